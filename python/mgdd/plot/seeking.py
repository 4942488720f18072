"""A seeker at work: what it applied, what it believed, and the limits that it kept, over cycles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.errors import DataError
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, axis_label, legend, minus, new_axes, require
from mgdd.results import VARIABLES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

__all__ = ["seeker_limit", "seeker_run"]

_MADE_BY = "mgdd.loop.run_seeker"


def seeker_run(cycles: xr.Dataset, *, optimum_cad: float | None = None, ax: Axes | None = None) -> Axes:
    """Draw requested timing and estimate of a seeker over cycles.

    Parameters
    ----------
    cycles : xarray.Dataset
        ``soc_requested_cad`` and ``estimate_cad`` [°CA aTDC] over ``cycle``, as `mgdd.loop.run_seeker` and
        `mgdd.rig.run_on_rig` give; misfires are marked where ``misfire`` says so.
    optimum_cad : float, optional
        Where the estimate should go [°CA aTDC].
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.loop import EngineBench, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking
    >>> run = run_seeker(EngineBench(seed=1), ExtremumSeeking(start=-20.0, lower=-30.0, upper=10.0), 300)
    >>> plot.seeker_run(run.dataset, optimum_cad=-5.63).get_xlabel()
    'engine cycle [-]'
    """
    require(cycles, ("cycle", "soc_requested_cad", "estimate_cad"), _MADE_BY)
    ax = new_axes(ax)
    at = cycles["cycle"]
    applied, estimate = cycles["soc_requested_cad"], cycles["estimate_cad"]
    lines: list[Line2D] = ax.plot(at, applied, ".", color=GREY, markersize=2, label=applied.attrs["long_name"])
    lines += ax.plot(at, estimate, "-", color=BLACK, label=estimate.attrs["long_name"])
    missed = cycles["misfire"].to_numpy().astype(bool) if "misfire" in cycles else None
    if missed is not None and missed.any():
        lines += ax.plot(at[missed], applied[missed], "x", color=ORANGE, markersize=5, label="misfired cycle")
    if optimum_cad is not None:
        label = minus(f"optimum without chance: {optimum_cad:.1f} °CA aTDC")
        lines += [ax.axhline(optimum_cad, color=BLUE, linestyle="--", label=label)]
    ax.set(xlabel=axis_label(cycles, "cycle"), ylabel="start of combustion [°CA aTDC]")
    legend(ax, lines)
    return ax


def seeker_limit(cycles: xr.Dataset, name: str, upper: float, *, ax: Axes | None = None) -> Axes:
    """Draw a limited quantity over the cycles of a seeker, with its limit.

    Parameters
    ----------
    cycles : xarray.Dataset
        ``limits`` over ``cycle`` and ``limit``, with the units ``limit_units``.
    name : str
        Which of the limits.
    upper : float
        The limit, in its unit.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.

    Raises
    ------
    DataError
        No such limit in the Dataset.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.loop import EngineBench, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking, Limit
    >>> seeker = ExtremumSeeking(start=-20.0, lower=-30.0, upper=10.0, limits=[Limit("p_max_bar", 95.0)])
    >>> run = run_seeker(EngineBench(limits=["p_max_bar"]), seeker, 300)
    >>> plot.seeker_limit(run.dataset, "p_max_bar", 95.0).get_ylabel()
    'maximum pressure [bar]'
    """
    require(cycles, ("cycle", "limits"), _MADE_BY)
    known = [str(limit) for limit in cycles["limit"].to_numpy()]
    if name not in known:
        raise DataError(f"dataset has no limit {name!r}: it has {', '.join(known)}")
    values = cycles["limits"].sel(limit=name)
    ax = new_axes(ax)
    lines: list[Line2D] = ax.plot(cycles["cycle"], values, ".", color=GREY, markersize=2, label="measured")
    lines += [ax.axhline(upper, color=ORANGE, linestyle="--", label=minus(f"limit {upper:g}"))]
    long_name = VARIABLES[name].long_name if name in VARIABLES else name
    ax.set(xlabel=axis_label(cycles, "cycle"), ylabel=f"{long_name} [{values['limit_units'].item()}]")
    legend(ax, lines)
    return ax
