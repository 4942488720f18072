"""Any Dataset: the figure made for its variables, else its variables over their first dimension, else its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.cycles import pressure
from mgdd.plot.maps import map_cells
from mgdd.plot.seeking import seeking, sensors
from mgdd.plot.style import BLACK, axis_label, divide, minus, new_axes, require
from mgdd.plot.throttle import throttle_run
from mgdd.plot.timing import timing
from mgdd.results.describe import as_figure, rows_of
from mgdd.results.labels import ANGLE, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

# The first figure whose variables stand over these dimensions: those of `mgdd.plot` that need no choice.
_FIGURES = (
    (pressure, {"pressure_bar": {ANGLE}}),
    (pressure, {"pressure_bar": {ANGLE, "cycle"}}),
    (throttle_run, {"angle_deg": {"time_s"}, "duty": {"time_s"}}),
    (seeking, {"estimate": {"cycle", "input"}, "j": {"cycle"}}),
    (timing, {name: {"soc_cad"} for name in ("efficiency_gross", "nox_affine_log_ppm", "nox_arrhenius_ppm")}),
    (sensors, {"nox_true_ppm": {"cycle"}}),
)
_LEAST = 3  # samples of a curve: a vertex of the timing needs as many
_POINTS = 40  # that stay apart as points of a curve
_PANELS = 4  # that can be read below each other


def data(data: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw a Dataset by the figure that its variables have, or as curves, as cells, or as a table of its numbers."""
    data = require("data", data, (), "mgdd.engine.simulate")
    for draw, needed in _FIGURES:
        if all(name in data and set(data[name].dims) == dims for name, dims in needed.items()):
            over = data[next(iter(needed))]
            if draw in (pressure, throttle_run) or min(over.shape) >= _LEAST:
                return draw(data, ax=ax)
    numbers = [str(name) for name, variable in data.data_vars.items() if variable.dtype.kind in "fiu"]
    lines = [name for name in numbers if data[name].ndim == 1 and data[name].size > 1]
    if lines:
        return _curves(data, lines, ax)
    cells = [name for name in numbers if data[name].ndim == 2 and min(data[name].shape) > 1]
    if cells:
        return map_cells(data, cells[0], ax=ax)
    units = {name: label_of(data[name]).units for name in numbers}
    return as_figure("Dataset", rows_of({name: data[name].to_numpy().squeeze() for name in numbers}, units), ax)


def _curves(data: xr.Dataset, names: list[str], ax: Axes | None) -> Axes:
    """Draw the first variables over their dimension, each in a panel; what changes comes before what does not."""
    over = data[names[0]].dims[0]
    shown = [name for name in names if data[name].dims == (over,)]
    shown.sort(key=lambda name: not np.nanmax(data[name]) > np.nanmin(data[name]))
    shown = shown[:_PANELS]
    x = data[over].to_numpy()
    labelled = x.dtype.kind in "fiu"
    ax = new_axes(ax, height=1.2 + 1.3 * len(shown))
    panels = divide(ax, [1.0] * len(shown))
    for panel, name in zip(panels, shown, strict=True):
        panel.plot(
            x if labelled else [*map(str, x)], data[name], "-" if x.size > _POINTS else ".-", color=BLACK, linewidth=1.2
        )
        panel.set_ylabel(minus(f"{name}\n[{label_of(data[name]).units}]"), fontsize="small")
        panel.grid(alpha=0.3)
    panels[-1].set_xlabel(axis_label(data, str(over)))
    ax.figure.align_ylabels(panels)
    return ax
