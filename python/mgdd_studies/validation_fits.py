"""Cycle models before and after calibration to measured traces, and what residuals of their kind leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint, find_optimum, simulate
from mgdd.engine.cycle import volume_l
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.records import CylinderFit, Load, starts_of
from mgdd.identify.engine.request import BURN_FIELDS, SHAPE_FIELDS, LoadBurn, Request, with_burn
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["LAWS", "STAGES", "Burn", "Draw", "Law", "Meeting", "best_slopes", "burns_of", "meet", "redraw", "stated_sd"]

STAGES = ("other loads", "heat release", "calibrated")
OBJECTIVE = "imep_closed_bar"  # a closed-valve trace carries no more
_STEP_CAD = 0.25  # a step of 1 °CA would let best timings jump by 0.05 °CA
_SLOPE_STDERRS = 3.0
_WHITE_SHARE = 0.1  # of the residual's rms: white noise as large as that would leave no pressure before compression


@dataclass(frozen=True)
class Law:
    """A cycle model that is calibrated: what is changed of the cylinder, and what all traces share and is fitted."""

    name: str
    changes: Mapping[str, Any]
    common: tuple[str, ...] = ()

    def fit(self, traces: Sequence[xr.Dataset], cylinder: Cylinder) -> CylinderFit:
        """Calibrate it; a burn does not start before its injection."""
        own = cylinder.replace(**self.changes)
        shape = SHAPE_FIELDS if own.burn_shape == "double_wiebe" else ()
        free = (*self.common, *BURN_FIELDS, *shape)
        others = dict.fromkeys(("fuel_heat_j", "bounds", "point", "start_values", "options"))
        # The study asks about errors for white noise alone, so what is held is not counted in them.
        return fit_request(Request.of(traces, own, free=free, step_cad=_STEP_CAD, integrator="trapezoid", **others))


_DOUBLE = {"burn_shape": "double_wiebe", "wall_heat_scale": 1.0}
LAWS = (
    Law("double Wiebe, linear gamma", {**_DOUBLE, "gamma_linear_300k": 1.40}, ("gamma_linear_300k",)),
    Law("double Wiebe, gamma 1.37", {**_DOUBLE, "gamma_model": "constant"}, ("wall_heat_scale",)),
    Law("Wiebe, linear gamma", {"burn_shape": "wiebe", "wall_heat_scale": 1.0}),
    Law("triangle, gamma 1.37", {"burn_shape": "triangle", "gamma_model": "constant", "wall_heat_scale": 0.5}),
)


@dataclass(frozen=True, kw_only=True)
class Burn:
    """A model of one load: cylinder with the burn's shape, conditions, and start of combustion [°CA aTDC]."""

    cylinder: Cylinder
    point: OperatingPoint
    soc_cad: float

    @classmethod
    def of(cls, load: Load) -> Burn:
        """Take it from a calibration."""
        return cls(cylinder=load.cylinder, point=load.point, soc_cad=load.soc_cad)

    def moved(self, name: str, by: float) -> Burn:
        """Give the same burn with one parameter of a calibration moved."""
        if name == "soc_cad":
            return replace(self, soc_cad=self.soc_cad + by)
        if name == "fuel_heat_j":
            by /= self.cylinder.lower_heating_value_mj_per_kg
            return replace(self, point=self.point.replace(fuel_mg=self.point.fuel_mg + by))
        if name == "burn_duration_cad":
            length = self.point.burn_duration_cad or 0.0
            return replace(self, point=self.point.replace(burn_duration_cad=length + by))
        return replace(self, cylinder=self.cylinder.replace(**{name: getattr(self.cylinder, name) + by}))

    @cached_property
    def best(self) -> tuple[float, float]:
        """Best CA50 [°CA aTDC], and curvature of J there over J [%/°CA²]."""
        found = find_optimum(self.cylinder, self.point, OBJECTIVE, step_cad=_STEP_CAD)
        return found["ca50_cad"], 100.0 * found.curvature / found.value

    def lost_percent(self, ca50_cad: float) -> float:
        """Give the share of J that is lost where the half of the heat is released then instead [%]."""
        found = find_optimum(self.cylinder, self.point, OBJECTIVE, step_cad=_STEP_CAD)
        soc = found["soc_cad"] + ca50_cad - found["ca50_cad"]
        there = simulate(self.cylinder, self.point, soc_cad=soc, step_cad=_STEP_CAD)
        return 100.0 * (1.0 - float(there[OBJECTIVE]) / found.value)


@dataclass(frozen=True, kw_only=True)
class Meeting:
    """How a model meets a trace: errors of pressure and closed IMEP, and the pressures themselves."""

    rmse_percent: float
    imep_closed_error_percent: float
    largest_error_bar: float
    angle_cad: NDArray[np.float64]
    measured_bar: NDArray[np.float64]
    model_bar: NDArray[np.float64]


def meet(burn: Burn, load: Load) -> Meeting:
    """Set a model beside the trace of a load, as a calibration does."""
    angle, measured = load.overlay[ANGLE].to_numpy(), load.overlay["measured_bar"].to_numpy()
    run = simulate(burn.cylinder, burn.point, soc_cad=burn.soc_cad, step_cad=_STEP_CAD)
    model = np.interp(angle, run[ANGLE].to_numpy(), run["pressure_bar"].to_numpy())
    volume = volume_l(burn.cylinder, angle)
    error = model - measured
    return Meeting(
        rmse_percent=100.0 * float(np.sqrt(np.mean(error**2))) / load.p_max_bar,
        imep_closed_error_percent=100.0 * float(np.trapezoid(error, volume) / np.trapezoid(measured, volume)),
        largest_error_bar=float(error[np.argmax(np.abs(error))]),
        angle_cad=angle,
        measured_bar=measured,
        model_bar=model,
    )


def burns_of(law: Law, fit: CylinderFit, traces: Sequence[xr.Dataset], cylinder: Cylinder) -> dict[str, list[Burn]]:
    """Give the model of every load by stage.

    ``other loads``: wall heat, gamma and shape of the burn are those of the other traces, their duration grows with a
    power of the fuel heat, the burn starts as long after the injection as theirs, and the fuel heat is as much above
    the trace's net heat as theirs. ``heat release``: burn angles and net heat of the trace itself, nothing fitted.
    ``calibrated``: the fit.
    """
    guessed = fit.request.starts(fit.request.measured())
    out: dict[str, list[Burn]] = {stage: [] for stage in STAGES}
    for at, load in enumerate(fit.loads):
        others = [k for k in range(len(traces)) if k != at]
        out["other loads"].append(
            _from_others(law.fit([traces[k] for k in others], cylinder), guessed, others, at, load)
        )
        own = guessed[at]
        base = fit.request.cylinder
        out["heat release"].append(
            Burn(cylinder=with_burn(base, own), point=_told(load.point, base, own), soc_cad=own.soc_cad)
        )
        out["calibrated"].append(Burn.of(load))
    return out


def _from_others(fit: CylinderFit, guessed: Sequence[Any], others: Sequence[int], at: int, load: Load) -> Burn:
    own = LoadBurn()
    heats = np.array([known.fuel_heat_j for known in fit.loads])
    ratio = np.median([known.fuel_heat_j / guessed[k].fuel_heat_j for known, k in zip(fit.loads, others, strict=True)])
    own.fuel_heat_j = float(ratio) * guessed[at].fuel_heat_j
    own.start_pressure_bar = load.point.intake_pressure_kpa / 100.0
    own.soc_cad = load.soi_cad + float(np.median([known.onset_against_soi_cad for known in fit.loads]))
    lengths = {"burn_duration_cad": [known.burn_duration_cad for known in fit.loads]}
    lengths["second_duration_cad"] = [known.cylinder.second_duration_cad for known in fit.loads]
    for name, values in lengths.items():
        power, level = np.polyfit(np.log(heats), np.log(values), 1)
        setattr(own, name, float(np.exp(level + power * np.log(own.fuel_heat_j))))
    for name in ("wiebe_m", "second_fraction", "second_delay_cad", "second_wiebe_m"):
        setattr(own, name, float(np.median([getattr(known.cylinder, name) for known in fit.loads])))
    cylinder = with_burn(fit.model, own)
    return Burn(cylinder=cylinder, point=_told(load.point, cylinder, own), soc_cad=own.soc_cad)


def _told(point: OperatingPoint, cylinder: Cylinder, burn: Any) -> OperatingPoint:
    fuel = burn.fuel_heat_j / cylinder.lower_heating_value_mj_per_kg
    return point.replace(fuel_mg=fuel, burn_duration_cad=burn.burn_duration_cad)


@dataclass(frozen=True, kw_only=True)
class Draw:
    """A calibration to the model's own pressure plus an error like the one it left."""

    values: NDArray[np.float64]
    stderr: NDArray[np.float64]
    best_ca50_cad: NDArray[np.float64]
    curvature_percent: NDArray[np.float64]
    stated_sd_cad: NDArray[np.float64]


def redraw(
    fit: CylinderFit, rng: np.random.Generator, *, block_cad: float | None, slopes: NDArray[np.float64] | None = None
) -> Draw:
    """Calibrate again to the model's pressure plus its residual times random factors that hold for about a block.

    The model of the fit is the truth of the draw. Without `block_cad` [°CA] the error is white noise of a tenth of the
    residual's rms; with `slopes`, those of `best_slopes`, the draw has the stated standard deviation of the best CA50.

    References
    ----------
    Shao (2010), the dependent wild bootstrap, with Bartlett's kernel.
    """
    traces = tuple(
        _disturbed(trace, load, rng, block_cad) for trace, load in zip(fit.request.traces, fit.loads, strict=True)
    )
    request = replace(fit.request, cylinder=fit.model, traces=traces, start_values=starts_of(fit))
    again = fit_request(request)
    best = np.array([Burn.of(load).best for load in again.loads])
    stated = np.full(len(again.loads), np.nan)
    if slopes is not None:
        stated = stated_sd(again, slopes)
    return Draw(
        values=np.array(again.report.values), stderr=np.array(again.report.stderr), best_ca50_cad=best[:, 0],
        curvature_percent=best[:, 1], stated_sd_cad=stated,
    )  # fmt: skip


def _disturbed(trace: xr.Dataset, load: Load, rng: np.random.Generator, block_cad: float | None) -> xr.Dataset:
    angle, error = load.overlay[ANGLE].to_numpy(), load.overlay["residual_bar"].to_numpy()
    if block_cad is None:
        drawn = _WHITE_SHARE * float(np.sqrt(np.mean(error**2))) * rng.standard_normal(error.size)
        drawn[0] = 0.0  # the model starts from the first sample, which would scale the whole trace
    else:
        width = max(1, round(block_cad / float(np.median(np.diff(angle)))))
        factors = np.convolve(rng.standard_normal(error.size + width - 1), np.ones(width), "valid") / np.sqrt(width)
        drawn = error * factors
    own = trace.sel({ANGLE: angle})
    out = own.assign(pressure_bar=(ANGLE, load.overlay["model_bar"].to_numpy() + drawn))
    out["pressure_bar"].attrs.update(trace["pressure_bar"].attrs)
    return out


def best_slopes(fit: CylinderFit) -> NDArray[np.float64]:
    """Give the slope of each load's best CA50 over every fitted parameter, shape (loads, parameters)."""
    out = np.zeros((len(fit.loads), len(fit.report.names)))
    for at, load in enumerate(fit.loads):
        burn = Burn.of(load)
        for k, name in enumerate(fit.report.names):
            own, _, file = name.partition("[")
            step = _SLOPE_STDERRS * float(fit.report.stderr[k])
            if (file and file != f"{load.file}]") or own == "soc_cad" or not np.isfinite(step):
                continue  # a later burn of the same shape has the same best CA50
            ends = [burn.moved(own, sign * step).best[0] for sign in (-1.0, 1.0)]
            out[at, k] = (ends[1] - ends[0]) / (2.0 * step)
    return out


def stated_sd(fit: CylinderFit, slopes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the standard deviation of each load's best CA50 that the fit states, by the slopes of `best_slopes`."""
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", slopes, np.nan_to_num(fit.report.covariance), slopes)))
