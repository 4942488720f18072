"""A page of pressure files: for each its checks, the table of its figures, and what its cycles look like."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mgdd import plot
from mgdd.plot.style import drawn
from mgdd.report.report import Section, Table, as_number
from mgdd.results.labels import ANGLE, label_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mgdd.engine import PressureCheck

DRAWN_CYCLES = 400  # of a longer record every second, third, ... one: a picture has no more rows
_SPECTRUM = "pressure_psd_bar2_per_khz"
_STATISTICS = {
    "mean": ("mean_", ""), "standard deviation": ("std_", ""), "COV [%]": ("cov_", "_percent"),
    "5th percentile": ("p5_", ""), "95th percentile": ("p95_", ""), "averaged cycle": ("cycle_mean_", ""),
}  # fmt: skip
_SIZE, _TALL, _WIDE = (6.6, 3.8), (6.6, 4.4), (8.4, 4.2)
_BURN = (-40.0, 100.0)  # °CA aTDC


def record_section(report: PressureCheck, figures: xr.Dataset | None, traces: xr.Dataset | None = None) -> Section:
    """Make the section of one file: checks as a list, and of an analysed file text, table and figures.

    `traces` are perhaps of fewer cycles than `figures`, which are None where `analyze` refused the file.
    """
    passed = [check.name for check in report.checks if check.verdict == "no fault found"]
    rest = sorted((check for check in report.checks if check.verdict != "no fault found"), key=_urgency)
    items = [f"{check.name}: {check}" for check in rest]
    if passed:
        items.append(f"no fault found: {', '.join(passed)}")
    title = report.title
    if figures is None:
        return Section(title=title, items=tuple(items))
    drawn_from = figures if traces is None else traces
    return Section(
        title=title,
        text=tuple(_text(figures, drawn_from)),
        items=tuple(items),
        table=figures_table(figures),
        figures=dict(_figures(figures, drawn_from)),
    )


def _urgency(check: object) -> int:
    return ("fail", "doubt", "open").index(check.verdict)  # type: ignore[attr-defined]


def _text(figures: xr.Dataset, traces: xr.Dataset) -> Iterator[str]:
    """State how the figures were made, and what is not in the table."""
    attrs = figures.attrs
    cycles = attrs.get("cycles", 1)
    yield (
        f"{cycles} cycle{'s' if cycles != 1 else ''}, {attrs['motored']} motored. Pegging: {attrs['method']}; gamma of "
        f"the heat release: {attrs['gamma']}; smoothing: {attrs['smoothing']}; heat window: {attrs['heat_window']}."
    )
    if "cycle" not in traces.dims:
        return
    if traces.sizes["cycle"] < cycles:
        yield f"Clouds, maps and spectrum show {traces.sizes['cycle']} cycles, evenly over the record."
    low, high = (1e-3 * edge for edge in attrs["knock_band_hz"])
    at = float(figures["ringing_frequency_khz"])
    ringing = f"The pressure rings at {at:.2f} kHz" if at == at else "No frequency stands out of the pressure"
    mode = float(figures["tangential_mode_khz"])
    knock = ""
    if "knock_share_percent" in figures:
        knock = f" {as_number(float(figures['knock_share_percent']))} % of the cycles knock."
    yield f"{ringing} between {low:g} and {high:g} kHz; the first tangential mode of the bore is {mode:.2f} kHz.{knock}"


def figures_table(figures: xr.Dataset, *, by_name: bool = False) -> Table:
    """Set out every figure, by what it is or by its name: of a record mean, scatter and percentiles."""
    if "cycles" not in figures.attrs:
        single = [(name, v) for name, v in figures.data_vars.items() if v.ndim == 0 and np.isfinite(v)]
        rows = [(label_of(v).long_name, as_number(float(v)), label_of(v).units) for _, v in single]
        return Table(columns=("figure", "value", "unit"), rows=tuple(rows))
    names = [str(name).removeprefix("cycle_mean_") for name in figures if str(name).startswith("cycle_mean_")]
    table = []
    for name in names:
        statistics = (figures.get(f"{before}{name}{after}") for before, after in _STATISTICS.values())
        cells = ["–" if value is None else as_number(float(value)) for value in statistics]
        if any(cell != "–" for cell in cells):
            label = label_of(figures[name])
            table.append((name if by_name else label.long_name, *cells, label.units))
    return Table(columns=("figure", *_STATISTICS, "unit"), rows=tuple(table))


def _figures(figures: xr.Dataset, traces: xr.Dataset) -> Iterator[tuple[str, Figure]]:
    yield "Pressure", drawn(plot.pressure, traces[["pressure_bar"]].assign_attrs(file=""), size=_SIZE)
    yield "Pressure over volume, both logarithmic", drawn(partial(plot.pressure, log_pv=True), traces, size=_TALL)
    yield "Heat release with burn angles", drawn(_burn, traces, size=_SIZE)
    if "cycle" not in traces.dims:
        return
    work = next(name for name in ("imep_net_bar", "imep_gross_bar", "imep_closed_bar") if _has_number(figures, name))
    for name in (work, "ca50_cad", "p_max_bar", "mapo_bar"):
        if _has_number(figures, name):
            caption = f"{label_of(figures[name]).long_name}: from cycle to cycle, histogram, return map"
            yield caption, drawn(plot.cycles, figures, size=_WIDE, figure=name)
    if _SPECTRUM in traces:
        yield "Spectrum of the pressure in the knock window", drawn(plot.cycles, traces, size=_SIZE, figure=_SPECTRUM)
    yield "Pressure less the mean cycle", drawn(plot.cycles, traces, size=_TALL, figure="pressure_bar")
    heat = "heat_release_net_j_per_cad"
    yield "Net heat release of every cycle", drawn(plot.cycles, traces, size=_TALL, figure=heat)


def _has_number(figures: xr.Dataset, name: str) -> bool:
    return bool(np.isfinite(figures[name]).any())


def _burn(traces: xr.Dataset, *, ax: Axes) -> Axes:
    """Draw pressure and heat release where the burn is."""
    angle = traces[ANGLE].to_numpy()
    ax = plot.pressure(traces.assign_attrs(file=""), ax=ax)
    ax.set_xlim(max(_BURN[0], angle[0]), min(_BURN[1], angle[-1]))
    return ax
