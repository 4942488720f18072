"""What the two position sensors make of a run, and when the check between them sees a fault."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import ParameterFile, Parameters, Wanted, entries, wanted
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SensorFault", "SensorPair"]

_VOLTS = {
    "first_v": ("V", "first sensor"),
    "second_v": ("V", "second sensor"),
    "sensed_angle_deg": ("deg", "plate angle as sensed"),
    "sum_error_v": ("V", "sum of both sensors minus supply"),
}
_FLAGS = {
    "first_range_fault": "first sensor out of range",
    "second_range_fault": "second sensor out of range",
    "sum_fault": "sum out of tolerance",
    "fault": "a check has failed for the debounce time",
}


@dataclass(frozen=True, kw_only=True)
class SensorFault:
    """A fault of one sensor, from a time on.

    Parameters
    ----------
    kind : {"open_wire", "short_to_ground", "short_to_supply", "offset", "gain", "stuck"}
        What fails; an open wire reads 0 V, a stuck sensor holds the voltage of the onset.
    sensor : {1, 2}
        Which sensor.
    from_s : float
        Onset after the first sample [s], >= 0.
    until_s : float, optional
        End [s]; it stays if left out.
    size : float
        Added voltage of ``offset`` [V], share by which ``gain`` grows [-].

    Raises
    ------
    mgdd.errors.ParameterError
        No such kind or sensor, a size for a kind that has none or none for one that needs it.

    Examples
    --------
    >>> from mgdd.throttle import SensorFault
    >>> SensorFault(kind="offset", sensor=2, size=0.25).from_s
    0.0
    """

    kind: str
    sensor: int = 1
    from_s: float = 0.0
    until_s: float | None = None
    size: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        kinds = [kind for kind in _core.throttle.sensor_fault_kinds if kind != "none"]
        if self.kind not in kinds:
            raise ParameterError.of("kind", self.kind, f"one of {', '.join(kinds)}")
        if self.sensor not in (1, 2):
            raise ParameterError.of("sensor", self.sensor, "1 or 2")
        if (self.kind in ("offset", "gain")) != (self.size != 0.0):
            raise ParameterError(f"size = {self.size:g}: goes with kind 'offset' [V] or 'gain' [-], which need it")


class SensorPair(Parameters, _core.throttle.SensorPair):  # noqa: D101 the core's text
    __doc__ = _core.throttle.SensorPair.__doc__

    def to_parameters(self) -> ParameterFile:
        """Give all fields, as `to_toml` writes them."""
        return ParameterFile(kind="sensor_pair", tables={"parameters": entries(self.to_dict())})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> SensorPair:
        """Make the pair of a file that `to_toml` wrote."""
        file.expect(kinds=("sensor_pair",), tables=("parameters",))
        names = [name for name in cls().to_dict() if name != "adc_bits"]
        return cls(**file.values("parameters", {**wanted(names), "adc_bits": Wanted(form="integer")}))

    def sense(self, run: xr.Dataset, *, faults: Sequence[SensorFault] = (), seed: int = 0) -> xr.Dataset:
        """Sample the true angle of a run with both sensors, converter and plausibility check.

        Parameters
        ----------
        run : xarray.Dataset
            ``angle_deg`` [deg] over even ``time_s`` [s], as `simulate_throttle` gives it.
        faults : sequence of SensorFault
            At most one per sensor.
        seed : int
            Of the noise, >= 0.

        Returns
        -------
        xarray.Dataset
            Over ``time_s``: ``first_v``, ``second_v``, ``sensed_angle_deg``, ``sum_error_v`` and the flags
            ``first_range_fault``, ``second_range_fault``, ``sum_fault`` and ``fault``, which stays; scalar
            ``detected_s`` is the time from the first onset (from the first sample without a fault) to ``fault`` [s],
            NaN if never.

        Raises
        ------
        mgdd.errors.ParameterError
            Two faults of one sensor, a fault outside its domain, a negative seed.
        mgdd.errors.DataError
            No angle or no even time.

        Notes
        -----
        Thresholds: sum within 0.2 V and range 0.2 to 4.8 V as in the manual of the Bosch MS 6 engine control; 200 ms of
        debouncing is common in service literature.

        Examples
        --------
        >>> from mgdd.throttle import SensorFault, SensorPair, Throttle, simulate_throttle
        >>> run = simulate_throttle(Throttle(), 0.3, duration_s=0.5)
        >>> seen = SensorPair().sense(run, faults=[SensorFault(kind="short_to_ground", sensor=2, from_s=0.1)])
        >>> round(float(seen["detected_s"]), 2)
        0.2
        """
        for name in ("time_s", "angle_deg"):
            if name not in run.variables:
                raise DataError(f"run has no variable {name!r}: mgdd.throttle.simulate_throttle makes it")
        if seed < 0:
            raise ParameterError.of("seed", seed, ">= 0")
        time = run["time_s"].to_numpy()
        sample = even_step(time)
        raw = _core.throttle.sense(
            self,
            run["angle_deg"].to_numpy(),
            sample_s=sample,
            seed=seed,
            faults=fault_pair(faults),
        )
        onset = min((fault.from_s for fault in faults), default=0.0)
        latched = raw["fault"].any()
        detected = float(time[int(np.argmax(raw["fault"]))] - time[0]) - onset if latched else math.nan
        return labelled_dataset(
            {
                "time_s": ("time_s", time),
                **{name: ("time_s", raw[name], *label) for name, label in _VOLTS.items()},
                **{name: ("time_s", raw[name], "-", text) for name, text in _FLAGS.items()},
                "detected_s": ((), detected, "s", "time from onset to detection"),
            },
            attrs={"seed": seed, "faults": ", ".join(f"{f.kind} of sensor {f.sensor}" for f in faults)},
        )


def fault_pair(faults: Sequence[SensorFault]) -> list[tuple[str, float, float, float | None]]:
    """Give kind, onset [s], size and end [s] of the fault of each sensor; ParameterError for two of one sensor."""
    per_sensor: list[tuple[str, float, float, float | None]] = [("none", 0.0, 0.0, None), ("none", 0.0, 0.0, None)]
    for fault in faults:
        if per_sensor[fault.sensor - 1][0] != "none":
            raise ParameterError(f"faults: sensor {fault.sensor} has two: give at most one per sensor")
        per_sensor[fault.sensor - 1] = (fault.kind, fault.from_s, fault.size, fault.until_s)
    return per_sensor
