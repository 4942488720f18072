"""One cycle: pressure over crank angle, and log p over log V."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.cycles import CYCLE, cloud
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, axis_label, finished, minus, new_axes, require
from mgdd.results.labels import ANGLE, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

_RATES = {
    "heat_release_j_per_cad": ("-.", ORANGE),
    "heat_release_net_j_per_cad": ("-.", ORANGE),
    "heat_release_gross_j_per_cad": (":", ORANGE),
}
_ANGLES = ("ca10_cad", "ca50_cad", "ca90_cad")
# The windows in which the exponents are fitted, °CA aTDC.
_WINDOWS = {"n_compression": (-100.0, -40.0), "n_expansion": (60.0, 120.0)}
_SLOPE_STYLES = {"n_compression": ("o--", BLUE), "n_expansion": ("s-.", ORANGE)}


def pressure(dataset: xr.Dataset | Result, *, log_pv: bool = False, ax: Axes | None = None) -> Axes:
    """Draw pressure over crank angle, with heat release and motoring where known; or over volume, both logarithmic.

    Parameters
    ----------
    dataset : xarray.Dataset or Result
        ``pressure_bar(crank_angle_cad)`` [bar, °CA aTDC] of a measured trace, of `mgdd.engine.simulate` or of
        `mgdd.engine.analyze`; of a record of cycles the mean is drawn over the cloud of the single ones, with the band
        from their 5th to their 95th percentile. Heat release rates [J/°CA] go to a twin axis, with CA10, CA50 and CA90
        on the first of them, ``motored_pressure_bar`` is dashed.
    log_pv : bool
        Over ``volume_l`` [L] instead, which `mgdd.engine.analyze` and `mgdd.engine.simulate` give, on logarithmic axes.
        ``n_compression`` and ``n_expansion`` [-], where present, are drawn as lines through the mean of their windows
        (-100 to -40 and 60 to 120 °CA aTDC).
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The pressure axes.

    Raises
    ------
    DataError
        No ``pressure_bar``, or a variable without unit; over volume a pressure that is not positive (a trace before
        pegging).

    Examples
    --------
    >>> from mgdd import datasets, plot
    >>> from mgdd.engine import simulate
    >>> ax = plot.pressure(datasets.read("hd_diesel_128x144")[0])
    >>> ax.get_xlabel()
    'crank angle [°CA aTDC]'
    >>> plot.pressure(simulate("puma_single"), log_pv=True).get_xlabel()
    'cylinder volume [L]'
    """
    if log_pv:
        return _log_pv(dataset, ax)
    optional, made_by = ("motored_pressure_bar", *_RATES, *_ANGLES), "mgdd.io.read_pressure or mgdd.engine.simulate"
    dataset = require("dataset", dataset, (ANGLE, "pressure_bar"), made_by, optional)
    rates = [name for name in _RATES if name in dataset]
    ax = new_axes(ax)
    lines: list[Line2D] = cloud(ax, dataset) if CYCLE in dataset["pressure_bar"].dims else []
    dataset = _mean(dataset)
    angle = dataset[ANGLE].to_numpy()
    lines += ax.plot(angle, dataset["pressure_bar"], "-", color=BLACK, label=_name(dataset))
    if "motored_pressure_bar" in dataset:
        motored = dataset["motored_pressure_bar"]
        lines += ax.plot(angle, motored, "--", color=GREY, label=label_of(motored).long_name)
    ax.set_xlim(float(angle[0]), float(angle[-1]))
    if rates:
        twin = ax.twinx()
        for name in rates:
            dash, color = _RATES[name]
            label = label_of(dataset[name]).long_name
            lines += twin.plot(angle, dataset[name], dash, color=color, linewidth=1.2, label=label)
        if all(name in dataset and np.isfinite(dataset[name]) for name in _ANGLES):
            burn = np.array([float(dataset[name]) for name in _ANGLES])
            text = minus(f"CA10, CA50, CA90: {burn[0]:.1f}, {burn[1]:.1f}, {burn[2]:.1f} °CA")
            lines += twin.plot(
                burn, np.interp(burn, angle, dataset[rates[0]]), "o", color=ORANGE, markersize=4, label=text
            )
        twin.set_ylabel(axis_label(dataset, rates[0]) if len(rates) == 1 else "heat release rate [J/°CA]")
    return finished(ax, dataset, ANGLE, "pressure_bar", lines, grid=False)


def _log_pv(dataset: xr.Dataset | Result, ax: Axes | None) -> Axes:
    """Draw pressure over volume on logarithmic axes, with the fitted polytropic slopes."""
    needed = (ANGLE, "pressure_bar", "volume_l")
    dataset = _mean(require("dataset", dataset, needed, "mgdd.engine.analyze or mgdd.engine.simulate"))
    angle = dataset[ANGLE].to_numpy()
    bar = dataset["pressure_bar"].to_numpy()
    litre = dataset["volume_l"].to_numpy()
    if not np.all(bar > 0.0):
        index = int(np.argmin(bar > 0.0))
        raise DataError(
            f"pressure_bar = {bar[index]:g} at {angle[index]:g} °CA aTDC: a logarithm needs > 0; "
            "peg the trace first with mgdd.engine.analyze"
        )
    ax = new_axes(ax, height=4.4)
    lines: list[Line2D] = ax.plot(litre, bar, "-", color=BLACK, linewidth=1.2, label=_name(dataset))
    for name, (low, high) in _WINDOWS.items():
        window = (angle >= low) & (angle <= high)
        if name not in dataset or not np.isfinite(dataset[name]) or np.count_nonzero(window) < 2:
            continue
        exponent = float(dataset[name])
        constant = np.exp(np.mean(np.log(bar[window]) + exponent * np.log(litre[window])))
        ends = np.array([litre[window].min(), litre[window].max()])
        dash, color = _SLOPE_STYLES[name]
        label = minus(f"{name.removeprefix('n_')} n = {exponent:.3f} ({low:g} to {high:g} °CA aTDC)")
        lines += ax.plot(ends, constant * ends**-exponent, dash, color=color, linewidth=2.4, label=label)
    ax.set(xscale="log", yscale="log")
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())
    return finished(ax, dataset, "volume_l", "pressure_bar", lines, columns=1, grid=False)


def _mean(dataset: xr.Dataset) -> xr.Dataset:
    """Give the mean cycle of a record, its exponents those of the averaged pressure."""
    if CYCLE not in dataset["pressure_bar"].dims:
        return dataset
    averaged = {name: dataset[f"cycle_mean_{name}"] for name in _WINDOWS if f"cycle_mean_{name}" in dataset}
    return dataset.mean(CYCLE, keep_attrs=True).assign(averaged)


def _name(dataset: xr.Dataset) -> str:
    """Return the legend entry of the pressure: with the trace's name where it has one."""
    file = dataset.attrs.get("file")
    long_name = label_of(dataset["pressure_bar"]).long_name
    return f"{long_name}, {file}" if file else long_name
