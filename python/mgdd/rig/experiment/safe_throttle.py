"""A throttle behind a safety gate for a run: what the gate forbids ends it, and leaving the rig opens the bridge."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from mgdd.errors import RigError
from mgdd.loop import Measurement, Plant
from mgdd.rig.gated import facts_of
from mgdd.rig.safety import SafetyGate

__all__ = ["SafeThrottle"]


class SafeThrottle:
    """A plant whose duty passes a safety gate; when the gate takes the drive away, `apply` raises and the run ends.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        Takes ``duty``, gives ``first_v``, ``second_v`` and ``sensed_angle_deg``.
    gate : SafetyGate
        Its cycle time is that of the plant.
    shadow : bool
        The plant does not follow, as in ``dry_run`` and ``replay``: what the gate forbids is noted, and the run goes on
        at zero duty.
    """

    def __init__(self, plant: Plant, gate: SafetyGate, *, shadow: bool = False) -> None:
        self.plant, self.gate, self.shadow = plant, gate, shadow
        self._values: Mapping[str, float] | None = None
        self._applied: dict[str, float] = {}

    @property
    def input_names(self) -> tuple[str, ...]:
        """The duty."""
        return self.plant.input_names

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities of the plant."""
        return self.plant.limit_names

    def start(self) -> float:
        """Measure at zero duty until the gate can run, and give the angle [deg].

        Raises
        ------
        mgdd.errors.RigError
            What stands against it after twice the good measurements that it needs.
        """
        for _ in range(2 * math.ceil(self.gate.envelope.good_frames)):
            self._observe()
            self.gate.command(0.0)
            self._send(0.0)
            self.measure()
        self.gate.arm()
        self.gate.run()
        if self._values is None:
            raise RigError("nothing was measured: the envelope asks for no good frame before arming")
        return float(self._values["sensed_angle_deg"])

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Pass a duty through the gate.

        Raises
        ------
        mgdd.errors.RigError
            The gate does not let the actuator be driven; the message has its reason.
        """
        self._observe()
        drive = self.gate.command(inputs["duty"])
        if drive.bridge_open and not self.shadow:
            raise RigError(
                f"the safety gate went to {self.gate.mode!r}: {self.gate.reason}; look for the cause before the next "
                "run"
            )
        self._send(drive.duty)

    def measure(self) -> Measurement:
        """Run one cycle; ``applied`` has the duty that left, as the plant says it where it does."""
        measured = self.plant.measure()
        self._values = measured.values
        return replace(measured, applied={**self._applied, **measured.applied})

    def _observe(self) -> None:
        self.gate.observe(**facts_of(self._values, self.gate.envelope.cycle_s))

    def _send(self, duty: float) -> None:
        self._applied = {"duty": duty}
        self.plant.apply(self._applied)
