"""Faults of a throttle under a supervisor: how soon it is safe, for which reason, and how far the plate goes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.control import Pid
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.throttle_baselines import Baseline, baselines, controller_of, supervisor_of, throttle_of
from mgdd.studies.throttle_fault_cases import (
    ACKNOWLEDGE_S,
    CASES,
    MODES,
    ONSET_S,
    SAMPLE_S,
    FaultCase,
    FaultRun,
    run_case,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["figures_of_run", "run_throttle_faults"]

SHOWN = ("sensors disagree", "jammed in flight")


def run_throttle_faults(
    *, seeds: int = 3, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Run every labelled fault against PID and sliding mode on every preset, watched by a supervisor.

    The plate is at rest at 40 deg; at 1 s the reference steps to 60 deg (or closes slowly, or leaves the travel) and
    the fault sets in; an acknowledgement is tried while it lasts, and again well after its end.

    Parameters
    ----------
    seeds : int
        Noise realisations; the rows hold the worst of them.
    quick : bool
        Preset P1 and one seed only.
    figures : bool
        Draw the figure.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows ``fault preset controller mode reason visible_ms safe_ms beyond_deg return_ms kept recovered``: time from
        the onset until the fault can be seen and from there until the reference is limited or the bridge open [ms], the
        largest angle above reference and start [deg], time from the open bridge to the limp-home band [ms] (None
        where it never comes), whether the early acknowledgement was refused and the late one led back to normal.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    Notes
    -----
    The supervisor is a monitor of simulations and test rigs, not a certified safety function.

    Examples
    --------
    >>> from mgdd.studies import run_study
    >>> rows = run_study("throttle-faults", quick=True, figures=False).summary["rows"]
    >>> max(row["safe_ms"] for row in rows) <= 50.0, all(row["recovered"] for row in rows)
    (True, True)
    """
    n_seeds = 1 if quick else check_seeds(seeds)
    names = presets.available("throttle")[: 1 if quick else None]
    chosen = [b for b in baselines().values() if b.preset in names]
    parts = [(f"{b.preset}, {_label(b)}", partial(_all_cases, b, n_seeds)) for b in chosen]
    done, interrupted = run_parts(parts, progress)
    summary = {
        "study": "throttle-faults",
        "seeds": n_seeds,
        "rows": [row for rows, _ in done for row in rows],
        "interrupted": interrupted,
    }
    return finish(_dataset(done[0][1]), to_jsonable(summary), _draw if figures else None)


def _label(baseline: Baseline) -> str:
    return "PID" if baseline.kind is Pid else "sliding mode"


def _all_cases(baseline: Baseline, n_seeds: int) -> tuple[list[dict[str, Any]], dict[str, FaultRun]]:
    """Give a row per fault, and the runs of those that are shown."""
    rows, shown = [], {}
    throttle = throttle_of(baseline.preset)
    for name, case in CASES.items():
        runs = [
            run_case(case, throttle, controller_of(baseline), supervisor_of(baseline.preset), seed=seed)
            for seed in range(n_seeds)
        ]
        figures = [figures_of_run(case, run) for run in runs]
        row = {"fault": name, "preset": baseline.preset, "controller": _label(baseline)}
        for key in figures[0]:
            row[key] = _worst([one[key] for one in figures])
        rows.append(row)
        if name in SHOWN:
            shown[name] = runs[0]
    return rows, shown


def _worst(values: list[Any]) -> Any:
    """Give the largest number, whether all are true, or the text that differs from the first if any does."""
    if isinstance(values[0], bool):
        return all(values)
    if isinstance(values[0], str):
        return next((value for value in values if value != values[0]), values[0])
    return None if any(value is None for value in values) else max(values)


def figures_of_run(case: FaultCase, run: FaultRun) -> dict[str, Any]:
    """Give what a row says of one run.

    Parameters
    ----------
    case : FaultCase
        Its scenario.
    run : FaultRun
        What happened.

    Returns
    -------
    dict
        Entries of a row by name.
    """
    wanted = MODES.index(case.mode)
    visible = case.seen_s(run)
    during = (run.time_s >= ONSET_S) & (run.time_s < case.repair_s)
    first = int(np.argmax(during & (run.mode >= wanted)))
    asked = np.fmax(
        np.clip(run.reference_deg, run.throttle.closed_deg, run.throttle.open_deg),
        run.angle_deg[round(ONSET_S / SAMPLE_S)],
    )
    returned = None
    if case.mode == "limp_home":
        there = run.bridge_open & (np.abs(run.angle_deg - run.throttle.limp_home_deg) <= 1.0)
        opened = int(np.argmax(run.bridge_open))
        if case.returns and there.any():
            returned = float(1e3 * (run.time_s[int(np.argmax(there))] - run.time_s[opened]))
    until_told = run.mode[first : round(ACKNOWLEDGE_S / SAMPLE_S)]
    kept = case.mode == "holding" or (run.refused == case.reason and bool((until_told == wanted).all()))
    return {
        "mode": MODES[int(run.mode[during].max())],
        "reason": run.reason[first],
        "visible_ms": 1e3 * (visible - ONSET_S),
        "safe_ms": 1e3 * max(0.0, float(run.time_s[first]) - visible),
        "beyond_deg": float(np.fmax(0.0, np.nanmax((run.angle_deg - asked)[during]))),
        "return_ms": returned,
        "kept": kept,
        "recovered": run.accepted == "none" and bool(run.mode[-1] == 0) and abs(run.angle_deg[-1] - 40.0) < 0.5,
    }


def _dataset(shown: dict[str, FaultRun]) -> xr.Dataset:
    runs = list(shown.values())

    def column(name: str, units: str, text: str) -> tuple[tuple[str, str], Any, str, str]:
        return ("fault", "time_s"), np.array([getattr(run, name) for run in runs]), units, text

    return labelled_dataset(
        {
            "fault": ("fault", list(shown), "-", "fault"),
            "time_s": ("time_s", runs[0].time_s),
            "reference_deg": column("reference_deg", "deg", "wanted plate angle"),
            "angle_deg": column("angle_deg", "deg", "plate angle"),
            "duty": column("duty", "-", "duty"),
            "bridge_open": column("bridge_open", "-", "bridge open"),
            "mode": column("mode", "-", "mode: " + ", ".join(f"{k} {name}" for k, name in enumerate(MODES))),
        },
        attrs={"preset": "P1", "controller": "PID", "limp_home_deg": runs[0].throttle.limp_home_deg},
    )


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.8, 6.0), layout="constrained")
    grid = figure.subplots(3, dataset.sizes["fault"], sharex=True, sharey="row", squeeze=False)
    for column, name in enumerate(dataset["fault"].to_numpy()):
        run = dataset.sel(fault=name, time_s=slice(0.9, 3.3))
        time = run["time_s"]
        angle, duty, mode = grid[:, column]
        angle.set_title(str(name))
        angle.plot(time, run["reference_deg"], color="0.6", label="reference")
        angle.plot(time, run["angle_deg"], label="plate")
        angle.axhline(dataset.attrs["limp_home_deg"], color="0.6", linestyle=":", linewidth=0.8)
        duty.plot(time, run["duty"])
        mode.step(time, run["mode"], where="post")
        mode.set_yticks(range(len(MODES)), MODES)
        mode.set_xlabel("time, s")
    grid[0, 0].set_ylabel("plate angle, deg")
    grid[0, 0].legend()
    grid[1, 0].set_ylabel("duty, -")
    return {"Angle, duty and mode over time for two faults, P1 with PID": figure}
