"""Figures of the study on the measured benchmarks of identification."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import BLACK, BLUE, axis_label, legend
from mgdd.results.labels import label_of

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

    part = dataset.isel({f"{name}_time_s": _SHOWN.get(name, slice(None))})
    time, measured, simulated = part[f"{name}_time_s"], part[f"{name}_measured"], part[f"{name}_simulated"]
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    lines = top.plot(time, measured, color=BLACK, label="measured")
    lines += top.plot(time, simulated, color=BLUE, linestyle="--", label="free run")
    top.set_ylabel(axis_label(part, f"{name}_measured"))
    legend(top, lines)
    bottom.plot(time, simulated - measured, color=BLACK)
    bottom.axhline(0.0, color=BLUE, linewidth=0.8)
    bottom.set_ylabel(f"residual [{label_of(measured).units}]")
    bottom.set_xlabel("time [s]")
    return figure
