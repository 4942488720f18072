"""A throttle that shares no code with the package: what an identification is tried on.

One motor (voltage, inductance, back-EMF) drives a plate with two preloaded limp-home springs between compliant stops,
with Coulomb, Stribeck or LuGre friction, or as two masses with a gap between them. Units are SI and radians inside,
degrees and duty outside. Integration: Strang splitting of 50 us, drift - current - kick - current - drift, with the
current exact for a held speed; dry friction stops a mass that would turn around within a step.

Sources: LuGre friction by Canudas de Wit et al. (1995), the Stribeck curve by Armstrong-Helouvry et al. (1994).
"""

import math
from dataclasses import dataclass

FAMILIES = ("coulomb", "stribeck", "lugre", "backlash")
SAMPLE_S = 1e-3


@dataclass(frozen=True, kw_only=True)
class Body:
    """A throttle as its maker would state it; torques and inertia at the plate shaft."""

    family: str = "coulomb"
    inertia_kgm2: float = 0.0021
    motor_nm_per_a: float = 0.383  # and V s/rad
    resistance_ohm: float = 1.5
    inductance_h: float = 1.5e-3
    supply_v: float = 12.0
    viscous: float = 0.0088  # N m s/rad, back-EMF not included
    coulomb_nm: float = 0.284
    static_nm: float = 0.284
    stribeck_rad_per_s: float = 0.3
    bristle_nm_per_rad: float = 80.0
    bristle_nms_per_rad: float = 0.4
    half_gap_deg: float = 0.0
    gear_nm_per_rad: float = 200.0
    gear_nms_per_rad: float = 0.2
    motor_inertia_share: float = 0.86
    motor_friction_share: float = 0.7
    spring_above: float = 0.087  # N m/rad
    spring_below: float = 0.15
    preload_above: float = 0.396  # N m
    preload_below: float = 0.45
    ramp_deg: float = 0.25  # half width over which the preload turns
    limp_home_deg: float = 8.0
    closed_deg: float = 0.0
    open_deg: float = 88.0
    stop_nm_per_rad: float = 5000.0
    stop_nms_per_rad: float = 4.5
    delay_samples: int = 0
    noise_deg: float = 0.03
    converter_deg: float = 90.0 / 4096.0

    @property
    def stall_nm(self) -> float:
        """Torque of the resting motor at full duty."""
        return self.motor_nm_per_a * self.supply_v / self.resistance_ohm

    def groups(self) -> dict[str, float]:
        """What duty and angle determine, under the names of the package's first-principle fit."""
        damping = self.viscous + self.motor_nm_per_a**2 / self.resistance_ohm
        return {
            "tau_s": self.inertia_kgm2 / damping,
            "gain_deg_per_s2_per_duty": math.degrees(self.stall_nm / self.inertia_kgm2),
            "beta_above_duty": self.preload_above / self.stall_nm,
            "kappa_above_duty_per_deg": math.radians(self.spring_above) / self.stall_nm,
            "delta_duty": self.coulomb_nm / self.stall_nm,
            "beta_below_duty": self.preload_below / self.stall_nm,
            "kappa_below_duty_per_deg": math.radians(self.spring_below) / self.stall_nm,
            "limp_home_deg": self.limp_home_deg,
            "electrical_s": self.inductance_h / self.resistance_ohm,
        }


class Bench:
    """A body in motion: one `sample` per millisecond."""

    def __init__(
        self,
        body: Body,
        *,
        angle_deg: float | None = None,
        speed_rad_per_s: float = 0.0,
        duty: float = 0.0,
        substeps: int = 20,
    ) -> None:
        self.body = body
        self.plate_rad = math.radians(body.limp_home_deg if angle_deg is None else angle_deg)
        self.speed_rad_per_s = self.motor_speed = speed_rad_per_s
        self.current_a = duty * body.supply_v / body.resistance_ohm
        self.bristle_rad = 0.0
        self._waiting = [duty] * body.delay_samples
        self._substeps = substeps
        self._h = SAMPLE_S / substeps
        self._settle = 1.0
        if body.inductance_h > 0.0:
            self._settle = -math.expm1(-0.5 * self._h * body.resistance_ohm / body.inductance_h)
        self._advance = self._two_masses if body.half_gap_deg > 0.0 else self._one_mass
        self.motor_rad = self.plate_rad
        if body.half_gap_deg > 0.0:  # the held duty presses one flank, with what plate friction leaves
            torque = self._load(self.plate_rad)
            gap = math.radians(body.half_gap_deg) + abs(torque) / body.gear_nm_per_rad
            self.motor_rad += math.copysign(gap, torque) if torque != 0.0 else 0.0

    @property
    def angle_deg(self) -> float:
        return math.degrees(self.plate_rad)

    @property
    def lead_deg(self) -> float:
        """How far the motor is ahead of the plate."""
        return math.degrees(self.motor_rad - self.plate_rad)

    def sample(self, duty: float) -> float:
        """Return the true angle [deg] at which the sample begins, then let the oldest waiting duty act for 1 ms."""
        angle = self.angle_deg
        self._waiting.append(duty)
        volt = self.body.supply_v * min(max(self._waiting.pop(0), -1.0), 1.0)
        for _ in range(self._substeps):
            self._advance(volt)
        return angle

    def energy_j(self) -> float:
        """Kinetic, magnetic and stored in springs, stops, bristles and gear."""
        b = self.body
        motor_share = b.motor_inertia_share if b.half_gap_deg > 0.0 else 0.0
        x = abs(self.plate_rad - math.radians(b.limp_home_deg))
        above = self.plate_rad >= math.radians(b.limp_home_deg)
        spring, preload = (b.spring_above, b.preload_above) if above else (b.spring_below, b.preload_below)
        ramp = math.radians(b.ramp_deg)
        stored = 0.5 * spring * x * x + preload * (0.5 * x * x / ramp if x < ramp else x - 0.5 * ramp)
        beyond = max(self.plate_rad - math.radians(b.open_deg), math.radians(b.closed_deg) - self.plate_rad, 0.0)
        stored += 0.5 * b.stop_nm_per_rad * beyond**2
        bent = max(abs(self.motor_rad - self.plate_rad) - math.radians(b.half_gap_deg), 0.0) if motor_share else 0.0
        stored += 0.5 * b.gear_nm_per_rad * bent**2
        if b.family == "lugre":
            stored += 0.5 * b.bristle_nm_per_rad * self.bristle_rad**2
        moving = (1.0 - motor_share) * self.speed_rad_per_s**2 + motor_share * self.motor_speed**2
        return stored + 0.5 * b.inertia_kgm2 * moving + 0.5 * b.inductance_h * self.current_a**2

    def _load(self, angle: float) -> float:
        """Torque of springs and stops that resists opening, without the stop's damping."""
        b = self.body
        x = angle - math.radians(b.limp_home_deg)
        spring, preload = (b.spring_above, b.preload_above) if x >= 0.0 else (b.spring_below, b.preload_below)
        torque = spring * x + preload * min(max(x / math.radians(b.ramp_deg), -1.0), 1.0)
        above = angle - math.radians(b.open_deg)
        below = angle - math.radians(b.closed_deg)
        return torque + b.stop_nm_per_rad * (max(above, 0.0) + min(below, 0.0))

    def _stop_damping(self, angle: float, speed: float) -> float:
        """Torque of the stop's damper; a stop does not pull."""
        b = self.body
        above, below = angle - math.radians(b.open_deg), angle - math.radians(b.closed_deg)
        if above > 0.0:
            return max(b.stop_nms_per_rad * speed, -b.stop_nm_per_rad * above)
        if below < 0.0:
            return min(b.stop_nms_per_rad * speed, -b.stop_nm_per_rad * below)
        return 0.0

    def _drive(self, volt: float, speed: float) -> None:
        """Half a step of the current at a held speed."""
        b = self.body
        end = (volt - b.motor_nm_per_a * speed) / b.resistance_ohm
        self.current_a += self._settle * (end - self.current_a)

    def _level(self, speed: float) -> float:
        """Sliding friction at a speed [N m]."""
        b = self.body
        if b.static_nm == b.coulomb_nm:
            return b.coulomb_nm
        return b.coulomb_nm + (b.static_nm - b.coulomb_nm) * math.exp(-((speed / b.stribeck_rad_per_s) ** 2))

    def _bend(self, speed: float) -> None:
        """Half a step of the bristles at a held speed."""
        if speed != 0.0:
            end = math.copysign(self._level(speed) / self.body.bristle_nm_per_rad, speed)
            self.bristle_rad += (end - self.bristle_rad) * -math.expm1(-0.5 * self._h * speed / end)

    def _one_mass(self, volt: float) -> None:
        b, h, speed = self.body, self._h, self.speed_rad_per_s
        angle = self.plate_rad + 0.5 * h * speed
        self._drive(volt, speed)
        push = b.motor_nm_per_a * self.current_a - self._load(angle) - self._stop_damping(angle, speed)
        if b.family == "lugre":
            self._bend(speed)
            z = self.bristle_rad
            rate = speed - b.bristle_nm_per_rad * abs(speed) * z / self._level(speed)
            push -= b.bristle_nm_per_rad * z + b.bristle_nms_per_rad * rate
            after = _kick(speed, push, 0.0, 0.0, b.viscous, h / b.inertia_kgm2)
            self._bend(after)
        else:
            after = _kick(speed, push, self._level(speed), b.static_nm, b.viscous, h / b.inertia_kgm2)
        self._drive(volt, after)
        self.speed_rad_per_s = self.motor_speed = after
        self.plate_rad = self.motor_rad = angle + 0.5 * h * after

    def _two_masses(self, volt: float) -> None:
        b, h, plate, motor = self.body, self._h, self.speed_rad_per_s, self.motor_speed
        angle, shaft = self.plate_rad + 0.5 * h * plate, self.motor_rad + 0.5 * h * motor
        self._drive(volt, motor)
        lead, gap = shaft - angle, math.radians(b.half_gap_deg)
        gear = 0.0  # teeth do not pull
        if lead > gap:
            gear = max(b.gear_nm_per_rad * (lead - gap) + b.gear_nms_per_rad * (motor - plate), 0.0)
        elif lead < -gap:
            gear = min(b.gear_nm_per_rad * (lead + gap) + b.gear_nms_per_rad * (motor - plate), 0.0)
        ours, theirs = b.motor_friction_share, 1.0 - b.motor_friction_share
        heavy, light = b.motor_inertia_share * b.inertia_kgm2, (1.0 - b.motor_inertia_share) * b.inertia_kgm2
        push = b.motor_nm_per_a * self.current_a - gear
        pull = gear - self._load(angle) - self._stop_damping(angle, plate)
        self.motor_speed = _kick(motor, push, ours * b.coulomb_nm, ours * b.static_nm, ours * b.viscous, h / heavy)
        self.speed_rad_per_s = _kick(
            plate, pull, theirs * b.coulomb_nm, theirs * b.static_nm, theirs * b.viscous, h / light
        )
        self._drive(volt, self.motor_speed)
        self.plate_rad = angle + 0.5 * h * self.speed_rad_per_s
        self.motor_rad = shaft + 0.5 * h * self.motor_speed


def _kick(speed: float, push: float, sliding: float, static: float, damping: float, over_inertia: float) -> float:
    """Speed after a torque, viscous and set-valued dry friction; over_inertia is the step over the inertia."""
    if speed == 0.0:
        if abs(push) <= static:
            return 0.0
        way = math.copysign(1.0, push)
    else:
        way = math.copysign(1.0, speed)
    half = 0.5 * damping * over_inertia
    after = ((1.0 - half) * speed + over_inertia * (push - way * sliding)) / (1.0 + half)
    return after if after * way > 0.0 or sliding == 0.0 else 0.0
