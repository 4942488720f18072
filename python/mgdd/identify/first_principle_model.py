"""The first-principle model of a throttle in the groups that duty and angle determine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd._describe import described
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io.parameters import FIT_NOTES, ParameterFile, Parameters, Wanted, entries, wanted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["FirstPrincipleModel"]

GROUP_NAMES = tuple(_core.throttle_group_names)
_SETTINGS = ("closed_deg", "open_deg", "ramp_deg", "substeps")


@described
@dataclass(frozen=True, kw_only=True)
class FirstPrincipleModel(Parameters):
    """Throttle in groups: set-valued friction, springs with preload on both sides, motor as a torque source.

    Parameters
    ----------
    parameters : mapping of str to float
        ``tau_s``, ``gain_deg_per_s2_per_duty``, preload ``beta_above_duty`` / ``beta_below_duty``, stiffness
        ``kappa_above_duty_per_deg`` / ``kappa_below_duty_per_deg``, friction ``delta_duty``, ``limp_home_deg`` and
        ``electrical_s`` (L/R, 0 for none).
    closed_deg, open_deg : float
        Mechanical stops [deg].
    ramp_deg : float
        Half width of the preload's ramp at limp-home [deg].
    substeps : int
        Steps per sample.

    Examples
    --------
    >>> from mgdd.identify import FirstPrincipleModel, throttle_start
    >>> model = FirstPrincipleModel(parameters=throttle_start())
    >>> model.simulate([0.0, 0.001, 0.002], [0.0, 0.0, 0.0], start_deg=8.0).tolist()
    [8.0, 8.0, 8.0]
    """

    parameters: Mapping[str, float]
    closed_deg: float = 0.0
    open_deg: float = 90.0
    ramp_deg: float = 0.25
    substeps: int = 2

    def __post_init__(self) -> None:
        missing = set(GROUP_NAMES) - set(self.parameters)
        if missing:
            raise ParameterError(f"parameters: {', '.join(sorted(missing))} missing")
        ordered = {name: float(self.parameters[name]) for name in GROUP_NAMES}
        for name, value in ordered.items():
            if not math.isfinite(value):
                raise ParameterError(f"{name} = {value!r}: must be finite")
            positive = name in ("tau_s", "gain_deg_per_s2_per_duty")
            if name != "limp_home_deg" and not (value > 0.0 if positive else value >= 0.0):
                raise ParameterError(f"{name} = {value!r}: must be {'>' if positive else '>='} 0")
        if not self.closed_deg < self.open_deg:
            raise ParameterError(f"open_deg = {self.open_deg!r}: must be above closed_deg = {self.closed_deg!r}")
        object.__setattr__(self, "parameters", MappingProxyType(ordered))

    @property
    def kind(self) -> str:
        """``first_principle``."""
        return "first_principle"

    def simulate(self, time_s: ArrayLike, duty: ArrayLike, *, start_deg: float) -> NDArray[np.float64]:
        """Run free from rest.

        Parameters
        ----------
        time_s, duty : array_like, shape (n,)
            Constant sample time [s]; duty [-], held to the next sample.
        start_deg : float
            Angle at the first sample [deg].

        Returns
        -------
        ndarray, shape (n,)
            Angle [deg] at every sample.
        """
        u = np.asarray(duty, dtype=np.float64)
        return _core.simulate_throttle_groups(
            list(self.parameters.values()),
            np.clip(u, -1.0, 1.0),
            step_s=sample_step(time_s, u.size),
            start=[float(start_deg), 0.0, 0.0],
            closed_deg=self.closed_deg,
            open_deg=self.open_deg,
            ramp_deg=self.ramp_deg,
            substeps=self.substeps,
        )

    def predict(self, time_s: ArrayLike, duty: ArrayLike, angle_deg: ArrayLike, horizon: int) -> NDArray[np.float64]:
        """Predict `horizon` samples ahead: the measured angle plus the free run's change over the horizon.

        Parameters
        ----------
        time_s, duty, angle_deg : array_like, shape (n,)
            Log [s, -, deg].
        horizon : int
            Samples, at least 1.

        Returns
        -------
        ndarray, shape (n - horizon,)
            Entry k is the angle [deg] at sample k + horizon.
        """
        measured = np.asarray(angle_deg, dtype=np.float64)
        if not 1 <= horizon < measured.size:
            raise ParameterError(f"horizon = {horizon}: must be within [1, {measured.size - 1}] samples")
        run = self.simulate(time_s, duty, start_deg=float(measured[0]))
        return measured[:-horizon] + run[horizon:] - run[:-horizon]

    def to_parameters(self) -> ParameterFile:
        """Give groups and settings, as `to_toml` writes them."""
        settings = {name: getattr(self, name) for name in _SETTINGS}
        return ParameterFile(
            kind=self.kind, tables={"parameters": entries(self.parameters), "settings": entries(settings)}
        )

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> FirstPrincipleModel:
        """Make the model of a file that `to_toml` or a fit wrote."""
        file.expect(kinds=("first_principle",), tables=("parameters", "settings", "fit?"), notes=FIT_NOTES)
        settings = file.values("settings", {**wanted(_SETTINGS), "substeps": Wanted(form="integer")})
        return cls(parameters=file.values("parameters", wanted(GROUP_NAMES)), **settings)


def sample_step(time_s: ArrayLike, size: int) -> float:
    time = np.asarray(time_s, dtype=np.float64)
    if time.ndim != 1 or time.size != size or size < 2:
        raise ShapeError(f"time_s has shape {time.shape}, duty {size} values: must be equal and at least 2")
    steps = np.diff(time)
    if steps.min() <= 0.0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise DataError("time_s: must rise in equal steps; read_throttle_log(..., step_s=...) resamples")
    return float((time[-1] - time[0]) / (size - 1))
