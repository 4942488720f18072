"""`mgdd throttle identify | validate`: a model from a log, and a model against a log."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd import identify
from mgdd.cli.from_library import Options
from mgdd.cli.options import add_command
from mgdd.cli.output import check_figure, check_output, emit, save_figure, wrote
from mgdd.cli.throttle_parameters import LOG, log_in
from mgdd.errors import ConvergenceError
from mgdd.optimize import FitOptions
from mgdd.results.fit import figures_of

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.throttle.validation import ThrottleValidation
    from mgdd.results import Fit

__all__ = ["add"]

_MODEL = Options(identify.identify_throttle, "model")
_FIT = Options(identify.identify_throttle, "limp_home_deg", "two_sided", "closed_deg", "open_deg")
_SEARCH = Options(FitOptions, "seed")
_LOG_TITLE = "columns of the log, by name, or by number from 0"
_LOG = logging.getLogger(__name__)

# Searches that ended without a tolerance met, but with a model: stiction makes the last of the cost rough.
_ENDED = ("stalled", "iteration_limit")


def add(verbs: Any) -> None:
    """Add both commands."""
    fit = add_command(
        verbs, "identify", _identify,
        help_text="fit a model to a log, test it on another, and name the parameters that the log does not identify",
        example="mgdd throttle identify chirp.csv --model pw_r --test steps.csv --output fit.toml --json",
        endings=".toml, the parameters, or .json",
    )  # fmt: skip
    fit.add_argument("file", metavar="FILE", help="log to fit: CSV, plain columns or .mat")
    _MODEL.add(fit)
    fit.add_argument("--test", metavar="FILE", help="log to test on, with the same columns")
    _FIT.add(fit)
    fit.add_argument(
        "--delay-samples",
        type=_counts,
        metavar="N[,N...]",
        help="samples until the duty acts; of several the best (default: searched for the groups, 0 for pw_*)",
    )
    _SEARCH.add(fit)
    fit.add_argument("--figure", metavar="FILE", help="draw the validation (.png, .svg or .pdf)")
    LOG.add(fit, _LOG_TITLE)
    check = add_command(
        verbs, "validate", _validate,
        help_text="run a fitted model against a log: free run, 5, 20 and 50 ms ahead, residual tests",
        example="mgdd throttle validate fit.toml steps.csv --json",
    )  # fmt: skip
    check.add_argument("fit", metavar="FIT.toml", help="parameters written by identify")
    check.add_argument("file", metavar="FILE", help="log: CSV, plain columns or .mat")
    check.add_argument("--figure", metavar="FILE", help="draw the validation (.png, .svg or .pdf)")
    LOG.add(check, _LOG_TITLE)


def _counts(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: must be whole numbers, for example 0,2,4") from None


def _identify(args: argparse.Namespace) -> None:
    check_output(args, ".toml", ".json")
    check_figure(args.figure)
    log = log_in(args, args.file)
    test = None if args.test is None else log_in(args, args.test)
    options = FitOptions(**_SEARCH.given(args))
    given = _MODEL.given(args) | _FIT.given(args)
    fit = identify.identify_throttle(log, test=test, delay_samples=args.delay_samples, options=options, **given)
    own = args.output if args.output is not None and Path(args.output).suffix == ".toml" else None
    if own is not None:
        Path(own).write_text(fit.to_toml(), encoding="utf-8", newline="\n")
        wrote(own)
        args.output = None
    validation = identify.validate_throttle(fit, log if test is None else test)
    payload = _payload(fit) | {"validation": validation.to_dict()}
    emit(args, payload, text=f"{fit.summary()}\n\n{validation.summary()}")
    if args.figure:
        _draw(validation, args.figure, fit.report.to_dataset())
    report = fit.report
    if not report.success and report.status not in _ENDED:
        raise ConvergenceError(f"{args.file}: the fit has failed ({report.message}); look at the log, or excite more")
    if report.status == "iteration_limit":
        _LOG.warning("%s: the search %s; the figures hold for what it has found", args.file, report.message)


def _payload(fit: Fit) -> dict[str, Any]:
    figures = fit.to_dict()
    same = ("source", "parameters", "stderr", "unidentifiable", "status", "success", "nit", "nfev")
    return {
        "model": fit.kind,
        **figures_of(fit),
        "findings": [str(finding) for finding in fit.findings],
        **{name: figures[name] for name in same},
    }


def _validate(args: argparse.Namespace) -> None:
    check_output(args)
    check_figure(args.figure)
    model = identify.load_throttle_model(args.fit)
    validation = identify.validate_throttle(model, log_in(args, args.file))
    emit(args, validation.to_dict(), text=validation.summary())
    if args.figure:
        _draw(validation, args.figure, None)


def _draw(validation: ThrottleValidation, file: str, correlation: xr.Dataset | None) -> None:
    from matplotlib.figure import Figure

    from mgdd import plot

    rows = 1 if correlation is None else 2
    figure = Figure(figsize=(12.0, 4.6 * rows), layout="constrained")
    axes = figure.subplots(rows, 3 if rows == 1 else 2).ravel()
    for pane, what in zip(axes, ("free_run", "n_step", "residuals"), strict=False):
        validation.plot(what, ax=pane)
    if correlation is not None:
        plot.correlation_matrix(correlation, ax=axes[3])
    save_figure(figure, file)
