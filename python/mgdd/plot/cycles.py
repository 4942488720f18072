"""Cycles: one over its angle and as log p over log V; many as a cloud, one by one, as a map, and their spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError
from mgdd.plot.style import (
    BLACK,
    BLUE,
    COLOURS,
    GREY,
    ORANGE,
    axis_label,
    beside,
    finished,
    legend,
    minus,
    new_axes,
    require,
)
from mgdd.results.labels import ANGLE, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
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


CYCLE = "cycle"
_LINES = 60  # of a cloud; the band shows the rest
_MARKS = {"misfire": ("x", ORANGE), "partial_burn": ("+", BLUE)}
_FREQUENCY = "frequency_khz"
_RINGING, _MODE = "ringing_frequency_khz", "tangential_mode_khz"
_BURN = (-40.0, 100.0)  # °CA aTDC of a map; the cycles do not differ elsewhere


def cloud(ax: Axes, dataset: xr.Dataset) -> list[Line2D]:
    """Draw single pressures in grey, the band from the 5th to the 95th percentile, and return what the legend names."""
    angle, bar = dataset[ANGLE].to_numpy(), dataset["pressure_bar"].transpose(CYCLE, ANGLE).to_numpy()
    shown = bar[:: max(1, len(bar) // _LINES)]
    ax.plot(angle, shown.T, color=GREY, linewidth=0.4, alpha=0.4)
    low, high = np.percentile(bar, (5.0, 95.0), axis=0)
    band = ax.fill_between(angle, low, high, color=BLUE, alpha=0.25, linewidth=0.0)
    band.set_label(f"5th to 95th percentile of {len(bar)} cycles")
    return [band]  # type: ignore[list-item]


def cycles(dataset: xr.Dataset | Result, figure: str = "imep_gross_bar", *, ax: Axes | None = None) -> Axes:
    """Draw a figure of a record from cycle to cycle, with histogram and return map; or its traces, or their spectrum.

    Parameters
    ----------
    dataset : xarray.Dataset or Result
        Of `mgdd.engine.analyze` or `mgdd.engine.Indicating`. Misfires and partial burns are marked.
    figure : str
        What is drawn: a figure over ``cycle`` from cycle to cycle, beside it its histogram and each value over the one
        before; a trace over ``cycle`` and ``crank_angle_cad`` as colours, of ``pressure_bar`` what it differs from the
        mean cycle; ``pressure_psd_bar2_per_khz`` as mean and band of the cycles, with the knock band, the frequency
        of ringing and the first tangential mode.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes; histogram and return map, or the colour bar, stand beside it.

    Raises
    ------
    DataError
        No such figure, not over ``cycle`` alone or with angle or frequency, or none of its values is a number.

    Examples
    --------
    >>> from mgdd import plot
    >>> from mgdd.engine import Indicating, simulate
    >>> runs = [simulate("puma_single", {"fuel_mg": mg}, soc_cad=-5.0) for mg in (20.0, 19.6, 20.7)]
    >>> indicating = Indicating("puma_single", runs[0]["crank_angle_cad"], speed_rpm=1500.0)
    >>> ax = plot.cycles(indicating.record([run["pressure_bar"] for run in runs]), "ca50_cad")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('engine cycle', 'CA50, angle of 50 % heat released [°CA aTDC]')
    """
    made_by = "mgdd.engine.analyze or Indicating.record"
    dataset = require("dataset", dataset, (CYCLE, figure), made_by, (*_MARKS, _RINGING, _MODE))
    if set(dataset[figure].dims) == {CYCLE, ANGLE}:
        return _map(dataset, figure, new_axes(ax, height=4.4))
    if set(dataset[figure].dims) == {CYCLE, _FREQUENCY}:
        return _spectrum(dataset, figure, new_axes(ax))
    if dataset[figure].dims != (CYCLE,):
        over = ", ".join(map(str, dataset[figure].dims)) or "nothing"
        alone = f"over {CYCLE} alone, or with {ANGLE} or {_FREQUENCY}"
        raise DataError(f"{figure} is over {over}: a figure {alone} is drawn; of several cylinders take one")
    cycle, values = dataset[CYCLE].to_numpy(), dataset[figure].to_numpy()
    finite = values[np.isfinite(values)]
    if not finite.size:
        raise DataError(f"{figure}: none of the {values.size} cycles has this figure")
    ax, side, after = beside(new_axes(ax), (5.0, 1.0, 3.0))
    mean = float(finite.mean())
    lines: list[Line2D] = ax.plot(cycle, values, ".", color=BLACK, markersize=3, label=f"mean {mean:.4g}")
    ax.axhline(mean, color=BLACK, linewidth=0.8)
    for edge in np.percentile(finite, (5.0, 95.0)):
        line = ax.axhline(float(edge), color=BLUE, linewidth=0.9, linestyle="--", label="5th and 95th percentile")
    lines.append(line)
    for name, (marker, color) in _MARKS.items():
        if name in dataset and (at := dataset[name].to_numpy().astype(bool)).any():
            label = f"{label_of(dataset[name]).long_name}: {np.count_nonzero(at)} cycles"
            there = np.where(np.isfinite(values[at]), values[at], finite.min())
            lines += ax.plot(cycle[at], there, marker, color=color, label=label)
    side.hist(finite, bins=min(40, max(5, int(np.sqrt(finite.size)))), orientation="horizontal", color=GREY)
    side.set(xlabel="cycles")
    side.sharey(ax)
    side.tick_params(labelleft=False)
    after.plot(values[:-1], values[1:], ".", color=BLACK, markersize=3)
    after.set(xlabel="one cycle", ylabel="the next one")
    after.grid(alpha=0.3)
    ax.set(xlabel="engine cycle", ylabel=axis_label(dataset, figure))
    ax.grid(alpha=0.3)
    legend(ax, lines, columns=1)
    return ax


def _map(dataset: xr.Dataset, figure: str, ax: Axes) -> Axes:
    """Draw a trace of every cycle as a row of colours; of pressure what it differs from the mean cycle."""
    angle, cycle = dataset[ANGLE].to_numpy(), dataset[CYCLE].to_numpy()
    rows = dataset[figure].transpose(CYCLE, ANGLE).to_numpy()
    label = label_of(dataset[figure])
    name = label.long_name
    if figure == "pressure_bar":
        rows, name = rows - rows.mean(axis=0), f"{name} less its mean"
    shown = (angle >= _BURN[0]) & (angle <= _BURN[1])
    shown = shown if np.count_nonzero(shown) > 1 else np.full(angle.size, True)
    rows, angle = rows[:, shown], angle[shown]
    if not np.isfinite(rows).any():
        raise DataError(f"{figure}: none of the {cycle.size} cycles has this trace between these angles")
    low, high = np.nanpercentile(rows, (0.5, 99.5))
    if figure == "pressure_bar":
        low, high = min(low, -high), max(high, -low)  # zero in the middle
    drawn = ax.pcolormesh(angle, cycle, rows, cmap=COLOURS, vmin=low, vmax=high, shading="nearest", rasterized=True)
    bar = ax.figure.colorbar(drawn, ax=ax, extend="both")
    bar.set_label(f"{name} [{label.units}]")
    lines: list[Artist] = []
    for mark, (marker, color) in _MARKS.items():
        if mark in dataset and (at := dataset[mark].to_numpy().astype(bool)).any():
            text = f"{label_of(dataset[mark]).long_name}: {np.count_nonzero(at)} cycles"
            there = np.full(np.count_nonzero(at), angle[-1])
            lines += ax.plot(there, cycle[at], marker, color=color, clip_on=False, label=text)
    ax.set(xlabel=axis_label(dataset, ANGLE), ylabel="engine cycle")
    if lines:
        legend(ax, lines)
    return ax


def _spectrum(dataset: xr.Dataset, figure: str, ax: Axes) -> Axes:
    """Draw mean and band of the cycles' spectra, with the band, the frequency and the mode that belong to them."""
    khz, density = dataset[_FREQUENCY].to_numpy(), dataset[figure].transpose(CYCLE, _FREQUENCY).to_numpy()
    low, high = np.percentile(density, (5.0, 95.0), axis=0)
    mean = density.mean(axis=0)
    cloud = ax.fill_between(khz, low, high, color=BLUE, alpha=0.25, linewidth=0.0, label="5th to 95th percentile")
    lines: list[Artist] = [*ax.plot(khz, mean, "-", color=BLACK, linewidth=1.2, label=f"mean of {len(density)} cycles")]
    lines.append(cloud)
    for edge in dataset.attrs.get("knock_band_hz", ()):
        ends = ax.axvline(1e-3 * edge, color=GREY, linewidth=1.0, linestyle="--", label="ends of the knock band")
        lines[2:] = [ends]
    at = {name: float(dataset[name]) for name in (_RINGING, _MODE) if name in dataset and np.isfinite(dataset[name])}
    text = {name: f"{label_of(dataset[name]).long_name}: {where:.2f} kHz" for name, where in at.items()}
    if _MODE in at:
        lines.append(ax.axvline(at[_MODE], color=ORANGE, linewidth=1.2, linestyle="-.", label=text[_MODE]))
    if _RINGING in at:
        top = float(np.interp(at[_RINGING], khz, mean))
        lines += ax.plot(at[_RINGING], top, "v", color=BLACK, markersize=7, label=text[_RINGING])
    ax.set(yscale="log", xlim=(float(khz[0]), float(khz[-1])))
    return finished(ax, dataset, _FREQUENCY, figure, lines)
