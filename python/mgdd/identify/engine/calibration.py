"""A calibration with all that judges it: profile of the wall heat, TDC, and every burn law on the same traces."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd.errors import argument
from mgdd.identify.engine.cylinder import fit_cylinder
from mgdd.identify.engine.profile import WallHeatProfile, wall_heat_profile
from mgdd.identify.engine.records import CylinderFit, figures_of, rmse_of
from mgdd.identify.engine.tdc import TdcEstimate, estimate_tdc
from mgdd.presets.meant import CylinderLike, PointLike, cylinder_of

if TYPE_CHECKING:
    import xarray as xr

_PER_LOAD = "rmse_percent imep_closed_error_percent soc_cad largest_error_bar largest_error_cad".split()
_MUCH_BETTER = 0.7  # of the RMSE

# Burn shape and gamma law of each row of the comparison; the last two are worth reading on.
LAWS = (
    ("triangle", "constant"),
    ("wiebe", "constant"),
    ("triangle", "linear"),
    ("wiebe", "linear"),
    ("double_wiebe", "constant"),
)


def compare_laws(
    traces: Sequence[xr.Dataset],
    cylinder: CylinderLike,
    *,
    point: PointLike | None = None,
    laws: Sequence[tuple[str, str]] = LAWS,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    progress: Callable[[str], None] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> list[CylinderFit]:
    """Fit every burn law to the same traces, each free to start before the injection if that fits better.

    What a law does with that freedom shows how wrong it is; `mgdd.identify.best_timing` bounds it.
    """
    cylinder, fits = cylinder_of(cylinder), []
    for shape, gamma in laws:
        start = min(
            cylinder.wall_heat_scale, _core.identify.wall_heat_scale_upper
        )  # a held scale may lie beyond the search
        law = cylinder.replace(burn_shape=shape, gamma_model=gamma, wall_heat_scale=start)
        if progress is not None:
            progress(f"calibrate {shape}, {gamma} gamma")
        fits.append(
            fit_cylinder(
                traces,
                law,
                fuel_heat_j=fuel_heat_j,
                bounds={"soc_cad": (None, None)},
                point=point,
                step_cad=step_cad,
                integrator=integrator,
            )
        )
    return fits


def better_laws(fit: CylinderFit, laws: Sequence[CylinderFit]) -> list[str]:
    """Doubt a fit where the best of the compared laws meets the traces much better; an empty list where none does."""
    best = min(laws, key=rmse_of)
    if not best.report.rmse < _MUCH_BETTER * fit.report.rmse:
        return []
    rmse, fit_rmse = 100.0 * best.report.rmse, 100.0 * fit.report.rmse
    met = f"{best.kind} meets the traces with an RMSE of {rmse:.2f} % against {fit_rmse:.2f} % of {fit.kind}"
    remedy = (
        f"{argument('burn_shape')} and {argument('gamma_model')} choose the law, mgdd engine optimum compares a family"
    )
    return [f"{met}: do not read burn, fuel heat or wall heat from the latter; {remedy}"]


def law_row(fit: CylinderFit) -> dict[str, Any]:
    """Give one row of the comparison of burn laws: lists over the traces."""
    has_soi = any(math.isfinite(load.soi_cad) for load in fit.loads)
    onset = {"onset_against_soi_cad": [load.onset_against_soi_cad for load in fit.loads]} if has_soi else {}
    return {
        "law": fit.kind,
        **onset,
        "file": [load.file for load in fit.loads],
        **{name: [getattr(load, name) for load in fit.loads] for name in _PER_LOAD},
        "wall_heat_scale": fit.model.wall_heat_scale,
        "warnings": [str(finding) for finding in fit.findings],
    }


TDC_SPAN_CAD = 2.0
_PER_TRACE = (
    "file p_max_bar rmse_bar rmse_percent imep_closed_error_percent soc_cad burn_duration_cad fuel_heat_j ca50_cad "
    "largest_error_bar largest_error_cad heat_loss_fraction"
).split()


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A fit with its reliability; the profile is None where the wall heat was not fitted."""

    fit: CylinderFit
    profile: WallHeatProfile | None
    tdc: TdcEstimate
    laws: list[CylinderFit]

    def unidentifiable(self) -> list[str]:
        """Name the parameters that the traces do not identify, by the fit or by the profile."""
        doubted = set(self.fit.report.unidentifiable)
        if self.profile is not None and not self.profile.identifiable:
            doubted.add("wall_heat_scale")
        return [name for name in self.fit.report.names if name in doubted]

    def doubts(self) -> list[str]:
        """Return the limitations found: findings of the fit, TDC, a law that fits much better."""
        return [*map(str, self.fit.findings), *self.tdc.doubts(), *better_laws(self.fit, self.laws)]

    def to_dict(self) -> dict[str, Any]:
        """Give everything as plain values."""
        return {
            "law": self.fit.kind,
            "status": self.fit.report.status,
            "traces": self._trace_rows(),
            "common": self._common(),
            "unidentifiable": self.unidentifiable(),
            "laws": [law_row(law) for law in self.laws],
            "tdc": self.tdc.figures,
            "warnings": self.doubts(),
            "cylinder": self.fit.model.to_dict(),
            "report": self.summary(),
        }

    def _trace_rows(self) -> list[dict[str, Any]]:
        names = list(_PER_TRACE)
        if any(math.isfinite(load.soi_cad) for load in self.fit.loads):
            names += ["soi_cad", "onset_against_soi_cad"]
        shape = [
            name for name in self.fit.model.fields() if any(n.startswith(f"{name}[") for n in self.fit.report.names)
        ]
        return [
            {name: figures_of(load)[name] for name in names} | {name: load.cylinder.to_dict()[name] for name in shape}
            for load in self.fit.loads
        ]

    def _common(self) -> dict[str, Any]:
        report, doubted = self.fit.report, self.unidentifiable()
        scale: dict[str, Any] = {"value": self.fit.model.wall_heat_scale, "stderr": None, "identifiable": None}
        common = {"wall_heat_scale": scale if self.profile is None else self.profile.to_dict()}
        for name, value, error in zip(report.names, report.values, report.stderr, strict=True):
            if "[" not in name and name != "wall_heat_scale":
                common[name] = {"value": float(value), "stderr": float(error), "identifiable": name not in doubted}
        return common

    def summary(self) -> str:
        """Return a short summary."""
        fit, profile, tdc = self.fit, self.profile, self.tdc
        lines = [f"Calibration with {fit.kind}: {fit.report.message}", "", *_loads(fit)]
        for name, value, error in zip(fit.report.names, fit.report.values, fit.report.stderr, strict=True):
            if "[" not in name and name != "wall_heat_scale":
                lines.append(f"  {name} = {value:.6g} +- {error:.2g} (all traces)")
        if profile is not None:
            error = f" +- {profile.stderr:.3f}" if profile.stderr == profile.stderr else ", at a bound"
            verdict = "identifiable" if profile.identifiable else "not identifiable from these traces"
            lines += [
                "",
                f"wall-heat scale {profile.value:.3f}{error}: {verdict}",
                f"  strongest correlation {profile.correlation:+.2f}, with {profile.correlated_with}",
                *(f"  {reason}" for reason in profile.reasons),
            ]
        if self.unidentifiable():
            lines += ["", f"not identifiable: {', '.join(self.unidentifiable())}"]
        place = f"{tdc.tdc_offset_cad:+.2f} CAD, {tdc.low_cad:+.2f} to {tdc.high_cad:+.2f} possible"
        lines += ["", f"TDC offset {place}; {tdc.cost}"]
        if self.doubts():
            named = [f"{name} is not identifiable from these traces" for name in self.unidentifiable()]  # as above
            lines += ["", "limitations found:", *(f"  - {text}" for text in self.doubts() if text not in named)]
        form = "  {:28} {:>9} {:>17} {:>10} {:>8}"
        head = ("law", "RMSE [%]", "closed IMEP [%]", "wall heat", "doubts")
        lines += ["", "every burn law on the same traces, the nearest first:", form.format(*head)]
        for law in sorted(self.laws, key=rmse_of):
            off = [load.imep_closed_error_percent for load in law.loads]
            between = f"{min(off):+.1f} to {max(off):+.1f}"
            scale = f"{law.model.wall_heat_scale:.2f}"
            lines.append(form.format(law.kind, f"{100.0 * law.report.rmse:.2f}", between, scale, len(law.findings)))
        return "\n".join(lines)


def _loads(fit: CylinderFit) -> list[str]:
    onset = any(load.soi_cad == load.soi_cad for load in fit.loads)
    last = f" {'SOC - SOI':>10}" if onset else ""
    form = "  {:24} {:>9} {:>15} {:>7} {:>9} {:>9} {:>7} {:>20}"
    head = ("trace", "RMSE [%]", "closed IMEP [%]", "SOC", "duration", "heat [J]", "CA50", "largest error")
    lines = [form.format(*head) + last]
    for load in fit.loads:
        error = f"{load.largest_error_bar:+.1f} bar at {load.largest_error_cad:.0f}"
        late = f" {load.onset_against_soi_cad:+10.1f}" if onset else ""
        lines.append(
            f"  {load.file:24} {load.rmse_percent:9.2f} {load.imep_closed_error_percent:+15.1f} {load.soc_cad:7.2f} "
            f"{load.burn_duration_cad:9.1f} {load.fuel_heat_j:9.0f} {load.ca50_cad:7.1f} {error:>20}{late}"
        )
    return lines


def judge_fit(fit: CylinderFit, *, fuel_heat_j: float | None, progress: Callable[[str], None]) -> Calibration:
    """Judge a fit of `mgdd.identify.fit_cylinder`, given this heat of the fuel, on its own traces."""
    request = fit.request
    traces, cylinder, point = list(request.traces), request.cylinder, request.point
    profile = None
    if "wall_heat_scale" in fit.report.names and len(fit.report.names) > 1:
        profile = wall_heat_profile(fit, progress=progress)
    tdc = estimate_tdc(traces, cylinder, point=point, fuel_heat_j=fuel_heat_j, span_cad=TDC_SPAN_CAD, progress=progress)
    laws = compare_laws(
        traces, cylinder, point=point, fuel_heat_j=fuel_heat_j, progress=progress, step_cad=request.step_cad,
        integrator=request.integrator,
    )  # fmt: skip
    return Calibration(fit=fit, profile=profile, tdc=tdc, laws=laws)
