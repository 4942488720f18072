"""Figures that a mouse can move in, from Datasets as the library labels them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.io.extras import import_extra
from mgdd.results.labels import label_of
from mgdd.rig.live.figures import COLOURS, plain, with_legend

if TYPE_CHECKING:
    import xarray as xr

GREY = "#8a8f98"
_HEIGHT = 320  # pixels
_TICKS = 5  # or their numbers run into each other on a telephone


def bokeh(module: str) -> Any:
    """Import a module of Bokeh."""
    return import_extra(f"bokeh.{module}", "workbench", "the workbench")


def axis_text(variable: xr.DataArray, name: str = "") -> str:
    """Write the label of an axis: long name and unit."""
    label = label_of(variable)
    return f"{label.long_name or name} [{label.units}]"


def canvas(x: str, y: str, *, log: str = "", **options: Any) -> Any:
    """Make an empty figure with cursor, zoom and a button that saves it; `log` names the logarithmic axes."""
    kinds = {f"{axis}_axis_type": "log" if axis in log else "linear" for axis in "xy"}
    figure = bokeh("plotting").figure(
        x_axis_label=x, y_axis_label=y, **kinds, height=_HEIGHT, min_width=280,
        sizing_mode="stretch_width", tools="pan,box_zoom,xwheel_zoom,reset,save,crosshair", output_backend="canvas",
        **options,
    )  # fmt: skip
    return _dressed(figure)


def _dressed(figure: Any) -> Any:
    figure.toolbar.logo = None
    for axis in figure.axis:
        axis.update(axis_label_text_font_size="12px", major_label_text_font_size="11px")
        if hasattr(axis.ticker, "desired_num_ticks"):
            axis.ticker.desired_num_ticks = _TICKS
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


def mark(figure: Any, along: str, at: float, colour: str = "#c62828") -> None:
    """Mark a value by a dashed line over the whole ``height`` or ``width``."""
    figure.add_layout(bokeh("models").Span(location=at, dimension=along, line_dash="dashed", line_color=colour))


def traces(datasets: Mapping[str, xr.Dataset], name: str, *, over: str = "crank_angle_cad", log: str = "") -> Any:
    """Draw a variable of one record or several over another; of many cycles the cloud, and their mean."""
    first = next(iter(datasets.values()))
    along = "cycle [-]" if over == "cycle" else axis_text(first[over], over)
    figure = canvas(along, axis_text(first[name], name), log=log)
    alone = len(datasets) == 1
    for colour, (label, data) in zip(COLOURS * len(datasets), datasets.items(), strict=False):
        mean = data
        if "cycle" in data[name].dims and over != "cycle":
            x, y = np.asarray(data[over].broadcast_like(data[name])), np.asarray(data[name])
            x = x if x.shape == y.shape else x.T
            figure.multi_line([*x], [*y], line_color=GREY if alone else colour, line_alpha=0.25, line_width=0.8)
            mean = data.mean("cycle", keep_attrs=True)
        line(figure, mean[over], mean[name], plain(label), colour, points=over == "cycle")
    return with_legend(figure)


def spectrum(datasets: Mapping[str, xr.Dataset]) -> Any:
    """Draw the spectra of the cycles with the knock band, the frequency of ringing and the first tangential mode."""
    name = "pressure_psd_bar2_per_khz"
    figure = traces(datasets, name, over="frequency_khz", log="y")
    first = next(iter(datasets.values()))
    ends = [float(first[name].min()), float(first[name].max())]
    figure.yaxis.axis_label = f"power density [{label_of(first[name]).units}]"
    figure.height = _HEIGHT + 40  # two more lines of the legend
    for edge in first.attrs.get("knock_band_hz", ()):
        mark(figure, "height", 1e-3 * edge, GREY)
    for mode, colour in (("tangential_mode_khz", COLOURS[1]), ("ringing_frequency_khz", COLOURS[2])):
        if mode in first and np.isfinite(first[mode]):
            at = float(first[mode])
            line(figure, [at, at], ends, f"{label_of(first[mode]).long_name}: {at:.2f} kHz", colour, dash="dashed")
    return with_legend(figure, columns=1)


def cycle_map(data: xr.Dataset, name: str) -> Any:
    """Draw a trace of every cycle as a row of colours, where it burns; of pressure what differs from the mean."""
    shown = data.sel(crank_angle_cad=slice(-40.0, 100.0)) if data["crank_angle_cad"].size > 1 else data
    rows, angle = shown[name].transpose("cycle", "crank_angle_cad"), shown["crank_angle_cad"]
    label = label_of(rows)
    less = rows.mean("cycle") if name == "pressure_bar" else 0.0
    values = np.asarray(rows - less, np.float32)
    low, high = (float(each) for each in np.nanpercentile(values, (0.5, 99.5)))
    if name == "pressure_bar":
        high = max(high, -low)
        low = -high
    title = f"{label.long_name}{' less its mean' if name == 'pressure_bar' else ''} [{label.units}]"
    cycle = np.asarray(data["cycle"])
    figure = canvas(axis_text(angle, "crank_angle_cad"), "cycle [-]", title=title)
    mapper = bokeh("models").LinearColorMapper(palette="Viridis256", low=low, high=max(high, low + 1e-9))
    x, wide = float(angle[0]), float(angle[-1] - angle[0])
    drawn = figure.image([values], x, float(cycle[0]) - 0.5, wide, float(cycle[-1] - cycle[0]) + 1.0,
                         color_mapper=mapper)  # fmt: skip
    tips = [("angle", "$x{0.0}"), ("cycle", "$y{0}"), ("value", "@image{0.000}")]
    figure.add_tools(bokeh("models").HoverTool(renderers=[drawn], tooltips=tips))
    figure.add_layout(bokeh("models").ColorBar(color_mapper=mapper, width=10), "right")
    return figure


def cells(table: xr.DataArray, title: str = "") -> Any:
    """Draw a map of one axis as a line, of two as coloured cells with their values."""
    axes = [str(dim) for dim in table.dims]
    models, own = bokeh("models"), axis_text(table, str(table.name))
    own = f"{title}: {own}" if title else own
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
    figure.title.text_font_size = "11px"  # it fits a telephone
    return _dressed(figure)


def runs(data: xr.Dataset, names: Sequence[str], over: str = "time_s") -> Any:
    """Draw variables of one unit over time."""
    figure = canvas(axis_text(data[over], over), axis_text(data[names[0]], names[0]))
    for colour, name in zip(COLOURS, names, strict=False):
        line(figure, data[over], data[name], label_of(data[name]).long_name or name, colour)
    return with_legend(figure)
