"""Objectives on the measured hydrogen-diesel engine, and a seeker for each that is tuned to what was measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import datasets
from mgdd.engine import Cylinder, OperatingPoint
from mgdd.errors import ConvergenceError, DataError
from mgdd.guide import Curve, ModelOptimum
from mgdd.optimize import ComponentLag, ExtremumSeeking, GoldenSection, Limit, Seeker, Spsa, tune
from mgdd.optimize.optimum import Optimum
from mgdd.optimize.tuning import Tuning
from mgdd_studies.measured_engine import EngineSurrogate, SurrogatePlant

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = [
    "ARRIVAL_CAD", "LOWER_CAD", "OBJECTIVES", "START_CAD", "UPPER_CAD", "Case", "Objective", "drawn_curve",
    "held_objective", "lag_of", "measured_guide", "measured_records", "seeker_of", "tuned_case",
]  # fmt: skip

_MPRR_LIMIT = 5.0
_NOX_WEIGHT = 0.001  # bar per ppm; its optimum lies well inside the records
START_CAD, LOWER_CAD, UPPER_CAD = 8.0, -9.0, 11.0  # the bounds leave the records by one or two degrees
ARRIVAL_CAD = 1.0  # distance to the optimum that counts as arrived
_AMPLITUDE_CAD = 2.0
_WISHED_CYCLES = 400.0
_HOLD_CYCLES, _HOLD_SEED = 4000, 10_000  # of the noise measurement, apart from all seeds of the runs
_SEEKERS = ("batch", "spsa", "golden")


@dataclass(frozen=True, kw_only=True)
class Objective:
    """What is maximised: signals by weight, their limits, and whether the seekers know of the lag."""

    name: str
    weights: Mapping[str, float]
    limits: Mapping[str, float] = field(default_factory=dict)
    compensated: bool = False
    seekers: tuple[str, ...] = _SEEKERS


_BOTH = {"imep_bar": 1.0, "nox_ppm": -_NOX_WEIGHT}
OBJECTIVES = (
    Objective(name="IMEP, pressure rise ≤ 5", weights={"imep_bar": 1.0}, limits={"mprr": _MPRR_LIMIT}),
    Objective(name="IMEP − 0.001 NOx, lag known", weights=_BOTH, compensated=True, seekers=("batch",)),
    Objective(name="IMEP − 0.001 NOx, lag ignored", weights=_BOTH),
)


@dataclass(frozen=True, kw_only=True)
class Case:
    """One seeker on one objective, tuned."""

    objective: Objective
    seeker: str
    best: Optimum
    free: Optimum
    curvature: float
    tuning: Tuning
    noise_sd: float
    lags: tuple[ComponentLag, ...]


def measured_records(study: str) -> xr.Dataset:
    """Load the records of the hydrogen-diesel engine; DataError where they are not at hand."""
    try:
        return datasets.read("h2df_502")
    except FileNotFoundError as error:
        raise DataError(
            f"the study {study} needs the records of the hydrogen-diesel engine: {error.strerror}; the page "
            "'A measured engine' says where they come from"
        ) from error


def lag_of(surrogate: EngineSurrogate, name: str) -> ComponentLag:
    """Return what stands between the command and a signal beyond the lag of the fastest one."""
    signal = surrogate.signals[name]
    first = min(model.lag_cycles for model in surrogate.signals.values())
    tau = signal.sensor.tau_cycles if signal.sensor is not None else 0.0
    return ComponentLag(delay_cycles=float(signal.lag_cycles - first), lag_cycles=tau)


def tuned_case(surrogate: EngineSurrogate, objective: Objective, seeker: str, held: NDArray[np.float64]) -> Case:
    """Tune a seeker by the curvature of the surface and by the noise of J held at the start, `held`."""
    best = surrogate.find_optimum(objective.weights, objective.limits)
    free = surrogate.find_optimum(objective.weights)
    around = surrogate.predict(free["soi_cad"] + np.array([-0.5, 0.0, 0.5]))
    j = np.sum([weight * around[name].to_numpy() for name, weight in objective.weights.items()], axis=0)
    curvature = float(j[0] - 2.0 * j[1] + j[2]) / 0.25
    lags = tuple(lag_of(surrogate, name) for name in objective.weights) if objective.compensated else ()
    if seeker in ("spsa", "golden"):
        noise = float(np.std(np.diff(held))) / math.sqrt(2.0)
        tuning = _tuned(noise, curvature, best, ComponentLag(), "spsa")
    else:
        late = max(lags, key=lambda lag: lag.delay_cycles + lag.lag_cycles, default=ComponentLag())
        period = _tuned(1.0, curvature, best, late, "batch").period
        noise = noise_at(held, period)
        tuning = _tuned(noise, curvature, best, late, "batch")
    return Case(
        objective=objective, seeker=seeker, best=best, free=free, curvature=curvature, tuning=tuning, noise_sd=noise,
        lags=lags,
    )  # fmt: skip


def _tuned(noise: float, curvature: float, best: Optimum, lag: ComponentLag, method: str) -> Tuning:
    return tune(
        noise, curvature, method=method, delay_cycles=lag.delay_cycles, lag_cycles=lag.lag_cycles,
        cycles=_WISHED_CYCLES, distance=abs(START_CAD - best["soi_cad"]), arrival=ARRIVAL_CAD,
        amplitude_max=_AMPLITUDE_CAD,
    )  # fmt: skip


def held_objective(surrogate: EngineSurrogate, objective: Objective) -> NDArray[np.float64]:
    """Measure J while the timing is held at the start."""
    engine = SurrogatePlant(surrogate, start_soi_cad=START_CAD, seed=_HOLD_SEED)
    rows = [engine.step(START_CAD) for _ in range(_HOLD_CYCLES)]
    return np.array([sum(w * row[name] for name, w in objective.weights.items()) for row in rows])


def noise_at(held: NDArray[np.float64], period: int) -> float:
    """Return the white noise that would disturb a dither of this period as much as the measured one does."""
    windows = held[: held.size // period * period].reshape(-1, period)
    wave = np.exp(2j * np.pi * np.arange(period) / period)
    return float(np.sqrt(np.mean(np.abs(windows @ wave) ** 2) / period))


def seeker_of(case: Case, seed: int) -> Seeker:
    """Make the seeker of a case; `seed` is that of SPSA."""
    space: dict[str, Any] = {"start": START_CAD, "bounds": (LOWER_CAD, UPPER_CAD)}
    # Judged by the optimum at the limit itself: a margin for the scatter of single cycles would be 3.5 °CA of timing.
    space["limits"] = [Limit(name, upper, margin_sd=0.0) for name, upper in case.objective.limits.items()]
    t, components = case.tuning, list(case.lags) or None
    if case.seeker == "batch":
        return ExtremumSeeking(
            **space, amplitude=t.amplitude, period=t.period, gain=t.gain, rate=t.rate, components=components
        )
    if case.seeker == "spsa":
        return Spsa(**space, schedule="constant", gain=t.gain, perturbation=t.amplitude, step_max=t.rate, seed=seed)
    return GoldenSection(**space, noise_sd=case.noise_sd)


# 4.5 L of four cylinders; bore and stroke are those of engines of this size, the compression ratio is a usual one.
_CYLINDER = Cylinder(bore_mm=107.0, stroke_mm=124.0, connecting_rod_mm=192.0, compression_ratio=17.3)
_TEN_TO_NINETY = 1.0 - math.sqrt(0.2)  # of the duration of a symmetric triangle
_BOUNDS_CAD, _NODES = (-30.0, 15.0), 121


@dataclass(frozen=True, kw_only=True)
class MeasuredGuide:
    """What the model says over the injection [°CA aTDC]."""

    curve: Curve  # IMEP [bar]
    pressure_rise: Curve  # the largest [bar/°CA]
    bar_per_point: float  # IMEP of a point of efficiency [bar]


def measured_guide(records: xr.Dataset) -> MeasuredGuide:
    """Draw IMEP and pressure rise over injection by the cycle model."""
    middle = {
        name: float(records[name].median())
        for name in ("speed_rpm", "soi_cad", "mfb10_cad", "mfb50_cad", "mfb90_cad", "diesel_energy_kj", "h2_energy_kj")
    }
    energy_kj = middle["diesel_energy_kj"] + middle["h2_energy_kj"]
    duration = (middle["mfb90_cad"] - middle["mfb10_cad"]) / _TEN_TO_NINETY
    point = OperatingPoint(
        speed_rpm=middle["speed_rpm"],
        fuel_mg=energy_kj * 1e3 / _CYLINDER.lower_heating_value_mj_per_kg,
        burn_duration_cad=duration,
    )
    from_soc_to_soi = middle["soi_cad"] - (middle["mfb50_cad"] - 0.5 * duration)
    model = ModelOptimum(_CYLINDER, bounds_cad=_BOUNDS_CAD)
    drawn, rises = drawn_curve(model, point), model.limit_curves(point, ["dp_max_bar_per_cad"])
    if rises is None:
        raise ConvergenceError(f"the guide has no pressure rise at {point}")
    displacement_m3 = 0.25 * math.pi * _CYLINDER.bore_mm**2 * _CYLINDER.stroke_mm * 1e-9
    bar_per_point = 0.01 * energy_kj * 1e3 / displacement_m3 * 1e-5
    soc = np.linspace(drawn.lower, drawn.upper, _NODES)
    return MeasuredGuide(
        curve=Curve(soc + from_soc_to_soi, bar_per_point * np.asarray(drawn(soc))),
        pressure_rise=Curve(soc + from_soc_to_soi, np.asarray(rises[0](soc))),
        bar_per_point=bar_per_point,
    )


def drawn_curve(model: ModelOptimum, point: OperatingPoint) -> Curve:
    """Draw J of a model over SOC; ConvergenceError where it has no cycle."""
    curve = model.curve(point)
    if curve is None:
        raise ConvergenceError(f"the guide has no cycle at {point}")
    return curve
