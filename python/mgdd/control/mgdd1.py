"""MGDD-1: one duty, moved along the slope that a model predicts, whatever the model is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from numpy.typing import ArrayLike

from mgdd import _core
from mgdd._settings import remade, takes_settings_of
from mgdd.errors import ParameterError, did_you_mean

_MOST_STATES = 32  # of an object that guides, as in the core


class Guide(Protocol):
    """A black box that guides; its states go in and out, so that it need not remember anything."""

    n_states: int
    sample_s: float

    def at_rest(self, angle_deg: float, /) -> ArrayLike:
        """Give the state, shape (n_states,), at rest at an angle."""
        ...

    def step(self, state: Any, duty: float, /) -> ArrayLike:
        """Give the state after a sample with a duty."""
        ...

    def output(self, state: Any, /) -> float:
        """Give the angle [deg] of a state."""
        ...


@takes_settings_of(_core.loop.Mgdd1)
class Mgdd1:
    """The plainest model-guided controller of a throttle plate: one duty over the horizon, moved by model outputs only.

    Each sample it asks the guide for the angles at the present duty and at two others, and takes the slope between
    them; no parameter of the guide is read. With `adaptation_gain` 1 the step is one of Gauss and Newton, below 1 a
    gradient scheme. ``Mgdd1.fields()`` lists bounds and defaults.

    Parameters
    ----------
    guide : PseudoWiener or object, optional
        A model of any kind and quality, with the sample time of the controller; PW-R of the throttle ``P1`` if left
        out. Or any object with the numbers ``n_states`` (1 to 32) and ``sample_s`` and the methods ``at_rest(angle_deg)
        -> state``, ``step(state, duty) -> state``, ``output(state) -> angle_deg`` and, if it shall follow the
        measurement, ``correct(state, angle_deg) -> state``; a state is an array of ``n_states`` numbers, which the
        controller keeps.
    horizon_samples : int
        Length of the prediction [-], 1 to 1000.
    delay_samples : int
        From a duty to its effect, 0 to 20.
    **settings
        As `fields` lists them.

    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain, naming field, value and bound; a guide that lacks what it needs.

    Notes
    -----
    With a guide of the core a step cannot raise and takes microseconds. An object is called some ``6 horizon_samples``
    times per sample, and sets the pace. Its exceptions come out of `step`, a state of the wrong length is a
    `mgdd.errors.ShapeError`, a number that is not finite a `mgdd.errors.DataError` that names the method; each leaves
    the controller as it was. `mgdd.loop.track` runs it, `mgdd.loop.track_many` does not.

    See Also
    --------
    GuidedPredictive : three moves, exact slopes, learning.

    References
    ----------
    Tan (2018), Model-Guided Data-Driven Optimization and Control for Internal Combustion Engine Systems, section 7.3;
    the form is our reading.

    Examples
    --------
    >>> from mgdd.control import Mgdd1
    >>> from mgdd.loop import track
    >>> bool(track(Mgdd1(), "step:20:60", seed=1)["static_error_deg"] < 0.5)
    True

    A guide that has no more than that the plate follows the duty within some 50 ms:

    >>> class Lag:
    ...     n_states, sample_s = 1, 1e-3
    ...     def at_rest(self, angle_deg):
    ...         return [angle_deg]
    ...     def step(self, state, duty):
    ...         return [state[0] + 0.02 * (8.0 + 150.0 * duty - state[0])]
    ...     def output(self, state):
    ...         return state[0]
    ...     def correct(self, state, angle_deg):
    ...         return [angle_deg]
    >>> -1.0 <= Mgdd1(Lag()).step(40.0, 20.0) <= 1.0
    True
    """

    def __init__(
        self,
        guide: Any | None = None,
        *,
        horizon_samples: int = 16,
        delay_samples: int = 1,
        **settings: float,
    ) -> None:
        numbers: dict[str, float] = {name: each["default"] for name, each in self.fields().items()} | settings
        if strange := min(settings.keys() - self.fields().keys(), default=""):
            known = [*self.fields(), "guide", "horizon_samples", "delay_samples"]
            remedy = did_you_mean(strange, known) or "fields() has them"
            raise TypeError(f"Mgdd1() has no argument {strange!r}: {remedy}")
        self._settings: dict[str, Any] = {"horizon_samples": horizon_samples, "delay_samples": delay_samples, **numbers}
        self.guide = guide
        self._core: Any = _made(
            guide, {"horizon_samples": horizon_samples, "delay_samples": delay_samples, "numbers": numbers}
        )

    @staticmethod
    def fields() -> dict[str, dict[str, Any]]:
        """Give every number by name: unit, bounds, meaning, default.

        Returns
        -------
        dict
            As of the other controllers.
        """
        described: dict[str, dict[str, Any]] = _core.loop.Mgdd1.fields()
        return described

    @property
    def settings(self) -> dict[str, Any]:
        """All settings but the guide as a new dict: keywords that make the controller again."""
        return dict(self._settings)

    @property
    def duty(self) -> float:
        """Duty of the last sample [-]."""
        return float(self._core.duty)

    @property
    def state(self) -> dict[str, list[float]]:
        """What a run needs to go on bit for bit; a refused state changes nothing."""
        columns: dict[str, list[float]] = self._core.state
        return columns

    @state.setter
    def state(self, saved: Mapping[str, Sequence[float]]) -> None:
        self._core.state = {name: list(values) for name, values in saved.items()}

    def step(self, reference_deg: float, measurement_deg: float) -> float:
        """Give the duty of this sample.

        Parameters
        ----------
        reference_deg, measurement_deg : float
            Wanted and measured angle [deg]; NaN repeats the last reference or corrects nothing.

        Returns
        -------
        float
            Duty [-]; 0 before the first finite inputs.

        Raises
        ------
        Exception
            What an object that guides raised, or of mgdd where it answered wrongly; the controller is as before.
        """
        return float(self._core.step(reference_deg, measurement_deg))

    def set_sent(self, duty: float) -> None:
        """Set the duty that was really sent for the last one [-], where a gate changed it; ignored if not finite."""
        self._core.set_sent(duty)

    def reset(self) -> None:
        """Forget everything that was measured."""
        self._core.reset()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle settings, guide and state."""
        return remade, (Mgdd1, (self.guide,), self.settings, {"state": self.state})


def _made(guide: Any | None, settings: dict[str, Any]) -> Any:
    if guide is None:
        control = {"ramp_deg": 0.5, "tanh_deg_per_s": 40.0, "substeps": 1.0}
        return _core.loop.Mgdd1(_core.throttle.PseudoWienerModel("pw_r", control, friction="tanh"), **settings)
    inner = getattr(guide, "_core", None)
    if isinstance(inner, _core.throttle.PseudoWienerModel):
        return _core.loop.Mgdd1(inner, **settings)
    missing = [name for name in ("at_rest", "step", "output") if not callable(getattr(guide, name, None))]
    if missing:
        raise ParameterError.of("guide", guide, f"a PseudoWiener model, or an object with {', '.join(missing)}")
    n_states, sample_s = getattr(guide, "n_states", None), getattr(guide, "sample_s", None)
    if isinstance(n_states, bool) or not isinstance(n_states, int) or not 1 <= n_states <= _MOST_STATES:
        raise ParameterError.of("guide.n_states", n_states, f"a whole number in [1, {_MOST_STATES}]")
    if not isinstance(sample_s, float) or not (math.isfinite(sample_s) and sample_s > 0.0):
        raise ParameterError.of("guide.sample_s", sample_s, "a number > 0 s")
    return _core.loop.ObjectGuidedMgdd1(guide, n_states=n_states, sample_s=sample_s, **settings)
