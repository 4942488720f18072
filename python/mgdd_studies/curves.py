"""Estimates over cycles with the band of many seeds, errors over the trials of learning, and a drive over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
    finished,
    minus,
    new_axes,
    require,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

__all__ = ["convergence", "drive", "learning"]

_MARKERS = "osv^D"
_BAND = ("estimate_low_cad", "estimate_high_cad")
# Two colours-and-dashes more than the shared style has: a comparison of seekers needs them.
_STYLES = (*LINE_STYLES, ("-", ORANGE), ("--", GREEN), ("-.", BLUE), (":", BLACK))


def convergence(tracks: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw how estimates approach the optimum: medians as lines, quantiles over seeds as bands.

    ``estimate_median_cad`` stands over ``cycle`` and one more dimension, whose coordinate names the lines. Where the
    Dataset has them, ``estimate_low_cad`` and ``estimate_high_cad`` are the band, and ``optimum_cad`` is the goal.
    """
    optional = (*_BAND, "optimum_cad")
    tracks = require("tracks", tracks, ("cycle", "estimate_median_cad"), "a study of seekers", optional)
    median = tracks["estimate_median_cad"]
    others = [str(dim) for dim in median.dims if dim != "cycle"]
    if "cycle" not in median.dims or len(others) != 1:
        raise DataError(f"estimate_median_cad has dimensions {median.dims}: must be cycle and one more")
    names = [str(name) for name in tracks[others[0]].to_numpy()]
    if len(names) > len(_STYLES):
        raise DataError(f"{others[0]} has {len(names)} entries: at most {len(_STYLES)} lines can be distinguished")
    ax = new_axes(ax, height=4.2)
    cycle = tracks["cycle"].to_numpy()
    handles: list[Artist] = []
    for index, name in enumerate(names):
        dash, color = _STYLES[index]
        own = tracks.isel({others[0]: index})
        if all(end in tracks for end in _BAND):
            low, high = (own[end].to_numpy() for end in _BAND)
            ax.fill_between(cycle, low, high, color=color, alpha=0.13, linewidth=0.0)
        handles += ax.plot(cycle, own["estimate_median_cad"], linestyle=dash, color=color, linewidth=1.4, label=name)
    if "optimum_cad" in tracks and np.ndim(tracks["optimum_cad"]) == 0:
        best = float(tracks["optimum_cad"])
        label = minus(f"optimum {best:.2f}")
        handles.append(ax.axhline(best, color=GREY, linewidth=0.9, linestyle=(0, (1, 1)), label=label))
    ax.set_xlim(float(cycle[0]), float(cycle[-1]))
    return finished(ax, tracks, "cycle", "estimate_median_cad", handles)


def learning(learned: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw how the error of a repeated task falls from trial to trial, one line per learning law."""
    learned = require("learned", learned, ("law", "trial", "ca50_error_cad"), "the study seeker-comparison")
    ax = new_axes(ax)
    error = learned["ca50_error_cad"].transpose("law", "trial").to_numpy()
    lines: list[Line2D] = []
    for index, law in enumerate(learned["law"].to_numpy()):
        dash, color = LINE_STYLES[index % len(LINE_STYLES)]
        lines += ax.semilogy(
            learned["trial"], error[index], linestyle=dash, color=color, marker=_MARKERS[index % len(_MARKERS)],
            markersize=4, label=str(law),
        )  # fmt: skip
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter("{x:g}")
    ax.grid(alpha=0.3, which="both")
    return finished(ax, learned, "trial", "ca50_error_cad", lines, columns=3, grid=False)


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
