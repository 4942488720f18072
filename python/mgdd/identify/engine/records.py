"""Records of a calibration: a `Fit` with one load per trace."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.results import Fit
from mgdd.results.labels import VARIABLES, labelled_dataset
from mgdd.results.result import Result

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from mgdd.identify.engine.request import Request


@dataclass(frozen=True, kw_only=True, repr=False)
class Load(Result):
    """One load of a calibration: its burn and how well the model meets the measurement.

    Parameters
    ----------
    file : str
        Name of the trace.
    point : OperatingPoint
        Conditions, with the fitted fuel and burn duration, ready for `mgdd.engine.simulate`.
    cylinder : Cylinder
        The fitted cylinder with the burn shape of this load.
    soc_cad, burn_duration_cad, fuel_heat_j : float
        Fitted burn: start [°CA aTDC], duration [°CA], heat [J].
    soi_cad : float
        Start of injection [°CA aTDC]; NaN if unknown.
    onset_against_soi_cad : float
        SOC minus SOI [°CA]; a negative one burns before the injection. NaN if SOI is unknown.
    ca50_cad : float
        Angle of half burned of the burn law [°CA aTDC].
    p_max_bar : float
        Highest measured sample [bar].
    rmse_bar, rmse_percent : float
        Pressure error of the closed cycle [bar], [% of p_max].
    imep_closed_bar, imep_closed_error_percent : float
        Measured closed-cycle IMEP [bar] and the model's error [%].
    largest_error_bar, largest_error_cad : float
        Largest local error, model minus measured [bar], and its angle [°CA aTDC].
    heat_loss_fraction : float
        Modelled wall heat over fuel heat [-].
    overlay : xarray.Dataset
        ``measured_bar``, ``model_bar``, ``residual_bar`` over ``crank_angle_cad``.
    """

    file: str
    point: OperatingPoint = field(repr=False)
    cylinder: Cylinder = field(repr=False)
    soc_cad: float
    burn_duration_cad: float
    fuel_heat_j: float
    soi_cad: float
    onset_against_soi_cad: float
    ca50_cad: float
    p_max_bar: float
    rmse_bar: float
    rmse_percent: float
    imep_closed_bar: float
    imep_closed_error_percent: float
    largest_error_bar: float
    largest_error_cad: float
    heat_loss_fraction: float
    overlay: xr.Dataset = field(repr=False)

    @property
    def dataset(self) -> xr.Dataset:
        """The overlay, its figures beside it."""
        return self.overlay

    def _draw(self, ax: Any) -> Any:
        from mgdd.plot.calibration import calibration_overlay

        return calibration_overlay(self.overlay, ax=ax)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CylinderFit(Fit):
    """A calibrated cylinder: `model` is the cylinder with the common parameters fitted, `kind` its burn law.

    The residual of the report is (model - measured)/p_max, so its ``rmse`` is a fraction of p_max. Standard errors of
    `fit_cylinder` count, beside the scatter of the residual, gamma 0.03, pegging 0.1 bar and TDC 0.3 °CA off where they
    are held, and 5 % of a stated fuel; ``findings`` report where the laws of the model are too far off for that.

    Parameters
    ----------
    loads : tuple of Load
        Per trace, in the order given: burn, errors, and cylinder and point ready for `mgdd.engine.simulate`.
    table : xarray.Dataset
        The figures of all loads over ``file``.
    correlation_if_free : ndarray, shape (n, n)
        As the report's correlation, but with parameters at a bound taken as free there.
    request : object
        What was asked for, so that `wall_heat_profile` can ask again.
    """

    loads: tuple[Load, ...]
    table: xr.Dataset
    correlation_if_free: np.ndarray
    request: Request


def rmse_of(fit: CylinderFit) -> float:
    """Give the error of a fit, infinite where the search failed."""
    return fit.report.rmse if math.isfinite(fit.report.rmse) else math.inf


def burn_law(cylinder: Cylinder) -> str:
    """Name burn shape and gamma law, for tables."""
    gamma = f"{cylinder.gamma:g}" if cylinder.gamma_model == "constant" else cylinder.gamma_model
    return f"{cylinder.burn_shape}, gamma {gamma}"


def starts_of(fit: CylinderFit) -> tuple[dict[str, float], ...]:
    """Give the burn of each load as start values of another fit; a start pressure that was held stays the trace's."""
    shape = ("wiebe_m", "second_fraction", "second_delay_cad", "second_duration_cad", "second_wiebe_m")
    burn = ("soc_cad", "burn_duration_cad", "fuel_heat_j")
    free = "start_pressure_bar" in fit.request.free
    return tuple(
        {name: float(getattr(load, name)) for name in burn}
        | {name: float(getattr(load.cylinder, name)) for name in shape}
        | ({"start_pressure_bar": float(load.point.intake_pressure_kpa) / 100.0} if free else {})
        for load in fit.loads
    )


def figures_of(load: Load) -> dict[str, Any]:
    """Give the name and the numbers of a load, without the overlay and the parameter records."""
    skip = ("overlay", "point", "cylinder")
    return {name: getattr(load, name) for name in load.__dataclass_fields__ if name not in skip}


_LABELS = {
    "onset_against_soi_cad": ("°CA", "fitted burn start minus SOI"),
    "largest_error_bar": ("bar", "largest local error, model minus measured"),
    "largest_error_cad": ("°CA aTDC", "angle of the largest local error"),
}


def load_table(loads: Sequence[Load]) -> xr.Dataset:
    """Tabulate the figures of all loads."""
    rows = [figures_of(load) for load in loads]
    columns = {name: [row[name] for row in rows] for name in rows[0] if name != "file"}
    files = ("file", [row["file"] for row in rows], "-", "trace")
    labels = {name: _LABELS.get(name) or VARIABLES[name] for name in columns}
    return labelled_dataset({"file": files, **{name: ("file", columns[name], *labels[name]) for name in columns}})
