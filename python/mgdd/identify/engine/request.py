"""Settings of a calibration: traces pegged and cut to the closed part, what is free, known and bounded."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine import analyze
from mgdd.engine.trace import conditions
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io.pressure import one_cycle
from mgdd.optimize.least_squares import FitOptions
from mgdd.presets.meant import CylinderLike, PointLike, cylinder_of, point_of, stated
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

LoadBurn = _core.identify.LoadBurn
with_burn = _core.identify.with_burn
SHAPE_FIELDS = ("wiebe_m", "second_fraction", "second_delay_cad", "second_duration_cad", "second_wiebe_m")
BURN_FIELDS = ("soc_cad", "burn_duration_cad", "fuel_heat_j")
_EARLIEST = ("soi_cad", "spark_cad")
# "gamma" names the parameter of whichever gamma law is in use.
GAMMA_PARAMETER = {"constant": "gamma", "linear": "gamma_linear_300k", "polynomial": "gamma_polynomial_c0"}

# What air and burned gas can have; the linear law must also stay above 1 in the hottest gas.
_GAMMA_BOUNDS = {"gamma": (1.15, 1.45), "gamma_linear_300k": (1.28, 1.45), "gamma_polynomial_c0": (1.25, 1.45)}
_START_CAD, _NOISY_START = 30.0, 0.01  # noise above this share would scale the cycle through its first sample

Bounds = Mapping[str, tuple[float | None, float | None]]


@dataclass(frozen=True, kw_only=True)
class Request:
    """One calibration, ready to be run and run again with changes."""

    traces: tuple[xr.Dataset, ...]
    labels: tuple[str, ...]
    cylinder: Cylinder
    free: tuple[str, ...]
    known_heat_j: tuple[float | None, ...]
    bounds: Mapping[str, tuple[float | None, float | None]]
    point: OperatingPoint | None
    start_values: tuple[Mapping[str, float], ...] | None
    step_cad: float
    integrator: str
    options: FitOptions | None

    @classmethod
    def of(
        cls,
        traces: Sequence[Any],
        cylinder: CylinderLike,
        *,
        free: Sequence[str] | None,
        fuel_heat_j: float | Sequence[float | None] | None,
        bounds: Bounds | None,
        point: PointLike | None,
        start_values: Sequence[Mapping[str, float]] | None,
        step_cad: float,
        integrator: str,
        options: FitOptions | None,
        **pegging: Any,
    ) -> Self:
        """Check the arguments of `fit_cylinder` against each other."""
        cylinder, fuel_mg = cylinder_of(cylinder), stated("fuel_mg", None, point) or None
        point = point_of(point)
        given = listed(traces)
        chosen = None if free is None else (free,) if isinstance(free, str) else tuple(free)
        heats = _known_heats(given, cylinder, fuel_heat_j, fuel_mg, chosen)
        noisy = any(_scatter_of_start(trace, cylinder) > _NOISY_START for trace in given)
        default = (*default_free(cylinder), *(("start_pressure_bar",) if noisy else ()))
        heat_known = _all_known(heats)
        names = chosen if chosen is not None else tuple(n for n in default if n != "fuel_heat_j" or not heat_known)
        names = tuple(GAMMA_PARAMETER[cylinder.gamma_model] if name == "gamma" else name for name in names)
        if start_values is not None and len(start_values) != len(given):
            raise ParameterError(f"start_values has {len(start_values)} entries for {len(given)} traces")
        return cls(
            traces=tuple(pegged(trace, cylinder, point, **pegging) for trace in given),
            labels=_labels(given),
            cylinder=cylinder,
            free=names,
            known_heat_j=heats,
            bounds=dict(bounds or {}),
            point=point,
            start_values=None if start_values is None else tuple(start_values),
            step_cad=step_cad,
            integrator=integrator,
            options=options,
        )

    def measured(self, *, late_cad: float = 0.0, more_bar: float = 0.0) -> list[_core.identify.MeasuredCycle]:
        """Give the closed parts as the core takes them, or as they would be that much later and higher."""
        out = []
        for trace, label in zip(self.traces, self.labels, strict=True):
            angle, pressure = closed(trace, self.cylinder)
            if late_cad or more_bar:
                pressure = np.interp(angle - late_cad, angle, pressure) + more_bar
            point = conditions(trace, self.point)
            out.append(
                _core.identify.MeasuredCycle(label=label, crank_angle_cad=angle, pressure_bar=pressure, point=point)
            )
        return out

    def starts(self, measured: Sequence[_core.identify.MeasuredCycle]) -> list[LoadBurn]:
        """Give the start of each burn: from the trace's heat release, then what is given, then what is known."""
        names = _core.identify.load_parameters()
        burns = []
        for index, trace in enumerate(measured):
            start_values = {} if self.start_values is None else self.start_values[index]
            for name in start_values:
                if name not in names:
                    raise ParameterError(
                        f"start_values: {name!r} is not a parameter of a trace: must be one of {', '.join(names)}"
                    )
            full = set(names) - {"start_pressure_bar"} <= set(start_values)  # then nothing is left to estimate
            burn = LoadBurn() if full else _core.identify.estimate_burn(trace, self.cylinder)
            for name, value in start_values.items():
                setattr(burn, name, float(value))
            heat = self.known_heat_j[index]
            if heat is not None:
                burn.fuel_heat_j = heat
            burns.append(burn)
        return burns

    def search_bounds(self) -> dict[str, tuple[float, float]]:
        """Give the bounds of the search; a burn starts at the earliest at the injection or spark of its trace."""
        out = {
            name: (-math.inf if low is None else float(low), math.inf if high is None else float(high))
            for name, (low, high) in self.bounds.items()
        }
        out = {name: _GAMMA_BOUNDS[name] for name in _GAMMA_BOUNDS if name in self.free} | out
        for trace, label in zip(self.traces, self.labels, strict=True):
            name = f"soc_cad[{label}]"
            earliest = earliest_burn_cad(trace)
            if earliest >= _core.engine.timing_window_cad[1]:
                raise DataError(
                    f"{label}: injection or spark at {earliest:g} °CA aTDC is later than any burn that is simulated "
                    f"({_core.engine.timing_window_cad[1]:g}): angles are °CA aTDC, negative before firing TDC"
                )
            if "soc_cad" in self.free and math.isfinite(earliest) and not {"soc_cad", name} & set(self.bounds):
                out[name] = (earliest, math.inf)
        return out

    def subset(self, places: Sequence[int]) -> Self:
        """Give the same request for some of the traces."""
        return replace(
            self,
            traces=tuple(self.traces[i] for i in places),
            labels=tuple(self.labels[i] for i in places),
            known_heat_j=tuple(self.known_heat_j[i] for i in places),
            start_values=None if self.start_values is None else tuple(self.start_values[i] for i in places),
        )

    def shifted(self, *, angle_cad: float = 0.0, pressure_bar: float = 0.0) -> Self:
        """Give the same request with a TDC or a pegging offset added to every trace."""
        moved = tuple(
            trace.assign(pressure_bar=trace["pressure_bar"] + pressure_bar).assign_coords(
                {ANGLE: trace[ANGLE] + angle_cad}
            )
            for trace in self.traces
        )
        for new, old in zip(moved, self.traces, strict=True):
            for name in (ANGLE, "pressure_bar"):
                new[name].attrs.update(old[name].attrs)
            # The same encoder counts the injection.
            new.attrs.update({name: float(old.attrs[name]) + angle_cad for name in _EARLIEST if _has(old, name)})
        return replace(self, traces=moved)


def listed(traces: Sequence[Any]) -> list[xr.Dataset]:
    """Give the traces of a calibration, one cycle each."""
    if isinstance(traces, str | os.PathLike | Mapping) or hasattr(traces, "to_numpy") or hasattr(traces, "sizes"):
        raise ShapeError(f"traces is one {type(traces).__name__}: pass a list of traces, [trace] for a single one")
    given = [one_cycle(trace) for trace in traces]
    if not given:
        raise DataError("no traces: a calibration needs at least one")
    return given


def pegged(
    trace: xr.Dataset,
    cylinder: Cylinder,
    point: OperatingPoint | None = None,
    *,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
) -> xr.Dataset:
    """Give a trace with absolute pressure, by a method of `mgdd.engine.analyze`."""
    if pegging == "none":
        return trace
    result = analyze(
        trace,
        cylinder,
        point=point,
        pegging=pegging,
        pegging_exponent=pegging_exponent,
        inlet_pressure_kpa=inlet_pressure_kpa,
        quiet=True,
    )
    moved = trace.assign(pressure_bar=trace["pressure_bar"] + float(result["pegging_bar"]))
    moved["pressure_bar"].attrs.update(trace["pressure_bar"].attrs)
    return moved


def default_free(cylinder: Cylinder) -> tuple[str, ...]:
    """Name what `fit_cylinder` frees for a burn law by default."""
    shape = SHAPE_FIELDS if cylinder.burn_shape == "double_wiebe" else ()
    return ("wall_heat_scale", *BURN_FIELDS, *shape)


def earliest_burn_cad(trace: xr.Dataset) -> float:
    """Give the earliest start of a burn: the injection or spark that the trace states, else NaN."""
    angles = [float(trace.attrs[name]) for name in _EARLIEST if _has(trace, name)]
    return min(angles) if angles else math.nan


def _has(trace: xr.Dataset, name: str) -> bool:
    return trace.attrs.get(name) is not None


def closed(trace: xr.Dataset, cylinder: Cylinder) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give angle and pressure between the valve events."""
    for name in (ANGLE, "pressure_bar"):
        if name not in trace.variables:
            raise DataError(f"the trace has no {name}: read it with mgdd.io.read_pressure")
    angle = trace[ANGLE].to_numpy()
    inside = (angle >= cylinder.ivc_cad - 1e-9) & (angle <= cylinder.evo_cad + 1e-9)
    return angle[inside], trace["pressure_bar"].to_numpy()[inside]


def _scatter_of_start(trace: xr.Dataset, cylinder: Cylinder) -> float:
    """Give the relative scatter of the first samples about a parabola of ln p over ln V."""
    angle, pressure = closed(trace, cylinder)
    first = (angle <= angle[:1] + _START_CAD) & (pressure > 0.0)
    if first.sum() < 8:
        return 0.0
    volume = np.log(_core.engine.volume_l(cylinder, angle[first]))
    log = np.log(pressure[first])
    rest = log - np.polyval(np.polyfit(volume, log, 2), volume)
    return float(np.sqrt(np.sum(rest**2) / (first.sum() - 3)))


def _labels(traces: Sequence[xr.Dataset]) -> tuple[str, ...]:
    names: list[str] = []
    for i, trace in enumerate(traces):
        name = str(trace.attrs.get("file", f"trace{i}"))
        while name in names:
            name += f"#{i}"
        names.append(name)
    return tuple(names)


def _all_known(heats: Sequence[float | None]) -> bool:
    return all(heat is not None for heat in heats)


def _known_heats(
    traces: Sequence[xr.Dataset],
    cylinder: Cylinder,
    fuel_heat_j: float | Sequence[float | None] | None,
    fuel_mg: float | None,
    free: Sequence[str] | None,
) -> tuple[float | None, ...]:
    """Give the known fuel heat of each trace: as given, by its attribute or the stated ``fuel_mg``; all or none."""
    if fuel_heat_j is not None and fuel_mg is not None:
        raise ParameterError("fuel_heat_j and point['fuel_mg'] both state the fuel: give one")
    heats: tuple[float | None, ...]
    if fuel_heat_j is None:
        per_mg = cylinder.lower_heating_value_mj_per_kg
        masses = [trace.attrs.get("fuel_mg", fuel_mg) for trace in traces]
        heats = tuple(None if mass is None else float(mass) * per_mg for mass in masses)
        if free is not None and "fuel_heat_j" in free:
            return (None,) * len(traces)
    else:
        is_number = isinstance(fuel_heat_j, int | float | np.number)
        heats = (fuel_heat_j,) * len(traces) if is_number else tuple(fuel_heat_j)  # type: ignore[arg-type, assignment]
        if free is not None and "fuel_heat_j" in free:
            raise ParameterError("fuel_heat_j is free and given: leave it out of free to hold it, or do not give it")
    if len(heats) != len(traces):
        raise ShapeError(f"fuel_heat_j has {len(heats)} entries for {len(traces)} traces: give one per trace")
    if any(heat is not None and not (math.isfinite(heat) and heat > 0.0) for heat in heats):
        raise ParameterError.of("fuel_heat_j", fuel_heat_j, "> 0 J for each trace")
    if not _all_known(heats) and any(heat is not None for heat in heats):
        raise ParameterError(
            "fuel_heat_j is known for some traces only: give it (or the attribute fuel_mg) for all, or for none"
        )
    return tuple(None if heat is None else float(heat) for heat in heats)
