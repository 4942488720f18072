"""What a node drives: a plant of the loop that can be left alone, and what its sensors tell a safety gate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from mgdd.errors import ParameterError
from mgdd.loop import Plant, VirtualThrottle
from mgdd.rig.gated import facts_of
from mgdd.rig.safety_envelope import SafetyEnvelope

__all__ = ["NodePlant", "Sampled", "node_plant"]


class Sampled(NamedTuple):
    """One sample of a plant behind a bus."""

    values: Mapping[str, float]
    applied: Mapping[str, float]


class NodePlant(Protocol):
    """A plant that can be driven or left alone."""

    @property
    def input_names(self) -> tuple[str, ...]:
        """Inputs that commands may carry."""
        ...

    @property
    def sample_s(self) -> float | None:
        """Time in the plant per sample [s]; None: that of the map."""
        ...

    def facts(self, envelope: SafetyEnvelope) -> dict[str, Any]:
        """Tell a gate what the sensors say, as `mgdd.rig.SafetyGate.observe` takes it; no time passes."""
        ...

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        """Run one sample; None: without drive."""
        ...


class _Throttle:
    """A throttle: without drive the bridge is open, and the springs move the plate to limp-home."""

    def __init__(self, plant: VirtualThrottle) -> None:
        self._plant = plant
        self._values: Mapping[str, float] | None = None
        self.input_names = tuple(name for name in plant.input_names if name != "bridge_open")
        self.sample_s: float | None = plant.sample_s

    def facts(self, envelope: SafetyEnvelope) -> dict[str, Any]:
        if self._values is None:  # nothing was sampled yet: a look ahead, taken back
            before = self._plant.state
            self.sample(None)
            self._plant.state = before
        return facts_of(self._values, envelope.cycle_s)

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        given = dict.fromkeys(self.input_names, 0.0) if inputs is None else dict(inputs)
        if inputs is None and "supply_v" in given:
            given["supply_v"] = self._plant.throttle.supply_v
        self._plant.apply({**given, "bridge_open": float(inputs is None)})
        self._values = self._plant.measure().values
        return Sampled(values=self._values, applied=given)


class _Cyclic:
    """An engine: only a driven one runs, cycle by cycle; one that stands has nothing to measure."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.input_names = tuple(plant.input_names)
        self.sample_s: float | None = None

    def facts(self, envelope: SafetyEnvelope) -> dict[str, Any]:
        # No plate to look at: told one in mid-travel, the same gate judges commands alone. An `ActuatorGuard` needs
        # bounds and limits, which the experiment of the host has and the node has not.
        half_v = 0.5 * envelope.sensor_sum_v
        middle_deg = 0.5 * (envelope.closed_deg + envelope.open_deg)
        return {"good_frames": 1, "age_s": 0.0, "sensor_v": (half_v, half_v), "angle_deg": middle_deg}

    def sample(self, inputs: Mapping[str, float] | None) -> Sampled:
        if inputs is None:
            return Sampled(values={}, applied={})
        self._plant.apply(inputs)
        measured = self._plant.measure()
        return Sampled(values={**measured.limits, **measured.values}, applied={**inputs, **measured.applied})


def node_plant(plant: Plant) -> NodePlant:
    """Put a plant of the loop behind a node; a throttle must have ``bridge_open`` among its inputs."""
    if not isinstance(plant, VirtualThrottle):
        return _Cyclic(plant)
    if "bridge_open" not in plant.input_names:
        raise ParameterError.of(
            "inputs of the throttle", list(plant.input_names), "with 'bridge_open': power off means an open bridge"
        )
    return _Throttle(plant)
