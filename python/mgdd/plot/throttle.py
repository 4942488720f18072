"""A throttle: its duty against its angle, a model's free run over a log, and a run over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    axis_label,
    divide,
    finished,
    legend,
    new_axes,
    require,
    residual_below,
)
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

_MADE_BY = "mgdd.io.read_throttle_log"


def holding_duty(log: xr.Dataset | Result, *, limp_home_deg: float | None = None, ax: Axes | None = None) -> Axes:
    """Draw the duty of a slow ramp over the angle: the gap between the branches is twice the friction.

    Parameters
    ----------
    log : xarray.Dataset or Result
        ``duty`` [-] and ``angle_deg`` [deg] over ``time_s`` [s] of a triangle or staircase; ``model_deg`` [deg], if
        there, is drawn over it.
    limp_home_deg : float, optional
        Marks limp-home [deg].
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
    >>> from mgdd import plot
    >>> from mgdd.signals import triangle
    >>> from mgdd.throttle import Throttle, simulate_throttle
    >>> ramp = triangle(8.0, offset=0.15, amplitude=0.2, frequency_hz=0.125)
    >>> plot.holding_duty(simulate_throttle(Throttle(), ramp["duty"], time_s=ramp["time_s"])).get_xlabel()
    'plate angle [deg]'
    """
    log = require("log", log, ("time_s", "duty", "angle_deg"), _MADE_BY, ("model_deg",))
    has_model = "model_deg" in log
    ax = new_axes(ax)
    duty, angle = log["duty"].to_numpy(), log["angle_deg"].to_numpy()
    rising = _rising(duty)
    lines: list[Line2D] = []
    for chosen, dash, color, label in ((rising, "-", BLACK, "duty rising"), (~rising, "--", BLUE, "duty falling")):
        lines += ax.plot(
            _only(angle, chosen), _only(duty, chosen), linestyle=dash, color=color, linewidth=1.3, label=label
        )
    if has_model:
        lines += ax.plot(log["model_deg"], duty, linestyle=":", color=ORANGE, linewidth=1.4, label="model")
    if limp_home_deg is not None:
        label = f"limp-home {limp_home_deg:g} deg"
        lines.append(ax.axvline(limp_home_deg, color=GREY, linewidth=0.9, linestyle=(0, (1, 1)), label=label))
    return finished(ax, log, "angle_deg", "duty", lines)


def free_run(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw measured and modelled angle of `validate_throttle`, the difference in ``ax.figure.axes[-1]``."""
    run = require("run", run, ("time_s", "angle_deg", "model_deg", "residual_deg"), "mgdd.identify.validate_throttle")
    ax = new_axes(ax, height=4.4)
    residual_below(ax, run, "time_s", "residual_deg").grid(alpha=0.3)
    time = run["time_s"].to_numpy()
    name = str(run.attrs.get("kind", "")).replace("_", " ")
    lines: list[Line2D] = ax.plot(time, run["angle_deg"], "-", color=GREY, linewidth=2.4, label="measured")
    label = f"model, free run ({name})" if name else "model, free run"
    lines += ax.plot(time, run["model_deg"], "--", color=BLACK, linewidth=1.0, label=label)
    ax.set_ylabel(axis_label(run, "angle_deg"))
    ax.grid(alpha=0.3)
    legend(ax, lines)
    return ax


def measured_and_model(run: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw a measured signal and the free run of its model over each other, the `run` of a `mgdd.results.Fit`."""
    run = require("run", run, ("time_s", "measured", "model"), "mgdd.results.Fit")
    ax = new_axes(ax)
    lines: list[Line2D] = ax.plot(run["time_s"], run["measured"], color=BLACK, label="measured")
    lines += ax.plot(run["time_s"], run["model"], color=BLUE, linestyle="--", label="free run")
    return finished(ax, run, "time_s", "measured", lines)


def _rising(duty: np.ndarray) -> np.ndarray:
    """Mark the samples of a rising duty; where it holds, the last direction counts."""
    slope = np.sign(np.diff(duty, prepend=duty[:1]))
    last = np.maximum.accumulate(np.where(slope != 0.0, np.arange(duty.size), 0))
    return np.asarray(slope[last] >= 0.0)


def _only(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    return np.where(chosen, values, np.nan)


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
