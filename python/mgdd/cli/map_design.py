"""`mgdd map design`: which points to run, inside what the model of the engine allows."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd._core.engine import OperatingPoint
from mgdd.cli.from_library import Options, named_options
from mgdd.cli.map_files import CSV, doubts_said, table_writers
from mgdd.cli.options import SCHEME, add_engine, engine_of, option, refuse_idle
from mgdd.cli.output import emit, lines
from mgdd.cli.ranges import factors_of, number_pairs
from mgdd.design import FeasibleRegion, design_points
from mgdd.errors import DataError, ParameterError
from mgdd.io.point_table import read_points
from mgdd.report import Table
from mgdd.sweep import sweep

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr
    from numpy.typing import NDArray

_DESIGN = Options(design_points, "method", "seed", "model", "n_starts", n="points")
_MARGIN, _TIMING = Options(FeasibleRegion.of_points, "margin"), Options(sweep, "soc_cad")
_ENGINE = ("preset", "set", *OperatingPoint.fields(), "burn", "gamma", "wall_heat", "ignition", "soc_cad")


def _add_design(parser: Any) -> None:
    option(parser, "--over NAME=LOW:HIGH[:N] ...",
           "range of a factor in the unit that its name ends in; with N, or as NAME=VALUE,VALUE, only these levels; "
           "repeatable", required=True)  # fmt: skip
    _DESIGN.add(parser)
    option(parser, "--limit NAME=X ...",
           "keep an indicator of the model at or below X, in the unit that its name ends in; repeatable")  # fmt: skip
    option(parser, "--within FILE",
           "points that the engine was driven at, .csv or .nc: new ones stay between them, in their convex hull",
    )  # fmt: skip
    _MARGIN.add(parser)
    option(parser, "--refused FILE",
           "of --within: points that could not be driven; what is nearer to one of them than to a driven one is out",
    )  # fmt: skip
    option(parser, "--extend FILE",
           "points that were run, .csv or .nc: new ones keep away from them and are numbered behind them")  # fmt: skip
    _TIMING.add(parser)
    CSV.add(parser)
    add_engine(parser)
    SCHEME.add(parser, "scheme")


def _design(args: argparse.Namespace) -> None:
    method = _DESIGN.of(args)["method"]
    if method != "d_optimal":
        refuse_idle(args, "model", why=f"--method {method} fits no polynomial")
    factors, limits = factors_of(args.over), number_pairs(args.limit, "--limit")
    region, driven = _region(args, limits), _driven(args, tuple(factors))
    before = _before(args, tuple(factors))
    with doubts_said() as said, named_options(n="points", existing="extend", outputs="limit"):
        plan = design_points(factors, feasible=_both(region, driven), existing=before, **_DESIGN.given(args))
    attrs = dict(plan.attrs)
    starts = attrs.pop("log_det_starts", None)
    columns = {str(name): plan[name].to_numpy() for name in plan.data_vars}
    highest = {}
    if region is not None:
        judged = region.evaluate(plan)
        highest = {name: float(judged[name].max()) for name in limits}
    payload = {
        **attrs,
        "points": plan.sizes["point"],
        **({} if starts is None else {"log_det_starts": starts}),
        "limits": dict(limits),
        "highest": highest,
        "warnings": said,
        "point": plan["point"].to_numpy(),
        "columns": columns,
    }
    payload["within"] = args.within
    payload["existing"] = 0 if before is None else before.sizes["point"]
    emit(args, payload, text=_text(payload, plan if args.output is None else None), write=table_writers(plan))


def _region(args: argparse.Namespace, limits: Mapping[str, float]) -> FeasibleRegion | None:
    if not limits:
        refuse_idle(args, *_ENGINE, why="without --limit no model is asked")
        if args.motored:
            raise ParameterError("--motored does not act here; without --limit no model is asked")
        return None
    cylinder, point, _ = engine_of(args)
    how = _TIMING.given(args) | SCHEME.given(args)

    def indicators(columns: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
        found = sweep(cylinder, point, columns, pointwise=True, outputs=tuple(limits), **how)
        return {name: found[name].to_numpy() for name in limits}

    return FeasibleRegion.of_model(indicators, limits)


def _driven(args: argparse.Namespace, names: tuple[str, ...]) -> FeasibleRegion | None:
    if args.within is None:
        refuse_idle(args, "margin", "refused", why="it is of the measured points of --within FILE")
        return None
    how = CSV.given(args)
    driven = read_points(args.within, names, **how)[list(names)]
    refused = None if args.refused is None else read_points(args.refused, names, **how)[list(names)]
    with named_options(infeasible="refused"):
        try:
            return FeasibleRegion.of_points(driven, infeasible=refused, **_MARGIN.given(args))
        except DataError as error:
            said = str(error)
            raise error.reworded(said if said.startswith("--") else f"{args.within}: {said}") from error


def _both(region: FeasibleRegion | None, driven: FeasibleRegion | None) -> Any:
    """Make one region of the limits of the model and the measured boundary, where both are given."""
    if region is None or driven is None:
        return region or driven
    return lambda columns: region.contains(columns) & driven.contains(columns)


def _before(args: argparse.Namespace, names: tuple[str, ...]) -> xr.Dataset | None:
    if args.extend is None:
        return None
    if args.output is not None and Path(args.output).resolve() == Path(args.extend).resolve():
        raise ParameterError(f"-o {args.output}: the file of --extend; new points would replace it: name another")
    return read_points(args.extend, names, **CSV.given(args))


def _text(payload: dict[str, Any], shown: xr.Dataset | None) -> list[str | Table]:
    names = ("method", "points", "existing", "feasible_share", "least_distance", "d_efficiency_percent")
    out: list[str | Table] = [lines({name: payload[name] for name in names if name in payload})]
    out += [
        f"{name}: at most {value:.4g} at these points by the model, limit {payload['limits'][name]:g}"
        for name, value in payload["highest"].items()
    ]
    if shown is None:
        return out
    columns = {"point": shown["point"].to_numpy(), **payload["columns"]}
    rows = zip(*([f"{value:.6g}" for value in column] for column in columns.values()), strict=True)
    return [*out, "", Table(columns=tuple(columns), rows=tuple(rows)), "", "-o design.csv keeps the points"]


COMMANDS = {"design": (_add_design, _design)}
