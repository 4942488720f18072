"""Forty random independent throttles and the logs that a user would take of them."""

import math
from dataclasses import replace

import numpy as np

from independent_throttle import FAMILIES, SAMPLE_S, Bench, Body

_UNSURE = (
    "tau_s", "gain_deg_per_s2_per_duty", "beta_above_duty", "beta_below_duty", "kappa_above_duty_per_deg",
    "kappa_below_duty_per_deg", "delta_duty",
)  # fmt: skip
Log = tuple[np.ndarray, np.ndarray, np.ndarray]  # time [s], duty as commanded [-], measured angle [deg]


def draw_body(family: str, seed: int) -> Body:
    """Draw a throttle of a family: groups over the range of passenger-car bodies, back to physical numbers."""
    rng = np.random.default_rng([FAMILIES.index(family), seed])

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    tau, gain = between(0.012, 0.04), math.radians(between(4.5e4, 1.4e5))
    supply, resistance = 12.0, between(1.0, 2.5)
    constant = rng.uniform(0.5, 0.95) * supply / (gain * tau)  # share of back-EMF in all damping
    stall = constant * supply / resistance
    inertia = stall / gain
    coulomb = stall * between(0.03, 0.1)
    static = coulomb * {"stribeck": rng.uniform(1.15, 1.6), "lugre": rng.uniform(1.0, 1.4)}.get(family, 1.0)
    preload = static * rng.uniform(1.4, 2.2)
    spring = math.degrees(stall * between(2e-4, 2e-3))
    bristle = coulomb / math.radians(rng.uniform(0.05, 0.25))
    return Body(
        family=family,
        inertia_kgm2=inertia,
        motor_nm_per_a=constant,
        resistance_ohm=resistance,
        inductance_h=resistance * between(3e-4, 2e-3),
        supply_v=supply,
        viscous=inertia / tau - constant**2 / resistance,
        coulomb_nm=coulomb,
        static_nm=static,
        stribeck_rad_per_s=rng.uniform(0.15, 0.6),
        bristle_nm_per_rad=bristle,
        bristle_nms_per_rad=2.0 * rng.uniform(0.3, 0.7) * math.sqrt(bristle * inertia),
        half_gap_deg=rng.uniform(0.1, 0.3) if family == "backlash" else 0.0,
        spring_above=spring,
        spring_below=spring * rng.uniform(0.7, 2.0),
        preload_above=preload,
        preload_below=preload * rng.uniform(0.82, 1.25),
        ramp_deg=rng.uniform(0.1, 0.4),
        limp_home_deg=rng.uniform(6.0, 14.0),
        open_deg=rng.uniform(84.0, 90.0),
        delay_samples=seed % 4,
        noise_deg=rng.uniform(0.02, 0.05),
    )


class BodyPlate:
    """A body as a plant of one's own; its delay is the loop's."""

    def __init__(self, body: Body, angle_deg: float | None = None, *, milliseconds: int = 1) -> None:
        self._bench = Bench(replace(body, delay_samples=0), angle_deg=angle_deg)
        self._milliseconds = milliseconds

    @property
    def output(self) -> float:
        """Angle now [deg]."""
        return self._bench.angle_deg

    def step(self, duty: float) -> None:
        """Let a duty act for one sample."""
        for _ in range(self._milliseconds):
            self._bench.sample(duty)


def known_of(body: Body, seed: int, *, spread: float = 0.2) -> dict[str, float]:
    """Draw what a controller knows of a body: its groups, each within a share of the truth."""
    rng = np.random.default_rng([seed, 77])
    shares = {name: 1.0 + rng.uniform(-spread, spread) for name in _UNSURE}
    known = {name: value * shares.get(name, 1.0) for name, value in body.groups().items()}
    return known | {"ramp_deg": body.ramp_deg, "delay_samples": float(body.delay_samples)}


def forty_bodies() -> list[Body]:
    """Ten throttles of each family, with delays of 0 to 3 samples."""
    return [draw_body(family, seed) for family in FAMILIES for seed in range(10)]


def make_logs(body: Body, seed: int) -> tuple[Log, Log]:
    """Excitation (levels, then a chirp) and a fresh test log (other levels), each from rest after a release."""
    rng = np.random.default_rng([FAMILIES.index(body.family), seed, 1])
    chirp = _chirp(body, 4000)
    return (
        _record(body, np.concatenate([_levels(body, 4000, rng, (60, 160)), chirp]), rng),
        _record(body, _levels(body, 6000, rng, (100, 200)), rng),
    )


def _levels(body: Body, n: int, rng: np.random.Generator, hold: tuple[int, int]) -> np.ndarray:
    """Random duties about what holds the plate, one in five of them below limp-home."""
    g, slack = body.groups(), body.static_nm / body.stall_nm
    duty = np.empty(0)
    while duty.size < n:
        level = g["beta_above_duty"] + 35.0 * g["kappa_above_duty_per_deg"] + slack * rng.uniform(-2.2, 2.4)
        samples = int(rng.integers(*hold))
        if rng.uniform() < 0.2:  # longer, since the plate first has to close
            level, samples = -g["beta_below_duty"] - slack * rng.uniform(1.0, 2.5), 2 * samples
        duty = np.append(duty, np.full(samples, level))
    return duty[:n]


def _chirp(body: Body, n: int) -> np.ndarray:
    """0.3 to 6 Hz about what holds the plate at 35 degrees above limp-home."""
    g, t = body.groups(), SAMPLE_S * np.arange(n)
    phase = 2.0 * np.pi * (0.3 * t + 0.5 * (6.0 - 0.3) / t[-1] * t**2)
    hold = g["beta_above_duty"] + 35.0 * g["kappa_above_duty_per_deg"]
    return np.asarray(hold + 2.2 * body.static_nm / body.stall_nm * np.sin(phase))


def _record(body: Body, wave: np.ndarray, rng: np.random.Generator) -> Log:
    """Release from 20 degrees above limp-home, 0.3 s at rest, then the wave, pulled slowly towards the middle."""
    bench = Bench(body, angle_deg=body.limp_home_deg + 20.0)
    for _ in range(1500):
        bench.sample(0.0)
    duty, angle = np.zeros(300 + wave.size), np.empty(300 + wave.size)
    for k in range(duty.size):
        noisy = bench.angle_deg + rng.normal(0.0, body.noise_deg)
        angle[k] = body.converter_deg * round(noisy / body.converter_deg)
        if k >= 300:
            pull = 0.002 * (body.limp_home_deg + 30.0 - angle[k]) if wave[k - 300] > 0.0 else 0.0
            duty[k] = min(max(wave[k - 300] + pull, -1.0), 1.0)
        bench.sample(float(duty[k]))
    return SAMPLE_S * np.arange(duty.size), duty, angle
