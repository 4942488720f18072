"""One chunk of a sweep, as a worker computes it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, NoxProxy, OperatingPoint
from mgdd.errors import ConvergenceError, ParameterError
from mgdd.results.labels import ANGLE
from mgdd.sweep.inputs import case_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

NOX = ("nox_affine_log_ppm", "nox_arrhenius_ppm")
VOID = "void"  # numbers of the cases whose pressure leaves the physical range
_ALWAYS = "p_max_bar"  # finite for every cycle that is one


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is the same for all cases of a sweep."""

    cylinder: Cylinder
    point: OperatingPoint
    soc_cad: float
    names: tuple[str, ...]
    outputs: tuple[str, ...]
    traces: tuple[str, ...]
    step_cad: float
    integrator: str
    nox: NoxProxy
    form: str = "automatic"  # of the batch kernel; one for a whole sweep, or the bits would depend on the chunks


def simulate_cases(request: Request, columns: NDArray[np.float64]) -> dict[str, NDArray[np.generic]]:
    """Simulate cases that differ in the named inputs, on one thread."""
    wanted = dict.fromkeys(name for name in request.outputs if name not in NOX)
    wanted |= dict.fromkeys(["t_max_k"] if set(NOX) & set(request.outputs) else [])
    found = _batch(request, columns, [*wanted, *([] if _ALWAYS in wanted else [_ALWAYS])])
    out: dict[str, NDArray[np.generic]] = {VOID: np.flatnonzero(np.isnan(found[_ALWAYS]))}
    for name, proxy in zip(NOX, (request.nox.affine_log_ppm, request.nox.arrhenius_ppm), strict=True):
        if name in request.outputs:
            out[name] = proxy(found["t_max_k"])
    out |= {name: found[name] for name in request.outputs if name in found}
    return out | _traces(request, columns)


def angles_of(request: Request) -> NDArray[np.float64]:
    """Give the crank angles of the traces [°CA aTDC]."""
    raw = _core.engine.simulate(
        request.cylinder, request.point.replace(fuel_mg=0.0), request.soc_cad, request.step_cad, request.integrator
    )
    return np.asarray(raw[ANGLE])


def _batch(request: Request, columns: NDArray[np.float64], outputs: Sequence[str]) -> Mapping[str, NDArray[np.float64]]:
    shared = (request.cylinder, request.point, request.soc_cad, request.names)
    scheme = (request.step_cad, request.integrator)
    try:
        found: Mapping[str, NDArray[np.float64]] = _core.engine.batch(
            *shared, columns, outputs, *scheme, threads=1, form=request.form
        )
    except ParameterError as error:
        raise _located(error, request, columns) from None
    return found


def _located(error: ParameterError, request: Request, columns: NDArray[np.float64]) -> ParameterError:
    """Name the case of an error by its inputs: its row in a chunk has no meaning to a caller."""
    match = re.match(r"case (\d+): ", str(error))
    if match is None:
        return error
    text = str(error)[match.end() :]
    if len(request.names) > 1:
        text += f" (at {said(request.names, columns[int(match[1])])})"
    return ParameterError(text, field=error.field, value=error.value, bound=error.bound)


def said(names: Sequence[str], row: NDArray[np.float64]) -> str:
    """Name a case by its inputs."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(names, row, strict=True))


def _traces(request: Request, columns: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    if not request.traces:
        return {}
    cycles: list[Mapping[str, NDArray[np.float64]] | None] = []
    for row in columns.tolist():
        values = dict(zip(request.names, row, strict=True))
        cylinder, point, soc = case_of(request.cylinder, request.point, request.soc_cad, values)
        try:
            cycles.append(_core.engine.simulate(cylinder, point, soc, request.step_cad, request.integrator))
        except ConvergenceError:
            cycles.append(None)
    nothing = np.full(len(angles_of(request)), np.nan)
    return {name: np.stack([nothing if cycle is None else cycle[name] for cycle in cycles]) for name in request.traces}
