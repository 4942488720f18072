"""Figures of the sensor study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd import plot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_SENSORS = ("true", "analyser", "fast", "soft", "soft_corrected")


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw map and steady readings, the answers to steps, and the correction of a wrong proxy, by caption."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    names = {f"steady_{name}_ppm": f"nox_{name}_ppm" for name in _SENSORS}
    steady = dataset[[*names, "soi_cad"]].rename(names)
    map_names = {"steady_true_ppm": "nox_true_ppm", "steady_analyser_ppm": "nox_analyser_ppm"}
    map_names |= {f"fitted_{name}_ppm": f"nox_{name}_ppm" for name in ("affine_log", "arrhenius")}
    mapped = dataset[[*map_names, "t_max_k"]].rename(map_names).swap_dims(soi_cad="t_max_k").drop_vars("soi_cad")
    plot.sensors(mapped, ax=left)
    plot.sensors(steady, ax=right)
    out = {"Map of the soft sensor over the maximum gas temperature, and every sensor over injection timing": figure}
    if "step" in dataset:
        figure = Figure(figsize=(11.0, 4.2), layout="constrained")
        steps = dataset[[*names.values()]]
        for ax, step in zip(figure.subplots(1, steps.sizes["step"], squeeze=False).flat, dataset["step"], strict=True):
            plot.sensors(steps.sel(step=step).drop_vars("step"), ax=ax)
            ax.annotate(str(step.item()), (0.98, 0.04), xycoords="axes fraction", ha="right")
        out["Answers of the sensors to a step of timing and of load at cycle 0"] = figure
    if "correction_cycle" in dataset:
        figure = Figure(figsize=(6.6, 3.8), layout="constrained")
        ax = figure.add_subplot()
        error = dataset["correction_error_percent"]
        low, middle, high = np.quantile(error, [0.1, 0.5, 0.9], axis=0)
        cycle = dataset["correction_cycle"].to_numpy()
        ax.fill_between(cycle, low, high, color="0.8", linewidth=0.0)
        ax.plot(cycle, middle, color="black")
        ax.axhline(0.0, color="0.4", linewidth=0.8)
        ax.set(xlabel="cycle since the wrong start [-]", ylabel="error of the corrected soft sensor [%]")
        ax.set_xlim(0, cycle.size)
        ax.grid(alpha=0.3)
        out["A wrong proxy held to the analyser: median of the seeds and the band that holds 80 % of them"] = figure
    return out
