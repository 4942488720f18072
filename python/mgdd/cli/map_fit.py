"""`mgdd map fit`: a model of one response over the points of an experiment."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.map_files import CSV
from mgdd.cli.options import add_command
from mgdd.cli.output import check_figure, check_output, emit, save_figure, wrote
from mgdd.errors import DataError, ParameterError
from mgdd.io.binary_files import read_netcdf
from mgdd.io.files import write_whole_text
from mgdd.io.point_table import POINT, input_names, read_points
from mgdd.plot.response import response_diagnostics
from mgdd.plot.style import drawn
from mgdd.results.fit import figures_of
from mgdd.surrogate import fit_response

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.results import Fit

__all__ = ["add_fit"]

_LOG = logging.getLogger(__name__)
_COLUMN = Options(fit_response, "response")
_FIT = Options(fit_response, "kind", "degree", "select", "folds", "n_starts", "seed")


def add_fit(verbs: Any) -> None:
    """Add the command of a fit."""
    parser = add_command(
        verbs, "fit", _fit,
        help_text="fit a model of one response to measured or simulated points, and say how far it may be believed",
        example="mgdd map fit table.nc --response efficiency_gross --factors speed_rpm,fuel_mg,soc_cad -o model.toml "
        "--figure fit.png",
        endings=".toml, the model with its points; .json, the figures of the fit",
    )  # fmt: skip
    parser.add_argument(
        "file", metavar="TABLE",
        help=".nc of mgdd engine sweep, or .csv with a point per row and the unit in each name, in brackets behind it "
        "or in a second row",
    )  # fmt: skip
    _COLUMN.add(parser)
    parser.add_argument(
        "--factors",
        metavar="NAME[,NAME]",
        help="columns to fit it over (default: the inputs of a sweep; needed for .csv)",
    )
    _FIT.add(parser)
    parser.add_argument("--figure", metavar="FILE", help="draw the diagnostics of the fit (.png, .svg or .pdf)")
    CSV.add(parser)


def _fit(args: argparse.Namespace) -> None:
    check_output(args, ".toml", ".json")
    check_figure(args.figure)
    table, left_out = _table(args)
    factors = [str(name) for name in table.data_vars if name != args.response]
    fit = fit_response(table, args.response, factors=factors, **_FIT.given(args))
    if args.output is not None and Path(args.output).suffix == ".toml":
        source = f"{args.response} of {Path(args.file).name}, {table.sizes[POINT]} points"
        write_whole_text(args.output, replace(fit.model.to_parameters(), notes={"source": source}).to_toml())
        wrote(args.output)
        file, args.output = args.output, None
    else:
        file = None
    emit(args, {**_figures(fit, factors), "left_out": left_out, "file": file}, text=fit.summary())
    if args.figure is not None:
        save_figure(_picture(fit, len(factors)), args.figure)


def _table(args: argparse.Namespace) -> tuple[xr.Dataset, int]:
    """Read response and factors; points where one is NaN, as of a cycle that was not simulated, are left out."""
    if args.factors is not None:
        factors = [name.strip() for name in args.factors.split(",")]
        if args.response in factors or len(set(factors)) < len(factors) or not all(factors):
            raise ParameterError(f"--factors {args.factors}: each name once, without the response {args.response}")
    elif Path(args.file).suffix.lower() == ".csv":
        raise ParameterError(f"--factors is needed: which columns of {args.file} make {args.response}")
    else:
        factors = _inputs(args.file, args.response)
    table = read_points(args.file, [*factors, args.response], **CSV.given(args))
    known = np.all([np.isfinite(column.to_numpy()) for column in table.data_vars.values()], axis=0)
    gone = int((~known).sum())
    if gone == known.size:
        raise DataError(f"{args.file}: {args.response} or a factor is NaN at every point: there is nothing to fit")
    if gone:
        _LOG.warning("%s: %d of %d points have no value (NaN) and are left out", args.file, gone, known.size)
    return table.isel({POINT: known}), gone


def _inputs(file: str, response: str) -> list[str]:
    """Name the inputs of a sweep: axes of its grid, or coordinates of its points."""
    inputs = list(input_names(read_netcdf(file), response))
    if not inputs:
        raise ParameterError(f"--factors is needed: {file} does not say which of its columns are inputs")
    return inputs


def _figures(fit: Fit, factors: Sequence[str]) -> dict[str, Any]:
    model, figures = fit.model, fit.to_dict()
    of_kind: dict[str, Any] = {"terms": list(model.terms)}
    if model.kind != "polynomial":
        of_kind = {"length_scales": dict(zip(factors, model.surface.length_scales.tolist(), strict=True))}
    return {
        "model": fit.kind,
        "response": model.name,
        "unit": model.label.units,
        "factors": list(factors),
        "points": model.values.size,
        **figures_of(fit),
        "checked_by": fit.checked_by,
        "noise_sd": float(model.surface.noise_sd),
        **of_kind,
        "parameters": figures["parameters"],
        "stderr": figures["stderr"],
        "unidentifiable": figures["unidentifiable"],
        "outliers": np.flatnonzero(fit.diagnostics["outlier"].to_numpy()).tolist(),  # type: ignore[attr-defined]
        "findings": [str(finding) for finding in fit.findings],
        "status": figures["status"],
    }


def _picture(fit: Any, factors: int) -> Any:
    return drawn(response_diagnostics, fit.diagnostics, size=(6.6, 5.4 + 2.3 * -(-factors // 3)))
