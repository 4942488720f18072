"""What the cycles of a record say against each other and over the whole cycle: slips, levels, gas exchange, TDC."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd.engine.dead_centre import motored_tdc
from mgdd.engine.trace import conditions
from mgdd.io.cycle_phase import phase_warnings
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd._core.engine import Cylinder, OperatingPoint

__all__ = ["record_doubts"]

_COARSE_CAD = 2.5
# Level of a cycle [bar]: off the median by more than this and six robust deviations, or drifting from first to last.
_OFF_BAR, _OFF_SCATTERS, _DRIFT_BAR, _DRIFT_STDERRS = 0.1, 6.0, 0.1, 5.0
# Over gas exchange: absolute pressures and pumping work that engines have, and the step at intake bottom dead centre.
_EXCHANGE_BAR, _PMEP_BAR, _STEP = (0.15, 8.0), (-3.0, 1.5), (0.6, 1.7)


def record_doubts(
    trace: xr.Dataset, found: xr.Dataset, engine: Cylinder, point: OperatingPoint | None
) -> list[tuple[str, str]]:
    """Give the doubts of a record beyond those of its analysis, each as its kind and its text."""
    said = _slips(trace) + _of_levels(trace, found) + _of_exchange(trace, found)
    return said + _of_tdc(trace, found, engine, point)


def _of_tdc(
    trace: xr.Dataset, found: xr.Dataset, engine: Cylinder, point: OperatingPoint | None
) -> list[tuple[str, str]]:
    """Place TDC of a motored record by its mean cycle."""
    angle, bar = _columns(trace)
    if int(found.attrs["motored"]) < len(bar) or np.median(np.diff(angle)) > _COARSE_CAD:
        return []
    mean = bar.mean(axis=0) + float(np.mean(found["pegging_bar"]))
    closed = (angle >= engine.ivc_cad) & (angle <= engine.evo_cad)
    doubts = motored_tdc(angle[closed], mean[closed], engine, conditions(trace, point)).doubts()
    return [("strokes", "; ".join(doubts))] if doubts else []


def _columns(trace: xr.Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    bar = trace["pressure_bar"]
    return trace[ANGLE].to_numpy(), np.atleast_2d(bar.transpose(..., ANGLE).to_numpy())


def _slips(trace: xr.Dataset) -> list[tuple[str, str]]:
    angle, bar = _columns(trace)
    return [("slip", text) for text in phase_warnings(angle, bar, over_time=False, source="trace")]


def _of_levels(trace: xr.Dataset, found: xr.Dataset) -> list[tuple[str, str]]:
    """Compare the cycles' levels early in compression with each other, pegged as they were analysed."""
    angle, bar = _columns(trace)
    if len(bar) < 4:
        return []
    start = max(float(angle[0]), -150.0)
    early = (angle >= start - 1e-9) & (angle <= start + 20.0)
    level = bar[:, early].mean(axis=1) + np.atleast_1d(found["pegging_bar"].to_numpy())
    off = level - np.median(level)
    usual = 1.4826 * float(np.median(np.abs(off)))
    out = []
    odd = np.flatnonzero(np.abs(off) > max(_OFF_BAR, _OFF_SCATTERS * usual))
    if odd.size and odd.size < 0.2 * len(bar):
        worst = int(odd[np.argmax(np.abs(off[odd]))])
        text = f"{odd.size} of {len(bar)} cycles start at another level: cycle {worst + 1} by {off[worst]:+.2g} bar"
        out.append(("odd_level", text))
    count = np.arange(len(bar)) - 0.5 * (len(bar) - 1)
    slope = float(count @ off / (count @ count))
    rest = off - off.mean() - slope * count
    stderr = math.sqrt(float(rest @ rest) / max(len(bar) - 2, 1) / float(count @ count))
    drift = slope * (len(bar) - 1)
    if abs(drift) > max(_DRIFT_BAR, _DRIFT_STDERRS * stderr * (len(bar) - 1)):
        out.append(("drift", f"the level moves by {drift:+.2g} bar from cycle 1 to cycle {len(bar)}"))
    return out


def _of_exchange(trace: xr.Dataset, found: xr.Dataset) -> list[tuple[str, str]]:
    """Judge levels and work between the valves' events, of records of 720 degrees."""
    if not np.isfinite(found["imep_net_bar"]).all():
        return []
    angle, bar = _columns(trace)
    mean = bar.mean(axis=0) + float(np.mean(found["pegging_bar"]))

    def level(low: float, high: float) -> float:
        return float(mean[(angle >= low) & (angle <= high)].mean())

    intake, exhaust, end = level(-300.0, -200.0), level(220.0, 300.0), level(-190.0, -170.0)
    out = []
    for text, value in (("intake", intake), ("exhaust", exhaust)):
        if not _EXCHANGE_BAR[0] < value < _EXCHANGE_BAR[1]:
            out.append(("exchange", f"the mean pressure of the {text} stroke is {value:.3g} bar"))
    pmep = float(np.mean(found["pmep_bar"]))
    if not _PMEP_BAR[0] < pmep < _PMEP_BAR[1]:
        out.append(("exchange", f"the gas exchange has a mean pressure of {pmep:.3g} bar"))
    if not out and not _STEP[0] < end / intake < _STEP[1]:
        out.append(("exchange", f"the intake stroke runs at {intake:.3g} bar and ends at {end:.3g} bar"))
    return out
