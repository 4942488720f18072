"""Many cycles: the cloud of their pressures, and a figure of theirs from cycle to cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, axis_label, beside, legend, new_axes, require
from mgdd.results.labels import ANGLE, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

__all__ = ["CYCLE", "cloud", "cycles"]

CYCLE = "cycle"
_LINES = 60  # of a cloud; the band says the rest
_MARKS = {"misfire": ("x", ORANGE), "partial_burn": ("+", BLUE)}


def cloud(ax: Axes, dataset: xr.Dataset) -> list[Line2D]:
    """Draw single pressures in grey, the band from the 5th to the 95th percentile, and return what the legend names."""
    angle, bar = dataset[ANGLE].to_numpy(), dataset["pressure_bar"].transpose(CYCLE, ANGLE).to_numpy()
    shown = bar[:: max(1, len(bar) // _LINES)]
    ax.plot(angle, shown.T, color=GREY, linewidth=0.4, alpha=0.4)
    low, high = np.percentile(bar, (5.0, 95.0), axis=0)
    band = ax.fill_between(angle, low, high, color=BLUE, alpha=0.25, linewidth=0.0)
    band.set_label(f"5th to 95th percentile of {len(bar)} cycles")
    return [band]  # type: ignore[list-item]


def cycles(dataset: xr.Dataset | Result, figure: str = "imep_gross_bar", *, ax: Axes | None = None) -> Axes:
    """Draw a figure of a record from cycle to cycle, its histogram, and each value over the one before it.

    Parameters
    ----------
    dataset : xarray.Dataset or Result
        Figures over ``cycle``, of `mgdd.engine.analyze` or `mgdd.engine.Indicating.record`. Misfires and partial burns
        are marked.
    figure : str
        Which one.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes over the cycle; histogram and return map stand beside it.

    Raises
    ------
    DataError
        No such figure, not over ``cycle`` alone, or none of its values is a number.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.engine import Indicating, simulate
    >>> runs = [simulate("puma_single", {"fuel_mg": mg}, soc_cad=-5.0) for mg in (20.0, 19.6, 20.7)]
    >>> indicating = Indicating(runs[0]["crank_angle_cad"], "puma_single", speed_rpm=1500.0)
    >>> ax = plot.cycles(indicating.record([run["pressure_bar"] for run in runs]), "ca50_cad")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('engine cycle', 'CA50, angle of 50 % heat released [°CA aTDC]')
    """
    made_by = "mgdd.engine.analyze or Indicating.record"
    dataset = require("dataset", dataset, (CYCLE, figure), made_by, tuple(_MARKS))
    if dataset[figure].dims != (CYCLE,):
        over = ", ".join(map(str, dataset[figure].dims)) or "nothing"
        raise DataError(f"{figure} is over {over}: a figure over {CYCLE} alone is drawn; of several cylinders take one")
    cycle, values = dataset[CYCLE].to_numpy(), dataset[figure].to_numpy()
    known = values[np.isfinite(values)]
    if not known.size:
        raise DataError(f"{figure}: none of the {values.size} cycles has this figure")
    ax, side, after = beside(new_axes(ax), (5.0, 1.0, 3.0))
    mean = float(known.mean())
    lines: list[Line2D] = ax.plot(cycle, values, ".", color=BLACK, markersize=3, label=f"mean {mean:.4g}")
    ax.axhline(mean, color=BLACK, linewidth=0.8)
    for edge in np.percentile(known, (5.0, 95.0)):
        line = ax.axhline(float(edge), color=BLUE, linewidth=0.9, linestyle="--", label="5th and 95th percentile")
    lines.append(line)
    for name, (marker, color) in _MARKS.items():
        if name in dataset and (at := dataset[name].to_numpy().astype(bool)).any():
            label = f"{label_of(dataset[name]).long_name}: {np.count_nonzero(at)} cycles"
            there = np.where(np.isfinite(values[at]), values[at], known.min())
            lines += ax.plot(cycle[at], there, marker, color=color, label=label)
    side.hist(known, bins=min(40, max(5, int(np.sqrt(known.size)))), orientation="horizontal", color=GREY)
    side.set(xlabel="cycles")
    side.sharey(ax)
    side.tick_params(labelleft=False)
    after.plot(values[:-1], values[1:], ".", color=BLACK, markersize=3)
    after.set(xlabel="one cycle", ylabel="the next one")
    after.grid(alpha=0.3)
    ax.set(xlabel="engine cycle", ylabel=axis_label(dataset, figure))
    ax.grid(alpha=0.3)
    legend(ax, lines, columns=1)
    return ax
