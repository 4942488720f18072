"""A drive over the throttle: pedal, torque, plate and manifold pressure, one below the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, ORANGE, axis_label, divide, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

__all__ = ["drive"]

# Panels: label, and the lines, what is wanted first.
_PANELS = (
    ("torque [N m]", (("wanted_torque_nm", "wanted"), ("torque_nm", "obtained"))),
    ("plate angle [deg]", (("reference_deg", "reference"), ("angle_deg", "opening"))),
    ("manifold\npressure [kPa]", (("wanted_pressure_kpa", "wanted, behind its lag"), ("pressure_kpa", "obtained"))),
)


def drive(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw pedal, torque, plate angle and manifold pressure of a drive over time.

    Parameters
    ----------
    run : xarray.Dataset or Result
        A drive as `mgdd.loop.simulate_drive` gives it.
    ax : matplotlib.axes.Axes, optional
        Where to draw; it gives its lower part to the panels. None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the pedal.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd.loop import simulate_drive
    >>> from mgdd.plot.drive import drive
    >>> from mgdd.throttle import DemandChain
    >>> drive(simulate_drive(DemandChain(), [10.0] * 20 + [40.0] * 80, 2000.0)).get_ylabel()
    'pedal [%]'
    """
    names = tuple(name for _, lines in _PANELS for name, _ in lines)
    run = require("run", run, ("time_s", "pedal_percent", *names), "mgdd.loop.simulate_drive")
    ax = new_axes(ax, height=6.4)
    time = run["time_s"].to_numpy()
    ax.plot(time, run["pedal_percent"], color=BLACK, linewidth=1.3)
    ax.set_ylabel(axis_label(run, "pedal_percent"))
    ax.set_xlim(float(time[0]), float(time[-1]))
    below = divide(ax, (0.7, 1.0, 1.0, 1.0))[1:]
    for panel, (label, ((wanted, asked), (obtained, got))) in zip(below, _PANELS, strict=True):
        panel.plot(time, run[wanted], color=ORANGE, linewidth=1.6, linestyle=(0, (4, 1.5)), label=asked)
        panel.plot(time, run[obtained], color=BLUE, linewidth=1.2, label=got)
        panel.set_ylabel(label)
        panel.legend(loc="best", frameon=False, fontsize="small")
    below[-1].set_xlabel(axis_label(run, "time_s"))
    for one in (ax, *below):
        one.grid(alpha=0.3)
    ax.figure.align_ylabels([ax, *below])
    return ax
