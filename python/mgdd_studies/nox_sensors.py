"""What a soft NOx sensor is good for: its map, its steady error, and its speed beside an analyser."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import plot, presets
from mgdd.engine import NoxModel, NoxProxy, OperatingPoint, SoftSensor, fit_nox_proxy, ignition_delay
from mgdd.loop import SensorDynamics, VirtualEngine
from mgdd.plot.style import new_figure
from mgdd.results.labels import VARIABLES, labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import grey_band
from mgdd_studies.statistics import with_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_nox_sensors"]

SOI_CAD = np.array([-26.0, -23.0, -20.0, -17.0, -14.0, -11.0, -8.0, -5.0, -2.0, 1.0, 4.0])
# A proxy as it may come from another engine: 25 % too low and too flat.
WRONG = SoftSensor(model=NoxModel(proxy=NoxProxy(reference_nox_ppm=900.0, activation_temperature_k=13000.0)))
SETTLE, STEADY, STEP_AT, AFTER = 800, 200, 1500, 1500
_SENSORS = ("analyser", "fast", "soft", "soft_corrected")
_NAMES = {
    "analyser": "analyser",
    "fast": "fast sensor",
    "soft": "soft sensor, wrong proxy",
    "soft_corrected": "soft sensor, wrong proxy held to the analyser",
    "soft_fitted": "soft sensor, fitted proxy",
}
_EARLY_CAD, _LATE_CAD, _LOW_MG, _HIGH_MG = -12.0, -5.0, 12.0, 30.0
_STEPS = ("timing step", "load step")
_QUIET: dict[str, Any] = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}


@dataclass(frozen=True, kw_only=True)
class _Sweep:
    """Steady readings over seed and SOI [ppm], by sensor, their scatter from cycle to cycle, and what was fitted."""

    soc_cad: NDArray[np.float64]
    t_max_k: NDArray[np.float64]
    nox_ppm: dict[str, NDArray[np.float64]]
    scatter: dict[str, float]
    fits: list[dict[str, Any]]
    proxies: dict[str, NoxProxy]


def run_nox_sensors(
    *, n_seeds: int = 20, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Compare a NOx analyser, a fast sensor and soft sensors, steady and in transients.

    The soft sensor maps the maximum gas temperature of the cycle to NOx. Its proxy is wrong on purpose (900 ppm at
    1900 K where the bench has 1200, and too flat); it is shown as it is, held to the analyser, and with a proxy fitted
    to the analyser over a sweep of injection timing. True NOx of the bench is an Arrhenius map of the same temperature:
    a correlation, not kinetics.

    Parameters
    ----------
    n_seeds : int
        Repetitions of the sweep and of the start of the correction.
    quick : bool
        At most three seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``sensor steady_error_percent worst_error_percent scatter_percent timing_step_t90_cycles timing_step_t90_s
        load_step_t90_cycles load_step_t90_s``: rms and largest error of the steady means over the sweep, scatter about
        the true value from cycle to cycle, and the time to 90 % of a sensor's own answer to a step without noise.
        ``summary`` holds the sweep, the two fits and the course of the correction.

    References
    ----------
    Tan (2018), section 4.3; the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.nox_sensors import run_nox_sensors
    >>> rows = run_nox_sensors(n_seeds=1, quick=True, figures=False).summary["rows"]
    >>> {row["sensor"]: row["timing_step_t90_cycles"] for row in rows}["soft sensor, fitted proxy"]
    0
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=3)
    work = Parts(progress)
    (sweep,) = work([("sweep of injection timing", partial(_sweep, n_seeds))])
    proxy = sweep.proxies["affine_log"]
    moves = work((name, partial(_step, name, proxy)) for name in _STEPS)
    course = work([("correction of a wrong proxy", partial(_correction, n_seeds))])
    return work.finish(
        "nox-sensors", _dataset(sweep, [noisy for _, noisy in moves], course), _draw if figures else None,
        seeds=n_seeds,
        rows=[_row(sensor, sweep, [quiet for quiet, _ in moves]) for sensor in _NAMES],
        sweep=_sweep_rows(sweep),
        fits=sweep.fits,
        correction=[_course_row(own) for own in course],
    )  # fmt: skip


def _sweep(n_seeds: int) -> _Sweep:
    preset = presets.load("puma_single")
    soc = np.array([ignition_delay(preset.cylinder, preset.point, soi_cad=soi).soc_cad for soi in SOI_CAD])
    names = ("true", *_SENSORS)
    means = {name: np.empty((n_seeds, soc.size)) for name in names}
    temperature = np.empty((n_seeds, soc.size))
    deviation: dict[str, list[float]] = {name: [] for name in names}
    for seed in range(n_seeds):
        for place, timing in enumerate(soc):
            bench = VirtualEngine(soft_sensor=WRONG, seed=seed * soc.size + place)
            tail = bench.run(np.full(SETTLE + STEADY, timing)).isel(cycle=slice(SETTLE, None))
            temperature[seed, place] = float(tail["t_max_k"].mean())
            for name in names:
                ratio = np.log(tail[f"nox_{name}_ppm"] / tail["nox_true_ppm"])
                deviation[name].append(float(ratio.std(ddof=1)))
                means[name][seed, place] = float(tail[f"nox_{name}_ppm"].mean())
    t_max, measured = temperature.mean(axis=0), means["analyser"].mean(axis=0)
    fits = {name: fit_nox_proxy(t_max, measured, map=name) for name in ("affine_log", "arrhenius")}
    means["soft_fitted"] = fits["affine_log"].proxy.affine_log_ppm(temperature.ravel()).reshape(temperature.shape)
    scatter = {name: 100.0 * float(np.mean(values)) for name, values in deviation.items()}
    return _Sweep(
        soc_cad=soc, t_max_k=t_max, nox_ppm=means, scatter=scatter,
        fits=[_fit_row(name, fit) for name, fit in fits.items()],
        proxies={name: fit.proxy for name, fit in fits.items()},
    )  # fmt: skip


def _step(name: str, fitted: NoxProxy) -> tuple[dict[str, NDArray[np.float64]], xr.Dataset]:
    """Run a step without noise, for the times, and with it, for the eye; the fitted sensor joins both."""
    low, high = OperatingPoint(fuel_mg=_LOW_MG), OperatingPoint(fuel_mg=_HIGH_MG)
    load = name == "load step"
    schedule = [(0, low), (STEP_AT, high)] if load else [(0, OperatingPoint())]
    soc = np.full(STEP_AT + AFTER, _LATE_CAD)
    if not load:
        soc[STEP_AT:] = _EARLY_CAD
    silent: dict[str, Any] = {
        "analyser": SensorDynamics(delay_s=3.0, lag_s=2.0, noise_fraction=0.0),
        "fast_sensor": SensorDynamics(delay_s=0.05, lag_s=0.05, noise_fraction=0.0),
    }
    still = VirtualEngine(schedule=schedule, soft_sensor=WRONG, **_QUIET, **silent).run(soc)
    noisy = VirtualEngine(schedule=schedule, soft_sensor=WRONG, seed=1).run(soc)
    quiet = {sensor: still[f"nox_{sensor}_ppm"].to_numpy() for sensor in _SENSORS}
    quiet["soft_fitted"] = fitted.affine_log_ppm(still["t_max_k"].to_numpy())
    return quiet, noisy


def _correction(n_seeds: int) -> NDArray[np.float64]:
    """Follow the corrected sensor from its wrong start, over seed and cycle: relative error of its ten-cycle mean."""
    out = np.empty((n_seeds, SETTLE))
    for seed in range(n_seeds):
        run = VirtualEngine(soft_sensor=WRONG, seed=seed).run(np.full(SETTLE, -6.0))
        error = np.log((run["nox_soft_corrected_ppm"] / run["nox_true_ppm"]).to_numpy())
        out[seed] = np.convolve(error, np.full(10, 0.1))[:SETTLE]
        out[seed, :9] = np.cumsum(error[:9]) / np.arange(1, 10)
    return 100.0 * np.expm1(out)


def _row(sensor: str, sweep: _Sweep, moves: list[dict[str, NDArray[np.float64]]]) -> dict[str, Any]:
    error = 100.0 * (sweep.nox_ppm[sensor] / sweep.nox_ppm["true"] - 1.0)
    mean = error.mean(axis=0)
    row: dict[str, Any] = {
        "sensor": _NAMES[sensor],
        **with_interval("steady_error_percent", np.sqrt((error**2).mean(axis=1))),
        "worst_error_percent": float(mean[np.argmax(np.abs(mean))]),
        "scatter_percent": sweep.scatter.get(sensor, math.nan),
    }
    if sensor == "soft_fitted":  # one map of the same temperature: it scatters as the uncorrected one does
        row["scatter_percent"] = sweep.scatter["soft"]
    for name, move in zip(_STEPS, moves, strict=False):
        old, new = move[sensor][STEP_AT - 1], move[sensor][-1]
        cycles = int(np.argmax((move[sensor][STEP_AT:] - old) / (new - old) >= 0.9))
        key = name.replace(" ", "_")
        row |= {f"{key}_t90_cycles": cycles, f"{key}_t90_s": cycles * 120.0 / OperatingPoint().speed_rpm}
    return row


def _sweep_rows(sweep: _Sweep) -> list[dict[str, float]]:
    return [
        {
            "soi_cad": float(SOI_CAD[place]),
            "soc_cad": float(sweep.soc_cad[place]),
            "t_max_k": float(sweep.t_max_k[place]),
            **{f"nox_{name}_ppm": float(values[:, place].mean()) for name, values in sweep.nox_ppm.items()},
        }
        for place in range(SOI_CAD.size)
    ]


def _fit_row(name: str, fit: Any) -> dict[str, Any]:
    return {
        "map": name,
        "reference_nox_ppm": fit.proxy.reference_nox_ppm,
        "reference_nox_stderr_ppm": fit.reference_nox_stderr_ppm,
        "activation_temperature_k": fit.proxy.activation_temperature_k,
        "activation_temperature_stderr_k": fit.activation_temperature_stderr_k,
        "residual_percent": 100.0 * fit.residual_ln,
    }


def _course_row(course: NDArray[np.float64]) -> dict[str, Any]:
    first = [np.flatnonzero(np.abs(own) <= 2.0) for own in course]
    arrived = [float(found[0]) if found.size else math.nan for found in first]
    return {
        "start_error_percent": float(course[:, 0].mean()),
        **with_interval("cycles_to_2_percent", arrived),
        **with_interval("final_error_percent", course[:, -STEADY:].mean(axis=1)),
    }


def _dataset(sweep: _Sweep, moves: list[xr.Dataset], course: list[NDArray[np.float64]]) -> xr.Dataset:
    variables: dict[str, tuple[Any, ...]] = {
        "soi_cad": ("soi_cad", SOI_CAD),
        "soc_cad": ("soi_cad", sweep.soc_cad),
        "t_max_k": ("soi_cad", sweep.t_max_k),
    }
    for name in ("true", *_SENSORS):
        label = VARIABLES[f"nox_{name}_ppm"]
        variables[f"steady_{name}_ppm"] = ("soi_cad", sweep.nox_ppm[name].mean(axis=0), *label)
    for name in ("affine_log", "arrhenius"):
        proxy = sweep.proxies[name]
        values = getattr(proxy, f"{name}_ppm")(sweep.t_max_k)
        label = VARIABLES[f"nox_{name}_ppm"]
        variables[f"fitted_{name}_ppm"] = ("soi_cad", values, label.units, f"{label.long_name}, fitted")
    if moves:
        shown = np.arange(STEP_AT - 100, STEP_AT + 400)
        variables["step"] = ("step", list(_STEPS[: len(moves)]), "-", "step at cycle 0")
        variables["cycle"] = ("cycle", shown - STEP_AT)
        for name in ("true", *_SENSORS):
            key = f"nox_{name}_ppm"
            variables[key] = (("step", "cycle"), [move[key].to_numpy()[shown] for move in moves])
    if course:
        variables["correction_cycle"] = ("correction_cycle", np.arange(SETTLE), "-", "cycle since the wrong start")
        variables["seed"] = ("seed", np.arange(course[0].shape[0]), "-", "seed")
        variables["correction_error_percent"] = (
            ("seed", "correction_cycle"), course[0], "%", "error of the corrected soft sensor, mean of 10 cycles",
        )  # fmt: skip
    return labelled_dataset(variables)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    figure = new_figure(11.0, 4.2)
    left, right = figure.subplots(1, 2)
    names = {f"steady_{name}_ppm": f"nox_{name}_ppm" for name in ("true", *_SENSORS)}
    steady = dataset[[*names, "soi_cad"]].rename(names)
    map_names = {"steady_true_ppm": "nox_true_ppm", "steady_analyser_ppm": "nox_analyser_ppm"}
    map_names |= {f"fitted_{name}_ppm": f"nox_{name}_ppm" for name in ("affine_log", "arrhenius")}
    mapped = dataset[[*map_names, "t_max_k"]].rename(map_names).swap_dims(soi_cad="t_max_k").drop_vars("soi_cad")
    plot.sensors(mapped, ax=left)
    plot.sensors(steady, ax=right)
    out = {"Map of the soft sensor over the maximum gas temperature, and every sensor over injection timing": figure}
    if "step" in dataset:
        figure = new_figure(11.0, 4.2)
        steps = dataset[[*names.values()]]
        for ax, step in zip(figure.subplots(1, steps.sizes["step"], squeeze=False).flat, dataset["step"], strict=True):
            plot.sensors(steps.sel(step=step).drop_vars("step"), ax=ax)
            ax.annotate(str(step.item()), (0.98, 0.04), xycoords="axes fraction", ha="right")
        out["Answers of the sensors to a step of timing and of load at cycle 0"] = figure
    if "correction_cycle" in dataset:
        figure = new_figure(6.6, 3.8)
        ax = figure.add_subplot()
        ends = np.quantile(dataset["correction_error_percent"], [0.1, 0.5, 0.9], axis=0)
        grey_band(ax, dataset["correction_cycle"].to_numpy(), *ends)
        ax.set(xlabel="cycle since the wrong start [-]", ylabel="error of the corrected soft sensor [%]")
        out["A wrong proxy held to the analyser: median of the seeds and the band that holds 80 % of them"] = figure
    return out
