"""What a calibration hands back: one record per load, one for all."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core import Cylinder, OperatingPoint
from mgdd._describe import described
from mgdd.optimize import FitReport

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CylinderFit", "LoadFit"]


@described
@dataclass(frozen=True, kw_only=True)
class LoadFit:
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

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import fit_cylinder
    >>> fit = fit_cylinder(datasets.load_hd_traces()[:1], presets.load("hd_diesel_128x144").cylinder)
    >>> fit.loads[0].rmse_percent < 1.0
    True
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

    def to_dict(self) -> dict[str, Any]:
        """Give the scalars of this load as a dict, without the overlay and the parameter records.

        Returns
        -------
        dict
            Field names to values.
        """
        skip = ("overlay", "point", "cylinder")
        return {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in skip}


@dataclass(frozen=True, kw_only=True)
class CylinderFit:
    """A calibrated cylinder with its report.

    Parameters
    ----------
    cylinder : Cylinder
        With the common parameters fitted.
    report : mgdd.optimize.FitReport
        Estimates, standard errors, correlation. The residual is (model - measured)/p_max, so ``rmse`` is a fraction of
        p_max. Standard errors take the residual as white noise; model error makes the true ones larger.
    loads : tuple of LoadFit
        Per trace, in the order given.
    warnings : tuple of str
        What to distrust, in words.
    correlation_if_free : ndarray, shape (n, n)
        As the report's correlation, but with parameters at a bound taken as free there.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import fit_cylinder
    >>> fit = fit_cylinder(datasets.load_hd_traces(), presets.load("hd_diesel_128x144").cylinder)
    >>> max(load.rmse_percent for load in fit.loads) < 1.0
    True
    >>> "wall_heat_scale" in fit.report.unidentifiable
    True
    """

    cylinder: Cylinder
    report: FitReport
    loads: tuple[LoadFit, ...]
    warnings: tuple[str, ...]
    correlation_if_free: np.ndarray = field(repr=False)

    @property
    def burn_law(self) -> str:
        """Burn shape and gamma law, for tables."""
        gamma = f"{self.cylinder.gamma:g}" if self.cylinder.gamma_model == "constant" else self.cylinder.gamma_model
        return f"{self.cylinder.burn_shape}, gamma {gamma}"

    def correlations(self, name: str) -> dict[str, float]:
        """Give the correlations of one parameter with all others, strongest first.

        Parameters
        ----------
        name : str
            As in ``report.names``.

        Returns
        -------
        dict of str to float
            Of the linearised problem at the estimate; a parameter at a bound counts as free there.
        """
        row = self.correlation_if_free[self.report.names.index(name)]
        pairs = [(n, float(c)) for n, c in zip(self.report.names, row, strict=True) if n != name and np.isfinite(c)]
        return dict(sorted(pairs, key=lambda pair: -abs(pair[1])))


described(
    CylinderFit,
    rows=lambda fit: {
        "burn_law": fit.burn_law,
        "status": fit.report.status,
        "wall_heat_scale": fit.cylinder.wall_heat_scale,
        "rmse_percent": {load.file: load.rmse_percent for load in fit.loads},
        "imep_closed_error_percent": {load.file: load.imep_closed_error_percent for load in fit.loads},
        "unidentifiable": fit.report.unidentifiable,
        "warnings": fit.warnings,
    },
)
