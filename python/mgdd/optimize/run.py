"""Run a seeker on a Python function, and read one of any kind from its file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mgdd.errors import DataError, Interrupted, ParameterError
from mgdd.optimize.direct_seekers import GoldenSection, GradientDescent, Spsa
from mgdd.optimize.dither_seekers import BoundedSeeking, ExtremumSeeking, NewtonSeeking
from mgdd.optimize.seeker_record import read_seeker_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    import numpy as np
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["load_seeker", "maximize"]

AnySeeker = ExtremumSeeking | NewtonSeeking | BoundedSeeking | Spsa | GradientDescent | GoldenSection
_KINDS: dict[str, type[AnySeeker]] = {
    cls.kind: cls for cls in (ExtremumSeeking, NewtonSeeking, BoundedSeeking, Spsa, GradientDescent, GoldenSection)
}


def load_seeker(path: str | os.PathLike[str]) -> AnySeeker:
    """Read a seeker of any kind from the file that its ``save`` wrote.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    seeker
        Of the kind that the file names; it goes on bit for bit where it was saved, with an empty history.

    Raises
    ------
    DataError
        No file of a seeker, an unknown kind, or settings and state that do not fit.
    OSError
        The file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from mgdd.optimize import Spsa, load_seeker
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "spsa.json"
    ...     Spsa(start=3.0).save(file)
    ...     load_seeker(file)
    <Spsa cycle 0, estimate [3.]>
    """
    kind, _, _ = read_seeker_file(path)
    if kind not in _KINDS:
        raise DataError(f"{Path(path)}: holds a {kind!r}: must be one of {', '.join(_KINDS)}")
    return _KINDS[kind].load(path)


def maximize(
    fun: Callable[[NDArray[np.float64]], Any],
    seeker: AnySeeker,
    cycles: int,
) -> xr.Dataset:
    """Let a seeker run on a Python function for a number of cycles.

    Parameters
    ----------
    fun : callable
        ``fun(input) -> J`` with the input of shape (inputs,), or ``-> (J, limits)`` where the seeker keeps
        limits; None says that the cycle misfired. J is a number, or an array with one entry per component.
        Exceptions of `fun` pass through and leave the seeker as before that cycle.
    seeker : seeker
        Any of `mgdd.optimize`; one with ``maximize=False`` minimises.
    cycles : int
        Calls of `fun`, >= 0.

    Returns
    -------
    xarray.Dataset
        The seeker's `history`, earlier runs included.

    Raises
    ------
    ParameterError
        `cycles` is negative.
    DataError, ShapeError
        `fun` returned what the seeker refuses; the seeker is unchanged by that cycle.
    Interrupted
        Ctrl-C; ``partial`` is the history so far. The interrupted cycle is asked again when the run is continued.

    Examples
    --------
    >>> from mgdd.optimize import GradientDescent, maximize
    >>> history = maximize(lambda x: -0.02 * (x[0] - 3.0) ** 2, GradientDescent(start=0.0), 40)
    >>> round(float(history["estimate"][-1, 0]), 3)
    3.0
    """
    if cycles < 0:
        raise ParameterError(f"cycles = {cycles}: must be >= 0")
    try:
        for _ in range(cycles):
            answer = fun(seeker.ask())
            if answer is None:
                seeker.tell(math.nan, misfire=True)
            elif isinstance(answer, tuple):
                j, limits = answer
                seeker.tell(j, limits)
            else:
                seeker.tell(answer)
    except KeyboardInterrupt:
        done = f"interrupted after cycle {seeker.cycle}; the history is in .partial, and the seeker can go on from here"
        raise Interrupted(done, seeker.history) from None
    return seeker.history
