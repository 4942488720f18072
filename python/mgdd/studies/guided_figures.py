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
    out = {
        "Estimates and J lost since the start, median and mean of the seeds; the bands hold 80 %": _starts(dataset),
        "J of the engine and of its guide over timing, each from its own maximum": _curves(dataset),
    }
    if "limited_case" in dataset:
        out["Under a limit of the pressure rise: estimate and true pressure rise, medians; the bands hold 80 %"] = (
            _limited(dataset)
        )
    return out


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


def _limited(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    cases = [str(name) for name in dataset["limited_case"].to_numpy()]
    margins = list(dict.fromkeys(name.rpartition(", ")[2] for name in cases))
    for column, margin in enumerate(margins[:2]):
        above, below = axes[0, column], axes[1, column]
        for at, case in enumerate(name for name in cases if name.endswith(margin)):
            own = dataset.isel(limited_case=cases.index(case))
            dash, color = LINE_STYLES[at % len(LINE_STYLES)]
            for ax, key in ((above, "estimate"), (below, "rise")):
                low, high = own[f"limited_{key}_low"], own[f"limited_{key}_high"]
                ax.fill_between(own["cycle"], low, high, color=color, alpha=0.12, linewidth=0.0)
                name = case.rpartition(", ")[0]
                ax.plot(own["cycle"], own[f"limited_{key}_median"], linestyle=dash, color=color, label=name)
        above.axhline(float(dataset["limited_optimum_cad"]), color=GREY, linewidth=1.0, label="best within the limit")
        below.axhline(float(dataset["pressure_rise_limit"]), color=GREY, linewidth=1.0)
        above.set_title(margin, loc="left", fontsize="small")
        below.set_xlabel("cycle")
    axes[0, 0].set_ylabel("timing [°CA aTDC]")
    axes[1, 0].set_ylabel("pressure rise\nwithout noise [bar/°CA]")
    lines, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside upper center", ncols=4, fontsize="small", frameon=False)
    return figure
