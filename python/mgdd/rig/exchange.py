"""What went to a rig and what came back, sample by sample: recorded, as columns of numbers, and replayed."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from mgdd.errors import DataError, ParameterError, RigError
from mgdd.loop import Measurement, Plant
from mgdd.loop.plant import checked_inputs
from mgdd.rig.base import AroundPlant, OpenOnce, Rig
from mgdd.rig.recorded import RecordedRun, readable_record

TABLE = "rig"  # of a record, with a row per exchange
_PARTS = ("input", "component", "limit", "value", "noise_free", "applied")


class Exchange(NamedTuple):
    """Inputs as they were asked for, and the measurement that followed."""

    inputs: Mapping[str, float]
    measurement: Measurement


class RigRecord:
    """All exchanges with a rig, in their order."""

    def __init__(
        self, input_names: Sequence[str], limit_names: Sequence[str] = (), exchanges: Sequence[Exchange] = ()
    ) -> None:
        self.input_names, self.limit_names = tuple(input_names), tuple(limit_names)
        self._exchanges = list(exchanges)

    def __len__(self) -> int:
        return len(self._exchanges)

    def __getitem__(self, place: int) -> Exchange:
        return self._exchanges[place]

    def append(self, exchange: Exchange) -> None:
        """Add an exchange at the end."""
        self._exchanges.append(exchange)

    @classmethod
    def from_columns(cls, names: Sequence[str], table: ArrayLike) -> Self:
        """Read a table with a row per exchange, NaN where it has no such number; pressure traces apart.

        The names are ``misfire``, and ``input.NAME``, ``component.NUMBER``, ``limit.NAME``, ``value.NAME``,
        ``noise_free.NAME``, ``applied.NAME``. DataError for a column that is none of these, a table of another width,
        or no input.
        """
        values = np.asarray(table, np.float64)
        if values.ndim != 2 or values.shape[1] != len(names):
            raise DataError(f"table has shape {values.shape}: must have a column for each of {len(names)} names")
        places: dict[str, dict[str, int]] = {part: {} for part in _PARTS}
        for place, name in enumerate(names):
            part, _, own = name.partition(".")
            if part in places and own:
                places[part][own] = place
            elif name != "misfire":
                raise DataError(f"column {name!r}: must be misfire, or begin with one of {', '.join(_PARTS)} and a dot")
        if not places["input"]:
            raise DataError("the record has no column input.NAME: it is not one of a rig")
        misfire = list(names).index("misfire") if "misfire" in names else None
        record = cls(tuple(places["input"]), tuple(places["limit"]))
        for row in values.tolist():
            parts = {part: {own: row[place] for own, place in owns.items()} for part, owns in places.items()}
            components = {own: value for own, value in parts["component"].items() if not math.isnan(value)}
            record.append(
                Exchange(
                    parts["input"],
                    Measurement(
                        components=tuple(components.values()),
                        limits=parts["limit"],
                        misfire=misfire is not None and row[misfire] == 1.0,
                        values=parts["value"],
                        noise_free_limits=parts["noise_free"],
                        applied={own: value for own, value in parts["applied"].items() if not math.isnan(value)},
                    ),
                )
            )
        return record

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read the exchanges that a `RecordingRig` gave to a `Recorder`, with a warning where the file ends before.

        DataError where it has no such table.
        """
        return cls.of_run(readable_record(path), f"{path}")

    @classmethod
    def of_run(cls, run: RecordedRun, origin: str) -> Self:
        """Take the exchanges of a record that was read."""
        samples = run.samples
        if TABLE not in samples:
            raise DataError(f"{origin}: has no table {TABLE!r}: it has {', '.join(samples) or 'none'}")
        columns = samples[TABLE].data_vars
        try:
            return cls.from_columns([str(name) for name in columns], np.column_stack([*columns.values()]))
        except DataError as error:
            raise error.reworded(f"{origin}: table {TABLE!r}: {error}") from error


def flat(exchange: Exchange) -> dict[str, float]:
    """Give an exchange as one row of named numbers."""
    measured = exchange.measurement
    groups: dict[str, Mapping[Any, float]] = {
        "input": exchange.inputs,
        "component": dict(enumerate(measured.components)),
        "limit": measured.limits,
        "value": measured.values,
        "noise_free": measured.noise_free_limits,
        "applied": measured.applied,
    }
    row = {f"{part}.{name}": float(value) for part, group in groups.items() for name, value in group.items()}
    return {**row, "misfire": float(measured.misfire)}


class RecordingRig(AroundPlant):
    """A rig that remembers every exchange.

    Parameters
    ----------
    rig : Rig
        The rig, or a plain plant.
    sink : callable, optional
        Called with each row of named numbers as soon as it is measured, to write it to a file: all have the names of
        the first one, NaN where there is none.
    keep : bool
        Whether `record` remembers them too; a run of days has a sink instead.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> from mgdd.rig import RecordingRig, SimulatedRig
    >>> rows = []
    >>> with RecordingRig(SimulatedRig(VirtualThrottle()), rows.append) as rig:
    ...     rig.apply({"duty": 0.6})
    ...     measured = rig.measure()
    >>> rows[0]["input.duty"], len(rig.record)
    (0.6, 1)
    """

    def __init__(
        self, rig: Rig | Plant, sink: Callable[[Mapping[str, float]], None] | None = None, *, keep: bool = True
    ) -> None:
        super().__init__(rig)
        self.rig, self._keep = rig, keep
        self.record = RigRecord(rig.input_names, rig.limit_names)
        self._sink = sink
        self._inputs: dict[str, float] = {}
        self._names: tuple[str, ...] = ()

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Apply the inputs, as the rig takes them."""
        self.rig.apply(inputs)
        self._inputs = {name: float(inputs[name]) for name in self.rig.input_names}

    def measure(self) -> Measurement:
        """Measure, and remember it with its inputs."""
        measured = self.rig.measure()
        exchange = Exchange(dict(self._inputs), measured)
        if self._keep:
            self.record.append(exchange)
        if self._sink is not None:
            row = flat(exchange)
            self._names = self._names or tuple(row)
            self._sink({**dict.fromkeys(self._names, math.nan), **row})
        return measured

    def __enter__(self) -> Self:
        if isinstance(self.rig, Rig):
            self.rig.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        if isinstance(self.rig, Rig):
            self.rig.__exit__(kind, error, trace)


class Difference(NamedTuple):
    """An input that was asked for and is not the recorded one."""

    sample: int
    name: str
    asked: float
    recorded: float


class ReplayRig(OpenOnce):
    """A rig that gives back what was recorded.

    A measurement belongs to the inputs it was recorded at: where others are asked for, the replay ends there, or with
    ``strict=False`` goes on and lists them in `differences`.

    Parameters
    ----------
    record : RigRecord
        What `RecordingRig` remembered.
    tolerance : float
        Largest difference of an input that counts as none, in its unit.
    strict : bool
        Whether another input is an error.

    Raises
    ------
    mgdd.errors.ParameterError
        A negative tolerance.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> from mgdd.rig import RecordingRig, ReplayRig, SimulatedRig
    >>> with RecordingRig(SimulatedRig(VirtualThrottle(seed=1))) as rig:
    ...     rig.apply({"duty": 0.6})
    ...     live = rig.measure()
    >>> with ReplayRig(rig.record) as again:
    ...     again.apply({"duty": 0.6})
    ...     replayed = again.measure()
    >>> replayed == live
    True
    """

    def __init__(self, record: RigRecord, *, tolerance: float = 0.0, strict: bool = True) -> None:
        ParameterError.unless(tolerance >= 0.0, "tolerance", tolerance, ">= 0")
        self.record, self.tolerance, self.strict = record, tolerance, strict
        self.input_names, self.limit_names = record.input_names, record.limit_names
        self.differences: list[Difference] = []
        self.sample = 0
        self._asked: dict[str, float] | None = None

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Ask for the inputs of the next sample, as `mgdd.loop.Plant.apply`; RigError where the rig is closed."""
        self._require_open()
        values = checked_inputs(inputs, self.input_names)
        self._asked = dict(zip(self.input_names, values, strict=True))

    def measure(self) -> Measurement:
        """Give the next recorded measurement.

        RigError before `apply`, where the rig is closed, at the end of the record, and for another input than the
        recorded one.
        """
        self._require_open()
        if self._asked is None:
            raise RigError("measure() before apply(): apply the inputs first")
        if self.sample >= len(self.record):
            raise RigError(f"the record ends after {len(self.record)} samples: ask for fewer")
        recorded = self.record[self.sample]
        differences = [
            Difference(self.sample, name, asked, recorded.inputs[name])
            for name, asked in self._asked.items()
            if not abs(asked - recorded.inputs[name]) <= self.tolerance
        ]
        if differences and self.strict:
            one = differences[0]
            raise RigError(
                f"sample {one.sample}: {one.name} = {one.asked:g} was asked for, {one.recorded:g} is recorded; "
                "strict=False goes on and lists the differences"
            )
        self.differences += differences
        self.sample += 1
        return recorded.measurement
