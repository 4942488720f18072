"""A seeker on any test rig, one ask, one cycle and one tell at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import Interrupted, ParameterError
from mgdd.loop import LoopRun, summarize_cycles
from mgdd.loop.bench import FLAGS
from mgdd.results import VARIABLES, labelled_dataset
from mgdd.rig.base import AnnouncingRig, Measurement, Rig

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.loop.seek import Seeker

__all__ = ["run_on_rig"]

_CHANGED = "operating_point_changed"
_UNKNOWN = "not given by the rig"
_OWN = ("estimate_cad", "soc_requested_cad", "j", "misfire")  # columns that the loop itself knows


class _Row(NamedTuple):
    """One measured cycle."""

    estimate: float
    applied: float
    void: bool
    measured: Measurement


def run_on_rig(
    rig: Rig,
    seeker: Seeker,
    cycles: int,
    *,
    optimum_cad: float | None = None,
    arrival_cad: float = 1.0,
    tail_cycles: int = 100,
    exceed_from: int = 1000,
    exceed_above: Mapping[str, float] | None = None,
) -> LoopRun:
    """Let a seeker steer a rig.

    Each cycle is one ask, one `Rig.apply`, one `Rig.measure` and one tell. A misfired cycle is told as such. A new
    operating point restarts the seeker: before its first cycle where the rig announces it (`AnnouncingRig`), otherwise
    after the first cycle whose ``values["operating_point_changed"]`` is true; the reading of that cycle then belongs to
    neither point and counts as void. On a `SimulatedRig` the trajectory is that of `mgdd.loop.run_seeker`, bit for bit.

    Parameters
    ----------
    rig : Rig
        Open; it stays open.
    seeker
        Any seeker of `mgdd.optimize` with one input, one component or as many as the rig measures, and limits that
        the rig measures.
    cycles : int
        How many.
    optimum_cad, arrival_cad, tail_cycles, exceed_from, exceed_above
        As in `mgdd.loop.run_seeker`; limits by their names on the rig.

    Returns
    -------
    LoopRun
        Cycles with everything that the rig measured, and their summary; figures that need a quantity which the rig
        does not measure are NaN.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one cycle, a seeker of several inputs, or one whose components or limits the rig does not measure.
    mgdd.errors.DataError
        A fired cycle whose reading is not finite. Errors of the rig pass through as well; the seeker then stands before
        that cycle, and its ``history`` holds the cycles so far.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the LoopRun of the cycles until then. Rig and seeker stand behind them, and calling again
        goes on.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.optimize import ExtremumSeeking
    >>> from mgdd.rig import SimulatedRig, run_on_rig
    >>> seeker = ExtremumSeeking(start=-20.0, lower=-30.0, upper=10.0)
    >>> with SimulatedRig(EngineBench(seed=1)) as rig:
    ...     run = run_on_rig(rig, seeker, 400, optimum_cad=-5.63)
    >>> abs(run.summary["final_cad"] + 5.63) < 2.0
    True
    """
    if cycles < 1:
        raise ParameterError(f"cycles = {cycles}: must be >= 1")
    if seeker.estimate.size != 1:
        raise ParameterError(f"start has {seeker.estimate.size} entries: a rig takes one input, soc_cad")
    if not isinstance(rig, Rig):
        raise ParameterError(f"rig = {rig!r}: must have apply() and measure(); wrap a bench in SimulatedRig")
    names = seeker.limit_names
    known = getattr(rig, "limit_names", None)
    if known is not None and not set(names) <= set(known):
        raise ParameterError(f"limits of the seeker {names} are not all measured by the rig, which has {list(known)}")
    if unknown := sorted(set(exceed_above or {}) - set(names)):
        raise ParameterError(f"exceed_above: {unknown} not among the limits of the seeker, {names}")
    announcing = rig if isinstance(rig, AnnouncingRig) else None
    first, log, interrupted = seeker.cycle, list[_Row](), False
    try:
        for _ in range(cycles):
            _one_cycle(rig, announcing, seeker, log)
    except KeyboardInterrupt:
        interrupted = True
        del log[seeker.cycle - first :]  # a cycle that was measured and not told: it is asked again
    dataset = _dataset(log, first)
    dataset.attrs["interrupted"] = int(interrupted)
    summary = summarize_cycles(
        dataset,
        optimum_cad=optimum_cad,
        arrival_cad=arrival_cad,
        tail_cycles=tail_cycles,
        exceed_from=exceed_from,
        exceed_above=exceed_above,
    )
    run = LoopRun(dataset=dataset, summary=summary, interrupted=interrupted)
    if interrupted:
        raise Interrupted(f"interrupted after {len(log)} of {cycles} cycles, which are in .partial", run)
    return run


def _one_cycle(rig: Rig, announcing: AnnouncingRig | None, seeker: Seeker, log: list[_Row]) -> None:
    if announcing is not None and announcing.operating_point_changes:
        seeker.restart()
    estimate = float(seeker.estimate[0])
    soc_cad = float(seeker.ask()[0])
    rig.apply(soc_cad)
    measured = rig.measure()
    _require_match(seeker, measured)
    late = announcing is None and bool(measured.values.get(_CHANGED, 0.0))
    void = measured.misfire or bool(measured.values.get("unphysical", 0.0)) or late
    summed = seeker.component_count == 1
    told = measured.performance if summed else np.array(measured.components)
    limits = [measured.limits[name] for name in seeker.limit_names]
    log.append(_Row(estimate, soc_cad, void, measured))
    seeker.tell(told, limits if limits else None, misfire=void)
    if late:
        seeker.restart()


def _require_match(seeker: Seeker, measured: Measurement) -> None:
    if seeker.component_count not in (1, len(measured.components)):
        raise ParameterError(
            f"components has {seeker.component_count} entries: the rig measures {len(measured.components)}; give as "
            "many, or one for their sum"
        )
    for name in seeker.limit_names:
        if name not in measured.limits:
            have = ", ".join(measured.limits) or "no limited quantity"
            raise ParameterError(f"limits: {name!r} is not measured by the rig: it measures {have}")


def _dataset(log: list[_Row], first: int) -> xr.Dataset:
    """Label what was measured; a value that is missing in some cycles is NaN there."""
    rows = [row.measured for row in log]
    names = dict.fromkeys(name for row in rows for name in row.values)
    columns = {name: np.array([row.values.get(name, math.nan) for row in rows]) for name in names}
    count = columns.pop("cycle", None)
    cycle = np.arange(first, first + len(rows)) if count is None or not np.isfinite(count).all() else count
    variables: dict[str, tuple[Any, ...]] = {
        "cycle": ("cycle", cycle.astype(np.int64)),
        "estimate_cad": ("cycle", np.array([row.estimate for row in log], np.float64)),
        "soc_requested_cad": ("cycle", np.array([row.applied for row in log], np.float64)),
        "j": ("cycle", np.array([row.performance for row in rows], np.float64)),
        "misfire": ("cycle", np.array([row.misfire for row in rows], np.bool_), "-", FLAGS["misfire"]),
        "void": (
            "cycle",
            np.array([row.void for row in log], np.bool_),
            "-",
            "cycle that the seeker did not use",
        ),
    }
    for name, values in columns.items():
        if name in FLAGS and name not in _OWN:
            variables[name] = ("cycle", values == 1.0, "-", FLAGS[name])
        elif name not in _OWN:
            variables[name] = ("cycle", values, *(() if name in VARIABLES else (_UNKNOWN, name)))
    width = max((len(row.components) for row in rows), default=1)
    components = np.full((len(rows), width), math.nan)
    for at, row in enumerate(rows):
        components[at, : len(row.components)] = row.components
    variables["component"] = ("component", np.arange(width), "-", "term of the performance")
    variables["components"] = (("cycle", "component"), components, "unit of J", "component of the performance")
    limits = list(dict.fromkeys(name for row in rows for name in row.limits))
    if limits:
        table = np.array([[row.limits.get(name, math.nan) for name in limits] for row in rows])
        units = [VARIABLES[name].units if name in VARIABLES else _UNKNOWN for name in limits]
        own = "unit of the limit"
        variables["limit"] = ("limit", limits, "-", "limited quantity")
        variables["limit_units"] = ("limit", units, "-", own)
        variables["limits"] = (("cycle", "limit"), table, own, "measured value of a limited quantity")
    out = labelled_dataset(variables)
    return out.set_coords("limit_units") if limits else out
