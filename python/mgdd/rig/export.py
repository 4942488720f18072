"""A record in the formats of other tools."""

from __future__ import annotations

import contextlib
import csv
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import Error, ParameterError, RigError
from mgdd.io.binary_files import write_netcdf, write_parquet
from mgdd.io.extras import import_extra
from mgdd.io.files import existing_file, write_whole
from mgdd.results.labels import label_of
from mgdd.rig.can.python_can import LOG_WRITERS, write_log
from mgdd.rig.recorded import RecordedRun, readable_record, stamped_frames

if TYPE_CHECKING:
    import xarray as xr


def export_record(
    source: str | os.PathLike[str], target: str | os.PathLike[str], *, kind: str | None = None
) -> list[Path]:
    """Write a record in the format of another tool.

    Parameters
    ----------
    source : path-like
        File of a `Recorder`; what cannot be read of it is left out, with a warning.
    target : path-like
        The file; of the kinds that hold one table per file a new folder.
    kind : {"mf4", "blf", "asc", "log", "netcdf", "csv", "parquet"}, optional
        The ending of `target` if left out. One file with everything: ``"mf4"`` (asammdf: tables, events and raw frames
        as a bus log; ``pip install "mgdd[mdf]"``). One file with the frames: ``"blf"``, ``"asc"`` or ``"log"``
        (candump; ``pip install "mgdd[can]"``). A folder with ``frames``, ``events`` and each table of samples:
        ``"netcdf"`` (classic format, by scipy), ``"csv"``, ``"parquet"`` (``pip install "mgdd[parquet]"``).

    Returns
    -------
    list of pathlib.Path
        What was written. It is written beside the target and renamed when complete: an existing file is replaced, an
        existing folder is not.

    Raises
    ------
    FileNotFoundError
        No such record.
    ImportError
        A package is missing; the message says how to install it.
    mgdd.errors.DataError
        Not a record.
    mgdd.errors.ParameterError
        An unknown kind.
    mgdd.errors.RigError
        The folder exists already, or the target cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.rig import Recorder, export_record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "run.rec"
    ...     with Recorder(path) as record:
    ...         record.sample("plate", {"angle_deg": 9.0}, monotonic_ns=0)
    ...     files = export_record(path, pathlib.Path(folder) / "run", kind="csv")
    >>> [file.name for file in files]
    ['events.csv', 'frames.csv', 'plate.csv']
    """
    record, whole = existing_file(source), Path(target)
    chosen = whole.suffix.removeprefix(".").lower() if kind is None else kind
    kinds = (*LOG_WRITERS, "mf4", *_TABLE_WRITERS)
    ParameterError.unless(chosen in kinds, "kind", chosen, f"one of {', '.join(kinds)}")
    if chosen in _TABLE_WRITERS:
        if whole.exists():
            raise RigError(f"{whole} exists already: name a new folder")
        with _naming(whole), tempfile.TemporaryDirectory(dir=whole.parent) as beside:
            made = Path(beside) / whole.name
            run = readable_record(record)
            made.mkdir()
            suffix, write = _TABLE_WRITERS[chosen]
            taken: set[str] = set()
            for name, data in {"frames": run.frames, "events": run.events, **run.samples}.items():
                stem = re.sub(r"[^\w.-]", "_", name) or "table"
                while stem in taken:
                    stem += "_"
                taken.add(stem)
                write(made / f"{stem}{suffix}", data)
            made.rename(whole)
        return sorted(whole.iterdir())
    with _naming(whole):
        if chosen == "mf4":
            write_whole(whole, lambda file: _write_mf4(file, readable_record(record)))
        else:
            write_whole(whole, lambda file: write_log(chosen, file, stamped_frames(record)))
    return [whole]


@contextlib.contextmanager
def _naming(target: Path) -> Iterator[None]:
    """Name the target in what the system says of it."""
    try:
        yield
    except OSError as error:
        if isinstance(error, Error):
            raise
        raise RigError(f"{target}: {error.strerror or error}; nothing was written, name another place") from error


def _columns(data: xr.Dataset) -> dict[str, tuple[Any, str, str]]:
    """Return name: (values, unit, long name) of what stands along the rows; a payload becomes its bytes."""
    rows = next(iter(data.sizes))
    out: dict[str, tuple[Any, str, str]] = {}
    for name in [*data.coords, *data.data_vars]:
        variable = data[name]
        values: Any = variable.values
        if variable.dims == (rows, "byte"):
            sizes = data["size"].values
            values = [bytes(row[:size]) for row, size in zip(values, sizes, strict=True)]
        elif variable.dims != (rows,):
            continue
        label = label_of(variable)
        out[str(name)] = (values, label.units, label.long_name)
    return out


def _write_csv(path: Path, data: xr.Dataset) -> None:
    columns = _columns(data)
    lists = [v.tolist() if isinstance(v, np.ndarray) else [each.hex() for each in v] for v, _, _ in columns.values()]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(columns)
        rows.writerows(zip(*lists, strict=True))


def _write_netcdf(path: Path, data: xr.Dataset) -> None:
    """Classic netCDF knows no unsigned numbers."""
    small = {name: v.astype(np.int16) for name, v in data.variables.items() if v.dtype == np.uint8}
    write_netcdf(data.assign({str(name): v for name, v in small.items()}), path)


_TABLE_WRITERS: Mapping[str, tuple[str, Callable[[Path, Any], None]]] = MappingProxyType(
    {
        "netcdf": (".nc", _write_netcdf),
        "csv": (".csv", _write_csv),
        "parquet": (".parquet", lambda path, data: write_parquet(_columns(data), path)),
    }
)

# A bus log as ASAM's associated standard "Bus logging" names its parts.
_BUS_GROUPS = {"CAN_DataFrame": (False, False), "CAN_ErrorFrame": (True, False), "CAN_RemoteFrame": (False, True)}


def _bus_event(group: str, frames: xr.Dataset) -> np.ndarray[Any, Any]:
    """Return frames as the structure that tools for bus logs look for."""
    small = ("BusChannel", "IDE", "DLC", "DataLength", "Dir", "EDL", "BRS", "ESI")
    kinds: list[Any] = [(f"{group}.ID", "<u4"), *((f"{group}.{name}", "u1") for name in small)]
    if group != "CAN_RemoteFrame":
        kinds += [(f"{group}.DataBytes", "u1", (64,))]
    out = np.zeros(frames.sizes["frame"], np.dtype(kinds))
    size = frames["size"].values
    out[f"{group}.ID"] = frames["id"].values
    out[f"{group}.BusChannel"] = frames["channel"].values
    out[f"{group}.IDE"] = frames["extended"].values
    out[f"{group}.DLC"] = np.where(size <= 8, size, 9 + np.searchsorted([12, 16, 20, 24, 32, 48], size))
    out[f"{group}.Dir"] = ~frames["received"].values
    out[f"{group}.EDL"] = frames["fd"].values
    out[f"{group}.BRS"] = frames["bit_rate_switch"].values
    if group != "CAN_RemoteFrame":
        out[f"{group}.DataLength"] = size
        out[f"{group}.DataBytes"][:, : frames.sizes["byte"]] = frames["data"].values
    return out


def _write_mf4(path: Path, run: RecordedRun) -> None:
    asammdf = import_extra("asammdf", "mdf", "an MF4 file")
    blocks = import_extra("asammdf.blocks.v4_blocks", "mdf", "an MF4 file")
    constants = import_extra("asammdf.blocks.v4_constants", "mdf", "an MF4 file")
    bus = blocks.SourceInformation(source_type=constants.SOURCE_BUS, bus_type=constants.BUS_TYPE_CAN)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = run.started
        for group, (error, remote) in _BUS_GROUPS.items():
            own = (run.frames["error"].values == error) & (run.frames["remote"].values == remote)
            frames = run.frames.isel(frame=own).sortby("time_s")
            if frames.sizes["frame"]:
                samples = _bus_event(group, frames)
                mdf.append(asammdf.Signal(samples, frames["time_s"].values, name=group, source=bus), comment="frames")
        for name, data in run.samples.items():
            ordered = data.sortby("time_s")
            signals = [
                asammdf.Signal(
                    ordered[key].values, ordered["time_s"].values, name=str(key), unit=label_of(data[key]).units
                )
                for key in data.data_vars
            ]
            mdf.append(signals, comment=name)
        if run.events.sizes["event"]:
            events = run.events.sortby("time_s")
            pairs = zip(events["category"].values, events["text"].values, strict=True)
            texts = np.array([f"{category}: {text}".encode() for category, text in pairs])
            signal = asammdf.Signal(texts, events["time_s"].values, name="event", encoding="utf-8")
            mdf.append(signal, comment="events")
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:  # it insists on its own ending
            saved = Path(folder) / "run.mf4"
            mdf.save(saved)
            saved.replace(path)
