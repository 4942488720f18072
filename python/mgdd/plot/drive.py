"""A drive over the throttle: pedal, torque, plate and manifold pressure, one below the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, ORANGE, axis_label, divide, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

# Panels: label, and the lines, what is wanted first.
_PANELS = (
    ("torque [N m]", (("wanted_torque_nm", "wanted"), ("torque_nm", "obtained"))),
    ("plate angle [deg]", (("reference_deg", "reference"), ("angle_deg", "opening"))),
    ("manifold\npressure [kPa]", (("wanted_pressure_kpa", "wanted, behind its lag"), ("pressure_kpa", "obtained"))),
)


def drive(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw pedal, torque, plate angle and manifold pressure of a `mgdd.loop.simulate_drive` over time."""
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
