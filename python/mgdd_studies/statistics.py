"""Means over seeds with their 95 % interval, and bands of trajectories."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import VirtualEngine, monte_carlo, run_seeker
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "OF_SEEDS", "OVER_SEEDS", "approach_gain", "band_variables", "estimates", "first_within", "loops", "mean_interval",
    "median_interval", "quantile_of", "quantiles_of", "rms", "run_with_slope", "sd_of", "stays_within", "with_interval",
    "with_median_interval", "with_quantiles",
]  # fmt: skip

_CONFIDENCE = 0.95
_SHARES = {"low": 0.1, "median": 0.5, "high": 0.9}
OF_SEEDS = {
    "low": "estimate, 10 % of the seeds below",
    "median": "estimate, median of the seeds",
    "high": "estimate, 10 % of the seeds above",
}


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
    return {key: _finite(value) for key, value in said}


def quantile_of(values: ArrayLike, share: float) -> float | None:
    """Give the least of the values below which a share of them lies; None where it is not finite."""
    return _finite(float(np.quantile(np.asarray(values, float), share, method="inverted_cdf")))


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def with_interval(name: str, values: ArrayLike) -> dict[str, float]:
    """Name a mean and the ends of its interval as a row does: ``name``, ``name_low``, ``name_high``."""
    return dict(zip((name, f"{name}_low", f"{name}_high"), mean_interval(values), strict=True))


def rms(values: ArrayLike) -> float:
    """Give the root of the mean square over seeds."""
    return float(np.sqrt(np.nanmean(np.square(np.asarray(values, float)))))


def sd_of(values: NDArray[np.float64]) -> float:
    """Give the standard deviation over seeds; NaN of one."""
    return float(values.std(ddof=1)) if values.size > 1 else math.nan


def first_within(estimate: NDArray[np.float64], best: float, distance: float) -> float:
    """Give the first cycle whose estimate lies within the distance; infinite where none does."""
    near = np.abs(estimate - best) <= distance
    return float(np.argmax(near)) if near.any() else math.inf


def stays_within(estimate: NDArray[np.float64], best: float, distance: float) -> float:
    """Give the cycle from which no estimate lies beyond the distance; infinite where the last one does."""
    beyond = np.flatnonzero(np.abs(estimate - best) > distance)
    last = int(beyond[-1]) + 1 if beyond.size else 0
    return float(last) if last < estimate.size else math.inf


def band_variables(
    name: str, over: tuple[str, str], runs: Iterable[ArrayLike], units: str, said: Mapping[str, str]
) -> dict[str, tuple[Any, ...]]:
    """Give median and band of 80 % of the seeds of some runs, as variables of a Dataset.

    Parameters
    ----------
    name : str
        Of the variables, with ``{}`` for ``low``, ``median`` or ``high``.
    over : tuple of str
        Dimensions of runs and cycles.
    runs : iterable of array_like, shape (seeds, cycles)
        Each run.
    units : str
        Of the variables.
    said : mapping of str to str
        Long names by end, in the order of the variables.
    """
    each = [np.asarray(run, float) for run in runs]
    return {
        name.format(end): (over, [np.quantile(run, _SHARES[end], axis=0) for run in each], units, text)
        for end, text in said.items()
    }


def quantiles_of(what: str, median: str) -> dict[str, str]:
    """Name median and ends of a band for `band_variables`: the ends as quantiles of something."""
    return {"median": median, "low": f"10 % quantile of the {what}", "high": f"90 % quantile of the {what}"}


def with_quantiles(text: str) -> dict[str, str]:
    """Name median and ends of a band for `band_variables`: the median by the text alone."""
    return {"median": text, "low": f"{text}, 10 % quantile", "high": f"{text}, 90 % quantile"}


def loops(bench: VirtualEngine, seeker: Any, seeds: Iterable[int], **how: Any) -> xr.Dataset:
    """Run `monte_carlo` of one bench and one seeker, over ``seed`` alone."""
    return monte_carlo(bench, seeker, seeds, **how).isel(bench=0, seeker=0, drop=True)


OVER_SEEDS = quantiles_of("estimate over seeds", "estimate of the best timing")


def estimates(
    make: Callable[[int], tuple[VirtualEngine, Any]], seeds: Iterable[int], cycles: int
) -> NDArray[np.float64]:
    """Run a seeker on a bench for each seed, and give its estimates, shape (seeds, cycles) [°CA aTDC]."""
    return np.stack([run_seeker(*make(seed), cycles).dataset["estimate"].to_numpy()[:, 0] for seed in seeds])


def run_with_slope(bench: VirtualEngine, seeker: Any, cycles: int) -> xr.Dataset:
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
    attrs = unit_attributes("%/°CA", "estimated slope of the objective")
    return run.assign(gradient_per_cad=("cycle", mean, attrs))


def approach_gain(curvature: float, time_constant_cycles: float, *, amplitude: float = 1.0) -> float:
    """Give the gain by which extremum seeking nears an optimum of this curvature with this time constant [cycles]."""
    return 2.0 / (amplitude * abs(curvature) * time_constant_cycles)
