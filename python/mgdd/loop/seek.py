"""One search: which seeker, from where and how long, on any plant; what Python, the command and the rig call."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mgdd.errors import Interrupted, ParameterError, ShapeError, argument, hinted
from mgdd.guide import CurveSeeking, FeedForward, GuidedEngine
from mgdd.loop.closed_loop import run_seeker, run_until_still, stillness
from mgdd.loop.engine_guide import EngineGuide
from mgdd.loop.function_plant import FunctionPlant
from mgdd.loop.lower_limits import both_sides, measured_names, with_lower_sides
from mgdd.loop.plant import Plant
from mgdd.loop.plant_loop import LoopRun, OwnSeeker, require_inputs_of
from mgdd.loop.seek_choice import Choice, Question, chosen
from mgdd.loop.seek_result import SeekResult, found_by
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.optimize import ComponentLag, GaussianProcessSeeking, Input, Limit, Seeker
from mgdd.optimize.inputs import inputs_of, named_values
from mgdd.optimize.map_driver import MapDriver
from mgdd.presets.meant import cylinder_of

_MOST_CYCLES = 2_000_000


def seek(
    plant: Plant | Callable[[Any], Any],
    inputs: Mapping[str, tuple[float, ...]] | Sequence[Input] | None = None,
    *,
    seeker: Any = "auto",
    start: Mapping[str, float] | float | None = None,
    cycles: int | None = None,
    tolerance: Mapping[str, float] | float | None = None,
    limits: Mapping[str, float | tuple[float | None, float | None]] | Sequence[Limit] = (),
    noise_sd: float | None = None,
    delay_cycles: float = 0.0,
    lag_cycles: float = 0.0,
    components: Sequence[ComponentLag] | None = None,
    guide: Any = None,
    known: Any = None,
    maximize: bool = True,
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> SeekResult:
    """Seek the best inputs of a plant or a function, with a seeker that is chosen and named in the result.

    `mgdd engine seek` and ``task = "seek"`` of an experiment are this call. By itself one input is sought by
    `CurveSeeking`, with the curve of the guide or with a parabola. Several inputs are sought by
    `GaussianProcessSeeking`, whose mean is the guide.

    Parameters
    ----------
    plant : Plant or callable
        It advances by `cycles`. A function takes the inputs by name, one input also as a number, and gives J, or
        ``(J, {limit: value})`` where there are limits, or None for a failed cycle; a compiled one is as
        `FunctionPlant` takes it.
    inputs : mapping of str to (float, float) or (float, float, float), or sequence of Input, optional
        Bounds of every input, finite, in its unit, and the step in which it is set; one to eight. Left out where
        `seeker` has them.
    seeker : str, class or Seeker
        ``auto``, or a name: ``curve_seeking``, ``gaussian_process_seeking``, ``extremum_seeking``, ``spsa``,
        ``gradient_descent``, ``golden_section``. Or a seeker, as that of an earlier result or one of your own with
        `ask`, `tell` and `estimate`, which goes on where it stands and changes.
    start : mapping of str to float, or float for one input, optional
        First inputs; limits should hold there. Left out: the best of the guide, or of `known`, or the middle; with
        limits the side on which engines keep them, as the latest `soc_cad` for ``p_max_bar``. Where none is known
        it is the middle, with a finding.
    cycles : int, optional
        How many; the first readings to every side at least. Left out: 200, and 25 more per cycle that J is late; of a
        seeker that dithers 2000, or 64 of its periods.
    tolerance : mapping of str to float, or float for one input, optional
        Stop before all `cycles` once the estimate has moved by less over the last 20 cycles per input, in its unit.
    limits : mapping of str to float or (float, float), or sequence of Limit
        Upper values of measured quantities, or lower and upper ones, of which either may be None. A lower one is kept
        as an upper one of the negated quantity, whose name begins with a minus in `run`.
    noise_sd : float, optional
        Standard deviation of one reading, > 0 [unit of J]; learnt without, but by golden section.
    delay_cycles, lag_cycles : float
        Transport delay and time constant between the plant and J [cycles].
    components : sequence of ComponentLag, optional
        The same for every component of J, in their order.
    guide : Curve, EngineGuide, CalibrationMap, TimingMap, or what `GaussianProcessSeeking` takes, optional
        What a model says of J, in the unit of J; a Curve for one input, of -J where J is minimised. An EngineGuide, or
        a map of the best timing over operating points, is of the start of combustion.
    known : DataFrame, Dataset or mapping of columns, optional
        Readings of before, in their order: a column per input and limit, and ``j``, as the Dataset of a result is. A
        row whose J is not finite failed. They are given first, to ``curve_seeking`` or ``gaussian_process_seeking``.
    maximize : bool
        False to minimise J.
    settings : mapping of str to any, optional
        Further settings of the seeker, by name.
    seed : int
        Of the seeker; the same seed gives the same run.

    Returns
    -------
    SeekResult
        Best inputs, J and limits there, the gain over the start, which seeker and why, reasons to doubt the result,
        and every cycle.

    Raises
    ------
    mgdd.errors.ParameterError
        Inputs that the plant does not have or that are missing, bounds that are not finite, a start outside of them,
        limits that are not measured, too few cycles, a seeker without what it needs. The plant has not moved.
    mgdd.errors.DataError
        A reading that is not a finite number. Its ``partial`` is the SeekResult of the cycles so far, as that of any
        error of the plant.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` as above.

    See Also
    --------
    run_seeker : the loop alone.

    Examples
    --------
    >>> from mgdd.loop import seek
    >>> def engine(x):
    ...     return 56.0 - 0.03 * (x["soc_cad"] + 4.0) ** 2 - 300.0 * (x["egr"] - 0.15) ** 2
    >>> found = seek(engine, {"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}, cycles=60)
    >>> found.reason
    '2 inputs: smallest cumulative loss, whatever their units'
    >>> round(found.inputs["soc_cad"]), round(found.inputs["egr"], 2), found.findings
    (-4, 0.15, ())
    >>> more = seek(engine, seeker=found.seeker, cycles=10)
    >>> more.seeker.cycle
    70
    """
    if cycles is not None and (isinstance(cycles, bool) or not isinstance(cycles, int | np.integer)):
        raise ParameterError.of("cycles", cycles, "a whole number")
    sides = both_sides(limits)
    own = Seeker | FeedForward | GuidedEngine | OwnSeeker
    if not isinstance(seeker, own) and OwnSeeker.is_one(seeker):
        if hasattr(seeker, "at") and hasattr(plant, "point"):
            seeker.at(plant.point)  # its estimate is of an operating point
        if isinstance(seeker, MapDriver):
            seeker = OwnSeeker.of_driver(seeker)
        else:
            seeker = OwnSeeker(seeker, seek_inputs(inputs), sides, maximize=maximize)
    if isinstance(seeker, own):
        left_out = {
            "start": start is None, "noise_sd": noise_sd is None, "delay_cycles": not delay_cycles,
            "lag_cycles": not lag_cycles, "components": components is None, "guide": guide is None,
            "known": known is None, "settings": not settings, "seed": not seed,
            "maximize": maximize or not seeker.settings["maximize"],
        }  # fmt: skip
        if named := [name for name, out in left_out.items() if not out]:
            raise ParameterError(f"{', '.join(named)}: the seeker given has its own: leave it out, or name the seeker")
        asked = _question_of(seeker, inputs, sides, plant)
        choice = Choice(seeker, "as given", 1, asked.budget(seeker))
    else:
        given = seek_inputs(inputs)
        asked = Question(
            inputs=given, start=started(start, given), limits=sides, noise_sd=noise_sd, delay_cycles=delay_cycles,
            lag_cycles=lag_cycles, components=components, guide=guide, maximize=maximize, seed=seed,
            settings=dict(settings or {}), point=getattr(guide, "point", None) or getattr(plant, "point", None),
            own_model=isinstance(plant, VirtualEngine) and isinstance(guide, EngineGuide)
            and cylinder_of(guide.cylinder) == plant.settings["cylinder"],
        )  # fmt: skip
        plant_of(plant, asked.inputs, asked.limits)  # before anything is made
        choice = chosen(asked, seeker)
        if known is not None:
            asked, choice = tell_known(asked, seeker, choice, known)
    still = stillness(asked, tolerance)
    wanted_cycles = choice.cycles if cycles is None else int(cycles)
    return searched(plant_of(plant, asked.inputs, asked.limits), choice, asked, wanted_cycles, still)


def searched(plant: Plant, choice: Choice, asked: Question, cycles: int, still: Any = None) -> SeekResult:
    """Let a seeker that was chosen run on a plant of its inputs; errors as those of `seek`."""
    require_cycles(choice, cycles)
    plant = with_lower_sides(plant, asked.limits)
    begun = dict(zip([one.name for one in asked.inputs], choice.seeker.estimate.tolist(), strict=True))

    def result(run: LoopRun) -> SeekResult:
        return found_by(choice.seeker, choice.reason, run, begun, asked)

    try:
        if still is None:
            return result(run_seeker(plant, choice.seeker, cycles))
        return result(run_until_still(plant, choice.seeker, cycles, asked, still))
    except (Exception, Interrupted) as stop:
        part = getattr(stop, "partial", None)
        if isinstance(part, LoopRun):
            stop.partial = result(part)  # type: ignore[union-attr]
        raise


def require_cycles(choice: Choice, cycles: int) -> None:
    """ParameterError for fewer than look to every side, or more than one search takes."""
    if cycles < choice.first_cycles:
        raise ParameterError.of("cycles", cycles, f">= {choice.first_cycles}, one reading to the side of every input")
    if cycles > _MOST_CYCLES:
        raise ParameterError.of(
            "cycles", cycles, f"<= {_MOST_CYCLES}; go on in another search, with {argument('known')}"
        )


def plant_of(plant: Any, inputs: Sequence[Input], limits: Sequence[Limit], values: Sequence[str] = ()) -> Plant:
    """Give the plant of these inputs and limits; ParameterError where it is none, or another."""
    names, held = [one.name for one in inputs], measured_names(limits)
    if isinstance(plant, Plant):
        if set(names) != set(plant.input_names):
            raise ParameterError(f"inputs = {', '.join(names)}: the plant takes {', '.join(plant.input_names)}")
        for name in held:
            if name not in plant.limit_names:
                have = ", ".join(plant.limit_names) or "none"
                refused = (
                    f"{argument('limits')}: {name!r} is not measured by the plant, which has {have}: a VirtualEngine "
                    "measures what its own limits name, a function what it returns beside J"
                )
                raise ParameterError(hinted(refused, name, plant.limit_names))
        return plant
    if callable(plant):
        return FunctionPlant(plant, names, held, values=tuple(values))
    raise ParameterError(
        f"plant = {plant!r}: must be a Plant, as VirtualEngine('puma_single'), or a function of the inputs by name"
    )


def _question_of(seeker: Any, inputs: Any, limits: tuple[Limit, ...], plant: Any) -> Question:
    """Ask again what a seeker was made for; ParameterError where inputs or limits are others."""
    own = seeker.settings
    there = tuple(own["inputs"])
    if inputs is not None:
        given = seek_inputs(inputs)
        if there and {one.name: (one.lower, one.upper) for one in given} != {
            one.name: (one.lower, one.upper) for one in there
        }:
            bounds_text = ", ".join(f"{one.name} in [{one.lower:g}, {one.upper:g}]" for one in there)
            raise ParameterError(f"inputs: the seeker given has {bounds_text}: leave them out")
        there = there or given
    if not there:
        if not isinstance(plant, Plant):
            raise ParameterError("inputs: the seeker given has no names for them: give their bounds by name")
        require_inputs_of(plant, seeker)
        low, high = (np.broadcast_to(side, seeker.estimate.shape) for side in own["bounds"])
        bounds = zip(plant.input_names, low.tolist(), high.tolist(), strict=True)
        there = inputs_of({name: (a, b) for name, a, b in bounds})
    held = tuple(own["limits"])
    if limits and {one.name: one.upper for one in limits} != {one.name: one.upper for one in held}:
        limits_text = ", ".join(f"{one.name} <= {one.upper:g}" for one in held) or "none"
        raise ParameterError(f"limits: the seeker given has {limits_text}: leave them out")
    begun = dict(zip([one.name for one in there], seeker.estimate.tolist(), strict=True))
    return Question(
        inputs=there, start=begun, limits=held, components=own.get("components"), maximize=own["maximize"],
        delay_cycles=float(own.get("delay_cycles", 0.0)), lag_cycles=float(own.get("lag_cycles", 0.0)),
        guide=own.get("guide") or (True if isinstance(seeker, FeedForward | GuidedEngine) else None),
    )  # fmt: skip


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
    values = np.atleast_1d(np.asarray(named_values(argument("start"), start, names), np.float64))
    if values.shape != (len(names),):
        raise ShapeError(
            f"{argument('start')} has {values.size} entries: must have one number for each of {', '.join(names)}"
        )
    for one, value in zip(inputs, values.tolist(), strict=True):
        if not one.lower <= value <= one.upper:
            raise ParameterError(
                f"{argument('start')}: {one.name} = {value:g}: must be in [{one.lower:g}, {one.upper:g}], its bounds"
            )
    return dict(zip(names, values.tolist(), strict=True))


def tell_known(asked: Question, seeker: Any, choice: Choice, known: Any) -> tuple[Question, Choice]:
    """Tell the readings, in their order, to a seeker that begins at the best of them where no start is given."""
    if not isinstance(choice.seeker, CurveSeeking | GaussianProcessSeeking):
        raise ParameterError(
            f"{argument('known')}: goes to curve_seeking or gaussian_process_seeking, not to "
            f"{type(choice.seeker).__name__}, which asks for the readings that it needs: leave it out"
        )
    names, held = [one.name for one in asked.inputs], [limit.name for limit in asked.limits]
    x = np.column_stack([_column(known, name, "applied", "input") for name in names])
    j = _column(known, "j", "objective", None)
    limits = np.column_stack([_column(known, name, "limits", "limit") for name in held] or [np.empty((j.size, 0))])
    for at, one in enumerate(asked.inputs):
        if outside := [value for value in x[:, at].tolist() if not one.lower <= value <= one.upper]:
            raise ParameterError(
                f"{argument('known')}: {one.name} = {outside[0]:g}: must be in [{one.lower:g}, {one.upper:g}]"
            )
    read = np.isfinite(j) & np.isfinite(limits).all(axis=1)
    if asked.start is None and asked.late_cycles == 0.0 and read.any():
        uppers = np.array([limit.upper for limit in asked.limits])
        feasible = read & (limits <= uppers).all(axis=1)
        worth = np.where(feasible if feasible.any() else read, j if asked.maximize else -j, -math.inf)
        best = dict(zip(names, x[int(np.argmax(worth))].tolist(), strict=True))
        asked = replace(asked, start=best)
        choice = chosen(asked, seeker)
    for row, value, measured, fired in zip(x.tolist(), j.tolist(), limits.tolist(), read.tolist(), strict=True):
        choice.seeker.ask()
        applied = dict(zip(names, row, strict=True))
        if fired:
            choice.seeker.tell(value, measured or None, applied=applied)
        else:
            choice.seeker.tell(math.nan, misfire=True, applied=applied)
    return asked, choice._replace(reason=f"{choice.reason}, after {j.size} readings of before", first_cycles=1)


def _column(known: Any, name: str, table: str, over: str | None) -> Any:
    """Take a column by its name, or from the table that results of ours have."""
    there = known if isinstance(known, Mapping) else getattr(known, "variables", getattr(known, "columns", None))
    if there is None:
        raise ParameterError(f"{argument('known')} = {type(known).__name__}: must be a table with columns by name")
    if over is not None and table in there and name in known.coords[over].to_numpy():
        values = known[table].sel({over: name})
    elif f"{table}_{name}" in there:  # of a table that the command wrote
        values = known[f"{table}_{name}"]
    elif name in there:
        values = known[name]
    elif over is None and table in there:
        values = known[table]
    else:
        raise ParameterError(
            hinted(
                f"{argument('known')}: has no column {name!r}, but {', '.join(map(str, there))}",
                name,
                [str(each) for each in there],
            )
        )
    column = np.asarray(values, np.float64)
    if column.ndim != 1:
        raise ParameterError(f"{argument('known')}: {name} has shape {column.shape}: must be a column")
    if table == "applied" and not np.isfinite(column).all():
        raise ParameterError(f"{argument('known')}: {name} must be finite in every row")
    return column
