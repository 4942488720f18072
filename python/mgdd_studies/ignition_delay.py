"""What start of injection belongs to a start of combustion, and what a wrong ignition delay costs a guide."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.guide import CurveSeeking
from mgdd.loop import VirtualEngine
from mgdd.plot.style import GREY, LINE_STYLES, axis_label, legend, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import legend_outside, names_of, numbered_plane
from mgdd_studies.guide_cases import SpeedLoadPlane, SteadyMap, drive, trimmed
from mgdd_studies.ignition_cases import MEASURED_AT, SOI_CAD, TRUTHS, DelayLaw, InjectionGuide, assumed_laws
from mgdd_studies.statistics import OF_SEEDS, band_variables, first_within, with_interval, with_median_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["Plane", "plane_of", "plane_row", "run_ignition_delay", "slope_row"]

AFTER = OperatingPoint(speed_rpm=2100.0, fuel_mg=16.0)  # of the step from `MEASURED_AT`
_STEP_AT, _CYCLES, _START_CYCLES, _JUDGED = 300, 600, 100, 200
_BIN, _TAIL = 20, 100  # cycles of a mean in the figure, and of the final estimate
_BOUNDS_SOI_CAD = (-45.0, 10.0)
_QUICK_SEEDS = 4
_INTAKE = {"warmer_20_k": ("intake_temperature_k", 20.0), "boost_less_15_kpa": ("intake_pressure_kpa", -15.0)}


@dataclass(frozen=True, kw_only=True)
class Plane:
    """One truth and one assumed correlation over the speed-load plane, cell by cell.

    ``soi_error_cad``: injection by the guide less the right one; ``lost`` and ``lost_trimmed``: J lost [points],
    infinite where nothing ignites; trimmed by the error that was learnt at `MEASURED_AT`.
    """

    truth: str
    assumed: str
    clipped: NDArray[np.bool_]
    delay_cad: NDArray[np.float64]
    slope: NDArray[np.float64]
    soi_error_cad: NDArray[np.float64]
    trim_cad: float
    lost: NDArray[np.float64]
    lost_trimmed: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class _Runs:
    form: str
    assumed: str
    estimate: NDArray[np.float64]
    lost: NDArray[np.float64]


def run_ignition_delay(
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Turn the best SOC of a right cycle model into SOI by a wrong correlation, and see what that costs.

    Deterministic part, on 8 x 8 cells from 900 to 3000 rpm and 6 to 40 mg at constant intake: one of three correlations
    is the truth, and the guide assumes it, another one, a polynomial through delays measured at 1500 rpm, their
    value at the best timing, or nothing. Then a run: the truth is Watson's, the guide starts at 1500 rpm and 20 mg, and
    steps in cycle 300 to 2100 rpm and 16 mg; extremum seeking with feed-forward, and curve-guided seeking, both in SOI.

    Parameters
    ----------
    n_seeds : int
        Runs per form and correlation.
    quick : bool
        At most four seeds, and a plane of 3 x 3 cells.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``truth assumed ...``: errors of the guide's injection [°CA], of what the trim of one point leaves, and J
        lost [points]. ``summary["slopes"]``: delay and dSOC/dSOI at the right injection. ``summary["intake"]``: the
        same when the intake is not as given. ``summary["runs"]``: J lost [points x cycles] and cycles to 1 °CA.

    References
    ----------
    Tan (2018), figure 5-10 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.ignition_delay import run_ignition_delay
    >>> rows = run_ignition_delay(n_seeds=1, quick=True, figures=False).summary["rows"]
    >>> [row["lost_mean"] for row in rows if row["truth"] == row["assumed"]]
    [0.0, 0.0, 0.0]
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=_QUICK_SEEDS)
    work = Parts(progress)
    work.progress("maps of the plane")
    plane = SpeedLoadPlane.of(quick=quick)
    planes = work(
        (f"{truth.name}, assumed {assumed.name}", partial(plane_of, truth, assumed, plane))
        for truth in TRUTHS for assumed in assumed_laws(truth)
    )  # fmt: skip
    runs = work(
        (f"{form}, assumed {assumed.name}", partial(_runs, form, assumed, n_seeds))
        for form in ("feed-forward", "curve") for assumed in assumed_laws(TRUTHS[0])
    )  # fmt: skip
    return work.finish(
        "ignition-delay", _dataset(planes, runs, plane), _draw if figures else None,
        seeds=n_seeds,
        rows=[plane_row(plane) for plane in planes],
        slopes=[slope_row(plane) for plane in planes if plane.truth == plane.assumed],
        intake=[_intake_row(law) for law in TRUTHS],
        runs=[_run_row(run) for run in runs],
    )  # fmt: skip


def plane_of(truth: DelayLaw, assumed: DelayLaw, plane: SpeedLoadPlane) -> Plane:
    """Compare the guide's with the right injection in every cell."""
    right, guide = InjectionGuide(truth), InjectionGuide(assumed)
    trim = right.timing(MEASURED_AT).soi_cad - guide.timing(MEASURED_AT).soi_cad
    shape = (len(plane.speeds), len(plane.fuels))
    error, lost, trimmed_lost, delay, slope = (np.empty(shape) for _ in range(5))
    clipped = np.empty(shape, bool)
    for at in np.ndindex(*shape):
        point, own = plane.points[at[0]][at[1]], plane.maps[at[0]][at[1]]
        best, said = right.timing(point), guide.timing(point)
        error[at], clipped[at] = said.soi_cad - best.soi_cad, best.clipped
        delay[at], slope[at] = best.delay_cad, truth.slope(point, best.soi_cad)
        lost[at] = _lost(truth, own, point, said.soi_cad, best.soi_cad)
        trimmed_lost[at] = _lost(truth, own, point, said.soi_cad + trim, best.soi_cad)
    return Plane(
        truth=truth.name, assumed=assumed.name, clipped=clipped, delay_cad=delay, slope=slope, soi_error_cad=error,
        trim_cad=trim, lost=lost, lost_trimmed=trimmed_lost,
    )  # fmt: skip


def _lost(truth: DelayLaw, own: SteadyMap, point: OperatingPoint, soi_cad: float, best_soi_cad: float) -> float:
    """Give the efficiency lost by an injection against the best that the truth can reach; infinite without ignition."""
    soc = truth.soc_of(point, min(max(soi_cad, SOI_CAD[0]), SOI_CAD[-1]))
    lost, least = own.lost(np.array([soc, truth.soc_of(point, best_soi_cad)])).tolist()
    return float(lost - least) if np.isfinite(soc) else np.inf


def plane_row(plane: Plane) -> dict[str, Any]:
    """Give size of the error and efficiency lost, before and after the trim."""
    left = plane.soi_error_cad + plane.trim_cad

    def losses(lost: NDArray[np.float64], end: str = "") -> dict[str, Any]:
        fired = lost[np.isfinite(lost)]
        return {
            f"lost{end}_mean": float(fired.mean()),
            f"lost{end}_p95": float(np.quantile(fired, 0.95)),
            f"cells_without_ignition{end}": lost.size - fired.size,
        }

    return {
        "truth": plane.truth,
        "assumed": plane.assumed,
        "cells": plane.lost.size,
        "soi_error_median_cad": float(np.median(np.abs(plane.soi_error_cad))),
        "soi_error_largest_cad": float(np.abs(plane.soi_error_cad).max()),
        **losses(plane.lost),
        "trim_cad": plane.trim_cad,
        "left_median_cad": float(np.median(np.abs(left))),
        **losses(plane.lost_trimmed, "_trimmed"),
    }


def slope_row(plane: Plane) -> dict[str, Any]:
    """Give delay and dSOC/dSOI at the right injection."""
    low, middle, high = np.quantile(plane.slope, [0.1, 0.5, 0.9]).tolist()
    return {
        "truth": plane.truth,
        "delay_smallest_cad": float(plane.delay_cad.min()),
        "delay_median_cad": float(np.median(plane.delay_cad)),
        "delay_largest_cad": float(plane.delay_cad.max()),
        "slope_p10": low,
        "slope_median": middle,
        "slope_p90": high,
        "curvature_ratio_median": float(np.median(plane.slope**2)),
        "cells_out_of_reach": int(plane.clipped.sum()),
    }


def _intake_row(law: DelayLaw) -> dict[str, Any]:
    """Give how the right injection at `MEASURED_AT` moves with the intake, and how much of it is the optimum's move."""
    guide = InjectionGuide(law)
    row: dict[str, Any] = {"truth": law.name}
    assumed = guide.timing(MEASURED_AT)
    for name, (field, by) in _INTAKE.items():
        point = MEASURED_AT.replace(**{field: getattr(MEASURED_AT, field) + by})
        row[f"soi_move_{name}_cad"] = guide.timing(point).soi_cad - assumed.soi_cad
        row[f"soc_move_{name}_cad"] = guide.timing(point).soc_cad - assumed.soc_cad
    return row


def _runs(form: str, assumed: DelayLaw, n_seeds: int) -> _Runs:
    truth, guide = TRUTHS[0], InjectionGuide(assumed)
    points = (MEASURED_AT, AFTER)
    maps = [SteadyMap.of(VirtualEngine(point=point)) for point in points]
    estimates, lost = np.empty((n_seeds, _CYCLES)), np.empty((n_seeds, _CYCLES))
    for seed in range(n_seeds):
        bench = VirtualEngine(schedule=[(0, MEASURED_AT), (_STEP_AT, AFTER)], seed=seed)
        if form == "curve":
            curve, (low, high) = guide.curve(MEASURED_AT), _BOUNDS_SOI_CAD
            seeker: Any = CurveSeeking(start=curve.best, bounds=(low, high), curve=curve)
        else:
            seeker = trimmed(guide)
        run = drive(bench, seeker, _CYCLES, curve_at=guide.curve, soc_of=truth.soc_of)
        estimates[seed] = run.estimate
        lost[seed] = np.concatenate(
            [own.lost(part) for own, part in zip(maps, np.split(run.applied, [_STEP_AT]), strict=True)]
        )
    return _Runs(form=form, assumed=assumed.name, estimate=estimates, lost=lost)


def _best_soi(point: OperatingPoint) -> float:
    return InjectionGuide(TRUTHS[0]).timing(point).soi_cad


def _run_row(run: _Runs) -> dict[str, Any]:
    before, after = _best_soi(MEASURED_AT), _best_soi(AFTER)
    starts = [first_within(own[:_STEP_AT], before, 1.0) for own in run.estimate]
    steps = [first_within(own[_STEP_AT:], after, 1.0) for own in run.estimate]
    return {
        "form": run.form,
        "assumed": run.assumed,
        **with_median_interval("start_cycles_to_1_cad", starts),
        **with_interval("start_lost", run.lost[:, :_START_CYCLES].sum(axis=1)),
        **with_median_interval("step_cycles_to_1_cad", steps),
        **with_interval("step_lost", run.lost[:, _STEP_AT : _STEP_AT + _JUDGED].sum(axis=1)),
        **with_interval("final_error_cad", run.estimate[:, -_TAIL:].mean(axis=1) - after),
    }


def _dataset(planes: list[Plane], runs: list[_Runs], plane: SpeedLoadPlane) -> xr.Dataset:
    cad, dims = "°CA aTDC", ("pair", "speed_rpm", "fuel_mg")
    laws = [law.soc(MEASURED_AT) - SOI_CAD for law in TRUTHS]
    variables: dict[str, tuple[Any, ...]] = {
        "pair": (
            "pair", [f"{own.truth}, assumed {own.assumed}" for own in planes], "-", "truth and assumed correlation",
        ),
        "speed_rpm": ("speed_rpm", plane.speeds, "rpm", "engine speed"),
        "fuel_mg": ("fuel_mg", plane.fuels, "mg", "fuel per cycle"),
        "soi_error_cad": (dims, [own.soi_error_cad for own in planes], "°CA", "start of injection, guide less right"),
        "left_error_cad": (
            dims, [own.soi_error_cad + own.trim_cad for own in planes], "°CA", "error that the trim leaves",
        ),
        "lost": (dims, [own.lost for own in planes], "%", "loss of efficiency by the guide's injection"),
        "lost_trimmed": (dims, [own.lost_trimmed for own in planes], "%", "loss with the trim of one point"),
        "law": ("law", [law.name for law in TRUTHS], "-", "correlation"),
        "soi_cad": ("soi_cad", SOI_CAD),
        "delay_cad": (("law", "soi_cad"), laws, "°CA", "ignition delay"),
        "cycle": ("cycle", np.arange(_CYCLES)),
    }  # fmt: skip
    if runs:
        best = np.repeat([_best_soi(MEASURED_AT), _best_soi(AFTER)], [_STEP_AT, _CYCLES - _STEP_AT])
        lost = [run.lost.mean(axis=0).reshape(-1, _BIN).mean(axis=1) for run in runs]
        variables |= {
            "run": ("run", [f"{run.form}, {run.assumed}" for run in runs], "-", "form and assumed correlation"),
            **band_variables("estimate_{}_cad", ("run", "cycle"), [run.estimate for run in runs], cad, OF_SEEDS),
            "middle_cycle": ("middle_cycle", np.arange(_BIN / 2, _CYCLES, _BIN), "-", "engine cycle"),
            "mean_lost": (
                ("run", "middle_cycle"),
                lost,
                "%",
                "loss of efficiency per cycle, mean of the seeds and of 20 cycles",
            ),
            "optimum_cad": ("cycle", best, cad, "right start of injection"),
        }
    return labelled_dataset(variables)


_LATEST_CAD, _EARLIEST_CAD = 12.0, -40.0
_MAPPED = ("Wolfer", "Hardenberg-Hase", "polynomial of 1500 rpm", "constant of 1500 rpm")
_SHOWN = ("Watson", "Hardenberg-Hase", "polynomial of 1500 rpm", "no delay")


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    out = {
        "Ignition delay over the start of injection at 1500 rpm, three correlations": _delays(dataset),
        "Error of the guide's injection where Watson's correlation is true; the numbers are the loss [points] with the "
        "trim of 1500 rpm and 20 mg": _draw_plane(dataset),
    }
    if "run" in dataset:
        out["Start and step by wrong correlations: median of the estimate, and loss of efficiency per cycle"] = (
            _draw_runs(dataset)
        )
    return out


def _delays(dataset: xr.Dataset) -> Figure:
    figure = new_figure(6.6, 3.9)
    ax = figure.subplots()
    own = dataset.sel(soi_cad=slice(_EARLIEST_CAD, _LATEST_CAD))
    lines = []
    for at, law in enumerate(map(str, own["law"].to_numpy())):
        dash, color = LINE_STYLES[at]
        lines += ax.plot(own["soi_cad"], own["delay_cad"][at], linestyle=dash, color=color, label=law)
    ax.set(xlabel=axis_label(dataset, "soi_cad"), ylabel=axis_label(dataset, "delay_cad"), ylim=(0.0, 25.0))
    ax.grid(alpha=0.3)
    legend(ax, lines, columns=3)
    return figure


def _draw_plane(dataset: xr.Dataset) -> Figure:
    pairs = names_of(dataset, "pair")
    wanted = [f"Watson, assumed {name}" for name in _MAPPED]
    shown = [pairs.index(name) for name in wanted if name in pairs]
    figure = new_figure(12.5, 3.8)
    axes = figure.subplots(1, max(len(shown), 1), sharey=True, squeeze=False)[0]
    speeds, fuels = dataset["speed_rpm"].to_numpy(), dataset["fuel_mg"].to_numpy()
    for ax, at in zip(axes, shown, strict=False):
        error = dataset["soi_error_cad"][at].to_numpy()
        left = dataset["lost_trimmed"][at].to_numpy()
        mesh = numbered_plane(
            ax, speeds, fuels, error, numbers=left, white=abs(error) > 9.0, cmap="RdBu_r", span=(-15.0, 15.0)
        )
        ax.set_title(pairs[at].partition("assumed ")[2], loc="left", fontsize="small")
        ax.set_xlabel("speed [rpm]")
    axes[0].set_ylabel("fuel [mg]")
    if shown:
        figure.colorbar(mesh, ax=list(axes), extend="both", label="SOI, guide less right [°CA]")
    return figure


def _draw_runs(dataset: xr.Dataset) -> Figure:
    figure = new_figure(9.0, 5.6)
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    runs = names_of(dataset, "run")
    cycle = dataset["cycle"].to_numpy()
    for column, form in enumerate(("feed-forward", "curve")):
        above, below = axes[0, column], axes[1, column]
        for at, name in enumerate(_SHOWN):
            if f"{form}, {name}" not in runs:
                continue
            own = dataset.isel(run=runs.index(f"{form}, {name}"))
            dash, color = LINE_STYLES[at]
            above.plot(cycle, own["estimate_median_cad"], linestyle=dash, color=color, label=f"assumed {name}")
            below.plot(own["middle_cycle"], own["mean_lost"], linestyle=dash, color=color)
        above.plot(cycle, dataset["optimum_cad"], color=GREY, linewidth=1.0, label="right SOI")
        above.set_title(form, loc="left", fontsize="small")
        below.set(xlabel="engine cycle [-]", yscale="log")
    axes[0, 0].set_ylabel("estimate of the best SOI\n[°CA aTDC]")
    axes[1, 0].set_ylabel("loss of efficiency per cycle [points]")
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    legend_outside(figure, axes[0, 0], 5)
    return figure
