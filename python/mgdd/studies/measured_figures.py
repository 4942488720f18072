"""Figures of the measured-traces study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import plot
from mgdd.engine import timing_sweep
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import Load
from mgdd.plot.calibration import wall_heat_profile
from mgdd.plot.family import family_strips
from mgdd.plot.style import drawn

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from mgdd.identify.engine.family import Member
    from mgdd.identify.engine.timing_records import BestTiming

__all__ = ["draw"]


def draw(
    analyses: Sequence[xr.Dataset],
    main: Member,
    profiles: Mapping[str, WallHeatProfile],
    timing: Sequence[BestTiming],
) -> dict[str, Figure]:
    """Draw the figures of the study by caption; nothing is registered with pyplot."""
    out = {
        "Best timing by every member of the family, without a pressure limit": family_strips(timing),
        "Measured pressure and apparent heat release": _grid(analyses, plot.pressure),
        "log p over log V with the polytropic slopes of compression and expansion": _grid(analyses, plot.log_pv),
        f"Calibration, {main.name}": _grid(main.fit.loads, Load.plot),
    }
    for law, profile in profiles.items():
        out[f"What the traces say about wall heat: refitted RMSE over the wall-heat scale, {law}"] = drawn(
            wall_heat_profile, profile.dataset, size=(13.0, 4.8)
        )
    sweeps = [timing_sweep(load.cylinder, load.point).assign_attrs(file=load.file) for load in main.fit.loads]
    out[f"Efficiency and NOx proxies over timing, {main.name}"] = _grid(sweeps, plot.timing, label=True)
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
