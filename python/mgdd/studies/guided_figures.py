"""Figures of the study of guided and unguided starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, GREY, LINE_STYLES, legend, minus

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_NAMES = {
    "unguided": "extremum seeking, unguided",
    "feed_forward": "extremum seeking from the guide's timing",
    "curve": "guided by the curve",
    "parabola": "guided by a parabola",
}


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the figures of the study by caption; nothing is registered with pyplot."""
    return {
        "Estimates and J lost since the start, median and mean of the seeds; the bands hold 80 %": _starts(dataset),
        "J of the engine and of its guide over timing, each from its own maximum": _curves(dataset),
    }


def _starts(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    lines = []
    for at, case in enumerate(map(str, dataset["case"].to_numpy())):
        one = dataset.isel(case=at)
        dash, color = LINE_STYLES[at % len(LINE_STYLES)]
        look = {"linestyle": dash, "color": color, "label": _NAMES[case]}
        lines += above.plot(one["cycle"], one["estimate_median_cad"], **look)
        if case in ("unguided", "curve"):
            low, high = one["estimate_low_cad"], one["estimate_high_cad"]
            above.fill_between(one["cycle"], low, high, color=color, alpha=0.15, linewidth=0.0)
        below.plot(one["cycle"], one["lost_j_cycles"], **look)
    best = float(dataset["optimum_cad"])
    lines.append(above.axhline(best, color=GREY, linewidth=1.0, label=minus(f"best timing: {best:.1f} °CA aTDC")))
    above.set_ylabel("timing [°CA aTDC]")
    below.set_ylabel(f"J lost since the start [{dataset['steady_j'].attrs['units']} × cycles]".replace("percent", "%"))
    below.set_yscale("log")
    below.set_xlabel("cycle")
    legend(above, lines)
    return figure


def _curves(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    ax = figure.subplots()
    own, guide = dataset["steady_j"], dataset["guide_j"]
    lines = ax.plot(dataset["timing_cad"], own - own.max(), color=BLACK, label="engine")
    lines += ax.plot(dataset["timing_cad"], guide - guide.max(), color=LINE_STYLES[1][1], linestyle="--", label="guide")
    ax.set_xlabel("timing [°CA aTDC]")
    ax.set_ylabel(f"J less its maximum [{own.attrs['units']}]".replace("percent", "%"))
    legend(ax, lines)
    return figure
