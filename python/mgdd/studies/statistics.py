"""Means over seeds with their 95 % interval, and bands of trajectories."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import EngineBench, monte_carlo, run_seeker
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "bands",
    "loops",
    "mean_interval",
    "median_interval",
    "rms",
    "run_with_slope",
    "with_interval",
    "with_median_interval",
]

_CONFIDENCE = 0.95


def mean_interval(values: ArrayLike) -> tuple[float, float, float]:
    """Give the mean of independent values and the ends of its 95 % interval, by Student's t.

    Parameters
    ----------
    values : array_like
        One value per seed; NaN (a loop that never arrived) is left out.

    Returns
    -------
    tuple of float
        Mean, low and high end; the ends are NaN for fewer than two values.
    """
    from scipy.special import stdtrit

    known = np.asarray(values, float).ravel()
    known = known[np.isfinite(known)]
    if known.size == 0:
        return math.nan, math.nan, math.nan
    mean = float(known.mean())
    if known.size == 1:
        return mean, math.nan, math.nan
    freedom = known.size - 1
    half = float(stdtrit(freedom, 0.5 + 0.5 * _CONFIDENCE) * known.std(ddof=1) / math.sqrt(known.size))
    return mean, mean - half, mean + half


def median_interval(values: ArrayLike) -> tuple[float, float, float]:
    """Give the median of independent values and the ends of its 95 % interval, by order statistics.

    The interval holds for any distribution: its ends are the narrowest symmetric pair of ordered values between which
    the median lies with at least 95 %.

    Parameters
    ----------
    values : array_like
        One value per seed; infinite for a loop that never arrived, which counts. NaN is left out.

    Returns
    -------
    tuple of float
        Median, low and high end; the ends are NaN for fewer than six values, which have no such pair.
    """
    from scipy.stats import binom

    known = np.sort(np.asarray(values, float).ravel())
    known = known[~np.isnan(known)]
    if known.size == 0:
        return math.nan, math.nan, math.nan
    below = known[(known.size - 1) // 2]
    above = known[known.size // 2]
    middle = float(above if not math.isfinite(above) else 0.5 * (below + above))
    cut = int(binom.ppf(0.5 * (1.0 - _CONFIDENCE), known.size, 0.5))
    if cut < 1:
        return middle, math.nan, math.nan
    return middle, float(known[cut - 1]), float(known[known.size - cut])


def with_median_interval(name: str, values: ArrayLike) -> dict[str, float | None]:
    """Name a median and the ends of its interval as a row does; None for what is not finite."""
    said = zip((name, f"{name}_low", f"{name}_high"), median_interval(values), strict=True)
    return {key: value if math.isfinite(value) else None for key, value in said}


def with_interval(name: str, values: ArrayLike) -> dict[str, float]:
    """Name a mean and the ends of its interval as a row does: ``name``, ``name_low``, ``name_high``."""
    return dict(zip((name, f"{name}_low", f"{name}_high"), mean_interval(values), strict=True))


def rms(values: ArrayLike) -> float:
    """Give the root of the mean square over seeds."""
    return float(np.sqrt(np.nanmean(np.square(np.asarray(values, float)))))


def loops(bench: EngineBench, seeker: Any, seeds: Iterable[int], **how: Any) -> xr.Dataset:
    """Run `monte_carlo` of one bench and one seeker, over ``seed`` alone."""
    return monte_carlo(bench, seeker, seeds, **how).isel(bench=0, seeker=0, drop=True)


def bands(make: Callable[[int], tuple[EngineBench, Any]], seeds: Iterable[int], cycles: int) -> NDArray[np.float64]:
    """Give median, 10 % and 90 % quantile of the estimate over seeds, cycle by cycle, shape (3, cycles) [°CA aTDC]."""
    runs = [run_seeker(*make(seed), cycles).dataset["estimate_cad"].to_numpy() for seed in seeds]
    return np.asarray(np.quantile(np.stack(runs), [0.5, 0.1, 0.9], axis=0))


def run_with_slope(bench: EngineBench, seeker: Any, cycles: int) -> xr.Dataset:
    """Give the cycles of `run_seeker` with the seeker's own slope of J, as mean over one dither period.

    Bench and seeker are copied: the same loop is run once in the core and once by ask and tell, which are one
    trajectory bit for bit.
    """
    twin, listener = copy.deepcopy(bench), copy.deepcopy(seeker)
    run = run_seeker(bench, seeker, cycles).dataset
    slope = np.empty(cycles)
    for cycle in range(cycles):
        measured = twin.step(float(listener.ask()[0]))
        parts = measured["components"]
        told = parts if listener.component_count > 1 else parts.sum()
        listener.tell(told, measured["limits"] if listener.limit_names else None, misfire=measured["misfire"])
        slope[cycle] = listener.gradient[0]
    settings = listener.settings
    period = 1 if settings.get("form") == "batch" else int(settings["period"])  # a batch is such a mean itself
    mean = np.convolve(slope, np.full(period, 1.0 / period))[:cycles]
    attrs = unit_attributes("%/°CA", "estimated slope of J")
    return run.assign(gradient_per_cad=("cycle", mean, attrs))
