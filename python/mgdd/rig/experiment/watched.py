"""A plant that tells a listener of every cycle."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from mgdd.loop import Measurement, Plant
from mgdd.rig.base import AroundPlant

__all__ = ["Cycle", "Watched"]


class Cycle(NamedTuple):
    """One cycle of a plant."""

    number: int  # from 0 on
    asked: Mapping[str, float]
    measured: Measurement
    thinking_s: float  # from the measurement before to these inputs
    waiting_s: float  # from the inputs to this measurement


class Watched(AroundPlant):
    """A plant whose cycles are told to a listener, with the time that they took."""

    def __init__(self, plant: Plant, listener: Callable[[Cycle], None]) -> None:
        super().__init__(plant)
        self._listener = listener
        self.cycles = 0
        self._asked: Mapping[str, float] = {}
        self._measured_s = self._applied_s = time.perf_counter()

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Pass the inputs on."""
        self._asked = dict(inputs)
        self._applied_s = time.perf_counter()
        self.plant.apply(inputs)

    def measure(self) -> Measurement:
        """Pass the measurement back, and tell the listener."""
        measured = self.plant.measure()
        now = time.perf_counter()
        cycle = Cycle(self.cycles, self._asked, measured, self._applied_s - self._measured_s, now - self._applied_s)
        self.cycles += 1
        self._listener(cycle)
        self._measured_s = time.perf_counter()
        return measured
