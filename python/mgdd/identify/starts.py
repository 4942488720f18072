"""Where the searches of one fit begin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mgdd import _core


def spread_starts(
    first: Mapping[str, float], box: Sequence[_core.optimize.Parameter], n_starts: int, seed: int
) -> list[dict[str, float]]:
    """Give the first start as it is, and further ones from a Latin hypercube between the bounds of the box."""
    further = _core.optimize.latin_hypercube(box, n_starts - 1, seed) if n_starts > 1 else []
    names = [parameter.name for parameter in box]
    return [dict(first), *({**first, **dict(zip(names, point.tolist(), strict=True))} for point in further)]
