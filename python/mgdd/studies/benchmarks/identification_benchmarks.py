"""Measured benchmarks of identification: a drive with friction, cascaded tanks, a Wiener-Hammerstein circuit."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from mgdd import datasets
from mgdd.errors import DataError
from mgdd.optimize import FitOptions
from mgdd.results.labels import labelled_dataset
from mgdd.signals import nrmse_fit_percent, rmse
from mgdd.studies.base import Progress, StudyResult, finish, run_parts
from mgdd.studies.benchmarks.drive_axis import drive_free_run, fit_drive
from mgdd.studies.benchmarks.figures import draw
from mgdd.studies.benchmarks.two_tanks import fit_two_tanks
from mgdd.studies.benchmarks.wiener_hammerstein import fit_linear, fit_wiener_hammerstein

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

    Vector = NDArray[np.float64]

__all__ = ["run_identification_benchmarks"]

Result = TypeVar("Result")

_NAME = "identification-benchmarks"
_DRIVE_WINDOW, _TANKS_WINDOW, _CIRCUIT_WINDOW = 20, 50, 50
_DRIVE_STARTS, _QUICK_STARTS = 48, 4
_HOLD_OUT_STARTS = 16
_LAST_CYCLE, _SECOND_CYCLE = 18_650, 6220  # first samples of them; a motion cycle of the training record takes 6.2 s
_QUICK_CIRCUIT = 20_000  # samples of the estimation record

_FIT = "fit 100 (1 - |e| / |y - mean y|), free run"
_RMSE = "RMSE, free run"
_PUBLISHED = {
    "emps": "96.8 dynoNet; 25.4 best linear model, Janot et al. 2019 (both as quoted by Forgione and Piga 2021)",
    "cascaded_tanks": "0.18 to 0.20 physical grey boxes of 2017 and 2018 (recalled; the papers were not at hand)",
    "wh2009": (
        "0.28 Schoukens et al. 2014; 1.2 dynoNet (both as quoted by Forgione and Piga 2021); 44 best linear model"
    ),
}
_WINDOWS = {
    "emps": "position and speed at the start from samples 0 to 19, scored from sample 20",
    "cascaded_tanks": "two levels at the start estimated on test samples 0 to 49, scored on all 1024",
    "wh2009": "filters from rest, test samples 0 to 49 not scored",
}


@dataclass(frozen=True, kw_only=True)
class _Case:
    """One row, and the free run behind it where it is drawn."""

    row: dict[str, Any]
    time_s: Vector = field(default_factory=lambda: np.empty(0))
    measured: Vector = field(default_factory=lambda: np.empty(0))
    simulated: Vector = field(default_factory=lambda: np.empty(0))
    drawn: bool = False


def run_identification_benchmarks(
    *, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Fit physical and block-oriented models to three measured benchmarks; train on the training record only.

    Every model is fitted without its test record. All forms of a set are reported, so that none is picked by its test
    figure; for the drive the fit of held-out cycles of the training record says which to prefer.

    Parameters
    ----------
    quick : bool
        Fewer starts for the drive, 20 000 samples for the circuit, no simpler forms of the circuit.
    figures : bool
        Whether to draw.
    progress : callable, optional
        Called with a few words before each fit.

    Returns
    -------
    StudyResult
        ``summary["rows"]``: ``set``, ``model``, ``train``, ``test``, ``metric``, ``unit``, ``published`` (text with
        source), and ``window``, ``n_parameters``, ``seconds`` (CPU of the fit), ``status``; for the drive also
        ``hold_out`` (the figure on one cycle of the training record after a fit to the others, by which the form is
        chosen; None in a quick run) and ``starts_within_0_05`` (starts that train that close to the best).

    Raises
    ------
    mgdd.errors.DataError
        None of the three sets is at hand. A set that is missing is left out and named in ``missing``.

    References
    ----------
    Janot, Gautier and Brunot (2019); Schoukens and Noël (2017); Schoukens, Suykens and Ljung (2009).

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.studies.benchmarks.identification_benchmarks import run_identification_benchmarks
    >>> if "cascaded_tanks" in datasets.available():
    ...     result = run_identification_benchmarks(quick=True, figures=False)
    ...     assert {"set", "train", "test"} <= set(result.summary["rows"][0])
    """
    makers: dict[Literal["emps", "cascaded_tanks", "wh2009"], Any] = {
        "emps": _drive_parts,
        "cascaded_tanks": _tank_parts,
        "wh2009": _circuit_parts,
    }
    parts, missing, reason = [], [], ""
    for name, make in makers.items():
        try:
            train, test = datasets.load(name)
        except FileNotFoundError as error:
            missing.append(name)
            reason = str(error.strerror)
            continue
        parts += make(train, test, quick)
    if not parts:
        raise DataError(f"the study {_NAME} needs at least one of {', '.join(missing)}: {reason}")
    cases, interrupted = run_parts(parts, progress)
    drawn = [case for case in cases if case.drawn]
    dataset = _dataset(cases, drawn)
    summary = {
        "study": _NAME,
        "seeds": 0,
        "quick": quick,
        "missing": missing,
        "interrupted": interrupted,
        "rows": [case.row for case in cases],
    }
    return finish(dataset, summary, draw if figures else None)


def _row(name: str, model: str, train: float, test: float, metric: str, unit: str, **more: Any) -> dict[str, Any]:
    return {
        "set": name,
        "model": model,
        "train": train,
        "test": test,
        "metric": metric,
        "unit": unit,
        "published": _PUBLISHED[name],
        "window": _WINDOWS[name],
        **more,
    }


def _timed(fit: Callable[[], Result]) -> tuple[Result, float]:
    """Give what a fit returns and its processor time [s]."""
    began = time.process_time()
    return fit(), time.process_time() - began


def _drive_parts(train: xr.Dataset, test: xr.Dataset, quick: bool) -> list[tuple[str, partial[_Case]]]:
    forms = [
        ("viscous + Coulomb + offset", "coulomb", False),
        ("viscous per direction + Coulomb + offset", "directional", False),
        ("viscous per direction + Coulomb with Stribeck rise + offset", "stribeck", False),
        ("viscous per direction + Coulomb + drifting offset", "directional", True),
        ("viscous per direction + Coulomb with Stribeck rise + drifting offset", "stribeck", True),
    ]
    return [
        (f"drive: {text}", partial(_drive, train, test, text, friction, drift, quick))
        for text, friction, drift in forms
    ]


def _hold_out(train: xr.Dataset, friction: str, drift: bool) -> float:
    """Mean fit [%] of the last cycle after a fit to the first three, and of the first after a fit to the others."""
    options: dict[str, Any] = {"friction": friction, "drift": drift, "options": FitOptions(n_starts=_HOLD_OUT_STARTS)}
    early = fit_drive(train.isel(time_s=slice(0, _LAST_CYCLE)), **options)
    late = fit_drive(train.isel(time_s=slice(_SECOND_CYCLE, None)), **options)
    first = train.isel(time_s=slice(0, _SECOND_CYCLE))
    tail, whole = _LAST_CYCLE - _DRIVE_WINDOW, train["position_m"].to_numpy()
    return 0.5 * (
        nrmse_fit_percent(whole[_LAST_CYCLE:], drive_free_run(early.model, train)[tail:])
        + nrmse_fit_percent(whole[_DRIVE_WINDOW:_SECOND_CYCLE], drive_free_run(late.model, first))
    )


def _drive(train: xr.Dataset, test: xr.Dataset, text: str, friction: str, drift: bool, quick: bool) -> _Case:
    options = FitOptions(n_starts=_QUICK_STARTS if quick else _DRIVE_STARTS)
    fit, seconds = _timed(partial(fit_drive, train, friction=friction, drift=drift, options=options))
    runs = {key: drive_free_run(fit.model, record) for key, record in (("train", train), ("test", test))}
    truth = {key: record["position_m"].to_numpy()[_DRIVE_WINDOW:] for key, record in (("train", train), ("test", test))}
    scores = {key: nrmse_fit_percent(truth[key], runs[key]) for key in runs}
    percents = 100.0 * (1.0 - np.asarray(fit.start_rmse) / truth["train"].std())
    return _Case(
        row=_row(
            "emps",
            text,
            scores["train"],
            scores["test"],
            _FIT,
            "%",
            n_parameters=len(fit.report.names),
            seconds=seconds,
            status=fit.report.status,
            hold_out=None if quick else _hold_out(train, friction, drift),
            starts=len(fit.start_rmse),
            starts_within_0_05=int(np.sum(percents > percents[0] - 0.05)),
        ),
        time_s=test["time_s"].to_numpy()[_DRIVE_WINDOW:],
        measured=truth["test"],
        simulated=runs["test"],
        drawn=friction == "stribeck" and drift,
    )


def _tank_parts(train: xr.Dataset, test: xr.Dataset, quick: bool) -> list[tuple[str, partial[_Case]]]:
    del quick  # seconds either way
    forms = [
        ("square-root outflows", "square_root"),
        ("square-root outflows + overflow", "square_root_overflow"),
        ("linear and power-law outflow + overflow + delay", "grey_box"),
        ("two power-law outflows + overflow + delay", "grey_box_free_exponent"),
    ]
    return [(f"tanks: {text}", partial(_tanks, train, test, text, form)) for text, form in forms]


def _tanks(train: xr.Dataset, test: xr.Dataset, text: str, form: str) -> _Case:
    fit, seconds = _timed(partial(fit_two_tanks, train, form=form))
    state = fit.model.estimate_state(test, window=_TANKS_WINDOW)
    run = fit.model.simulate(test, initial_state=state)["level_v"].to_numpy()
    truth = test["level_v"].to_numpy()
    row = _row(
        "cascaded_tanks",
        text,
        fit.report.rmse,
        rmse(truth, run),
        _RMSE,
        "V",
        n_parameters=len(fit.report.names),
        seconds=seconds,
        status=fit.report.status,
        test_without_window=rmse(truth[_TANKS_WINDOW:], run[_TANKS_WINDOW:]),
    )
    return _Case(row=row, time_s=test["time_s"].to_numpy(), measured=truth, simulated=run, drawn=form == "grey_box")


def _circuit_parts(train: xr.Dataset, test: xr.Dataset, quick: bool) -> list[tuple[str, partial[_Case]]]:
    some = train.isel(time_s=slice(0, _QUICK_CIRCUIT)) if quick else train
    return [
        ("circuit: linear", partial(_linear, some, test)),
        ("circuit: filter, curve, filter", partial(_circuit, some, test, quick)),
    ]


def _linear(train: xr.Dataset, test: xr.Dataset) -> _Case:
    fit, seconds = _timed(partial(fit_linear, train))
    run, truth = (one["output_v"].to_numpy()[_CIRCUIT_WINDOW:] for one in (fit.simulate(test), test))
    more = {"n_parameters": 13, "seconds": seconds, "status": "best of 15 passes"}
    return _Case(row=_row("wh2009", "linear, order 6", 1e3 * fit.rmse, 1e3 * rmse(truth, run), _RMSE, "mV", **more))


def _circuit(train: xr.Dataset, test: xr.Dataset, quick: bool) -> _Case:
    fit, seconds = _timed(partial(fit_wiener_hammerstein, train, scan_samples=8000 if quick else 15_000))
    run, truth = (one["output_v"].to_numpy()[_CIRCUIT_WINDOW:] for one in (fit.model.simulate(test), test))
    row = _row(
        "wh2009",
        "filter of order 3, cubic spline, filter of order 4",
        1e3 * fit.report.rmse,
        1e3 * rmse(truth, run),
        _RMSE,
        "mV",
        n_parameters=len(fit.report.names),
        seconds=seconds,
        status=fit.report.status,
    )
    return _Case(row=row, time_s=test["time_s"].to_numpy()[_CIRCUIT_WINDOW:], measured=truth, simulated=run, drawn=True)


def _dataset(cases: list[_Case], drawn: list[_Case]) -> xr.Dataset:
    rows = [case.row for case in cases]
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", np.arange(len(rows)), "-", "model on set"),
        "set": ("case", [row["set"] for row in rows], "-", "data set"),
        "model": ("case", [row["model"] for row in rows], "-", "model"),
        "train": ("case", [row["train"] for row in rows], "in the unit of the row", "figure on the training record"),
        "test": ("case", [row["test"] for row in rows], "in the unit of the row", "figure on the test record"),
        "unit": ("case", [row["unit"] for row in rows], "-", "unit of the row"),
    }
    units = {"emps": ("m", "position"), "cascaded_tanks": ("V", "level"), "wh2009": ("V", "output voltage")}
    for case in drawn:
        name = case.row["set"]
        unit, what = units[name]
        at = f"{name}_time_s"
        variables[at] = (at, case.time_s, "s", "time")
        variables[f"{name}_measured"] = (at, case.measured, unit, f"{what}, measured")
        variables[f"{name}_simulated"] = (at, case.simulated, unit, f"{what}, free run")
    return labelled_dataset(variables)
