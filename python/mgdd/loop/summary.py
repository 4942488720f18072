"""What a closed loop came to, from its cycles: the same figures as those of the core, also for half a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mgdd.loop.criteria import LoopCriteria
from mgdd.loop.limit_figures import NOISE_FREE, limit_figures

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["summarize_cycles"]


def summarize_cycles(cycles: xr.Dataset, criteria: LoopCriteria | None = None) -> dict[str, float]:
    """Sum up the cycles of a run, whether it came to its end or not.

    Parameters
    ----------
    cycles : xarray.Dataset
        Over ``cycle``: ``misfire`` and ``j``, and ``estimate_cad`` and ``soc_requested_cad`` or, over ``input`` as
        well, ``estimate`` and ``applied``; where known also
        ``soc_applied_cad``, ``unphysical``, ``efficiency_gross``, ``nox_true_ppm``,
        ``limits`` and ``noise_free_limits`` over ``limit``.
    criteria : LoopCriteria, optional
        As in `run_seeker`; cycles are counted from the first row. No seeker is at hand, so ``limits`` must be named for
        their figures.

    Returns
    -------
    dict
        The summary of `run_seeker`, to rounding, with the halves and the tail of the cycles at hand. NaN where nothing
        was measured, and for figures of the estimate where it is not one angle.

    Raises
    ------
    mgdd.errors.ParameterError
        A limit in ``exceed_above`` or ``limits`` that was not measured.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, LoopCriteria, run_seeker
    >>> from mgdd.loop.summary import summarize_cycles
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-20.0, lower=-30.0, upper=10.0, noise_sd=0.25)
    >>> run = run_seeker(EngineBench(seed=1), seeker, 300, criteria=LoopCriteria(optimum=-5.63))
    >>> again = summarize_cycles(run.dataset, LoopCriteria(optimum=-5.63))
    >>> again["cycles_to"] == run.summary["cycles_to"]
    True
    """
    criteria = criteria or LoopCriteria()
    measured = tuple(str(name) for name in cycles["limit"].to_numpy()) if "limits" in cycles else ()
    uppers = list[float]()
    if cycles.sizes["cycle"]:  # a run that was interrupted before its first cycle has measured nothing
        criteria.thresholds(measured)
        uppers = criteria.limits_of(measured)
    estimate, applied = _one_angle(cycles)
    n = estimate.size
    half = np.arange(n) >= n // 2
    misfire = cycles["misfire"].to_numpy().astype(bool)
    void = misfire | cycles["unphysical"].to_numpy().astype(bool) if "unphysical" in cycles else misfire

    def fired(name: str, factor: float = 1.0) -> float:
        return factor * _mean(cycles[name].to_numpy()[half & ~void]) if name in cycles else math.nan

    out = {
        "final_cad": _mean(estimate[max(n - criteria.tail_cycles, 0) :]),
        "mean_cad": _mean(estimate[half]),
        "rms_cad": math.nan,
        "cycles_to": math.nan,
        "cycles_stays": math.nan,
        "exceeded_fraction": _exceeded(cycles, criteria.counted_from(n), criteria.exceed_above),
        "mean_applied_cad": _mean(applied[half]),
        "mean_j": fired("j"),
        "mean_efficiency_percent": fired("efficiency_gross", 100.0),
        "mean_nox_ppm": fired("nox_true_ppm"),
        "lowest_cad": float(np.min(estimate, initial=math.inf)),
        "highest_cad": float(np.max(estimate, initial=-math.inf)),
        "misfires": float(misfire.sum()),
        "judged_from": float(criteria.counted_from(n)),
        **{f"exceed_above_{name}": float(value) for name, value in criteria.exceed_above.items()},
        **_of_limits(cycles, uppers, criteria.counted_from(n)),
    }
    if criteria.optimum is None:
        return out
    away = np.asarray(estimate - criteria.optimum, dtype=np.float64)
    out["rms_cad"] = math.sqrt(_mean(away[half] ** 2))
    near = np.abs(away) <= criteria.arrival
    if near.any():
        out["cycles_to"] = float(np.argmax(near))
    if n and near[-1]:
        out["cycles_stays"] = float(n - np.argmin(near[::-1])) if not near.all() else 0.0
    return out


def _of_limits(cycles: xr.Dataset, uppers: Sequence[float], judged_from: int) -> dict[str, float]:
    """Sum up the limits of a run as measured and, where the plant knows them, noise-free; `uppers` as in `limit`."""
    out: dict[str, float] = {}
    for variable, prefix in (("limits", ""), ("noise_free_limits", NOISE_FREE)):
        if variable in cycles:
            names = [str(name) for name in cycles["limit"].to_numpy()]
            out |= limit_figures(cycles[variable].to_numpy(), names, uppers, judged_from, prefix)
    return out


def _one_angle(cycles: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give estimate and applied timing [°CA aTDC]; NaN for several inputs or one that is not an angle."""
    if "estimate_cad" in cycles:
        applied = cycles["soc_applied_cad" if "soc_applied_cad" in cycles else "soc_requested_cad"]
        return cycles["estimate_cad"].to_numpy(), applied.to_numpy()
    if cycles.sizes["input"] == 1 and str(cycles["input"].to_numpy()[0]).endswith("_cad"):
        return cycles["estimate"].to_numpy()[:, 0], cycles["applied"].to_numpy()[:, 0]
    nothing = np.full(cycles.sizes["cycle"], math.nan)
    return nothing, nothing


def _exceeded(cycles: xr.Dataset, first: int, above: Mapping[str, float]) -> float:
    if not above or "limits" not in cycles or cycles.sizes["cycle"] <= first:
        return math.nan
    thresholds = np.array([above.get(str(name), math.inf) for name in cycles["limit"].to_numpy()])
    over = np.any(cycles["limits"].to_numpy()[first:] > thresholds, axis=1)
    return float(np.mean(over))


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if values.size else math.nan
