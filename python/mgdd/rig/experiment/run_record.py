"""The record of a run: every exchange with the rig and every event, appended as it happens."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from mgdd.errors import DataError
from mgdd.rig.exchange import RigRecord
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.recorded import read_record
from mgdd.rig.recorder import Recorder

__all__ = ["TABLE", "RunRecord", "read_exchanges"]

TABLE = "rig"  # of the record: a row per exchange


class RunRecord:
    """Takes what happens in a run: to a file, if there is one, and to a list of events.

    Parameters
    ----------
    file : pathlib.Path, optional
        The record; without, only events are kept.
    checked : CheckedExperiment
        For the header.

    Attributes
    ----------
    events : list of str
        All that was said.
    recorder : Recorder or None
        Of the file.
    """

    def __init__(self, file: Path | None, checked: CheckedExperiment) -> None:
        self.events: list[str] = []
        header = {"experiment": checked.experiment.to_toml(), **checked.to_dict()}
        self.recorder = None if file is None else Recorder(file, config=header)
        self._names: tuple[str, ...] = ()

    def row(self, row: Mapping[str, float]) -> None:
        """Append an exchange; the first one says the names, what a later one lacks is NaN."""
        if self.recorder is None:
            return
        if not self._names:
            # What a rig applied may be missing at first: it has its place from the start.
            late = [name.replace("input.", "applied.", 1) for name in row if name.startswith("input.")]
            self._names = tuple(dict.fromkeys((*row, *late)))
        new = [name for name in row if name not in self._names]
        if new:
            self.say([f"record: {', '.join(new)} came too late for the table"])
        self.recorder.sample(TABLE, {name: row.get(name, math.nan) for name in self._names})

    def say(self, events: Iterable[str]) -> None:
        """Append events."""
        for event in events:
            self.events.append(event)
            if self.recorder is not None:
                category, _, text = event.partition(": ")
                self.recorder.event(category, text)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        if self.recorder is not None:
            self.recorder.__exit__(kind, error, trace)


def read_exchanges(file: Path) -> RigRecord:
    """Read the exchanges of a recorded run.

    Raises
    ------
    mgdd.errors.DataError
        Not a record, or none of a run.
    """
    import numpy as np

    samples = read_record(file).samples
    if TABLE not in samples:
        raise DataError(f"{file}: holds no exchanges of a rig: give run.rec of `mgdd rig run`")
    table = samples[TABLE]
    names = [str(name) for name in table.data_vars]
    return RigRecord.from_columns(names, np.column_stack([table[name].to_numpy() for name in names]))
