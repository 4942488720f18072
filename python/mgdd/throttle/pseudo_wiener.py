"""Pseudo-Wiener models of a throttle: free run, prediction from a measurement, and files."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._settings import remade
from mgdd.errors import DataError
from mgdd.io.parameters import FIT_NOTES, ParameterFile, Parameters, Wanted, entries, wanted
from mgdd.presets.meant import ThrottleLike, moving_throttle_of
from mgdd.results.describe import described, rows_of
from mgdd.signals.even_grid import even_step, is_same_step
from mgdd.signals.model import RunInputs, SampledModel, check_horizon, columns_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd.results import Fit


_KINDS = ("pw_r", "pw_w", "pw_p")
_STEP_S = 5e-4  # of PW-R
_GAIN_SAMPLE_S = 1e-3  # the observer gains are per 1 ms


class PseudoWiener(SampledModel, Parameters):
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
        PW-R: exact stiction, or smooth for gradients; the smooth one creeps under load at up to ``tanh_deg_per_s
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
    >>> run = model.simulate({"time_s": time, "duty": np.full(200, 0.4)}, initial_state={"angle_deg": 8.0})
    >>> run["angle_deg"].units
    'degree'
    >>> PseudoWiener.from_toml(model.to_toml()) == model
    True
    """

    input_names = ("duty",)
    output_name = observed_state = "angle_deg"
    state_names = ("angle_deg",)

    def __init__(
        self,
        kind: str = "pw_r",
        parameters: Mapping[str, float] | None = None,
        *,
        switching: str = "predicted",
        friction: str = "set_valued",
    ) -> None:
        given = {str(name): float(value) for name, value in (parameters or {}).items()}
        self._core = _core.throttle.PseudoWienerModel(kind, given, switching=switching, friction=friction)
        self._options = {"switching": switching, "friction": friction}

    @classmethod
    def of_throttle(cls, throttle: ThrottleLike | Fit | SampledModel) -> PseudoWiener:
        """Give PW-R with the groups of a first-principle throttle.

        Parameters
        ----------
        throttle : Throttle, Preset, str or path-like, first-principle Fit or its model
            tau = J/b, G = g/J, preload, spring and Coulomb torque over the stall torque g; of a fit the delay, too.

        Returns
        -------
        PseudoWiener
            Without inductance, stiction and the softness of the stops, which PW-R does not have.
        """
        body, fit = moving_throttle_of(throttle)
        model = cls("pw_r", _core.throttle.pseudo_wiener_of(body).parameters)
        if fit is None:
            return model
        return model.at_sample(fit.sample_s).replace(delay_samples=fit.parameters["delay_samples"])

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
        units = _core.throttle.pseudo_wiener_units(self.kind)
        return MappingProxyType({name: str(units[name]) for name in self.parameters})

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
        if is_same_step(sample_s, old):
            return self
        substeps = max(1, round(sample_s / _STEP_S)) if self.kind == "pw_r" else None
        return PseudoWiener(self.kind, self._core.at_sample(sample_s, substeps=substeps), **self._options)

    def _rest(self) -> list[float]:
        return [float(self.parameters["limp_home_deg"])]

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        return np.asarray(self.at_sample(run.step_s)._core.simulate(_duty(run.columns[0]), start_deg=run.state[0]))

    def predict(
        self,
        record: Any,
        horizon: int,
        *,
        angle_gain: float = 0.35,
        speed_gain_per_s: float = 35.0,
        bias_gain_duty_per_deg: float = 0.004,
    ) -> xr.Dataset:
        """Predict ahead of a measured record, the state corrected by every measured angle.

        Parameters
        ----------
        record : xarray.Dataset, DataFrame or mapping of columns
            ``time_s`` [s], ``duty`` [-] and ``angle_deg`` [deg].
        horizon : int
            Samples ahead, at least 1.
        angle_gain, speed_gain_per_s, bias_gain_duty_per_deg : float
            Observer of PW-R per 1 ms; they are scaled to the sample time. PW-W and PW-P predict
            ``angle(k) + simulated(k + horizon) - simulated(k)``.

        Returns
        -------
        xarray.Dataset
            ``angle_deg`` over ``time_s`` from sample `horizon` on; entry k is predicted from the data up to sample k.

        Raises
        ------
        DataError
            A missing column, a value that is not finite, or times that are not even.
        ShapeError
            Columns of different length.
        ParameterError
            A horizon that does not fit into the record.
        """
        time, u, angle = columns_of(record, ("time_s", "duty", "angle_deg"))
        check_horizon(horizon, angle.size)
        sample_s = even_step(time)
        share = sample_s / _GAIN_SAMPLE_S
        ahead = self.at_sample(sample_s)._core.predict(
            _duty(u),
            angle,
            int(horizon),
            angle_gain=1.0 - (1.0 - angle_gain) ** share,
            speed_gain_per_s=speed_gain_per_s * share,
            bias_gain_duty_per_deg=bias_gain_duty_per_deg * share,
        )
        return self._labelled(time[horizon:], {"angle_deg": np.asarray(ahead)})

    def slopes(
        self, duty: ArrayLike, *, initial_state: Mapping[str, float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Predict a horizon from a state, with exact sensitivities to every duty.

        Parameters
        ----------
        duty : array_like, shape (n,)
            Duty of the horizon [-].
        initial_state : mapping of str to float
            ``angle_deg`` now [deg] and, of PW-R, ``speed_deg_per_s`` [deg/s], 0 without.

        Returns
        -------
        tuple of ndarray
            Angle after each sample [deg], shape (n,), and d angle / d duty [deg], shape (n, n), lower triangular.
        """
        angle, slope = self._core.slopes(
            np.asarray(duty, dtype=np.float64),
            start_deg=float(initial_state["angle_deg"]),
            speed_deg_per_s=float(initial_state.get("speed_deg_per_s", 0.0)),
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
        units = {name: str(unit) for name, unit in _core.throttle.pseudo_wiener_units(file.kind).items()}
        parameters = file.values("parameters", {name: Wanted(unit, required=False) for name, unit in units.items()})
        options = file.values("settings", wanted(("switching", "friction"), form="text"))
        model = cls(file.kind, parameters, **options)
        file.values("parameters", wanted(model.parameters, units))  # the numbers determine which of them there are
        return model

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PseudoWiener) and self._core == other._core

    def __hash__(self) -> int:
        return hash((self.kind, tuple(self.parameters.values()), *self._options.values()))

    def __reduce__(self) -> tuple[object, ...]:
        return remade, (PseudoWiener, (self.kind, dict(self.parameters)), dict(self._options), {})


described(
    PseudoWiener,
    title=lambda model: f"PseudoWiener {model.kind}, " + ", ".join(f"{n} {v}" for n, v in model._options.items()),
    rows=lambda model: rows_of(model.parameters, model.units),
)


def _duty(column: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.abs(column).max() <= 1.0:
        raise DataError("duty: must be in [-1, 1]; a duty in percent is divided by 100")
    return column
