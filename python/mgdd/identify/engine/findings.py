"""Limitations of a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.engine import OperatingPoint
from mgdd.engine import analyze
from mgdd.errors import ParameterError
from mgdd.identify.engine.request import GAMMA_PARAMETER, Request, earliest_burn_cad
from mgdd.results.finding import Finding

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd._core.engine import Cylinder
    from mgdd.identify.engine.records import CylinderFit, Load
    from mgdd.results.fit_report import FitReport


@dataclass(frozen=True, kw_only=True)
class Plausibility:
    """Limits of what a model that was fitted to pressure can be.

    Parameters
    ----------
    wall_heat_range, gamma_range : tuple of float
        Scales of the textbook wall heat, and leading parameters of the gamma law [-].
    efficiency_limit : float
        Highest work of the closed cycle over the heat of the fuel [-]: the best truck engines stay below 0.5 of brake
        efficiency, 0.55 of the closed cycle.
    fuel_balance : tuple of float
        Heat that the model releases over that of the stated fuel [-]: up to 7 % does not burn, as much leaves with
        crevice and blow-by, and a flow meter and a heating value are good to 4 %.
    imep_percent : float
        Largest error of the closed IMEP [%].
    """

    wall_heat_range: tuple[float, float] = (0.3, 1.5)
    gamma_range: tuple[float, float] = (1.25, 1.42)
    efficiency_limit: float = 0.55
    fuel_balance: tuple[float, float] = (0.86, 1.04)
    imep_percent: float = 2.0

    def __post_init__(self) -> None:
        for name in ("wall_heat_range", "gamma_range", "fuel_balance"):
            if not getattr(self, name)[0] < getattr(self, name)[1]:
                raise ParameterError.of(name, getattr(self, name), "a pair that rises")
        for name in ("efficiency_limit", "imep_percent"):
            ParameterError.unless(getattr(self, name) > 0.0, name, getattr(self, name), "> 0")

    def of_model(self, cylinder: Cylinder) -> Iterator[Finding]:
        """Give what is not plausible of the parameters that all traces share."""
        name = GAMMA_PARAMETER[cylinder.gamma_model]
        for code, field, what, (low, high) in (
            ("implausible_wall_heat", "wall_heat_scale", "wall heat", self.wall_heat_range),
            ("implausible_gamma", name, "gamma", self.gamma_range),
        ):
            value = float(getattr(cylinder, field))
            if not low <= value <= high:
                digits = 2 if field == "wall_heat_scale" else 3
                yield Finding(code, (field,), f"{what} {value:.{digits}f} outside {low:g} to {high:g}")

    def of_load(self, load: Load, known_heat_j: float | None) -> Iterator[Finding]:
        """Give what is not plausible of one trace, whose fuel brings `known_heat_j`."""
        efficiency = load.imep_closed_bar * load.cylinder.swept_volume_l * 100.0 / load.fuel_heat_j  # bar l are 100 J
        if not efficiency <= self.efficiency_limit:
            yield Finding(
                "implausible_efficiency",
                (load.file,),
                f"closed efficiency {efficiency:.3f} above {self.efficiency_limit:g}",
            )
        low, high = self.fuel_balance
        if known_heat_j is not None and not low <= load.fuel_heat_j / known_heat_j <= high:
            balance = load.fuel_heat_j / known_heat_j
            yield Finding(
                "fuel_balance", (load.file,), f"heat {balance:.2f} of the stated fuel, outside {low:g} to {high:g}"
            )
        if not abs(load.imep_closed_error_percent) <= self.imep_percent:
            yield Finding(
                "imep_error",
                (load.file,),
                f"closed IMEP {load.imep_closed_error_percent:+.1f} %, beyond {self.imep_percent:g} %",
            )


_PLAUSIBLE = Plausibility()
_RMSE_LIMIT_PERCENT = 2.0


def findings_of(fit: CylinderFit, request: Request) -> tuple[Finding, ...]:
    """Collect the doubts of the traces, then those of the fit."""
    return (
        *_of_traces(request),
        *_poor(fit),
        *_not_converged(fit),
        *_early(fit, request),
        *_work(fit),
        *_implausible(fit, request),
        *(
            Finding("unidentifiable", (name,), f"{name} is not identifiable from these traces")
            for name in fit.report.unidentifiable
        ),
    )


def _of_traces(request: Request) -> Iterator[Finding]:
    """Give what the analysis of each trace finds suspicious: TDC, pegging, unit, missing angles, fuel, speed."""
    silent = [label for trace, label in zip(request.traces, request.labels, strict=True) if not _has_speed(trace)]
    if silent and request.point is None:
        yield Finding(
            "assumed_speed",
            tuple(silent),
            f"no speed is stated for {', '.join(silent)}: {OperatingPoint().speed_rpm:g} rpm are assumed, and wall "
            "heat per degree depends on it",
            "give point=, or the attribute speed_rpm",
        )
    for trace, label, heat_j in zip(request.traces, request.labels, request.known_heat_j, strict=True):
        analysis = analyze(trace, request.cylinder, point=request.point, quiet=True)
        net = float(analysis["heat_net_j"])
        if heat_j is not None and net > heat_j:
            yield Finding(
                "fuel_too_small",
                (label,),
                f"{label}: the gas shows {net:.0f} J of net heat, more than the {heat_j:.0f} J of the stated fuel",
                "suspect fuel_mg, TDC, the pressure unit or the displacement",
            )
        for text in analysis.attrs["warnings"].splitlines():
            yield Finding("doubtful_trace", (label,), f"{label}: {text}")


def _has_speed(trace: xr.Dataset) -> bool:
    return trace.attrs.get("speed_rpm") is not None


def _poor(fit: CylinderFit) -> Iterator[Finding]:
    poor = [load for load in fit.loads if load.rmse_percent > _RMSE_LIMIT_PERCENT]
    if poor:
        each = ", ".join(f"{load.file} {load.rmse_percent:.1f} %" for load in poor)
        yield Finding(
            "poor_fit",
            tuple(load.file for load in poor),
            f"the model does not meet the measurement (pressure RMSE in % of p_max: {each})",
            "suspect geometry, TDC, pegging or the preset",
        )


def _not_converged(fit: CylinderFit) -> Iterator[Finding]:
    if not fit.report.success:
        yield Finding("not_converged", (), f"the search ended without converging: {fit.report.message}")


def _early(fit: CylinderFit, request: Request) -> Iterator[Finding]:
    earliest = [earliest_burn_cad(trace) for trace in request.traces]
    for held in (False, True):
        early = [
            (load, first)
            for load, first in zip(fit.loads, earliest, strict=True)
            if (abs(load.soc_cad - first) <= 1e-6 if held else load.soc_cad < first - 1e-6)
        ]
        if not early:
            continue
        each = ", ".join(f"{load.file} {load.soc_cad - first:+.1f}" for load, first in early)
        starts = "is held at the injection or spark and would start before" if held else "starts before the injection"
        yield Finding(
            "early_onset",
            tuple(load.file for load, _ in early),
            f"the fitted burn {starts} (SOC minus SOI in °CA: {each}): the burn law bends to make up for another error "
            "of the model, so its start is not a physical onset",
        )


def _implausible(fit: CylinderFit, request: Request) -> Iterator[Finding]:
    """Give what the model cannot be; the error of the work has a finding of its own, over all traces."""
    for finding in _PLAUSIBLE.of_model(fit.model):
        yield replace(
            finding,
            text=f"{finding.text}: it makes up for another error of the model, and fuel heat and burn do so with it",
            remedy="state the fuel, hold wall_heat_scale and free gamma, or ask best_timing",
        )
    of_loads: dict[str, list[Finding]] = {}
    for load, heat_j in zip(fit.loads, request.known_heat_j, strict=True):
        for finding in _PLAUSIBLE.of_load(load, heat_j):
            of_loads.setdefault(finding.code, []).append(replace(finding, text=f"{load.file} {finding.text}"))
    for code, together in of_loads.items():
        if code != "imep_error":
            files = tuple(name for finding in together for name in finding.names)
            text = "; ".join(finding.text for finding in together[:3]) + (" and others" if len(together) > 3 else "")
            yield Finding(code, files, text, "suspect gamma, TDC, pegging or the fuel")


def _work(fit: CylinderFit) -> Iterator[Finding]:
    errors = [load.imep_closed_error_percent for load in fit.loads]
    if max(map(abs, errors)) <= _PLAUSIBLE.imep_percent:
        return
    if max(errors) < 0.0 or min(errors) > 0.0:
        low, high = (f"{size:.1f}" for size in (min(map(abs, errors)), max(map(abs, errors))))
        size = low if low == high else f"{low} to {high}"
        what = f"closed IMEP is {size} % {'low' if errors[0] < 0.0 else 'high'}"
    else:
        what = f"closed IMEP is wrong by {min(errors):+.1f} to {max(errors):+.1f} %"
    yield Finding(
        "imep_error",
        tuple(load.file for load in fit.loads),
        f"{what} although the pressure RMSE is at most {max(load.rmse_percent for load in fit.loads):.2f} % of p_max: "
        "a small RMSE proves nothing here",
        "do not read efficiency or fuel heat from this fit",
    )


# How far gamma, pressure and angle of a usual bench may be off, without better knowledge.
WIDTHS: Mapping[str, float] = MappingProxyType({"gamma": 0.03, "pegging_bar": 0.1, "tdc_cad": 0.3})
_FUEL = 0.05  # of the stated fuel that may not burn, or not be there
_STEPS = 30  # of a search that starts near its end


def with_model_error(report: FitReport, request: Request, fit: _core.identify.CylinderFit) -> FitReport:
    """Add to the errors of a fit what would change if that were otherwise which it holds: gamma, pegging, TDC, fuel.

    Considered, not estimated (Schmidt 1966): each held quantity is spread evenly over its width, and everything is
    fitted again with it at one end. A parameter at a bound or in a null direction stays as it is.
    """
    finite = np.flatnonzero(np.isfinite(report.stderr))
    if finite.size == 0:
        return report
    covariance, stderr = report.covariance.copy(), report.stderr.copy()
    for change in _changes(request, fit.cylinder):
        moved = _estimates(request, fit, **change) - report.values
        covariance[np.ix_(finite, finite)] += np.outer(moved, moved)[np.ix_(finite, finite)] / 3.0  # of an even spread
    stderr[finite] = np.sqrt(np.diag(covariance)[finite])
    for array in (covariance, stderr):
        array.flags.writeable = False
    return replace(report, covariance=covariance, stderr=stderr)


def _changes(request: Request, model: Cylinder) -> Iterator[dict[str, Any]]:
    """Give each held quantity with its width, as arguments of `_estimates`."""
    name = GAMMA_PARAMETER[model.gamma_model]
    if name not in request.free:
        yield {"cylinder": model.replace(**{name: float(getattr(model, name)) - WIDTHS["gamma"]})}
    yield {"more_bar": WIDTHS["pegging_bar"]}
    yield {"late_cad": WIDTHS["tdc_cad"]}
    if "fuel_heat_j" not in request.free:
        yield {"fuel": 1.0 - _FUEL}


def _estimates(
    request: Request,
    fit: _core.identify.CylinderFit,
    *,
    cylinder: Cylinder | None = None,
    fuel: float = 1.0,
    **moved: float,
) -> NDArray[np.float64]:
    """Fit again, from the estimates."""
    burns = [load.burn for load in fit.loads]  # copies, so that the fit stays as it is
    for burn in burns:
        burn.fuel_heat_j *= fuel
        if "start_pressure_bar" not in request.free:
            burn.start_pressure_bar = 0.0  # that of the trace, wherever it is moved
    again = _core.identify.fit_cylinder(
        request.measured(**moved), cylinder or fit.cylinder, burns, list(request.free), request.step_cad,
        request.integrator, _STEPS, request.search_bounds(),
    )  # fmt: skip
    return np.asarray(again.report.values)
