"""Figures of the measured-traces study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import plot
from mgdd.engine import timing_sweep
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import CylinderFit, Load
from mgdd.plot.calibration import wall_heat_profile
from mgdd.plot.style import drawn

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]


def draw(
    analyses: Sequence[xr.Dataset],
    main: CylinderFit,
    best: CylinderFit,
    reference: CylinderFit,
    profiles: Mapping[str, WallHeatProfile],
    timing: Sequence[Mapping[str, Any]],
) -> dict[str, Figure]:
    """Draw the figures of the study by caption; nothing is registered with pyplot."""
    out = {
        "Measured pressure and apparent heat release": _grid(analyses, plot.pressure),
        "log p over log V with the polytropic slopes of compression and expansion": _grid(analyses, plot.log_pv),
        f"Calibration, {main.kind}": _grid(main.loads, Load.plot),
        f"Calibration, {best.kind}": _grid(best.loads, Load.plot),
    }
    for law, profile in profiles.items():
        out[f"What the traces say about wall heat: refitted RMSE over the wall-heat scale, {law}"] = drawn(
            wall_heat_profile, profile.dataset, size=(13.0, 4.8)
        )
    sweeps = [timing_sweep(load.cylinder, load.point).assign_attrs(file=load.file) for load in reference.loads]
    scale = reference.model.wall_heat_scale
    caption = f"Efficiency and NOx proxies over timing, {reference.kind}, wall-heat scale held at {scale:g}"
    out[caption] = _grid(sweeps, plot.timing, label=True)
    out["Best timing without a pressure limit, as a range over wall-heat scale 0.5 to 1"] = _ranges(timing)
    return out


def _figure(rows: int) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(13.0, 4.8 * rows), layout="constrained")


def _grid(datasets: Sequence[Any], function: Any, *, label: bool = False) -> Figure:
    columns = min(2, len(datasets))
    rows = -(-len(datasets) // columns)
    figure = _figure(rows)
    for i, dataset in enumerate(datasets):
        part = figure.add_subplot(rows, columns, i + 1)
        function(dataset, ax=part)
        if label:  # plots of a trace name their file themselves
            part.annotate(dataset.attrs["file"], (0.5, 0.04), xycoords="axes fraction", ha="center")
    return figure


def _ranges(timing: Sequence[Mapping[str, Any]]) -> Figure:
    figure = _figure(1)
    left, right = figure.subplots(1, 2, sharey=True)
    places = range(len(timing))
    for ax, names, label in (
        (left, ("free_soc_cad", "fitted_soc_cad"), "start of combustion [°CA aTDC]"),
        (right, ("free_gain_percent", "gain_percent"), "gain in closed-cycle efficiency over the measured timing [%]"),
    ):
        first, second = names
        ax.hlines(places, [r[first][0] for r in timing], [r[first][1] for r in timing], lw=6, color="0.35")
        ax.hlines(places, [r[second][0] for r in timing], [r[second][1] for r in timing], lw=6, color="tab:orange")
        for style, name in (("|", first), ("x", second)):
            for end in (0, 1):
                ax.plot([r[name][end] for r in timing], places, style, color="black", ms=9)
        ax.set_xlabel(label)
        ax.grid(alpha=0.3)
        ax.margins(y=0.2)
    left.set_yticks(list(places), [str(r["file"]) for r in timing])
    handles = [
        left.plot([], [], "|-", lw=6, color="0.35", mec="black", label="best, no pressure limit")[0],
        left.plot([], [], "x-", lw=6, color="tab:orange", mec="black", label="as fitted")[0],
    ]
    left.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    handles = [
        right.plot([], [], "|-", lw=6, color="0.35", mec="black", label="no pressure limit")[0],
        right.plot([], [], "x-", lw=6, color="tab:orange", mec="black", label="under the trace's own p_max")[0],
    ]
    right.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure
