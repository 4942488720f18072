"""Weights of the samples of a log: what the model does not describe counts less, where the rest stands at its noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["SPREAD", "Blocks", "certainly_less"]

_BLOCK_S, _FEWEST = 0.1, 10
_MOVED_DEG = 1.0
_CERTAIN = 2.0  # standard errors
_AT_NOISE = 2.0
SPREAD = 1.25  # of the errors of blocks that differ by noise alone


class Blocks:
    """A log in blocks of 0.1 s, for errors that differ between them.

    A free run leaves the plate where the model is wrong (where it crosses a gap, rebounds from a stop), and those few
    blocks would decide everything. With an error of its own for each block maximum likelihood divides by it (Carroll
    and Ruppert 1988, chapter 2).

    Parameters
    ----------
    angle : ndarray, shape (n,)
        As measured [deg].
    step_s : float
        Sample time [s].
    """

    def __init__(self, angle: NDArray[np.float64], step_s: float) -> None:
        size = max(round(_BLOCK_S / step_s), _FEWEST)
        self.of_sample = np.minimum(np.arange(angle.size) // size, max(angle.size // size - 1, 0))
        self._samples = np.bincount(self.of_sample)
        self._moving = np.array([np.ptp(angle[self.of_sample == k]) > _MOVED_DEG for k in range(self._samples.size)])

    def errors(self, residual: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the root mean square of every block, in the unit of the residual."""
        return np.asarray(np.sqrt(np.bincount(self.of_sample, weights=residual**2) / self._samples))

    def usual(self, errors: NDArray[np.float64], floor: float) -> float:
        """Return the median error of the blocks in which the plate moves, at least `floor`."""
        return max(float(np.median(errors[self._moving])) if self._moving.any() else 0.0, floor)

    def weights(self, residual: NDArray[np.float64], floor: float) -> NDArray[np.float64] | None:
        """Return a weight per sample, 1 where its block is as good as the usual one.

        None where all are, and where the usual block is far from `floor`: then the model misses the whole log.
        """
        errors = self.errors(residual)
        usual = self.usual(errors, floor)
        most = SPREAD * usual
        if errors.size < 4 or usual > _AT_NOISE * floor or not (errors > most).any():
            return None
        return np.asarray(np.minimum(1.0, most / np.maximum(errors, floor))[self.of_sample])

    def losses(self, residual: NDArray[np.float64], most: float) -> NDArray[np.float64]:
        """Return the mean square of every block, cut off at `most` squared: what the model misses has no vote."""
        return np.asarray(np.minimum(self.errors(residual), most) ** 2)


def certainly_less(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> bool:
    """Whether one model loses less than another by more than twice the standard error of the mean over blocks.

    The comparison of Diebold and Mariano (1995) with blocks long enough to be independent.
    """
    apart = theirs - ours
    error = float(apart.std(ddof=1)) / np.sqrt(apart.size) if apart.size > 1 else np.inf
    return bool(apart.mean() > _CERTAIN * error)
