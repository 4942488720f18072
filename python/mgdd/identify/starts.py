"""Where the searches of one fit begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mgdd import _core

__all__ = ["spread_starts"]


def spread_starts(
    first: Mapping[str, float], box: Sequence[_core.optimize.Parameter], n_starts: int, seed: int
) -> list[dict[str, float]]:
    """Give the first start as it is, and further ones from a Latin hypercube between the bounds of the box.

    Parameters
    ----------
    first : mapping of str to float
        Values by name; those outside the box stay.
    box : sequence of _core.optimize.Parameter
        Names, finite bounds and scales of what is spread.
    n_starts : int
        All starts, the first included.
    seed : int
        Of the hypercube.

    Returns
    -------
    list of dict of str to float
        In the order of `first`.

    Raises
    ------
    ParameterError
        Bounds that are not finite, where there is more than one start.

    Examples
    --------
    >>> from mgdd import _core
    >>> from mgdd.identify.starts import spread_starts
    >>> gain = _core.optimize.Parameter(name="gain", lower=0.0, upper=1.0)
    >>> [sorted(start) for start in spread_starts({"gain": 0.5, "time_s": 2.0}, [gain], 2, 0)]
    [['gain', 'time_s'], ['gain', 'time_s']]
    """
    further = _core.optimize.latin_hypercube(box, n_starts - 1, seed) if n_starts > 1 else []
    names = [parameter.name for parameter in box]
    return [dict(first), *({**first, **dict(zip(names, point.tolist(), strict=True))} for point in further)]
