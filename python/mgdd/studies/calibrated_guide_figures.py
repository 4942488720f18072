"""Figures of the study of a guide that learns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE
from mgdd.studies.calibrated_guide_cases import RECIPES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw"]

_LOOKS = dict(zip((recipe.name for recipe in RECIPES), (("-", BLACK), ("--", BLUE), ("-.", ORANGE)), strict=True))
_SHOWN, _SHOWN_AFTER = 80, 60
_LEGEND = {"none": "not calibrated"}


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw what the guide learns and what that does to the estimate, then the load step, by caption."""
    out = {
        "Error of the guide's best timing (above) and of the estimate (below): median of the seeds, and the band that "
        "holds 80 % of them": _starts(dataset)
    }
    if "step" in dataset:
        out["Error of the estimate after a load step from 12 to 30 mg, by the curve and by feed-forward"] = _steps(
            dataset
        )
    return out


def _starts(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    own = dataset.isel(run=np.flatnonzero(dataset["tdc_error_cad"] == 0.0))
    cases = list(dict.fromkeys(zip(own["engine"].to_numpy(), own["start_cad"].to_numpy(), strict=True)))
    figure = Figure(figsize=(3.1 * len(cases) + 0.6, 5.4), layout="constrained")
    axes = figure.subplots(2, len(cases), sharex=True, sharey="row", squeeze=False)
    for (above, below), (engine, start) in zip(axes.T, cases, strict=True):
        runs = own.isel(
            run=np.flatnonzero((own["engine"] == engine) & (own["start_cad"] == start)), cycle=slice(_SHOWN)
        )
        for at, name in enumerate(map(str, runs["calibrated"].to_numpy())):
            one = runs.isel(run=at)
            _band(above, one["cycle"], one, "guide_error", name)
            _band(below, one["cycle"], one, "error", name)
        above.set_title(f"{engine},\nfrom {start:g} °CA aTDC".replace("-", "−"), loc="left", fontsize="small")
        below.set_ylim(-4.0, 4.0)
        below.axhspan(-1.5, 1.5, color=GREY, alpha=0.15, linewidth=0.0)
    axes[0, 0].set_ylabel("error of the guide's\nbest timing [°CA]")
    axes[1, 0].set_ylabel("error of the estimate [°CA]")
    figure.supxlabel("engine cycle [-]", fontsize="medium")
    _legend(figure, axes[0, 0])
    return figure


def _steps(dataset: xr.Dataset) -> Figure:
    from matplotlib.figure import Figure

    parts = [str(name).rsplit(", ", 2) for name in dataset["step"].to_numpy()]
    cases = list(dict.fromkeys((engine, form) for engine, form, _ in parts))
    figure = Figure(figsize=(3.1 * len(cases) + 0.6, 3.8), layout="constrained")
    axes = figure.subplots(1, len(cases), sharey=True, squeeze=False)[0]
    cycle = dataset["after_step"].to_numpy()[:_SHOWN_AFTER]
    for ax, case in zip(axes, cases, strict=True):
        for at, (engine, form, name) in enumerate(parts):
            if (engine, form) == case and name in _LOOKS:
                _band(ax, cycle, dataset.isel(step=at, after_step=slice(_SHOWN_AFTER)), "step_error", name)
        ax.axhspan(-1.5, 1.5, color=GREY, alpha=0.15, linewidth=0.0)
        ax.set_title(f"{case[0]},\n{case[1]}", loc="left", fontsize="small")
    axes[0].set_ylabel("error of the estimate [°CA]")
    figure.supxlabel("cycles since the load step [-]", fontsize="medium")
    _legend(figure, axes[0])
    return figure


def _band(ax: Axes, cycle: xr.DataArray | np.ndarray, one: xr.Dataset, what: str, name: str) -> None:
    dash, color = _LOOKS[name]
    ax.fill_between(cycle, one[f"{what}_low_cad"], one[f"{what}_high_cad"], color=color, alpha=0.13, linewidth=0.0)
    label = _LEGEND.get(name, f"calibrated: {name}")
    ax.plot(cycle, one[f"{what}_median_cad"], linestyle=dash, color=color, linewidth=1.3, label=label)
    ax.axhline(0.0, color=GREY, linewidth=0.7)
    ax.grid(alpha=0.3)


def _legend(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False, fontsize="small")
