"""Tables of the documentation that the measured heavy-duty traces give: fits, best timings and analysis."""

from __future__ import annotations

from functools import cache
from typing import Any

from tables_of_model import Rows, values_of

from mgdd import datasets, presets
from mgdd.engine import Cylinder, analyze
from mgdd.identify import best_timing, wall_heat_profile
from mgdd.identify.engine.calibration import compare_laws
from mgdd.identify.engine.records import CylinderFit
from mgdd.identify.engine.timing_records import BestTiming

__all__ = ["burn_laws", "fits", "members", "profile", "timing", "traces"]

LAW_NAMES = {
    ("triangle", "constant"): "triangle, 1.37",
    ("wiebe", "constant"): "Wiebe, 1.37",
    ("triangle", "linear"): "triangle, linear",
    ("wiebe", "linear"): "Wiebe, linear",
    ("double_wiebe", "constant"): "double Wiebe, 1.37",
}
_LOADS = ("25 %", "50 %", "75 %", "100 %")


@cache
def measured() -> tuple[list[Any], Cylinder]:
    return datasets.read("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder


@cache
def fits() -> dict[tuple[str, str], CylinderFit]:
    return dict(zip(LAW_NAMES, compare_laws(*measured(), laws=tuple(LAW_NAMES)), strict=True))


@cache
def ranges() -> list[BestTiming]:
    return best_timing(*measured())


def burn_laws() -> Rows:
    names = ("rmse_percent", "imep_closed_error_percent", "onset_against_soi_cad", "largest_error_bar")
    return {
        LAW_NAMES[law]: [*(getattr(own, name) for name in names for own in fit.loads), fit.model.wall_heat_scale]
        for law, fit in fits().items()
    }


def profile() -> Rows:
    rows = {}
    for law, label in {
        ("wiebe", "linear"): r"Wiebe, linear $\gamma$",
        ("double_wiebe", "constant"): r"double Wiebe, $\gamma$ 1.37",
    }.items():
        own = wall_heat_profile(fits()[law])
        moves = [end for name in ("gamma", "pegging_bar", "tdc_cad") for end in sorted(own.moved[name])]
        rows[label] = [own.value, own.correlation, own.range_low, own.range_high, *moves]
    return rows


def timing() -> Rows:
    """Best CA50, move and gain of the headline with their ranges, under the own peak pressure and without limit."""
    own = ("ca50_cad", "shift_cad", "gain_percent")
    names = (*own, *(f"free_{name}" for name in own))
    return {
        load: [value for name in names for value in (getattr(row.best, name), *getattr(row, name))]
        for load, row in zip(_LOADS, ranges(), strict=True)
    }


def members() -> Rows:
    """Set the plausible members side by side: RMSE and best CA50 of each load, and the span of the efficiencies."""
    rows: dict[str, list[float]] = {}
    for at, answer in enumerate(ranges()[0].members):
        own = [row.members[at] for row in ranges()]
        if all(one.plausible for one in own):
            eta = [one.efficiency_gross for one in own]
            values = [one.rmse_percent for one in own] + [one.free_ca50_cad for one in own]
            name = answer.member.name.removeprefix("double_wiebe, ").removesuffix(" (gamma fitted)")
            rows[name] = [*values, min(eta), max(eta)]
    return rows


def traces() -> Rows:
    loaded, cylinder = measured()
    names = ("p_max_bar", "ca50_cad", "heat_net_j", "imep_closed_bar", "n_compression", "n_expansion")
    return {load: values_of(analyze(trace, cylinder), *names) for load, trace in zip(_LOADS, loaded, strict=True)}
