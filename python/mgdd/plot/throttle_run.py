"""A run of a throttle over time: angle, duty and current, one below the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, axis_label, divide, legend, new_axes, require
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

_OPTIONAL = ("reference_deg", "current_a")
_PANELS = (("error_deg", ORANGE), ("duty", BLUE), ("current_a", GREEN))


def throttle_run(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the plate angle over time, with the reference if there is one; error, duty and current in panels below.

    Parameters
    ----------
    run : xarray.Dataset or Result
        ``angle_deg`` [deg] and ``duty`` [-] over ``time_s`` [s], and ``reference_deg`` [deg] and ``current_a`` [A] if
        there, as `mgdd.loop.track`, `mgdd.throttle.simulate_throttle` or `mgdd.io.read_throttle_log` gives them.
        Attribute ``limp_home_deg`` is marked.
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
    >>> from mgdd import plot
    >>> from mgdd.loop import track, tuned_controller
    >>> plot.throttle_run(track(tuned_controller("pid", "P1"), "step:20:60", throttle="P1")).get_ylabel()
    'plate angle [deg]'
    """
    run = require("run", run, ("time_s", "angle_deg", "duty"), "mgdd.throttle.simulate_throttle", _OPTIONAL)
    if "reference_deg" in run:
        error = (run["reference_deg"] - run["angle_deg"]).assign_attrs(units="deg", long_name="error")
        run = run.assign(error_deg=error)
    panels = [(name, color) for name, color in _PANELS if name in run]
    ax = new_axes(ax, height=3.0 + 0.9 * len(panels))
    time, lines = run["time_s"].to_numpy(), []
    if "reference_deg" in run:
        lines += ax.plot(time, run["reference_deg"], "--", color=GREY, linewidth=1.2, label="reference")
    lines += ax.plot(
        time, run["angle_deg"], "-", color=BLACK, linewidth=1.4, label=label_of(run["angle_deg"]).long_name
    )
    if "limp_home_deg" in run.attrs:
        rest = float(run.attrs["limp_home_deg"])
        lines.append(
            ax.axhline(rest, color=GREY, linewidth=0.9, linestyle=(0, (1, 1)), label=f"limp-home {rest:g} deg")
        )
    ax.set_ylabel(axis_label(run, "angle_deg"))
    ax.set_xlim(float(time[0]), float(time[-1]))
    below = divide(ax, [1.0] + [0.5] * len(panels))[1:]
    for panel, (name, color) in zip(below, panels, strict=True):
        # The input of a sample holds until the next one.
        panel.plot(time, run[name], color=color, linewidth=1.1, drawstyle="steps-post" if name == "duty" else "default")
        panel.axhline(0.0, color=GREY, linewidth=0.8)
        panel.set_ylabel(axis_label(run, name))
    below[-1].set_xlabel(axis_label(run, "time_s"))
    for one in (ax, *below):
        one.grid(alpha=0.3)
    ax.figure.align_ylabels([ax, *below])
    legend(ax, lines)
    return ax
