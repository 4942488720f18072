"""Samples of a real-time loop as they come: rows of a record, cycles of a task, and columns of its result."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.loop import Measurement
from mgdd.rig.can.loop_map import LOOP_NAMES
from mgdd.rig.exchange import Exchange, flat
from mgdd.rig.experiment.watched import Cycle
from mgdd.rig.recorder import Recorder

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LOOP_TABLE", "LoopSamples", "task_columns"]

LOOP_TABLE = "loop"  # of a record: a row per cycle of the loop
RUN = _core.rig.safety_states.index("run")
_MAP_NAMES = {own: name for name, own in LOOP_NAMES.items()}


class LoopSamples:
    """Takes the samples of a loop: into a record, to a listener, and keeps what the result needs.

    Parameters
    ----------
    recorder : Recorder or None
        Takes each cycle into the table ``loop``, with all that a replay needs.
    row : callable
        Takes each exchange with the plant: the duty of a cycle, and what the next cycle had measured.
    listener : callable
        Takes the exchanges of the task as cycles.
    value_names : sequence of str
        Measured values of the map; those that a loop does not read are NaN.
    samples : int
        How many grid points the task has.
    sample_s : float
        Time between two of them [s].
    """

    def __init__(
        self,
        recorder: Recorder | None,
        *,
        row: Callable[[Mapping[str, float]], None],
        listener: Callable[[Cycle], None],
        value_names: Sequence[str],
        samples: int,
        sample_s: float,
    ) -> None:
        self._recorder, self._row, self._listener = recorder, row, listener
        self._samples, self._sample_s = samples, sample_s
        self._missing = dict.fromkeys(value_names, math.nan)
        self._before: dict[str, float] | None = None
        self._told, self._untold = 0, deque[Cycle]()
        self._rows: list[dict[str, float]] = []
        self._first: int | None = None
        self._running = False

    @property
    def done(self) -> int:
        """Grid points of the task that are over: their measurement has come."""
        if self._first is None or self._before is None:
            return 0
        return min(int(self._before["cycle"]) - self._first, self._samples)

    @property
    def stopped(self) -> bool:
        """Whether the gate has taken the drive away since the task began."""
        return self._first is not None and not self._running

    def take(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Take samples.

        Parameters
        ----------
        columns : mapping of str to ndarray
            As `RealtimeLoop.sample_columns` gives them.
        """
        names = [name for name in columns if name != "deadline_ns"]
        rows = zip(columns["deadline_ns"].tolist(), *(columns[name].tolist() for name in names), strict=True)
        for deadline_ns, *values in rows:
            self._take(deadline_ns, _recorded(dict(zip(names, map(float, values), strict=True))))

    def tell(self) -> None:
        """Tell the listener of the cycles that it has not heard of; what it raises ends the run."""
        while self._untold:
            self._told += 1
            self._listener(self._untold.popleft())

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Give what the task came to, a row per grid point; see `task_columns`."""
        return task_columns(self._rows, self._samples)

    def _take(self, deadline_ns: int, now: dict[str, float]) -> None:
        if self._recorder is not None:
            self._recorder.sample(LOOP_TABLE, now, monotonic_ns=deadline_ns)
        over = self.done == self._samples
        before, self._before = self._before, now
        self._running = now["mode"] == RUN
        began = self._first is not None
        if self._running and not began:
            self._first = int(now["cycle"])
        if self._first is not None and not over:
            self._rows.append(now)
        if before is None:
            return
        exchange = Exchange({"duty": before["duty"]}, self._measurement(before, now))
        self._row(flat(exchange))
        if began and not over:
            asked, thinking_s = {"duty": before["asked_duty"]}, before["compute_us"] * 1e-6
            period_s = (now["cycle"] - before["cycle"]) * self._sample_s
            cycle = Cycle(
                self._told + len(self._untold), asked, exchange.measurement, thinking_s, period_s - thinking_s
            )
            self._untold.append(cycle)

    def _measurement(self, before: Mapping[str, float], now: Mapping[str, float]) -> Measurement:
        values = {name: now[name] for name in _MAP_NAMES.values()}
        return Measurement(
            components=(),
            limits={},
            misfire=False,
            values={**self._missing, **{n: v for n, v in values.items() if n in self._missing}},
            applied={"duty": _applied(before, now)},
        )


def task_columns(rows: Sequence[Mapping[str, float]], samples: int) -> dict[str, NDArray[np.float64]]:
    """Give the columns of a task from the rows of a loop.

    Parameters
    ----------
    rows : sequence of mapping
        From the first cycle that was driven on.
    samples : int
        Grid points of the task, at most.

    Returns
    -------
    dict of str to ndarray
        ``asked_duty``, ``duty`` as the node reports it, and ``sensed_angle_deg``, which was measured after that duty. A
        grid point that the loop missed has the numbers of the one before: what was sent last held.
    """
    cycle = np.array([row["cycle"] for row in rows])
    done = 0 if len(rows) == 0 else min(int(cycle[-1] - cycle[0]), samples)
    if done == 0:
        return {name: np.empty(0) for name in ("asked_duty", "duty", "sensed_angle_deg")}
    place = np.searchsorted(cycle, cycle[0] + np.arange(done + 1), side="right") - 1
    applied = [_applied(rows[at], rows[after]) for at, after in pairwise(place)]
    return {
        "asked_duty": np.array([rows[at]["asked_duty"] for at in place[:-1]]),
        "duty": np.array(applied),
        "sensed_angle_deg": np.array([rows[after]["sensed_angle_deg"] for after in place[1:]]),
    }


def _applied(before: Mapping[str, float], after: Mapping[str, float]) -> float:
    said = after["applied_duty"]
    return before["duty"] if math.isnan(said) else said


def _recorded(row: dict[str, float]) -> dict[str, float]:
    """Name the numbers of a sample as the other tables of a record do."""
    row["sensed_angle_deg"] = row.pop("angle_deg")
    row["mode"] = row.pop("state")
    return row
