"""What stands in a record: Datasets with units, and the repair of a damaged file."""

from __future__ import annotations

import datetime as dt
import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core import rig as core
from mgdd.errors import DataError, printable
from mgdd.io.files import existing_file, parsed
from mgdd.results.labels import VARIABLES, labelled_dataset
from mgdd.results.result import Result, merged
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

_LAST_ID = 0x1FFF_FFFF
_FLAGS = {
    "extended": "29-bit identifier",
    "error": "news of a bus error",
    "received": "received rather than sent",
    "fd": "CAN FD",
    "bit_rate_switch": "data at the higher rate",
    "remote": "request of a frame",
}


@dataclass(frozen=True, repr=False)
class RecordedRun(Result):
    """A run as its record holds it; every ``time_s`` counts from `started` on the monotonic clock."""

    run_id: str  # of the recorder
    started: dt.datetime  # UTC
    config: dict[str, Any]  # as given to `Recorder`
    header: dict[str, Any]  # ``mgdd``, ``config``, ``wall_ns``, ``monotonic_ns``
    frames: xr.Dataset  # ``bus_time_s`` is the stamp of the driver, from its first one on; ``data`` ends in zeros
    samples: dict[str, xr.Dataset]  # by table; units are those the names end in
    events: xr.Dataset
    records: int  # that were read
    unknown: int  # of them, of a kind of a later version
    damaged_bytes: int  # that a repair could not read
    ignored_bytes: int  # behind the last readable record; 0 in a file that was closed in peace

    @property
    def dataset(self) -> xr.Dataset:
        """All tables beside each other, the name of the table in front of each variable."""
        tables = {"frame": self.frames, "event": self.events, **self.samples}
        return merged(
            *(
                data.rename({name: f"{table}_{name}" for name in data.variables if name != table})
                for table, data in tables.items()
            ),
            attrs={"run_id": self.run_id, "started": self.started.isoformat()},
        )

    def summary(self) -> str:
        """Return a short text: what the record holds and what could not be read."""
        lines = [f"run {self.run_id}, started {self.started:%Y-%m-%d %H:%M:%S} UTC"]
        lines += [f"{self.frames.sizes['frame']} frames, {self.events.sizes['event']} events"]
        lines += [f"table {name}: {data.sizes['time_s']} samples of {len(data)}" for name, data in self.samples.items()]
        if self.unknown:
            lines += [f"{self.unknown} records of a kind that this version of mgdd does not know"]
        if self.damaged_bytes:
            lines += [f"{self.damaged_bytes} bytes were damaged"]
        if self.ignored_bytes:
            lines += [f"{self.ignored_bytes} bytes at the end are not readable: repair_record looks behind them"]
        return "\n".join(lines)


def read_record(path: str | os.PathLike[str]) -> RecordedRun:
    """Read a record up to its end or to its first damaged place.

    Parameters
    ----------
    path : path-like
        File of a `Recorder`; it may still be written.

    Returns
    -------
    RecordedRun
        Datasets ``frames``, ``samples[table]`` and ``events``, the header, and how many bytes were ignored.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Not a record, of another version, or a damaged header.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.rig import Recorder, read_record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "run.rec"
    ...     with Recorder(path) as record:
    ...         record.sample("plate", {"angle_deg": 9.0})
    ...     run = read_record(path)
    >>> run.samples["plate"]["angle_deg"].attrs["units"], run.ignored_bytes
    ('degree', 0)
    """
    read = core.read_record(os.fspath(existing_file(path)))
    raw = read["header"]
    text = raw["json"].decode("utf-8", "backslashreplace")
    try:
        content = parsed(text, "header", "JSON")
    except DataError:
        content = {"text": text}
    if not isinstance(content, dict):
        content = {"json": content}
    header = {**content, "wall_ns": raw["wall_ns"], "monotonic_ns": raw["monotonic_ns"]}
    start = header["monotonic_ns"]
    samples: dict[str, xr.Dataset] = {}
    for table in read["tables"]:
        name = _free(table["name"], samples)
        samples[name] = _table_dataset(table, start)
    return RecordedRun(
        run_id=read["header"]["run_id"].hex(),
        started=dt.datetime.fromtimestamp(header["wall_ns"] * 1e-9, dt.UTC),
        config=header.get("config", {}),
        header=header,
        frames=_frame_dataset(read["frames"], start, os.fspath(path)),
        samples=samples,
        events=_event_dataset(read["events"], start),
        records=read["records"],
        unknown=read["unknown"],
        damaged_bytes=read["damaged_bytes"],
        ignored_bytes=read["ignored_bytes"],
    )


def repair_record(path: str | os.PathLike[str], target: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """Make a damaged record readable to its end; nothing is lost.

    Every readable record is kept, also those behind a damaged place; what cannot be read stays in its place as bytes.
    A header that is damaged is replaced by an empty one. Written beside the target and renamed when complete.

    Parameters
    ----------
    path : path-like
        The record; not one that is still written.
    target : path-like, optional
        The repaired one; default the same file, which is left alone if there is nothing to repair.

    Returns
    -------
    dict
        ``records`` and ``damaged_bytes`` that were kept, ``places`` that were damaged, ``header_lost``.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Nothing in it is a record, or it is of another version.
    mgdd.errors.RigError
        The target cannot be written; nothing has changed.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.rig import Recorder, read_record, repair_record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "run.rec"
    ...     with Recorder(path) as record:
    ...         record.event("note", "the power fails")
    ...     with path.open("ab") as file:
    ...         _ = file.write(bytes(512))
    ...     before = read_record(path).ignored_bytes
    ...     repair_record(path)["damaged_bytes"], before, read_record(path).ignored_bytes
    (512, 512, 0)
    """
    source = existing_file(path)
    return dict(core.repair_record(os.fspath(source), os.fspath(source if target is None else target)))


def readable_record(path: str | os.PathLike[str]) -> RecordedRun:
    """Read a record for a caller who does not look at its counts, and warn of what cannot be read."""
    run = read_record(path)
    _warn_of_rest(path, run.ignored_bytes)
    return run


def _warn_of_rest(path: str | os.PathLike[str], ignored_bytes: int) -> None:
    if ignored_bytes:
        state = "are not readable and left out: mgdd.rig.repair_record looks behind them"
        warnings.warn(
            f"{printable(os.fspath(path))}: {ignored_bytes} bytes at its end {state}", UserWarning, stacklevel=3
        )


def stamped_frames(path: Path) -> Iterator[tuple[float, core.Frame]]:
    """Yield the frames of a record with their wall-clock time [s since 1970]: the start's, gone on by the monotonic.

    Warns at the end of what cannot be read.
    """
    reader = core.RecordReader(os.fspath(path))
    shift = reader.header["wall_ns"] - reader.header["monotonic_ns"]
    for record in reader:
        if isinstance(record, core.Frame):
            yield (record.monotonic_ns + shift) * 1e-9, record
    _warn_of_rest(path, reader.ignored_bytes)


def _free(name: str, taken: Mapping[str, Any]) -> str:
    """Return the name, or it with the first number that is free."""
    return name if name not in taken else next(n for i in range(2, len(taken) + 3) if (n := f"{name}_{i}") not in taken)


def _seconds(stamps: NDArray[np.int64], start: int) -> NDArray[np.float64]:
    """Seconds since the start; exact to the nanosecond for 104 days."""
    return np.asarray(stamps - start, np.float64) * 1e-9


def _table_dataset(table: Mapping[str, Any], start: int) -> xr.Dataset:
    variables: dict[str, Any] = {"time_s": ("time_s", _seconds(table["monotonic_ns"], start))}
    for place, given in enumerate(table["columns"]):
        name = _free(given, variables)
        values = table["values"][:, place]
        standard = VARIABLES.get(name)
        label = standard or (unit_of(name), name.replace("_", " ").strip() or repr(name))
        variables[name] = ("time_s", values, *label)
    return labelled_dataset(variables)


def _frame_dataset(frames: Mapping[str, Any], start: int, origin: str) -> xr.Dataset:
    bus = frames["bus_ns"]
    beyond = np.flatnonzero(frames["id"] > _LAST_ID)
    if beyond.size:
        at = int(beyond[0])
        raise DataError(f"{origin}: frame {at} has the identifier {int(frames['id'][at]):#x}: it has at most 29 bits")
    given = bus != 0
    first = int(bus[given][0]) if given.any() else 0
    variables: dict[str, Any] = {
        "frame": ("frame", np.arange(len(bus), dtype=np.int32), "-", "frame"),
        "byte": ("byte", np.arange(frames["data"].shape[1], dtype=np.int32), "-", "byte of the payload"),
        "time_s": ("frame", _seconds(frames["monotonic_ns"], start)),
        "bus_time_s": ("frame", np.where(given, _seconds(bus, first), np.nan), "s", "stamp of the driver"),
        "id": ("frame", frames["id"].astype(np.int32), "-", "identifier"),
        "size": ("frame", frames["size"], "-", "bytes of the payload"),
        "channel": ("frame", frames["channel"], "-", "bus"),
        "data": (("frame", "byte"), frames["data"], "-", "payload"),
    }
    variables |= {name: ("frame", frames[name], "-", text) for name, text in _FLAGS.items()}
    return labelled_dataset(variables, attrs={"bus_start_ns": str(first)})


def _event_dataset(events: list[tuple[int, str, str]], start: int) -> xr.Dataset:
    stamps = np.array([stamp for stamp, _, _ in events], np.int64)
    return labelled_dataset(
        {
            "event": ("event", np.arange(len(events), dtype=np.int32), "-", "event"),
            "time_s": ("event", _seconds(stamps, start)),
            "category": ("event", np.array([category for _, category, _ in events], np.str_), "-", "kind of event"),
            "text": ("event", np.array([text for _, _, text in events], np.str_), "-", "what happened"),
        }
    )
