"""What a loop moves as a plate: a throttle, a fit of one, or a plant of the user's own."""

from __future__ import annotations

import math
import numbers
import os
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np

from mgdd import _core
from mgdd._arguments import shown
from mgdd.errors import ParameterError
from mgdd.identify import load_throttle_model
from mgdd.identify.throttle.fits import KINDS
from mgdd.io.parameters import ParameterFile
from mgdd.presets.meant import ThrottleLike, moving_throttle_of, throttle_model_of, unknown_to_a_fit, whole_delay_of
from mgdd.results import Fit
from mgdd.signals.model import SampledModel
from mgdd.throttle import PseudoWiener, Throttle


@runtime_checkable
class PlatePlant(Protocol):
    """A plate of the user's own: any object with these two; `copy.deepcopy` gives a fresh one for every run."""

    @property
    def output(self) -> float:
        """Angle now [deg]."""
        ...

    def step(self, duty: float, /) -> object:
        """Let a duty act for one sample; what is returned does not count."""
        ...


@dataclass(frozen=True)
class Plate:
    """A plant of the loop, and the fitted model that it was made of: that one says nothing of torques and currents."""

    plant: Throttle | PseudoWiener | PlatePlant
    model: Any = None

    def delay_samples(self, given: int | None, sample_s: float) -> int:
        """Return the whole samples of delay that are given, else those of the fit, else one."""
        own = whole_delay_of(self.model, sample_s)
        return given if given is not None else 1 if own is None else own

    def require_torques(self, **signals: Any) -> None:
        """Refuse a torque or a supply on what only a `Throttle` has them."""
        for name, value in signals.items():
            if value is None or (self.model is None and isinstance(self.plant, Throttle)):
                continue
            if self.model is not None:
                raise unknown_to_a_fit(name, value)
            raise ParameterError.of(name, value, "left out: a plant of your own has it in its step")

    def moving(self, sample_s: float, start_deg: float) -> PlatePlant:
        """Return a plant without sensors, at rest at an angle where it is a model."""
        if isinstance(self.plant, PseudoWiener):
            low, high = (self.plant.parameters[name] for name in ("closed_deg", "open_deg"))
            return _ModelPlate(self.plant.at_sample(sample_s), float(np.clip(start_deg, low, high)))
        return cast("PlatePlant", self.plant)


def require_loop_delay(delay_samples: int) -> None:
    """Refuse a delay between controller and bridge that the loops do not run."""
    whole = isinstance(delay_samples, numbers.Integral)
    ParameterError.unless(whole, "delay_samples", delay_samples, "a whole number in [0, 20]")
    ParameterError.unless(0 <= delay_samples <= 20, "delay_samples", delay_samples, "in [0, 20]")


def plate_of(given: Any) -> Plate:
    """Return the plant that is meant by a throttle, a preset, a fit, its model, the file of either, or an own plant."""
    if given is None or isinstance(given, Plate):
        return given or Plate(Throttle())
    meant = model_of(given)
    if isinstance(meant, PseudoWiener):  # its delay is the loop's
        return Plate(meant.replace(delay_samples=0.0), meant)
    if isinstance(meant, Throttle):
        return Plate(*moving_throttle_of(meant))
    if isinstance(meant, PlatePlant) and not isinstance(meant, type):
        return Plate(meant)
    if callable(getattr(meant, "step", None)):
        raise ParameterError(
            f"throttle = {shown(given)}: must have `output`, the angle now [deg], beside step(duty)", field="throttle"
        )
    return Plate(*moving_throttle_of(meant))


def model_of(given: Any) -> Any:
    """Return the throttle of a preset or its file, the model of a fit or its file, and everything else as it is."""
    if isinstance(given, Plate):
        return given.model or given.plant
    if isinstance(given, str | os.PathLike) and os.fspath(given).endswith(".toml"):
        kind = ParameterFile.read(given).kind
        if kind in KINDS:
            return load_throttle_model(given)
    return throttle_model_of(given)


class _ModelPlate:
    """A pseudo-Wiener model sample by sample."""

    def __init__(self, model: PseudoWiener, start_deg: float) -> None:
        self._stepper = _core.throttle.PseudoWienerStepper(model.kind, dict(model.parameters), **model._options)
        self._state = self._stepper.at_rest(start_deg)

    @property
    def output(self) -> float:
        return float(self._stepper.output(self._state))

    def step(self, duty: float, /) -> None:
        self._state = self._stepper.advance(self._state, duty)


class OwnPlate:
    """A plant that is not a `Throttle`, with white noise on its angle."""

    _still: Mapping[str, float] = MappingProxyType({"supply_v": math.nan})

    def __init__(
        self,
        plate: Plate,
        sample_s: float,
        first_deg: float,
        start_deg: float | None,
        noise_deg: float,
        seed: int,
    ) -> None:
        if start_deg is not None and plate.model is None:
            raise ParameterError.of("start_deg", start_deg, "left out: a plant of your own starts where it is")
        self._plant: PlatePlant = plate.moving(sample_s, first_deg if start_deg is None else start_deg)
        self.start_deg = self._angle()
        self._noise, self._rng = noise_deg, np.random.default_rng(seed)

    def _angle(self) -> float:
        given = self._plant.output
        try:
            angle = float(given() if callable(given) else given)
        except TypeError:
            raise ParameterError.of("output of the plant", given, "one number, the angle now [deg]") from None
        ParameterError.unless(math.isfinite(angle), "output of the plant", angle, "a finite angle [deg]")
        return angle

    def step(self, *, duty: float, **_none: float) -> dict[str, float]:
        """Let a duty act for one sample, and read the angle."""
        self._plant.step(float(np.clip(duty, -1.0, 1.0)))
        angle = self._angle()
        return {"angle_deg": angle, "sensed_angle_deg": angle + self._noise * float(self._rng.standard_normal())}


PlateLike = ThrottleLike | Fit | SampledModel | PlatePlant | Plate
