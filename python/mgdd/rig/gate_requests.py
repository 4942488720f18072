"""The safety gate of a loop in a thread of the core: its mode, and the requests that change it."""

from __future__ import annotations

import time
from typing import Any

from mgdd.errors import RigError

__all__ = ["GateRequests"]

_PAUSE_S = 0.002


class GateRequests:
    """What an operator sees of the gate of a running loop, and asks of it.

    Parameters
    ----------
    core : object
        The loop in the core: ``request``, ``state``, ``reason``, ``cause``, ``running``.
    cycle_s : float
        Its period [s]; one request is heard per cycle.
    """

    def __init__(self, core: Any, cycle_s: float) -> None:
        self._gate = core
        self._pause_s = max(_PAUSE_S, 2.0 * cycle_s)

    @property
    def running(self) -> bool:
        """Whether the thread runs."""
        return bool(self._gate.running)

    @property
    def mode(self) -> str:
        """Mode of the safety gate: ``init``, ``armed``, ``run``, ``limp`` or ``fault``."""
        return str(self._gate.state)

    @property
    def reason(self) -> str:
        """Why that mode was entered."""
        return str(self._gate.reason)

    @property
    def cause(self) -> str:
        """What is wrong now; ``none`` where nothing is."""
        return str(self._gate.cause)

    def arm(self, timeout_s: float = 2.0) -> None:
        """Ask the gate for the mode ``armed``, until enough good frames have come.

        Parameters
        ----------
        timeout_s : float
            How long to ask [s]; the same of `drive`, `release` and `reset`.

        Raises
        ------
        mgdd.errors.RigError
            The gate refuses, with what is wrong; or the loop does not run. The same of the others.
        """
        self._ask("arm", "armed", timeout_s)

    def drive(self, timeout_s: float = 2.0) -> None:
        """Ask the gate for the mode ``run``: the actuator is driven from now on. Otherwise as `arm`."""
        self._ask("run", "run", timeout_s)

    def release(self, timeout_s: float = 2.0) -> None:
        """Open the bridge, from ``run`` back to the mode ``armed``. Otherwise as `arm`."""
        self._ask("stop", "armed", timeout_s)

    def reset(self, timeout_s: float = 2.0) -> None:
        """Leave ``limp`` for ``armed``, or ``fault`` for ``init``, once nothing is wrong. Otherwise as `arm`."""
        self._ask("reset", "init" if self.mode == "fault" else "armed", timeout_s)

    def abort(self) -> None:
        """Open the bridge at the next cycle, whatever the mode; a reset leads out of it.

        Raises
        ------
        mgdd.errors.RigError
            The loop does not run.
        """
        self._require_running()
        while not self._gate.request("abort"):
            time.sleep(_PAUSE_S)
            self._require_running()

    def _ask(self, request: str, wanted: str, timeout_s: float) -> None:
        until = time.monotonic() + timeout_s
        while self.mode != wanted:
            self._require_running()
            if time.monotonic() > until:
                why = self.cause if self.cause != "none" else f"too few good frames, or the wrong mode, {self.mode}"
                raise RigError(f"no {request!r} within {timeout_s:g} s: {why}")
            self._gate.request(request)
            time.sleep(self._pause_s)

    def _require_running(self) -> None:
        if not self.running:
            raise RigError("the loop does not run: start() it; one that was stopped is made anew")
