"""What a validation shows: error ahead, autocorrelation of residuals, and which parameters are entangled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, GREY, LINE_STYLES, ORANGE, axis_label, divide, legend, minus, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

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
    >>> plot.correlation_matrix(fit.to_dataset()).texts[1].get_text()
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
