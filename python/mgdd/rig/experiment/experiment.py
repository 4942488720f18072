"""An experiment file: what is asked, of which plant, over which bus, and what stands between."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from mgdd.errors import ParameterError
from mgdd.io.files import parsed, read_plain_text
from mgdd.results.describe import described
from mgdd.rig.can.can_rig import MODES
from mgdd.rig.can.toml_table import TomlTable
from mgdd.rig.experiment.settings import (
    PACES,
    TASKS,
    BusSettings,
    EnginePlant,
    IdentifyTask,
    MapTask,
    ReplaySettings,
    SafetySettings,
    SeekTask,
    Settings,
    ThrottlePlant,
    TrackTask,
)

_KIND, _FORMAT = "experiment", 1
_TASK_OF: Mapping[str, type[IdentifyTask | TrackTask | SeekTask | MapTask]] = {
    "identify": IdentifyTask, "track": TrackTask, "seek": SeekTask, "map": MapTask,
}  # fmt: skip
# Keys that may name a file, in the records of an experiment.
_FILES = {
    "settings": ("reference", "model", "prior", "known"), "plant": ("preset",), "safety": ("envelope",),
    "bus": ("map",), "replay": ("record",),
}  # fmt: skip
_HEAD = ("kind", "format", "task", "mode", "seed", "plant", "bus", "safety", "replay")


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """An experiment on a throttle or an engine; the same one runs in process, over a bus, on a record and on a bench.

    Parameters
    ----------
    task : {"identify", "track", "seek", "map"}
        What is done.
    mode : {"simulate", "hil", "dry_run", "replay", "bench"}
        Where: in this process; in another process behind a bus; on a real bus, transmitting nothing; on a record; on a
        real bench, which must be armed.
    seed : int
        Of the noise of a simulated plant, and of every search.
    plant : ThrottlePlant or EnginePlant
        What is simulated; the model of ``dry_run`` and ``bench`` stands in the task.
    bus : BusSettings
        Where the plant is.
    safety : SafetySettings
        What no controller and no seeker may exceed.
    replay : ReplaySettings
        The record to replay.
    settings : IdentifyTask, TrackTask, SeekTask or MapTask
        Of the task.
    origin : str
        The file, for messages; not compared.

    Examples
    --------
    >>> from mgdd.rig import Experiment
    >>> experiment = Experiment.from_toml('''
    ... kind = "experiment"
    ... format = 1
    ... task = "track"
    ... [track]
    ... reference = "step:20:60"
    ... controller = "pid"
    ... ''')
    >>> experiment.mode, experiment.settings.reference
    ('simulate', 'step:20:60')
    >>> Experiment.from_toml(experiment.to_toml()) == experiment
    True
    """

    task: str
    settings: IdentifyTask | TrackTask | SeekTask | MapTask
    plant: ThrottlePlant | EnginePlant
    mode: str = "simulate"
    seed: int = 0
    bus: BusSettings = field(default_factory=BusSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    replay: ReplaySettings = field(default_factory=ReplaySettings)
    origin: str = field(default="experiment", compare=False)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read an experiment file, checked as far as the file itself goes; `check_experiment` looks at what it names.

        The page Experiments lists the keys. FileNotFoundError; `mgdd.errors.DataError` where it is not TOML or lacks a
        key; `mgdd.errors.ParameterError` for an unknown key, a value of another form or outside its range.
        """
        return cls.from_toml(read_plain_text(path, only_utf8=True), origin=str(path))

    @classmethod
    def from_toml(cls, text: str, *, origin: str = "experiment") -> Self:
        """Read the text of an experiment file; errors as those of `load`."""
        table = TomlTable(parsed(text, origin, "TOML"), origin=origin)
        kind, version = table.take("kind", "text"), table.take("format", "integer")
        if kind != _KIND:
            raise table.error("kind", kind, repr(_KIND))
        if version != _FORMAT:
            raise table.error("format", version, f"{_FORMAT}: this version of mgdd reads no other")
        task = table.take("task", "text")
        if task not in TASKS:
            raise table.error("task", task, f"one of {', '.join(TASKS)}")
        table.only((*_HEAD, task))
        mode, seed = table.take("mode", "text", "simulate"), table.take("seed", "integer", 0)
        if mode not in MODES:
            raise table.error("mode", mode, f"one of {', '.join(MODES)}")
        if not 0 <= seed < 2**64:
            raise table.error("seed", seed, "in [0, 2**64)")
        return cls(
            task=task,
            mode=mode,
            seed=seed,
            settings=_TASK_OF[task].read(table.table(task)),
            plant=(EnginePlant if task in ("seek", "map") else ThrottlePlant).read(table.table("plant")),
            bus=BusSettings.read(table.table("bus")),
            safety=SafetySettings.read(table.table("safety")),
            replay=ReplaySettings.read(table.table("replay")),
            origin=origin,
        )

    def to_toml(self) -> str:
        """Write what `from_toml` reads back equal, every key that is set."""
        import tomli_w

        tables = {"plant": self.plant, "bus": self.bus, "safety": self.safety, "replay": self.replay}
        every: Mapping[str, Settings] = {self.task: self.settings, **tables}
        head = {"kind": _KIND, "format": _FORMAT, "task": self.task, "mode": self.mode, "seed": self.seed}
        return tomli_w.dumps(head | {name: own for name, table in every.items() if (own := table.to_dict())})

    def with_mode(
        self,
        mode: str,
        *,
        record: str | os.PathLike[str] | None = None,
        connection: str | None = None,
        pace: str | None = None,
    ) -> Self:
        """Give the same experiment in another mode; ParameterError where there is no such mode or pace.

        Parameters
        ----------
        mode : {"simulate", "hil", "dry_run", "replay", "bench"}
            The mode.
        record : path-like, optional
            The record to replay; as it is if left out.
        connection : str, optional
            The bus, as ``socketcan:can0``; as it is if left out.
        pace : {"step", "real_time"}, optional
            Of the bus; as it is if left out.
        """
        for name, value, among in (("mode", mode, MODES), ("pace", pace or self.bus.pace, PACES)):
            ParameterError.unless(value in among, name, value, f"one of {', '.join(among)}")
        bus = replace(self.bus, connection=connection or self.bus.connection, pace=pace or self.bus.pace)
        replay = self.replay if record is None else ReplaySettings(record=os.fspath(record))
        return replace(self, mode=mode, replay=replay, bus=bus)

    def with_files(self, put: Callable[[Path], str]) -> Self:
        """Give the same experiment with the names that `put` gives to the files beside it, by their paths."""
        changed: dict[str, Any] = {}
        for part, keys in _FILES.items():
            record = getattr(self, part)
            named = {key: getattr(record, key, None) for key in keys}
            paths = {key: self.folder / name for key, name in named.items() if name and (self.folder / name).is_file()}
            if paths:
                changed[part] = replace(record, **{key: put(path) for key, path in paths.items()})
        return replace(self, **changed)

    @property
    def folder(self) -> Path:
        """Where relative paths of the file start from."""
        return Path(self.origin).parent if Path(self.origin).is_file() else Path()

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Limited quantities that seeker and guard ask for."""
        own = getattr(self.settings, "limits", {})
        return tuple(dict.fromkeys((*own, *self.safety.limits)))


def _rows(experiment: Experiment) -> Mapping[str, Any]:
    own = {name: value for name, value in experiment.settings.to_dict().items() if not isinstance(value, Mapping)}
    return {"task": experiment.task, "mode": experiment.mode, "seed": experiment.seed, **own}


described(Experiment, rows=_rows)
