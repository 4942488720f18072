"""Figures of the study on the measured benchmarks of identification."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.measured import measured_and_model
from mgdd.plot.style import residual_below

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_TITLES = {
    "emps": "Drive with friction, pulses record: free run from the measured voltage",
    "cascaded_tanks": "Cascaded tanks, test record: free run from two estimated levels",
    "wh2009": "Wiener-Hammerstein circuit, 4 ms of the test record: free run from rest",
}
_SHOWN = {"wh2009": slice(20_000, 20_205)}


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw measured and free run over each other, and the residual below; nothing is registered with pyplot."""
    return {title: _overlay(dataset, name) for name, title in _TITLES.items() if f"{name}_measured" in dataset}


def _overlay(dataset: xr.Dataset, name: str) -> Figure:
    from matplotlib.figure import Figure

    own = {f"{name}_{column}": column for column in ("time_s", "measured", "simulated")}
    run = dataset[list(own)].rename(own).rename(simulated="model").isel(time_s=_SHOWN.get(name, slice(None)))
    residual = (run["model"] - run["measured"]).assign_attrs(run["measured"].attrs)
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    ax = figure.add_subplot()
    measured_and_model(run, ax=ax).set_xlabel("")
    residual_below(ax, run.assign(residual=residual), "time_s", "residual")
    return figure
