"""Two tanks in a row with overflow, fitted to their free run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd._describe import described
from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import ParameterFile, Parameters, entries, wanted
from mgdd.optimize import FitReport

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = ["TanksFit", "TwoTanksModel", "fit_two_tanks"]

_UNKNOWN_LEVELS = ["upper_level_v", "lower_level_v"]
# Starts: outflow exponents, and all else in the order of a first guess from time constants of minutes.
_BASE = {
    "pump_per_s": 0.065,
    "upper_outflow_per_s": 0.0066,
    "upper_exponent": 1.0,
    "lower_outflow_per_s": 0.145,
    "lower_exponent": 0.2,
    "lower_datum_v": -2.0,
    "upper_brim_v": 32.0,
    "overflow_share": 0.5,
    "delay_samples": 1.0,
}
_SQUARE_ROOT = {
    "pump_per_s": 0.05,
    "upper_outflow_per_s": 0.05,
    "upper_exponent": 0.5,
    "lower_outflow_per_s": 0.05,
    "lower_exponent": 0.5,
    "lower_datum_v": 0.0,
    "upper_brim_v": 200.0,
    "overflow_share": 0.0,
    "delay_samples": 0.0,
}
_FORMS: dict[str, tuple[dict[str, float], tuple[str, ...]]] = {
    "square_root": (_SQUARE_ROOT, ("pump_per_s", "upper_outflow_per_s", "lower_outflow_per_s")),
    "square_root_overflow": (
        {**_SQUARE_ROOT, "upper_brim_v": 8.0, "overflow_share": 0.8},
        ("pump_per_s", "upper_outflow_per_s", "lower_outflow_per_s", "upper_brim_v", "overflow_share"),
    ),
    "grey_box": (_BASE, tuple(name for name in _BASE if name != "upper_exponent")),
    "grey_box_free_exponent": (_BASE, tuple(_BASE)),
}


@described
@dataclass(frozen=True, kw_only=True)
class TwoTanksModel(Parameters):
    """Two tanks in a row: a pump fills the upper one, its outlet and part of its overflow the lower one.

    Parameters
    ----------
    parameters : mapping of str to float
        ``pump_per_s``, ``upper_outflow_per_s``, ``upper_exponent``, ``lower_outflow_per_s``, ``lower_exponent``,
        ``lower_datum_v``, ``upper_brim_v``, ``overflow_share`` and ``delay_samples``. Levels have the unit of the
        sensor, V; an outflow is factor times level above its datum to the power of its exponent [V/s].
    lower_brim_v : float
        Level at which the lower tank runs over and the sensor ends [V].

    Examples
    --------
    >>> from mgdd.identify import TwoTanksModel
    >>> tanks = TwoTanksModel(parameters=dict(
    ...     pump_per_s=0.05, upper_outflow_per_s=0.05, upper_exponent=0.5, lower_outflow_per_s=0.05, lower_exponent=0.5,
    ...     lower_datum_v=0.0, upper_brim_v=10.0, overflow_share=0.5, delay_samples=0.0))
    >>> level = tanks.simulate([2.0] * 500, dt_s=4.0, start_upper_v=0.0, start_lower_v=0.0)
    >>> round(float(level[-1]), 2)  # steady: pump * 2 V = outflow * sqrt(level)
    4.0
    """

    parameters: Mapping[str, float]
    lower_brim_v: float = 10.0

    def simulate(
        self, pump_v: ArrayLike, *, dt_s: float, start_upper_v: float, start_lower_v: float
    ) -> NDArray[np.float64]:
        """Run freely from two levels.

        Parameters
        ----------
        pump_v : array_like, shape (n,)
            Pump voltage [V], held over each sample.
        dt_s : float
            Sample time [s].
        start_upper_v, start_lower_v : float
            Levels at the first sample [V].

        Returns
        -------
        ndarray, shape (n,)
            Level of the lower tank [V].

        Raises
        ------
        mgdd.errors.ParameterError
            Unknown or missing parameters.
        """
        pump = np.asarray(pump_v, dtype=np.float64)
        start = [start_upper_v, start_lower_v, float(pump[0]), float(pump[0])]
        model = _core.TwoTanks(lower_brim_v=self.lower_brim_v)
        return np.asarray(model.free_run(parameters=_row(self.parameters), start=start, input=pump, dt_s=dt_s))

    def to_parameters(self) -> ParameterFile:
        """Give all parameters, as `to_toml` writes them."""
        values = dict(zip(_core.TwoTanks.parameter_names, _row(self.parameters), strict=True))
        tables = {"parameters": entries(values), "settings": entries({"lower_brim_v": float(self.lower_brim_v)})}
        return ParameterFile(kind="two_tanks", tables=tables)

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> TwoTanksModel:
        """Make the tanks of a file that `to_toml` wrote."""
        file.expect(kinds=("two_tanks",), tables=("parameters", "settings"))
        return cls(
            parameters=file.values("parameters", wanted(_core.TwoTanks.parameter_names)),
            lower_brim_v=file.values("settings", wanted(("lower_brim_v",)))["lower_brim_v"],
        )

    def estimate_start(self, record: xr.Dataset, *, window: int = 50) -> tuple[float, float]:
        """Estimate the two levels at the first sample from the first samples of a record, parameters held.

        Parameters
        ----------
        record : xarray.Dataset
            ``pump_v`` and ``level_v`` over ``time_s``.
        window : int
            Number of samples that may be seen.

        Returns
        -------
        tuple of float
            Upper and lower level [V].

        Raises
        ------
        mgdd.errors.DataError
            A window outside the record, or times that are not even.
        """
        n = record.sizes["time_s"]
        if not 3 <= window <= n:
            raise DataError(f"window = {window}: must be in [3, {n}], the samples of the record")
        known = record.isel(time_s=slice(0, window))
        # The upper level is not seen directly: the best of a few starts, since its brim makes hollows.
        brim = float(self.parameters["upper_brim_v"])
        fits = [_fit(self.parameters, [], known, share * brim, self.lower_brim_v, 100) for share in (0.2, 0.5, 0.9)]
        best = min(fits, key=lambda fit: float(fit.report.cost))
        return float(best.starts[0][0]), float(best.starts[0][1])


@described
@dataclass(frozen=True, kw_only=True)
class TanksFit:
    """Fitted tanks.

    Parameters
    ----------
    report : FitReport
        Parameters and the two levels at the start of the record; the residual is in V.
    model : TwoTanksModel
        The tanks.
    rmse_v : float
        Of the free run over the record [V].

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.identify import fit_two_tanks
    >>> if "cascaded_tanks" in datasets.available():
    ...     fit = fit_two_tanks(datasets.load_cascaded_tanks()[0], starts=1)
    ...     assert fit.rmse_v == fit.report.rmse
    """

    report: FitReport
    model: TwoTanksModel
    rmse_v: float


def fit_two_tanks(
    record: xr.Dataset, *, form: str = "grey_box", starts: int = 4, seed: int = 1, max_iterations: int = 200
) -> TanksFit:
    """Fit two tanks to their free run, the levels at the start included.

    Parameters
    ----------
    record : xarray.Dataset
        ``pump_v`` [V] and ``level_v`` [V] over ``time_s`` [s].
    form : str
        ``square_root``: Torricelli's law, no overflow; ``square_root_overflow``: with overflow of the upper tank;
        ``grey_box``: outflow of the upper tank proportional to its level, of the lower one by a power of the level
        above a datum, overflow in part into the lower tank, delay of the pump; ``grey_box_free_exponent``: the upper
        outflow by a power too.
    starts : int
        Number of starts, >= 1; the best by the error on this record is taken.
    seed : int
        Of the scattered starts.
    max_iterations : int
        Trial steps per start.

    Returns
    -------
    TanksFit
        Report, model and error.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown form or fewer than one start.
    mgdd.errors.DataError
        Times that are not even.

    References
    ----------
    Schoukens and Noël (2017), Three benchmarks addressing open challenges in nonlinear system identification.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.identify import fit_two_tanks
    >>> if "cascaded_tanks" in datasets.available():
    ...     fit = fit_two_tanks(datasets.load_cascaded_tanks()[0], starts=1)
    ...     assert fit.rmse_v < 0.16
    """
    if form not in _FORMS:
        raise ParameterError(f"form = {form!r}: must be one of {', '.join(_FORMS)}")
    if starts < 1:
        raise ParameterError(f"starts = {starts}: must be >= 1")
    base, free = _FORMS[form]
    rng = np.random.default_rng(seed)
    fits = []
    for index in range(starts):
        point = dict(base)
        for name in free if index else ():
            point[name] *= float(np.exp(0.15 * rng.standard_normal()))
        point["overflow_share"] = min(point["overflow_share"], 1.0)
        upper = min(0.8 * point["upper_brim_v"], 25.0) if form.startswith("grey_box") else 4.0
        fits.append(_fit(point, list(free), record, upper, 10.0, max_iterations))
    best = min(fits, key=lambda fit: float(fit.report.cost))
    names = tuple(_core.TwoTanks.parameter_names)
    return TanksFit(
        report=FitReport.from_core(best.report, record["level_v"].to_numpy()),
        model=TwoTanksModel(parameters=dict(zip(names, best.parameters, strict=True))),
        rmse_v=float(best.report.rmse),
    )


def _fit(
    parameters: Mapping[str, float],
    free: list[str],
    record: xr.Dataset,
    upper_v: float,
    lower_brim_v: float,
    max_iterations: int,
) -> _core.FreeRunFit:
    time = record["time_s"].to_numpy()
    dt_s = float(time[1] - time[0])
    if not (dt_s > 0.0 and np.allclose(np.diff(time), dt_s, rtol=1e-3)):
        raise DataError("time_s is not evenly spaced: resample the record first")
    pump, level = record["pump_v"].to_numpy(), record["level_v"].to_numpy()
    data = _core.FreeRunRecord(
        input=pump,
        output=level,
        start=[upper_v, float(level[0]), float(pump[0]), float(pump[0])],
        free_start=_UNKNOWN_LEVELS,
    )
    options = _core.LeastSquaresOptions(max_iterations=max_iterations, cost_tolerance=1e-9)
    return _core.TwoTanks(lower_brim_v=lower_brim_v).fit(
        base=_row(parameters), free=free, records=[data], dt_s=dt_s, options=options
    )


def _row(parameters: Mapping[str, float]) -> list[float]:
    names = tuple(_core.TwoTanks.parameter_names)
    if set(parameters) != set(names):
        odd = sorted(set(parameters) ^ set(names))[0]
        raise ParameterError(f"parameter {odd!r} is unknown or missing: needed are {', '.join(names)}")
    return [float(parameters[name]) for name in names]
