"""Crank angles in other conventions, turned to °CA aTDC (firing TDC = 0, compression negative)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["CONVENTION", "pair", "turned"]

CONVENTION = "crank angle is in °CA aTDC: firing TDC = 0, compression negative"


def pair(angle: ArrayLike, pressure: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return new float64 arrays: the angle, and the pressure over it or (cycle, angle); or raise ShapeError."""
    first = np.array(angle, dtype=np.float64)
    second = np.array(pressure, dtype=np.float64)
    if (
        first.ndim != 1
        or second.ndim not in (1, 2)
        or second.shape[-1:] != first.shape
        or second.shape[0] == 0 < first.size
    ):
        remedy = "give two one-dimensional arrays of one length, or one row of pressures per cycle"
        if second.ndim == 2 and second.shape[:1] == first.shape:
            remedy = "one row per cycle is needed: pass the transpose"
        raise ShapeError(f"crank angle has shape {first.shape} and pressure {second.shape}: {remedy}")
    return first, second


def turned(
    angle_deg: NDArray[np.float64], firing_tdc_deg: float | None, before_tdc: bool
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the order that sorts angles of a 0..720 record, or before TDC, and the sorted angles in °CA aTDC."""
    if firing_tdc_deg is None:
        order = np.argsort(-angle_deg, kind="stable") if before_tdc else np.arange(angle_deg.size)
        return order, 0.0 - angle_deg[order] if before_tdc else angle_deg
    if before_tdc:
        raise DataError("firing_tdc_deg, before_tdc: angles are in one convention: give one of them")
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
    order = np.argsort(wrapped, kind="stable")
    return order, wrapped[order]
