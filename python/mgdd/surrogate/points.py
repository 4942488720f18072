"""Points of several factors: read from a table, scaled by their ranges, and the convex hull around them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, ParameterError
from mgdd.results.labels import Label, label_of, named_label
from mgdd.signals.model import columns_of

MOST_FACTORS = 6  # of a hull: its facets grow beyond all memory with more
EDGE = 1e-9  # of a range: a point so far outside of a boundary lies on it
_CHUNK = 1 << 22  # facets times points that are computed at once
_FLAT = 1e-9  # thickness of points, in their ranges, below which they have no hull


def column_names(table: Any, what: str) -> tuple[str, ...]:
    """Return the names of the columns of a Dataset, a DataFrame or a mapping."""
    names = getattr(table, "data_vars", table)
    if not (isinstance(table, Mapping) or hasattr(table, "columns") or hasattr(table, "data_vars")):
        raise ParameterError.of(what, table, "a Dataset, a DataFrame or a mapping of columns")
    return tuple(str(name) for name in names)


def points_of(table: Any, names: Sequence[str], *, what: str = "points") -> NDArray[np.float64]:
    """Return columns side by side, shape (n, m), finite; a single number counts for every row."""
    column_names(table, what)
    missing = [name for name in names if name not in table]
    if missing:
        raise DataError(f"{what} have no {missing[0]}: needed are {', '.join(names)}")
    given = {name: np.asarray(table[name]) for name in names}
    size = max((column.size for column in given.values() if column.ndim), default=1)
    full = {name: np.full(size, column) if column.ndim == 0 else column for name, column in given.items()}
    return np.column_stack(columns_of(full, names, what=what, least=1))


def column_label(table: Any, name: str) -> Label:
    """Return unit and name of a column: as a Dataset states, otherwise as the name does."""
    attributes = getattr(table[name], "attrs", {})
    return label_of(table[name]) if {"units", "long_name"} <= set(attributes) else named_label(name)


@dataclass(frozen=True, kw_only=True, eq=False)
class PointHull:
    """Convex hull of points, as half-spaces in the points' own ranges: normals of length 1 and offsets."""

    lower: NDArray[np.float64]
    span: NDArray[np.float64]
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]

    def depth(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return how far points lie inside the nearest facet, and which it is.

        The unit is the range of each factor. Negative outside: the distance from the plane of the facet that is
        violated most, which is at most the distance from the hull.
        """
        scaled = (points - self.lower) / self.span
        depth, facet = np.empty(len(scaled)), np.empty(len(scaled), dtype=np.intp)
        rows = max(1, _CHUNK // self.offsets.size)
        for start in range(0, len(scaled), rows):
            outward = scaled[start : start + rows] @ self.normals.T + self.offsets
            nearest = np.argmax(outward, axis=1)
            facet[start : start + rows] = nearest
            depth[start : start + rows] = -outward[np.arange(nearest.size), nearest]
        return depth, facet


def hull_of(points: NDArray[np.float64], names: Sequence[str]) -> PointHull:
    """Find the convex hull of points, shape (n, m)."""
    n, m = points.shape
    if m > MOST_FACTORS:
        raise DataError(f"{m} factors: the hull of measured points takes at most {MOST_FACTORS}; hold some constant")
    lower, span = points.min(axis=0), np.ptp(points, axis=0)
    if not np.all(span > 0.0):
        raise DataError(f"{names[int(np.argmin(span))]} does not vary in the points: leave it out")
    if m == 1:
        return PointHull(lower=lower, span=span, normals=np.array([[-1.0], [1.0]]), offsets=np.array([0.0, -1.0]))
    if n <= m:
        raise DataError(f"{n} points of {m} factors enclose nothing: at least {m + 1} are needed")
    from scipy.spatial import ConvexHull

    scaled = (points - lower) / span
    thickness = np.linalg.svd(scaled - scaled.mean(axis=0), compute_uv=False)[-1] / np.sqrt(n)
    if thickness < _FLAT:
        raise DataError(f"the points of {', '.join(names)} lie in a plane and enclose nothing: vary each on its own")
    equations = ConvexHull(scaled).equations
    equations = equations[np.unique(equations.round(9), axis=0, return_index=True)[1]]  # facets are cut into simplices
    return PointHull(lower=lower, span=span, normals=equations[:, :-1], offsets=equations[:, -1])
