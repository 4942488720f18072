"""Whether the estimate of a seeker has settled, and where."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError

if TYPE_CHECKING:
    import xarray as xr

_LEAST_SHARE = 1e-3  # of the spread: standard deviation of an estimate that does not move at all


def settled_estimate(history: xr.Dataset, cycles: int, spread: float) -> tuple[float, float] | None:
    """Give mean and standard deviation of the last cycles of a seeker with one input; None where they do not agree."""
    if cycles < 2:
        raise ParameterError.of("cycles", cycles, ">= 2")
    last = history.isel(cycle=slice(-cycles, None))
    if last.sizes["cycle"] < cycles:
        return None
    if "point" in last and (np.ptp(last["point"].to_numpy()) > 0 or bool(last["testing"].to_numpy().any())):
        return None
    estimate = last["estimate"].to_numpy()[:, 0]
    early, late = estimate[: cycles // 2], estimate[cycles // 2 :]
    drift = abs(float(np.mean(late) - np.mean(early)))
    scatter = float(np.mean(np.abs(estimate - np.mean(estimate))))
    if not (scatter < spread and drift < spread):
        return None
    return float(np.mean(estimate)), max(math.hypot(scatter, drift), _LEAST_SHARE * spread)
