"""A controlled throttle over time: wanted and true angle, the error, and the duty."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, axis_label, divide, legend, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

__all__ = ["throttle_track"]


def throttle_track(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw wanted and true angle over time, and the error and the duty in panels below.

    Parameters
    ----------
    run : xarray.Dataset or Result
        ``reference_deg``, ``angle_deg`` [deg] and ``duty`` [-] over ``time_s`` [s], as `mgdd.loop.track` gives them.
    ax : matplotlib.axes.Axes, optional
        Where to draw; it gives its lower half to the panels. None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the angle.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd.control import Pid
    >>> from mgdd.loop import track
    >>> from mgdd.plot.throttle_track import throttle_track
    >>> throttle_track(track(Pid(), "step:20:60")).get_ylabel()
    'plate angle [deg]'
    """
    run = require("run", run, ("time_s", "reference_deg", "angle_deg", "duty"), "mgdd.loop.track")
    ax = new_axes(ax, height=5.2)
    time, error = run["time_s"].to_numpy(), (run["reference_deg"] - run["angle_deg"]).to_numpy()
    lines = ax.plot(time, run["reference_deg"], "--", color=GREY, linewidth=1.2, label="wanted")
    lines += ax.plot(time, run["angle_deg"], "-", color=BLACK, linewidth=1.4, label="true")
    ax.set_ylabel(axis_label(run, "angle_deg"))
    ax.set_xlim(float(time[0]), float(time[-1]))
    legend(ax, lines)
    _, middle, below = divide(ax, [1.0, 0.5, 0.5])
    middle.plot(time, error, "-", color=ORANGE, linewidth=1.0)
    middle.axhline(0.0, color=GREY, linewidth=0.7)
    middle.set_ylabel("error [deg]")
    below.step(time, run["duty"], "-", color=BLUE, linewidth=1.0, where="post")
    below.set_ylabel("duty [-]")
    below.set_xlabel("time [s]")
    return ax
