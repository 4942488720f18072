"""What all figures share: colours, labels, new axes, and the refusal of a Dataset that lacks a variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.errors import DataError
from mgdd.results.labels import check_labels, label_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

__all__ = [
    "BLACK",
    "BLUE",
    "GREEN",
    "GREY",
    "LINE_STYLES",
    "ORANGE",
    "axis_label",
    "legend",
    "minus",
    "new_axes",
    "panel_below",
    "require",
]

# Okabe and Ito's palette: apart for colour-blind eyes, and of different lightness in print.
BLACK, BLUE, ORANGE, GREEN, GREY = "#000000", "#0072B2", "#D55E00", "#009E73", "#777777"
LINE_STYLES: tuple[tuple[str, str], ...] = (
    ("-", BLACK),
    ("--", BLUE),
    ("-.", ORANGE),
    (":", GREEN),
    ((0, (6, 1, 1, 1, 1, 1)), GREY),  # type: ignore[assignment]
)


def new_axes(ax: Axes | None, *, height: float = 3.8) -> Axes:
    """Return `ax`, or the axes of a new figure of `height` inches."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(6.6, height), layout="constrained")[1]


def panel_below(ax: Axes, *, share: float = 0.25) -> Axes:
    """Give the lower `share` of `ax` to new axes with the same x axis, and return them."""
    spec = ax.get_subplotspec()
    if spec is not None:
        inner = spec.subgridspec(2, 1, height_ratios=(1.0 - share, share), hspace=0.06)
        ax.set_subplotspec(inner[0])
        return ax.figure.add_subplot(inner[1], sharex=ax)
    left, bottom, width, height = ax.get_position().bounds
    ax.set_position((left, bottom + (share + 0.02) * height, width, (0.98 - share) * height))
    return ax.figure.add_axes((left, bottom, width, (share - 0.01) * height), sharex=ax)


def require(dataset: xr.Dataset, names: tuple[str, ...], made_by: str) -> None:
    """Refuse a Dataset without these variables (naming the function that makes them) or without labels."""
    for name in names:
        if name not in dataset.variables:
            have = ", ".join(map(str, dataset.variables)) or "nothing"
            raise DataError(f"dataset has no variable {name!r}: {made_by} makes it; this one has {have}")
    check_labels(dataset[list(names)])


def axis_label(dataset: xr.Dataset, name: str) -> str:
    """Return "long name [units]" of a variable."""
    label = label_of(dataset[name])
    return f"{label.long_name} [{label.units}]"


def minus(text: str) -> str:
    """Write minus signs as the tick labels do."""
    return text.replace("-", "−")


def legend(ax: Axes, lines: Sequence[Artist], *, columns: int = 2) -> None:
    """Put one legend for all `lines`, also those of twin axes, above the axes where it hides no data."""
    ax.legend(
        handles=list(lines),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.01, 1.0, 0.1),
        mode="expand",
        ncols=min(columns, len(lines)),
        frameon=False,
        borderaxespad=0.0,
        fontsize="small",
    )
