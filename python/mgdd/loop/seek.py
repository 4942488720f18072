"""A seeker on the virtual bench: one closed loop, or thousands."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, hand_over, or_partial
from mgdd.loop.bench import EngineBench, cycles_to_dataset
from mgdd.results import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.optimize import BoundedSeeking, ExtremumSeeking, GoldenSection, GradientDescent, NewtonSeeking, Spsa

    Seeker = ExtremumSeeking | NewtonSeeking | BoundedSeeking | Spsa | GradientDescent | GoldenSection

__all__ = ["LoopRun", "monte_carlo", "run_seeker"]

_CAD = "°CA aTDC"
_SUMMARY = {
    "final_cad": (_CAD, "mean estimate of the last cycles"),
    "mean_cad": (_CAD, "mean estimate, second half"),
    "rms_cad": ("°CA", "rms distance of the estimate to the optimum, second half"),
    "cycles_to": ("cycle", "first cycle at which the estimate has arrived"),
    "cycles_stays": ("cycle", "cycle from which the estimate stays"),
    "exceeded_fraction": ("-", "share of cycles over a limit"),
    "mean_applied_cad": (_CAD, "mean applied timing, second half"),
    "mean_j": ("unit of J", "mean performance, second half"),
    "mean_efficiency_percent": ("%", "mean gross efficiency, second half"),
    "mean_nox_ppm": ("ppm", "mean true NOx, second half"),
    "lowest_cad": (_CAD, "lowest estimate"),
    "highest_cad": (_CAD, "highest estimate"),
    "misfires": ("-", "misfired cycles"),
}


@dataclass(frozen=True, kw_only=True)
class LoopRun:
    """A closed loop, cycle by cycle, and what it came to.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over ``cycle``: ``estimate_cad`` before the cycle and everything that the bench measured of it.
    summary : mapping of str to float
        ``final_cad`` (mean estimate of the last 100 cycles), ``mean_cad`` and ``rms_cad`` (second half), ``cycles_to``
        and ``cycles_stays`` (NaN: never), ``exceeded_fraction``, means of J, efficiency and true NOx over the second
        half, extremes of the estimate, misfires.
    interrupted : bool
        Ctrl-C ended the run before all its cycles: it is the part that `mgdd.errors.Interrupted` carried.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking
    >>> run = run_seeker(EngineBench(seed=1), ExtremumSeeking(start=-20.0, lower=-30.0, upper=10.0), 600)
    >>> abs(run.summary["final_cad"] + 5.63) < 2.0
    True
    """

    dataset: xr.Dataset
    summary: Mapping[str, float]
    interrupted: bool = False


def run_seeker(
    bench: EngineBench,
    seeker: Seeker,
    cycles: int,
    *,
    optimum_cad: float | None = None,
    arrival_cad: float = 1.0,
    tail_cycles: int = 100,
    exceed_from: int = 1000,
    exceed_above: Mapping[str, float] | None = None,
) -> LoopRun:
    """Run a seeker on the bench, in the core and without the GIL.

    Each cycle is one ask, one cycle of the bench and one tell; a new operating point restarts the seeker first. Driving
    the same seeker from Python one ask/tell at a time gives the same trajectory, bit for bit. Both go on from where
    they stand: calling again continues.

    Parameters
    ----------
    bench : EngineBench
        The plant; it advances by ``cycles``.
    seeker
        Any seeker of `mgdd.optimize` with one input, one component or as many as the performance has terms, and the
        limits of the bench.
    cycles : int
        How many.
    optimum_cad : float, optional
        Where the estimate should go [°CA aTDC], for ``rms_cad``, ``cycles_to`` and ``cycles_stays``.
    arrival_cad : float
        Distance to the optimum that counts as arrived [°CA].
    tail_cycles : int
        Cycles behind ``final_cad``.
    exceed_from : int
        First cycle that counts for ``exceeded_fraction``.
    exceed_above : mapping of str to float, optional
        Per limit of the bench, the value above which a cycle counts.

    Returns
    -------
    LoopRun
        Cycles and summary.

    Raises
    ------
    mgdd.errors.ParameterError
        A seeker that does not fit the bench, or fewer than one cycle.
    mgdd.errors.InUseError
        Bench or seeker are in a call of another thread.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the LoopRun of the cycles until then. Bench and seeker stand behind them, and running
        them again goes on.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, run_seeker
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-20.0, lower=-30.0, upper=10.0, noise_sd=0.25)
    >>> run = run_seeker(EngineBench(seed=1), seeker, 300, optimum_cad=-5.63)
    >>> run.summary["cycles_to"] < 100
    True
    """
    above = _thresholds(bench, exceed_above)
    raw, stop = or_partial(
        lambda: _core.run_loop(
            bench,
            seeker,
            cycles,
            optimum_cad=math.nan if optimum_cad is None else optimum_cad,
            arrival_cad=arrival_cad,
            tail_cycles=tail_cycles,
            exceed_from=exceed_from,
            exceed_above=above,
        )
    )
    dataset = cycles_to_dataset(bench, raw["columns"], estimate_cad=raw["estimate_cad"])
    dataset.attrs["interrupted"] = int(raw["interrupted"])
    return hand_over(LoopRun(dataset=dataset, summary=raw["summary"], interrupted=raw["interrupted"]), stop)


def monte_carlo(
    benches: EngineBench | Sequence[EngineBench],
    seekers: Seeker | Sequence[Seeker],
    seeds: Iterable[int],
    *,
    cycles: int,
    optimum_cad: float | Sequence[float] | None = None,
    arrival_cad: float = 1.0,
    tail_cycles: int = 100,
    exceed_from: int = 1000,
    exceed_above: Mapping[str, float] | None = None,
    threads: int = 0,
) -> xr.Dataset:
    """Run every seeker on every bench with every seed, whole loops at once on all cores.

    Each loop starts from cycle 0 of its bench and from where its seeker stands. Chance depends on the seed alone, so
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
    optimum_cad : float or sequence of float, optional
        Per bench, where the estimate should go [°CA aTDC].
    arrival_cad, tail_cycles, exceed_from, exceed_above
        As in `run_seeker`.
    threads : int
        0 for all cores.

    Returns
    -------
    xarray.Dataset
        Over ``bench``, ``seeker`` and ``seed``: the summary of `run_seeker`, and ``finished``, which is true.

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
    >>> from mgdd.loop import EngineBench, monte_carlo
    >>> from mgdd.optimize import ExtremumSeeking
    >>> gains = [ExtremumSeeking(start=-12.0, lower=-30.0, upper=10.0, gain=g) for g in (0.5, 1.0)]
    >>> table = monte_carlo(EngineBench(), gains, range(4), cycles=400, optimum_cad=-5.63)
    >>> dict(table.sizes)
    {'bench': 1, 'seeker': 2, 'seed': 4}
    """
    bench_list = [benches] if isinstance(benches, EngineBench) else list(benches)
    seeker_list = list(seekers) if isinstance(seekers, Sequence) else [seekers]
    seed_list = _whole_seeds(seeds)
    for seed in seed_list:
        if not 0 <= seed < 2**64:
            raise ParameterError(f"seeds: {seed} must be in [0, 2**64)")
    if optimum_cad is None:
        optima = [math.nan] * len(bench_list)
    elif isinstance(optimum_cad, int | float | np.number):
        optima = [float(optimum_cad)] * len(bench_list)
    else:
        optima = [float(value) for value in optimum_cad]
    above = [_thresholds(bench, exceed_above) for bench in bench_list]
    raw, stop = or_partial(
        lambda: _core.monte_carlo(
            bench_list,
            seeker_list,
            seed_list,
            cycles=cycles,
            optimum_cad=optima,
            arrival_cad=arrival_cad,
            tail_cycles=tail_cycles,
            exceed_from=exceed_from,
            exceed_above=above,
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
    for name, values in raw.items():
        variables[name] = (dims, np.where(finished, values.reshape(shape), np.nan), *_SUMMARY[name])
    return hand_over(labelled_dataset(variables, attrs={"cycles": cycles}), stop)


def _whole_seeds(seeds: Iterable[int]) -> list[int]:
    try:
        return [operator.index(seed) for seed in seeds]
    except TypeError as error:
        raise ParameterError(f"seeds: must be whole numbers, for example range(20): {error}") from None


def _thresholds(bench: EngineBench, exceed_above: Mapping[str, float] | None) -> list[float]:
    if exceed_above is None:
        return []
    names: list[str] = bench.settings["limits"]
    unknown = set(exceed_above) - set(names)
    if unknown:
        raise ParameterError(f"exceed_above: {sorted(unknown)} not among the limits of the bench, {names}")
    return [float(exceed_above.get(name, math.inf)) for name in names]
