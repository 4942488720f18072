"""`mgdd map predict`: what fitted models say on a grid or at points, as a table."""

from __future__ import annotations

import argparse
import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.from_library import Options
from mgdd.cli.map_files import CSV, write_table
from mgdd.cli.options import add_command
from mgdd.cli.output import check_output, emit
from mgdd.cli.ranges import add_over, grid_of
from mgdd.errors import ParameterError, did_you_mean
from mgdd.io.parameters import ParameterFile
from mgdd.io.point_table import POINT, read_points
from mgdd.results.labels import label_of
from mgdd.surrogate import ResponseModel
from mgdd.surrogate.response_model import prediction_table

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["add_predict"]

_LOG = logging.getLogger(__name__)
_LEVEL = Options(ResponseModel.predict, "level")


def add_predict(verbs: Any) -> None:
    """Add the command of a prediction."""
    parser = add_command(
        verbs, "predict", _predict,
        help_text="evaluate fitted models on a grid, as a table that mgdd map optimize reads",
        example="mgdd map predict efficiency.toml p_max.toml --over speed_rpm=1000:3000:9 --over fuel_mg=6:30:7 "
        "--over soc_cad=-16:4:81 -o table.nc",
        endings=".nc, netCDF; with --points also .csv",
    )  # fmt: skip
    parser.add_argument("files", nargs="+", metavar="MODEL.toml", help="models as mgdd map fit writes them")
    what = parser.add_mutually_exclusive_group(required=True)
    add_over(what, what="a factor")
    what.add_argument("--points", metavar="FILE", help="the points of a .csv or .nc file instead of a grid")
    _LEVEL.add(parser)
    parser.add_argument(
        "--extrapolate", action="store_true",
        help="also give values outside of the points that were fitted; they are NaN otherwise",
    )  # fmt: skip
    CSV.add(parser)


def _predict(args: argparse.Namespace) -> None:
    check_output(args, ".nc", *((".csv",) if args.points else ()))
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
    for text in said:
        _LOG.warning("%s", text)
    file, args.output = args.output, None
    if file is not None:
        write_table(table, file)
    payload = {
        "models": {model.name: file for model, file in zip(models, args.files, strict=True)},
        "shape": dict(table.sizes),
        "points": total,
        "extrapolated": outside,
        "ranges": {model.name: _range(table[model.name]) for model in models},
        "warnings": said,
        "file": file,
    }
    emit(args, payload, text=_predicted(payload, table, models))


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


def _predicted(payload: Mapping[str, Any], table: xr.Dataset, models: Sequence[ResponseModel]) -> str:
    size = " x ".join(f"{count} {name}" for name, count in payload["shape"].items())
    out = [f"{payload['points']} points: {size}"]
    for model in models:
        found, label = payload["ranges"][model.name], label_of(table[model.name])
        said = "no value inside of the fitted points" if found is None else f"{found[0]:.4g} to {found[1]:.4g}"
        out.append(f"{model.name}: {said} {'' if label.units == '-' or found is None else label.units}".rstrip())
    return "\n".join([*out, *([] if payload["file"] else ["-o table.nc keeps the table"])])
