"""What a guide saves while the operating point keeps changing: a drive sequence, and the whole speed-load plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.loop import VirtualEngine
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import band, names_of, numbered_plane
from mgdd_studies.guide_cases import GUIDES, Guide, SpeedLoadPlane, SteadyMap, drive, guided_by, verdict_on, verdicts
from mgdd_studies.statistics import first_within, mean_interval, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["PLANE_RUNS", "plane_row", "run_guided_transients", "run_plane"]

LEARNT_AT = OperatingPoint(speed_rpm=1500.0, fuel_mg=20.0)
PLANE_GUIDES = ("wall heat -30 %", "wall heat +30 %", "duration -15 %", "adiabatic")
PLANE_RUNS = (("none", "none"), *((form, name) for form in ("feed-forward", "curve") for name in PLANE_GUIDES))
_SETTLED, _JUDGED = 400, 200
_BY_NAME: dict[str, Guide] = {guide.name: guide for guide in GUIDES}
# Speed [rpm] and fuel [mg] of 250 cycles each: pulling away, cruising, overtaking, coasting down.
SEQUENCE = (
    (900.0, 8.0), (1500.0, 12.0), (1500.0, 30.0), (2000.0, 24.0), (2500.0, 34.0), (1800.0, 10.0),
    (1200.0, 18.0), (1500.0, 36.0), (2200.0, 14.0), (2800.0, 28.0), (1500.0, 8.0), (1000.0, 12.0),
)  # fmt: skip
_DWELL, _BIN = 250, 50
_GUIDES = ("wall heat +30 %", "duration -15 %", "adiabatic")
_SAME = 0.01  # share of loss within which two cells count as equal: two cycles of dither


@dataclass(frozen=True, kw_only=True)
class Plane:
    """Cycles to 1 CAD and J lost in 200 cycles [points x cycles] after the step, by speed and fuel."""

    form: str
    name: str
    cycles: NDArray[np.float64]
    lost: NDArray[np.float64]


def run_plane(form: str, name: str, plane: SpeedLoadPlane) -> Plane:
    """Step from 1500 rpm and 20 mg to each cell, with that guide as feed-forward or curve, or without (``none``)."""
    shape = (len(plane.speeds), len(plane.fuels))
    cycles, lost = np.empty(shape), np.empty(shape)
    for at in np.ndindex(*shape):
        cell, after = plane.points[at[0]][at[1]], plane.maps[at[0]][at[1]]
        schedule = [(0, LEARNT_AT), (_SETTLED, cell)]
        bench = VirtualEngine(schedule=schedule, soc_scatter_cad=0.0, efficiency_noise_percent=0.0)
        run = drive(bench, guided_by(form, _BY_NAME.get(name), LEARNT_AT), _SETTLED + _JUDGED)
        cycles[at] = first_within(run.estimate[_SETTLED:], after.best_cad, 1.0)
        lost[at] = after.lost(run.applied[_SETTLED:]).sum()
    return Plane(form=form, name=name, cycles=cycles, lost=lost)


def plane_row(plane: Plane, none: Plane) -> dict[str, Any]:
    """Compare with the plain seeker: cells that take more cycles to 1 CAD or lose over 1 % more, and means."""
    ratio = plane.lost / none.lost
    return {
        "form": plane.form,
        "guide": plane.name,
        "cells": plane.lost.size,
        "cells_slower": int(np.sum(plane.cycles > none.cycles)),
        "cells_costlier": int(np.sum(ratio > 1.0 + _SAME)),
        "worst_cost_over_unguided": float(ratio.max()),
        "mean_cycles": float(plane.cycles.mean()),
        "mean_cycles_saved": float(np.mean(none.cycles - plane.cycles)),
        "mean_lost": float(plane.lost.mean()),
        "lost_over_unguided": float(plane.lost.sum() / none.lost.sum()),
    }


@dataclass(frozen=True, kw_only=True)
class _Drive:
    """J lost per cycle [points], shape (seed, cycle), and the mean estimate of every cycle."""

    form: str
    guide: str
    lost: NDArray[np.float64]
    estimate: NDArray[np.float64]


def run_guided_transients(
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Measure the efficiency lost over a sequence of twelve operating points, and after a step to each cell of a plane.

    The sequence takes 3000 cycles, with burn durations by the duration law. Unguided extremum seeking starts at -20 °CA
    aTDC and restarts at every point; guides lead it as feed-forward, or give their curve to curve-guided seeking
    (`GuidedEngine` without calibration). Noise of 0.25 points, 0.3 °CA of scatter. The plane has 8 x 8 cells from 900
    to 3000 rpm and 6 to 40 mg; the trim is learnt at 1500 rpm and 20 mg, then the point steps to the cell; no noise.

    Parameters
    ----------
    n_seeds : int
        Runs of the sequence.
    quick : bool
        At most two seeds, and a plane of 3 x 3 cells.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``form guide lost_per_100 lost_per_100_moving lost_over_unguided moving_over_unguided``: J lost per 100
        cycles [points x cycles] against the noise-free optimum, of the whole sequence and from the second point on.
        ``summary["plane"]``: cells that take more cycles than unguided, or lose more, cycles and loss saved.
        ``summary["bars"]``: what was demanded of the plane.

    References
    ----------
    Tan (2018), figures 5-9, 5-13 and 5-14 (question); the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> result = run_study("guided-transients", n_seeds=2, quick=True)
    >>> all(row["lost_over_unguided"] < 0.7 for row in result.summary["rows"][1:])
    True
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=2)
    work = Parts(progress)
    points = [OperatingPoint(speed_rpm=speed, fuel_mg=fuel) for speed, fuel in SEQUENCE]
    maps = [SteadyMap.of(VirtualEngine(point=point)) for point in points]
    plane = SpeedLoadPlane.of(quick=quick)
    wanted = [("none", "none"), *((form, name) for form in ("feed-forward", "curve") for name in _GUIDES)]
    done = work(
        (f"sequence, {form}, {name}", partial(_sequence, form, name, points, maps, n_seeds)) for form, name in wanted
    )
    planes = work((f"plane, {form}, {name}", partial(run_plane, form, name, plane)) for form, name in PLANE_RUNS)
    table = [plane_row(plane, planes[0]) for plane in planes]
    return work.finish(
        "guided-transients", _dataset(done, planes, maps, plane), _draw if figures else None,
        seeds=n_seeds,
        rows=[_row(own, done[0]) for own in done],
        plane=table,
        bars=_bars(table),
    )  # fmt: skip


def _sequence(form: str, name: str, points: list[OperatingPoint], maps: list[SteadyMap], n_seeds: int) -> _Drive:
    schedule = [(_DWELL * at, point) for at, point in enumerate(points)]
    lost, estimates = [], []
    for seed in range(n_seeds):
        bench = VirtualEngine(schedule=schedule, seed=seed)
        run = drive(bench, guided_by(form, _BY_NAME.get(name), points[0]), _DWELL * len(points))
        parts = run.applied.reshape(len(points), _DWELL)
        lost.append(np.concatenate([own.lost(part) for own, part in zip(maps, parts, strict=True)]))
        estimates.append(run.estimate)
    return _Drive(form=form, guide=name, lost=np.stack(lost), estimate=np.stack(estimates))


def _row(own: _Drive, none: _Drive) -> dict[str, Any]:
    """Give loss per 100 cycles, of all of the sequence and without its first point, which is the start."""
    whole, moving = (100.0 * run.mean(axis=1) for run in (own.lost, own.lost[:, _DWELL:]))
    plain, plain_moving = (100.0 * float(run.mean()) for run in (none.lost, none.lost[:, _DWELL:]))
    return {
        "form": own.form,
        "guide": own.guide,
        **with_interval("lost_per_100", whole),
        **with_interval("lost_per_100_moving", moving),
        "lost_over_unguided": mean_interval(whole)[0] / plain,
        **with_interval("moving_over_unguided", moving / plain_moving),
    }


def _bars(table: list[dict[str, Any]]) -> list[dict[str, Any]]:
    bars = []
    for form in ("feed-forward", "curve"):
        known = {row["guide"]: row for row in table if row["form"] == form}
        good = [known[name] for name in PLANE_GUIDES[:-1] if name in known]
        for key, text in (("cells_slower", "more cycles to 1 CAD"), ("cells_costlier", "over 1 % more loss")):
            if good:
                said = f"plane, {form}, wall heat ±30 % and duration -15 %: cells with {text} than unguided"
                bars.append(verdict_on(said, [float(row[key]) for row in good], "none", high=0.0))
        worst = [known["adiabatic"]["worst_cost_over_unguided"]] if "adiabatic" in known else []
        bars += verdicts([(f"plane, {form}, adiabatic: worst cost over unguided [-]", worst, 1.2)])
    return bars


def _named(form: str, guide: str) -> str:
    return "unguided" if form == "none" else f"{form}, {guide}"


def _dataset(done: list[_Drive], planes: list[Plane], maps: list[SteadyMap], plane: SpeedLoadPlane) -> xr.Dataset:
    cad = "°CA aTDC"
    cycles = done[0].lost.shape[1]
    means = [own.lost.reshape(own.lost.shape[0], -1, _BIN).mean(axis=2) for own in done]
    bins = [100.0 * own.lost.reshape(own.lost.shape[0], -1, _BIN).mean(axis=(0, 2)) for own in done]
    lows, highs = (
        [np.array([mean_interval(column)[end] for column in mean.T]) * 100.0 for mean in means] for end in (1, 2)
    )
    run = ("run", "middle_cycle")
    variables: dict[str, tuple[Any, ...]] = {
        "run": ("run", [_named(own.form, own.guide) for own in done], "-", "form and guide"),
        "cycle": ("cycle", np.arange(cycles)),
        "middle_cycle": ("middle_cycle", np.arange(_BIN / 2, cycles, _BIN), "-", "engine cycle"),
        "lost_per_100": (run, bins, "%", "loss of efficiency per 100 cycles"),
        "lost_per_100_low": (run, lows, "%", "loss of efficiency per 100 cycles, low end of the interval"),
        "lost_per_100_high": (run, highs, "%", "loss of efficiency per 100 cycles, high end of the interval"),
        "estimate_cad": (("run", "cycle"), [np.median(own.estimate, axis=0) for own in done], cad, "median estimate"),
        "optimum_cad": ("cycle", np.repeat([own.best_cad for own in maps], _DWELL), cad, "optimum"),
        "speed_rpm": ("cycle", np.repeat([speed for speed, _ in SEQUENCE], _DWELL), "rpm", "engine speed"),
        "fuel_mg": ("cycle", np.repeat([fuel for _, fuel in SEQUENCE], _DWELL), "mg", "fuel per cycle"),
    }
    if planes:
        dims = ("plane_run", "plane_speed_rpm", "plane_fuel_mg")
        variables |= {
            "plane_run": ("plane_run", [_named(own.form, own.name) for own in planes], "-", "form and guide"),
            "plane_speed_rpm": ("plane_speed_rpm", plane.speeds, "rpm", "engine speed"),
            "plane_fuel_mg": ("plane_fuel_mg", plane.fuels, "mg", "fuel per cycle"),
            "plane_cycles": (dims, [own.cycles for own in planes], "-", "cycles to 1 °CA after the step"),
            "plane_lost": (
                dims,
                [own.lost for own in planes],
                "%",
                "loss of efficiency over 200 cycles after the step",
            ),
        }
    return labelled_dataset(variables)


_SHOWN = (
    ("unguided", "-", BLACK), ("feed-forward, wall heat +30 %", "--", BLUE), ("curve, wall heat +30 %", "-", ORANGE),
)  # fmt: skip


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    figure = new_figure(9.0, 7.0)
    timing, loss, point = figure.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.6, 1.0))
    cycle = dataset["cycle"].to_numpy()
    runs = names_of(dataset, "run")
    for name, dash, color in _SHOWN:
        if name in runs:
            own = dataset.sel(run=name)
            timing.plot(cycle, own["estimate_cad"], dash, color=color, linewidth=1.1, label=name)
            ends = [own[f"lost_per_100{end}"] for end in ("_low", "", "_high")]
            band(loss, own["middle_cycle"].to_numpy(), *ends, dash=dash, color=color, alpha=0.2, linewidth=1.1)
    timing.plot(cycle, dataset["optimum_cad"], ":", color=GREY, linewidth=1.4, label="optimum")
    timing.set(ylabel="estimate of the best\ntiming [°CA aTDC]", ylim=(-20.5, 2.0))
    timing.legend(ncols=2, fontsize="small", loc="lower right")
    loss.set(ylabel="loss of efficiency per 100 cycles\n[points × cycles]", yscale="log")
    point.plot(cycle, dataset["speed_rpm"], "-", color=BLACK)
    point.set(ylabel="speed [rpm]", xlabel="engine cycle [-]", xlim=(0, cycle.size))
    fuel = point.twinx()
    fuel.plot(cycle, dataset["fuel_mg"], "--", color=BLUE)
    fuel.set_ylabel("fuel [mg], dashed")
    for ax in (timing, loss, point):
        ax.grid(alpha=0.3)
    out = {"A sequence of twelve operating points: medians of the estimate, loss with its 95 % interval": figure}
    if "plane_run" in dataset:
        out["Loss in the 200 cycles after a step from 1500 rpm and 20 mg, over that of the unguided seeker"] = (
            _draw_plane(dataset)
        )
    return out


def _draw_plane(dataset: xr.Dataset) -> Figure:
    names = names_of(dataset, "plane_run")[1:]
    lost = dataset["plane_lost"].to_numpy()
    speeds, fuels = dataset["plane_speed_rpm"].to_numpy(), dataset["plane_fuel_mg"].to_numpy()
    rows = 2 if len(names) > 1 else 1
    columns = max(-(-len(names) // rows), 1)
    figure = new_figure(3.1 * columns, 3.4 * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for ax, name, own in zip(grid.flat, names, lost[1:], strict=False):
        shares = own / lost[0]
        mesh = numbered_plane(
            ax, speeds, fuels, shares, numbers=shares, white=shares > 0.6, cmap="cividis_r", span=(0.0, 1.4)
        )
        ax.set_title(name, loc="left", fontsize="small")
    for ax in grid[-1]:
        ax.set_xlabel("speed [rpm]")
    for ax in grid[:, 0]:
        ax.set_ylabel("fuel [mg]")
    if names:
        figure.colorbar(mesh, ax=list(grid.flat), label="loss over unguided [-]")
    return figure
