"""What a closed loop came to, from its cycles: the same figures as those of the core, also for half a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["summarize_cycles"]


def summarize_cycles(
    cycles: xr.Dataset,
    *,
    optimum_cad: float | None = None,
    arrival_cad: float = 1.0,
    tail_cycles: int = 100,
    exceed_from: int = 1000,
    exceed_above: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Sum up the cycles of a run, whether it came to its end or not.

    Parameters
    ----------
    cycles : xarray.Dataset
        Over ``cycle``: ``estimate_cad``, ``soc_requested_cad``, ``misfire`` and ``j``; where measured also
        ``unphysical``, ``efficiency_gross``, ``nox_true_ppm`` and ``limits`` over ``limit``.
    optimum_cad, arrival_cad, tail_cycles, exceed_from, exceed_above
        As in `run_seeker`; cycles are counted from the first row.

    Returns
    -------
    dict
        The summary of `run_seeker`, to rounding, with the halves and the tail of the cycles at hand. NaN where nothing
        was measured.

    Raises
    ------
    mgdd.errors.ParameterError
        A limit in ``exceed_above`` that was not measured, a NaN there, or a criterion out of its range.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, run_seeker, summarize_cycles
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-20.0, lower=-30.0, upper=10.0, noise_sd=0.25)
    >>> run = run_seeker(EngineBench(seed=1), seeker, 300, optimum_cad=-5.63)
    >>> again = summarize_cycles(run.dataset, optimum_cad=-5.63)
    >>> again["cycles_to"] == run.summary["cycles_to"]
    True
    """
    _check_criteria(cycles, arrival_cad, tail_cycles, exceed_from, exceed_above or {})
    estimate: NDArray[np.float64] = cycles["estimate_cad"].to_numpy()
    n = estimate.size
    half = np.arange(n) >= n // 2
    misfire = cycles["misfire"].to_numpy().astype(bool)
    void = misfire | cycles["unphysical"].to_numpy().astype(bool) if "unphysical" in cycles else misfire

    def fired(name: str, factor: float = 1.0) -> float:
        return factor * _mean(cycles[name].to_numpy()[half & ~void]) if name in cycles else math.nan

    out = {
        "final_cad": _mean(estimate[max(n - tail_cycles, 0) :]),
        "mean_cad": _mean(estimate[half]),
        "rms_cad": math.nan,
        "cycles_to": math.nan,
        "cycles_stays": math.nan,
        "exceeded_fraction": _exceeded(cycles, exceed_from, exceed_above or {}),
        "mean_applied_cad": _mean(cycles["soc_requested_cad"].to_numpy()[half]),
        "mean_j": fired("j"),
        "mean_efficiency_percent": fired("efficiency_gross", 100.0),
        "mean_nox_ppm": fired("nox_true_ppm"),
        "lowest_cad": float(np.min(estimate, initial=math.inf)),
        "highest_cad": float(np.max(estimate, initial=-math.inf)),
        "misfires": float(misfire.sum()),
    }
    if optimum_cad is None or not math.isfinite(optimum_cad):
        return out
    away = np.asarray(estimate - optimum_cad, dtype=np.float64)
    out["rms_cad"] = math.sqrt(_mean(away[half] ** 2))
    near = np.abs(away) <= arrival_cad
    if near.any():
        out["cycles_to"] = float(np.argmax(near))
    if n and near[-1]:
        out["cycles_stays"] = float(n - np.argmin(near[::-1])) if not near.all() else 0.0
    return out


def _check_criteria(
    cycles: xr.Dataset, arrival_cad: float, tail_cycles: int, exceed_from: int, above: Mapping[str, float]
) -> None:
    if not arrival_cad > 0.0:
        raise ParameterError(f"arrival_cad = {arrival_cad:g}: must be > 0")
    if tail_cycles < 1:
        raise ParameterError(f"tail_cycles = {tail_cycles}: must be >= 1")
    if exceed_from < 0:
        raise ParameterError(f"exceed_from = {exceed_from}: must be >= 0")
    measured = [str(name) for name in cycles["limit"].to_numpy()] if "limits" in cycles else []
    for name, value in above.items():
        if name not in measured:
            raise ParameterError(f"exceed_above: {name!r} is not among the limits that were measured, {measured}")
        if math.isnan(value):
            raise ParameterError(f"exceed_above: {name} = nan: give a number, or leave it out")


def _exceeded(cycles: xr.Dataset, first: int, above: Mapping[str, float]) -> float:
    if not above or "limits" not in cycles or cycles.sizes["cycle"] <= first:
        return math.nan
    thresholds = np.array([above.get(str(name), math.inf) for name in cycles["limit"].to_numpy()])
    over = np.any(cycles["limits"].to_numpy()[first:] > thresholds, axis=1)
    return float(np.mean(over))


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if values.size else math.nan
