"""Doubts of a record of many cycles: slips, levels, gas exchange, a soft maximum, top dead centre."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd.engine.dead_centre import motored_tdc
from mgdd.engine.doubts import copy_doubts, top_of
from mgdd.engine.trace import conditions
from mgdd.io.cycle_phase import lost_turn, phase_warnings, phases
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd._core.engine import Cylinder, OperatingPoint

_COARSE_CAD = 2.5
# A soft saturation is distinguished from a burn by spark alone, and by so many cycles; a shift of a degree matters.
_SPARK_RATIO, _SOFT_CYCLES, _WANTED_CAD = 14.0, 10, 1.0
# Level of a cycle [bar]: off the median by more than this and six robust deviations, or drifting from first to last.
_OFF_BAR, _OFF_SCATTERS, _DRIFT_BAR, _DRIFT_STDERRS = 0.1, 6.0, 0.1, 5.0
# Over gas exchange: absolute pressures and pumping work that engines have, and the step at intake bottom dead centre.
_EXCHANGE_BAR, _PMEP_BAR, _STEP = (0.15, 8.0), (-3.0, 1.5), (0.6, 1.7)


def record_doubts(
    trace: xr.Dataset, figures: xr.Dataset, engine: Cylinder, point: OperatingPoint | None
) -> list[tuple[str, str]]:
    """Give the doubts of a record beyond those of its analysis, each as its kind and its text."""
    doubts = copy_doubts(*_columns(trace)) + _slips(trace) + _of_levels(trace, figures) + _of_exchange(trace, figures)
    return doubts + _of_soft_top(trace, figures, engine) + _of_tdc(trace, figures, engine, point)


def _of_soft_top(trace: xr.Dataset, figures: xr.Dataset, engine: Cylinder) -> list[tuple[str, str]]:
    """Doubt a gain that falls off towards the peak, where burns of one form would show it."""
    angle, bar = _columns(trace)
    if engine.compression_ratio >= _SPARK_RATIO or int(figures.attrs["motored"]):
        return []
    top = top_of(angle, bar, 0.0)
    if not top.soft:
        return []
    text = (
        f"3 % below the top the cycles have {top.soft_ratio:.2f} of the width at 12 %, where a burn by spark has 0.48"
    )
    return [("soft", f"{text}: a gain that falls off towards the peak; peak, work and heat are low")]


def _of_tdc(
    trace: xr.Dataset, figures: xr.Dataset, engine: Cylinder, point: OperatingPoint | None
) -> list[tuple[str, str]]:
    """Place TDC of a motored record by its mean cycle."""
    angle, bar = _columns(trace)
    if int(figures.attrs["motored"]) < len(bar) or np.median(np.diff(angle)) > _COARSE_CAD:
        return []
    mean = bar.mean(axis=0) + float(np.mean(figures["pegging_bar"]))
    closed = (angle >= engine.ivc_cad) & (angle <= engine.evo_cad)
    doubts = motored_tdc(angle[closed], mean[closed], engine, conditions(trace, point)).doubts()
    return [("strokes", "; ".join(doubts))] if doubts else []


def _columns(trace: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    bar = trace["pressure_bar"]
    return trace[ANGLE].to_numpy(), np.atleast_2d(bar.transpose(..., ANGLE).to_numpy())


def _slips(trace: xr.Dataset) -> list[tuple[str, str]]:
    angle, bar = _columns(trace)
    kind = "slip" if lost_turn(angle, bar) is None else "turn"
    return [(kind, text) for text in phase_warnings(angle, bar, over_time=False, source="trace")]


def hidden(trace: xr.Dataset, figures: xr.Dataset, engine: Cylinder) -> dict[str, tuple[str, str]]:
    """Report by check what faults these data would not show, and the size below which they stay hidden."""
    angle, bar = _columns(trace)
    step = float(np.median(np.diff(angle)))
    limits = {}
    if int(figures.attrs["motored"]) < len(bar):
        text = figures.attrs["open"] or "a fired trace hardly shows an error of TDC"
        limits["top dead centre"] = (text, "mgdd.identify.estimate_tdc scans it; a motored record shows it")
        if engine.compression_ratio >= _SPARK_RATIO or len(bar) < _SOFT_CYCLES:
            text = "a gain that falls off above 0.7 of the peak looks like another burn"
            few = "10 fired cycles or more" if engine.compression_ratio < _SPARK_RATIO else "a dead-weight calibration"
            limits["amplifier"] = (text, f"{few} would show it")
    placed = phases(angle, bar)
    if placed is None:
        if len(bar) > 1:
            limits["crank angle"] = ("compression before the burn is too short to place the cycles", "")
    elif placed.visible_cad > min(step, _WANTED_CAD):
        lost = int(placed.visible_cad / step)
        text = (
            f"a cycle that lies less than {placed.visible_cad:.2g} °CA off, {max(lost, 1)} lost sample(s), is not seen"
        )
        limits["crank angle"] = (text, "")
    return limits


def _of_levels(trace: xr.Dataset, figures: xr.Dataset) -> list[tuple[str, str]]:
    """Compare the cycles' levels early in compression with each other, pegged as they were analysed."""
    angle, bar = _columns(trace)
    if len(bar) < 4:
        return []
    start = max(float(angle[0]), -150.0)
    early = (angle >= start - 1e-9) & (angle <= start + 20.0)
    level = bar[:, early].mean(axis=1) + np.atleast_1d(figures["pegging_bar"].to_numpy())
    off = level - np.median(level)
    usual = 1.4826 * float(np.median(np.abs(off)))
    doubts = []
    odd = np.flatnonzero(np.abs(off) > max(_OFF_BAR, _OFF_SCATTERS * usual))
    if odd.size and odd.size < 0.2 * len(bar):
        worst = int(odd[np.argmax(np.abs(off[odd]))])
        text = f"{odd.size} of {len(bar)} cycles start at another level: cycle {worst + 1} by {off[worst]:+.2g} bar"
        doubts.append(("odd_level", text))
    count = np.arange(len(bar)) - 0.5 * (len(bar) - 1)
    slope = float(count @ off / (count @ count))
    rest = off - off.mean() - slope * count
    stderr = math.sqrt(float(rest @ rest) / max(len(bar) - 2, 1) / float(count @ count))
    drift = slope * (len(bar) - 1)
    if abs(drift) > max(_DRIFT_BAR, _DRIFT_STDERRS * stderr * (len(bar) - 1)):
        doubts.append(("drift", f"the level moves by {drift:+.2g} bar from cycle 1 to cycle {len(bar)}"))
    return doubts


def _of_exchange(trace: xr.Dataset, figures: xr.Dataset) -> list[tuple[str, str]]:
    """Judge levels and work between the valves' events, of records of 720 degrees."""
    if not np.isfinite(figures["imep_net_bar"]).all():
        return []
    angle, bar = _columns(trace)
    mean = bar.mean(axis=0) + float(np.mean(figures["pegging_bar"]))

    def level(low: float, high: float) -> float:
        return float(mean[(angle >= low) & (angle <= high)].mean())

    intake, exhaust, end = level(-300.0, -200.0), level(220.0, 300.0), level(-190.0, -170.0)
    doubts = []
    for text, value in (("intake", intake), ("exhaust", exhaust)):
        if not _EXCHANGE_BAR[0] < value < _EXCHANGE_BAR[1]:
            doubts.append(("exchange", f"the mean pressure of the {text} stroke is {value:.3g} bar"))
    pmep = float(np.mean(figures["pmep_bar"]))
    if not _PMEP_BAR[0] < pmep < _PMEP_BAR[1]:
        doubts.append(("exchange", f"the gas exchange has a mean pressure of {pmep:.3g} bar"))
    if not doubts and not _STEP[0] < end / intake < _STEP[1]:
        doubts.append(("exchange", f"the intake stroke runs at {intake:.3g} bar and ends at {end:.3g} bar"))
    return doubts
