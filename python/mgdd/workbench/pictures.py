"""Figures that a mouse can move in, from Datasets as the library labels them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.io.extras import import_extra
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr

# Distinct to the colour-blind, too, on white and on black.
COLOURS = ("#1f83c9", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
GREY = "#8a8f98"
_HEIGHT = 320  # pixels


def bokeh(module: str) -> Any:
    """Import a module of Bokeh."""
    return import_extra(f"bokeh.{module}", "workbench", "the workbench")


def axis_text(variable: xr.DataArray, name: str = "") -> str:
    """Write the label of an axis: long name and unit."""
    label = label_of(variable)
    return f"{label.long_name or name} [{label.units}]"


def canvas(x: str, y: str, *, log: bool = False, **options: Any) -> Any:
    """Make an empty figure with cursor, zoom and a button that saves it."""
    kind = "log" if log else "linear"
    figure = bokeh("plotting").figure(
        x_axis_label=x, y_axis_label=y, x_axis_type=kind, y_axis_type=kind, height=_HEIGHT, min_width=280,
        sizing_mode="stretch_width", tools="pan,box_zoom,xwheel_zoom,reset,save,crosshair", output_backend="canvas",
        **options,
    )  # fmt: skip
    return _dressed(figure)


def _dressed(figure: Any) -> Any:
    figure.toolbar.logo = None
    for axis in figure.axis:
        axis.update(axis_label_text_font_size="12px", major_label_text_font_size="11px")
    return figure


def side_by_side(*figures: Any) -> Any:
    """Set figures side by side, as many as fit."""
    pane, flex = import_extra("panel", "workbench", "the workbench"), {"flex": "1 1 460px", "min-width": "280px"}
    return pane.FlexBox(
        *(pane.Column(pane.pane.Bokeh(each, sizing_mode="stretch_width"), styles=flex) for each in figures),
        sizing_mode="stretch_width", gap="4px",
    )  # fmt: skip


def line(figure: Any, x: Any, y: Any, label: str, colour: str, *, dash: str = "solid", points: bool = False) -> Any:
    """Draw a line, or points, whose values stand beside the cursor; give its source."""
    source = bokeh("models").ColumnDataSource({"x": np.asarray(x), "y": np.asarray(y)})
    draw = figure.scatter if points else figure.line
    how: dict[str, Any] = {"size": 6} if points else {"line_width": 1.8, "line_dash": dash}
    drawn = draw("x", "y", source=source, color=colour, **({"legend_label": label} if label else {}), **how)
    tips = [("", label)] if label else []
    figure.add_tools(
        bokeh("models").HoverTool(
            renderers=[drawn], tooltips=[*tips, ("x", "@x{0.[0000]}"), ("y", "@y{0.[0000]}")], mode="mouse"
        )
    )
    return source


def mark(figure: Any, along: str, at: float) -> None:
    """Mark a value by a dashed line over the whole ``height`` or ``width``."""
    figure.add_layout(bokeh("models").Span(location=at, dimension=along, line_dash="dashed", line_color="#c62828"))


def with_legend(figure: Any) -> Any:
    """Put the legend above the axes, where it hides nothing."""
    if figure.legend:
        legend = figure.legend[0]
        legend.update(
            orientation="horizontal", ncols=3, click_policy="hide", label_text_font_size="12px", padding=2, margin=0,
            border_line_color=None, background_fill_alpha=0.0,
        )  # fmt: skip
        figure.add_layout(legend, "above")
    return figure


def traces(datasets: Mapping[str, xr.Dataset], name: str, *, over: str = "crank_angle_cad", log: bool = False) -> Any:
    """Draw a variable of one record or several over another; of many cycles the cloud, and their mean."""
    first = next(iter(datasets.values()))
    figure = canvas(axis_text(first[over], over), axis_text(first[name], name), log=log)
    alone = len(datasets) == 1
    for colour, (label, data) in zip(COLOURS * len(datasets), datasets.items(), strict=False):
        mean = data
        if "cycle" in data[name].dims:
            x, y = np.asarray(data[over].broadcast_like(data[name])), np.asarray(data[name])
            x = x if x.shape == y.shape else x.T
            figure.multi_line([*x], [*y], line_color=GREY if alone else colour, line_alpha=0.25, line_width=0.8)
            mean = data.mean("cycle", keep_attrs=True)
        line(figure, mean[over], mean[name], _short(label), colour)
    return with_legend(figure)


def by_cycle(datasets: Mapping[str, xr.Dataset], name: str) -> Any:
    """Draw a figure from cycle to cycle."""
    first = next(iter(datasets.values()))
    figure = canvas("cycle [-]", axis_text(first[name], name))
    for colour, (label, data) in zip(COLOURS * len(datasets), datasets.items(), strict=False):
        line(figure, data["cycle"], data[name], _short(label), colour, points=True)
    return with_legend(figure)


def cells(table: xr.DataArray) -> Any:
    """Draw a map of one axis as a line, of two as coloured cells with their values."""
    axes = [str(dim) for dim in table.dims]
    models, own = bokeh("models"), axis_text(table, str(table.name))
    if len(axes) == 1:
        figure = canvas(axis_text(table[axes[0]], axes[0]), own)
        line(figure, table[axes[0]], table, "", COLOURS[0])
        return figure
    down, across = axes
    names = [[f"{value:g}" for value in np.asarray(table[axis])] for axis in axes]
    figure = bokeh("plotting").figure(
        x_range=names[1], y_range=names[0], x_axis_label=axis_text(table[across], across),
        y_axis_label=axis_text(table[down], down), height=_HEIGHT, min_width=280, sizing_mode="stretch_width",
        tools="save", title=own,
    )  # fmt: skip
    values = np.asarray(table, np.float64)
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    dark = values < np.median(finite) if finite.size else values > 0.0  # where the palette is
    flat = [
        (names[1][column], names[0][row], values[row, column], "white" if dark[row, column] else "black")
        for row in range(values.shape[0])
        for column in range(values.shape[1])
    ]
    x, y, z, ink = zip(*flat, strict=True)
    mapper = models.LinearColorMapper(palette="Viridis256", low=low, high=high if high > low else low + 1.0)
    source = models.ColumnDataSource({"x": x, "y": y, "z": z, "ink": ink, "text": [f"{value:.4g}" for value in z]})
    figure.rect("x", "y", 1, 1, source=source, fill_color={"field": "z", "transform": mapper}, line_color=None)
    figure.text("x", "y", text="text", source=source, text_align="center", text_baseline="middle",
                text_color="ink", text_font_size="12px")  # fmt: skip
    figure.add_layout(models.ColorBar(color_mapper=mapper, width=10), "right")
    return _dressed(figure)


def _short(label: str, longest: int = 34) -> str:
    """Cut a name, and keep it from being taken for mathematics, as Bokeh does between dollars."""
    cut = label if len(label) <= longest else f"{label[: longest - 1]}…"
    return cut.replace("$$", "$ $").replace("\\[", "\\ [").replace("\\(", "\\ (")


def runs(data: xr.Dataset, names: Sequence[str], over: str = "time_s") -> Any:
    """Draw variables of one unit over time."""
    figure = canvas(axis_text(data[over], over), axis_text(data[names[0]], names[0]))
    for colour, name in zip(COLOURS, names, strict=False):
        line(figure, data[over], data[name], label_of(data[name]).long_name or name, colour)
    return with_legend(figure)
