"""The fit of a differential equation in one call."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mgdd.identify.grey_box.fit import fit_model
from mgdd.identify.grey_box.model import Interpolation
from mgdd.identify.grey_box.models import Derivative, OdeModel, Output, first_states
from mgdd.optimize.least_squares import FitOptions
from mgdd.results import Fit


def fit_ode(
    derivative: Derivative,
    record: Any,
    *,
    parameters: Mapping[str, float],
    initial_state: ArrayLike,
    input_names: Sequence[str] = ("u",),
    output_names: Sequence[str] = ("y",),
    output: Output | None = None,
    free: Collection[str] | None = None,
    free_state: Sequence[int] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    log_scaled: Collection[str] = (),
    interpolation: Interpolation = "hold",
    input_delay_s: float | tuple[float, float] = 0.0,
    substeps: int = 1,
    skip: int = 0,
    sigma: Any = 1.0,
    horizon: int | None = None,
    shooting_samples: int | None = None,
    vectorized: bool = True,
    options: FitOptions | None = None,
) -> Fit:
    """Fit parameters and start of the user's own ODE to records: `fit_model` of an `OdeModel`, in one call.

    Write the equation with ``x[0]``, ``p[1]`` and NumPy functions, and it takes the columns of all central differences
    unchanged. For long records or many parameters write the model as a C++ functor instead (docs, Identification).

    Parameters
    ----------
    derivative, parameters, input_names, output_names, output, interpolation, substeps, vectorized
        As of `OdeModel`; `parameters` are the start values.
    record, free, free_state, bounds, log_scaled, input_delay_s, skip, sigma, horizon, shooting_samples, options
        As of `fit_model`.
    initial_state : array_like, shape (n_states,) or (n_records, n_states)
        State at the first sample; for the free ones where the search starts.

    Returns
    -------
    mgdd.results.Fit
        As of `fit_model`.

    Raises
    ------
    ParameterError, ShapeError, DataError, Interrupted
        As `fit_model` does.

    See Also
    --------
    mgdd.identify.fit_model : any model, with the meaning of the options.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import fit_ode
    >>> time = np.linspace(0.0, 10.0, 201)
    >>> def lag(t, x, u, p):
    ...     return (p[0] * u[0] - x) / p[1]
    >>> u = np.where(time > 0.99, 1.0, 0.0)
    >>> y = np.where(time > 1.3, 2.0 * (1.0 - np.exp(-(time - 1.3) / 0.5)), 0.0)
    >>> record = {"time_s": time, "u": u, "y": y}
    >>> start = {"gain": 1.0, "time_constant_s": 1.0}
    >>> fit = fit_ode(lag, record, parameters=start, initial_state=[0.0], input_delay_s=(0.0, 1.0))
    >>> fit.report.values.round(2).tolist()
    [2.0, 0.5, 0.3]
    """
    states = np.atleast_2d(np.asarray(initial_state, dtype=np.float64))
    model = OdeModel(
        derivative=derivative,
        output=output or first_states,
        parameters=parameters,
        initial_state=tuple(states[0].tolist()),
        substeps=substeps,
        input_names=tuple(input_names),
        output_names=tuple(output_names),
        interpolation=interpolation,
        vectorized=vectorized,
    )
    return fit_model(
        model,
        record,
        initial_state=initial_state,
        free=free,
        free_state=free_state,
        bounds=bounds,
        log_scaled=log_scaled,
        input_delay_s=input_delay_s,
        skip=skip,
        sigma=sigma,
        horizon=horizon,
        shooting_samples=shooting_samples,
        options=options,
    )
