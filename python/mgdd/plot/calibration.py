"""Measured against modelled pressure, how sharply the traces fix wall heat and TDC, and the answers of a family."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import (
    BLACK,
    BLUE,
    GREY,
    LINE_STYLES,
    ORANGE,
    finished,
    legend,
    minus,
    new_axes,
    require,
    residual_below,
)  # fmt: skip
from mgdd.results.labels import ANGLE, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

_EVENTS = {"soi_cad": (":", ORANGE), "soc_cad": ("--", BLUE)}


def calibration_overlay(overlay: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw measured points under the model's line, and their difference in a panel below, ``ax.figure.axes[-1]``.

    The data are those of one trace of `mgdd.identify.fit_cylinder`; start of injection and of combustion, RMSE and IMEP
    error are shown where the Dataset has them.
    """
    needed = (ANGLE, "measured_bar", "model_bar", "residual_bar")
    optional = (*_EVENTS, "rmse_percent", "imep_closed_error_percent")
    overlay = require("overlay", overlay, needed, "mgdd.identify.fit_cylinder", optional)
    ax = new_axes(ax, height=4.8)
    panel = residual_below(ax, overlay, ANGLE, "residual_bar")
    angle = overlay[ANGLE].to_numpy()
    lines: list[Line2D] = ax.plot(angle, overlay["measured_bar"], ".", color=GREY, markersize=4, label="measured")
    burn = str(overlay.attrs.get("burn", "")).replace("_", " ").replace("wiebe", "Wiebe")
    model = f"model, {burn}" if burn else "model"
    lines += ax.plot(angle, overlay["model_bar"], "-", color=BLACK, linewidth=1.2, label=model)
    for name, (dash, color) in _EVENTS.items():
        if name in overlay and np.isfinite(overlay[name]):
            at = float(overlay[name])
            panel.axvline(at, linestyle=dash, color=color)
            label = minus(f"{label_of(overlay[name]).long_name} {at:.1f}")
            lines.append(ax.axvline(at, linestyle=dash, color=color, label=label))
    ax.set_ylabel("cylinder pressure [bar]")
    parts = [str(overlay.attrs["file"])] if overlay.attrs.get("file") else []
    if "rmse_percent" in overlay:
        parts.append(f"RMSE {float(overlay['rmse_percent']):.2f} % of p_max")
    if "imep_closed_error_percent" in overlay:
        parts.append(f"closed IMEP {float(overlay['imep_closed_error_percent']):+.1f} %")
    quality = minus("\n".join(parts))
    if quality:
        ax.text(0.02, 0.95, quality, transform=ax.transAxes, va="top", fontsize="small")
    legend(ax, lines)
    return ax


def wall_heat_profile(profile: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the best reachable RMSE over the wall-heat scale: a flat curve means the traces do not fix it.

    A second dimension gives a line each; the shaded band holds the scales within 10 % of the best RMSE of all traces.
    """
    profile = require("profile", profile, ("wall_heat_scale", "rmse_percent"), "mgdd.identify.wall_heat_profile")
    rmse = profile["rmse_percent"]
    if "wall_heat_scale" not in rmse.dims or rmse.ndim > 2:
        raise DataError(f"rmse_percent has dimensions {rmse.dims}: wall_heat_scale and at most one more are needed")
    ax = new_axes(ax, height=4.2)
    scale = profile["wall_heat_scale"].to_numpy()
    others = [str(dim) for dim in rmse.dims if dim != "wall_heat_scale"]
    curves = rmse.transpose("wall_heat_scale", *others).to_numpy().reshape(scale.size, -1)
    names = [f"{name}" for name in profile[others[0]].to_numpy()] if others else ["best fit"]
    lines: list[Line2D] = []
    for index, name in enumerate(names):
        dash, color = LINE_STYLES[index % len(LINE_STYLES)]
        lines += ax.plot(scale, curves[:, index], linestyle=dash, color=color, marker="o", markersize=3, label=name)
    together = np.sqrt(np.mean(curves**2, axis=1))
    fine = np.linspace(float(scale.min()), float(scale.max()), 2001)
    inside = fine[np.interp(fine, scale, together) <= 1.1 * together.min()]
    span = ax.axvspan(
        float(inside.min()), float(inside.max()), color=GREY, alpha=0.2, linewidth=0, label="within 10 % of the best"
    )
    ax.set_ylim(bottom=0.0)
    return finished(ax, profile, "wall_heat_scale", "rmse_percent", [*lines, span], grid=False)


def tdc_scan(scan: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the least RMSE over the TDC offset, and the range of offsets that are possible, of `estimate_tdc`."""
    names = ("tdc_offset_cad", "rmse_percent", "low_cad", "high_cad")
    scan = require("scan", scan, names, "mgdd.identify.estimate_tdc")
    ax = new_axes(ax, height=4.2)
    lines: list[Line2D] = ax.plot(
        scan["tdc_offset_cad"], scan["rmse_percent"], "o-", color=BLACK, markersize=3, label="calibrated at each offset"
    )
    low, high = float(scan["low_cad"]), float(scan["high_cad"])
    span = ax.axvspan(low, high, color=GREY, alpha=0.2, linewidth=0, label="within a quarter of the least")
    ax.axvline(0.0, color=BLUE, linestyle="--", linewidth=1.0)
    ax.set_ylim(bottom=0.0)
    return finished(ax, scan, "tdc_offset_cad", "rmse_percent", [*lines, span], grid=False)


_NEEDED = ("free_ca50_cad", "fitted_ca50_cad", "plausible")
_LABEL = "best CA50, no pressure limit [°CA aTDC]"


def family_strip(timing: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw each member's best CA50 without a pressure limit, one row per member, of a load of `best_timing`.

    Filled: plausible; open: not; ringed: the best; band: the range; dashed: burn as measured.
    """
    timing = require("timing", timing, ("member", *_NEEDED), "mgdd.identify.best_timing")
    names = [str(name) for name in timing["member"].to_numpy()]
    if not names:
        raise DataError(f"{timing.attrs.get('file', 'timing')}: no members to draw")
    ax = new_axes(ax, height=0.24 * len(names) + 1.2)
    rows, chosen = np.arange(len(names)), timing.attrs.get("best")
    best, good = timing["free_ca50_cad"].to_numpy(), timing["plausible"].to_numpy().astype(bool)
    if chosen:
        ends = ("free_ca50_low_cad", best[good].min()), ("free_ca50_high_cad", best[good].max())
        low, high = (float(timing.attrs.get(name, end)) for name, end in ends)
        ax.axvspan(low, high, color=ORANGE, alpha=0.15, linewidth=0, label=minus(f"plausible: {low:.1f} to {high:.1f}"))
        at = names.index(chosen)
        measured = float(timing["fitted_ca50_cad"][at])
        ax.axvline(measured, color=BLUE, linestyle="--", linewidth=1.0, label=minus(f"as measured: {measured:.1f}"))
    ax.plot(best[~good], rows[~good], "o", color=GREY, markerfacecolor="none", markersize=4, label="not plausible")
    ax.plot(best[good], rows[good], "o", color=BLACK, markersize=4.5)
    if chosen:
        label = minus(f"best member: {best[at]:.1f}")
        ax.plot(
            best[at], at, "o", color=ORANGE, markerfacecolor="none", markersize=10, markeredgewidth=1.8, label=label
        )
    ax.set_yticks(rows, names, fontsize="x-small")
    ax.set_ylim(rows[-1] + 0.7, -0.7)
    ax.set_xlabel(_LABEL)
    ax.grid(axis="x", alpha=0.3)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize="small")
    return ax


def family_strips(rows: Sequence[Any]) -> Figure:
    """Draw one strip per load, side by side over one list of members."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 + 2.9 * len(rows), 0.21 * len(rows[0].members) + 2.3), layout="constrained")
    panels = figure.subplots(1, len(rows), sharex=True, sharey=True, squeeze=False)[0]
    for ax, row in zip(panels, rows, strict=True):
        family_strip(row, ax=ax)
        ax.set_xlabel(f"{row.file}\n{_LABEL.replace(', no', ',' + chr(10) + 'no')}", fontsize="small")
    return figure
