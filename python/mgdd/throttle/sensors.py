"""What the two position sensors make of a run, and when the check between them sees a fault."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import ParameterFile, Parameters, Wanted, entries, wanted
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import even_step
from mgdd.throttle.faults import ThrottleFault, fault_pair

if TYPE_CHECKING:
    import xarray as xr

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
        if seed < 0:
            raise ParameterError.of("seed", seed, ">= 0")
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
