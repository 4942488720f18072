"""What all figures share: colours, labels, new axes, and the one gate for what is drawn, a result or its Dataset."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mgdd._arguments import shown
from mgdd.errors import DataError, ParameterError
from mgdd.results.labels import check_labels, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mgdd.results.result import Result

# Okabe and Ito's palette: apart for colour-blind eyes, and of different lightness in print.
BLACK, BLUE, ORANGE, GREEN, GREY = "#000000", "#0072B2", "#D55E00", "#009E73", "#777777"
COLOURS = "cividis"  # of even lightness, for colour-blind eyes and for print
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


def new_figure(width: float, height: float) -> Figure:
    """Make a figure of that size [inch], which pyplot does not know."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def drawn(draw: Callable[..., Axes], data: xr.Dataset | Result, *, size: tuple[float, float], **how: Any) -> Figure:
    """Draw data on the only axes of a new figure of `size` inches, which pyplot does not know."""
    figure = new_figure(*size)
    draw(data, ax=figure.add_subplot(), **how)
    return figure


def divide(ax: Axes, heights: Sequence[float]) -> list[Axes]:
    """Divide axes into panels of these heights on one x axis, one above the other; `ax` becomes the uppermost."""
    spec, count = ax.get_subplotspec(), len(heights)
    if spec is not None:
        inner = spec.subgridspec(count, 1, height_ratios=heights, hspace=0.07)
        ax.set_subplotspec(inner[0])
        panels = [ax, *(ax.figure.add_subplot(inner[place], sharex=ax) for place in range(1, count))]
    else:
        left, bottom, width, height = ax.get_position().bounds
        scale, gap = height / sum(heights), 0.02 * height
        feet = [bottom + scale * sum(heights[place + 1 :]) + gap for place in range(count - 1)] + [bottom]
        boxes = [(left, foot, width, scale * size - gap) for foot, size in zip(feet, heights, strict=True)]
        ax.set_position(boxes[0])
        panels = [ax, *(ax.figure.add_axes(box, sharex=ax) for box in boxes[1:])]
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    return panels


def beside(ax: Axes, widths: Sequence[float]) -> list[Axes]:
    """Divide axes into panels of these widths side by side, of which `ax` becomes the first."""
    spec = ax.get_subplotspec()
    if spec is not None:
        inner = spec.subgridspec(1, len(widths), width_ratios=widths)
        ax.set_subplotspec(inner[0])
        return [ax, *(ax.figure.add_subplot(inner[place]) for place in range(1, len(widths)))]
    left, bottom, width, height = ax.get_position().bounds
    edges = [left + width * sum(widths[:place]) / sum(widths) for place in range(len(widths) + 1)]
    boxes = [(a, bottom, 0.85 * (b - a), height) for a, b in itertools.pairwise(edges)]
    ax.set_position(boxes[0])
    return [ax, *(ax.figure.add_axes(box) for box in boxes[1:])]


def residual_below(ax: Axes, data: xr.Dataset, x: str, residual: str) -> Axes:
    """Give the lower quarter of `ax` to a residual, model minus measured, over the whole of x; return its panel."""
    over, panel = data[x].to_numpy(), divide(ax, (3.0, 1.0))[1]
    panel.plot(over, data[residual], "-", color=BLACK, linewidth=0.8)
    panel.axhline(0.0, color=GREY, linewidth=0.8)
    panel.set(xlabel=axis_label(data, x), ylabel=minus(f"model -\nmeasured\n[{label_of(data[residual]).units}]"))
    ax.set_xlim(float(over[0]), float(over[-1]))
    return panel


def require(
    argument: str, given: xr.Dataset | Result, names: tuple[str, ...], made_by: str, optional: tuple[str, ...] = ()
) -> xr.Dataset:
    """Return the Dataset of what a figure is given, a result or the Dataset itself, with these variables and labels."""
    import xarray as xr

    dataset = given if isinstance(given, xr.Dataset) else getattr(given, "dataset", None)
    if not isinstance(dataset, xr.Dataset):
        bound = f"a Dataset or a result of mgdd, as {made_by} gives it"
        raise ParameterError(f"{argument} = {shown(given)}: must be {bound}", field=argument, value=given, bound=bound)
    for name in names:
        if name not in dataset.variables:
            have = ", ".join(map(str, dataset.variables)) or "nothing"
            raise DataError(f"{argument} has no variable {name!r}: {made_by} makes it; this one has {have}")
    check_labels(dataset[[*names, *(name for name in optional if name in dataset.variables)]])
    return dataset


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


def finished(
    ax: Axes, data: xr.Dataset, x: str, y: str, lines: Sequence[Artist], *, columns: int = 2, grid: bool = True
) -> Axes:
    """Label both axes by variables of the Dataset, add grid and legend, and return the axes."""
    ax.set(xlabel=axis_label(data, x), ylabel=axis_label(data, y))
    if grid:
        ax.grid(alpha=0.3)
    legend(ax, lines, columns=columns)
    return ax
