"""Measured benchmarks of identification: a drive with friction, cascaded tanks, a Wiener-Hammerstein circuit."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import new_figure, residual_below
from mgdd.plot.throttle import measured_and_model
from mgdd.results.labels import labelled_dataset
from mgdd.signals import nrmse_fit_percent
from mgdd.signals.metrics import rmse
from mgdd_studies.base import Parts, Progress, StudyResult
from mgdd_studies.benchmarks.drive_axis import drive_free_run, fit_drive
from mgdd_studies.benchmarks.records import read
from mgdd_studies.benchmarks.two_tanks import fit_two_tanks, start_levels
from mgdd_studies.benchmarks.wiener_hammerstein import fit_linear, fit_wiener_hammerstein

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mgdd.identify import SimulatorModel

    Vector = NDArray[np.float64]

__all__ = ["run_identification_benchmarks"]

Result = TypeVar("Result")
_NAME = "identification-benchmarks"
_DRIVE_WINDOW, _TANKS_WINDOW, _CIRCUIT_WINDOW, _CIRCUIT_TRAIN_WINDOW = 20, 50, 50, 100
_LAST_CYCLE, _SECOND_CYCLE = 18_650, 6220  # first samples of them; a motion cycle of the training record takes 6.2 s
_QUICK_DRIVE, _QUICK_CIRCUIT = 12_440, 10_000  # samples of the estimation record: two motion cycles of the drive


class _Set(NamedTuple):
    """How a set is judged: figure and its unit, what others published, what may be seen; and what is measured there."""

    metric: str
    unit: str
    published: str
    window: str
    measured: tuple[str, str]
    caption: str


_SETS = {
    "emps": _Set(
        "fit 100 (1 - |e| / |y - mean y|), free run", "%",
        "96.8 dynoNet; 25.4 best linear model, Janot et al. 2019 (both as quoted by Forgione and Piga 2021)",
        "position and speed at the start from samples 0 to 19, scored from sample 20",
        ("m", "position"),
        "Drive with friction, pulses record: free run from the measured voltage",
    ),
    "cascaded_tanks": _Set(
        "RMSE, free run", "V",
        "0.18 to 0.20 physical grey boxes of 2017 and 2018 (recalled; the papers were not at hand)",
        "two levels at the start estimated on test samples 0 to 49, scored on all 1024",
        ("V", "level"),
        "Cascaded tanks, test record: free run from two estimated levels",
    ),
    "wh2009": _Set(
        "RMSE, free run", "mV",
        "0.28 Schoukens et al. 2014; 1.2 dynoNet (both as quoted by Forgione and Piga 2021); 44 best linear model",
        "filters from rest, test samples 0 to 49 not scored",
        ("V", "output voltage"),
        "Wiener-Hammerstein circuit, 4 ms of the test record: free run from rest",
    ),
}  # fmt: skip


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
        The simplest and the best form of the drive, fitted to its first two cycles, and 10 000 samples for the circuit.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        ``summary["rows"]``: ``set``, ``model``, ``train``, ``test``, ``metric``, ``unit``, ``published`` (text with
        source), and ``window``, ``n_parameters``, ``seconds`` (CPU of the fit), ``status``; for the drive also
        ``hold_out`` (the figure on one cycle of the training record after a fit to the others, by which the form is
        chosen; None in a quick run).

    Raises
    ------
    mgdd.errors.DataError
        None of the three sets is at hand. A set that is missing is left out and named in ``missing``.

    References
    ----------
    Janot, Gautier and Brunot (2019); Schoukens and Noël (2017); Schoukens, Suykens and Ljung (2009).

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd_studies import run_study
    >>> if "cascaded_tanks" in records.names():
    ...     result = run_study("identification-benchmarks", quick=True)
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
            train, test = read(name)
        except FileNotFoundError as error:
            missing.append(name)
            reason = str(error.strerror)
            continue
        parts += make(train, test, quick)
    if not parts:
        raise DataError(f"the study {_NAME} needs at least one of {', '.join(missing)}: {reason}")
    work = Parts(progress)
    cases = work(parts)
    drawn = [case for case in cases if case.drawn]
    return work.finish(
        _NAME, _dataset(cases, drawn), _draw if figures else None,
        seeds=0,
        quick=quick,
        missing=missing,
        rows=[case.row for case in cases],
    )  # fmt: skip


def _row(
    name: str, model: str, figures: tuple[float, float], seconds: float, n_parameters: int, status: str, **more: Any
) -> dict[str, Any]:
    judged, (train, test) = _SETS[name], figures
    return {
        "set": name, "model": model, "train": train, "test": test, "metric": judged.metric, "unit": judged.unit,
        "published": judged.published, "window": judged.window, "n_parameters": n_parameters, "seconds": seconds,
        "status": status, **more,
    }  # fmt: skip


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
        for text, friction, drift in (forms[::4] if quick else forms)
    ]


def _hold_out(train: xr.Dataset, friction: str, drift: bool) -> float:
    """Mean fit [%] of the last cycle after a fit to the first three, and of the first after a fit to the others."""
    early = fit_drive(train.isel(time_s=slice(0, _LAST_CYCLE)), friction=friction, drift=drift)
    late = fit_drive(train.isel(time_s=slice(_SECOND_CYCLE, None)), friction=friction, drift=drift)
    first = train.isel(time_s=slice(0, _SECOND_CYCLE))
    tail, whole = _LAST_CYCLE - _DRIVE_WINDOW, train["position_m"].to_numpy()
    return 0.5 * (
        nrmse_fit_percent(whole[_LAST_CYCLE:], drive_free_run(early.model, train)[tail:])
        + nrmse_fit_percent(whole[_DRIVE_WINDOW:_SECOND_CYCLE], drive_free_run(late.model, first))
    )


def _drive(train: xr.Dataset, test: xr.Dataset, text: str, friction: str, drift: bool, quick: bool) -> _Case:
    seen = train.isel(time_s=slice(0, _QUICK_DRIVE)) if quick else train
    fit, seconds = _timed(partial(fit_drive, seen, friction=friction, drift=drift))
    runs = {key: drive_free_run(fit.model, record) for key, record in (("train", seen), ("test", test))}
    truth = {key: record["position_m"].to_numpy()[_DRIVE_WINDOW:] for key, record in (("train", seen), ("test", test))}
    scores = {key: nrmse_fit_percent(truth[key], runs[key]) for key in runs}
    row = _row(
        "emps", text, (scores["train"], scores["test"]), seconds, len(fit.report.names) - 2, fit.report.status,
        hold_out=None if quick else _hold_out(train, friction, drift),
    )  # fmt: skip
    return _Case(
        row=row, time_s=test["time_s"].to_numpy()[_DRIVE_WINDOW:], measured=truth["test"], simulated=runs["test"],
        drawn=friction == "stribeck" and drift,
    )  # fmt: skip


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
    state = start_levels(fit.model, test, window=_TANKS_WINDOW)
    run = fit.model.simulate(test, initial_state=state)["level_v"].to_numpy()
    truth = test["level_v"].to_numpy()
    more = {"test_without_window": rmse(truth[_TANKS_WINDOW:], run[_TANKS_WINDOW:])}
    row = _row(
        "cascaded_tanks",
        text,
        (fit.report.rmse, rmse(truth, run)),
        seconds,
        len(fit.report.names),
        fit.report.status,
        **more,
    )
    return _Case(row=row, time_s=test["time_s"].to_numpy(), measured=truth, simulated=run, drawn=form == "grey_box")


def _circuit_parts(train: xr.Dataset, test: xr.Dataset, quick: bool) -> list[tuple[str, partial[_Case]]]:
    some = train.isel(time_s=slice(0, _QUICK_CIRCUIT)) if quick else train
    return [
        ("circuit: linear", partial(_linear, some, test)),
        ("circuit: filter, curve, filter", partial(_circuit, some, test)),
    ]


def _linear(train: xr.Dataset, test: xr.Dataset) -> _Case:
    model, seconds = _timed(partial(fit_linear, train))
    figures, _, _ = _scores(model, train, test)
    return _Case(row=_row("wh2009", "linear, order 6", figures, seconds, 13, "best of 15 passes"))


def _circuit(train: xr.Dataset, test: xr.Dataset) -> _Case:
    fit, seconds = _timed(partial(fit_wiener_hammerstein, train))
    figures, run, truth = _scores(fit.model, train, test)
    name = "filter of order 3, cubic spline, filter of order 4"
    row = _row("wh2009", name, figures, seconds, len(fit.report.names), fit.report.status)
    return _Case(row=row, time_s=test["time_s"].to_numpy()[_CIRCUIT_WINDOW:], measured=truth, simulated=run, drawn=True)


def _scores(model: SimulatorModel, train: xr.Dataset, test: xr.Dataset) -> tuple[tuple[float, float], Vector, Vector]:
    """Give the errors of the free run on both records [mV], and the run and what was measured on the last."""
    errors = []
    for record, skip in ((train, _CIRCUIT_TRAIN_WINDOW), (test, _CIRCUIT_WINDOW)):
        run, truth = (one["output_v"].to_numpy()[skip:] for one in (model.simulate(record), record))
        errors.append(1e3 * rmse(truth, run))
    return (errors[0], errors[1]), run, truth


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
    for case in drawn:
        name = case.row["set"]
        unit, what = _SETS[name].measured
        at = f"{name}_time_s"
        variables[at] = (at, case.time_s, "s", "time")
        variables[f"{name}_measured"] = (at, case.measured, unit, f"{what}, measured")
        variables[f"{name}_simulated"] = (at, case.simulated, unit, f"{what}, free run")
    return labelled_dataset(variables)


_SHOWN = {"wh2009": slice(20_000, 20_205)}


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw measured and free run over each other, and the residual below; nothing is registered with pyplot."""
    return {own.caption: _overlay(dataset, name) for name, own in _SETS.items() if f"{name}_measured" in dataset}


def _overlay(dataset: xr.Dataset, name: str) -> Figure:
    own = {f"{name}_{column}": column for column in ("time_s", "measured", "simulated")}
    run = dataset[list(own)].rename(own).rename(simulated="model").isel(time_s=_SHOWN.get(name, slice(None)))
    residual = (run["model"] - run["measured"]).assign_attrs(run["measured"].attrs)
    figure = new_figure(8.0, 5.0)
    ax = figure.add_subplot()
    measured_and_model(run, ax=ax).set_xlabel("")
    residual_below(ax, run.assign(residual=residual), "time_s", "residual")
    return figure
