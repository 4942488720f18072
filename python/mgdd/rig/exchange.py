"""What went to a rig and what came back, sample by sample, as columns of numbers."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from mgdd.errors import DataError
from mgdd.loop import Measurement, Plant
from mgdd.rig.base import Rig
from mgdd.rig.recorded import RecordedRun, readable_record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Exchange", "RecordingRig", "RigRecord"]

_PARTS = ("input", "component", "limit", "value", "noise_free", "applied")


class Exchange(NamedTuple):
    """Inputs as they were asked for, and the measurement that followed."""

    inputs: Mapping[str, float]
    measurement: Measurement


class RigRecord:
    """All exchanges with a rig, in their order.

    Parameters
    ----------
    input_names, limit_names : sequence of str
        Of the rig.
    exchanges : sequence of Exchange
        What it begins with.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.rig import RecordingRig, SimulatedRig
    >>> from mgdd.rig.exchange import RigRecord
    >>> with RecordingRig(SimulatedRig(EngineBench())) as rig:
    ...     rig.apply({"soc_cad": -6.0})
    ...     measured = rig.measure()
    >>> record = RigRecord.from_columns(*rig.record.to_columns())
    >>> len(record), record[0].measurement == measured
    (1, True)
    """

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
        """Add an exchange at the end.

        Parameters
        ----------
        exchange : Exchange
            Inputs and measurement.
        """
        self._exchanges.append(exchange)

    def to_columns(self) -> tuple[list[str], NDArray[np.float64]]:
        """Give names and a table with a row per exchange.

        Returns
        -------
        names : list of str
            ``misfire``, and ``input.NAME``, ``component.NUMBER``, ``limit.NAME``, ``value.NAME``, ``noise_free.NAME``,
            ``applied.NAME``.
        table : ndarray
            NaN where an exchange has no such number, or has it as NaN.
        """
        rows = [flat(exchange) for exchange in self._exchanges]
        names = list(dict.fromkeys(name for row in rows for name in row))
        for name in reversed(
            [*(f"input.{own}" for own in self.input_names), *(f"limit.{n}" for n in self.limit_names)]
        ):
            if name not in names:
                names.insert(0, name)
        table = np.array([[row.get(name, math.nan) for name in names] for row in rows], np.float64)
        return names, table.reshape(len(rows), len(names))

    @classmethod
    def from_columns(cls, names: Sequence[str], table: ArrayLike) -> Self:
        """Read what `to_columns` gave.

        Parameters
        ----------
        names : sequence of str
            Of the columns.
        table : array_like
            A row per exchange.

        Returns
        -------
        RigRecord
            Equal to what was written, pressure traces apart; numbers that were never there and were NaN are not told
            from each other.

        Raises
        ------
        mgdd.errors.DataError
            A column that is none of these, a table of another width, or no input.
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
    def read(cls, path: str | os.PathLike[str], *, table: str = "rig") -> Self:
        """Read the exchanges of a record file.

        Parameters
        ----------
        path : path-like
            File of a `Recorder` that was the sink of a `RecordingRig`.
        table : str
            Name of their table.

        Returns
        -------
        RigRecord
            As far as the file can be read, with a warning where it ends before.

        Raises
        ------
        mgdd.errors.DataError
            Not a record, or one without that table.
        """
        return cls.of_run(readable_record(path), f"{path}", table=table)

    @classmethod
    def of_run(cls, run: RecordedRun, origin: str, *, table: str = "rig") -> Self:
        """Take the exchanges of a record that was read."""
        samples = run.samples
        if table not in samples:
            raise DataError(f"{origin}: has no table {table!r}: it has {', '.join(samples) or 'none'}")
        columns = samples[table].data_vars
        try:
            return cls.from_columns([str(name) for name in columns], np.column_stack([*columns.values()]))
        except DataError as error:
            raise error.reworded(f"{origin}: table {table!r}: {error}") from error


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


class RecordingRig:
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
        self.rig, self._keep = rig, keep
        self.record = RigRecord(rig.input_names, rig.limit_names)
        self._sink = sink
        self._inputs: dict[str, float] = {}
        self._names: tuple[str, ...] = ()

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.rig.input_names

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities that `measure` reports."""
        return self.rig.limit_names

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle brings a new operating point; False for a rig that announces none."""
        return bool(getattr(self.rig, "operating_point_changes", False))

    @property
    def point(self) -> Any:
        """Operating point of the next cycle, for a guide; as absent as the rig's own."""
        return getattr(self.rig, "point")  # noqa: B009 - the protocol of a plant does not have it

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Apply the inputs.

        Parameters
        ----------
        inputs : mapping of str to float
            As the rig takes them.
        """
        self.rig.apply(inputs)
        self._inputs = {name: float(inputs[name]) for name in self.rig.input_names}

    def measure(self) -> Measurement:
        """Measure, and remember it with its inputs.

        Returns
        -------
        mgdd.loop.Measurement
            As the rig gives it.
        """
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
