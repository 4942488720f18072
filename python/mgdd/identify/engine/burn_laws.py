"""Every burn law on the same traces."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd.errors import argument
from mgdd.identify.engine.cylinder import fit_cylinder
from mgdd.identify.engine.records import CylinderFit
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
    best = min(laws, key=lambda law: law.report.rmse if law.report.rmse == law.report.rmse else float("inf"))
    if not best.report.rmse < _MUCH_BETTER * fit.report.rmse:
        return []
    rmse, own = 100.0 * best.report.rmse, 100.0 * fit.report.rmse
    met = f"{best.kind} meets the traces with an RMSE of {rmse:.2f} % against {own:.2f} % of {fit.kind}"
    remedy = (
        f"{argument('burn_shape')} and {argument('gamma_model')} choose the law, mgdd engine optimum compares a family"
    )
    return [f"{met}: do not read burn, fuel heat or wall heat from the latter; {remedy}"]


def law_row(fit: CylinderFit) -> dict[str, Any]:
    """Give one row of the comparison of burn laws: lists over the traces."""
    known = any(math.isfinite(load.soi_cad) for load in fit.loads)
    onset = {"onset_against_soi_cad": [load.onset_against_soi_cad for load in fit.loads]} if known else {}
    return {
        "law": fit.kind,
        **onset,
        "file": [load.file for load in fit.loads],
        **{name: [getattr(load, name) for load in fit.loads] for name in _PER_LOAD},
        "wall_heat_scale": fit.model.wall_heat_scale,
        "warnings": [str(finding) for finding in fit.findings],
    }
