"""The checks of a mapping file against its DBC, before anything is sent."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mgdd._core.rig import E2eSettings
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.results.labels import VARIABLES, named_label
from mgdd.results.units import attribute_units
from mgdd.rig.can.dbc import DbcFile, DbcMessage, DbcSignal, near
from mgdd.rig.can.mapped import GATE_MODES, MappedMessage, MappedSignal, Raw, StateSignal
from mgdd.rig.can.toml_table import TomlTable

_COMMAND = ("timeout_ms", "e2e", "driven", "safe", "inputs")
_MEASUREMENT = ("timeout_ms", "e2e", "values", "applied")
_ENTRY = ("signal", "unit", "scale", "offset")
_E2E = (
    "profile", "crc", "counter", "data_id", "data_id_mode", "data_id_list", "max_step", "counter_modulus",
    "bad_until_invalid", "good_until_valid",
)  # fmt: skip
_TIMEOUT_CYCLES = 3


class MapReader:
    """Reads the messages of a mapping file; remembers which names and signals are taken."""

    def __init__(self, *, dbc: DbcFile) -> None:
        self.dbc = dbc
        self._homes: dict[tuple[str, str], str] = {}
        self._users: dict[tuple[str, str], str] = {}

    def command(self, name: str, table: TomlTable) -> MappedMessage:
        """Read a message of the host."""
        table.only(_COMMAND)
        message = self._message(name, table)
        timeout, e2e, protected = self._timeout(message, table), *self._e2e(message, table.table("e2e"))
        inputs = self._entries("input", message, table.table("inputs"), bounded=True)
        for key, entry in inputs.items():
            low, high = entry.bounds
            if not (low <= entry.lower <= entry.upper <= high):
                raise table.error(
                    f"inputs.{key}", [entry.lower, entry.upper],
                    f"lower <= upper within the range of {name}.{entry.signal.name}, [{low:g}, {high:g}]; narrow the "
                    "input or widen the signal",
                )  # fmt: skip
        driven = self._raws(message, table.table("driven"))
        own = {entry.signal.name for entry in inputs.values()} | protected
        if both := own & set(driven):
            raise table.error("driven", sorted(both), "signals that are neither an input nor counter or CRC")
        selecting = {signal.name for signal in message.signals.values() if signal.multiplexer}
        used = {branch for entry in inputs.values() for branch in entry.signal.branches}
        for signal in message.signals.values():
            sent = not signal.branches or used & set(signal.branches)
            if sent and signal.name not in own | set(driven) | selecting:
                raise table.error(
                    "driven",
                    sorted(driven),
                    f"given a value of {signal.name} too: it is neither an input nor protected",
                )
        safe_table = table.table("safe")
        safe = self._raws(message, safe_table)
        if safe or message.cycle_s is not None:
            for entry in inputs.values():
                if entry.signal.name not in safe:
                    raise table.error(
                        "safe", sorted(safe), f"given a value of {entry.signal.name}: what is sent when the rig is left"
                    )
            safe = {**driven, **safe}
        return MappedMessage(message=message, timeout_s=timeout, e2e=e2e, signals=inputs, driven=driven, safe=safe)

    def measurement(self, name: str, table: TomlTable) -> MappedMessage:
        """Read a message of the node."""
        table.only(_MEASUREMENT)
        message = self._message(name, table)
        timeout, e2e, _ = self._timeout(message, table), *self._e2e(message, table.table("e2e"))
        values = self._entries("value", message, table.table("values"))
        applied = self._entries("applied", message, table.table("applied"))
        return MappedMessage(message=message, timeout_s=timeout, e2e=e2e, signals=values, applied=applied)

    def require_whole(
        self, table: TomlTable, commands: Mapping[str, MappedMessage], measurements: Mapping[str, MappedMessage]
    ) -> None:
        """Refuse a map without inputs, safe frame or measurements, and messages that both sides send."""
        inputs = [name for message in commands.values() for name in message.signals]
        if not inputs:
            raise DataError(f"{table.origin}: [commands] has no input: give at least one")
        if not any(message.safe for message in commands.values()):
            raise DataError(f"{table.origin}: no command has safe values: give what is sent when the rig is left")
        if not any(message.signals for message in measurements.values()):
            raise DataError(f"{table.origin}: [measurements] has no value: give at least one")
        for name in commands:
            if name in measurements:
                raise table.error("measurements", name, "a message that the host does not send")
        applied = [name for message in measurements.values() for name in message.applied]
        for name in applied:
            if name not in inputs:
                guess = did_you_mean(name, inputs)
                raise table.error("applied", name, f"one of the inputs {', '.join(inputs)}; {guess}".removesuffix("; "))

    def state(self, table: TomlTable, measurements: Mapping[str, MappedMessage]) -> StateSignal | None:
        """Read where the node says its state."""
        table.only(("message", "signal", "failed", "names"))
        name = table.take("message", "text", None)
        if name is None:
            return None
        if name not in measurements:
            raise table.error("message", name, f"one of the measurements {', '.join(measurements)}")
        signal = self._signal(measurements[name].message, table.take("signal", "text"), table, "signal")
        named = table.table("names")
        named.only(GATE_MODES)
        names = {mode: named.take(mode, "text", mode) for mode in GATE_MODES}
        for mode, state in names.items():
            if state != mode and state not in signal.choices:
                raise named.error(mode, state, f"a name of the value table: {', '.join(signal.choices) or 'none'}")
        states = {mode: state for mode, state in names.items() if state in signal.choices}
        failed = tuple(table.take("failed", "texts", [states[mode] for mode in ("limp", "fault") if mode in states]))
        for state in failed:
            if state not in signal.choices:
                raise table.error("failed", state, f"a name of the value table: {', '.join(signal.choices) or 'none'}")
        return StateSignal(message=name, signal=signal, failed=failed, names=states)

    def _message(self, name: str, table: TomlTable) -> DbcMessage:
        try:
            return self.dbc.message(name)
        except DataError as error:
            raise DataError(f"{table.origin}: [{table.path}]: {error}") from error

    def _signal(self, message: DbcMessage, name: str, table: TomlTable, key: str) -> DbcSignal:
        if name not in message.signals:
            hint = near(name, message.signals)
            raise table.error(key, name, f"a signal of {message.name} in {self.dbc.file.name}: {hint}")
        return message.signals[name]

    def _timeout(self, message: DbcMessage, table: TomlTable) -> float | None:
        default = None if message.cycle_s is None else _TIMEOUT_CYCLES * message.cycle_s * 1e3
        timeout = table.take("timeout_ms", "number", default)
        if timeout is None:
            return None
        if not 0.0 < timeout < math.inf:
            raise table.error("timeout_ms", timeout, "> 0 ms")
        if message.cycle_s is not None and timeout * 1e-3 <= message.cycle_s:
            raise table.error("timeout_ms", timeout, f"above the cycle time of {message.cycle_s * 1e3:g} ms")
        return float(timeout * 1e-3)

    def _entries(
        self, what: str, message: DbcMessage, table: TomlTable, *, bounded: bool = False
    ) -> dict[str, MappedSignal]:
        return {name: self._entry(what, message, name, inner, bounded) for name, inner in table.tables()}

    def _entry(self, what: str, message: DbcMessage, name: str, table: TomlTable, bounded: bool) -> MappedSignal:
        table.only((*_ENTRY, "lower", "upper") if bounded else _ENTRY)
        signal = self._signal(message, table.take("signal", "text"), table, "signal")
        if (what, name) in self._homes:
            raise ParameterError(
                f"{table.origin}: {table.path}: {what} {name!r} is mapped twice: {self._homes[what, name]} has it too; "
                "remove one",
                field=table.path, value=name, bound="mapped once",
            )  # fmt: skip
        if (message.name, signal.name) in self._users:
            raise table.error(
                "signal", signal.name, f"mapped once: {self._users[message.name, signal.name]} has it too; remove one"
            )
        if signal.multiplexer:
            raise table.error("signal", signal.name, "a signal that does not select others")
        self._homes[what, name] = message.name
        self._users[message.name, signal.name] = table.path
        scale, offset = table.take("scale", "number", 1.0), table.take("offset", "number", 0.0)
        if scale == 0.0 or not math.isfinite(scale):
            raise table.error("scale", scale, "finite and not 0")
        unit = table.take("unit", "text")
        if _plain_unit(unit) != _plain_unit(signal.unit):
            raise table.error("unit", unit, f"{signal.unit!r}, the unit of {signal.name} in {self.dbc.file.name}")
        own = named_label(name).units
        known = name in VARIABLES or own != "-"
        if (scale == 1.0 and offset == 0.0) and known and _plain_unit(own) != _plain_unit(unit):
            raise table.error(
                "unit", unit, f"{own!r} as the name {name} says, or converted: give scale (and offset) to that unit"
            )
        lower = table.take("lower", "number") if bounded else -math.inf
        upper = table.take("upper", "number") if bounded else math.inf
        return MappedSignal(name=name, signal=signal, scale=scale, offset=offset, lower=lower, upper=upper)

    def _raws(self, message: DbcMessage, table: TomlTable) -> dict[str, Raw]:
        out: dict[str, Raw] = {}
        for name, given in table.items().items():
            signal = self._signal(message, name, table, name)
            out[name] = _raw_of(signal, given, table, name, message.size)
        return out

    def _e2e(self, message: DbcMessage, table: TomlTable) -> tuple[E2eSettings | None, set[str]]:
        table.only(_E2E)
        crc_name = table.take("crc", "text", None)
        if crc_name is None:
            if left := table.items():
                raise DataError(
                    f"{table.origin}: {table.key('crc')} is missing beside {', '.join(left)}: name the signal"
                )
            return None, set()
        crc = self._signal(message, crc_name, table, "crc")
        counter = self._signal(message, table.take("counter", "text"), table, "counter")
        if crc.layout.length != 8 or _low_bit(crc) != 0:
            raise table.error("crc", crc.name, "a signal of 8 bits that fill one byte")
        low, bits = _low_bit(counter), counter.layout.length
        place = {(0, 4): "low_nibble", (4, 4): "high_nibble", (0, 8): "byte"}.get((low, bits))
        if place is None:
            raise table.error(
                "counter", counter.name, "a signal of 4 bits that fill half a byte, or of 8 that fill one"
            )
        profile = table.anything("profile", "sae_j1850")
        given: dict[str, Any] = {
            "counter_modulus": 1 << bits,
            "crc": tuple(profile) if isinstance(profile, list) else profile,
        }
        given |= table.items()
        try:
            settings = E2eSettings(
                size=message.size,
                crc_byte=crc.layout.start // 8,
                counter_byte=counter.layout.start // 8,
                counter_place=place,
                **given,
            )
        except (ParameterError, TypeError) as error:
            if isinstance(error, ParameterError) and error.field == "crc":  # here that is the name of the signal
                raise table.error("profile", profile, "sae_j1850, h2f or [polynomial, start, final_xor]") from error
            raise ParameterError(f"{table.origin}: [{table.path}]: {error}") from error
        return settings, {crc.name, counter.name}


def _low_bit(signal: DbcSignal) -> int:
    """Place of the lowest bit in its byte, of a signal within one byte."""
    first = signal.layout.start % 8
    return first if signal.layout.byte_order == "little_endian" else first - signal.layout.length + 1


def _raw_of(signal: DbcSignal, given: Any, table: TomlTable, key: str, size: int) -> Raw:
    if isinstance(given, str):
        if given not in signal.choices:
            raise table.error(key, given, f"a name of its value table: {', '.join(signal.choices) or 'it has none'}")
        if len(raws := [raw for raw, name in signal.names.items() if name == given]) > 1:
            raise table.error(key, given, f"one of the raw values {', '.join(map(str, raws))}: all have that name")
        return raws[0]
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise table.error(key, given, "a number, or a name of its value table in quotes")
    low, high = signal.bounds
    if not low <= given <= high:
        raise table.error(key, given, f"within [{low:g}, {high:g}] {signal.unit}")
    raw: Raw = signal.layout.unpack_raw(signal.layout.pack(bytes(size), float(given)))
    return raw


def _plain_unit(unit: str) -> str:
    try:
        return attribute_units(unit)
    except ValueError:
        return unit
