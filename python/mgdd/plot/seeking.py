"""Runs of a seeker: input, performance, slope and limits in panels, and what the NOx sensors read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINE_STYLES,
    ORANGE,
    axis_label,
    divide,
    legend,
    minus,
    new_axes,
    require,
)
from mgdd.results.labels import label_of
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from mgdd.results.result import Result

_NEEDED = ("cycle", "asked", "estimate", "j")
_MADE_BY = "mgdd.loop.run_seeker"
_SLOPE = "gradient_per_cad"


def seeking(
    run: xr.Dataset | Result,
    *,
    optimum_cad: float | None = None,
    limit_values: Mapping[str, float] | None = None,
    mean_cycles: int = 50,
    ax: Axes | None = None,
) -> Axes:
    """Draw a closed loop as stacked panels over the cycles.

    The panels are the input with its dither and the estimate; J with its running mean; the estimated slope of J, or
    the NOx sensor behind J where the run has no slope; and the limited quantities, each with its limit. A panel without
    data is left out.

    Parameters
    ----------
    run : xarray.Dataset or Result
        ``estimate`` and ``asked`` over ``cycle`` and ``input``, each input in a panel of its own, and ``j`` over
        ``cycle``, as `mgdd.loop.run_seeker` gives; optional are ``gradient_per_cad`` [unit of J per °CA], NOx of the
        sensor that ``attrs["nox_sensor"]`` names, and ``limits`` over ``limit``.
    optimum_cad : float, optional
        Where the estimate should go [°CA aTDC]; ``attrs["optimum"]`` if left out, which the criteria of a run give.
    limit_values : mapping of str to float, optional
        Limits by name, in their units; ``attrs["limit_NAME"]`` if left out, which the seeker of a run gives.
    mean_cycles : int
        Window of the running mean of J [cycles].
    ax : matplotlib.axes.Axes, optional
        Where to draw; it is divided into the panels. None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the first panel; the others are the last ones of ``ax.figure.axes``.

    Raises
    ------
    DataError
        A variable is missing or has no unit, or a limit that the run did not measure.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.loop import VirtualEngine, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking
    >>> run = run_seeker(VirtualEngine(nox_sensor="none"), ExtremumSeeking(start=-16.0), 60).dataset
    >>> [panel.get_ylabel() for panel in plot.seeking(run).figure.axes]
    ['soc_cad [°CA aTDC]', 'efficiency [%]']
    """
    run = require("run", run, (), _MADE_BY)
    sensor = f"nox_{run.attrs.get('nox_sensor', 'none')}_ppm".replace("true_value", "true")
    third = _SLOPE if _SLOPE in run else sensor if sensor in run else None
    limited = [str(name) for name in run["limit"].to_numpy()] if "limits" in run else []
    require("run", run, (*_NEEDED, *([third] if third else []), *(["limits"] if limited else [])), _MADE_BY)
    inputs = [
        (f"{name} [{unit_of(str(name))}]", run["asked"][:, k], run["estimate"][:, k])
        for k, name in enumerate(run["input"].to_numpy())
    ]
    optimum_cad = run.attrs.get("optimum") if optimum_cad is None else optimum_cad
    if limit_values is None:
        limit_values = {name: run.attrs[f"limit_{name}"] for name in limited if f"limit_{name}" in run.attrs}
    for name in limit_values:
        if name not in limited:
            raise DataError(f"limit_values: {name!r} was not measured as a limit in this run, which has {limited}")
    n, below = len(inputs), 1 + bool(third) + bool(limited)
    ax = new_axes(ax, height=0.2 + 1.8 * n + 1.6 * below)
    panels = divide(ax, [1.4] * n + [1.0] * below)
    cycle = run["cycle"].to_numpy()
    handles: list[Artist] = []
    for panel, (label, asked, estimate) in zip(panels, inputs, strict=False):
        panel.set_ylabel(label)
        lines = panel.plot(cycle, asked, color=GREY, linewidth=0.6, label="with dither")
        lines += panel.plot(cycle, estimate, color=BLACK, linewidth=1.6, label="estimate")
        handles = handles or [*lines]
    if optimum_cad is not None:
        label = minus(f"optimum {optimum_cad:.2f}")
        handles.append(ax.axhline(optimum_cad, color=BLUE, linestyle="--", linewidth=1.0, label=label))
    j = run["j"].to_numpy()
    panels[n].plot(cycle, j, ".", color=GREY, markersize=1.5)
    handles += panels[n].plot(
        cycle, _running_mean(j, mean_cycles), "-", color=ORANGE, linewidth=1.4, label=f"mean of {mean_cycles} cycles"
    )
    panels[n].set_ylabel(_short(run, "j"))
    if third:
        panels[n + 1].plot(cycle, run[third], color=BLACK, linewidth=0.8)
        if third == _SLOPE:
            panels[n + 1].axhline(0.0, color=GREY, linewidth=0.8)
        panels[n + 1].set_ylabel(_short(run, third))
    for index, name in enumerate(limited):
        dash, color = LINE_STYLES[index % len(LINE_STYLES)]
        panels[-1].plot(cycle, run["limits"].sel(limit=name), linestyle=dash, color=color, linewidth=0.7)
        if name in limit_values:
            value = limit_values[name]
            label = minus(f"limit {name} {value:g}")
            line = panels[-1].axhline(value, color=ORANGE, linestyle=(0, (4, 1.5)), linewidth=1.6, label=label)
            handles.append(line)
    if limited:
        panels[-1].set_ylabel(_limit_label(run, limited))
    for panel in panels:
        panel.grid(alpha=0.3)
    ax.set_xlim(float(cycle[0]), float(cycle[-1]))
    panels[-1].set_xlabel(axis_label(run, "cycle"))
    ax.figure.align_ylabels(panels)
    legend(ax, handles, columns=3)
    return ax


def _short(run: xr.Dataset, name: str) -> str:
    if name == _SLOPE:
        return f"slope [{label_of(run[name]).units}]"
    label = label_of(run[name])
    long_name = re.sub(r"(,) | (?=[+-]\d)", r"\1\n", label.long_name)  # parts of a name, terms of a sum
    return f"{long_name} [{label.units}]".replace("\n-", "\n−")


def _limit_label(run: xr.Dataset, names: list[str]) -> str:
    units = [str(unit) for unit in run["limit_units"].to_numpy()] if "limit_units" in run.coords else ["-"] * len(names)
    if len(names) == 1:
        return f"{names[0]} [{units[0]}]"
    return f"limited [{', '.join(dict.fromkeys(units))}]"


def _running_mean(values: NDArray[np.float64], window: int) -> NDArray[np.float64]:
    """Mean of the last `window` values, of fewer at the beginning; misfires (NaN) are left out."""
    finite = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(finite, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(finite)])
    last = np.arange(1, values.size + 1)
    first = np.maximum(last - window, 0)
    return np.asarray((total[last] - total[first]) / np.maximum(count[last] - count[first], 1))


# Behind each other in this order: the noisy ones first, the true value above them.
_SENSORS: dict[str, dict[str, Any]] = {
    "nox_fast_ppm": {"color": GREY, "linestyle": "-", "marker": "x", "linewidth": 0.7},
    "nox_soft_ppm": {"color": ORANGE, "linestyle": "-.", "marker": "^", "linewidth": 1.2},
    "nox_soft_corrected_ppm": {"color": GREEN, "linestyle": ":", "marker": "v", "linewidth": 1.8},
    "nox_true_ppm": {"color": BLACK, "linestyle": "-", "marker": "o", "linewidth": 1.5},
    "nox_analyser_ppm": {"color": BLUE, "linestyle": "--", "marker": "s", "linewidth": 1.5},
    "nox_affine_log_ppm": {"color": ORANGE, "linestyle": (0, (6, 2)), "marker": "", "linewidth": 1.2},
    "nox_arrhenius_ppm": {"color": GREEN, "linestyle": (0, (2, 1)), "marker": "", "linewidth": 1.2},
}
_MARKER_SIZES = {"nox_fast_ppm": 6.0, "nox_soft_corrected_ppm": 7.0, "nox_analyser_ppm": 9.0}
_OVER = ("cycle", "soc_cad", "soi_cad", "t_max_k")


def sensors(readings: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw what the NOx sensors read beside the true value.

    Parameters
    ----------
    readings : xarray.Dataset or Result
        ``nox_true_ppm`` [ppm] over ``cycle`` (as a run of the bench gives), ``soc_cad``, ``soi_cad`` or ``t_max_k``,
        and any of ``nox_analyser_ppm``, ``nox_fast_ppm``, ``nox_soft_ppm``, ``nox_soft_corrected_ppm``,
        ``nox_affine_log_ppm`` and ``nox_arrhenius_ppm``. Steady readings get markers.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        No true value, a variable without unit, other dimensions.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.loop import VirtualEngine
    >>> plot.sensors(VirtualEngine(seed=1).run([-6.0] * 20)).get_ylabel()
    'NOx [ppm]'
    """
    readings = require("readings", readings, ("nox_true_ppm",), "mgdd.loop.VirtualEngine.run", tuple(_SENSORS))
    names = [name for name in _SENSORS if name in readings]
    dims = readings["nox_true_ppm"].dims
    if len(dims) != 1 or dims[0] not in _OVER:
        raise DataError(f"nox_true_ppm has dimensions {dims}: must be one of {', '.join(_OVER)}")
    over = str(dims[0])
    require("readings", readings, (over,), "mgdd.loop.VirtualEngine.run")
    ax = new_axes(ax)
    lines: list[Artist] = []
    for name in names:
        style = dict(_SENSORS[name])
        marker = style.pop("marker")
        if over != "cycle":
            style |= {"marker": marker, "markersize": _MARKER_SIZES.get(name, 4.0), "markerfacecolor": "none"}
            if name in _MARKER_SIZES:  # these lie on the true value: open markers of different size keep all in sight
                style["linestyle"] = "none"
        label = label_of(readings[name]).long_name.removeprefix("NOx, ").removeprefix("NOx proxy, ")
        lines += ax.plot(readings[over], readings[name], label=label, **style)
    ax.set(xlabel=axis_label(readings, over), ylabel="NOx [ppm]")
    if over == "cycle":
        ax.set_xlim(float(readings[over][0]), float(readings[over][-1]))
    ax.grid(alpha=0.3)
    legend(ax, lines)
    return ax
