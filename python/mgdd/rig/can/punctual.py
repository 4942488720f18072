"""The times that a host has to keep before a node that runs by a clock of its own."""

from __future__ import annotations

import math
import time

from mgdd.errors import RigError
from mgdd.rig.can.signal_map import SignalMap

__all__ = ["Punctual"]

_REMEDY = "call arm() or enter the rig again"


class Punctual:
    """Refuses commands and measurements that come too late: the node has let go, and has to be armed again."""

    def __init__(self, signal_map: SignalMap, bus: str, timeout_s: float) -> None:
        limits = [m.timeout_s for m in signal_map.commands.values() if m.timeout_s is not None]
        self._command_s = min(limits, default=math.inf)
        self._let_go_s = self._command_s + signal_map.cycle_s  # by then the node has looked at the time
        self._measured_s = max(timeout_s, self._command_s)
        self._bus = bus
        self._driven_ns: int | None = None
        self.is_timed = False  # a node without a clock steps, and waits for every command

    def commanded(self) -> None:
        """Note that a command of a driven node has left."""
        self._driven_ns = time.monotonic_ns()

    def armed_again(self) -> None:
        """Forget the commands before a handshake."""
        self._driven_ns = None

    def require_command(self) -> None:
        """Refuse a command after a time in which the node has let go."""
        if not self.is_timed or self._driven_ns is None:
            return
        late_s = (time.monotonic_ns() - self._driven_ns) * 1e-9
        if late_s > self._let_go_s:
            raise RigError(
                f"{self._bus}: {late_s * 1e3:.0f} ms since the last command, the time limit is "
                f"{self._command_s * 1e3:g} ms: the node has let go; {_REMEDY}"
            )

    def require_measurement(self, arrived_ns: int) -> None:
        """Refuse a measurement that waited for longer than it may take."""
        age_s = (time.monotonic_ns() - arrived_ns) * 1e-9
        if self.is_timed and age_s > self._measured_s:
            raise RigError(
                f"{self._bus}: the measurement is {age_s * 1e3:.0f} ms old, the limit is {self._measured_s * 1e3:g} "
                f"ms: this process or the bus stood still; {_REMEDY}"
            )
