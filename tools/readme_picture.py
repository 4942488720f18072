"""Draw the pictures of the README: a calibrated trace with its best timing as a range, and the run of its example.

Run `python tools/readme_picture.py` with the package installed; they go to docs/_static.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from mgdd import datasets, presets
from mgdd.engine import analyze, timing_sweep
from mgdd.identify import best_timing
from mgdd.identify.engine.records import Load
from mgdd.identify.engine.timing_records import BestTiming
from mgdd.maps import optimize_map
from mgdd.sweep import sweep

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "_static"
LOAD = 1  # the trace at 50 % load
BLACK, BLUE, ORANGE, GREY = "#000000", "#0072B2", "#D55E00", "#777777"


def draw_trace(ax: Axes, heat: xr.Dataset, load: Load) -> None:
    """Measured points, the calibrated line through them, and the measured heat release below."""
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


def draw_timing(ax: Axes, row: BestTiming) -> None:
    """Closed-cycle efficiency over the angle of half burned, for plausible models of several wall heats."""
    like = [m for m in row.members if m.plausible and m.member.fitted == "gamma" and m.member.gamma_model == "linear"]
    styles = [(dash, colour) for colour in (BLACK, BLUE, GREY) for dash in ("-", "--")]
    for answer, (dash, colour) in zip(like, styles, strict=False):
        load = answer.member.fit.loads[LOAD]
        sweep = timing_sweep(load.cylinder, load.point, soc_cad=np.arange(-15.0, 10.5, 0.5))
        efficiency = 100.0 * sweep["work_closed_j"] / load.fuel_heat_j
        wall = answer.member.wall_heat_model.capitalize()
        name = f"{wall} {answer.member.wall_heat_scale:g}, RMSE {answer.rmse_percent:.2f} %"
        ax.plot(sweep["ca50_cad"], efficiency, dash, color=colour, label=name)
        at = float(np.interp(answer.free_ca50_cad, sweep["ca50_cad"], efficiency))
        ax.plot(answer.free_ca50_cad, at, "o", color=colour, markersize=6)
    low, high = row.free_ca50_cad
    ax.axvspan(low, high, color=ORANGE, alpha=0.2, linewidth=0, label=f"range: {low:.1f} to {high:.1f}")
    ax.set(xlabel="half burned, CA50 [°CA aTDC]", ylabel="efficiency, closed cycle [%]", xlim=(-4, 20))
    ax.legend(loc="lower center", frameon=False, fontsize=7.0)
    ax.set_title("Best timing: equally good models disagree", loc="left")


def draw_example() -> None:
    """Run the example of the README and keep its figure."""
    code = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)[0]
    names: dict[str, Any] = {}
    exec(code, names)  # noqa: S102
    names["figure"].savefig(FOLDER / "readme_run.png", dpi=150, metadata={"Software": None})


def draw_map() -> None:
    """Draw the best timing over speed and fuel under a limit, as the tour makes it."""
    axes = {"speed_rpm": np.linspace(1000, 3000, 6), "fuel_mg": np.linspace(8, 32, 6)}
    table = sweep("puma_single", over={**axes, "soc_cad": np.linspace(-20, 5, 101)})
    best = optimize_map(table, "efficiency_gross", limits={"p_max_bar": 120.0}, max_loss=0.002)
    best.plot().figure.savefig(FOLDER / "readme_map.png", dpi=100, metadata={"Software": None})


def main() -> None:
    """Fit, draw, write."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    traces, cylinder = datasets.read("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder
    row = best_timing(traces, cylinder)[LOAD]
    if row.best is None:
        raise SystemExit("no plausible model: there is nothing to draw")
    with plt.rc_context({"font.size": 9.5, "axes.titlesize": 9.5, "legend.fontsize": 9.0}):
        fig, (left, right) = plt.subplots(1, 2, figsize=(8.8, 3.5), layout="constrained")
        draw_trace(left, analyze(traces[LOAD], cylinder), row.best.member.fit.loads[LOAD])
        draw_timing(right, row)
        fig.savefig(FOLDER / "engine_cycle.png", dpi=200, metadata={"Software": None})
    draw_example()
    draw_map()


if __name__ == "__main__":
    main()
