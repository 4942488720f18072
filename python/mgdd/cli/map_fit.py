"""`mgdd map fit | predict`: a model of one response over the points of an experiment, and what models say elsewhere."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.map_files import CSV, table_writers
from mgdd.cli.options import add_over, option
from mgdd.cli.output import emit, warn
from mgdd.cli.ranges import grid_of
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.io.binary_files import read_netcdf
from mgdd.io.files import write_whole_text
from mgdd.io.parameters import ParameterFile
from mgdd.io.point_table import POINT, input_names, read_points
from mgdd.plot.identification import response_diagnostics
from mgdd.plot.style import drawn
from mgdd.results.labels import label_of
from mgdd.surrogate import ResponseModel, fit_response
from mgdd.surrogate.response_model import prediction_table

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.results import Fit


_COLUMN = Options(fit_response, "response")
_FIT = Options(fit_response, "kind", "degree", "select", "folds", "n_starts", "seed")


def _add_fit(parser: Any) -> None:
    option(parser, "file TABLE",
           ".nc of mgdd engine sweep, or .csv with a point per row and the unit in each name, in brackets behind it "
           "or in a second row")  # fmt: skip
    _COLUMN.add(parser)
    option(parser, "--factors NAME[,NAME]", "columns to fit it over (default: the inputs of a sweep; needed for .csv)")
    _FIT.add(parser)
    option(parser, "--figure FILE", "draw the diagnostics of the fit (.png, .svg or .pdf)")
    CSV.add(parser)


def _fit(args: argparse.Namespace) -> None:
    table, left_out = _table(args)
    factors = [str(name) for name in table.data_vars if name != args.response]
    fit = fit_response(table, args.response, factors=factors, **_FIT.given(args))
    source = f"{args.response} of {Path(args.file).name}, {table.sizes[POINT]} points"
    emit(
        args, {**_figures(fit, factors), "left_out": left_out}, text=fit.summary(),
        write={".toml": lambda file: write_whole_text(
            file, replace(fit.model.to_parameters(), notes={"source": source}).to_toml())},
        figure=lambda: drawn(response_diagnostics, fit.diagnostics, size=(6.6, 5.4 + 2.3 * -(-len(factors) // 3))),
    )  # fmt: skip


def _table(args: argparse.Namespace) -> tuple[xr.Dataset, int]:
    """Read response and factors; points where one is NaN, as of a cycle that was not simulated, are left out."""
    if args.factors is not None:
        factors = [name.strip() for name in args.factors.split(",")]
        if args.response in factors or len(set(factors)) < len(factors) or not all(factors):
            raise ParameterError(f"--factors {args.factors}: each name once, without the response {args.response}")
    elif Path(args.file).suffix.lower() == ".csv":
        raise ParameterError(f"--factors is needed: which columns of {args.file} make {args.response}")
    else:
        factors = list(input_names(read_netcdf(args.file), args.response))
        if not factors:
            raise ParameterError(f"--factors is needed: {args.file} does not say which of its columns are inputs")
    table = read_points(args.file, [*factors, args.response], **CSV.given(args))
    known = np.all([np.isfinite(column.to_numpy()) for column in table.data_vars.values()], axis=0)
    gone = int((~known).sum())
    if gone == known.size:
        raise DataError(f"{args.file}: {args.response} or a factor is NaN at every point: there is nothing to fit")
    if gone:
        warn(f"{gone} of {known.size} points have no value (NaN) and are left out", of=args.file)
    return table.isel({POINT: known}), gone


def _figures(fit: Fit, factors: Sequence[str]) -> dict[str, Any]:
    model = fit.model
    of_kind: dict[str, Any] = {"terms": list(model.terms)}
    if model.kind != "polynomial":
        of_kind = {"length_scales": dict(zip(factors, model.surface.length_scales.tolist(), strict=True))}
    return {
        **fit.to_dict(),
        "response": model.name,
        "unit": model.label.units,
        "factors": list(factors),
        "points": model.values.size,
        "checked_by": fit.checked_by,
        "noise_sd": float(model.surface.noise_sd),
        **of_kind,
        "outliers": np.flatnonzero(fit.diagnostics["outlier"].to_numpy()).tolist(),  # type: ignore[attr-defined]
    }


_LEVEL = Options(ResponseModel.predict, "level")


def _add_predict(parser: Any) -> None:
    option(parser, "files MODEL.toml", "models as mgdd map fit writes them", nargs="+")
    what = parser.add_mutually_exclusive_group(required=True)
    add_over(what, what="a factor")
    option(what, "--points FILE", "the points of a .csv or .nc file instead of a grid")
    _LEVEL.add(parser)
    option(parser, "--extrapolate", "also give values outside of the points that were fitted; they are NaN otherwise")
    CSV.add(parser)


def _predict(args: argparse.Namespace) -> None:
    models = [_model(file) for file in args.files]
    twice = next((m.name for k, m in enumerate(models) if m.name in [o.name for o in models[:k]]), None)
    if twice is not None:
        raise ParameterError(f"two files hold a model of {twice}: give one of each response")
    names = list(dict.fromkeys(name for model in models for name in model.factors))
    axes, columns = _places(args, names)
    table, outside = prediction_table(models, axes, columns, extrapolate=args.extrapolate, **_LEVEL.of(args))
    table.attrs["models"] = ", ".join(args.files)
    total = math.prod(table.sizes.values())
    what = "kept, extrapolated)"
    if not args.extrapolate:
        fewer = "leave them out" if args.points else "narrow --over"
        what = f"NaN): {fewer}, add points there (mgdd map design --extend), or keep them with --extrapolate"
    said = [
        f"{name}: {count} of {total} points lie outside of those that were fitted ({what}"
        for name, count in outside.items()
        if count
    ]
    warn(*said)
    payload = {
        "models": {model.name: file for model, file in zip(models, args.files, strict=True)},
        "shape": dict(table.sizes),
        "points": total,
        "extrapolated": outside,
        "ranges": {model.name: _range(table[model.name]) for model in models},
        "warnings": said,
    }
    text = _predicted(payload, table, models, args.output)
    emit(args, payload, text=text, write=table_writers(table))


def _model(file: str) -> ResponseModel:
    if Path(file).suffix != ".toml":
        raise ParameterError(f"{file}: a model ends in .toml, as mgdd map fit -o model.toml writes it")
    return ResponseModel.from_parameters(ParameterFile.read(file))


def _places(
    args: argparse.Namespace, names: Sequence[str]
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[np.float64]]]:
    """Give the axes of the answer, and where the models are asked."""
    if args.points:
        table = read_points(args.points, names, **CSV.given(args))
        return {POINT: table[POINT].to_numpy()}, {name: table[name].to_numpy() for name in names}
    grid = grid_of(args.over)
    lacking = [name for name in names if name not in grid]
    if lacking:
        raise ParameterError(f"--over {lacking[0]}=LOW:HIGH:N is missing: the models need {', '.join(names)}")
    odd = [name for name in grid if name not in names]
    if odd:
        near = did_you_mean(odd[0], names) or f"they have {', '.join(names)}"
        raise ParameterError(f"--over {odd[0]}: not a factor of the models: {near}")
    return dict(grid), dict(zip(grid, np.meshgrid(*grid.values(), indexing="ij"), strict=True))


def _range(values: xr.DataArray) -> list[float] | None:
    known = values.to_numpy()[np.isfinite(values.to_numpy())]
    return [float(known.min()), float(known.max())] if known.size else None


def _predicted(payload: Mapping[str, Any], table: xr.Dataset, models: Sequence[ResponseModel], file: str | None) -> str:
    size = " x ".join(f"{count} {name}" for name, count in payload["shape"].items())
    out = [f"{payload['points']} points: {size}"]
    for model in models:
        found, label = payload["ranges"][model.name], label_of(table[model.name])
        said = "no value inside of the fitted points" if found is None else f"{found[0]:.4g} to {found[1]:.4g}"
        out.append(f"{model.name}: {said} {'' if label.units == '-' or found is None else label.units}".rstrip())
    return "\n".join([*out, *([] if file else ["-o table.nc keeps the table"])])


COMMANDS = {"fit": (_add_fit, _fit), "predict": (_add_predict, _predict)}
