"""`mgdd engine sweep`: cycles over a grid of inputs, into a netCDF file."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.cli.options import add_command, add_engine, add_scheme, engine_of
from mgdd.cli.output import Stopped, check_output, emit, wrote
from mgdd.errors import Interrupted, ParameterError
from mgdd.sweep import sweep

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["add_sweep"]


def add_sweep(verbs: Any) -> None:
    """Add the command."""
    parser = add_command(
        verbs, "sweep", _sweep,
        help_text="simulate a cycle for every point of a grid; -o FILE.nc keeps the table",
        example="mgdd engine sweep --over soc_cad=-20:5:51 --over speed_rpm=1000:3000:9 -o table.nc --json",
        endings=".nc, netCDF",
    )  # fmt: skip
    parser.add_argument(
        "--over", action="append", default=[], required=True, metavar="NAME=LOW:HIGH:N",
        help="N even values of an input from LOW to HIGH, both included; repeatable, one dimension each",
    )  # fmt: skip
    parser.add_argument(
        "--outputs", metavar="NAME[,NAME]", help="indicators that are wanted (default: all of them and the NOx proxies)"
    )
    parser.add_argument("--soc-cad", type=float, default=-6.0, metavar="X", help="where it is not swept (default: -6)")
    parser.add_argument("--workers", type=int, metavar="N", help="threads (default: one per core)")
    add_engine(parser)
    add_scheme(parser, step_cad=1.0)


def _sweep(args: argparse.Namespace) -> None:
    check_output(args, ".nc")
    grid = _grid(args.over)
    cylinder, point, preset = engine_of(args)
    begun, stopped = time.perf_counter(), None
    try:
        table = sweep(
            cylinder,
            point,
            grid,
            soc_cad=args.soc_cad,
            outputs=args.outputs.split(",") if args.outputs else None,
            step_cad=args.step_cad,
            integrator=args.integrator,
            workers=args.workers,
        )
        cycles = math.prod(table.sizes.values())
    except Interrupted as stop:
        stopped, table = str(stop), stop.partial
        cycles = int(table["finished"].sum())
    seconds = time.perf_counter() - begun
    file, args.output = args.output, None  # the object below goes to stdout, the table into the file
    if file is not None:
        _write(table, Path(file))
        wrote(file)
    payload = {
        "preset": preset.name,
        "shape": dict(table.sizes),
        "cycles": cycles,
        "cycles_per_s": cycles / seconds,
        "n_void": table.attrs["n_void"],
        "warnings": table.attrs["warnings"].splitlines(),
        "file": file,
    }
    emit(args, payload)
    if stopped is not None:
        raise Stopped(f"{cycles} cycles are kept" if file else "nothing was kept; name a file with -o")


def _grid(given: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    grid: dict[str, NDArray[np.float64]] = {}
    for item in given:
        name, _, span = item.partition("=")
        name, parts = name.strip().replace("-", "_"), span.split(":")
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        except (ValueError, IndexError):
            parts = []
        if len(parts) != 3 or not name:
            raise ParameterError(f"--over {item}: write NAME=LOW:HIGH:N, for example soc_cad=-20:5:51")
        if name in grid:
            raise ParameterError(f"--over {name} is given twice: give it once")
        if count < 1 or not math.isfinite(low) or not math.isfinite(high) or (count == 1) != (low == high):
            raise ParameterError(f"--over {item}: LOW and HIGH must be finite and differ, N >= 2; or LOW = HIGH, N = 1")
        grid[name] = np.linspace(low, high, count)
    return grid


def _write(table: xr.Dataset, path: Path) -> None:
    """Write netCDF under a name of its own and rename: nobody finds half a file."""
    beside = path.with_name(f"{path.stem}.writing{path.suffix}")
    try:
        table.to_netcdf(beside, engine="scipy")
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
