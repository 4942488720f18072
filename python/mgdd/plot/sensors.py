"""NOx of every sensor of the bench, over cycles, timing or gas temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, axis_label, legend, new_axes, require
from mgdd.results.labels import label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from mgdd.results.result import Result

# Behind each other in this order: the noisy ones first, the true value above them.
_SENSORS: dict[str, dict[str, Any]] = {
    "nox_fast_ppm": {"color": GREY, "linestyle": "-", "marker": "x", "linewidth": 0.7},
    "nox_soft_ppm": {"color": ORANGE, "linestyle": "-.", "marker": "^", "linewidth": 1.2},
    "nox_soft_corrected_ppm": {"color": GREEN, "linestyle": ":", "marker": "v", "linewidth": 1.8},
    "nox_true_ppm": {"color": BLACK, "linestyle": "-", "marker": "o", "linewidth": 1.5},
    "nox_analyser_ppm": {"color": BLUE, "linestyle": "--", "marker": "s", "linewidth": 1.5},
    "nox_affine_log_ppm": {"color": ORANGE, "linestyle": (0, (6, 2)), "marker": "", "linewidth": 1.2},
    "nox_arrhenius_ppm": {"color": GREEN, "linestyle": (0, (2, 1)), "marker": "", "linewidth": 1.2},
}
_MARKER_SIZES = {"nox_fast_ppm": 6.0, "nox_soft_corrected_ppm": 7.0, "nox_analyser_ppm": 9.0}
_OVER = ("cycle", "soc_cad", "soi_cad", "t_max_k")


def sensors(readings: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw what the NOx sensors read beside the true value.

    Parameters
    ----------
    readings : xarray.Dataset or Result
        ``nox_true_ppm`` [ppm] over ``cycle`` (as a run of the bench gives), ``soc_cad``, ``soi_cad`` or ``t_max_k``,
        and any of ``nox_analyser_ppm``, ``nox_fast_ppm``, ``nox_soft_ppm``, ``nox_soft_corrected_ppm``,
        ``nox_affine_log_ppm`` and ``nox_arrhenius_ppm``. Steady readings get markers.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        No true value, a variable without unit, other dimensions.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.loop import VirtualEngine
    >>> plot.sensors(VirtualEngine(seed=1).run([-6.0] * 20)).get_ylabel()
    'NOx [ppm]'
    """
    readings = require("readings", readings, ("nox_true_ppm",), "mgdd.loop.VirtualEngine.run", tuple(_SENSORS))
    names = [name for name in _SENSORS if name in readings]
    dims = readings["nox_true_ppm"].dims
    if len(dims) != 1 or dims[0] not in _OVER:
        raise DataError(f"nox_true_ppm has dimensions {dims}: must be one of {', '.join(_OVER)}")
    over = str(dims[0])
    require("readings", readings, (over,), "mgdd.loop.VirtualEngine.run")
    ax = new_axes(ax)
    lines: list[Artist] = []
    for name in names:
        style = dict(_SENSORS[name])
        marker = style.pop("marker")
        if over != "cycle":
            style |= {"marker": marker, "markersize": _MARKER_SIZES.get(name, 4.0), "markerfacecolor": "none"}
            if name in _MARKER_SIZES:  # these lie on the true value: open markers of different size keep all in sight
                style["linestyle"] = "none"
        label = label_of(readings[name]).long_name.removeprefix("NOx, ").removeprefix("NOx proxy, ")
        lines += ax.plot(readings[over], readings[name], label=label, **style)
    ax.set(xlabel=axis_label(readings, over), ylabel="NOx [ppm]")
    if over == "cycle":
        ax.set_xlim(float(readings[over][0]), float(readings[over][-1]))
    ax.grid(alpha=0.3)
    legend(ax, lines)
    return ax
