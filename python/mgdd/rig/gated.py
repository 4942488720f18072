"""A throttle behind a safety gate, as a plant of the loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mgdd._core.rig import Drive
from mgdd.errors import ParameterError, RigError
from mgdd.loop import Measurement, Plant
from mgdd.rig.safety import SafetyGate


class GatedThrottle:
    """A throttle whose duty passes a safety gate: one `apply` and one `measure` per cycle.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        Takes ``duty`` and, where it can, ``bridge_open``; gives ``first_v``, ``second_v``, ``sensed_angle_deg`` and,
        where known, ``age_s``: `mgdd.loop.VirtualThrottle`, or a rig. The bridge of a plant without ``bridge_open``
        opens when its rig is left: there `apply` raises once the gate takes the drive away.
    gate : SafetyGate, optional
        With the envelope ``etb`` if left out.
    shadow : bool
        The plant does not follow, as in ``dry_run`` and ``replay``: nothing is raised, and the run goes on at zero
        duty.

    Raises
    ------
    mgdd.errors.ParameterError
        A plant with other inputs.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> from mgdd.rig import GatedThrottle
    >>> plant = GatedThrottle(VirtualThrottle(inputs=("duty", "bridge_open"), seed=1))
    >>> start_deg = plant.start()
    >>> for _ in range(400):
    ...     plant.apply({"duty": 0.3})
    ...     measured = plant.measure()
    >>> measured.applied["duty"], measured.values["angle_deg"] > 20.0
    (0.3, True)
    >>> plant.gate.abort()
    >>> for _ in range(400):
    ...     plant.apply({"duty": 0.3})
    ...     measured = plant.measure()
    >>> measured.applied, abs(measured.values["angle_deg"] - 8.0) < 1.0
    ({'duty': 0.0, 'bridge_open': 1.0}, True)
    """

    input_names = ("duty",)

    def __init__(self, plant: Plant, gate: SafetyGate | None = None, *, shadow: bool = False) -> None:
        if set(plant.input_names) not in ({"duty"}, {"duty", "bridge_open"}):
            raise ParameterError(f"plant takes {', '.join(plant.input_names)}: must take duty, or duty and bridge_open")
        self.plant = plant
        self.gate = SafetyGate() if gate is None else gate
        self.shadow = shadow
        self._opens = "bridge_open" in plant.input_names
        self._values: Mapping[str, float] | None = None
        self._applied: dict[str, float] | None = None

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities of the plant."""
        return self.plant.limit_names

    def start(self) -> float:
        """Measure without drive until the gate can be armed, then arm and run it; give the angle measured last [deg].

        RigError where something stands against it after twice the good frames that it needs.
        """
        angle_deg = math.nan
        for _ in range(2 * max(math.ceil(self.gate.envelope.good_frames), 1)):
            self._send(self._passed(0.0))
            angle_deg = float(self.measure().values["sensed_angle_deg"])
        if self.gate.mode == "init":
            self.gate.arm()
        self.gate.run()
        return angle_deg

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Pass the duty of the next cycle through the gate, with what was measured last.

        NaN is a fault of the controller and opens the bridge. Any input but ``duty`` is a ParameterError; a RigError
        has the reason why the gate takes the drive away from a plant that cannot open its bridge.
        """
        if set(inputs) != {"duty"}:
            raise ParameterError(f"inputs = {', '.join(map(str, inputs)) or 'none'}: must be duty")
        drive = self._passed(inputs["duty"])
        if drive.bridge_open and not (self._opens or self.shadow):
            raise drive_taken(self.gate.mode, self.gate.reason)
        self._send(drive)

    def measure(self) -> Measurement:
        """Run one cycle; ``applied`` has what left: the ``duty``, and ``bridge_open`` where the plant takes it."""
        if self._applied is None:
            raise RigError("measure() before apply(): apply a duty first")
        measured = self.plant.measure()
        self._values = measured.values
        return replace(measured, applied={**self._applied, **measured.applied})

    def _passed(self, duty: float) -> Drive:
        self.gate.observe(**facts_of(self._values, self.gate.envelope.cycle_s))
        return self.gate.command(duty)

    def _send(self, drive: Drive) -> None:
        self._applied = {"duty": drive.duty}
        if self._opens:
            self._applied["bridge_open"] = float(drive.bridge_open)
        self.plant.apply(self._applied)


def facts_of(values: Mapping[str, float] | None, cycle_s: float) -> dict[str, Any]:
    """Give what measured values of a throttle tell a gate; a measurement is new while its age is below a cycle."""
    if values is None:
        return {}
    age_s = values.get("age_s", 0.0)
    return {
        "good_frames": int(age_s < 0.5 * cycle_s),
        "age_s": age_s,
        "sensor_v": (values["first_v"], values["second_v"]),
        "angle_deg": values["sensed_angle_deg"],
    }


def drive_taken(mode: str, reason: str) -> RigError:
    """Make the error of a run whose gate took the drive away."""
    return RigError(f"the safety gate went to {mode!r}: {reason}; look for the cause before the next run")
