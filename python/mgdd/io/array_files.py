"""Readers of binary files: MATLAB, HDF5, netCDF, NumPy, Parquet, TDMS of National Instruments, MDF of ASAM."""

from __future__ import annotations

import contextlib
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError
from mgdd.io.array_table import Columns, Named, Reversed, Samples, columns_of, marked
from mgdd.io.extras import import_extra
from mgdd.results.labels import ANGLE

_MISSING = ("_FillValue", "missing_value")
_MARKS = (*_MISSING, "valid_min", "valid_max", "valid_range", "scale_factor", "add_offset")
# What stands where nothing was written, by type; of bytes every value is data ("NetCDF Users Guide", fill values).
_UNWRITTEN = {
    "f4": 9.969209968386869e36, "f8": 9.969209968386869e36, "i2": -32767, "u2": 65535, "i4": -2147483647,
    "u4": 4294967295, "i8": -9223372036854775806, "u8": 18446744073709551614,
}  # fmt: skip


def of_matlab(file: Path, _: contextlib.ExitStack) -> Columns:
    """Read the variables of MATLAB 4 to 7, whole."""
    from scipy.io import loadmat

    try:
        content = loadmat(file, squeeze_me=True, struct_as_record=False)
    except MemoryError:
        raise
    except Exception as error:
        raise DataError(f"{file}: not a MATLAB file: {error}: save it with save(..., '-v7') or as CSV") from error
    return columns_of(
        column for name, value in content.items() if not name.startswith("__") for column in _of_struct(name, value)
    )


def _of_struct(name: str, value: Any) -> Iterator[Named]:
    for field in getattr(value, "_fieldnames", ()):
        yield from _of_struct(f"{name}.{field}", getattr(value, field))
    if isinstance(value, np.ndarray):
        yield Named(name, value)


def of_hdf5(file: Path, stack: contextlib.ExitStack) -> Columns:
    """Open the data sets of an HDF5 file, as MATLAB 7.3 and netCDF 4 write one too, until the stack closes it."""
    h5py = import_extra("h5py", "formats", "a file of MATLAB 7.3, HDF5 or netCDF 4")
    content = stack.enter_context(h5py.File(file, "r"))
    matlab = any("MATLAB_class" in item.attrs for item in content.values())
    items: list[tuple[str, Any]] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.shape is not None and item.dtype.kind in "fiub" and name[0] != "#":
            items.append((name.replace("/", "."), item))

    content.visititems(visit)
    netcdf = "_NCProperties" in content.attrs
    columns = []
    for name, item in items:
        if item.external or item.is_virtual:  # a missing file would give numbers that nobody measured
            raise DataError(
                f"{file}: the numbers of data set {name!r} are in other files: those are not read; copy them into one, "
                "as h5repack does"
            )
        needed, held = item.size * item.id.get_type().get_size(), item.id.get_storage_size()
        if item.id.get_offset() is not None and held < needed:  # the library would give whatever is in memory
            raise ValueError(f"data set {name!r} has {held} of {needed} bytes")
        values = _Decoded(item, item.attrs, unwritten=netcdf)
        unit = next(filter(None, (_text(item.attrs.get(key)) for key in ("units", "unit"))), "")
        columns.append(Named(name, Reversed(values) if matlab else values, unit))
    return columns_of(columns)


def _text(value: Any) -> str:
    """Give the text of an attribute; none of what is empty or no text."""
    first = next(iter(np.ravel(value)), "")
    return first.decode() if isinstance(first, bytes) else first if isinstance(first, str) else ""


def of_netcdf(file: Path, stack: contextlib.ExitStack) -> Columns:
    """Open the variables of a netCDF 3 file until the stack closes it."""
    import xarray as xr

    raw: dict[str, Any] = {"mask_and_scale": False, "decode_times": False}
    dataset = stack.enter_context(xr.open_dataset(file, engine="scipy", **raw))
    named = []
    for name in sorted(dataset.variables, key=lambda each: each != ANGLE):  # the angle first, as in a text
        variable = dataset[name].variable
        values = _Decoded(variable, variable.attrs, unwritten=True)
        turned = variable.dims[-1:] == (ANGLE,)
        named.append(Named(str(name), Reversed(values) if turned else values, str(variable.attrs.get("units", ""))))
    return columns_of(named, along=dataset.sizes.get(ANGLE))


def of_numpy(file: Path, stack: contextlib.ExitStack) -> Columns:
    """Open the arrays of an NPY or NPZ file until the stack closes it."""
    content = np.load(file, mmap_mode="r", allow_pickle=False)
    if isinstance(content, np.ndarray):
        named = content.dtype.names
        return columns_of([Named(name, content[name]) for name in named] if named else [Named("", content)])
    stack.enter_context(content)
    members = (name.removesuffix(".npy") for name in content.zip.namelist() if name.endswith(".npy"))
    return columns_of(Named(name, _Member(content, name)) for name in members)


class _Member:
    """An array of an NPZ file, which holds it compressed: read whole, once, where any of it is asked for."""

    def __init__(self, archive: Any, name: str) -> None:
        self._archive, self._name = archive, name
        with archive.zip.open(f"{name}.npy") as stream:
            form = np.lib.format
            read = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
            header = read.get(form.read_magic(stream))  # another version holds records, no columns
            found: tuple[Any, bool, Any] = header(stream) if header else ((), False, np.dtype(object))
            self.shape, _, self.dtype = found

    @cached_property
    def _values(self) -> NDArray[Any]:
        values: NDArray[Any] = self._archive[self._name]
        return values

    def __getitem__(self, index: Any) -> Any:
        return self._values[index]


def of_parquet(file: Path, stack: contextlib.ExitStack) -> Columns:
    """Open the columns of a Parquet file until the stack closes it."""
    parquet = import_extra("pyarrow.parquet", "parquet", "a Parquet file")
    content = stack.enter_context(parquet.ParquetFile(file))
    named = []
    for field in content.schema_arrow:
        notes = field.metadata or {}
        unit = (notes.get(b"units") or notes.get(b"unit") or b"").decode()
        named.append(Named(field.name, _ArrowColumn(content, field), unit))
    return columns_of(named)


class _ArrowColumn:
    """A column of a Parquet file."""

    def __init__(self, content: Any, field: Any) -> None:
        self._content, self._name = content, field.name
        self.shape = (content.metadata.num_rows,)
        self._cast = str(field.type).startswith(("decimal", "bool"))  # else objects, where cells are empty
        try:
            self.dtype = np.dtype(float if self._cast else field.type.to_pandas_dtype())
        except (NotImplementedError, TypeError):
            self.dtype = np.dtype(object)

    def __getitem__(self, _: Any) -> NDArray[Any]:
        column = self._content.read(columns=[self._name])[self._name]
        values: NDArray[Any] = (column.cast("double") if self._cast else column).to_numpy()
        return values


class _Decoded:
    """An array that gives what is missing as NaN, and packed numbers unpacked."""

    def __init__(self, values: Any, marks: Mapping[str, Any], *, unwritten: bool = False) -> None:
        self._values, self.shape = values, values.shape
        given = {key: np.ravel(marks[key]) for key in _MARKS if key in marks}
        least = {"valid_range": 2}
        self._marks = {
            key: numbers
            for key, numbers in given.items()
            if numbers.dtype.kind in "fiu" and numbers.size >= least.get(key, 1)
        }
        usual = _UNWRITTEN.get(f"{values.dtype.kind}{values.dtype.itemsize}")
        if unwritten and usual is not None:
            self._marks.setdefault("_FillValue", np.array([usual]))
        self.dtype = np.dtype(np.float64) if self._marks and values.dtype.kind in "fiu" else values.dtype

    def __getitem__(self, index: Any) -> NDArray[Any]:
        raw = np.asarray(self._values[index])
        if not self._marks or raw.dtype.kind not in "fiu":
            return raw
        missing = np.isin(raw, [value for key in _MISSING for value in self._of_type(key, raw.dtype)])
        low, high = self._marks.get("valid_range", [-np.inf, np.inf])[:2]
        for key, end in (("valid_min", low), ("valid_max", high)):
            bound = self._marks.get(key, [end])[0]
            missing |= raw < bound if key == "valid_min" else raw > bound
        numbers = marked(raw.astype(np.float64), missing)
        (scale, *_), (offset, *_) = self._marks.get("scale_factor", [1.0]), self._marks.get("add_offset", [0.0])
        return numbers if (scale, offset) == (1.0, 0.0) else numbers * scale + offset

    def _of_type(self, key: str, dtype: np.dtype[Any]) -> list[Any]:
        """Return the values of a mark as the array would hold them; one that it cannot hold marks nothing."""
        with np.errstate(all="ignore"):
            held = np.asarray(self._marks.get(key, []))
            cast = held.astype(dtype)
        return [one for one, given in zip(cast, held, strict=True) if dtype.kind == "f" or one == given]


def of_tdms(file: Path, stack: contextlib.ExitStack) -> Columns:
    """Open the channels of a TDMS file until the stack closes it."""
    nptdms = import_extra("nptdms", "formats", "a TDMS file")
    # Not by its path: an index beside it may be of another record.
    content = stack.enter_context(nptdms.TdmsFile.open(stack.enter_context(file.open("rb"))))
    if content.file_status.incomplete_final_segment:
        warnings.warn(f"{file}: the record was cut off: its last samples are missing", UserWarning, stacklevel=2)
    channels = [channel for group in content.groups() for channel in group.channels()]
    names = Counter(channel.name for channel in channels)
    named: list[Named] = []
    for channel in channels:
        count = len(channel)
        name = channel.name if names[channel.name] == 1 else f"{channel.group_name}.{channel.name}"
        clock = _clock(channel.properties)
        if clock and count and not any(each.values.shape == (count,) and each.unit == "s" for each in named):
            time = Samples(count, np.float64, partial(_ticks, *clock, count))
            plain = not named and "time" not in names
            named.append(Named("time" if plain else f"time ({name})", time, "s"))
        unit = channel.properties.get("unit_string", channel.properties.get("NI_UnitDescription", ""))
        named.append(Named(name, Samples(count, channel.dtype, partial(channel.__getitem__, slice(None))), str(unit)))
    return columns_of(named)


def _clock(properties: Mapping[str, Any]) -> tuple[float, float] | None:
    """Give start and step of a channel's time [s]; None where its properties give no time, as a step of 0 does."""
    given = (properties.get("wf_start_offset", 0.0), properties.get("wf_increment"))
    start, step = (float(each) if isinstance(each, int | float | np.number) else np.nan for each in given)
    return (start, step) if np.isfinite(start) and np.isfinite(step) and step > 0.0 else None


def _ticks(start_s: float, step_s: float, count: int) -> NDArray[Any]:
    return start_s + step_s * np.arange(count)


def of_mdf(file: Path, stack: contextlib.ExitStack) -> Columns:
    """Open the channels of an MDF file, each group with its time, until the stack closes it."""
    asammdf = import_extra("asammdf", "mdf", "an MDF file")
    named: list[Named] = []
    stream = stack.enter_context(file.open("rb"))
    # One that its recorder did not finish by its path: asammdf does so, in a copy.
    content = stack.enter_context(asammdf.MDF(stream if stream.peek(1).startswith(b"MDF ") else file))
    for number, group in enumerate(content.groups):
        own = _channels(content, number)
        count = group.channel_group.cycles_nr
        if not own or not count:
            continue
        master = partial(content.get_master, number)
        if not _has_time(named, count, master):
            named.append(Named(f"time {number}" if named else "time", Samples(count, np.float64, master), "s"))
        for k in own:
            read = partial(_samples, content, number, k)
            first = read(record_offset=0, record_count=1)
            if first.ndim == 1:
                unit = str(content.get_channel_unit(group=number, index=k))
                named.append(Named(group.channels[k].name, Samples(count, first.dtype, read), unit))
            else:
                whole = content.select([(None, number, k)], validate=False)[0]
                named.append(Named(whole.name, marked(whole.samples, read(bits=True)), whole.unit))
    return columns_of(named)


def _virtual(content: Any, channel: Any) -> bool:
    """Whether a channel stands in no record; asammdf counts it from wherever a part begins."""
    return bool(channel.channel_type in (3, 6) if content.version >= "4" else not channel.bit_count)


def _has_time(named: list[Named], count: int, master: Callable[[], NDArray[Any]]) -> bool:
    """Whether a column of seconds holds these times already."""
    times = [each.values for each in named if each.unit == "s" and each.values.shape == (count,)]
    return bool(times) and any(np.array_equal(each[...], master()) for each in times)


def _samples(content: Any, group: int, index: int, *, bits: bool = False, **part: int) -> NDArray[Any]:
    """Return the samples of a channel, or the bits that mark some as invalid; asammdf itself leaves those out."""
    values, invalid = content.get(group=group, index=index, samples_only=True, ignore_invalidation_bits=True, **part)
    found: NDArray[Any] = invalid if bits else values if values.dtype.names else marked(values, invalid)
    return found


def _channels(content: Any, number: int) -> list[int]:
    """Give the channels of a group that hold numbers; one that is not within its record is refused.

    On such a channel asammdf ends the process. Numbers of the types stand in "MDF" by ASAM, versions 3.3 and 4.2.
    """
    master, group, out = content.masters_db.get(number), content.groups[number], []
    size, old = int(group.channel_group.samples_byte_nr), content.version < "4"
    rows, held = group.channel_group.cycles_nr, sum(block.original_size for block in group.get_data_blocks())
    if rows * size > held:
        raise ValueError(f"{rows} records of {size} bytes in a group of {held}")
    for k, channel in enumerate(group.channels):
        if _virtual(content, channel):
            first = bits = 0
        elif old:
            first, bits = channel.start_offset // 8 + channel.additional_byte_offset, channel.bit_count
        else:
            first, bits = channel.byte_offset, channel.bit_offset + channel.bit_count
        end = first + (bits + 7) // 8
        if end > size:
            raise ValueError(f"channel {channel.name!r} ends at byte {end} of a record of {size}")
        numeric = channel.data_type != 7 if old else channel.data_type in (*range(6), 10)  # or the bytes of a bus
        if k != master and numeric and not group.channel_dependencies[k]:
            out.append(k)
    return out
