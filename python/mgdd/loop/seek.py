"""A seeker on a plant: one closed loop, or thousands on the virtual bench."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError, hand_over, or_partial
from mgdd.guide import FeedForward, GuidedEngine
from mgdd.loop.bench import EngineBench
from mgdd.loop.bench_record import cycles_to_dataset
from mgdd.loop.criteria import LoopCriteria
from mgdd.loop.limit_figures import FIGURES, NOISE_FREE, limit_figures, limit_label
from mgdd.loop.plant import Plant
from mgdd.loop.plant_loop import LoopRun, steer
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.optimize import Seeker

__all__ = ["LoopRun", "monte_carlo", "run_seeker"]

_CAD = "°CA aTDC"
_SUMMARY = {
    "final_cad": (_CAD, "mean estimate of the last cycles"),
    "mean_cad": (_CAD, "mean estimate, second half"),
    "rms_cad": ("°CA", "rms distance of the estimate to the optimum, second half"),
    "cycles_to": ("cycle", "first cycle at which the estimate has arrived"),
    "cycles_stays": ("cycle", "cycle from which the estimate stays"),
    "exceeded_fraction": ("-", "share of the cycles from judged_from on above a threshold exceed_above_..."),
    "mean_applied_cad": (_CAD, "mean applied timing, second half"),
    "mean_j": ("unit of J", "mean performance, second half"),
    "mean_efficiency_percent": ("%", "mean gross efficiency, second half"),
    "mean_nox_ppm": ("ppm", "mean true NOx, second half"),
    "lowest_cad": (_CAD, "lowest estimate"),
    "highest_cad": (_CAD, "highest estimate"),
    "misfires": ("-", "misfired cycles"),
    "judged_from": ("cycle", "first cycle of exceeded_fraction and of the figures judged_..."),
}


def run_seeker(
    plant: Plant,
    seeker: Seeker | FeedForward | GuidedEngine,
    cycles: int,
    *,
    criteria: LoopCriteria | None = None,
) -> LoopRun:
    """Let a seeker steer a plant: a virtual bench, a surrogate, a rig over a bus, or one of your own.

    Each cycle is one ask, one cycle of the plant and one tell. A misfired cycle is told as such. A new operating point
    restarts the seeker: before its first cycle where the plant announces it (`AnnouncingPlant`), otherwise after the
    first cycle whose ``values["operating_point_changed"]`` is true; the reading of that cycle belongs to neither point
    and counts as void. Both go on from where they stand: calling again continues. On an `EngineBench` the loop runs in
    the core without the GIL; one ask and tell at a time from Python gives the same trajectory, bit for bit.

    Parameters
    ----------
    plant : Plant
        It advances by ``cycles``; a rig is open and stays open.
    seeker
        Any seeker of `mgdd.optimize` or `mgdd.guide` with one input for every name of ``plant.input_names``, one
        component or as many as the plant measures, and limits that the plant measures.
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
        A fired cycle whose reading is not finite. Errors of the plant pass through as well; the seeker then stands
        before that cycle, and its ``history`` holds the cycles so far.
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
    if not isinstance(plant, EngineBench) or isinstance(seeker, FeedForward | GuidedEngine):
        return steer(plant, seeker, cycles, criteria)
    goal = _core_criteria(plant, criteria)
    run: Any = _core.loop.run_loop  # one overload for each class of seeker
    raw, stop = or_partial(lambda: run(plant, seeker, cycles, **goal))
    columns, names = raw["columns"], plant.limit_names
    known = plant.noise_free_limits(columns["soc_requested_cad"], columns["cycle"])
    dataset = cycles_to_dataset(plant, columns, estimate_cad=raw["estimate_cad"], noise_free_limits=known)
    dataset.attrs["interrupted"] = int(raw["interrupted"])
    summary = _with_a_limit(raw["summary"], names)
    summary |= {f"exceed_above_{name}": float(value) for name, value in criteria.exceed_above.items()}
    uppers = criteria.limits_of(names, seeker)
    summary |= limit_figures(known, names, uppers, int(summary["judged_from"]), NOISE_FREE)
    return hand_over(LoopRun(dataset=dataset, summary=summary, interrupted=raw["interrupted"]), stop)


def _with_a_limit(raw: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Leave out what the core says of a limited quantity without a limit."""
    free = {f"{figure}_{name}" for name in names if not np.isfinite(raw[f"limit_{name}"]).any() for figure in FIGURES}
    return {key: value for key, value in raw.items() if key not in free}


def _core_criteria(bench: EngineBench, criteria: LoopCriteria) -> dict[str, Any]:
    return {
        "optimum_cad": math.nan if criteria.optimum is None else criteria.optimum,
        "arrival_cad": criteria.arrival,
        "tail_cycles": criteria.tail_cycles,
        "exceed_from": criteria.exceed_from,
        "exceed_above": criteria.thresholds(bench.limit_names),
        "limits": [] if criteria.limits is None else criteria.limits_of(bench.limit_names),
    }


def monte_carlo(
    benches: EngineBench | Sequence[EngineBench],
    seekers: Seeker | Sequence[Seeker],
    seeds: Iterable[int],
    *,
    cycles: int,
    criteria: LoopCriteria | Sequence[LoopCriteria] | None = None,
    threads: int = 0,
) -> xr.Dataset:
    """Run every seeker on every bench with every seed, whole loops at once on all cores.

    Each loop starts from cycle 0 of its bench and from where its seeker stands. Noise depends on the seed alone, so
    the numbers are the same on any number of threads.

    Parameters
    ----------
    benches : EngineBench or sequence
        Plants, for example several operating points; read, not advanced.
    seekers : seeker or sequence
        For example several gains; read, not advanced.
    seeds : iterable of int
        Of the bench, and of SPSA.
    cycles : int
        Length of each loop.
    criteria : LoopCriteria or sequence of LoopCriteria, optional
        As in `run_seeker`, one for all or one per bench.
    threads : int
        0 for all cores.

    Returns
    -------
    xarray.Dataset
        Over ``bench``, ``seeker`` and ``seed``: the summary of `run_seeker` without its noise-free figures, which would
        double the work, and ``finished``, true everywhere.

    Raises
    ------
    mgdd.errors.ParameterError
        Nothing to run, or a seeker that does not fit a bench.
    mgdd.errors.InUseError
        A bench or seeker is in a call of another thread.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the Dataset with ``finished`` false and NaN for every loop that did not reach its end.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, LoopCriteria, monte_carlo
    >>> from mgdd.optimize import ExtremumSeeking
    >>> gains = [ExtremumSeeking(start=-12.0, lower=-30.0, upper=10.0, gain=g) for g in (0.5, 1.0)]
    >>> table = monte_carlo(EngineBench(), gains, range(4), cycles=400, criteria=LoopCriteria(optimum=-5.63))
    >>> dict(table.sizes)
    {'bench': 1, 'seeker': 2, 'seed': 4}
    """
    bench_list = [benches] if isinstance(benches, EngineBench) else list(benches)
    seeker_list = list(seekers) if isinstance(seekers, Sequence) else [seekers]
    seed_list = _whole_seeds(seeds)
    for seed in seed_list:
        if not 0 <= seed < 2**64:
            raise ParameterError(f"seeds: {seed} must be in [0, 2**64)")
    given = [criteria or LoopCriteria()] * len(bench_list) if not isinstance(criteria, Sequence) else list(criteria)
    if len(given) != len(bench_list):
        raise ShapeError(f"criteria has {len(given)} entries: give one for all or one per bench, {len(bench_list)}")
    each = [_core_criteria(bench, own) for bench, own in zip(bench_list, given, strict=True)]
    for name in ("arrival_cad", "tail_cycles", "exceed_from"):
        if len({own[name] for own in each}) > 1:
            raise ParameterError(f"criteria: {name.removesuffix('_cad')} must be the same for all benches")
    raw, stop = or_partial(
        lambda: _core.loop.monte_carlo(
            bench_list,
            seeker_list,
            seed_list,
            cycles=cycles,
            optimum_cad=[own["optimum_cad"] for own in each],
            arrival_cad=each[0]["arrival_cad"] if each else 1.0,
            tail_cycles=each[0]["tail_cycles"] if each else 1,
            exceed_from=each[0]["exceed_from"] if each else None,
            exceed_above=[own["exceed_above"] for own in each],
            limits=[own["limits"] for own in each],
            threads=threads,
        )
    )
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
    for name, values in _with_a_limit(raw, names).items():
        label = _SUMMARY.get(name) or limit_label(name, names)
        variables[name] = (dims, np.where(finished, values.reshape(shape), np.nan), *label)
    for name in dict.fromkeys(name for own in given for name in own.exceed_above):
        above = [float(own.exceed_above.get(name, np.nan)) for own in given]
        variables[f"exceed_above_{name}"] = ("bench", above, *limit_label(f"exceed_above_{name}", names))
    return hand_over(labelled_dataset(variables, attrs={"cycles": cycles}), stop)


def _whole_seeds(seeds: Iterable[int]) -> list[int]:
    try:
        return [operator.index(seed) for seed in seeds]
    except TypeError as error:
        raise ParameterError(f"seeds: must be whole numbers, for example range(20): {error}") from None
