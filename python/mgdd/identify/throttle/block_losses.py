"""Errors of a throttle log block by block: what the model misses in a few of them must not decide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

_BLOCK_S, _FEWEST = 0.1, 10
_MOVED_DEG = 1.0
_SPREAD = 1.25  # of the errors of blocks that differ by noise alone
_CERTAIN = 2.0  # standard errors


def block_losses(
    residual: Mapping[float, NDArray[np.float64]], angle: NDArray[np.float64], step_s: float, floor_deg: float
) -> dict[float, NDArray[np.float64]]:
    """Return the mean square of blocks of 0.1 s in which the plate moves, cut off where no model describes the plate.

    A free run leaves the plate where the model is wrong (where it crosses a gap, rebounds from a stop), and those few
    blocks would decide. A loss is therefore cut off a quarter above the usual error of the best model.
    """
    size = max(round(_BLOCK_S / step_s), _FEWEST)
    of_sample = np.minimum(np.arange(angle.size) // size, max(angle.size // size - 1, 0))
    samples = np.bincount(of_sample)
    moving = np.array([np.ptp(angle[of_sample == k]) > _MOVED_DEG for k in range(samples.size)])
    moving = moving if moving.any() else np.ones(samples.size, dtype=bool)
    square = {key: (np.bincount(of_sample, weights=one**2) / samples)[moving] for key, one in residual.items()}
    usual = max(min(float(np.median(one)) for one in square.values()), floor_deg**2)
    return {key: np.minimum(one, _SPREAD**2 * usual) for key, one in square.items()}


def certainly_less(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> bool:
    """Whether one model loses less than another by more than twice the standard error of the mean over blocks.

    The comparison of Diebold and Mariano (1995) with blocks long enough to be independent.
    """
    apart = theirs - ours
    error = float(apart.std(ddof=1)) / np.sqrt(apart.size) if apart.size > 1 else np.inf
    return bool(apart.mean() > _CERTAIN * error)
