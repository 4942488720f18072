"""Pseudo-Wiener models of a throttle: free run, prediction from a measurement, and files."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mgdd._core import Throttle

__all__ = ["PseudoWiener"]

_STEP_S = 5e-4  # of PW-R
_GAIN_SAMPLE_S = 1e-3  # the observer gains are per 1 ms
_UNEVEN = 1e-3


class PseudoWiener:
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
            The copy, or the model itself. Its ``delay_samples`` need not be whole: between two duties the one that acts
            is their mean by time.

        Raises
        ------
        ParameterError
            The delay would be longer than five samples.

        Examples
        --------
        >>> PseudoWiener("pw_r", {"delay_samples": 3.0}).at_sample(2e-3).parameters["delay_samples"]
        1.5
        """
        old = self.parameters["sample_s"]
        if abs(sample_s - old) <= _UNEVEN * old:
            return self
        substeps = max(1, round(sample_s / _STEP_S)) if self.kind == "pw_r" else None
        return PseudoWiener(self.kind, self._core.at_sample(sample_s, substeps=substeps), **self._options)

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
        """Predict ahead of a measured record, the state corrected by every measured angle.

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

    def to_toml(self, *, source: str = "mgdd") -> str:
        """Write the model as TOML that `from_toml` reads back equal.

        Parameters
        ----------
        source : str
            Where the numbers come from.

        Returns
        -------
        str
            One line per value with its unit.
        """
        text = json.dumps(source, ensure_ascii=False)
        units = self.units
        lines = [f'kind = "{self.kind}"', f"source = {text}", "unidentifiable = []"]
        lines += [f'{name} = "{value}"' for name, value in self._options.items()]
        lines += ["", "[parameters]"]
        lines += [
            f'{name} = {{ value = {value!r}, unit = "{units[name]}", source = {text} }}'
            for name, value in self.parameters.items()
        ]
        return "\n".join(lines) + "\n"

    @classmethod
    def from_toml(cls, text: str) -> PseudoWiener:
        """Read what `to_toml` wrote, or a saved fit of these kinds.

        Parameters
        ----------
        text : str
            The TOML text.

        Returns
        -------
        PseudoWiener
            The model.

        Raises
        ------
        DataError
            No TOML, or no table ``[parameters]`` of values with units.
        ParameterError
            A kind, name or value that does not exist.
        """
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise DataError(f"not valid TOML: {error}") from error
        table = data.get("parameters")
        if not isinstance(table, dict) or not table:
            raise DataError("no table [parameters]: PseudoWiener.to_toml writes one")
        kind = str(data.get("kind", ""))
        values = {}
        for name, entry in table.items():
            if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
                raise DataError(f"[parameters] {name}: write {{ value = ..., unit = ... }}")
            values[name] = float(entry["value"])
        options = {name: str(data[name]) for name in ("switching", "friction") if name in data}
        model = cls(kind, values, **options)
        for name, unit in model.units.items():
            if name in table and table[name].get("unit") != unit:
                raise DataError(f"[parameters] {name}: unit = {table[name].get('unit')!r}: must be {unit!r}")
        return model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PseudoWiener) and self._core == other._core

    def __hash__(self) -> int:
        return hash((self.kind, tuple(self.parameters.values()), *self._options.values()))

    def __repr__(self) -> str:
        return f"PseudoWiener({self.kind!r}, {dict(self.parameters)!r})"

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (self.kind, dict(self.parameters), dict(self._options))


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
