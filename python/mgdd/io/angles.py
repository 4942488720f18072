"""Crank angles in other conventions, converted to °CA aTDC (firing TDC = 0, compression negative)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["CONVENTION", "from_0_720", "from_btdc"]

CONVENTION = "crank angle is in °CA aTDC: firing TDC = 0, compression negative"


def from_0_720(
    angle_deg: ArrayLike, pressure: ArrayLike, *, firing_tdc_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turn a 0..720 degree record into -360..360 °CA aTDC, sorted by angle.

    Parameters
    ----------
    angle_deg : array_like
        Rising crank angle [deg], one cycle at most.
    pressure : array_like
        Pressure at these angles, any unit; it is only reordered.
    firing_tdc_deg : float
        Where firing TDC stands in the record [deg]: 360 when it starts at gas-exchange TDC, 0 when it starts
        at firing TDC. It is never guessed.

    Returns
    -------
    tuple of ndarray
        Angle [°CA aTDC] and pressure, both new arrays.

    Raises
    ------
    DataError
        Angles that do not rise or that span more than 720 degrees, a `firing_tdc_deg` outside 0..720.
    ShapeError
        Arrays that are not one-dimensional and equally long.

    Examples
    --------
    >>> from mgdd.io import from_0_720
    >>> angle, pressure = from_0_720([0, 90, 180, 540, 630], [5, 4, 3, 2, 1], firing_tdc_deg=0)
    >>> angle.tolist(), pressure.tolist()
    ([-180.0, -90.0, 0.0, 90.0, 180.0], [2.0, 1.0, 5.0, 4.0, 3.0])
    """
    angle, values = pair(angle_deg, pressure)
    order, aligned = aligned_angle(angle, firing_tdc_deg)
    return aligned[order], values[order]


def from_btdc(angle_deg: ArrayLike, pressure: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turn angles in degrees *before* firing TDC (compression positive) into °CA aTDC, sorted by angle.

    Parameters
    ----------
    angle_deg : array_like
        Crank angle [° before firing TDC].
    pressure : array_like
        Pressure at these angles, any unit; it is only reordered.

    Returns
    -------
    tuple of ndarray
        Angle [°CA aTDC] and pressure, both new arrays.

    Raises
    ------
    ShapeError
        Arrays that are not one-dimensional and equally long.

    Examples
    --------
    >>> from mgdd.io import from_btdc
    >>> angle, pressure = from_btdc([2, 1, 0, -1], [50, 55, 60, 58])
    >>> angle.tolist(), pressure.tolist()
    ([-2.0, -1.0, 0.0, 1.0], [50.0, 55.0, 60.0, 58.0])
    """
    angle, values = pair(angle_deg, pressure)
    order = np.argsort(-angle, kind="stable")
    return 0.0 - angle[order], values[order]


def pair(angle: ArrayLike, pressure: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two new float64 arrays, one-dimensional and equally long, or raise ShapeError."""
    first = np.array(angle, dtype=np.float64)
    second = np.array(pressure, dtype=np.float64)
    if first.ndim != 1 or first.shape != second.shape:
        raise ShapeError(
            f"crank angle has shape {first.shape} and pressure {second.shape}: "
            "give two one-dimensional arrays of one length"
        )
    return first, second


def aligned_angle(
    angle_deg: NDArray[np.float64], firing_tdc_deg: float
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the order that sorts a 0..720 record, and its angles in °CA aTDC (still unsorted)."""
    if not 0.0 <= firing_tdc_deg <= 720.0:
        raise DataError.of("firing_tdc_deg", firing_tdc_deg, "in [0, 720]")
    step = np.diff(angle_deg)
    if not np.all(step > 0.0):
        index = int(np.argmin(step > 0.0)) + 1
        raise DataError(f"angle_deg[{index}] = {angle_deg[index]:g} follows {angle_deg[index - 1]:g}: angles must rise")
    if angle_deg.size and angle_deg[-1] - angle_deg[0] > 720.0:
        span = angle_deg[-1] - angle_deg[0]
        raise DataError(f"angles span {span:g} degrees: one cycle of at most 720 degrees is needed")
    shifted = angle_deg - firing_tdc_deg
    wrapped = np.where(shifted > 360.0, shifted - 720.0, np.where(shifted < -360.0, shifted + 720.0, shifted))
    return np.argsort(wrapped, kind="stable"), wrapped
