"""Maps of an engine: contours over speed and load, and the cells of a calibration map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, COLOURS, GREY, ORANGE, axis_label, finished, legend, minus, new_axes, require
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

_MADE_BY = "mgdd.maps.optimize_map or mgdd.datasets.read"
# Beside a value in its cell; what is not named here needs no mark.
_MARKS = {
    "predicted": "p", "extrapolated": "e", "interpolated": "i", "held": "h", "learned": "l",
    "infeasible": "×", "unattainable": "×",
}  # fmt: skip


def map_contour(
    data: xr.Dataset | Result,
    variable: str,
    *,
    levels: int | Sequence[float] = 12,
    full_load: str | None = "full_load_nm",
    ax: Axes | None = None,
) -> Axes:
    """Draw contours over two operating axes, with the points behind them and the full-load line.

    Parameters
    ----------
    data : xarray.Dataset or Result
        `variable` over two axes; the first is drawn to the right. NaN is left white.
    variable : str
        What is drawn.
    levels : int or sequence of float
        Contour levels, or about how many between the lowest hundredth of the values and the highest tenth: specific
        figures grow without bound towards zero load.
    full_load : str, optional
        Variable over the first axis that is drawn as a line where the Dataset has it; None for none.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes; the colour bar is ``ax.figure.axes[-1]``.

    Raises
    ------
    mgdd.errors.DataError
        A variable is missing, has no unit or does not stand over two axes.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.plot import map_contour
    >>> from mgdd.results.labels import labelled_dataset
    >>> speed, torque = np.arange(1000.0, 4001.0, 500.0), np.arange(20.0, 201.0, 30.0)
    >>> data = labelled_dataset({
    ...     "speed_rpm": ("speed_rpm", speed, "rpm", "engine speed"),
    ...     "torque_nm": ("torque_nm", torque, "N m", "torque"),
    ...     "bsfc_g_per_kwh": (("speed_rpm", "torque_nm"), 210.0 + 2e-5 * (speed[:, None] - 2000.0)**2
    ...                        + 3e-3 * (torque - 160.0)**2, "g/kWh", "fuel consumption"),
    ... })
    >>> map_contour(data, "bsfc_g_per_kwh").get_xlabel()
    'engine speed [rpm]'
    """
    data = require("data", data, (), _MADE_BY)
    x, y = _two_axes(data, variable)
    line = full_load if full_load is not None and full_load in data else None
    require("data", data, (x, y, variable, *([line] if line else [])), _MADE_BY)
    ax = new_axes(ax, height=4.4)
    values = data[variable].transpose(y, x).to_numpy()
    lines: list[Artist] = []
    filled = ax.contourf(data[x], data[y], values, levels=_levels(values, levels), cmap=COLOURS, extend="both")
    drawn = ax.contour(data[x], data[y], values, levels=filled.levels, colors=BLACK, linewidths=0.6)
    ax.clabel(drawn, fmt="%g", fontsize="small")
    bar = ax.figure.colorbar(filled, ax=ax)
    bar.set_label(axis_label(data, variable))
    bar.minorticks_off()
    across, along = np.meshgrid(data[x].to_numpy(), data[y].to_numpy())
    finite = np.isfinite(values)
    lines += ax.plot(
        across[finite], along[finite], ".", color=BLACK, alpha=0.5, markersize=2, label=f"{finite.sum()} points"
    )
    if line is not None:
        lines += ax.plot(data[x], data[line], "-", color=ORANGE, linewidth=2.0, label=label_of(data[line]).long_name)
    return finished(ax, data, x, y, lines, grid=False)


def map_cells(data: xr.Dataset | Result, variable: str | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw the cells of a calibration map: value by colour and in print, support as the size of a dot.

    Parameters
    ----------
    data : xarray.Dataset or Result
        As `mgdd.maps.CalibrationMap.to_dataset` gives it, or any variable over one or two axes; a map over one axis is
        drawn as a line with its standard deviation and range.
    variable : str, optional
        What is drawn; the map itself, if left out.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes. Cells stand at their number, with their breakpoints as ticks. A letter shows where a value comes from:
        p predicted, e extrapolated, i interpolated, h held, l learned; a cross stands where there is none, and a frame
        where a limit holds it.

    Raises
    ------
    mgdd.errors.DataError
        A variable is missing or has no unit, or stands over no or three axes.

    Examples
    --------
    >>> from mgdd.plot import map_cells
    >>> from mgdd.results.labels import labelled_dataset
    >>> data = labelled_dataset({
    ...     "speed_rpm": ("speed_rpm", [900.0, 1500.0], "rpm", "engine speed"),
    ...     "fuel_mg": ("fuel_mg", [6.0, 20.0, 40.0], "mg", "fuel"),
    ...     "soc_cad": (("speed_rpm", "fuel_mg"), [[-1.0, -4.0, -7.0], [-2.0, -6.0, -9.0]]),
    ... })
    >>> map_cells(data, "soc_cad").get_ylabel()
    'fuel [mg]'
    """
    data = require("data", data, (), _MADE_BY)
    variable_name = str(data.attrs.get("map", "")) if variable is None else variable
    if variable_name in data and data[variable_name].ndim == 1:
        return _curve(data, variable_name, new_axes(ax))
    x, y = _two_axes(data, variable_name)
    require("data", data, (x, y, variable_name), _MADE_BY)
    ax = new_axes(ax, height=4.6)
    values = data[variable_name].transpose(x, y).to_numpy()
    widest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    how: dict[str, Any] = {"cmap": COLOURS}
    if variable_name == "difference":  # of two maps: zero in the middle
        how = {"cmap": "PuOr", "vmin": -widest, "vmax": widest}
    image = ax.imshow(values.T, origin="lower", aspect="auto", **how)
    ax.figure.colorbar(image, ax=ax).set_label(axis_label(data, variable_name))
    for axis, name, set_ticks in ((ax.xaxis, x, ax.set_xticks), (ax.yaxis, y, ax.set_yticks)):
        entries = data[name].to_numpy()
        set_ticks(range(entries.size), [f"{entry:g}" for entry in entries], fontsize="small")
        axis.set_tick_params(length=0)
    if values.shape[0] > 8:
        ax.tick_params(axis="x", labelrotation=90)
    lines = _cell_marks(ax, data, values, (x, y))
    ax.set(xlabel=axis_label(data, x), ylabel=axis_label(data, y))
    if lines:
        legend(ax, lines)
    return ax


def _levels(values: Any, levels: int | Sequence[float]) -> Any:
    from matplotlib.ticker import MaxNLocator

    finite = values[np.isfinite(values)]
    if not isinstance(levels, int) or not finite.size:
        return levels
    low, high = np.quantile(finite, [0.01, 0.9])
    return MaxNLocator(levels).tick_values(float(low), float(high))


def _two_axes(data: xr.Dataset, variable: str) -> tuple[str, str]:
    if variable not in data or data[variable].ndim != 2:
        have = ", ".join(str(name) for name in data.data_vars if data[name].ndim == 2) or "none"
        raise DataError(f"no variable {variable!r} over two axes: the Dataset has {have}")
    first, second = data[variable].dims
    return str(first), str(second)


def _curve(data: xr.Dataset, variable: str, ax: Axes) -> Axes:
    """Draw a map over one axis."""
    (x,) = map(str, data[variable].dims)
    require("data", data, (x, variable), _MADE_BY)
    lines: list[Artist] = []
    values = data[variable].to_numpy()
    if {"low", "high"} <= set(data.data_vars) and np.isfinite(data["low"]).any():
        lines.append(ax.fill_between(data[x], data["low"], data["high"], color=GREY, alpha=0.25, label="allowed range"))
    if "sd" in data and np.isfinite(data["sd"]).any():
        bars: Any = ax.errorbar(
            data[x], values, data["sd"], fmt="none", ecolor=BLUE, capsize=3, label="standard deviation"
        )
        lines.append(bars)
    lines += ax.plot(data[x], values, "o-", color=BLACK, markersize=4, label=label_of(data[variable]).long_name)
    return finished(ax, data, x, variable, lines, columns=3)


def _cell_marks(ax: Axes, data: xr.Dataset, values: Any, axes: tuple[str, str]) -> list[Artist]:
    """Write the value of each cell, its mark and support; give what belongs into the legend."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    def column(name: str, absent: Any) -> Any:
        there = name in data and set(data[name].dims) == set(axes)
        return data[name].transpose(*axes).to_numpy() if there else np.full(values.shape, absent)

    source, held, support = column("source", ""), column("active_limit", ""), column("support", 0.0)
    if "beyond" in data:
        held = np.where(column("beyond", False), "the tolerance", "")
    middle = 0.5 * (np.nanmin(values) + np.nanmax(values)) if np.isfinite(values).any() else 0.0
    size = "small" if values.size <= 64 else "x-small" if values.size <= 150 else None
    most, same = float(np.nanmax(support)), bool((support == support.flat[0]).all())
    dark = values < middle
    if "beyond" in data:  # a difference is pale in its middle
        dark = np.abs(values) > 0.6 * np.nanmax(np.abs(values))
    frame = BLACK if "beyond" in data else ORANGE
    lines: list[Artist] = []
    widest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    for i, j in np.ndindex(*values.shape):
        color = "white" if dark[i, j] else BLACK
        mark = _MARKS.get(str(source[i, j]), "")
        value = 0.0 if np.abs(values[i, j]) < 1e-4 * widest else values[i, j]  # what the solver left of a zero
        number = f"{value:.3g}" if np.isfinite(value) and size else ""
        text = minus(number) + (f" {mark}" if mark else "")
        if text:
            ax.text(i, j, text, ha="center", va="center", fontsize=size or "x-small", color=color)
        if not same and support[i, j] > 0.0:
            ax.plot(i, j - 0.33, "o", color=color, markersize=1.0 + 3.5 * np.sqrt(support[i, j] / most))
        if str(held[i, j]):
            width = 1.4 if size else 0.8
            ax.add_patch(Rectangle((i - 0.46, j - 0.46), 0.92, 0.92, fill=False, edgecolor=frame, linewidth=width))
    if most > 0.0:
        label, dot = (f"support {most:g} everywhere", "") if same else (f"support, at most {most:g}", "o")
        lines.append(Line2D([], [], marker=dot, color=BLACK, linestyle="none", markersize=4.5, label=label))
    frame_label = "beyond" if "beyond" in data else "held by"
    limits = sorted({str(text) for text in held.ravel() if str(text)})
    if limits:
        lines.append(Rectangle((0, 0), 1, 1, fill=False, edgecolor=frame, label=f"{frame_label} {', '.join(limits)}"))
    used = sorted({str(text) for text in source.ravel() if str(text) in _MARKS})
    lines += [Line2D([], [], marker=f"${_MARKS[name]}$", color=BLACK, linestyle="none", label=name) for name in used]
    return lines
