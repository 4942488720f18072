"""Analysis of a record of cycles: every cycle, the scatter of the figures, and the averaged cycle."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.results.labels import ANGLE, VARIABLES, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["is_of_cycles", "of_cycles"]

_CYCLE = "cycle"
_OFFSETS = ("pegging_bar", "compression_offset_bar")
_COLUMNS = (
    "pressure_bar",
    "temperature_k",
    "heat_release_net_j_per_cad",
    "heat_release_gross_j_per_cad",
    "heat_loss_j_per_cad",
    "heat_net_cumulative_j",
    "heat_gross_cumulative_j",
)


def is_of_cycles(trace: Any) -> bool:
    """Whether this is a Dataset whose pressure has the dimensions cycle and crank angle."""
    variables = getattr(trace, "variables", {})
    return "pressure_bar" in variables and set(variables["pressure_bar"].dims) == {_CYCLE, ANGLE}


def of_cycles(
    trace: xr.Dataset,
    cylinder: Cylinder,
    point: OperatingPoint,
    options: _core.engine.TraceOptions,
    attrs: dict[str, Any],
    given: str | None,
) -> xr.Dataset:
    """Analyse every cycle, and the cycle of their mean pressure; what varies has a mean, a deviation and a COV."""
    pressure = trace["pressure_bar"].transpose(_CYCLE, ANGLE).to_numpy()
    raw = _core.engine.analyze_cycles(trace[ANGLE].values, pressure, cylinder, point, options)
    mean = _core.engine.analyze(trace[ANGLE].values, pressure.mean(axis=0), cylinder, point, options)
    found = sum(raw["window_found"])
    n = len(pressure)
    lines = [*raw["warnings"], *(f"mean of {n} cycles: {text}" for text in mean["warnings"])]
    return labelled_dataset(
        {
            ANGLE: (ANGLE, raw[ANGLE]),
            _CYCLE: (_CYCLE, trace[_CYCLE].values if _CYCLE in trace.coords else np.arange(1, n + 1)),
            "volume_l": (ANGLE, raw["volume_l"]),
            **{name: ((_CYCLE, ANGLE), raw[name]) for name in _COLUMNS},
            **{name: (_CYCLE, values) for name, values in raw["scalars"].items()},
            **_scatter(raw["scalars"]),
            **{
                f"cycle_mean_{name}": ((), v, *_label(name, "of the mean cycle")) for name, v in mean["scalars"].items()
            },
        },
        attrs={
            **attrs,
            "smoothing": raw["smoothing"],
            "mass_source": raw["mass_source"],
            "heat_window": given or ("found" if found else "no burn found"),
            "cycles": n,
            "motored": int(sum(raw["motored"])),
            "warnings": "\n".join(lines),
        },
    )


def _label(name: str, which: str) -> tuple[str, str]:
    unit, text = VARIABLES[name]
    return unit, f"{text}, {which}"


def _scatter(scalars: dict[str, np.ndarray]) -> dict[str, tuple[Any, ...]]:
    """Mean, standard deviation (n - 1) and, where zero is not a convention, the COV over the cycles with a figure."""
    out: dict[str, tuple[Any, ...]] = {}
    for name, values in scalars.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # all NaN, or one cycle: the answer is NaN
            mean, std = np.nanmean(values), np.nanstd(values, ddof=1)
        out[f"mean_{name}"] = ((), mean, *_label(name, "mean of the cycles"))
        unit, text = _label(name, "standard deviation of the cycles")
        out[f"std_{name}"] = ((), std, unit.removesuffix(" aTDC"), text)
        if name.endswith("_cad") or name in _OFFSETS:
            continue
        cov = 100.0 * std / abs(mean) if mean else np.nan
        out[f"cov_{name}_percent"] = ((), cov, "%", f"{VARIABLES[name].long_name}, coefficient of variation")
    imep = scalars["imep_closed_bar"]
    lowest = 100.0 * imep.min() / imep.mean() if imep.mean() else np.nan
    out["lnv_imep_closed_percent"] = ((), lowest, "%", "lowest closed-cycle IMEP over the mean (LNV)")
    return out
