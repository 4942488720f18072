"""Faults of a throttle; what its two position sensors make of a run, and when the check between them sees a fault."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import ParameterFile, Parameters, Wanted, entries, wanted
from mgdd.results.describe import described
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import xarray as xr

_OF_SENSOR = tuple(kind for kind in _core.throttle.sensor_fault_kinds if kind != "none")
_SIZED = {
    "offset": "V", "gain": "-", "jammed_at": "deg", "spring_above": "-", "spring_below": "-", "supply_sag": "V",
}  # fmt: skip


@described
@dataclass(frozen=True, kw_only=True)
class ThrottleFault:
    """A fault of one sensor, or of plate, springs, supply or measurement, from a time on.

    Parameters
    ----------
    kind : str
        Of a sensor: ``open_wire`` (reads 0 V), ``short_to_ground``, ``short_to_supply``, ``offset`` and ``gain`` by
        `size`, ``stuck`` (holds the voltage of the onset). ``jammed``: plate and gear stay where they are.
        ``jammed_at``: they catch when the plate comes to `size`. ``spring_above``, ``spring_below``: the spring of that
        side of limp-home loses the share `size` of preload and stiffness. ``supply_sag``: the bridge has `size` at
        most. ``missing_sample``: no measurement arrives. ``nan_sample``: one arrives, and its numbers are NaN.
        ``stale_sample``: the last good one arrives again.
    sensor : {1, 2}, optional
        Which sensor, for the kinds of one; the first if left out.
    from_s : float
        Onset after the first sample [s], >= 0.
    until_s : float, optional
        End [s]; it stays if left out. A loss of n samples ends n samples after its onset.
    size : float, optional
        Added voltage [V] or share by which the gain grows [-], angle [deg], share in (0, 1] or voltage [V] of the kinds
        that have one; a spring breaks as a whole if left out.

    Raises
    ------
    mgdd.errors.ParameterError
        No such kind or sensor, a sensor or size for a kind that has none, or no size for one that needs it.
        `mgdd.throttle.SensorPair.sense` and `mgdd.loop.VirtualThrottle` refuse a time or size outside its domain.

    Examples
    --------
    >>> from mgdd.loop import ThrottleFault, VirtualThrottle
    >>> ThrottleFault(kind="offset", sensor=2, size=0.25).from_s
    0.0
    >>> plant = VirtualThrottle(faults=[ThrottleFault(kind="jammed_at", size=20.0)])
    >>> for _ in range(200):
    ...     plant.apply({"duty": 0.6})
    ...     values = plant.measure().values
    >>> abs(values["angle_deg"] - 20.0) < 0.2
    True
    """

    kind: str
    sensor: int | None = None
    from_s: float = 0.0
    until_s: float | None = None
    size: float | None = None

    def __post_init__(self) -> None:
        of_sensor, kinds = self.kind in _OF_SENSOR, (*_OF_SENSOR, *_core.loop.throttle_fault_kinds)
        ParameterError.unless(self.kind in kinds, "kind", self.kind, f"one of {', '.join(kinds)}")
        if of_sensor and self.sensor is None:
            object.__setattr__(self, "sensor", 1)
        if self.sensor not in ((1, 2) if of_sensor else (None,)):
            bound = "1 or 2" if of_sensor else f"left out with {self.kind!r}"
            raise ParameterError.of("sensor", self.sensor, bound)
        if self.kind.startswith("spring") and self.size is None:
            object.__setattr__(self, "size", 1.0)
        if (self.kind in _SIZED) != (bool(self.size) if of_sensor else self.size is not None):
            sized = ", ".join(f"{kind!r} [{unit}]" for kind, unit in _SIZED.items())
            raise ParameterError.of("size", self.size, f"given with {sized}, and left out with other kinds")

    def to_core(self) -> tuple[str, float, float, float | None]:
        """Give kind, onset [s], size and end [s] as the core reads them."""
        until = None if self.until_s is None else float(self.until_s)
        return self.kind, float(self.from_s), float(self.size or 0.0), until


def fault_pair(faults: Sequence[ThrottleFault]) -> list[tuple[str, float, float, float | None]]:
    """Give what `to_core` gives for each sensor; ParameterError for two faults of one, or one of no sensor."""
    per_sensor: list[tuple[str, float, float, float | None]] = [("none", 0.0, 0.0, None), ("none", 0.0, 0.0, None)]
    for fault in faults:
        if fault.sensor is None:
            raise ParameterError(f"faults: {fault.kind} is not a fault of a sensor: mgdd.loop.VirtualThrottle takes it")
        if per_sensor[fault.sensor - 1][0] != "none":
            raise ParameterError(f"faults: sensor {fault.sensor} has two: give at most one per sensor")
        per_sensor[fault.sensor - 1] = fault.to_core()
    return per_sensor


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

    def sense(self, run: xr.Dataset, *, faults: Sequence[ThrottleFault] = (), seed: int = 0) -> xr.Dataset:
        """Sample the true angle of a run with both sensors, converter and plausibility check.

        Parameters
        ----------
        run : xarray.Dataset
            ``angle_deg`` [deg] over even ``time_s`` [s], as `simulate_throttle` gives it.
        faults : sequence of ThrottleFault
            Of sensors, at most one of each.
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
            Two faults of one sensor or one of no sensor, a fault outside its domain, a negative seed.
        mgdd.errors.DataError
            No angle or no even time.

        Notes
        -----
        Thresholds: sum within 0.2 V and range 0.2 to 4.8 V as in the manual of the Bosch MS 6 engine control; 200 ms of
        debouncing is common in service literature.

        Examples
        --------
        >>> from mgdd.loop import ThrottleFault
        >>> from mgdd.throttle import SensorPair, Throttle, simulate_throttle
        >>> run = simulate_throttle(Throttle(), 0.3, duration_s=0.5)
        >>> seen = SensorPair().sense(run, faults=[ThrottleFault(kind="short_to_ground", sensor=2, from_s=0.1)])
        >>> round(float(seen["detected_s"]), 2)
        0.2
        """
        for name in ("time_s", "angle_deg"):
            if name not in run.variables:
                raise DataError(f"run has no variable {name!r}: mgdd.throttle.simulate_throttle makes it")
        ParameterError.unless(seed >= 0, "seed", seed, ">= 0")
        time = run["time_s"].to_numpy()
        sample = even_step(time)
        raw = _core.throttle.sense(
            self, run["angle_deg"].to_numpy(), sample_s=sample, seed=seed, faults=fault_pair(faults)
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
