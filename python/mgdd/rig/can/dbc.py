"""A DBC file as the codec of the core reads it: cantools parses, `SignalLayout` packs and unpacks."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mgdd._core.rig import SignalLayout
from mgdd.errors import DataError, did_you_mean
from mgdd.io.extras import import_extra
from mgdd.io.files import bytes_of, decoded, existing_file

__all__ = ["DbcFile", "DbcMessage", "DbcSignal"]

_MISSING = ("invalid", "sna", "signal_not_available", "not_available")  # names of a raw value that says: no value

# What the parser would allocate or count without a bound, looked for outside of texts in quotes and comments.
_QUOTED = re.compile(r'"(?:\\"|[^"])*?"|//[^\n]*')
_MESSAGE = re.compile(r"(?<![A-Za-z_])BO_\s([^:;]*):\s*([-+]?\d[^\s:]*)")
_SIGNAL = re.compile(r"(?<![A-Za-z_])SG_\s([^:;]*):\s*([-+]?\d+)\s*\|\s*([-+]?\d+)\s*@")
_RANGES = re.compile(r"(?<![A-Za-z_])SG_MUL_VAL_\s[^;]*")
_RANGE = re.compile(r"(\d+)\s*-\s*(\d+)")
_LONG_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d{41,}|\d+\.?\d*[eE][-+]?\d{4,})")
_QUOTED_NUMBER = re.compile(r'"\s*[-+\d._]+[eE][-+]?[\d_]{4,}\s*"')
_BYTES, _BITS, _BRANCHES = 64, 64, 1 << 16  # of a CAN FD frame, of a signal, and values of all multiplexers together
_PARTS_BYTES = 1785  # of a message in several frames, SAE J1939-21


@dataclass(frozen=True, kw_only=True)
class DbcSignal:
    """A signal: its bits, its unit, and the names of its raw values."""

    name: str
    layout: SignalLayout
    unit: str  # "-" if it has none
    choices: Mapping[str, int] = field(default_factory=dict)  # raw value by its name in the value table
    missing_raw: int | None = None  # raw value that means that the value is missing
    branches: tuple[int, ...] = ()  # values of the multiplexer that select it; none: always there
    multiplexer: bool = False  # whether it selects others

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest physical value that can be sent."""
        layout = self.layout
        low, high = -math.inf, math.inf
        if layout.raw_type in ("signed", "unsigned"):
            least = -(1 << (layout.length - 1)) if layout.raw_type == "signed" else 0
            low, high = sorted(raw * layout.scale + layout.offset for raw in (least, least + (1 << layout.length) - 1))
        return (
            low if layout.minimum is None else max(low, layout.minimum),
            high if layout.maximum is None else min(high, layout.maximum),
        )


@dataclass(frozen=True, kw_only=True)
class DbcMessage:
    """A message: identifier, bytes, time between two frames, signals."""

    name: str
    frame_id: int
    extended: bool
    size: int
    cycle_s: float | None  # None where it is sent on events
    signals: Mapping[str, DbcSignal]  # without those beyond 64 bits, none of a message in several frames

    @property
    def multiplexer(self) -> DbcSignal | None:
        """The signal that selects others."""
        return next((signal for signal in self.signals.values() if signal.multiplexer), None)


@dataclass(frozen=True, kw_only=True)
class DbcFile:
    """A database of messages."""

    file: Path
    sha256: str
    messages: Mapping[str, DbcMessage]

    @classmethod
    def read(cls, path: Path) -> DbcFile:
        """Read a file strictly; DataError where it is not a DBC, or its signals overlap or leave their message."""
        cantools = import_extra("cantools", "can", "a DBC file")
        file = existing_file(path)
        content = bytes_of(file)
        text = decoded(content, str(file))
        _require_bounded(file, text)
        try:
            database = cantools.database.load_string(text, database_format="dbc", strict=True)
            messages = {message.name: _message(file, message) for message in database.messages}
            _require_once(file, database.messages)
        except DataError:
            raise
        except cantools.Error as error:
            raise DataError(
                f"{file}: {error}; correct the file, signals must fit their message and not overlap"
            ) from error
        except Exception as error:  # the parser raises what it stumbles over
            raise DataError(f"{file}: cannot be read as a DBC: {error}; correct the file") from error
        return cls(file=file, sha256=hashlib.sha256(content).hexdigest(), messages=messages)

    def message(self, name: str) -> DbcMessage:
        """Return a message; DataError guesses which one was meant."""
        if name in self.messages:
            message = self.messages[name]
            if message.size > _BYTES:
                raise DataError(
                    f"{self.file.name}: message {name} has {message.size} bytes: a frame has at most {_BYTES}, and "
                    "what comes in several is not put together here; map another one"
                )
            return message
        raise DataError(f"{self.file.name} has no message {name!r}: {near(name, self.messages)}")


def _require_bounded(file: Path, text: str) -> None:
    """Refuse what no frame can carry before the parser makes room for it."""
    plain = _QUOTED.sub('""', text)
    if number := _LONG_NUMBER.search(plain) or _QUOTED_NUMBER.search(text):
        raise DataError(f"{file}: the number {number[0]} is beyond all signals: correct it")
    for name, size in _MESSAGE.findall(plain):
        if "SG_" not in name and (not re.fullmatch(r"\d{1,4}", size) or int(size) > _PARTS_BYTES):
            raise DataError(
                f"{file}: message {name.strip()} has {size} bytes: a message has 0 to {_PARTS_BYTES}; correct it"
            )
    for name, start, length in _SIGNAL.findall(plain):
        if max(int(length), int(start) + 1) > 8 * _PARTS_BYTES:
            raise DataError(
                f"{file}: signal {name.strip()} has {length} bits from bit {start}: a message has up to "
                f"{8 * _PARTS_BYTES}; correct it"
            )
    branches = 0
    for ranges in _RANGES.findall(plain):
        branches += sum(max(0, int(last) - int(first) + 1) for first, last in _RANGE.findall(ranges))
    if branches > _BRANCHES:
        raise DataError(f"{file}: SG_MUL_VAL_ names {branches} values: at most {_BRANCHES} are read; narrow the ranges")


def _require_once(file: Path, messages: Sequence[Any]) -> None:
    """Refuse two messages of one name or identifier: which of them is meant, nobody knows."""
    taken: dict[Any, str] = {}
    for message in messages:
        for key in (message.name, (message.frame_id, message.is_extended_frame)):
            if key in taken:
                raise DataError(
                    f"{file}: message {message.name} has the name or identifier {message.frame_id:#x} of "
                    f"{taken[key]}: remove one"
                )
            taken[key] = message.name


def near(name: str, known: Mapping[str, Any]) -> str:
    """Ask for the nearest name, or list them."""
    return did_you_mean(name, known) or f"it has {', '.join(known) or 'none'}"


def _message(file: Path, message: Any) -> DbcMessage:
    whole = [] if message.length > _BYTES else message.signals
    signals = {signal.name: _signal(signal) for signal in whole if signal.length <= _BITS}
    selecting = [signal.name for signal in signals.values() if signal.multiplexer]
    if len(selecting) > 1:
        raise DataError(
            f"{file}: {message.name} has the multiplexers {', '.join(selecting)}: at most one per message is supported"
        )
    return DbcMessage(
        name=message.name,
        frame_id=message.frame_id,
        extended=message.is_extended_frame,
        size=message.length,
        cycle_s=message.cycle_time * 1e-3 if message.cycle_time else None,
        signals=signals,
    )


def _signal(signal: Any) -> DbcSignal:
    kind = "signed" if signal.is_signed else "unsigned"
    choices = {str(name): int(raw) for raw, name in (signal.choices or {}).items()}
    return DbcSignal(
        name=signal.name,
        layout=SignalLayout(
            start=signal.start,
            length=signal.length,
            byte_order=signal.byte_order,
            raw_type=f"float{signal.length}" if signal.is_float else kind,
            scale=float(signal.scale),
            offset=float(signal.offset),
            minimum=None if signal.minimum is None else float(signal.minimum),
            maximum=None if signal.maximum is None else float(signal.maximum),
        ),
        unit=signal.unit or "-",
        choices=choices,
        missing_raw=next((raw for name, raw in choices.items() if name.lower() in _MISSING), None),
        branches=tuple(signal.multiplexer_ids or ()),
        multiplexer=signal.is_multiplexer,
    )
