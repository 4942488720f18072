"""How well each controller follows on throttles that it does not know, all tuned alike, and what unsettles them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import track, tuned_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.throttle_baselines import throttle_of
from mgdd.studies.throttle_tracking_cases import (
    CASES,
    DELAY_SAMPLES,
    references,
    row_of,
    run_case,
    throttles_of,
    warm_rows,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["run_throttle_tracking"]

_KEPT = ("settling_ms", "mse_deg2", "static_error_deg", "overshoot_deg", "total_variation", "limit_cycle_deg")


def run_throttle_tracking(
    *, seeds: int = 100, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Compare the model-guided controller with its baselines on throttles drawn around the presets.

    Every controller knows the preset and the reference, all were tuned by `mgdd.loop.tune_controller` with the same
    cost and budget on other draws. Noise of 0.03 deg, 12 bits, a delay of one sample. Steps 20 to 60 deg (`large`), 40
    to 42 (`small`), 4 to 20 (`up`) and 20 to 4 (`down`, both across limp-home), a sine of 40 +- 10 deg at 1 Hz, and 2 s
    at rest.

    Parameters
    ----------
    seeds : int
        Throttles per preset, and noise seeds.
    quick : bool
        Four throttles around P1, the first case only.
    figures : bool
        Draw the figure.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows per case, preset and controller: medians and 95th percentiles (``_p95``) of settling times [ms] and mean
        square errors [deg²], mean and 95 % interval of the large step's mean square error, ``static_p95_deg``,
        ``overshoot_p95_deg``, total variation of the duty at rest and over the small step, and the number of throttles
        with a limit cycle above 0.5 deg. ``summary["warm"]``: mean square errors on throttles with 40 % more friction
        or preload, cold, after 2 s of driving, and for a controller that knows it.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    Tan (2018), sections 7.3 and 7.4: the questions of figures 7-25 to 7-35 and table 7-4; its numbers are not known.

    Examples
    --------
    >>> from mgdd.studies import run_study
    >>> rows = run_study("throttle-tracking", seeds=3, quick=True, figures=False).summary["rows"]
    >>> [row["controller"] for row in rows][:2]
    ['guided', 'mgdd1']
    """
    check_seeds(seeds)
    n = min(seeds, 4) if quick else seeds
    jobs = [(name, preset) for name, case in CASES.items() for preset in case.presets]
    if quick:
        jobs = [("unknown", "P1")]
    parts = [(f"{CASES[name].text}, {preset}", partial(run_case, name, preset, n)) for name, preset in jobs]
    runs, interrupted = run_parts(parts, progress)
    done = jobs[: len(runs)]
    rows = [
        row_of(name, preset, str(controller), run)
        for (name, preset), run in zip(done, runs, strict=True)
        for controller in run["controller"].to_numpy()
    ]
    warm: list[dict[str, Any]] = []
    if not quick and not interrupted:
        if progress is not None:
            progress("friction and preload 40 % wrong")
        warm = [row for preset in ("P1", "P2", "P3") for row in warm_rows(preset, min(n, 20))]
    summary = {
        "study": "throttle-tracking",
        "seeds": n,
        "rows": rows,
        "warm": warm,
        "delay_samples": DELAY_SAMPLES,
        "interrupted": interrupted,
    }
    return finish(_dataset(runs, done), to_jsonable(summary), _draw if figures else None)


def _dataset(runs: list[xr.Dataset], done: list[tuple[str, str]]) -> xr.Dataset:
    first = [(preset, run) for (name, preset), run in zip(done, runs, strict=True) if name == "unknown"]
    run = first[0][1]
    dims = ("preset", "throttle", "controller", "reference")
    return labelled_dataset(
        {
            "preset": ("preset", [preset for preset, _ in first], "-", "preset"),
            "throttle": ("throttle", run["throttle"].to_numpy(), "-", "number of the throttle"),
            "controller": ("controller", run["controller"].to_numpy(), "-", "controller"),
            "reference": ("reference", list(references()), "-", "reference"),
            **{name: (dims, np.stack([each[name].to_numpy() for _, each in first])) for name in _KEPT},
        }
    )


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    from matplotlib.figure import Figure as NewFigure

    from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE

    colors = dict(zip(FAMILIES, (BLUE, GREY, ORANGE, GREEN, BLACK, "#8c6bb1"), strict=True))
    dashes: tuple[Any, ...] = ("-", ":", "--", "-.", "-", (0, (6, 1, 1, 1, 1, 1)))  # each also readable without colour
    styles = dict(zip(FAMILIES, dashes, strict=True))
    figure = NewFigure(figsize=(7.2, 6.2), layout="constrained")
    axes = figure.subplots(2, 2)
    wanted = references()
    plant = throttles_of(CASES["unknown"], "P1", 4)[3]
    for (left, right), name, window_ms in zip(axes, ("small", "large"), (120.0, 200.0), strict=True):
        reference = wanted[name]
        for kind in FAMILIES:
            run = track(tuned_controller(kind, throttle_of("P1")), reference, throttle=plant, seed=1)
            time_ms = 1e3 * (run["time_s"].to_numpy() - reference.from_s)
            shown = (time_ms >= -10.0) & (time_ms <= window_ms)
            look = {"linestyle": styles[kind], "color": colors[kind], "linewidth": 1.2}
            left.plot(time_ms[shown], run["angle_deg"].to_numpy()[shown], **look)
            settling = np.sort(dataset["settling_ms"].sel(preset="P1", controller=kind, reference=name).to_numpy())
            share = np.arange(1, len(settling) + 1) / len(settling)
            right.step(settling, share, label=FAMILIES[kind].label, **look)
        left.set_ylabel("plate angle [deg]")
        right.set_ylabel("share of the throttles [-]")
        right.set_xlim(0.0, 3.0 * window_ms)
        right.set_ylim(0.0, 1.02)
    axes[1][0].set_xlabel("time after the step [ms]")
    axes[1][1].set_xlabel("settling time [ms]")
    figure.legend(*axes[0][1].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    caption = (
        "Steps of 2 and of 40 deg. Left: one throttle drawn around P1. Right: share of the drawn throttles that have "
        "settled by a time; a curve that ends below 1 has throttles that never settle"
    )
    return {caption: figure}
