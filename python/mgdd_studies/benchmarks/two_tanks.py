"""Two tanks in a row with overflow: a model of a few lines, fitted to its free run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.identify import DiscreteModel, fit_model
from mgdd.optimize import FitOptions
from mgdd.results import Fit

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["fit_two_tanks", "start_levels", "two_tanks"]

SAMPLE_S = 4.0
_BRIM_V = 10.0  # the lower tank runs over here, and the sensor ends here
_SUBSTEPS = 2  # explicit Euler; the time constants of the tanks are minutes
_STARTS = (0.2, 0.5, 0.9)  # of the brim: where the upper level may stand, which is not measured
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
_BOUNDS = {
    "pump_per_s": (1e-5, 10.0),
    "upper_outflow_per_s": (1e-6, 10.0),
    "upper_exponent": (0.05, 2.0),
    "lower_outflow_per_s": (1e-6, 10.0),
    "lower_exponent": (0.05, 2.0),
    "lower_datum_v": (-5.0, 5.0),
    "upper_brim_v": (1.0, 200.0),
    "overflow_share": (0.0, 1.0),
    "state_0": (0.0, 200.0),
    "state_1": (-5.0, 20.0),
}


def levels(x: NDArray[Any], u: NDArray[Any], p: NDArray[Any]) -> tuple[Any, Any]:
    """Step two tanks by a sample: a pump fills the upper one, its outlet and part of its overflow the lower one.

    Torricelli's law with a free exponent and datum, and the overflow of Schoukens and Noël (2017).
    """
    pump, upper_outflow, upper_exponent, lower_outflow, lower_exponent, datum, brim, share = p
    upper, lower = x
    inflow, h = pump * np.maximum(u[0], 0.0), SAMPLE_S / _SUBSTEPS
    for _ in range(_SUBSTEPS):
        leaves = upper_outflow * np.maximum(upper, 0.0) ** upper_exponent
        rises = h * (leaves - lower_outflow * np.maximum(lower - datum, 0.0) ** lower_exponent)
        upper = np.maximum(upper + h * (inflow - leaves), 0.0)
        over = np.maximum(upper - brim, 0.0)
        upper, lower = upper - over, np.minimum(lower + rises + share * over, _BRIM_V)
    return upper, lower


def lower_level(x: NDArray[Any], u: NDArray[Any], p: NDArray[Any]) -> NDArray[Any]:
    """Measure the lower level."""
    del u, p
    level: NDArray[Any] = x[1]
    return level


def two_tanks(
    parameters: Mapping[str, float], *, delay_s: float = 0.0, initial_state: tuple[float, float] = (0.0, 0.0)
) -> DiscreteModel:
    """Make a model of the tanks, sampled every 4 s, from ``pump_v`` [V] to ``level_v`` [V].

    Parameters
    ----------
    parameters : mapping of str to float
        ``pump_per_s``, ``upper_outflow_per_s``, ``upper_exponent``, ``lower_outflow_per_s``, ``lower_exponent``,
        ``lower_datum_v``, ``upper_brim_v`` and ``overflow_share``, in this order. Levels have the unit of the sensor,
        V; an outflow is factor times level above its datum to the power of its exponent [V/s].
    delay_s : float
        Of the pump [s].
    initial_state : tuple of float
        Upper and lower level at the first sample [V].

    Returns
    -------
    DiscreteModel
        The tanks.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd_studies.benchmarks.two_tanks import two_tanks
    >>> tanks = two_tanks(dict(
    ...     pump_per_s=0.05, upper_outflow_per_s=0.05, upper_exponent=0.5, lower_outflow_per_s=0.05, lower_exponent=0.5,
    ...     lower_datum_v=0.0, upper_brim_v=10.0, overflow_share=0.5))
    >>> run = tanks.simulate({"time_s": 4.0 * np.arange(500), "pump_v": np.full(500, 2.0)})
    >>> round(float(run["level_v"][-1]), 2)  # steady: pump * 2 V = outflow * sqrt(level)
    4.0
    """
    ParameterError.unless(list(parameters) == list(_BASE), "parameters", list(parameters), f"{', '.join(_BASE)}")
    return DiscreteModel(
        step=levels,
        output=lower_level,
        parameters=parameters,
        initial_state=initial_state,
        input_names=("pump_v",),
        output_names=("level_v",),
        input_delay_s=delay_s,
        sample_s=SAMPLE_S,
    )


def start_levels(model: DiscreteModel, record: xr.Dataset, *, window: int = 50) -> tuple[float, float]:
    """Estimate the two levels at the first sample [V] from the first samples of a record, parameters held.

    Raises
    ------
    mgdd.errors.DataError
        A window outside the record, or times that are not even.
    """
    n = record.sizes["time_s"]
    if not 3 <= window <= n:
        raise DataError.of("window", window, f"in [3, {n}], the samples of the record")
    known, first = record.isel(time_s=slice(0, window)), float(record["level_v"][0])
    brim = model.parameters["upper_brim_v"]
    # The best of a few starts, since the brim makes hollows.
    fits = [
        fit_model(model, known, initial_state=[share * brim, first], free=(), free_state=(0, 1), bounds=_BOUNDS)
        for share in _STARTS
    ]
    upper, lower = min(fits, key=lambda fit: fit.report.cost).model.initial_state
    return upper, lower


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
        As of `mgdd.identify.fit_model`, which fits.

    Returns
    -------
    mgdd.results.Fit
        Report (parameters and the two levels at the first sample) [V] and model.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown form.
    mgdd.errors.DataError
        Times that are not even, or of another step than 4 s.

    References
    ----------
    Schoukens and Noël (2017), Three benchmarks addressing open challenges in nonlinear system identification.

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd_studies.benchmarks.two_tanks import fit_two_tanks
    >>> if "cascaded_tanks" in records.names():
    ...     assert fit_two_tanks(records.read("cascaded_tanks")[0]).train.rmse < 0.16
    """
    if form not in _FORMS:
        raise ParameterError.of("form", form, f"one of {', '.join(_FORMS)}")
    base, free = _FORMS[form]
    grey = form.startswith("grey_box")
    upper = min(0.8 * base["upper_brim_v"], 25.0) if grey else 4.0
    return fit_model(
        two_tanks(base, initial_state=(upper, float(record["level_v"][0]))),
        record,
        free=free,
        free_state=(0, 1),
        bounds=_BOUNDS,
        input_delay_s=(0.0, 2.0 * SAMPLE_S) if grey else 0.0,
        options=options,
    )
