"""What the noise of an angle leaves of the fit of a perfect model, and fits that stay far below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.results.finding import Finding

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.results.fit import FitQuality

_MISSED_PERCENT = 3.0  # points of the fit below what noise alone would leave
_LEAST_FOUR_FIFTHS = 0.4377  # mean square of the least four fifths of a normal variable, over its variance


def noise_of(angle: NDArray[np.float64]) -> float:
    """Return the standard deviation of white noise on an angle, from its second differences, which motion hardly has.

    The mean square of the smaller four fifths, over what it is of a normal distribution: a median would be a whole
    number of steps of the converter.
    """
    second = np.sort(np.abs(np.diff(angle, 2)))
    least = second[: max(4 * second.size // 5, 1)]
    return float(np.sqrt(np.mean(least**2) / (_LEAST_FOUR_FIFTHS * 6.0)))


def below_ceiling(logs: Sequence[xr.Dataset], train: FitQuality | None) -> tuple[Finding, ...]:
    """Report a fit that misses far more of its own logs than the noise of the angle."""
    own = None if train is None else train.nrmse_fit_percent
    if own is None:
        return ()
    angles = [log["angle_deg"].to_numpy() for log in logs]
    noise = float(np.sqrt(np.average([noise_of(angle) ** 2 for angle in angles], weights=[a.size for a in angles])))
    ceiling = 100.0 * (1.0 - noise / float(np.std(np.concatenate(angles))))
    if ceiling - own <= _MISSED_PERCENT:
        return ()
    text = (
        f"the fit meets its own log at {own:.1f} %, and the noise of the angle alone would leave {ceiling:.1f} %: the "
        "plate does what the model does not have, and the intervals hold for the model only"
    )
    remedy = "compare with the other kinds of model, look at the residuals, and check the stops and the log"
    return (Finding("below_ceiling", (), text, remedy),)
