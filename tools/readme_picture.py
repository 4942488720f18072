"""Draw the picture of the README: a calibrated trace, and its best timing as a range.

Run `python tools/readme_picture.py [FILE]` with the package installed; FILE defaults to docs/_static/engine_cycle.png,
and its suffix chooses the format.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from mgdd import datasets, presets
from mgdd.engine import analyze, find_optimum, timing_sweep
from mgdd.identify import fit_cylinder
from mgdd.identify.engine.records import CylinderFit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

OUT = Path(__file__).parents[1] / "docs" / "_static" / "engine_cycle.png"
LOAD = 1  # the trace at 50 % load
BURN = ("soc_cad", "burn_duration_cad", "fuel_heat_j")
BLACK, BLUE, ORANGE, GREY = "#000000", "#0072B2", "#D55E00", "#777777"


def draw_trace(ax: Axes, heat: xr.Dataset, fit: CylinderFit) -> None:
    """Measured points, the calibrated line through them, and the measured heat release below."""
    load = fit.loads[LOAD]
    overlay = load.overlay
    angle = overlay["crank_angle_cad"]
    lines = ax.plot(angle, overlay["measured_bar"], "o", color=GREY, markersize=3.2, label="measured pressure")
    lines += ax.plot(angle, overlay["model_bar"], "-", color=BLACK, linewidth=1.3, label="calibrated model")
    twin = ax.twinx()
    lines += twin.plot(
        heat["crank_angle_cad"], heat["heat_release_net_j_per_cad"], "-.", color=ORANGE, label="heat release"
    )
    ax.set(xlim=(-60, 80), ylim=(0, 230), xlabel="crank angle [°CA aTDC]", ylabel="cylinder pressure [bar]")
    twin.set(ylim=(-10, 760))
    twin.set_ylabel("net heat release [J/°CA]", color=ORANGE)
    twin.tick_params(axis="y", colors=ORANGE)
    ax.legend(handles=lines, loc="upper right", frameon=False)
    ax.set_title(f"Calibrated, double Wiebe: RMSE {load.rmse_percent:.2f} % of p_max", loc="left")


def draw_timing(ax: Axes, fits: dict[float, CylinderFit]) -> None:
    """Closed-cycle efficiency over timing, the rest refitted at each wall-heat scale, and the range of the best."""
    best = []
    for (scale, fit), (dash, colour) in zip(fits.items(), (("-", BLACK), ("--", BLUE)), strict=True):
        load = fit.loads[LOAD]
        sweep = timing_sweep(load.cylinder, load.point, soc_cad=np.arange(-20.0, 8.5, 0.5))
        efficiency = 100.0 * sweep["work_closed_j"] / load.fuel_heat_j
        ax.plot(sweep["soc_cad"], efficiency, dash, color=colour, label=f"wall-heat scale {scale:g}")
        top = find_optimum(load.cylinder, load.point, "imep_closed_bar", step_cad=0.25)
        best.append(top["soc_cad"])
        ax.plot(top["soc_cad"], float(efficiency.interp(soc_cad=top["soc_cad"])), "o", color=colour, markersize=6)
    low, high = min(best), max(best)
    text = f"best: {low:.1f} to {high:.1f} °CA".replace("-", "−")
    ax.axvspan(low, high, color=ORANGE, alpha=0.25, linewidth=0, label=text)
    ax.set(xlabel="start of combustion [°CA aTDC]", ylabel="efficiency, closed cycle [%]", xlim=(-20, 8))
    ax.legend(loc="lower right", frameon=False)
    ax.set_title("Best timing, single Wiebe: wall heat is unknown", loc="left")


def main() -> None:
    """Fit, draw, write."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    traces, cylinder = datasets.load("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder
    double = fit_cylinder(traces, cylinder.replace(burn_shape="double_wiebe", gamma_model="constant"))
    single = {scale: fit_cylinder(traces, cylinder.replace(wall_heat_scale=scale), free=BURN) for scale in (0.5, 1.0)}
    plt.rcParams |= {"font.size": 9.5, "axes.titlesize": 9.5, "legend.fontsize": 9.0, "svg.hashsalt": "mgdd"}
    fig, (left, right) = plt.subplots(1, 2, figsize=(8.8, 3.5), layout="constrained")
    draw_trace(left, analyze(traces[LOAD], cylinder), double)
    draw_timing(right, single)
    out.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Date": None} if out.suffix == ".svg" else {"Software": None}
    fig.savefig(out, dpi=200, metadata=metadata)


if __name__ == "__main__":
    main()
