"""Pseudo-Wiener models of a throttle: free run, prediction from a measurement, and files."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd._describe import described, rows_of
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io.parameters import FIT_NOTES, ParameterFile, Parameters, Wanted, entries, wanted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mgdd._core import Throttle

__all__ = ["PseudoWiener"]

_KINDS = ("pw_r", "pw_w", "pw_p")
_STEP_S = 5e-4  # of PW-R
_GAIN_SAMPLE_S = 1e-3  # the observer gains are per 1 ms
_UNEVEN = 1e-3


class PseudoWiener(Parameters):
    """A pseudo-Wiener model of a throttle.

    Parameters
    ----------
    kind : {"pw_r", "pw_w", "pw_p"}
        Second-order block with friction inside (the default of every fit); two lags and a static map of seven knots
        (strict Wiener); two lags and one to eight plays.
    parameters : mapping of str to float, optional
        Values by name, the name ends in the unit; what is left out keeps its default. Settings are among them:
        ``closed_deg open_deg sample_s delay_samples`` and, by kind, ``substeps ramp_deg tanh_deg_per_s dead_band_deg``,
        ``map_start`` (1: a free run starts where the map gives the first angle, 0: at rest without duty), ``plays``,
        ``knot_lower_duty knot_upper_duty``.
    switching : {"predicted", "measured"}
        PW-R: side of limp-home by the predicted position, or frozen by the measurement.
    friction : {"set_valued", "tanh"}
        PW-R: exact sticking, or smooth for gradients; the smooth one creeps under load at up to ``tanh_deg_per_s
        atanh(load / friction)``.

    Raises
    ------
    ParameterError
        An unknown kind or name, or a value outside its bounds.

    Notes
    -----
    The structures are this package's reading of the name in Tan (2018), section 7.1.2, whose equations were not at
    hand.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.throttle import PseudoWiener, Throttle
    >>> model = PseudoWiener.of_throttle(Throttle())
    >>> time = np.arange(200) * 1e-3
    >>> angle = model.simulate(time, np.full(200, 0.4), start_deg=8.0)
    >>> PseudoWiener.from_toml(model.to_toml()) == model
    True
    """

    def __init__(
        self,
        kind: str = "pw_r",
        parameters: Mapping[str, float] | None = None,
        *,
        switching: str = "predicted",
        friction: str = "set_valued",
    ) -> None:
        given = {str(name): float(value) for name, value in (parameters or {}).items()}
        self._core = _core.PseudoWienerModel(kind, given, switching=switching, friction=friction)
        self._options = {"switching": switching, "friction": friction}

    @classmethod
    def of_throttle(cls, throttle: Throttle) -> PseudoWiener:
        """Give PW-R with the groups of a first-principle throttle.

        Parameters
        ----------
        throttle : Throttle
            tau = J/b, G = g/J, preload, spring and Coulomb torque over the stall torque g.

        Returns
        -------
        PseudoWiener
            Without inductance, stiction and the softness of the stops, which PW-R does not have.
        """
        return cls("pw_r", _core.pseudo_wiener_of(throttle).parameters)

    @property
    def kind(self) -> str:
        """``pw_r``, ``pw_w`` or ``pw_p``."""
        return str(self._core.kind)

    @property
    def parameters(self) -> Mapping[str, float]:
        """All numbers by name, settings included."""
        return MappingProxyType({name: float(value) for name, value in self._core.parameters.items()})

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of every parameter."""
        known = _core.pseudo_wiener_units(self.kind)
        return MappingProxyType({name: str(known[name]) for name in self.parameters})

    def replace(self, **changes: float) -> PseudoWiener:
        """Give a copy with other numbers.

        Parameters
        ----------
        **changes : float
            Parameters by name.

        Returns
        -------
        PseudoWiener
            The copy.
        """
        return PseudoWiener(self.kind, {**self.parameters, **changes}, **self._options)

    def at_sample(self, sample_s: float) -> PseudoWiener:
        """Give the model for another sample time; PW-R keeps steps of at most 0.5 ms, a delay its seconds.

        Parameters
        ----------
        sample_s : float
            Time between samples [s].

        Returns
        -------
        PseudoWiener
            The copy, or the model itself.
        """
        old = self.parameters["sample_s"]
        if abs(sample_s - old) <= _UNEVEN * old:
            return self
        changes = {
            "sample_s": sample_s,
            "delay_samples": float(round(self.parameters["delay_samples"] * old / sample_s)),
        }
        if self.kind == "pw_r":
            changes["substeps"] = float(max(1, round(sample_s / _STEP_S)))
        return self.replace(**changes)

    def simulate(self, time_s: ArrayLike, duty: ArrayLike, *, start_deg: float) -> NDArray[np.float64]:
        """Run free from rest.

        Parameters
        ----------
        time_s : array_like, shape (n,)
            Even, increasing times [s].
        duty : array_like, shape (n,)
            Duty [-]; sample k acts from ``time_s[k]`` to ``time_s[k + 1]``.
        start_deg : float
            Angle at the first sample [deg].

        Returns
        -------
        ndarray, shape (n,)
            Angle at ``time_s`` [deg].

        Raises
        ------
        DataError
            An uneven time.
        ShapeError
            Columns of different length.
        """
        sample_s, u = _grid(time_s, duty)
        return np.asarray(self.at_sample(sample_s)._core.simulate(u, start_deg=float(start_deg)))

    def predict(
        self,
        time_s: ArrayLike,
        duty: ArrayLike,
        angle_deg: ArrayLike,
        horizon: int,
        *,
        angle_gain: float = 0.35,
        speed_gain_per_s: float = 35.0,
        bias_gain_duty_per_deg: float = 0.004,
    ) -> NDArray[np.float64]:
        """Predict ahead of a measured record, re-anchored at every sample.

        Parameters
        ----------
        time_s, duty, angle_deg : array_like, shape (n,)
            The record: time [s], duty [-], angle [deg].
        horizon : int
            Samples ahead, at least 1.
        angle_gain, speed_gain_per_s, bias_gain_duty_per_deg : float
            Observer of PW-R per 1 ms; they are scaled to the sample time. PW-W and PW-P predict
            ``angle(k) + simulated(k + horizon) - simulated(k)``.

        Returns
        -------
        ndarray, shape (n - horizon,)
            Entry k is the prediction of the angle at sample k + horizon from data up to k [deg].

        Raises
        ------
        DataError
            An uneven time.
        ShapeError
            Columns of different length.
        ParameterError
            A horizon that does not fit into the record.
        """
        sample_s, u = _grid(time_s, duty)
        share = sample_s / _GAIN_SAMPLE_S
        angle = np.asarray(angle_deg, dtype=np.float64)
        if horizon < 1:
            raise ParameterError(f"horizon = {horizon}: must be in [1, {u.size - 1}], below the samples of the log")
        return np.asarray(
            self.at_sample(sample_s)._core.predict(
                u,
                angle,
                int(horizon),
                angle_gain=1.0 - (1.0 - angle_gain) ** share,
                speed_gain_per_s=speed_gain_per_s * share,
                bias_gain_duty_per_deg=bias_gain_duty_per_deg * share,
            )
        )

    def slopes(
        self, duty: ArrayLike, *, start_deg: float, speed_deg_per_s: float = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Predict a horizon from a state, with exact sensitivities to every duty.

        Parameters
        ----------
        duty : array_like, shape (n,)
            Duty of the horizon [-].
        start_deg : float
            Angle now [deg].
        speed_deg_per_s : float
            Speed now [deg/s], PW-R only.

        Returns
        -------
        tuple of ndarray
            Angle after each sample [deg], shape (n,), and d angle / d duty [deg], shape (n, n), lower triangular.
        """
        angle, slope = self._core.slopes(
            np.asarray(duty, dtype=np.float64), start_deg=float(start_deg), speed_deg_per_s=float(speed_deg_per_s)
        )
        return np.asarray(angle), np.asarray(slope)

    def to_parameters(self) -> ParameterFile:
        """Give all numbers and choices, as `to_toml` writes them."""
        return ParameterFile(
            kind=self.kind,
            tables={"parameters": entries(self.parameters, self.units), "settings": entries(self._options)},
        )

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> PseudoWiener:
        """Make the model of a file that `to_toml` or a fit wrote."""
        file.expect(kinds=_KINDS, tables=("parameters", "settings", "fit?"), notes=FIT_NOTES)
        units = {name: str(unit) for name, unit in _core.pseudo_wiener_units(file.kind).items()}
        said = file.values("parameters", {name: Wanted(unit, required=False) for name, unit in units.items()})
        options = file.values("settings", wanted(("switching", "friction"), form="text"))
        model = cls(file.kind, said, **options)
        file.values("parameters", wanted(model.parameters, units))  # which of them there are, the numbers say
        return model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PseudoWiener) and self._core == other._core

    def __hash__(self) -> int:
        return hash((self.kind, tuple(self.parameters.values()), *self._options.values()))

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (self.kind, dict(self.parameters), dict(self._options))


described(
    PseudoWiener,
    title=lambda model: f"PseudoWiener {model.kind}, " + ", ".join(f"{n} {v}" for n, v in model._options.items()),
    rows=lambda model: rows_of(model.parameters, model.units),
)


def _rebuild(kind: str, parameters: Mapping[str, float], options: Mapping[str, str]) -> PseudoWiener:
    return PseudoWiener(kind, parameters, switching=options["switching"], friction=options["friction"])


def _grid(time_s: ArrayLike, duty: ArrayLike) -> tuple[float, NDArray[np.float64]]:
    time = np.asarray(time_s, dtype=np.float64)
    column = np.asarray(duty, dtype=np.float64)
    if time.ndim != 1 or time.size < 2 or column.shape != time.shape:
        raise ShapeError(f"time_s has shape {time.shape}, duty {column.shape}: must be two columns of one length >= 2")
    step = float(time[-1] - time[0]) / (time.size - 1)
    if not step > 0.0 or not np.allclose(np.diff(time), step, rtol=0.0, atol=0.1 * step):
        raise DataError("time_s is uneven: resample the record to a constant step")
    if not (np.isfinite(column).all() and np.abs(column).max() <= 1.0):
        raise DataError("duty: must be finite and in [-1, 1]")
    return step, column
