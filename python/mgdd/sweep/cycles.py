"""The cycle model over any of its inputs."""

from __future__ import annotations

import logging
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, NoxProxy, OperatingPoint
from mgdd.engine.cycle import TRACES
from mgdd.errors import ConvergenceError, ParameterError, argument, did_you_mean
from mgdd.parallel.chunks import run_chunks
from mgdd.parallel.finished import hand_over
from mgdd.parallel.pool import MakesExecutor
from mgdd.presets.meant import CylinderLike, PointLike, engine_of
from mgdd.results.finding import Finding
from mgdd.results.labels import ANGLE, labelled_dataset
from mgdd.sweep.cases import Cases, case_of, cases_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd.results.dataset import Dataset

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
    needed = dict.fromkeys(name for name in request.outputs if name not in NOX)
    needed |= dict.fromkeys(["t_max_k"] if set(NOX) & set(request.outputs) else [])
    outputs = _batch(request, columns, [*needed, *([] if _ALWAYS in needed else [_ALWAYS])])
    result: dict[str, NDArray[np.generic]] = {VOID: np.flatnonzero(np.isnan(outputs[_ALWAYS]))}
    for name, proxy in zip(NOX, (request.nox.affine_log_ppm, request.nox.arrhenius_ppm), strict=True):
        if name in request.outputs:
            result[name] = proxy(outputs["t_max_k"])
    result |= {name: outputs[name] for name in request.outputs if name in outputs}
    return result | _traces(request, columns)


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
        columns_out: Mapping[str, NDArray[np.float64]] = _core.engine.batch(
            *shared, columns, outputs, *scheme, threads=1, form=request.form
        )
    except ParameterError as error:
        raise _located(error, request, columns) from None
    return columns_out


def _located(error: ParameterError, request: Request, columns: NDArray[np.float64]) -> ParameterError:
    """Name the case of an error by its inputs: its row in a chunk has no meaning to a caller."""
    match = re.match(r"case (\d+): ", str(error))
    if match is None:
        return error
    text = str(error)[match.end() :]
    if len(request.names) > 1:
        text += f" (at {case_text(request.names, columns[int(match[1])])})"
    return ParameterError(text, field=error.field, value=error.value, bound=error.bound)


def case_text(names: Sequence[str], row: NDArray[np.float64]) -> str:
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


_LOG = logging.getLogger(__name__)
_CHUNK_BYTES = 8 * 2**20  # what a chunk carries at most: few are under way, so they stay small beside the result
_SAMPLE = 100_000  # cases that show how many in a row share an operating point
_GRID_MOVES = ("ivc_cad", "evo_cad")  # a cycle of other valve timings has other crank angles


def sweep(
    cylinder: CylinderLike,
    point: PointLike | Mapping[str, ArrayLike] | xr.Dataset | None = None,
    over: Mapping[str, ArrayLike] | xr.Dataset | None = None,
    *,
    pointwise: bool = False,
    soc_cad: float = -6.0,
    outputs: str | Sequence[str] | None = None,
    keep_traces: bool | str | Sequence[str] = False,
    step_cad: float = 1.0,
    integrator: str = "trapezoid",
    nox: NoxProxy | None = None,
    executor: MakesExecutor | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Dataset:
    """Simulate a cycle for every point of a grid, or for every point of a list.

    The numbers are those of `mgdd.engine.simulate` for each point, to rounding; to one part in a million where thirty
    or more cycles in a row differ in timing, fuel and burn alone, which then share a table of the expansion. They do
    not depend on executor, workers or chunks.

    Parameters
    ----------
    cylinder, point, step_cad, integrator
        As in `mgdd.engine.simulate`; what is not swept. The point may be left out, ``sweep("puma_single", over)``.
    over : mapping of str to array_like, or Dataset
        Values by input: ``soc_cad``, ``burn_duration_cad``, ``trapped_mass_g``, and every field of cylinder and point
        that is a number. Each is one dimension of a grid, in the order given. A Dataset over ``point``, as
        `mgdd.design` gives it, is a list of points.
    pointwise : bool
        `over` is a list of points: columns of one length.
    soc_cad : float
        Start of combustion where it is not swept [°CA aTDC].
    outputs : str or sequence of str, optional
        Indicators and NOx proxies that are wanted; all of them if left out. Fewer need less memory.
    keep_traces : bool, str or sequence of str
        Names of traces that are wanted as well; True for all of `mgdd.engine.simulate` but the motored pressure.
    nox : NoxProxy, optional
        Constants of the NOx maps; the defaults are plausible, not of any engine.
    executor, workers, progress
        As in `mgdd.parallel.map_items`: threads on all cores if left out. Every worker computes on one thread.

    Returns
    -------
    xarray.Dataset
        The outputs over the names of `over`, or over ``point`` with the inputs as its coordinates. Cycles whose
        pressure leaves the physical range are NaN: attribute ``n_void`` counts them, and ``warnings`` names the first.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown input or output, values that repeat or are not finite or outside their domain, traces over valve
        timings, a result that is larger than the memory of this machine.
    mgdd.errors.ShapeError
        Columns of different length, or a Dataset over something else.
    mgdd.errors.WorkerLostError
        As in `mgdd.parallel.map_items`; ``partial`` is a Dataset as after Ctrl-C.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the whole Dataset, in which ``finished`` marks the cycles that were simulated; the others
        are NaN.

    Examples
    --------
    >>> from mgdd.engine import Cylinder, OperatingPoint
    >>> from mgdd.sweep import sweep
    >>> table = sweep(Cylinder(), OperatingPoint(), {"speed_rpm": [1000.0, 2000.0], "soc_cad": [-9.0, -6.0, -3.0]})
    >>> dict(table.sizes)
    {'speed_rpm': 2, 'soc_cad': 3}
    >>> table["efficiency_gross"].idxmax("soc_cad").values.tolist()
    [-3.0, -9.0]
    """
    if over is None:
        point, over = None, point
    cylinder, point = engine_of(cylinder, point)
    cases = cases_of(over, pointwise=pointwise)
    request = Request(
        cylinder=cylinder,
        point=point,
        soc_cad=soc_cad,
        names=tuple(cases.names),
        outputs=_chosen("outputs", outputs, [*_core.engine.indicator_units(), *NOX]),
        traces=_chosen(
            "keep_traces", None if keep_traces is True else () if keep_traces is False else keep_traces, TRACES
        ),
        step_cad=step_cad,
        integrator=integrator,
        nox=NoxProxy() if nox is None else nox,
    )
    angles = _angles(request)
    width = 8 * (len(request.outputs) + len(request.traces) * len(angles))
    _require_memory(cases, width)
    simulate_cases(request, cases.rows(cases.extremes()))  # a value outside its domain is found before any work
    rows = cases.columns(0, min(cases.n, _SAMPLE))
    request = replace(request, form=_core.engine.batch_form(cylinder, point, soc_cad, request.names, rows))
    arrays = {name: np.empty(cases.n) for name in request.outputs}
    arrays |= {name: np.empty((cases.n, len(angles))) for name in request.traces}
    finished, void = np.zeros(cases.n, bool), _Void()

    def keep(start: int, stop: int, part: Mapping[str, NDArray[Any]]) -> None:
        for name, array in arrays.items():
            array[start:stop] = part[name]
        void.add(start, part[VOID])
        finished[start:stop] = True

    stop = run_chunks(
        simulate_cases,
        lambda start, stop: (request, cases.columns(start, stop)),
        keep,
        cases.n,
        executor=executor,
        workers=workers,
        largest=max(1, _CHUNK_BYTES // (width + 8 * len(cases.names))),
        progress=progress,
    )
    for array in arrays.values() if stop else ():
        array[~finished] = np.nan
    return hand_over(_dataset(request, cases, arrays, angles, void, finished if stop else None), stop)


class _Void:
    """Counts the cases without a result, and remembers the first."""

    def __init__(self) -> None:
        self.count, self.first = 0, -1

    def add(self, start: int, numbers: NDArray[np.int64]) -> None:
        self.count += len(numbers)
        if len(numbers) and not 0 <= self.first < start + int(numbers[0]):
            self.first = start + int(numbers[0])


def _dataset(
    request: Request,
    cases: Cases,
    arrays: Mapping[str, NDArray[np.float64]],
    angles: NDArray[np.float64],
    void: _Void,
    finished: NDArray[np.bool_] | None,
) -> Dataset:
    variables = cases.coordinates()
    if request.traces:
        variables[ANGLE] = (ANGLE, angles)
    for name, array in arrays.items():
        variables[name] = ((*cases.dims, *((ANGLE,) if array.ndim == 2 else ())), cases.arranged(array))
    if finished is not None:
        variables["finished"] = (cases.dims, cases.arranged(finished), "-", "whether the cycle was simulated")
    doubts = [_finding(cases, void)] if void.count else []
    for doubt in doubts:
        _LOG.warning("%s", doubt)
    fixed = {name: value for name, value in request.point.to_dict().items() if value is not None}
    attrs: dict[str, Any] = {"integrator": request.integrator, "step_cad": request.step_cad}
    attrs |= {name: v for name, v in {**fixed, "soc_cad": request.soc_cad}.items() if name not in request.names}
    attrs |= {"n_void": void.count, "warnings": "\n".join(map(str, doubts))}
    return labelled_dataset(variables, attrs=attrs, copy=False).set_coords(request.names)


def _finding(cases: Cases, void: _Void) -> Finding:
    text = f"{void.count} of {cases.n} cycles leave the physical range of the pressure and are NaN, the first at "
    (row,) = cases.rows(np.array([void.first]))
    remedy = "take a smaller step_cad, less wall heat or other points"
    return Finding("unphysical", tuple(cases.names), text + case_text(cases.names, row), remedy)


def _chosen(what: str, given: str | Iterable[str] | None, choices: Iterable[str]) -> tuple[str, ...]:
    choices = tuple(choices)
    names = choices if given is None else (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if name not in choices:
            hint = did_you_mean(name, choices) or "known are"
            raise ParameterError.of(argument(what), name, f"a known name: {hint} {', '.join(choices)}")
    if len(set(names)) < len(names):
        raise ParameterError.of(argument(what), ", ".join(names), "names that differ")
    return names


def _angles(request: Request) -> NDArray[np.float64]:
    if not request.traces:
        return np.empty(0)
    for name in _GRID_MOVES:
        if name in request.names:
            raise ParameterError(f"keep_traces: not over {name}, which moves their crank angles; sweep once per value")
    return angles_of(request)


def _require_memory(cases: Cases, width: int) -> None:
    """Refuse a result that this machine cannot hold, before it is begun."""
    size, memory = cases.n * width, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if size > memory:
        raise ParameterError(
            f"{' x '.join(map(str, cases.shape))} cycles of {width} bytes each are {size} bytes "
            f"({size / 2**30:.3g} GiB), more than the {math.floor(memory / 2**30)} GiB of this machine: take fewer "
            "points or name fewer outputs and traces"
        )
