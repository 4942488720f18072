"""The record of a run: every exchange with the rig and every event, appended as it happens."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.recorder import Recorder

__all__ = ["RunRecord"]

_TABLE = "rig"  # where `RigRecord.read` looks for exchanges


class RunRecord:
    """Takes what happens in a run: to a file, if there is one, and to a list of events."""

    def __init__(self, file: Path | None, checked: CheckedExperiment) -> None:
        self.events: list[str] = []
        self.began = False
        header = {"experiment": checked.experiment.to_toml(), **checked.to_dict()}
        self.recorder = None if file is None else Recorder(file, config=header)
        self._names: tuple[str, ...] = ()
        self._missed: set[str] = set()

    def row(self, row: Mapping[str, float]) -> None:
        """Append an exchange; the first one says the names, what a later one lacks is NaN."""
        if self.recorder is None:
            return
        if not self._names:
            # What a rig applied may be missing at first: it has its place from the start.
            late = [name.replace("input.", "applied.", 1) for name in row if name.startswith("input.")]
            self._names = tuple(dict.fromkeys((*row, *late)))
        new = sorted(set(row).difference(self._names, self._missed))
        if new:
            self._missed.update(new)
            self.say([f"record: {', '.join(new)} came after the first cycle and has no column"])
        self.recorder.sample(_TABLE, {name: row.get(name, math.nan) for name in self._names})

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
            self.began = self.recorder.written > 0
            self.recorder.__exit__(kind, error, trace)
