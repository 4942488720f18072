"""What a run leaves: whole files in a folder, and a record of every exchange and event, appended as it happens."""

from __future__ import annotations

import contextlib
import json
import math
import platform
import shutil
import sys
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from mgdd import _core
from mgdd.errors import RigError
from mgdd.io.files import write_whole
from mgdd.results.labels import to_jsonable
from mgdd.rig.experiment.checked import CheckedExperiment
from mgdd.rig.recorder import Recorder

if TYPE_CHECKING:
    import os

    import xarray as xr
    from matplotlib.figure import Figure

_INPUTS = "inputs"
_PACKAGES = ("numpy", "scipy", "xarray", "python-can", "cantools")
_TABLE = "rig"  # where `RigRecord.read` looks for exchanges


class RunFolder:
    """A new or empty folder that takes the files of one run."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._made = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            held = sorted(entry.name for entry in self.path.iterdir())
        except OSError as error:
            raise RigError(f"run folder {self.path}: {error.strerror or error}; name another one") from error
        if held:
            raise RigError(f"run folder {self.path}: holds {held[0]} already; name a new folder, no run is overwritten")

    def discard(self) -> None:
        """Take back what was written, and the folder where it was made: the run never began."""
        for entry in self.path.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry)
            else:
                entry.unlink()
        for folder in self._made:
            with contextlib.suppress(OSError):  # another run has come into a folder above
                folder.rmdir()

    def keep(self, path: Path) -> str:
        """Copy a file that a run reads, and give its name in the folder; bulk and maps stay where they are.

        A map reads its DBC beside it, a record may be large: both are named by their full path.
        """
        is_map = path.suffix == ".toml" and 'kind = "signal_map"' in path.read_text(encoding="utf-8", errors="replace")
        if path.suffix == ".rec" or is_map:
            return str(path.resolve())
        inputs = self.path / _INPUTS
        inputs.mkdir(exist_ok=True)
        name = path.name
        for number in range(2, 1000):
            if not (inputs / name).exists():
                break
            name = f"{path.stem}_{number}{path.suffix}"
        self._whole(f"{_INPUTS}/{name}", lambda half: half.write_bytes(path.read_bytes()))
        return f"{_INPUTS}/{name}"

    def text(self, name: str, text: str) -> None:
        """Write a text."""
        self._whole(name, lambda path: path.write_text(text, encoding="utf-8", newline="\n"))

    def json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write JSON; NaN and infinity as null."""
        self.text(name, json.dumps(to_jsonable(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n")

    def dataset(self, name: str, dataset: xr.Dataset) -> None:
        """Write netCDF."""
        self._whole(name, lambda path: dataset.to_netcdf(path, engine="scipy"))

    def figure(self, name: str, figure: Figure) -> None:
        """Write a PNG."""
        self._whole(name, lambda path: figure.savefig(path, dpi=150, format="png"))

    def _whole(self, name: str, write: Any) -> None:
        """Write under another name, and give it its own when it is on the disk."""
        try:
            write_whole(self.path / name, write)
        except OSError as error:
            raise RigError(
                f"{self.path / name}: {error.strerror or error}; free some space, or name a folder elsewhere"
            ) from error


def versions() -> dict[str, Any]:
    """Give time, versions and machine of a run."""
    found: dict[str, str | None] = {}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return {
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        "mgdd": _core.__version__,
        "python": platform.python_version(),
        "packages": found,
        "system": platform.platform(),
        "arguments": sys.argv[1:],
    }


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
