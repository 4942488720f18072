"""A seeker on a plant, one closed loop: with a seeker of your own, or one that `seek` chooses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted, ParameterError, ShapeError, hand_over, hinted, or_partial
from mgdd.guide import FeedForward, GuidedEngine
from mgdd.loop.bench import EngineBench
from mgdd.loop.bench_record import cycles_to_dataset
from mgdd.loop.criteria import LoopCriteria
from mgdd.loop.function_plant import FunctionPlant
from mgdd.loop.limit_figures import NOISE_FREE, limit_figures, with_a_limit
from mgdd.loop.plant import Plant
from mgdd.loop.plant_loop import LoopRun, require_inputs_of, steer
from mgdd.loop.seek_choice import chosen
from mgdd.loop.seek_result import SeekResult, found_by
from mgdd.optimize import Seeker
from mgdd.optimize.inputs import inputs_of, named_values
from mgdd.optimize.optimum import limits_of
from mgdd.optimize.seeker_findings import findings_of
from mgdd.results.result import Figures

if TYPE_CHECKING:
    from mgdd.optimize import Input, Limit

__all__ = ["LoopRun", "require_measured", "run_seeker", "seek", "seek_inputs", "started"]


def run_seeker(
    plant: Plant,
    seeker: Seeker | FeedForward | GuidedEngine,
    cycles: int,
    *,
    criteria: LoopCriteria | None = None,
) -> LoopRun:
    """Let a seeker steer a plant: a virtual bench, a surrogate, a rig over a bus, or one of your own.

    Each cycle is one ask, one cycle of the plant and one tell. A misfired cycle is reported as such. A new operating
    point restarts the seeker: before its first cycle where the plant announces it (`AnnouncingPlant`), otherwise after
    the first cycle whose ``values["operating_point_changed"]`` is true; the reading of that cycle belongs to neither
    point and counts as void. Both go on from where they stand: calling again continues. On an `EngineBench` of
    one input, and on a compiled `FunctionPlant`, the loop runs in the core without the GIL where a seeker of
    `mgdd.optimize` or a `CurveSeeking` has the inputs and limits of the plant in their order; one ask and tell at a
    time from Python gives the same trajectory, bit for bit.

    Parameters
    ----------
    plant : Plant
        It advances by ``cycles``; a rig is open and stays open.
    seeker
        Any seeker of `mgdd.optimize` or `mgdd.guide` with one input for every name of ``plant.input_names``, in their
        order or, where it has ``inputs``, by their names; one component or as many as the plant measures, and limits
        that the plant measures.
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
    >>> from mgdd.loop import EngineBench, LoopCriteria, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking
    >>> seeker = ExtremumSeeking(start=-20.0, lower=-30.0, upper=10.0)
    >>> run = run_seeker(EngineBench(seed=1), seeker, 600, criteria=LoopCriteria(optimum=-5.63))
    >>> run.summary["cycles_to"] < 400
    True
    """
    criteria = criteria or LoopCriteria()
    if (
        not isinstance(plant, EngineBench)
        or len(plant.input_names) > 1
        or isinstance(seeker, FeedForward | GuidedEngine)
        or (isinstance(seeker, Seeker) and tuple(seeker.limit_names) != plant.limit_names)  # the core wants the same
    ):
        return steer(plant, seeker, cycles, criteria)
    require_inputs_of(plant, seeker)
    goal = criteria.to_core(plant.limit_names)
    run_loop: Any = _core.loop.run_loop  # one overload for each class of seeker
    raw, stop = or_partial(lambda: run_loop(plant, seeker, cycles, **goal))
    columns, names = raw["columns"], plant.limit_names
    known = plant.noise_free_limits(columns["soc_requested_cad"], columns["cycle"])
    dataset = cycles_to_dataset(plant, columns, estimate_cad=raw["estimate_cad"], noise_free_limits=known)
    dataset.attrs["interrupted"] = int(raw["interrupted"])
    summary = Figures(with_a_limit(raw["summary"], names))
    summary |= {f"exceed_above_{name}": float(value) for name, value in criteria.exceed_above.items()}
    uppers = criteria.limits_of(names, seeker)
    dataset.attrs |= criteria.attributes(names, uppers)
    summary |= limit_figures(known, names, uppers, int(summary["judged_from"]), NOISE_FREE)
    findings = findings_of(seeker.settings, **raw["watched"])
    run = LoopRun(dataset=dataset, summary=summary, interrupted=raw["interrupted"], findings=findings)
    return hand_over(run, stop)


def seek(
    plant: Plant | Callable[[dict[str, float]], Any],
    inputs: Mapping[str, tuple[float, float]] | Sequence[Input],
    *,
    start: Mapping[str, float] | float | None = None,
    cycles: int = 200,
    limits: Mapping[str, float] | Sequence[Limit] = (),
    noise_sd: float | None = None,
    delay_cycles: float = 0.0,
    lag_cycles: float = 0.0,
    guide: Any = None,
    maximize: bool = True,
    seed: int = 0,
) -> SeekResult:
    """Seek the best inputs of a plant or a function, with a seeker that is chosen and said in the result.

    One input is sought by `CurveSeeking`, with the curve of the guide or with a parabola. Several inputs are sought by
    `GaussianProcessSeeking`, whose mean is the guide.

    Parameters
    ----------
    plant : Plant or callable
        It advances by `cycles`. A function takes the inputs by name and gives J, or ``(J, {limit: value})`` where there
        are limits, or None for a failed cycle; a compiled one is as `FunctionPlant` takes it.
    inputs : mapping of str to (float, float), or sequence of Input
        Bounds of every input, finite, in its unit; one to eight.
    start : mapping of str to float, or float for one input, optional
        First inputs; limits should hold there. The middle of the bounds if left out, for a curve its best input.
    cycles : int
        How many; the first readings to every side at least.
    limits : mapping of str to float, or sequence of Limit
        Upper values of measured quantities.
    noise_sd : float, optional
        Standard deviation of one reading, > 0 [unit of J]; learnt without.
    delay_cycles, lag_cycles : float
        Transport delay and time constant between the plant and J [cycles].
    guide : Curve, or what `GaussianProcessSeeking` takes, optional
        What a model says of J, in the unit of J; a Curve for one input, of -J where J is minimised.
    maximize : bool
        False to minimise J.
    seed : int
        Of the seeker; the same seed gives the same run.

    Returns
    -------
    SeekResult
        Best inputs, J and limits there, the gain over the start, which seeker and why, what speaks against the result,
        and every cycle.

    Raises
    ------
    mgdd.errors.ParameterError
        Inputs that the plant does not have or that are missing, bounds that are not finite, a start outside of them,
        limits that are not measured, too few cycles. The plant has not moved.
    mgdd.errors.DataError
        A reading that is not a finite number. Its ``partial`` is the SeekResult of the cycles so far, as that of any
        error of the plant.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` as above.

    See Also
    --------
    run_seeker : with a seeker of your own, and to go on.

    Examples
    --------
    >>> from mgdd.loop import seek
    >>> def engine(x):
    ...     return 56.0 - 0.03 * (x["soc_cad"] + 4.0) ** 2 - 300.0 * (x["egr"] - 0.15) ** 2
    >>> found = seek(engine, {"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}, cycles=60)
    >>> found.reason
    '2 inputs: it loses least on the way, whatever their units'
    >>> round(found.inputs["soc_cad"]), round(found.inputs["egr"], 2), found.findings
    (-4, 0.15, ())
    """
    given = seek_inputs(inputs)
    names, wanted = [one.name for one in given], limits_of(limits)
    if isinstance(cycles, bool) or not isinstance(cycles, int | np.integer):
        raise ParameterError.of("cycles", cycles, "a whole number")
    if isinstance(plant, Plant):
        require_measured(plant, names, [limit.name for limit in wanted])
    elif callable(plant):
        plant = FunctionPlant(plant, names, [limit.name for limit in wanted])
    else:
        raise ParameterError(f"plant = {plant!r}: must be a Plant, or a function of the inputs by name")
    choice = chosen(
        given, started(start, given), limits=wanted, noise_sd=noise_sd, delay_cycles=delay_cycles,
        lag_cycles=lag_cycles, guide=guide, maximize=maximize, seed=seed,
    )  # fmt: skip
    if cycles < choice.first_cycles:
        raise ParameterError.of("cycles", cycles, f">= {choice.first_cycles}, one reading to the side of every input")
    begun = dict(zip(names, choice.seeker.estimate.tolist(), strict=True))

    def result(run: LoopRun) -> SeekResult:
        late = delay_cycles + lag_cycles
        return found_by(choice.seeker, choice.reason, run, begun, late_cycles=late, guided=guide is not None)

    try:
        return result(run_seeker(plant, choice.seeker, cycles))
    except (Exception, Interrupted) as stop:
        part = getattr(stop, "partial", None)
        if isinstance(part, LoopRun):
            stop.partial = result(part)  # type: ignore[union-attr]
        raise


def seek_inputs(inputs: Any) -> tuple[Input, ...]:
    """Read the inputs of a search; ParameterError for none, and for bounds that are not finite."""
    given = inputs_of(inputs)
    if not given:
        raise ParameterError("inputs: none given; give bounds by name, for example {'soc_cad': (-20.0, 5.0)}")
    for one in given:
        if not (math.isfinite(one.lower) and math.isfinite(one.upper)):
            raise ParameterError(f"inputs: {one.name} = ({one.lower:g}, {one.upper:g}): give finite bounds")
    return given


def started(start: Any, inputs: Sequence[Input]) -> dict[str, float] | None:
    """Give the start by name; ParameterError where it lies outside of the bounds."""
    if start is None:
        return None
    names = [one.name for one in inputs]
    values = np.atleast_1d(np.asarray(named_values("start", start, names), np.float64))
    if values.shape != (len(names),):
        raise ShapeError(f"start has {values.size} entries: must have one number for each of {', '.join(names)}")
    for one, value in zip(inputs, values.tolist(), strict=True):
        if not one.lower <= value <= one.upper:
            raise ParameterError(
                f"start: {one.name} = {value:g}: must be in [{one.lower:g}, {one.upper:g}], its bounds"
            )
    return dict(zip(names, values.tolist(), strict=True))


def require_measured(plant: Plant, names: Sequence[str], limits: Sequence[str]) -> None:
    """ParameterError where a plant has other inputs, or does not measure a limit."""
    if set(names) != set(plant.input_names):
        raise ParameterError(f"inputs = {', '.join(names)}: the plant takes {', '.join(plant.input_names)}")
    for name in limits:
        if name not in plant.limit_names:
            have = ", ".join(plant.limit_names) or "none"
            raise ParameterError(
                hinted(f"limits: {name!r} is not measured by the plant, which has {have}", name, plant.limit_names)
            )
