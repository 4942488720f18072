"""The smooth throttle, and the fit of its ten parameters from one or many starts at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError
from mgdd.identify.starts import rank
from mgdd.io.parameters import ModelParameters, wanted
from mgdd.optimize.inputs import bounds_pair
from mgdd.optimize.least_squares import FitOptions, fit_of, fit_options, fit_run
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.results import Fit
from mgdd.results.describe import described
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import VARIABLES
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import RunInputs, SampledModel, columns_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_EXAMPLE = MappingProxyType(dict(zip(_core.identify.smooth_names, _core.identify.smooth_example, strict=True)))
_START_RAD = 0.14


@described
@dataclass(frozen=True, kw_only=True)
class SmoothThrottle(SampledModel, ModelParameters):
    """The smooth throttle: tanh friction and preload, coil current, RK4 with one step per sample.

    Parameters
    ----------
    parameters : mapping of str to float, optional
        Torque and friction in SI and rad, by name and in the order of `SmoothThrottle().parameters`; an example
        throttle without.
    inertia_kgm2, gear_ratio, inductance_h, supply_v : float
        Known constants [kg m², -, H, V].

    Raises
    ------
    ParameterError
        A parameter that is missing or unknown.
    """

    kind = "smooth"
    parameter_names = tuple(_EXAMPLE)
    settings = MappingProxyType(wanted(("inertia_kgm2", "gear_ratio", "inductance_h", "supply_v")))
    input_names = ("duty",)
    output_name = "angle_deg"
    state_names = ("angle_rad", "speed_rad_per_s", "current_a")

    parameters: Mapping[str, float] = field(default_factory=lambda: dict(_EXAMPLE))
    inertia_kgm2: float = 2e-3
    gear_ratio: float = 20.0
    inductance_h: float = 1e-3
    supply_v: float = 12.0

    def __post_init__(self) -> None:
        odd = set(self.parameters) ^ set(_EXAMPLE)
        if odd:
            raise ParameterError(
                f"parameters: {', '.join(sorted(odd))} missing or unknown: must be {', '.join(_EXAMPLE)}"
            )
        ordered = {name: float(self.parameters[name]) for name in _EXAMPLE}
        object.__setattr__(self, "parameters", MappingProxyType(ordered))
        for name, value in {**ordered, **self.constants}.items():
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError.of(name, value, "finite and > 0")

    @property
    def constants(self) -> dict[str, float]:
        """The known constants by name."""
        return {name: getattr(self, name) for name in self.settings}

    def _rest(self) -> list[float]:
        return [_START_RAD, 0.0, 0.0]

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        values = list(self.parameters.values())
        return _core.identify.simulate_smooth_throttle(
            values, run.columns[0], step_s=run.step_s, start=run.state, **self.constants
        )

    def fit(
        self,
        record: Any,
        *,
        start_values: ArrayLike,
        bounds: tuple[ArrayLike, ArrayLike],
        initial_state: Mapping[str, float] | Sequence[float] | None = None,
        options: FitOptions | None = None,
    ) -> Fit:
        """Fit the ten parameters to a record of duty and angle; the known constants are those of this model.

        Levenberg-Marquardt on the output error of the free run with exact sensitivities, in four stages: a twentieth of
        the record without and with the two smoothing widths, a quarter, then all of it with all ten parameters. Several
        starts run side by side in SIMD lanes. A smoothing width that the record does not determine is named.

        Parameters
        ----------
        record : xarray.Dataset, DataFrame or mapping of columns
            ``duty`` [-] and ``angle_deg`` [deg] over an evenly spaced ``time_s`` [s].
        start_values : array_like, shape (n_starts, 10) or (10,)
            In the order of `parameters`.
        bounds : pair of array_like, each of shape (10,)
            Least and largest values, positive.
        initial_state : mapping of str to float, or sequence of float, optional
            Known ``angle_rad``, ``speed_rad_per_s`` and ``current_a`` at the first sample; at rest without.
        options : FitOptions, optional
            A tolerance of 1e-9 of the last stage by default; the other options have no effect here and
            are refused.

        Returns
        -------
        mgdd.results.Fit
            The best start, and the reports of all (without their residual).

        Raises
        ------
        ShapeError
            Arrays that do not belong together.
        ParameterError
            A start outside its bounds, or a constant that is not positive.
        DataError
            A record that is not finite.
        Interrupted
            Ctrl-C; ``partial`` is the best fit of what was searched until then, None where nothing was.

        References
        ----------
        Nielsen (1999) for the damping; Moré (1978) for the scaling; Griewank and Walther (2008) for the sensitivities.
        """
        chosen = fit_options(options, tolerance=1e-9)
        table = np.atleast_2d(np.asarray(start_values, dtype=np.float64))
        if table.ndim != 2 or table.shape[1] != 10:
            raise ShapeError(f"start_values has shape {table.shape}: must be (n_starts, 10)")
        time, duty, angle = columns_of(record, ("time_s", "duty", "angle_deg"))
        state = self.state_of(initial_state)
        how: dict[str, Any] = {
            "duty": duty,
            "angle_deg": angle,
            **{side: _ten(each, side) for side, each in zip(("lower", "upper"), bounds_pair(bounds), strict=True)},
            "step_s": even_step(time),
            "start": state,
            **self.constants,
            "cost_tolerance": chosen.tolerance,
            "lanes": True,
        }
        result, stop = or_partial(lambda: _core.identify.fit_smooth_throttle(starts=table.tolist(), **how))
        reports = tuple(map(FitReport.from_core, result["reports"]))
        number, reached = rank(reports)
        best = reports[number]
        fitted = replace(self, parameters=dict(zip(_EXAMPLE, best.values.tolist(), strict=True)))
        modelled = fitted.simulate(record, initial_state=state)["angle_deg"].to_numpy()
        run = fit_run(time, angle, modelled, VARIABLES["angle_deg"]) if np.isfinite(modelled).all() else None
        errors = (report.rmse for report in reports)
        return hand_over(fit_of(best, fitted, run, errors, n_best=reached, start_reports=reports), stop)


def _ten(values: ArrayLike, name: str) -> list[float]:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (10,):
        raise ShapeError(f"{name} has shape {vector.shape}: must be (10,)")
    return [float(value) for value in vector]
