"""Outputs over a swept timing, and the trade-off of two of them along any swept input."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.plot.style import (
    BLACK,
    BLUE,
    GREY,
    LINE_STYLES,
    ORANGE,
    axis_label,
    divide,
    finished,
    legend,
    minus,
    new_axes,
    require,
)
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

    from mgdd.results.result import Result

_NOX = {"nox_affine_log_ppm": ("--", BLUE), "nox_arrhenius_ppm": ("-.", ORANGE)}


def timing(sweep: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw efficiency and both NOx proxy maps over timing, with the best timing marked.

    Parameters
    ----------
    sweep : xarray.Dataset or Result
        ``efficiency_gross`` [-], ``nox_affine_log_ppm`` and ``nox_arrhenius_ppm`` [ppm] over ``soc_cad``
        [°CA aTDC], as `mgdd.engine.timing_sweep` gives. NOx goes to a twin axis.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The efficiency axes. The mark is the vertex of the parabola through the highest sample and its
        neighbours, or that sample itself where it ends the sweep; the legend then states so.

    Raises
    ------
    DataError
        A variable is missing or has no unit, fewer than three timings.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.engine import Cylinder, OperatingPoint, timing_sweep
    >>> plot.timing(timing_sweep(Cylinder(), OperatingPoint(), soc_cad=[-10.0, -6.0, 0.0])).get_xlabel()
    'start of combustion [°CA aTDC]'
    """
    sweep = require("sweep", sweep, ("soc_cad", "efficiency_gross", *_NOX), "mgdd.engine.timing_sweep")
    soc, efficiency = sweep["soc_cad"].to_numpy(), sweep["efficiency_gross"].to_numpy()
    if soc.ndim != 1 or soc.size < 3:
        raise DataError(f"soc_cad has shape {soc.shape}: at least three timings are needed")
    ax = new_axes(ax)
    lines: list[Line2D] = ax.plot(
        soc, efficiency, "-", color=BLACK, label=label_of(sweep["efficiency_gross"]).long_name
    )
    best, top, at_end = _vertex(soc, efficiency)
    where = "best at the end of the sweep" if at_end else "best"
    lines += ax.plot(
        best, top, "o", color=BLACK, markersize=6, label=minus(f"{where}: {top:.4f} at {best:.1f} °CA aTDC")
    )
    ax.axvline(best, color=BLACK, linewidth=0.8, linestyle=":")
    twin = ax.twinx()
    for name, (dash, color) in _NOX.items():
        label = label_of(sweep[name]).long_name
        lines += twin.plot(soc, sweep[name], linestyle=dash, color=color, label=label)
    twin.set_ylabel("NOx proxy [ppm]")
    twin.set_ylim(bottom=0.0)
    return finished(ax, sweep, "soc_cad", "efficiency_gross", lines, grid=False)


def scanned(
    scan: xr.Dataset, objective: str, best: float, value: float, caps: Mapping[str, float], *, ax: Axes | None = None
) -> Axes:
    """Draw an objective over the only input, with its optimum, and each limited quantity with its limit below."""
    over = str(scan[objective].dims[0])
    x, feasible = scan[over].to_numpy(), np.ones(scan.sizes[over], bool)
    for name, cap in caps.items():
        feasible &= scan[name].to_numpy() <= cap
    ax = new_axes(ax, height=3.0 + 1.5 * len(caps))
    panels = divide(ax, [1.6] + [1.0] * len(caps))
    handles: list[Line2D] = ax.plot(x, scan[objective], "-", color=GREY, linewidth=1.2, label="all timings")
    if not feasible.all():
        allowed = np.where(feasible, scan[objective], np.nan)
        handles += ax.plot(x, allowed, "-", color=BLACK, linewidth=2.2, label="within the limits")
    text = minus(f"optimum {value:.4g} at {best:.2f} {label_of(scan[over]).units}")
    handles += ax.plot(best, value, "o", color=BLUE, markersize=7, label=text)
    ax.set_ylabel(axis_label(scan, objective))
    for panel, (name, cap) in zip(panels[1:], caps.items(), strict=True):
        panel.plot(x, scan[name], "-", color=BLACK, linewidth=1.2)
        text = minus(f"limit {name} {cap:g} {label_of(scan[name]).units}")
        handles.append(panel.axhline(cap, color=ORANGE, linestyle="--", linewidth=1.4, label=text))
        panel.set_ylabel(f"{name}\n[{label_of(scan[name]).units}]")
    for panel in panels:
        panel.axvline(best, color=BLUE, linewidth=0.8, linestyle=":")
        panel.grid(alpha=0.3)
    panels[-1].set_xlabel(axis_label(scan, over))
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.figure.align_ylabels(panels)
    legend(ax, handles)
    return ax


def _vertex(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float, bool]:
    index = int(np.nanargmax(y))
    if index in (0, y.size - 1):
        return float(x[index]), float(y[index]), True
    left, here, right = y[index - 1 : index + 2] - y[index]
    before, after = x[index] - x[index - 1], x[index + 1] - x[index]
    slope = (right * before**2 - left * after**2) / (before * after * (before + after))
    bend = (right * before + left * after) / (before * after * (before + after))
    if not bend < 0.0:
        return float(x[index]), float(y[index]), False
    shift = -slope / (2.0 * bend)
    return float(x[index] + shift), float(y[index] + here + slope * shift + bend * shift**2), False


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
