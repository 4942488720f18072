"""What smoothness of a map means: its second differences along the axes, as a matrix over its cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from mgdd.maps.calibration_map import CalibrationMap

_LEAST = 1e-4  # weight where cells are empty
_TWIST = 1e-3  # share of the mixed differences in the smoothness where cells are empty


def smoothness_of(optimum: CalibrationMap, weight: float, *, has_gaps: bool) -> Any:
    """Give the matrix whose quadratic form is the weighted sum of squared differences.

    What is empty needs some smoothness, and no twist: with second differences alone a plane is not all that is smooth.
    """
    bends = _bends(optimum)
    bent = bends.T @ bends
    if not has_gaps:
        return weight * bent
    twists = _twists(optimum)
    return max(weight, _LEAST) * (bent + _TWIST * (twists.T @ twists))


def _bends(optimum: CalibrationMap) -> Any:
    """Give the matrix of second differences along all axes, an axis counted in its mean steps."""
    from scipy import sparse

    index = np.arange(optimum.values.size).reshape(optimum.values.shape)
    parts = []
    for number, entries in enumerate(optimum.axes.values()):
        if entries.size < 3:
            continue
        step = np.diff(entries) / (entries[-1] - entries[0]) * (entries.size - 1)
        both = 0.5 * (step[:-1] + step[1:])
        coefficients = np.stack([1.0 / (step[:-1] * both), -2.0 / (step[:-1] * step[1:]), 1.0 / (step[1:] * both)])
        rows = np.moveaxis(index, number, 0)
        columns = np.stack([rows[:-2], rows[1:-1], rows[2:]]).reshape(3, -1)
        weights = np.repeat(coefficients, rows[0].size, axis=1)
        count = np.broadcast_to(np.arange(columns.shape[1]), columns.shape)
        shape = (columns.shape[1], index.size)
        parts.append(sparse.csc_matrix((weights.ravel(), (count.ravel(), columns.ravel())), shape=shape))
    return sparse.vstack(parts, format="csc") if parts else sparse.csc_matrix((0, index.size))


def _twists(optimum: CalibrationMap) -> Any:
    """Give the matrix of differences of differences, an axis counted in its mean steps."""
    from scipy import sparse

    index = np.arange(optimum.values.size).reshape(optimum.values.shape)
    if index.ndim < 2:
        return sparse.csc_matrix((0, index.size))
    first, second = (np.diff(x) / (x[-1] - x[0]) * (x.size - 1) for x in optimum.axes.values())
    columns = np.stack([index[1:, 1:], index[:-1, 1:], index[1:, :-1], index[:-1, :-1]]).reshape(4, -1)
    weights = np.outer([1.0, -1.0, -1.0, 1.0], 1.0 / np.outer(first, second).ravel())
    count = np.broadcast_to(np.arange(columns.shape[1]), columns.shape)
    shape = (columns.shape[1], index.size)
    return sparse.csc_matrix((weights.ravel(), (count.ravel(), columns.ravel())), shape=shape)
