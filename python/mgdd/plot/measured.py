"""A measured signal and the free run of its model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, finished, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from mgdd.results.result import Result


def measured_and_model(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw a measured signal and the free run of its model over each other, the `run` of a `mgdd.results.Fit`."""
    run = require("run", run, ("time_s", "measured", "model"), "mgdd.results.Fit")
    ax = new_axes(ax)
    lines: list[Artist] = []
    lines += ax.plot(run["time_s"], run["measured"], color=BLACK, label="measured")
    lines += ax.plot(run["time_s"], run["model"], color=BLUE, linestyle="--", label="free run")
    return finished(ax, run, "time_s", "measured", lines)
