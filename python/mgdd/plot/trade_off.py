"""The trade-off of two outputs along a swept input."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.plot.style import BLACK, BLUE, LINE_STYLES, finished, minus, new_axes, require
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

_MARKERS = "osv^DPX"  # more than there are colours: a sixth line is not the first again


def trade_off(
    sweep: xr.Dataset | Result,
    x: str,
    y: str,
    *,
    over: str = "soc_cad",
    every: int = 4,
    marked: xr.Dataset | Result | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw two outputs against each other along a swept input, with labels of the input: the price of one in the other.

    Parameters
    ----------
    sweep : xarray.Dataset or Result
        Both variables over `over`, and over one more axis for several lines.
    x, y : str
        To the right and upwards, for example ``nox_affine_log_ppm`` and ``efficiency_gross``.
    over : str
        The swept input.
    every : int
        Every how many points are labelled with the input, >= 1.
    marked : xarray.Dataset, optional
        `x`, `y` and `over` at chosen points, one per line, as `mgdd.maps.apply_map` gives them; drawn as stars.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    mgdd.errors.DataError
        A variable is missing, has no unit, or stands over other axes.
    mgdd.errors.ParameterError
        `every` is not >= 1.

    Examples
    --------
    >>> from mgdd.engine import Cylinder, OperatingPoint, timing_sweep
    >>> from mgdd.plot import trade_off
    >>> sweep = timing_sweep(Cylinder(), OperatingPoint(), soc_cad=range(-16, 9))
    >>> trade_off(sweep, "p_max_bar", "efficiency_gross").get_xlabel()
    'maximum pressure [bar]'
    """
    ParameterError.unless(every >= 1, "every", every, ">= 1")
    sweep = require("sweep", sweep, (over, x, y), "mgdd.engine.timing_sweep")
    others = [str(dim) for dim in sweep[y].dims if dim != over]
    if over not in sweep[y].dims or len(others) > 1 or set(sweep[x].dims) != set(sweep[y].dims):
        raise DataError(f"{x} and {y}: must stand over {over} and at most one more axis, the same for both")
    ax = new_axes(ax, height=4.4)
    right = sweep[x].transpose(*others, over).to_numpy().reshape(-1, sweep.sizes[over])
    up = sweep[y].transpose(*others, over).to_numpy().reshape(-1, sweep.sizes[over])
    lines: list[Artist] = []
    for index, (own_x, own_y) in enumerate(zip(right, up, strict=True)):
        dash, color = LINE_STYLES[index % len(LINE_STYLES)]
        name = f"{over} swept"
        if others:
            label = label_of(sweep[others[0]])
            name = f"{label.long_name} {sweep[others[0]].to_numpy()[index]:g} {label.units}"
        lines += ax.plot(
            own_x, own_y, linestyle=dash, color=color, marker=_MARKERS[index % len(_MARKERS)], markersize=4,
            markevery=every, label=minus(name), fillstyle="full" if index < len(LINE_STYLES) else "none",
        )  # fmt: skip
        for place in range(0, own_x.size, every):
            if np.isfinite(own_x[place]) and np.isfinite(own_y[place]):
                ax.annotate(
                    minus(f"{sweep[over].to_numpy()[place]:g}"), (own_x[place], own_y[place]), xytext=(4, 3),
                    textcoords="offset points", fontsize="x-small", color=color,
                )  # fmt: skip
    if marked is not None:
        marked = require("marked", marked, (x, y), "mgdd.maps.apply_map")
        stars = ax.plot(
            marked[x].to_numpy().ravel(), marked[y].to_numpy().ravel(), "*", color=BLUE, markersize=11,
            markeredgecolor=BLACK, linestyle="none", label="chosen",
        )  # fmt: skip
        lines += stars
    ax.margins(0.08)
    unit = label_of(sweep[over])
    ax.text(
        0.99, 0.02, f"labels: {unit.long_name} [{unit.units}]", transform=ax.transAxes, ha="right", fontsize="small"
    )
    return finished(ax, sweep, x, y, lines, columns=3)
