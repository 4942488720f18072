"""Seekers on a plant of the core by the thousand: plants, seekers and seeds on cores, processes or machines."""

from __future__ import annotations

import copy
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted, ParameterError, ShapeError, WorkerLostError
from mgdd.guide import FeedForward, GuidedEngine
from mgdd.guide.feed_forward import AnswerSpan, answers_along
from mgdd.loop.function_plant import FunctionPlant
from mgdd.loop.plant_loop import require_inputs_of, require_point_for
from mgdd.loop.summary import FIGURES_OF_INPUT, LoopCriteria, limit_label, of_first_input, with_a_limit
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.parallel.chunks import pieces, run_chunks
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.parallel.pool import MakesExecutor, threads_of
from mgdd.results.labels import labelled_dataset, name_unit

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.optimize import Seeker

    _Plant = VirtualEngine | FunctionPlant
    _Seeker = Seeker | FeedForward | GuidedEngine
    _Call = tuple[list[_Plant], list[_Seeker], Sequence[int], list[list[AnswerSpan]], list[Mapping[str, Any]]]

_SUMMARY = {
    "cycles_to": ("cycle", "first cycle at which the estimate has arrived"),
    "cycles_stays": ("cycle", "cycle from which the estimate stays"),
    "exceeded_fraction": ("-", "share of the cycles from judged_from on above a threshold exceed_above_..."),
    "mean_j": ("unit of J", "mean performance, second half"),
    "mean_efficiency_percent": ("%", "mean gross efficiency, second half"),
    "mean_nox_ppm": ("ppm", "mean true NOx, second half"),
    "misfires": ("-", "misfired cycles"),
    "judged_from": ("cycle", "first cycle of exceeded_fraction and of the figures judged_..."),
}


_OF_AN_ENGINE = ("mean_efficiency_percent", "mean_nox_ppm")


def monte_carlo(
    benches: _Plant | Sequence[_Plant],
    seekers: _Seeker | Sequence[_Seeker],
    seeds: Iterable[int],
    *,
    cycles: int,
    criteria: LoopCriteria | Sequence[LoopCriteria] | None = None,
    executor: MakesExecutor | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Run every seeker on every bench with every seed: whole loops on all cores, or on an executor.

    Each loop starts from cycle 0 of its bench and from where its seeker stands. Noise depends on the seed alone, so
    the numbers do not depend on executor, workers or chunks. Sixteen loops and more run side by side and have the
    numbers of `run_seeker` to rounding; fewer, and those with a gamma of temperature, several inputs or a limit on
    ``t_evo_k``, have its bits; means of a seeker with a guide are summed in another order. Of several inputs the
    figures of the first alone are there.

    Parameters
    ----------
    benches : VirtualEngine, FunctionPlant or sequence
        Plants, for example several operating points; read, not advanced. Either benches, or compiled functions, which
        run from cycle 0 with the seed of the loop; several threads call one function at once, and no other process
        does.
    seekers : seeker or sequence
        As in `run_seeker`, for example several gains; read, not advanced. The guide of a `FeedForward` is asked once at
        every operating point of a bench, before the loops, and once more where it held or refused.
    seeds : iterable of int
        Of the bench, and of a seeker that draws.
    cycles : int
        Length of each loop.
    criteria : LoopCriteria or sequence of LoopCriteria, optional
        As in `run_seeker`, one for all or one per bench.
    executor, workers, progress
        As in `mgdd.parallel.map_items`, an item being a loop: threads on all cores if left out. Every worker computes
        on one thread.

    Returns
    -------
    xarray.Dataset
        Over ``bench``, ``seeker`` and ``seed``: the summary of `run_seeker` without its noise-free figures, which would
        double the work, and ``finished``, true everywhere. Of functions without figures of an engine.

    Raises
    ------
    mgdd.errors.ParameterError
        Nothing to run, or a seeker that does not fit a bench.
    mgdd.errors.InUseError
        A bench or seeker is in a call of another thread.
    mgdd.errors.WorkerLostError
        As in `mgdd.parallel.map_items`; ``partial`` is a Dataset as after Ctrl-C.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the Dataset with ``finished`` false and NaN for every loop that did not reach its end.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine, LoopCriteria, monte_carlo
    >>> from mgdd.optimize import ExtremumSeeking
    >>> gains = [ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0), gain=g) for g in (0.5, 1.0)]
    >>> table = monte_carlo(VirtualEngine(), gains, range(4), cycles=400, criteria=LoopCriteria(optimum=-5.63))
    >>> dict(table.sizes)
    {'bench': 1, 'seeker': 2, 'seed': 4}
    """
    bench_list = [benches] if isinstance(benches, VirtualEngine | FunctionPlant) else list(benches)
    seeker_list = list(seekers) if isinstance(seekers, Sequence) else [seekers]
    try:
        seed_list = [operator.index(seed) for seed in seeds]
    except TypeError as error:
        raise ParameterError(f"seeds: must be whole numbers, for example range(20): {error}") from None
    if wrong := [seed for seed in seed_list if not 0 <= seed < 2**64]:
        raise ParameterError(f"seeds: {wrong[0]} must be in [0, 2**64)")
    given = [criteria or LoopCriteria()] * len(bench_list) if not isinstance(criteria, Sequence) else list(criteria)
    if len(given) != len(bench_list):
        raise ShapeError(f"criteria has {len(given)} entries: give one for all or one per bench, {len(bench_list)}")
    for bench in bench_list:
        for seeker in seeker_list:
            require_inputs_of(bench, seeker)
            named = tuple(getattr(seeker, "input_names", ()))
            if named and named != bench.input_names:
                raise ParameterError(
                    f"inputs of the seeker are {', '.join(named)}: here they stand in the order of the bench, "
                    f"{', '.join(bench.input_names)}"
                )
    functions = _functions_of(bench_list)
    goals: list[Mapping[str, Any]] = [
        own.to_core(bench.limit_names) for bench, own in zip(bench_list, given, strict=True)
    ]
    for name in ("arrival_cad", "tail_cycles", "exceed_from"):
        if len({goal[name] for goal in goals}) > 1:
            raise ParameterError(f"criteria: {name.removesuffix('_cad')} must be the same for all benches")
    form = _core.loop.loop_form(len(bench_list) * len(seeker_list) * len(seed_list))  # of all, however they are cut
    answers = [_answers(bench, seeker, cycles) for bench in bench_list for seeker in seeker_list]
    call = (bench_list, seeker_list, seed_list, answers, goals, cycles, form)
    stop: Interrupted | WorkerLostError | None
    if executor is None and progress is None:
        threads = threads_of(workers)
        raw, stop = or_partial(lambda: _loops(*call, threads))
    else:
        raw, stop = _in_chunks(call, executor=executor, workers=workers, progress=progress)
    shape = (len(bench_list), len(seeker_list), len(seed_list))
    dims = ("bench", "seeker", "seed")
    finished = raw.pop("finished").reshape(shape)
    variables: dict[str, tuple[Any, ...]] = {
        "bench": ("bench", np.arange(shape[0]), "-", "bench"),
        "seeker": ("seeker", np.arange(shape[1]), "-", "seeker"),
        "seed": ("seed", np.array(seed_list, np.uint64), "-", "seed"),
        "finished": (dims, finished, "-", "whether the loop ran to its end"),
    }
    names = bench_list[0].limit_names
    inputs = bench_list[0].input_names
    of_input = {f"{figure}_{inputs[0]}": text for figure, text in FIGURES_OF_INPUT.items()}
    for name, values in with_a_limit(of_first_input(raw, inputs), names).items():
        if functions and name in _OF_AN_ENGINE:
            continue
        label = (
            (name_unit(name), of_input[name]) if name in of_input else _SUMMARY.get(name) or limit_label(name, names)
        )
        variables[name] = (dims, np.where(finished, values.reshape(shape), np.nan), *label)
    for name in dict.fromkeys(name for own in given for name in own.exceed_above):
        above = [float(own.exceed_above.get(name, np.nan)) for own in given]
        variables[f"exceed_above_{name}"] = ("bench", above, *limit_label(f"exceed_above_{name}", names))
    return hand_over(labelled_dataset(variables, attrs={"cycles": cycles}), stop)


def _loops(
    benches: Sequence[_Plant],
    seekers: Sequence[_Seeker],
    seeds: Sequence[int],
    answers: Sequence[list[AnswerSpan]],
    goals: Sequence[Mapping[str, Any]],
    cycles: int,
    form: str,
    threads: int = 1,
) -> dict[str, NDArray[Any]]:
    """Run every loop in one call of the core: a column per figure, in the order of benches, seekers and seeds."""
    first = goals[0] if goals else LoopCriteria().to_core(())
    shared: dict[str, Any] = {name: first[name] for name in ("arrival_cad", "tail_cycles", "exceed_from")}
    shared |= {name: [goal[name] for goal in goals] for name in ("optimum_cad", "exceed_above", "limits")}
    plants: Any = [plant._core for plant in _functions_of(benches)] or benches
    columns: dict[str, NDArray[Any]] = _core.loop.monte_carlo(
        plants, list(seekers), seeds, answers, cycles=cycles, threads=threads, form=form, **shared
    )
    return columns


def _in_chunks(
    call: tuple[list[_Plant], list[_Seeker], Sequence[int], list[list[AnswerSpan]], list[Mapping[str, Any]], int, str],
    *,
    executor: MakesExecutor | None,
    workers: int | None,
    progress: Callable[[int, int], None] | None,
) -> tuple[dict[str, NDArray[Any]], Interrupted | WorkerLostError | None]:
    benches, seekers, seeds, answers, goals, cycles, form = call
    # What does not fit is found by one cycle of every pair, before any work; whose cycles count is checked by a chunk.
    shown = [{**goal, "exceed_from": None} for goal in goals]
    columns, stop = or_partial(lambda: _loops(benches, seekers, seeds[:1], answers, shown, min(cycles, 1), form))
    own, begun = [copy.deepcopy(bench) for bench in benches], [_bare(seeker) for seeker in seekers]
    n = len(benches) * len(seekers) * len(seeds)
    columns = {name: np.full(n, False if name == "finished" else np.nan) for name in columns}

    def cut(start: int, stop: int) -> tuple[list[_Call], int, str]:
        pairs = [(divmod(row, len(seekers)), seeds[a:b]) for row, a, b in pieces(start, stop, len(seeds))]
        calls = [([own[b]], [begun[s]], these, [answers[b * len(seekers) + s]], [goals[b]]) for (b, s), these in pairs]
        return calls, cycles, form

    def keep(start: int, stop: int, parts: list[dict[str, NDArray[Any]]]) -> None:
        for name, column in columns.items():
            column[start:stop] = np.concatenate([part[name] for part in parts])

    error = stop or run_chunks(_some_loops, cut, keep, n, executor=executor, workers=workers, progress=progress)
    return columns, error


def _some_loops(calls: Sequence[_Call], cycles: int, form: str) -> list[dict[str, NDArray[Any]]]:
    return [_loops(*call, cycles, form) for call in calls]


def _functions_of(plants: Sequence[_Plant]) -> list[FunctionPlant]:
    """Give the compiled functions, none of benches; ParameterError for a mixture, and for a function in Python."""
    functions = [plant for plant in plants if isinstance(plant, FunctionPlant)]
    if functions and len(functions) < len(plants):
        raise ParameterError("benches: VirtualEngine and FunctionPlant were both given: run them one after the other")
    for plant in functions:
        if not plant.compiled:
            raise ParameterError(f"benches: {plant!r}: must be compiled and give J; run_seeker runs others")
        if plant.input_names != functions[0].input_names:
            raise ParameterError("benches: every FunctionPlant must have the same inputs")
    return functions


def _answers(plant: _Plant, seeker: _Seeker, cycles: int) -> list[AnswerSpan]:
    require_point_for(plant, seeker)
    if isinstance(seeker, FeedForward) and isinstance(plant, VirtualEngine):
        return answers_along(seeker, plant.settings["schedule"], cycles)
    return []


def _bare(seeker: _Seeker) -> _Seeker:
    """Copy a seeker as it stands, without its history."""
    if isinstance(seeker, FeedForward | GuidedEngine):
        bare: FeedForward | GuidedEngine = seeker._bare()
        return bare
    own = copy.deepcopy(seeker)
    own.clear_history()
    return own
