"""A seeker on a plant, one closed loop: in the core where both are of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd.errors import Interrupted, ParameterError, argument
from mgdd.guide import FeedForward, GuidedEngine
from mgdd.loop.lower_limits import with_lower_sides
from mgdd.loop.plant import Plant
from mgdd.loop.plant_loop import LoopRun, OwnSeeker, require_inputs_of, steer
from mgdd.loop.plant_record import VOID, cycles_to_dataset, steered
from mgdd.loop.seek_choice import Question
from mgdd.loop.summary import NOISE_FREE, LoopCriteria, limit_figures, of_first_input, summarize_cycles, with_a_limit
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.optimize import Seeker
from mgdd.optimize.inputs import named_values
from mgdd.optimize.map_driver import MapDriver
from mgdd.optimize.seeker_findings import findings_of
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.results.result import Figures


def run_seeker(
    plant: Plant,
    seeker: Seeker | FeedForward | GuidedEngine | MapDriver,
    cycles: int,
    *,
    criteria: LoopCriteria | None = None,
) -> LoopRun:
    """Let a seeker steer a plant: a virtual bench, a surrogate, a rig over a bus, or one of your own.

    Each cycle is one ask, one cycle of the plant and one tell. A misfired cycle is reported as such. A new operating
    point restarts the seeker: before its first cycle where the plant announces it (`AnnouncingPlant`), otherwise after
    the first cycle whose ``values["operating_point_changed"]`` is true; the reading of that cycle belongs to neither
    point and counts as void. Both go on from where they stand: calling again continues. On an `VirtualEngine` of
    one input, and on a compiled `FunctionPlant`, the loop runs in the core without the GIL where a seeker of
    `mgdd.optimize` or a `CurveSeeking` has the inputs and limits of the plant in their order; one ask and tell at a
    time from Python gives the same trajectory, bit for bit.

    Parameters
    ----------
    plant : Plant
        It advances by ``cycles``; a rig is open and stays open.
    seeker
        Any seeker of `mgdd.optimize` or `mgdd.guide`, or ``driver()`` of a `MapSeeking`, with one input for every name
        of ``plant.input_names``, in their order or, where it has ``inputs``, by their names; one component or as many
        as the plant measures, and limits that the plant measures.
    cycles : int
        How many, >= 1.
    criteria : LoopCriteria, optional
        Where the estimate should go and what counts as a broken limit.

    Returns
    -------
    LoopRun
        Cycles with everything that was measured, and their summary.

    Raises
    ------
    mgdd.errors.ParameterError
        A seeker that does not fit the plant, or fewer than one cycle.
    mgdd.errors.DataError
        A fired cycle whose reading is not finite. Errors of the plant pass through as well, with the LoopRun so far
        as ``partial``; the seeker then stands before that cycle, and its ``history`` holds the cycles so far.
    mgdd.errors.InUseError
        Bench or seeker are in a call of another thread.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the LoopRun of the cycles until then. Plant and seeker are in the state after them, and
        running them again goes on.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine, LoopCriteria, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking
    >>> seeker = ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0))
    >>> run = run_seeker(VirtualEngine(seed=1), seeker, 600, criteria=LoopCriteria(optimum=-5.63))
    >>> run.summary["cycles_to"] < 400
    True
    """
    criteria = criteria or LoopCriteria()
    if isinstance(seeker, MapDriver):
        driver: Any = OwnSeeker.of_driver(seeker)
        return steer(with_lower_sides(plant, driver.settings["limits"]), driver, cycles, criteria)
    if (
        not isinstance(plant, VirtualEngine)
        or len(plant.input_names) > 1
        or not isinstance(seeker, Seeker)
        or tuple(seeker.limit_names) != plant.limit_names  # the core wants the same
    ):
        return steer(plant, seeker, cycles, criteria)
    require_inputs_of(plant, seeker)
    goal = criteria.to_core(plant.limit_names)
    run_loop: Any = _core.loop.run_loop  # one overload for each class of seeker
    raw, stop = or_partial(lambda: run_loop(plant, seeker, cycles, **goal))
    columns, names = raw["columns"], plant.limit_names
    asked, applied = columns.pop("soc_requested_cad"), columns.pop("soc_applied_cad")
    noise_free = plant.noise_free_limits(asked, columns["cycle"])
    own = steered(plant.input_names, *(each[:, np.newaxis] for each in (raw["estimate_cad"], asked, applied)))
    own["void"] = ("cycle", columns["misfire"] | columns["unphysical"], "-", VOID)
    dataset = cycles_to_dataset(plant, columns, more=own, noise_free_limits=noise_free)
    dataset.attrs["interrupted"] = int(raw["interrupted"])
    summary = Figures(with_a_limit(of_first_input(raw["summary"], plant.input_names), names))
    summary |= {f"exceed_above_{name}": float(value) for name, value in criteria.exceed_above.items()}
    uppers = criteria.limits_of(names, seeker)
    dataset.attrs |= criteria.attributes(names, uppers)
    summary |= limit_figures(noise_free, names, uppers, int(summary["judged_from"]), NOISE_FREE)
    findings = findings_of(seeker.settings, raw["watched"])
    run = LoopRun(dataset=dataset, summary=summary, interrupted=raw["interrupted"], findings=findings)
    return hand_over(run, stop)


_CYCLES = 20  # per input: twice what an estimate takes to arrive, docs/benchmarks.md
_LOOK = 5  # cycles between two looks


def stillness(asked: Question, tolerance: Any) -> NDArray[np.float64] | None:
    """Read a tolerance, a number per input, by name or alone; None for none."""
    if tolerance is None:
        return None
    still = np.atleast_1d(
        np.asarray(named_values(argument("tolerance"), tolerance, [one.name for one in asked.inputs]), np.float64)
    )
    if still.shape != (len(asked.inputs),) or not (np.isfinite(still) & (still > 0.0)).all():
        raise ParameterError(f"{argument('tolerance')} = {tolerance}: must be > 0, one number for each input")
    return still


def run_until_still(plant: Plant, seeker: Any, cycles: int, asked: Question, tolerance: NDArray[np.float64]) -> LoopRun:
    """Run at most `cycles`, a few at a time; the partial result of an error holds those before as well."""
    parts, estimates = list[LoopRun](), [seeker.estimate.copy()]
    window = _CYCLES * len(asked.inputs) + math.ceil(asked.late_cycles)
    done = 0
    while done < cycles:
        count = min(_LOOK, cycles - done)
        try:
            parts.append(run_seeker(plant, seeker, count))
        except (Exception, Interrupted) as stop:
            part = getattr(stop, "partial", None)
            if isinstance(part, LoopRun):
                stop.partial = _joined([*parts, part], asked)  # type: ignore[union-attr]
            raise
        done += count
        estimates.append(seeker.estimate.copy())
        if done >= window and (np.ptp(estimates[-(window // _LOOK) - 1 :], axis=0) < tolerance).all():
            break
    return _joined(parts, asked)


def _joined(parts: list[LoopRun], asked: Question) -> LoopRun:
    import xarray as xr

    held = [one for one in parts if one.dataset.sizes["cycle"]] or parts[:1]
    whole = xr.concat(
        [one.dataset for one in held], "cycle", data_vars="minimal", coords="minimal", compat="override",
        combine_attrs="override",
    )  # fmt: skip
    whole.attrs["interrupted"] = int(parts[-1].interrupted)
    limits = {limit.name: limit.upper for limit in asked.limits}
    summary = Figures(summarize_cycles(whole, LoopCriteria(limits=limits or None)))
    return LoopRun(dataset=whole, summary=summary, interrupted=parts[-1].interrupted, findings=parts[-1].findings)
