"""A throttle with its sensors as a plant of the loop: duty in, measured angle out, one sample at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mgdd import _core
from mgdd._settings import remade
from mgdd.errors import ParameterError, RigError
from mgdd.loop.plant import Measurement, checked_inputs
from mgdd.loop.plates import model_of, require_loop_delay
from mgdd.presets.meant import ThrottleLike, moving_throttle_of, unknown_to_a_fit, whole_delay_of
from mgdd.results import Fit
from mgdd.signals.model import SampledModel
from mgdd.throttle import SensorPair, Throttle
from mgdd.throttle.sensors import ThrottleFault, fault_pair

_INPUTS = ("duty", "supply_v", "airflow_torque_nm", "bridge_open")


class VirtualThrottle(_core.loop.VirtualThrottle):
    """An electronic throttle sample by sample, with both position sensors, their noise, and faults of every part.

    Parameters
    ----------
    throttle : Throttle, Preset, Fit, FirstPrincipleModel, str or path-like, optional
        Its parameters; the preset ``P1`` if left out. A first-principle fit, its model or the file of either moves as
        its log did; it has neither ``supply_v`` nor ``airflow_torque_nm``, and its current and supply are NaN.
    inputs : sequence of str
        Which of ``duty`` [-], ``supply_v`` [V], ``airflow_torque_nm`` [N m] and ``bridge_open`` are applied; the others
        stay at 0 and at the supply of the throttle. While ``bridge_open`` is not 0 no current flows, whatever the duty.
    delay_samples : int, optional
        Samples until a duty acts; those of the fit, else 0, if left out.
    sensors : SensorPair, optional
        As in `mgdd.throttle.SensorPair.sense`.
    faults : sequence of ThrottleFault
        At most one per sensor, and 32 of plate, springs, supply and measurement.
    start_deg : float, optional
        Angle at the start, at rest [deg]; limp-home if left out.
    sample_s, step_s : float
        Time between samples, and the integration step that goes into it a whole number of times [s].
    bridge : {"brake", "open"}
        What the bridge does at zero duty.
    seed : int
        Of the sensors' noise, in [0, 2**64).

    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> plant = VirtualThrottle(seed=1)
    >>> for _ in range(60):
    ...     plant.apply({"duty": 0.6})
    ...     measured = plant.measure()
    >>> round(measured.values["angle_deg"], 2), abs(measured.values["sensed_angle_deg"] - 33.6) < 0.5
    (33.6, True)
    """

    limit_names: tuple[str, ...] = ()

    def __init__(
        self,
        throttle: ThrottleLike | Fit | SampledModel | None = None,
        *,
        inputs: Sequence[str] = ("duty",),
        delay_samples: int | None = None,
        sensors: SensorPair | None = None,
        faults: Sequence[ThrottleFault] = (),
        start_deg: float | None = None,
        sample_s: float = 1e-3,
        step_s: float = 1e-4,
        bridge: str = "brake",
        seed: int = 0,
    ) -> None:
        if not inputs or len(set(inputs)) < len(inputs) or not set(inputs) <= set(_INPUTS):
            raise ParameterError.of("inputs", list(inputs), f"some of {', '.join(_INPUTS)}, once each")
        ParameterError.unless(0 <= seed < 2**64, "seed", seed, "in [0, 2**64)")
        self.throttle, self._model = moving_throttle_of(model_of(Throttle() if throttle is None else throttle))
        if self._model is not None and (torques := {"supply_v", "airflow_torque_nm"} & set(inputs)):
            raise unknown_to_a_fit("inputs", min(torques))
        delay = delay_samples if delay_samples is not None else whole_delay_of(self._model, sample_s) or 0
        require_loop_delay(delay)
        self.delay_samples = delay
        self._waiting = (0.0,) * delay
        self.sample_s = sample_s
        self.input_names = tuple(inputs)
        self._still = {"duty": 0.0, "supply_v": self.throttle.supply_v, "airflow_torque_nm": 0.0, "bridge_open": 0.0}
        self.start_deg = self.throttle.limp_home_deg if start_deg is None else float(start_deg)
        self._applied: dict[str, float] | None = None
        self._settings: dict[str, Any] = {
            "throttle": self.throttle if self._model is None else self._model,
            "inputs": self.input_names,
            "delay_samples": delay,
            "sensors": sensors or SensorPair(),
            "faults": tuple(faults),
            "start_deg": self.start_deg,
            "sample_s": sample_s,
            "step_s": step_s,
            "bridge": bridge,
            "seed": seed,
        }
        here = {"throttle", "inputs", "delay_samples", "faults"}
        own = {name: value for name, value in self._settings.items() if name not in here}
        of_sensors = fault_pair([fault for fault in faults if fault.sensor is not None])
        of_others = [fault.to_core() for fault in faults if fault.sensor is None]
        super().__init__(throttle=self.throttle, faults=of_sensors, plant_faults=of_others, **own)

    def __reduce__(self) -> tuple[Any, ...]:
        since = {"state": self.state, "_applied": self._applied, "_waiting": self._waiting}
        return remade, (type(self), (), self._settings, since)

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next sample.

        Parameters
        ----------
        inputs : mapping of str to float
            One number per name of `input_names`; a duty is clipped to -1..1.
        """
        values = checked_inputs(inputs, self.input_names)
        self._applied = {**self._still, **dict(zip(self.input_names, values, strict=True))}

    def measure(self) -> Measurement:
        """Run one sample under the inputs applied last, and read the sensors at its end.

        Returns
        -------
        Measurement
            ``values``: ``time_s``, ``sensed_angle_deg``, both sensors as ``first_v``, ``second_v``, ``first_angle_deg``
            and ``second_angle_deg``, ``fault`` of their check as 0 or 1, ``age_s`` of what arrived last, ``supply_v``
            of the bridge, and the truth ``angle_deg``, ``speed_deg_per_s`` and ``current_a``. What is missing is NaN.
        """
        if self._applied is None:
            raise RigError("measure() before apply(): apply a duty first")
        applied = self._applied
        sent = (applied["duty"], *self._waiting)
        self._waiting = sent[:-1]
        reading = self.step(
            duty=sent[-1],
            supply_v=applied["supply_v"],
            airflow_torque_nm=applied["airflow_torque_nm"],
            bridge_open=applied["bridge_open"] != 0.0,
        )
        if self._model is not None:
            reading |= {"current_a": math.nan, "supply_v": math.nan}
        return Measurement(values={name: float(value) for name, value in reading.items()})
