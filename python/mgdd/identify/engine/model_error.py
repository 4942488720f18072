"""What a calibration holds as if it were known, counted in the standard errors of what it estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.identify.engine.request import GAMMA_PARAMETER, Request

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd._core.engine import Cylinder
    from mgdd.results.fit_report import FitReport

# How far gamma, pressure and angle of a usual bench may be off, where nobody has said better.
WIDTHS: Mapping[str, float] = MappingProxyType({"gamma": 0.03, "pegging_bar": 0.1, "tdc_cad": 0.3})
_FUEL = 0.05  # of the stated fuel that may not burn, or not be there
_STEPS = 30  # of a search that starts near its end


def with_model_error(report: FitReport, request: Request, fit: _core.identify.CylinderFit) -> FitReport:
    """Add to the errors of a fit what would change if that were otherwise which it holds: gamma, pegging, TDC, fuel.

    Considered, not estimated (Schmidt 1966): each held quantity is spread evenly over its width, and everything is
    fitted again with it at one end. A parameter at a bound or in a null direction stays as it is.
    """
    known = np.flatnonzero(np.isfinite(report.stderr))
    if known.size == 0:
        return report
    covariance, stderr = report.covariance.copy(), report.stderr.copy()
    for change in _changes(request, fit.cylinder):
        moved = _estimates(request, fit, **change) - report.values
        covariance[np.ix_(known, known)] += np.outer(moved, moved)[np.ix_(known, known)] / 3.0  # of an even spread
    stderr[known] = np.sqrt(np.diag(covariance)[known])
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
