"""A DBC file as the codec of the core reads it: cantools parses, `SignalLayout` packs and unpacks."""

from __future__ import annotations

import hashlib
import logging
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mgdd._core.rig import SignalLayout
from mgdd.errors import DataError, Error, did_you_mean
from mgdd.io.extras import import_extra
from mgdd.io.files import bytes_of, decoded, existing_file

_LOG = logging.getLogger(__name__)

# What a value table calls a raw value that is not a measurement, in lower case: of every signal, and of one that
# carries a quantity: a switch or a state machine may well be in the state "error".
_NO_VALUE = (
    r"s ?n ?a|n ?a|(?:not|no) ?(?:avail(?:able)?|valid|present|defined|supported|value|data|signal|measurement|info)|"
    r"unavail(?:able)?|inv(?:alid|ld)?|undef(?:ined)?|unknown|missing|reserved|ungueltig|ungültig|"
    r"nicht (?:verfuegbar|verfügbar)"
)
_WRONG = (
    r"err(?:or)?|fault(?:y|ed)?|fail(?:ed|ure)?|defect(?:ive)?|defekt|fehler|broken|implausible|unplausible|"
    r"not plausible|out of range|(?:short|open) circuit|short to (?:ground|gnd|battery|supply)|(?:open|broken) wire"
)
_FILLERS = r"signal|sig|sensor|value|val|data|indicator|is|the|or|and|[0-9]+|0x[0-9a-f]+"
_WORDS = re.compile(r"[A-ZÄÖÜ]+(?![a-zäöüß])|[A-ZÄÖÜ]?[a-zäöüß]+|0x[0-9A-Fa-f]+|[0-9]+")
_IS_NO_VALUE = re.compile(rf"(?:(?:{_FILLERS}) )*(?:(?:{_NO_VALUE}) (?:(?:{_FILLERS}) )*)+")
_IS_WRONG = re.compile(rf"(?:(?:{_FILLERS}) )*(?:(?:{_NO_VALUE}|{_WRONG}) (?:(?:{_FILLERS}) )*)+")
_LONGEST_REASON = 200  # letters of what the parser says: it may quote half a file
_BYTES, _BITS = 64, 64  # of a CAN FD frame, of a signal


@dataclass(frozen=True, kw_only=True)
class DbcSignal:
    """A signal: its bits, its unit, and the names of its raw values."""

    name: str
    layout: SignalLayout
    unit: str  # "-" if it has none
    names: Mapping[int, str] = field(default_factory=dict)  # of raw values, by its value table
    missing_raws: tuple[int, ...] = ()  # raw values that are no measurement; the first one is sent for what is missing
    branches: tuple[int, ...] = ()  # values of the multiplexer that select it; none: always there
    multiplexer: bool = False  # whether it selects others

    @property
    def choices(self) -> dict[str, int]:
        """Raw value by its name; of several of one name the first."""
        out: dict[str, int] = {}
        for raw, name in self.names.items():
            out.setdefault(name, raw)
        return out

    @property
    def missing_raw(self) -> int | None:
        """Raw value that says that the value is missing; None where the signal cannot say it."""
        return next(iter(self.missing_raws), None)

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
    odd: Mapping[str, str] = field(default_factory=dict)  # messages that cannot be mapped, and why

    @classmethod
    def read(cls, path: Path) -> DbcFile:
        """Read a file; DataError where it is not a DBC.

        A message that cannot be mapped (signals that overlap, a multiplexer below another one, a factor of 0) is named
        in the log, and by `message`; the others are there.
        """
        cantools = import_extra("cantools", "can", "a DBC file")
        file = existing_file(path)
        content = bytes_of(file)
        text = decoded(content, str(file))
        try:
            logging.getLogger("cantools").setLevel(logging.ERROR)  # of one identifier twice we speak ourselves
            database = cantools.database.load_string(text, database_format="dbc", strict=False)
        except Exception as error:  # the parser raises what it stumbles over
            reason = " ".join(str(error).split())
            reason = reason if len(reason) <= _LONGEST_REASON else f"{reason[:_LONGEST_REASON]}…"
            raise DataError(
                f"{file}: cannot be read as a DBC: {reason}; correct it there, or map a copy of the file that has only "
                "the messages you need"
            ) from error
        odd = _taken_twice(database.messages)
        messages: dict[str, DbcMessage] = {}
        for message in database.messages:
            if message.name in odd:
                continue
            try:
                message.refresh(strict=True)
                messages[message.name] = _message(message)
            except (cantools.Error, Error, ValueError, OverflowError) as error:
                odd[message.name] = str(error)
        for name, why in odd.items():
            _LOG.warning("%s: message %s cannot be mapped: %s", file.name, name, why)
        return cls(file=file, sha256=hashlib.sha256(content).hexdigest(), messages=messages, odd=odd)

    def message(self, name: str) -> DbcMessage:
        """Return a message; DataError guesses which one was meant, or says what is wrong with it."""
        if name in self.odd:
            raise DataError(f"{self.file}: message {name}: {self.odd[name].removesuffix('.')}; correct the file")
        if name in self.messages:
            message = self.messages[name]
            if message.size > _BYTES:
                raise DataError(
                    f"{self.file.name}: message {name} has {message.size} bytes: a frame has at most {_BYTES}, and "
                    "what comes in several is not put together here; map another one"
                )
            return message
        raise DataError(f"{self.file.name} has no message {name!r}: {near(name, self.messages)}")


def _taken_twice(messages: Sequence[Any]) -> dict[str, str]:
    """Find messages of one name or identifier: which of them is meant is unknown."""
    taken: dict[Any, str] = {}
    odd: dict[str, str] = {}
    for message in messages:
        for key in (message.name, (message.frame_id, message.is_extended_frame)):
            if key in taken:
                for one, other in ((message.name, taken[key]), (taken[key], message.name)):
                    odd[one] = f"it has the name or identifier {message.frame_id:#x} of {other}: remove one"
            taken.setdefault(key, message.name)
    return odd


def near(name: str, names: Mapping[str, Any]) -> str:
    """Ask for the nearest name, or list them."""
    return did_you_mean(name, names) or f"it has {', '.join(names) or 'none'}"


def _message(message: Any) -> DbcMessage:
    whole = [] if message.length > _BYTES else message.signals
    signals = {signal.name: _signal(signal) for signal in whole if signal.length <= _BITS}
    selecting = [signal.name for signal in signals.values() if signal.multiplexer]
    if len(selecting) > 1:
        raise DataError(f"it has the multiplexers {', '.join(selecting)}: at most one per message is supported")
    cycle_ms = message.cycle_time
    if not isinstance(cycle_ms, int | float | None):
        raise DataError(f"its GenMsgCycleTime is {cycle_ms!r}: give a number of milliseconds")
    return DbcMessage(
        name=message.name,
        frame_id=message.frame_id,
        extended=message.is_extended_frame,
        size=message.length,
        cycle_s=cycle_ms * 1e-3 if cycle_ms else None,
        signals=signals,
    )


def _signal(signal: Any) -> DbcSignal:
    kind = "signed" if signal.is_signed else "unsigned"
    unit, scale, offset = signal.unit or "-", float(signal.scale), float(signal.offset)
    wrap = 1 << signal.length if signal.is_signed else 0  # some tools write the raw values of a signed signal unsigned
    names = {
        int(raw) - (wrap if wrap and raw >= wrap // 2 else 0): str(name) for raw, name in (signal.choices or {}).items()
    }
    return DbcSignal(
        name=signal.name,
        layout=SignalLayout(
            start=signal.start,
            length=signal.length,
            byte_order=signal.byte_order,
            raw_type=f"float{signal.length}" if signal.is_float else kind,
            scale=scale,
            offset=offset,
            minimum=None if signal.minimum is None else float(signal.minimum),
            maximum=None if signal.maximum is None else float(signal.maximum),
        ),
        unit=unit,
        names=names,
        missing_raws=_missing_of(names, quantity=unit != "-" or (scale, offset) != (1.0, 0.0) or signal.is_float),
        branches=tuple(signal.multiplexer_ids or ()),
        multiplexer=signal.is_multiplexer,
    )


def _missing_of(names: Mapping[int, str], *, quantity: bool) -> tuple[int, ...]:
    """Raw values that are no measurement by their names: "not available" first, then errors of a quantity."""
    words = {raw: "".join(f"{word.lower()} " for word in _WORDS.findall(name)) for raw, name in names.items()}
    missing = [raw for raw, text in words.items() if _IS_NO_VALUE.fullmatch(text)]
    wrong = [raw for raw, text in words.items() if quantity and _IS_WRONG.fullmatch(text)]
    return tuple(dict.fromkeys((*missing, *wrong)))
