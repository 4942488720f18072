"""Every limit over a run: how far and how often it was exceeded, from the first cycle on and in the judged ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import VARIABLES

if TYPE_CHECKING:
    from numpy.typing import NDArray

NOISE_FREE = "noise_free_"
_OWN = "unit of the limit"
FIGURES = {
    "limit": (_OWN, "limit itself"),
    "worst": (_OWN, "largest reading"),
    "worst_cycle": ("cycle", "cycle of the largest reading, from the first of the run"),
    "above_cycles": ("-", "cycles above the limit itself, from the first on"),
    "above_fraction": ("-", "share of all cycles above the limit itself"),
    "judged_above_cycles": ("-", "cycles above the limit itself, from judged_from on"),
    "judged_above_fraction": ("-", "share of the cycles from judged_from on above the limit itself"),
    "exceed_above": (_OWN, "threshold of exceeded_fraction"),
}


def limit_figures(
    readings: NDArray[np.float64], names: Sequence[str], uppers: Sequence[float], judged_from: int, prefix: str = ""
) -> dict[str, float]:
    """Give the figures of every finite limit; a cycle counts where it has a reading, and is above where it is >."""
    out: dict[str, float] = {}
    for column, name, upper in zip(readings.T, names, uppers, strict=True):
        read = np.isfinite(column)
        if not math.isfinite(upper) or (prefix and not read.any()):
            continue
        above, judged = column > upper, np.arange(column.size) >= judged_from
        worst = int(np.argmax(np.where(read, column, -math.inf))) if read.any() else None
        own = {
            "limit": float(upper),
            "worst": math.nan if worst is None else float(column[worst]),
            "worst_cycle": math.nan if worst is None else float(worst),
            "above_cycles": float(above.sum()),
            "above_fraction": _share(above, read),
            "judged_above_cycles": float((above & judged).sum()),
            "judged_above_fraction": _share(above & judged, read & judged),
        }
        if prefix:
            del own["limit"]
        out |= {f"{prefix}{figure}_{name}": value for figure, value in own.items()}
    return out


def limit_label(key: str, names: Sequence[str]) -> tuple[str, str]:
    """Give unit and long name of a figure named FIGURE_LIMIT."""
    for name in names:
        figure = key.removesuffix(f"_{name}")
        if figure in FIGURES and figure != key:
            unit, text = FIGURES[figure]
            return (VARIABLES[name].units if unit == _OWN else unit), f"{name}: {text}"
    raise KeyError(key)


def with_a_limit(raw: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Leave out what the core says of a limited quantity without a limit."""
    free = {f"{figure}_{name}" for name in names if not np.isfinite(raw[f"limit_{name}"]).any() for figure in FIGURES}
    return {key: value for key, value in raw.items() if key not in free}


def noise_free_variable(table: NDArray[np.float64]) -> tuple[Any, ...]:
    """Label limited quantities at the applied inputs without scatter and noise."""
    return (("cycle", "limit"), table, _OWN, "noise-free value of a limited quantity at the applied inputs")


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(part.sum() / whole.sum()) if whole.any() else math.nan
