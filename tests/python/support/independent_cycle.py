"""Records of 720 degrees from an engine that shares no code with the package: other gas, burn and wall heat.

A single zone with gamma falling with temperature, two Wiebe burns, Hohenberg's wall heat (1979, SAE 790825), a smooth
blow-down and strokes with waves; fuel, timing and charge vary from cycle to cycle. By Runge-Kutta over all cycles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mgdd.engine import Cylinder

Array = np.ndarray
R = 287.0
LOWER_HEAT = 42.8  # MJ/kg


@dataclass(frozen=True)
class Engine:
    """Geometry [m, -, CAD], speed [rpm], manifolds [bar, K] and fuel [mg]."""

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

    @property
    def swept(self) -> float:
        return 0.25 * np.pi * self.bore**2 * self.stroke

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
            lower_heating_value_mj_per_kg=LOWER_HEAT,
        )


def draw(random: np.random.Generator) -> Engine:
    """Draw a diesel from a small to a heavy one."""
    bore = random.uniform(0.078, 0.13)
    stroke = bore * random.uniform(1.0, 1.2)
    intake = random.uniform(1.0, 2.6)
    swept = 0.25 * np.pi * bore**2 * stroke
    air_mg = 0.9 * intake * 1e5 * swept / (R * 320.0) * 1e6
    return Engine(
        bore, stroke, stroke * random.uniform(1.5, 1.9), random.uniform(14.5, 18.0),
        random.uniform(-150.0, -125.0), random.uniform(110.0, 135.0), random.uniform(900.0, 2600.0) * 0.1 / bore,
        intake, intake * random.uniform(0.95, 1.3) + 0.1, random.uniform(310.0, 350.0),
        air_mg / random.uniform(20.0, 45.0), random.uniform(-6.0, 3.0),
    )  # fmt: skip


def gamma(temperature: Array) -> Array:
    return np.clip(1.392 - 8.0e-5 * (temperature - 300.0), 1.24, 1.40)


def wiebe(angle: float, start: Array, length: float, shape: float) -> Array:
    share = np.clip((angle - start) / length, 0.0, None)
    return 6.9 * (shape + 1.0) / length * share**shape * np.exp(-6.9 * share ** (shape + 1.0))


def record(random: np.random.Generator, engine: Engine, cycles: int, *, step: float = 0.5, motored: bool = False):
    """Return the angle [CAD], the pressure [bar] (cycle, angle) and the fuel of each cycle [mg]."""
    angle = np.arange(-360.0, 360.0, step)
    fuel = 0.0 if motored else engine.fuel_mg
    fuel = fuel * random.normal(1.0, 0.015, cycles)
    soc = engine.soc + random.normal(0.0, 0.3, cycles)
    start = engine.intake_bar * random.normal(1.0, 0.004, cycles)
    first, last = (int(np.searchsorted(angle, edge)) for edge in (engine.ivc, engine.evo))
    volume = engine.volume(angle)
    p = start * 1e5 * random.uniform(1.0, 1.04)
    mass = p * volume[first] / (R * engine.intake_k)
    diffusion = random.uniform(28.0, 45.0)

    def slope(at: float, pressure: Array) -> Array:
        v, dv = engine.volume(at), (engine.volume(at + 1e-3) - engine.volume(at - 1e-3)) / 2e-3
        t = pressure * v / (mass * R)
        g = gamma(t)
        burn = 0.25 * wiebe(at, soc, 8.0, 1.2) + 0.75 * wiebe(at, soc + 1.5, diffusion, 0.9)
        piston = 2.0 * engine.stroke * engine.speed / 60.0
        film = 130.0 * v**-0.06 * (pressure * 1e-5) ** 0.8 * t**-0.4 * (piston + 1.4) ** 0.8
        area = 0.5 * np.pi * engine.bore**2 * 1.15 + 4.0 * v / engine.bore
        loss = 0.6 * film * area * (t - 440.0) / (6.0 * engine.speed)
        heat = fuel * LOWER_HEAT * burn - loss
        return ((g - 1.0) * heat - g * pressure * dv) / v

    out = np.empty((cycles, angle.size))
    for k in range(first, last + 1):
        out[:, k] = p
        a = slope(angle[k], p)
        b = slope(angle[k] + 0.5 * step, p + 0.5 * step * a)
        c = slope(angle[k] + 0.5 * step, p + 0.5 * step * b)
        p = p + step / 6.0 * (a + 2.0 * b + 2.0 * c + slope(angle[k] + step, p + step * c))
    late = angle[last + 1 :] - engine.evo
    wave = 0.03 * engine.exhaust_bar * np.sin(np.deg2rad(3.0 * late))
    exhaust = engine.exhaust_bar + wave + (out[:, last, None] / 1e5 - engine.exhaust_bar) * np.exp(-late / 18.0)
    out[:, last + 1 :] = exhaust * 1e5
    early = angle[:first]
    blend = np.exp(-(early + 360.0) / 15.0)
    wave = -0.06 * engine.intake_bar * np.sin(np.deg2rad(0.9 * (early + 360.0)))
    settled = start[:, None] + wave
    closing = np.clip((early - (engine.ivc - 40.0)) / 40.0, 0.0, 1.0)
    intake = settled * (1.0 - closing) + closing * out[:, first, None] / 1e5
    out[:, :first] = 1e5 * (intake + (out[:, -1, None] / 1e5 - intake) * blend)
    bar = out / 1e5 + random.normal(0.0, 0.015, out.shape)
    return angle, bar, fuel
