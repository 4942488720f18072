"""Readers of files of recorders: TDMS of National Instruments, MDF of ASAM."""

from __future__ import annotations

import contextlib
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.io.array_table import Columns, Named, Samples, columns_of, marked
from mgdd.io.extras import import_extra


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
