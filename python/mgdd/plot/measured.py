"""A measured signal and the free run of its model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, finished, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

__all__ = ["measured_and_model"]


def measured_and_model(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw a measured signal and the free run of its model over each other.

    Parameters
    ----------
    run : xarray.Dataset or Result
        ``measured`` and ``model`` over ``time_s``, as the attribute ``run`` of a `mgdd.results.Fit` has them.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from mgdd.plot.measured import measured_and_model
    >>> from mgdd.results.labels import labelled_dataset
    >>> run = labelled_dataset({
    ...     "time_s": ("time_s", [0.0, 1.0]),
    ...     "measured": ("time_s", [0.0, 1.0], "V", "level, measured"),
    ...     "model": ("time_s", [0.0, 0.9], "V", "level, free run"),
    ... })
    >>> measured_and_model(run, ax=Figure().add_subplot()).get_ylabel()
    'level, measured [V]'
    """
    run = require("run", run, ("time_s", "measured", "model"), "mgdd.results.Fit")
    ax = new_axes(ax)
    lines: list[Artist] = []
    lines += ax.plot(run["time_s"], run["measured"], color=BLACK, label="measured")
    lines += ax.plot(run["time_s"], run["model"], color=BLUE, linestyle="--", label="free run")
    return finished(ax, run, "time_s", "measured", lines)
