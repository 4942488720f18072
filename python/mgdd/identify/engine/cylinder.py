"""Calibration of the cycle model to measured pressure traces."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine import analyze
from mgdd.errors import DataError, ParameterError, ShapeError, hand_over, or_partial
from mgdd.identify.engine.records import CylinderFit, Load, burn_law, load_table
from mgdd.io.trace_forms import as_trace
from mgdd.optimize.fit_options import FitOptions, fit_options
from mgdd.results import Finding, FitReport
from mgdd.results.fit import FitQuality
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fit_cylinder"]

SHAPE_FIELDS = ("wiebe_m", "second_fraction", "second_delay_cad", "second_duration_cad", "second_wiebe_m")
BURN_FIELDS = ("soc_cad", "burn_duration_cad", "fuel_heat_j")
# An IMEP error beyond this share makes efficiency and timing doubtful, whatever the pressure RMSE says.
_IMEP_LIMIT_PERCENT = 3.0
_RMSE_LIMIT_PERCENT = 2.0


def fit_cylinder(
    traces: Sequence[Any],
    cylinder: Cylinder,
    *,
    free: Sequence[str] | None = None,
    point: OperatingPoint | None = None,
    start_values: Sequence[Mapping[str, float]] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
    options: FitOptions | None = None,
) -> CylinderFit:
    """Fit the cycle model to measured pressure: the burn per trace, the cylinder for all together.

    Parameters
    ----------
    traces : sequence of xarray.Dataset, or of any form of a trace that `mgdd.engine.analyze` takes
        ``pressure_bar(crank_angle_cad)`` each, absolute. Attributes ``speed_rpm``, ``trapped_mass_g``,
        ``ivc_temperature_k`` and ``soi_cad`` are used where present; ``file`` names the trace. Samples outside
        IVC..EVO are dropped.
    cylinder : Cylinder
        Start and constants; its ``burn_shape`` and ``gamma_model`` choose the laws.
    free : sequence of str, optional
        Parameters to fit: per trace ``soc_cad burn_duration_cad fuel_heat_j`` and, of the Wiebe laws, ``wiebe_m
        second_fraction second_delay_cad second_duration_cad second_wiebe_m``; for all traces any field of the
        cylinder except ``ivc_cad`` and ``evo_cad``. Default: the three burn parameters and ``wall_heat_scale``, with
        the double Wiebe also its five shape parameters.
    point : OperatingPoint, optional
        Conditions that a trace does not carry.
    start_values : sequence of mapping, optional
        Start values of the per-trace parameters; from the heat release of the trace if left out.
    step_cad : float
        Largest step of the model [°CA]; measured steps are divided evenly.
    integrator : str
        As in `mgdd.engine.simulate`.
    options : FitOptions, optional
        200 trial steps of the search where nothing else is said; the other options have no effect here and are refused.

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
        An unknown or repeated name in ``free`` or ``start_values``.
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
    >>> traces, cylinder = datasets.load("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder
    >>> fit = fit_cylinder(traces, cylinder, free=["soc_cad", "burn_duration_cad", "fuel_heat_j"])
    >>> fit.report.success
    True
    """
    names = default_free(cylinder) if free is None else tuple([free] if isinstance(free, str) else free)
    if isinstance(traces, str | os.PathLike | Mapping) or hasattr(traces, "to_numpy") or hasattr(traces, "variables"):
        raise ShapeError(f"traces is one {type(traces).__name__}: pass a list of traces, [trace] for a single one")
    traces = [as_trace(trace) for trace in traces]
    if not traces:
        raise DataError("no traces: a calibration needs at least one")
    labels = _labels(traces)
    measured = [_measured(trace, label, cylinder, point) for trace, label in zip(traces, labels, strict=True)]
    burns = _starts(measured, cylinder, start_values)
    chosen = fit_options(options, max_iterations=200)
    core, stop = or_partial(
        lambda: _core.identify.fit_cylinder(
            measured, cylinder, burns, list(names), step_cad, integrator, chosen.max_iterations
        )
    )
    loads = tuple(
        _load(core.cylinder, fitted, trace, label, point)
        for fitted, trace, label in zip(core.loads, traces, labels, strict=True)
    )
    report = FitReport.from_core(core.report)
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
    )
    return hand_over(replace(fit, findings=(*_doubts(traces, cylinder, point), *_findings(fit))), stop)


def _draw(fit: CylinderFit, ax: Any) -> Any:
    """Draw the trace that the model meets worst."""
    return max(fit.loads, key=lambda load: load.rmse_percent).plot(ax=ax)


def default_free(cylinder: Cylinder) -> tuple[str, ...]:
    """Name what `fit_cylinder` frees for a burn law when nothing is said."""
    shape = SHAPE_FIELDS if cylinder.burn_shape == "double_wiebe" else ()
    return ("wall_heat_scale", *BURN_FIELDS, *shape)


def conditions(trace: xr.Dataset, point: OperatingPoint | None) -> OperatingPoint:
    """Give the operating point of a trace: its own attributes over ``point``."""
    names = ("speed_rpm", "trapped_mass_g", "ivc_temperature_k")
    own = {n: float(trace.attrs[n]) for n in names if trace.attrs.get(n) is not None}
    return (point or OperatingPoint()).replace(**own)


def _labels(traces: Sequence[xr.Dataset]) -> list[str]:
    names: list[str] = []
    for i, trace in enumerate(traces):
        name = str(trace.attrs.get("file", f"trace{i}"))
        while name in names:
            name += f"#{i}"
        names.append(name)
    return names


def _closed(trace: xr.Dataset, cylinder: Cylinder) -> tuple[np.ndarray, np.ndarray]:
    for name in (ANGLE, "pressure_bar"):
        if name not in trace.variables:
            raise DataError(f"the trace has no {name}: read it with mgdd.io.read_pressure")
    angle = trace[ANGLE].to_numpy()
    inside = (angle >= cylinder.ivc_cad - 1e-9) & (angle <= cylinder.evo_cad + 1e-9)
    return angle[inside], trace["pressure_bar"].to_numpy()[inside]


def _measured(
    trace: xr.Dataset, label: str, cylinder: Cylinder, point: OperatingPoint | None
) -> _core.identify.MeasuredCycle:
    angle, pressure = _closed(trace, cylinder)
    return _core.identify.MeasuredCycle(
        label=label, crank_angle_cad=angle, pressure_bar=pressure, point=conditions(trace, point)
    )


def _starts(
    measured: Sequence[_core.identify.MeasuredCycle],
    cylinder: Cylinder,
    start_values: Sequence[Mapping[str, float]] | None,
) -> list[_core.identify.LoadBurn]:
    if start_values is None:
        return [_core.identify.estimate_burn(trace, cylinder) for trace in measured]
    if len(start_values) != len(measured):
        raise ParameterError(f"start_values has {len(start_values)} entries for {len(measured)} traces")
    known = _core.identify.load_parameters()
    burns = []
    for trace, values in zip(measured, start_values, strict=True):
        burns.append(
            _core.identify.LoadBurn() if set(known) <= set(values) else _core.identify.estimate_burn(trace, cylinder)
        )
        burn = burns[-1]
        for name, value in values.items():
            if name not in known:
                raise ParameterError(
                    f"start_values: {name!r} is not a parameter of a trace: must be one of {', '.join(known)}"
                )
            setattr(burn, name, float(value))
    return burns


def _load(
    cylinder: Cylinder, fitted: _core.identify.LoadFit, trace: xr.Dataset, label: str, point: OperatingPoint | None
) -> Load:
    angle, pressure = _closed(trace, cylinder)
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
    own = conditions(trace, point).replace(
        intake_pressure_kpa=float(pressure[0]) * 100.0,
        fuel_mg=burn.fuel_heat_j / cylinder.lower_heating_value_mj_per_kg,
        burn_duration_cad=burn.burn_duration_cad,
        trapped_mass_g=fitted.trapped_mass_g,
    )
    return Load(
        file=label,
        point=own,
        cylinder=_core.identify.with_burn(cylinder, burn),
        soc_cad=burn.soc_cad,
        burn_duration_cad=burn.burn_duration_cad,
        fuel_heat_j=burn.fuel_heat_j,
        soi_cad=soi,
        onset_against_soi_cad=burn.soc_cad - soi,
        overlay=overlay,
        **scalars,
    )


def _doubts(traces: Sequence[xr.Dataset], cylinder: Cylinder, point: OperatingPoint | None) -> list[Finding]:
    """Collect what the analysis of each trace finds suspicious: TDC, pegging, unit, missing angles."""
    out = []
    for trace in traces:
        analysis = analyze(trace, cylinder, point=point, quiet=True)
        file = str(analysis.attrs["file"])
        out += [
            Finding("doubtful_trace", (file,), f"{file}: {text}") for text in analysis.attrs["warnings"].splitlines()
        ]
    return out


def _findings(fit: CylinderFit) -> tuple[Finding, ...]:
    out: list[Finding] = []
    poor = [load for load in fit.loads if load.rmse_percent > _RMSE_LIMIT_PERCENT]
    if poor:
        each = ", ".join(f"{load.file} {load.rmse_percent:.1f} %" for load in poor)
        out.append(
            Finding(
                "poor_fit",
                tuple(load.file for load in poor),
                f"the model does not meet the measurement (pressure RMSE in % of p_max: {each})",
                "suspect geometry, TDC, pegging or the preset",
            )
        )
    if not fit.report.success:
        out.append(Finding("not_converged", (), f"the search ended without converging: {fit.report.message}"))
    early = [load for load in fit.loads if load.onset_against_soi_cad < 0.0]
    if early:
        each = ", ".join(f"{load.file} {load.onset_against_soi_cad:+.1f}" for load in early)
        out.append(
            Finding(
                "early_onset",
                tuple(load.file for load in early),
                f"the fitted burn starts before the injection (SOC minus SOI in °CA: {each}): the burn law bends to "
                "make up for another error of the model, so its start is not a physical onset",
            )
        )
    errors = [load.imep_closed_error_percent for load in fit.loads]
    if not max(map(abs, errors)) <= _IMEP_LIMIT_PERCENT:
        if max(errors) < 0.0 or min(errors) > 0.0:
            low, high = (f"{size:.1f}" for size in (min(map(abs, errors)), max(map(abs, errors))))
            size = low if low == high else f"{low} to {high}"
            what = f"closed IMEP is {size} % {'low' if errors[0] < 0.0 else 'high'}"
        else:
            what = f"closed IMEP is wrong by {min(errors):+.1f} to {max(errors):+.1f} %"
        out.append(
            Finding(
                "imep_error",
                tuple(load.file for load in fit.loads),
                f"{what} although the pressure RMSE is at most "
                f"{max(load.rmse_percent for load in fit.loads):.2f} % of p_max: a small RMSE proves nothing here",
                "do not read efficiency or fuel heat from this fit",
            )
        )
    out += [
        Finding("unidentifiable", (name,), f"{name} is not identifiable from these traces")
        for name in fit.report.unidentifiable
    ]
    return tuple(out)
