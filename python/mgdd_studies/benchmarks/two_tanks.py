"""Two tanks in a row with overflow, fitted to their free run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from mgdd._core import systems
from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import ModelParameters, wanted
from mgdd.optimize.least_squares import FitOptions, LeastSquaresOptions, fit_of, fit_options, fit_run
from mgdd.parallel.finished import hand_over, keep_finished
from mgdd.results import Fit
from mgdd.results.describe import described
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import Label
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import RunInputs, SampledModel

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["TwoTanksModel", "fit_two_tanks"]

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
class TwoTanksModel(SampledModel, ModelParameters):
    """Two tanks in a row: a pump fills the upper one, its outlet and part of its overflow the lower one.

    Parameters
    ----------
    parameters : mapping of str to float
        ``pump_per_s``, ``upper_outflow_per_s``, ``upper_exponent``, ``lower_outflow_per_s``, ``lower_exponent``,
        ``lower_datum_v``, ``upper_brim_v``, ``overflow_share`` and ``delay_samples``. Levels have the unit of the
        sensor, V; an outflow is factor times level above its datum to the power of its exponent [V/s].
    lower_brim_v : float
        Level at which the lower tank runs over and the sensor ends [V].

    Notes
    -----
    The input is ``pump_v`` [V] over ``time_s`` [s]; states are ``upper_level_v`` and ``lower_level_v``, empty without;
    the output is ``level_v`` of the lower tank [V].

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd_studies.benchmarks.two_tanks import TwoTanksModel
    >>> tanks = TwoTanksModel(parameters=dict(
    ...     pump_per_s=0.05, upper_outflow_per_s=0.05, upper_exponent=0.5, lower_outflow_per_s=0.05, lower_exponent=0.5,
    ...     lower_datum_v=0.0, upper_brim_v=10.0, overflow_share=0.5, delay_samples=0.0))
    >>> run = tanks.simulate({"time_s": 4.0 * np.arange(500), "pump_v": np.full(500, 2.0)})
    >>> round(float(run["level_v"][-1]), 2)  # steady: pump * 2 V = outflow * sqrt(level)
    4.0
    """

    kind = "two_tanks"
    parameter_names = tuple(systems.TwoTanks.parameter_names)
    settings = MappingProxyType(wanted(("lower_brim_v",)))
    input_names = ("pump_v",)
    output_name = "level_v"
    state_names = ("upper_level_v", "lower_level_v")
    observed_state = "lower_level_v"
    labels = MappingProxyType({"pump_v": Label("V", "pump voltage"), "level_v": Label("V", "level")})

    parameters: Mapping[str, float]
    lower_brim_v: float = 10.0

    def _rest(self) -> list[float]:
        return [0.0, 0.0]

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        pump = run.columns[0]
        start = [*run.state, float(pump[0]), float(pump[0])]
        model = systems.TwoTanks(lower_brim_v=self.lower_brim_v)
        return np.asarray(model.free_run(parameters=_row(self.parameters), start=start, input=pump, dt_s=run.step_s))

    def _written(self) -> Mapping[str, float]:
        return dict(zip(self.parameter_names, _row(self.parameters), strict=True))

    def estimate_state(self, record: xr.Dataset, *, window: int = 50) -> dict[str, float]:
        """Estimate the two levels at the first sample from the first samples of a record, parameters held.

        Parameters
        ----------
        record : xarray.Dataset
            ``pump_v`` and ``level_v`` over ``time_s``.
        window : int
            Number of samples that may be seen.

        Returns
        -------
        dict of str to float
            ``upper_level_v`` and ``lower_level_v`` [V], for `simulate`.

        Raises
        ------
        mgdd.errors.DataError
            A window outside the record, or times that are not even.
        mgdd.errors.Interrupted
            Ctrl-C; ``partial`` is the best estimate so far.
        """
        n = record.sizes["time_s"]
        if not 3 <= window <= n:
            raise DataError.of("window", window, f"in [3, {n}], the samples of the record")
        known = record.isel(time_s=slice(0, window))
        # The upper level is not seen directly: the best of a few starts, since its brim makes hollows.
        brim = float(self.parameters["upper_brim_v"])
        found: list[systems.FreeRunFit] = []
        stop = keep_finished(
            lambda share: _fit(self.parameters, [], known, share * brim, self.lower_brim_v, 100), (0.2, 0.5, 0.9), found
        )
        best = min(found, key=_cost)
        return hand_over(dict(zip(self.state_names, map(float, best.starts[0][:2]), strict=True)), stop)


def fit_two_tanks(record: xr.Dataset, *, form: str = "grey_box", options: FitOptions | None = None) -> Fit:
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
    options : FitOptions, optional
        4 starts, scattered with seed 1, 200 trial steps per start and a tolerance of 1e-9 by default;
        the best by the error on this record is taken.

    Returns
    -------
    mgdd.results.Fit
        Report (parameters and the two levels at the first sample) [V] and model.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown form.
    mgdd.errors.DataError
        Times that are not even.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the best fit so far.

    References
    ----------
    Schoukens and Noël (2017), Three benchmarks addressing open challenges in nonlinear system identification.

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd.optimize import FitOptions
    >>> from mgdd_studies.benchmarks.two_tanks import fit_two_tanks
    >>> if "cascaded_tanks" in records.names():
    ...     fit = fit_two_tanks(records.read("cascaded_tanks")[0], options=FitOptions(n_starts=1))
    ...     assert fit.train.rmse < 0.16
    """
    if form not in _FORMS:
        raise ParameterError.of("form", form, f"one of {', '.join(_FORMS)}")
    chosen = fit_options(options, n_starts=4, seed=1, max_iterations=200, tolerance=1e-9)
    base, free = _FORMS[form]
    rng = np.random.default_rng(chosen.seed)

    def points() -> Iterator[dict[str, float]]:
        for index in range(chosen.n_starts):
            point = dict(base)
            for name in free if index else ():
                point[name] *= float(np.exp(0.15 * rng.standard_normal()))
            point["overflow_share"] = min(point["overflow_share"], 1.0)
            yield point

    def search(point: Mapping[str, float]) -> systems.FreeRunFit:
        upper = min(0.8 * point["upper_brim_v"], 25.0) if form.startswith("grey_box") else 4.0
        return _fit(point, list(free), record, upper, 10.0, chosen.max_iterations, chosen.tolerance)

    found: list[systems.FreeRunFit] = []
    stop = keep_finished(search, points(), found)
    best = min(found, key=_cost)
    names = tuple(systems.TwoTanks.parameter_names)
    report = FitReport.from_core(best.report, record["level_v"].to_numpy())
    model = TwoTanksModel(parameters=dict(zip(names, best.parameters, strict=True)))
    modelled = model.simulate(record, initial_state=[float(x) for x in best.starts[0][:2]])["level_v"]
    run = fit_run(record["time_s"].to_numpy(), record["level_v"].to_numpy(), modelled, model.labels["level_v"])
    return hand_over(fit_of(report, model, run, (float(one.report.rmse) for one in found)), stop)


def _cost(found: systems.FreeRunFit) -> float:
    return float(found.report.cost)


def _fit(
    parameters: Mapping[str, float],
    free: list[str],
    record: xr.Dataset,
    upper_v: float,
    lower_brim_v: float,
    max_iterations: int,
    tolerance: float = 1e-9,
) -> systems.FreeRunFit:
    time = record["time_s"].to_numpy()
    dt_s = even_step(time)
    pump, level = record["pump_v"].to_numpy(), record["level_v"].to_numpy()
    data = systems.FreeRunRecord(
        input=pump,
        output=level,
        start=[upper_v, float(level[0]), float(pump[0]), float(pump[0])],
        free_start=_UNKNOWN_LEVELS,
    )
    options = LeastSquaresOptions(max_iterations=max_iterations, cost_tolerance=tolerance)
    return systems.TwoTanks(lower_brim_v=lower_brim_v).fit(
        base=_row(parameters), free=free, records=[data], dt_s=dt_s, options=options
    )


def _row(parameters: Mapping[str, float]) -> list[float]:
    names = tuple(systems.TwoTanks.parameter_names)
    if set(parameters) != set(names):
        odd = sorted(set(parameters) ^ set(names))[0]
        raise ParameterError(f"parameter {odd!r} is unknown or missing: needed are {', '.join(names)}")
    return [float(parameters[name]) for name in names]
