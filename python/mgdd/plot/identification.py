"""Diagnostics of fits: error ahead, residuals, entangled parameters, and a response model over its factors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import (
    BLACK,
    BLUE,
    GREY,
    LINE_STYLES,
    ORANGE,
    axis_label,
    divide,
    legend,
    minus,
    new_axes,
    new_figure,
    require,
)
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec
    from numpy.typing import NDArray

    from mgdd.results.result import Result

_TANGLED = 0.98


def error_growth(n_step: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw how the error of a prediction grows with its horizon: one line per predictor of `validate_throttle`."""
    n_step = require("n_step", n_step, ("predictor", "horizon_s", "n_step_rms_deg"), "mgdd.identify.validate_throttle")
    names = [str(name).replace("_", " ") for name in n_step["predictor"].to_numpy()]
    if len(names) > len(LINE_STYLES):
        raise DataError(f"predictor has {len(names)} entries: at most {len(LINE_STYLES)} lines can be distinguished")
    ax = new_axes(ax)
    horizon = 1e3 * n_step["horizon_s"].to_numpy()
    rms = n_step["n_step_rms_deg"].transpose("predictor", "horizon_s").to_numpy()
    lines: list[Artist] = []
    for index, name in enumerate(names):
        dash, color = LINE_STYLES[index]
        lines += ax.plot(horizon, rms[index], linestyle=dash, color=color, marker="o", markersize=4, label=name)
    ax.set(xlabel="horizon [ms]", ylabel=axis_label(n_step, "n_step_rms_deg"), yscale="log")
    ax.set_xticks(horizon)
    ax.grid(alpha=0.3, which="both")
    legend(ax, lines)
    return ax


def residual_correlation(correlations: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the autocorrelation of a residual and, below, its correlation with earlier input, of `validate_throttle`."""
    names = ("autocorrelation", "cross_correlation")
    correlations = require("correlations", correlations, ("lag", *names, "limit"), "mgdd.identify.validate_throttle")
    ax = new_axes(ax, height=4.4)
    panels = divide(ax, (1.0, 1.0))
    lag, limit = correlations["lag"].to_numpy(), float(correlations["limit"])
    lines: list[Artist] = []
    for panel, name in zip(panels, names, strict=True):
        values = correlations[name].to_numpy()
        band = panel.axhspan(
            -limit, limit, color=GREY, alpha=0.25, linewidth=0.0, label=minus(f"±{limit:.3g}, 95 % of lags")
        )
        out = np.abs(values) > limit
        panel.vlines(lag, 0.0, values, color=BLACK, linewidth=1.2)
        (inside,) = panel.plot(lag[~out], values[~out], "o", color=BLUE, markersize=4, label="inside")
        (outside,) = panel.plot(lag[out], values[out], "s", color=ORANGE, markersize=4, label="outside")
        panel.axhline(0.0, color=BLACK, linewidth=0.8)
        panel.grid(alpha=0.3)
        lines = lines or [band, inside, outside]
    ax.set_ylabel("residual with itself [-]")
    panels[1].set(xlabel=axis_label(correlations, "lag"), ylabel="with earlier duty [-]")
    legend(ax, lines, columns=3)
    return ax


def validation_figure(validation: Any, correlation: xr.Dataset | None = None) -> Figure:
    """Draw free run, error ahead and residuals of a validation, and how the estimates of its fit are correlated."""
    rows = 1 if correlation is None else 2
    figure = new_figure(12.0, 4.6 * rows)
    panes = figure.subplots(rows, 3 if rows == 1 else 2).ravel()
    for pane, what in zip(panes, ("free_run", "n_step", "residuals"), strict=False):
        validation.plot(what, ax=pane)
    if correlation is not None:
        correlation_matrix(correlation, ax=panes[3])
    return figure


def correlation_matrix(correlation: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw how the estimates of a fit depend on each other; pairs beyond 0.98 cannot be separated.

    Parameters
    ----------
    correlation : xarray.Dataset or Result
        ``correlation`` [-] over ``parameter`` and ``other``, the names; NaN for a parameter at a bound. As
        the ``to_dataset`` of a fit's report gives it.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes; numbers stand in the cells, those beyond 0.98 in a frame.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.optimize import least_squares
    >>> fit = least_squares(lambda x: ([x[0] + x[1], x[0]], [[1, 1], [1, 0]]), [1.0, 1.0], names=["preload", "coulomb"])
    >>> plot.correlation_matrix(fit.dataset).texts[1].get_text()
    '−0.71'
    """
    from matplotlib.patches import Rectangle

    correlation = require("correlation", correlation, ("parameter", "other", "correlation"), "a fit of mgdd.identify")
    names = [str(name) for name in correlation["parameter"].to_numpy()]
    values = correlation["correlation"].transpose("parameter", "other").to_numpy()
    n = len(names)
    ax = new_axes(ax, height=max(3.4, 1.6 + 0.42 * n))
    ax.set_facecolor("#dddddd")
    image = ax.imshow(values, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
    ax.figure.colorbar(image, ax=ax, label="correlation [-]", shrink=0.9)
    size = "small" if n <= 8 else "xx-small"
    for i in range(n):
        for j in range(n):
            value = float(values[i, j])
            shown = minus(f"{value:.2f}") if np.isfinite(value) else "–"
            dark = np.isfinite(value) and abs(value) > 0.6
            ax.text(j, i, shown, ha="center", va="center", fontsize=size, color="white" if dark else BLACK)
            if i != j and np.isfinite(value) and abs(value) > _TANGLED:
                frame = Rectangle((j - 0.46, i - 0.46), 0.92, 0.92, fill=False, edgecolor=BLACK, linewidth=1.8)
                ax.add_patch(frame)
    ax.set_xticks(range(n), names, rotation=40, ha="right", rotation_mode="anchor", fontsize="small")
    ax.set_yticks(range(n), names, fontsize="small")
    return ax


_CUTS_IN_A_ROW = 3
_NEEDED = (
    "point", "measured", "fitted", "left_out", "studentised", "normal_score", "outlier", "outlier_bound", "factor",
    "cut", "cut_mean", "cut_lower", "cut_upper",
)  # fmt: skip


def response_diagnostics(diagnostics: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw the diagnostics of `mgdd.surrogate.fit_response`: four panels of residuals, and a cut along each factor.

    Points beyond the bound for outliers are squares.
    """
    diagnostics = require("diagnostics", diagnostics, _NEEDED, "mgdd.surrogate.fit_response")
    names = [str(name) for name in diagnostics["factor"].to_numpy()]
    require("diagnostics", diagnostics, tuple(names), "mgdd.surrogate.fit_response")
    rows = -(-len(names) // _CUTS_IN_A_ROW)
    ax = new_axes(ax, height=5.4 + 2.3 * rows)
    panels, cuts = _divided(ax, rows, len(names))
    data, odd = diagnostics, diagnostics["outlier"].to_numpy().astype(bool)
    response = label_of(data["measured"])
    quantity = response.long_name.removesuffix(", measured")
    measured, left_out = data["measured"].to_numpy(), data["left_out"].to_numpy()
    ends = [min(np.min(measured), np.nanmin(left_out)), max(np.max(measured), np.nanmax(left_out))]
    ax.plot(ends, ends, "-", color=GREY, linewidth=0.8)
    lines = _points(ax, left_out, measured, odd)
    ax.set(xlabel=f"from the other points [{response.units}]", ylabel=f"{quantity}\nmeasured [{response.units}]")
    bound, residual = float(data["outlier_bound"]), data["studentised"].to_numpy()
    over = {
        "point": (data["point"].to_numpy(), axis_label(data, "point")),
        "fitted": (data["fitted"].to_numpy(), f"fitted [{response.units}]"),
        "normal_score": (data["normal_score"].to_numpy(), axis_label(data, "normal_score")),
    }
    for panel, (values, label) in zip(panels[1:], over.values(), strict=True):
        _points(panel, values, residual, odd)
        panel.set(xlabel=label, ylabel=axis_label(data, "studentised"))
        panel.axhline(0.0, color=GREY, linewidth=0.8)
        for edge in (-bound, bound):
            if np.isfinite(bound):
                panel.axhline(edge, color=ORANGE, linestyle="--", linewidth=0.9)
    scores = over["normal_score"][0]
    panels[3].plot([scores.min(), scores.max()], [scores.min(), scores.max()], "-", color=GREY, linewidth=0.8)
    lines += _cuts(cuts, data, names, f"{quantity}\n[{response.units}]")
    for panel in (*panels, *cuts):
        panel.grid(alpha=0.3)
    legend(ax, list({minus(str(line.get_label())): line for line in lines}.values()), columns=1)
    return ax


def _points(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], odd: NDArray[np.bool_]) -> list[Artist]:
    lines: list[Artist] = [*ax.plot(x[~odd], y[~odd], "o", color=BLUE, markersize=4, label="point")]
    if odd.any():
        lines += ax.plot(x[odd], y[odd], "s", color=ORANGE, markersize=6, label="outlier")
    return lines


def _cuts(axes: list[Axes], data: xr.Dataset, names: list[str], label: str) -> list[Artist]:
    lines: list[Artist] = []
    for place, (ax, name) in enumerate(zip(axes, names, strict=True)):
        cut = data.isel(factor=place)
        percent = 100.0 * float(data.attrs.get("level", 0.95))
        band = ax.fill_between(
            cut["cut"], cut["cut_lower"], cut["cut_upper"], color=GREY, alpha=0.3, linewidth=0.0,
            label=f"{percent:.0f} % of new measurements",
        )  # fmt: skip
        (line,) = ax.plot(cut["cut"], cut["cut_mean"], "-", color=BLACK, label="model, other factors at their medians")
        ax.set_xlabel(axis_label(data, name), fontsize="small")
        if place % _CUTS_IN_A_ROW == 0:
            ax.set_ylabel(label)
        else:
            ax.sharey(axes[place - place % _CUTS_IN_A_ROW])
            ax.tick_params(labelleft=False)
        lines = lines or [line, band]
    return lines


def _divided(ax: Axes, rows: int, cuts: int) -> tuple[list[Axes], list[Axes]]:
    """Divide axes into two rows of two panels, and rows of cuts below."""
    spec, figure = ax.get_subplotspec(), ax.figure
    heights: dict[str, Any] = {"height_ratios": (2.0, 0.85 * rows)}
    outer: Any
    if spec is not None:
        outer = spec.subgridspec(2, 1, **heights)
    else:
        left, bottom, width, height = ax.get_position().bounds
        box = {"left": left, "bottom": bottom, "right": left + width, "top": bottom + height, "hspace": 0.35}
        outer = figure.add_gridspec(2, 1, **box, **heights)
    wide = {} if spec is not None else {"wspace": 0.4, "hspace": 0.5}
    upper, lower = outer[0].subgridspec(2, 2, **wide), outer[1].subgridspec(rows, min(cuts, _CUTS_IN_A_ROW), **wide)

    def panel(place: SubplotSpec) -> Axes:
        made: Axes = figure.add_subplot(place)
        return made

    ax.set_subplotspec(upper[0, 0])
    panels = [ax, *(panel(upper[place]) for place in ((0, 1), (1, 0), (1, 1)))]
    return panels, [panel(lower[place // _CUTS_IN_A_ROW, place % _CUTS_IN_A_ROW]) for place in range(cuts)]
