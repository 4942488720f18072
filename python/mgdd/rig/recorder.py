"""The record of a run: one append-only file that survives the process that writes it, and a bus that fills it."""

from __future__ import annotations

import json
import os
import threading
import time
import uuid
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd._core.rig import Frame, RecordWriter
from mgdd.errors import ParameterError, did_you_mean
from mgdd.results.labels import to_jsonable
from mgdd.rig.can.transport import Bus, changed

_OWN = "time_s"


class Recorder:
    """Writes frames, samples and events of a run into a new file, each with one unbuffered write.

    A process that is killed loses at most the record it was writing; after a failure of the power everything up to the
    last `sync` is there. Any thread may call it. `read_record` reads the file, also while it is written.

    Parameters
    ----------
    path : path-like
        The new file; a record is never overwritten.
    config : mapping, optional
        Whatever describes the run, for the header: settings, versions, hashes. What JSON can hold, with arrays and
        paths as `mgdd.results` writes them.

    Raises
    ------
    mgdd.errors.RigError
        The file exists, cannot be made, or the disk is full; also from every later call. What was written before stays
        readable.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.rig import Recorder, read_record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "run.rec"
    ...     with Recorder(path, config={"rig": "demo"}) as record:
    ...         for step in range(3):
    ...             record.sample("controller", {"angle_deg": 10.0 + step, "duty": 0.1})
    ...         record.event("state", "RUN -> LIMP")
    ...     run = read_record(path)
    >>> run.samples["controller"]["angle_deg"].values.tolist(), run.events["text"].values.tolist()
    ([10.0, 11.0, 12.0], ['RUN -> LIMP'])
    """

    def __init__(self, path: str | os.PathLike[str], *, config: Mapping[str, Any] | None = None) -> None:
        header = {"mgdd": _core.__version__, "config": to_jsonable(config or {})}
        identity = uuid.uuid4()
        self.run_id = identity.hex
        self._lock = threading.Lock()
        self._tables: dict[str, tuple[int, tuple[str, ...]]] = {}
        self._writer = RecordWriter(
            os.fspath(path),
            run_id=identity.bytes,
            wall_ns=time.time_ns(),
            monotonic_ns=time.monotonic_ns(),
            json=json.dumps(header, allow_nan=False, ensure_ascii=False),
        )

    @property
    def path(self) -> Path:
        """The file."""
        return Path(self._writer.path)

    @property
    def written(self) -> int:
        """Records that were written."""
        with self._lock:
            return self._writer.written

    @property
    def refused(self) -> int:
        """Records that could not be written; each raised its RigError."""
        with self._lock:
            return self._writer.refused

    def frame(self, frame: Frame) -> None:
        """Append a frame of a bus, sent or received, with its stamps."""
        with self._lock:
            self._writer.write(frame)

    def sample(self, table: str, values: Mapping[str, float], *, monotonic_ns: int | None = None) -> None:
        """Append a row of named numbers to a table, NaN where there is none; default now [ns].

        The first row makes the table and says the names for all: others are a ParameterError, as is ``time_s``, which a
        reader adds. A name ends in its unit, as ``angle_deg`` does.
        """
        now = time.monotonic_ns() if monotonic_ns is None else monotonic_ns
        with self._lock:
            number, names = self._tables.get(table) or self._new_table(table, tuple(values), now)
            if values.keys() != set(names):
                raise _other_names(table, names, values)
            self._writer.write_sample(number, now, _numbers(names, values))

    def event(self, category: str, text: str, *, monotonic_ns: int | None = None) -> None:
        """Append an event of a category, ``"state"``, ``"fault"``, ``"note"`` or any other word; default now [ns]."""
        now = time.monotonic_ns() if monotonic_ns is None else monotonic_ns
        with self._lock:
            self._writer.write_event(now, category, text)

    def sync(self) -> None:
        """Wait until the disk has everything: once a second is enough, and not in the thread of a loop."""
        with self._lock:
            self._writer.sync()

    def close(self) -> None:
        """Close the file; a second time does nothing."""
        with self._lock:
            self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        try:
            if kind is not None:
                self.event("exception", f"{kind.__name__}: {error}")
        finally:
            self.close()

    def _new_table(self, table: str, names: Sequence[str], now: int) -> tuple[int, tuple[str, ...]]:
        ParameterError.unless(_OWN not in names, "values", _OWN, "another name: the record has its own time_s")
        self._tables[table] = (self._writer.add_table(table, list(names), now), tuple(names))
        return self._tables[table]


def _numbers(names: Sequence[str], values: Mapping[str, float]) -> NDArray[np.float64]:
    try:
        return np.array([float(values[name]) for name in names])
    except (TypeError, ValueError):
        name = next(name for name in names if not isinstance(values[name], Real))
        raise ParameterError.of(name, values[name], "one number") from None


def _other_names(table: str, names: Sequence[str], values: Mapping[str, float]) -> ParameterError:
    unknown = [name for name in values if name not in names]
    if unknown:
        hint = did_you_mean(unknown[0], names) or f"it has {', '.join(names)}"
        return ParameterError.of("values", unknown[0], f"a name of table {table}: {hint}")
    missing = next(name for name in names if name not in values)
    return ParameterError.of("values", missing, f"given in every row of table {table}: NaN where there is none")


class RecordedBus:
    """Passes everything on to another bus, and appends every frame to a record."""

    def __init__(self, bus: Bus, recorder: Recorder) -> None:
        self.bus, self.recorder = bus, recorder
        self.name, self.shared, self.stays_here = bus.name, bus.shared, bool(getattr(bus, "stays_here", False))
        self.open, self.close, self.claim = bus.open, bus.close, bus.claim
        # Identifiers that another socket of this process sends: what is received of them is recorded as sent.
        self.sent_elsewhere: frozenset[tuple[int, bool]] = frozenset()

    @property
    def counters(self) -> dict[str, Any]:
        """What the bus counts."""
        return dict(getattr(self.bus, "counters", {}))

    def send(self, frame: Frame, *, final: bool = False) -> None:
        """Send a frame; what the bus did not take is not recorded."""
        self.bus.send(frame, final=final)
        self._append(frame, received=False)

    def receive(self, timeout_s: float) -> Frame | None:
        """Give the next frame."""
        frame = self.bus.receive(timeout_s)
        if frame is not None:
            self._append(frame, received=(frame.id, frame.extended) not in self.sent_elsewhere)
        return frame

    def _append(self, frame: Frame, *, received: bool) -> None:
        stamp_ns = frame.monotonic_ns or time.monotonic_ns()
        self.recorder.frame(changed(frame, monotonic_ns=stamp_ns, received=received))
