"""A throttle, plant or pseudo-Wiener model, as a sampled-data system of python-control (optional)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd._core.throttle import Throttle
from mgdd.errors import ParameterError
from mgdd.presets.meant import ThrottleLike, moving_throttle_of, throttle_model_of, whole_delay_of
from mgdd.results import Fit
from mgdd.signals.model import SampledModel
from mgdd.throttle.pseudo_wiener import PseudoWiener

# The order of the core's state; angles of motor and gear at plate scale, then of the plate.
_STATES = (
    *("gear_angle_deg", "gear_speed_deg_per_s", "current_a", "gear_bristle_deg"),
    *("plate_angle_deg", "plate_speed_deg_per_s", "plate_bristle_deg"),
)
_ANGLE = _STATES.index("plate_angle_deg")


def to_iosystem(
    model: ThrottleLike | Fit | SampledModel,
    *,
    sample_s: float = 1e-3,
    step_s: float = 1e-4,
    start_deg: float | None = None,
    name: str = "throttle",
) -> tuple[Any, NDArray[np.float64]]:
    """Give a throttle as a discrete-time `control.NonlinearIOSystem`, duty in, plate angle out, and its state at rest.

    Parameters
    ----------
    model : Throttle, Preset, str or path-like, Fit or its model
        The plant, or a model of it. The delay of a first-principle fit is whole samples, its current has no unit.
    sample_s : float
        Time between samples, the time base of the system [s]; the duty holds in between.
    step_s : float
        Integration step of a Throttle [s], a whole number of times in the sample time.
    start_deg : float, optional
        Angle at the start [deg], within the travel; limp-home if left out.
    name : str
        Name of the system.

    Returns
    -------
    control.NonlinearIOSystem
        Input ``duty`` [-], clipped to -1..1; output ``angle_deg`` [deg] at the sample; the bridge brakes at zero duty.
        Time comes last in its arrays, as everywhere in python-control.
    ndarray
        The state at rest. Of a Throttle angle [deg], speed [deg/s], current [A] and bristle [deg] of motor and gear,
        then angle, speed and bristle of the plate, of a fit the duties that wait; of a PseudoWiener the states of its
        block in deg, s and duty.

    Raises
    ------
    ImportError
        python-control is not installed: ``pip install mgdd[control]``.
    mgdd.errors.ParameterError
        A sample that is not a whole number of steps, a step outside its domain, a start outside the travel.

    Notes
    -----
    The response is that of `simulate`, bit by bit up to the conversion between degrees and radians at each sample.

    Examples
    --------
    >>> import importlib.util
    >>> from mgdd.throttle import Throttle, to_iosystem
    >>> if importlib.util.find_spec("control"):
    ...     system, rest = to_iosystem(Throttle(), start_deg=20.0)
    ...     assert system.dt == 0.001
    ...     assert rest.round(6).tolist() == [20.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0]
    """
    meant, waiting = throttle_model_of(model), 0
    plant_model: Throttle | PseudoWiener
    if isinstance(meant, PseudoWiener):
        plant_model = meant
    else:
        plant_model, fit = moving_throttle_of(meant)
        waiting = whole_delay_of(fit, sample_s) or 0
    try:
        import control
    except ImportError as error:
        raise ImportError("to_iosystem needs python-control: pip install 'mgdd[control]'") from error
    rest = np.concatenate([_at_rest(plant_model, start_deg), np.zeros(waiting)])
    stepper: Any
    if isinstance(plant_model, PseudoWiener):
        stepper = _stepper(plant_model.at_sample(sample_s))
        states = [f"state_{i}" for i in range(rest.size)]
    else:
        stepper = _core.throttle.Stepper(plant_model, sample_s=sample_s, step_s=step_s)
        states = [*_STATES, *(f"duty_{waiting - i}_samples_ago" for i in range(waiting))]
    moving = rest.size - waiting

    def update(_time: float, state: Any, inputs: Any, _params: dict[str, Any]) -> NDArray[np.float64]:
        column = np.concatenate([np.asarray(state, dtype=np.float64), np.ravel(inputs)[:1]])
        return np.concatenate([stepper.advance(column[:moving], float(column[moving])), column[moving + 1 :]])

    def output(_time: float, state: Any, _inputs: Any, _params: dict[str, Any]) -> NDArray[np.float64]:
        column = np.asarray(state, dtype=np.float64)
        return np.asarray([stepper.output(column) if isinstance(plant_model, PseudoWiener) else column[_ANGLE]])

    system = control.nlsys(
        update, output, inputs=["duty"], outputs=["angle_deg"], states=states, dt=sample_s, name=name
    )
    return system, rest


def _at_rest(model: Throttle | PseudoWiener, start_deg: float | None) -> NDArray[np.float64]:
    values = model.parameters if isinstance(model, PseudoWiener) else model.to_dict()
    limp_home, closed, opened = (float(values[name]) for name in ("limp_home_deg", "closed_deg", "open_deg"))
    start = limp_home if start_deg is None else float(start_deg)
    if not closed <= start <= opened:
        raise ParameterError(f"start_deg = {start:g}: must lie within the travel, {closed:g} to {opened:g} deg")
    rest = _stepper(model).at_rest(start) if isinstance(model, PseudoWiener) else _core.throttle.Stepper.at_rest(start)
    return np.asarray(rest, dtype=np.float64)


def _stepper(model: PseudoWiener) -> Any:
    return _core.throttle.PseudoWienerStepper(model.kind, dict(model.parameters), **model._options)
