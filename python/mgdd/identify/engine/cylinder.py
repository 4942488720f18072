"""Calibration of the cycle model to measured pressure traces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine.trace import conditions
from mgdd.identify.engine.findings import findings_of, with_model_error
from mgdd.identify.engine.records import CylinderFit, Load, burn_law, load_table
from mgdd.identify.engine.request import Bounds, Request, closed, with_burn
from mgdd.optimize.least_squares import FitOptions, fit_options
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.presets.meant import CylinderLike, PointLike
from mgdd.results.fit import FitQuality
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr


def fit_cylinder(
    traces: Sequence[Any],
    cylinder: CylinderLike,
    *,
    free: Sequence[str] | None = None,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    bounds: Bounds | None = None,
    point: PointLike | None = None,
    start_values: Sequence[Mapping[str, float]] | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
    options: FitOptions | None = None,
) -> CylinderFit:
    """Fit the cycle model to measured pressure: the burn per trace, the cylinder for all together.

    Parameters
    ----------
    traces : sequence of xarray.Dataset, or of any form of a trace that `mgdd.engine.analyze` takes
        ``pressure_bar(crank_angle_cad)`` each. Attributes ``speed_rpm``, ``trapped_mass_g``, ``ivc_temperature_k``,
        ``fuel_mg``, ``soi_cad`` and ``spark_cad`` are used where present; ``file`` names the trace. Samples outside
        IVC..EVO are dropped.
    cylinder : Cylinder, Preset, str or path-like
        As in `mgdd.engine.simulate`: start and constants; its ``burn_shape`` and ``gamma_model`` choose the laws.
    free : sequence of str, optional
        Parameters to fit: per trace ``soc_cad burn_duration_cad fuel_heat_j`` and, of the Wiebe laws, ``wiebe_m
        second_fraction second_delay_cad second_duration_cad second_wiebe_m``; for all traces any field of the
        cylinder except ``ivc_cad`` and ``evo_cad``; ``gamma`` is the parameter of the gamma law in use. Default: the
        three burn parameters and ``wall_heat_scale``, with the double Wiebe also its five shape parameters, and
        ``start_pressure_bar`` per trace where the first 30 °CA scatter by more than 1 %: one sample would scale all.
    fuel_heat_j : float or sequence of float, optional
        Known heat of the fuel, one for all traces or one each [J]; it is held. Left out, ``fuel_mg`` of the traces
        gives it where present, and it is fitted otherwise.
    bounds : mapping of str to pair, optional
        Lower and upper bound of a free parameter, ``NAME`` for all traces or ``NAME[file]`` for one; None leaves a side
        open. Left out, a burn starts at the earliest at the injection or spark of its trace, and gamma stays in 1.15
        to 1.45 (linear law at 300 K: 1.28 to 1.45).
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        Conditions that a trace does not carry; a ``fuel_mg`` by name is the known fuel of such a trace.
    start_values : sequence of mapping, optional
        Start values of the per-trace parameters; from the heat release of the trace if left out.
    pegging, pegging_exponent, inlet_pressure_kpa
        How the pressure is made absolute first, as in `mgdd.engine.analyze`.
    step_cad : float
        Largest step of the model [°CA]; measured steps are divided evenly.
    integrator : str
        As in `mgdd.engine.simulate`.
    options : FitOptions, optional
        200 trial steps of the search by default; the other options have no effect here and are refused.

    Returns
    -------
    mgdd.results.Fit
        `model` is the cylinder with the common parameters, `kind` its burn law. It has further fields: ``loads``, per
        trace the burn, the errors, an overlay Dataset, and cylinder and point ready for `mgdd.engine.simulate`;
        ``table``, their figures in one Dataset; ``correlation_if_free``, the correlation with parameters at a bound
        taken as free.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown or repeated name in ``free``, ``bounds`` or ``start_values``, or a fuel heat both free and given.
    mgdd.errors.DataError
        A trace that cannot be used, or shows no heat release.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the fit as far as it came, with the status ``interrupted``.

    Notes
    -----
    Levenberg-Marquardt with exact forward sensitivities; ``wall_heat_scale`` is searched in [0, 2.5].

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import fit_cylinder
    >>> traces, cylinder = datasets.read("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder
    >>> fit = fit_cylinder(traces, cylinder, free=["soc_cad", "burn_duration_cad", "fuel_heat_j"])
    >>> fit.report.success
    True
    """
    request = Request.of(
        traces,
        cylinder,
        free=free,
        fuel_heat_j=fuel_heat_j,
        bounds=bounds,
        point=point,
        start_values=start_values,
        step_cad=step_cad,
        integrator=integrator,
        options=options,
        pegging=pegging,
        pegging_exponent=pegging_exponent,
        inlet_pressure_kpa=inlet_pressure_kpa,
    )
    return fit_request(request, model_error=True)


def fit_request(request: Request, *, model_error: bool = False) -> CylinderFit:
    """Run a calibration that has been checked; `model_error` fits three or four times more, from the result."""
    cylinder, point, labels = request.cylinder, request.point, request.labels
    measured = request.measured()
    burns = request.starts(measured)
    chosen = fit_options(request.options, max_iterations=200)
    core, stop = or_partial(
        lambda: _core.identify.fit_cylinder(
            measured,
            cylinder,
            burns,
            list(request.free),
            request.step_cad,
            request.integrator,
            chosen.max_iterations,
            request.search_bounds(),
        )
    )
    loads = tuple(
        _load(core.cylinder, fitted, trace, label, point)
        for fitted, trace, label in zip(core.loads, request.traces, labels, strict=True)
    )
    report = FitReport.from_core(core.report)
    if model_error and stop is None:
        report = with_model_error(report, request, core)
    fit = CylinderFit(
        report=report,
        model=core.cylinder,
        kind=burn_law(core.cylinder),
        train=FitQuality(nrmse_fit_percent=None, rmse=100.0 * report.rmse, unit="% of p_max", n=report.residual.size),
        unidentifiable=report.unidentifiable,
        source=", ".join(labels),
        draw=_draw,
        loads=loads,
        table=load_table(loads),
        correlation_if_free=np.asarray(core.correlation_if_free),
        request=request,
    )
    return hand_over(replace(fit, findings=findings_of(fit, request)), stop)


def _draw(fit: CylinderFit, ax: Any) -> Any:
    """Draw the trace that the model meets worst."""
    return max(fit.loads, key=lambda load: load.rmse_percent).plot(ax=ax)


def _load(
    cylinder: Cylinder, fitted: _core.identify.LoadFit, trace: xr.Dataset, label: str, point: OperatingPoint | None
) -> Load:
    angle, pressure = closed(trace, cylinder)
    burn = fitted.burn
    soi = float(trace.attrs.get("soi_cad", math.nan))
    scalars = {
        name: getattr(fitted, name)
        for name in (
            "p_max_bar rmse_bar rmse_percent imep_closed_bar imep_closed_error_percent largest_error_bar "
            "largest_error_cad ca50_cad heat_loss_fraction"
        ).split()
    }
    overlay = labelled_dataset(
        {
            ANGLE: (ANGLE, angle),
            "measured_bar": (ANGLE, pressure),
            "model_bar": (ANGLE, fitted.model_bar),
            "residual_bar": (ANGLE, fitted.model_bar - pressure),
            "rmse_bar": ((), fitted.rmse_bar),
            "rmse_percent": ((), fitted.rmse_percent),
            "imep_closed_error_percent": ((), fitted.imep_closed_error_percent),
            "soc_cad": ((), burn.soc_cad),
            "soi_cad": ((), soi),
            "p_max_bar": ((), fitted.p_max_bar),
        },
        attrs={"file": label, "burn": cylinder.burn_shape},
    )
    state = conditions(trace, point).replace(
        intake_pressure_kpa=burn.start_pressure_bar * 100.0,
        fuel_mg=burn.fuel_heat_j / cylinder.lower_heating_value_mj_per_kg,
        burn_duration_cad=burn.burn_duration_cad,
        trapped_mass_g=fitted.trapped_mass_g,
    )
    return Load(
        file=label,
        point=state,
        cylinder=with_burn(cylinder, burn),
        soc_cad=burn.soc_cad,
        burn_duration_cad=burn.burn_duration_cad,
        fuel_heat_j=burn.fuel_heat_j,
        soi_cad=soi,
        onset_against_soi_cad=burn.soc_cad - soi,
        overlay=overlay,
        **scalars,
    )
