"""Where the searches of one fit begin, and which of them ended best."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from mgdd import _core
from mgdd.results.fit import ARRIVED
from mgdd.results.fit_report import FitReport


def spread_starts(
    first: Mapping[str, float], box: Sequence[_core.optimize.Parameter], n_starts: int, seed: int
) -> list[dict[str, float]]:
    """Give the first start as it is, and further ones from a Latin hypercube between the bounds of the box."""
    further = _core.optimize.latin_hypercube(box, n_starts - 1, seed) if n_starts > 1 else []
    names = [parameter.name for parameter in box]
    return [dict(first), *({**first, **dict(zip(names, point.tolist(), strict=True))} for point in further)]


def rank(reports: Sequence[FitReport]) -> tuple[int, int]:
    """Give the number of the report with the lowest cost, and how many ended within 0.5 % of its error; as the core."""
    best = 0
    for number, report in enumerate(reports):
        if report.cost < reports[best].cost or not math.isfinite(reports[best].cost):
            best = number
    return best, sum(report.rmse <= ARRIVED * reports[best].rmse for report in reports)
