"""Every burn law on the same traces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from mgdd import _core
from mgdd._core.engine import OperatingPoint
from mgdd.identify.engine.cylinder import fit_cylinder
from mgdd.identify.engine.records import CylinderFit
from mgdd.presets.meant import CylinderLike, cylinder_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["LAWS", "compare_laws"]

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
    point: OperatingPoint | None = None,
    laws: Sequence[tuple[str, str]] = LAWS,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    progress: Callable[[str], None] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> list[CylinderFit]:
    """Fit every burn law to the same traces, each free to start before the injection if that fits better.

    What a law does with that freedom shows how wrong it is; `mgdd.identify.best_timing` bounds it.

    Parameters
    ----------
    traces, cylinder, point, fuel_heat_j, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`.
    laws : sequence of (burn_shape, gamma_model)
        Laws to compare.
    progress : callable, optional
        Called with a short text before each fit.

    Returns
    -------
    list of mgdd.results.Fit
        In the order of ``laws``.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify.engine.burn_laws import compare_laws
    >>> fits = compare_laws(datasets.read("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder)
    >>> [fit.kind for fit in fits][:2]
    ['triangle, gamma 1.37', 'wiebe, gamma 1.37']
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
