"""Calls of the user's functions: columns where they take them, one column after the other where they do not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError, ShapeError

Rows = Callable[..., NDArray[np.float64]]
_TWO = 1e-3  # relative difference of the two columns of a check


def rows_of(function: Callable[..., Any], name: str, rows: int, *, vectorized: bool, timed: bool = False) -> Rows:
    """Return a function that gives (rows, m) for the m columns of its last argument; ShapeError says what it gave.

    A timed one has the time first, a number or (m,).
    """

    def whole(*given: Any) -> NDArray[np.float64]:
        return _rows(function(*given), name, rows, given[-1].shape[1])

    def one_by_one(*given: Any) -> NDArray[np.float64]:
        out = np.empty((rows, given[-1].shape[1]))
        of_columns = [np.ndim(each) > (1 if k or not timed else 0) for k, each in enumerate(given)]
        for i in range(out.shape[1]):
            own = (each[..., i] if several else each for each, several in zip(given, of_columns, strict=True))
            out[:, i] = _rows(function(*own), name, rows, 1)[:, 0]
        return out

    return whole if vectorized else one_by_one


def _rows(value: Any, name: str, rows: int, columns: int) -> NDArray[np.float64]:
    if isinstance(value, np.ndarray) and value.shape == (rows, columns):
        return value
    listed = isinstance(value, tuple | list) and len(value) == rows
    stacked = isinstance(value, np.ndarray) and rows > 1 and value.ndim == (1 if columns == 1 else 2)
    parts = value if listed or stacked else (value,)
    out, fits = np.empty((rows, columns)), len(parts) == rows
    for i, part in enumerate(parts if fits else ()):
        shape = part.shape if isinstance(part, np.ndarray) else np.shape(part)
        fits = fits and (shape == (columns,) or shape in ((), (1,)))
        if fits:
            out[i] = part
    if not fits:
        shapes = [np.shape(part) for part in parts]
        got = (len(parts), *shapes[0]) if len(set(shapes)) == 1 else shapes
        raise ShapeError(f"{name} returned shape {got}: must be ({rows}, {columns}), {rows} rows of {columns} columns")
    return out


def check_columns(function: Callable[..., Any], name: str, rows: int, given: Sequence[Any]) -> None:
    """Refuse a function that fails on two columns, or gives something else than on each alone.

    The last two-dimensional arguments are given with one column.
    """
    near = [np.hstack([a, a + _TWO * np.maximum(np.abs(a), _TWO)]) if np.ndim(a) == 2 else a for a in given]
    call = rows_of(function, name, rows, vectorized=True)
    remedy = "write it with x[0], p[1] and NumPy functions, or give the model vectorized=False"
    with np.errstate(all="ignore"):
        try:
            both = call(*near)
        except (ParameterError, ShapeError):
            raise
        except Exception as error:
            # Its own fault, where it fails on one column too; that error passes through.
            rows_of(function, name, rows, vectorized=False)(*given)
            raise ParameterError(f"{name} does not take columns ({type(error).__name__}: {error}): {remedy}") from error
        for i in (0, 1):
            alone = call(*(a[:, i : i + 1] if np.ndim(a) == 2 else a for a in near))
            if not np.allclose(both[:, i : i + 1], alone, rtol=1e-9, atol=0.0, equal_nan=True):
                raise ParameterError(f"{name} mixes its columns, each of which is a run of its own: {remedy}")
