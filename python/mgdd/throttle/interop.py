"""A throttle, plant or pseudo-Wiener model, as a sampled-data system of python-control (optional)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.throttle import Throttle
from mgdd.errors import ParameterError
from mgdd.throttle.pseudo_wiener import PseudoWiener

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["initial_state", "to_iosystem"]

# The order of the core's state; angles of motor and gear at plate scale, then of the plate.
_STATES = (
    *("gear_angle_deg", "gear_speed_deg_per_s", "current_a", "gear_bristle_deg"),
    *("plate_angle_deg", "plate_speed_deg_per_s", "plate_bristle_deg"),
)
_ANGLE = _STATES.index("plate_angle_deg")


def initial_state(model: Throttle | PseudoWiener, start_deg: float | None = None) -> NDArray[np.float64]:
    """Give the state of a throttle at rest, as systems of `to_iosystem` start from it.

    Parameters
    ----------
    model : Throttle or PseudoWiener
        The throttle.
    start_deg : float, optional
        Angle [deg], within the travel; limp-home if left out.

    Returns
    -------
    ndarray
        Of a Throttle angle [deg], speed [deg/s], current [A] and bristle [deg] of motor and gear, then angle, speed
        and bristle of the plate; of a PseudoWiener the states of its block in deg, s and duty.

    Raises
    ------
    mgdd.errors.ParameterError
        A start outside the travel.

    Examples
    --------
    >>> from mgdd.throttle import Throttle, initial_state
    >>> initial_state(Throttle(), 20.0).round(6).tolist()
    [20.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0]
    """
    values = model.parameters if isinstance(model, PseudoWiener) else model.to_dict()
    limp_home, closed, opened = (float(values[name]) for name in ("limp_home_deg", "closed_deg", "open_deg"))
    start = limp_home if start_deg is None else float(start_deg)
    if not closed <= start <= opened:
        raise ParameterError(f"start_deg = {start:g}: must lie within the travel, {closed:g} to {opened:g} deg")
    rest = _stepper(model).at_rest(start) if isinstance(model, PseudoWiener) else _core.throttle.Stepper.at_rest(start)
    return np.asarray(rest, dtype=np.float64)


def to_iosystem(
    model: Throttle | PseudoWiener, *, sample_s: float = 1e-3, step_s: float = 1e-4, name: str = "throttle"
) -> Any:
    """Give a throttle as a discrete-time `control.NonlinearIOSystem`: duty in, plate angle out.

    Parameters
    ----------
    model : Throttle or PseudoWiener
        The plant, or a pseudo-Wiener model of it.
    sample_s : float
        Time between samples, the time base of the system [s]; the duty holds in between.
    step_s : float
        Integration step of a Throttle [s], a whole number of times in the sample time.
    name : str
        Name of the system.

    Returns
    -------
    control.NonlinearIOSystem
        Input ``duty`` [-], clipped to -1..1; output ``angle_deg`` [deg] at the sample; the bridge brakes at zero duty.
        `initial_state` gives its start. Time comes last in its arrays, as everywhere in python-control.

    Raises
    ------
    ImportError
        python-control is not installed: ``pip install mgdd[control]``.
    mgdd.errors.ParameterError
        A sample that is not a whole number of steps, a step outside its domain.

    Notes
    -----
    The response is that of `simulate`, bit by bit up to the conversion between degrees and radians at each sample.

    Examples
    --------
    >>> import importlib.util
    >>> from mgdd.throttle import Throttle, to_iosystem
    >>> if importlib.util.find_spec("control"):
    ...     assert to_iosystem(Throttle()).dt == 0.001
    """
    try:
        import control
    except ImportError as error:
        raise ImportError("to_iosystem needs python-control: pip install 'mgdd[control]'") from error
    stepper: Any
    if isinstance(model, PseudoWiener):
        stepper = _stepper(model.at_sample(sample_s))
        states = [f"state_{i}" for i in range(initial_state(model).size)]
    else:
        stepper = _core.throttle.Stepper(model, sample_s=sample_s, step_s=step_s)
        states = list(_STATES)

    def update(_time: float, state: Any, inputs: Any, _params: dict[str, Any]) -> NDArray[np.float64]:
        return np.asarray(stepper.advance(np.asarray(state, dtype=np.float64), float(np.ravel(inputs)[0])))

    def output(_time: float, state: Any, _inputs: Any, _params: dict[str, Any]) -> NDArray[np.float64]:
        column = np.asarray(state, dtype=np.float64)
        return np.asarray([stepper.output(column) if isinstance(model, PseudoWiener) else column[_ANGLE]])

    return control.nlsys(update, output, inputs=["duty"], outputs=["angle_deg"], states=states, dt=sample_s, name=name)


def _stepper(model: PseudoWiener) -> Any:
    return _core.throttle.PseudoWienerStepper(model.kind, dict(model.parameters), **model._options)
