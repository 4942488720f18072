"""Records of 720 degrees from engines that share no code with the package: both engine kinds, fired or motored.

One zone of fresh and burned gas whose heat capacities follow from the vibrations of their molecules (Einstein 1907), a
crevice at wall temperature, blow-by through a choked gap, one of four wall-heat laws, Wiebe burns, a blow-down and
strokes with waves. Fuel, timing, duration and charge vary from cycle to cycle. By Runge-Kutta over all cycles at once.
"""

from dataclasses import dataclass, replace

import numpy as np

from mgdd.engine import Cylinder

Array = np.ndarray
LOWER_HEAT = {"diesel": 42.8, "spark": 43.4}  # MJ/kg
STOICHIOMETRIC = 14.6
GAS = {"diesel": 287.0, "spark": 281.0}  # J/(kg K): fuel vapour is heavy
LAWS = ("annand", "hohenberg", "woschni", "eichelberg")
# Vibrational temperatures [K] of what the charge consists of, with share of moles times degeneracy.
_FRESH = ((3390.0, 0.79), (2270.0, 0.21))
_BURNED = ((3390.0, 0.73), (960.0, 0.26), (1995.0, 0.13), (3380.0, 0.13), (2295.0, 0.14), (5330.0, 0.28))


@dataclass(frozen=True)
class Engine:
    """Geometry [m, -, CAD], speed [rpm], manifolds [bar, K], fuel [mg], burn [CAD, -], wall heat and leaks."""

    kind: str
    bore: float
    stroke: float
    rod: float
    ratio: float
    ivc: float
    evo: float
    speed: float
    intake_bar: float
    exhaust_bar: float
    intake_k: float
    fuel_mg: float
    soc: float
    duration: float
    shape: float  # of the Wiebe law; of a diesel that of its diffusion burn
    premixed: float  # share of a short first burn
    completeness: float
    law: str
    wall_scale: float
    wall_k: float
    crevice: float  # volume over that of clearance
    gap: float  # m2

    @property
    def swept(self) -> float:
        return 0.25 * np.pi * self.bore**2 * self.stroke

    @property
    def fuel_heat(self) -> float:
        """Heat of the injected fuel [J]."""
        return self.fuel_mg * LOWER_HEAT[self.kind]

    def volume(self, angle: Array) -> Array:
        crank = 0.5 * self.stroke
        phi = np.deg2rad(angle)
        reach = crank * np.cos(phi) + np.sqrt(self.rod**2 - (crank * np.sin(phi)) ** 2)
        return self.swept / (self.ratio - 1.0) + 0.25 * np.pi * self.bore**2 * (crank + self.rod - reach)

    def cylinder(self) -> Cylinder:
        """Say to the package what a user knows of the engine."""
        return Cylinder(
            bore_mm=1e3 * self.bore,
            stroke_mm=1e3 * self.stroke,
            connecting_rod_mm=1e3 * self.rod,
            compression_ratio=self.ratio,
            ivc_cad=self.ivc,
            evo_cad=self.evo,
            lower_heating_value_mj_per_kg=LOWER_HEAT[self.kind],
            burn_shape="double_wiebe" if self.kind == "diesel" else "wiebe",
        )


@dataclass(frozen=True)
class Record:
    """Angle [CAD], pressure [bar] (cycle, angle), and per cycle what the package is not told."""

    angle: Array
    bar: Array
    fuel_mg: Array
    wall_heat: Array  # J
    blow_by: Array  # of the charge


def draw(random: np.random.Generator, kind: str = "diesel", law: str = "annand") -> Engine:
    """Draw an engine from a small to a heavy one, or from a throttled to a boosted one."""
    spark = kind == "spark"
    bore = random.uniform(0.07, 0.095) if spark else random.uniform(0.078, 0.13)
    stroke = bore * (random.uniform(0.9, 1.15) if spark else random.uniform(1.0, 1.2))
    intake = random.uniform(0.45, 1.3) if spark else random.uniform(1.0, 2.6)
    intake_k = random.uniform(310.0, 350.0)
    air_mg = 0.88 * intake * 1e5 * 0.25 * np.pi * bore**2 * stroke / (287.0 * intake_k) * 1e6
    lambda_ = random.uniform(0.95, 1.1) if spark else random.uniform(1.4, 3.0)
    speed = random.uniform(1000.0, 4000.0) if spark else random.uniform(900.0, 2600.0) * 0.1 / bore
    # Spans that give 10 to 25 % of the fuel's heat to the walls by any of the laws.
    spans = {"annand": (0.22, 0.5), "hohenberg": (0.6, 1.4), "woschni": (0.6, 1.5), "eichelberg": (0.4, 1.1)}
    scale = random.uniform(*spans[law])
    return Engine(
        kind=kind, bore=bore, stroke=stroke, rod=stroke * random.uniform(1.5, 1.9),
        ratio=random.uniform(8.5, 12.5) if spark else random.uniform(14.5, 18.5),
        ivc=random.uniform(-150.0, -120.0), evo=random.uniform(115.0, 140.0), speed=speed,
        intake_bar=intake, exhaust_bar=(1.0 if spark else intake) * random.uniform(1.0, 1.2) + 0.05,
        intake_k=intake_k, fuel_mg=air_mg / (STOICHIOMETRIC * lambda_),
        soc=random.uniform(-30.0, -12.0) if spark else random.uniform(-8.0, 3.0),
        duration=random.uniform(45.0, 70.0) if spark else random.uniform(38.0, 65.0),
        shape=random.uniform(1.8, 2.6) if spark else random.uniform(0.7, 1.1),
        premixed=0.0 if spark else random.uniform(0.1, 0.35),
        completeness=random.uniform(0.93, 0.98) if spark else random.uniform(0.975, 0.995),
        law=law, wall_scale=scale, wall_k=random.uniform(400.0, 470.0),
        crevice=random.uniform(0.005, 0.018), gap=random.uniform(0.06, 0.25) * 1e-6 * (bore / 0.09) ** 2,
    )  # fmt: skip


def _vibration(parts: tuple[tuple[float, float], ...], t: Array) -> Array:
    out = np.zeros_like(t)
    for theta, share in parts:
        x = theta / t
        out += share * x * x * np.exp(-x) / (1.0 - np.exp(-x)) ** 2
    return out


def heat_capacity(kind: str, t: Array, burned: Array) -> Array:
    """Give cv over R of a charge of which a share is burned; fuel vapour and water turn more than air."""
    fresh = (2.8 + 2.5e-4 * (t - 300.0) if kind == "spark" else 2.5) + _vibration(_FRESH, t)
    return (1.0 - burned) * fresh + burned * (2.57 + _vibration(_BURNED, t))


def _wiebe(angle: float, start: Array, length: Array, shape: float) -> tuple[Array, Array]:
    share = np.clip((angle - start) / length, 0.0, None)
    left = np.exp(-6.9 * share ** (shape + 1.0))
    return 1.0 - left, 6.9 * (shape + 1.0) / length * share**shape * left


def _film(e: Engine, p: Array, t: Array, v: float, motored: Array) -> Array:
    """Give the heat transfer coefficient [W/(m2 K)] of the law, without its scale."""
    speed = 2.0 * e.stroke * e.speed / 60.0
    if e.law == "hohenberg":  # 1979, SAE 790825
        return 130.0 * v**-0.06 * (p * 1e-5) ** 0.8 * t**-0.4 * (speed + 1.4) ** 0.8
    if e.law == "eichelberg":  # 1939
        return 7.67 * speed ** (1.0 / 3.0) * np.sqrt(p * 1e-6 * t)
    if e.law == "woschni":  # 1967, SAE 670931, closed part
        p0, v0, t0 = e.intake_bar * 1e5, e.volume(np.array(e.ivc)), e.intake_k + 20.0
        gas = 2.28 * speed + 3.24e-3 * e.swept * t0 / (p0 * v0) * np.clip(p - motored, 0.0, None)
        return 3.26 * e.bore**-0.2 * (p * 1e-3) ** 0.8 * t**-0.55 * gas**0.8
    viscosity, conductivity = 1.85e-5 * (t / 300.0) ** 0.67, 0.0263 * (t / 300.0) ** 0.75
    reynolds = p / (GAS[e.kind] * t) * speed * e.bore / viscosity
    return conductivity / e.bore * reynolds**0.7  # Annand 1963


def closed_part(e: Engine, angle: Array, soc: Array, duration: Array, fuel_mg: Array, start_bar: Array):
    """Return pressure [bar] (cycle, angle) on even angles from IVC to EVO, wall heat [J], blow-by of the charge."""
    r, step = GAS[e.kind], float(angle[1] - angle[0])
    seconds = 1.0 / (6.0 * e.speed)
    clearance = e.swept / (e.ratio - 1.0)
    crevice = e.crevice * clearance
    t = np.full_like(start_bar, e.intake_k + 20.0)
    p_start = start_bar * 1e5
    v_start = float(e.volume(angle[0]))
    m = p_start / r * (v_start / t + crevice / e.wall_k)
    m_first = m.copy()
    residual = 0.06 if e.kind == "spark" else 0.03
    rich = np.clip(fuel_mg * 1e-6 * STOICHIOMETRIC / m, 0.0, 1.0)  # of the charge that burning turns into products
    radiation = {"diesel": 3.3e-8 * 0.5, "spark": 4.3e-9}[e.kind] if e.law == "annand" else 0.0

    def slope(at: float, t: Array, m: Array) -> tuple[Array, Array, Array, Array]:
        v, dv = (
            float(e.volume(np.array(at))),
            float(e.volume(np.array(at + 1e-3)) - e.volume(np.array(at - 1e-3))) / 2e-3,
        )
        first, first_rate = _wiebe(at, soc, 8.0 + 0.0 * duration, 1.2)
        second, second_rate = _wiebe(at, soc + (1.5 if e.premixed else 0.0), duration, e.shape)
        burned = e.premixed * first + (1.0 - e.premixed) * second
        rate = e.premixed * first_rate + (1.0 - e.premixed) * second_rate
        both = v / t + crevice / e.wall_k
        p = m * r / both
        area = 0.5 * np.pi * e.bore**2 * 1.1 + 4.0 * v / e.bore
        motored = p_start * (v_start / v) ** 1.33
        loss = e.wall_scale * _film(e, p, t, v, motored) * area * (t - e.wall_k) * seconds
        loss = loss + radiation * area * (t**4 - e.wall_k**4) * seconds
        leak = 0.62 * e.gap * p / np.sqrt(r * t) * seconds
        cv = r * heat_capacity(e.kind, t, np.clip(residual + rich * burned, 0.0, 1.0))
        inside = m - p * crevice / (r * e.wall_k)
        q = fuel_mg * LOWER_HEAT[e.kind] * e.completeness * rate - loss
        # dp = a + b dT; m cv dT = q - p dV - RT leak - carried dp: the crevice takes enthalpy
        a, b = p * (-leak / m - dv / t / both), p * (v / t**2) / both
        carried = crevice / (r * e.wall_k) * r * t
        dt = (q - p * dv - r * t * leak - carried * a) / (inside * cv + carried * b)
        back = crevice / (r * e.wall_k) * ((cv + r) * e.wall_k - cv * t)
        falling = a + b * dt < 0.0
        dt = np.where(falling, (q - p * dv - r * t * leak - back * a) / (inside * cv + back * b), dt)
        return dt, -leak, loss, p

    out = np.empty((start_bar.size, angle.size))
    wall = np.zeros_like(t)
    for k, at in enumerate(angle):
        t1, m1, _, p = slope(at, t, m)
        out[:, k] = p
        t2, m2, w2, _ = slope(at + 0.5 * step, t + 0.5 * step * t1, m + 0.5 * step * m1)
        t3, m3, _, _ = slope(at + 0.5 * step, t + 0.5 * step * t2, m + 0.5 * step * m2)
        t4, m4, _, _ = slope(at + step, t + step * t3, m + step * m3)
        t = t + step / 6.0 * (t1 + 2.0 * t2 + 2.0 * t3 + t4)
        m = m + step / 6.0 * (m1 + 2.0 * m2 + 2.0 * m3 + m4)
        wall += step * w2
    return out * 1e-5, wall, 1.0 - m / m_first


def work(e: Engine, soc: Array, step: float = 0.5) -> Array:
    """Return the work [J] between IVC and EVO of noise-free cycles with these starts of combustion [CAD]."""
    angle = np.arange(e.ivc, e.evo + 1e-9, step)
    one = np.ones_like(np.asarray(soc, dtype=float))
    bar, *_ = closed_part(e, angle, np.asarray(soc, dtype=float), e.duration * one, e.fuel_mg * one, e.intake_bar * one)
    return np.asarray(np.trapezoid(bar * 1e5, e.volume(angle), axis=1))


def best_soc(e: Engine) -> float:
    """Return the start of combustion [CAD] of the most work."""
    soc = np.arange(-60.0, 15.0, 1.0)
    best = int(np.argmax(w := work(e, soc)))
    if best in (0, soc.size - 1):
        return float(soc[best])
    a, b, c = w[best - 1 : best + 2]
    return float(soc[best] + 0.5 * (a - c) / (a - 2.0 * b + c))


def record(
    random: np.random.Generator, engine: Engine, cycles: int, *, step: float = 0.5, motored: bool = False,
    noise_bar: float = 0.03, scatter: float = 1.0, resolution_bar: float = 0.0,
) -> Record:  # fmt: skip
    """Draw a record; `scatter` scales what varies from cycle to cycle."""
    e = replace(engine, fuel_mg=0.0) if motored else engine
    angle = np.round(np.arange(-360.0, 360.0, step), 9)
    spark = e.kind == "spark"
    fuel = e.fuel_mg * random.normal(1.0, 0.01 * scatter, cycles)
    soc = e.soc + random.normal(0.0, (1.2 if spark else 0.3) * scatter, cycles)
    duration = e.duration * random.normal(1.0, (0.05 if spark else 0.02) * scatter, cycles)
    start = e.intake_bar * random.normal(1.0, 0.004 * scatter, cycles) * random.uniform(1.0, 1.04)
    first, last = (int(np.searchsorted(angle, edge)) for edge in (e.ivc, e.evo))
    closed, wall, blow_by = closed_part(e, angle[first : last + 1], soc, duration, fuel, start)
    out = np.empty((cycles, angle.size))
    out[:, first : last + 1] = closed
    late = angle[last + 1 :] - e.evo
    wave = 0.03 * e.exhaust_bar * np.sin(np.deg2rad(3.0 * late))
    out[:, last + 1 :] = e.exhaust_bar + wave + (closed[:, -1:] - e.exhaust_bar) * np.exp(-late / 18.0)
    early = angle[:first]
    wave = -0.06 * e.intake_bar * np.sin(np.deg2rad(0.9 * (early + 360.0)))
    closing = np.clip((early - (e.ivc - 40.0)) / 40.0, 0.0, 1.0)
    intake = (start[:, None] + wave) * (1.0 - closing) + closing * closed[:, :1]
    out[:, :first] = intake + (out[:, -1:] - intake) * np.exp(-(early + 360.0) / 15.0)
    out += random.normal(0.0, noise_bar, out.shape)
    if resolution_bar > 0.0:
        out = np.round(out / resolution_bar) * resolution_bar
    return Record(angle, out, fuel, wall, blow_by)
