"""Named quantities in the signals of messages: what a mapping file becomes, for the host and for the node."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from mgdd import _core
from mgdd._core.rig import E2eSettings
from mgdd.errors import ParameterError
from mgdd.rig.can.dbc import DbcMessage, DbcSignal

GATE_MODES: tuple[str, ...] = tuple(_core.rig.safety_states)

Raw = int | float  # an integer; of a float signal the float


@dataclass(frozen=True, kw_only=True)
class MappedSignal:
    """A named quantity and the signal that carries it: quantity = scale * signal + offset."""

    name: str
    signal: DbcSignal
    scale: float = 1.0  # from the unit of the signal to that of the name
    offset: float = 0.0
    lower: float = -math.inf  # of an input, in its unit
    upper: float = math.inf

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that the signal can carry, in the unit of the name."""
        low, high = sorted(self.scale * bound + self.offset for bound in self.signal.bounds)
        return low, high

    def pack(self, payload: bytes, value: float) -> bytes:
        """Write a value, clamped to its range; NaN as the raw value that says so, or a ParameterError."""
        if math.isnan(value) and self.signal.missing_raw is not None:
            return self.signal.layout.pack_raw(payload, self.signal.missing_raw)
        physical = value if self.scale == 1.0 and self.offset == 0.0 else (value - self.offset) / self.scale
        if math.isinf(physical):
            physical = math.copysign(1e300, physical)
        return self.signal.layout.pack(payload, physical)

    def unpack(self, payload: bytes) -> float:
        """Read the value; NaN where the raw value says that there is none, or an error."""
        layout = self.signal.layout
        if self.signal.missing_raws and layout.unpack_raw(payload) in self.signal.missing_raws:
            return math.nan
        physical = layout.unpack(payload)
        return physical if self.scale == 1.0 and self.offset == 0.0 else self.scale * physical + self.offset


@dataclass(frozen=True, kw_only=True)
class MappedMessage:
    """A message that the host sends or receives, with the quantities in it."""

    message: DbcMessage
    timeout_s: float | None  # without one for so long the sender is gone; None: sent on events
    e2e: E2eSettings | None
    signals: Mapping[str, MappedSignal]  # inputs of a command, measured values otherwise
    applied: Mapping[str, MappedSignal] = field(default_factory=dict)  # inputs that the node says it applied
    driven: Mapping[str, Raw] = field(default_factory=dict)  # of a command, further signals while it drives
    safe: Mapping[str, Raw] = field(default_factory=dict)  # of a safe frame, all signals; none: not sent at the end

    @property
    def name(self) -> str:
        """Name of the message."""
        return self.message.name

    @property
    def key(self) -> tuple[int, bool]:
        """Identifier, and whether it has 29 bits."""
        return self.message.frame_id, self.message.extended

    def payloads(
        self, values: Mapping[str, float], raws: Mapping[str, Raw], applied: Mapping[str, float] = MappingProxyType({})
    ) -> list[bytes]:
        """Pack named values and raw numbers: one payload, or one per branch of the multiplexer that is used."""
        return [self._packed(branch, values, raws, applied) for branch in self._branches()]

    def read(self, payload: bytes) -> dict[str, float]:
        """Read the named values of a payload; of a multiplexed message those of its branch."""
        return self._read(self.signals, payload)

    def read_applied(self, payload: bytes) -> dict[str, float]:
        """Read the inputs that the node says it applied."""
        return self._read(self.applied, payload)

    def drives(self, payload: bytes) -> bool:
        """Whether a command drives: every further signal stands as it does while driven."""
        return self._stands(payload, self.driven)

    def rests(self, payload: bytes) -> bool:
        """Whether a command is a safe one: every signal stands as in a safe frame."""
        return bool(self.safe) and self._stands(payload, self.safe)

    def _stands(self, payload: bytes, raws: Mapping[str, Raw]) -> bool:
        branch = self._branch_of(payload)
        return all(
            signal.layout.unpack_raw(payload) == raw
            for name, raw in raws.items()
            if _is_in(signal := self.message.signals[name], branch)
        )

    def _read(self, entries: Mapping[str, MappedSignal], payload: bytes) -> dict[str, float]:
        branch = self._branch_of(payload)
        return {name: entry.unpack(payload) for name, entry in entries.items() if _is_in(entry.signal, branch)}

    def _branch_of(self, payload: bytes) -> int | None:
        multiplexer = self.message.multiplexer
        return None if multiplexer is None else int(multiplexer.layout.unpack_raw(payload))

    def _branches(self) -> Sequence[int | None]:
        if self.message.multiplexer is None:
            return [None]
        used = [e.signal for e in (*self.signals.values(), *self.applied.values())]
        used += [self.message.signals[name] for name in (*self.driven, *self.safe)]
        return sorted({branch for signal in used for branch in signal.branches[:1]})

    def _packed(
        self, branch: int | None, values: Mapping[str, float], raws: Mapping[str, Raw], applied: Mapping[str, float]
    ) -> bytes:
        payload = bytes(self.message.size)
        if branch is not None and self.message.multiplexer is not None:
            payload = self.message.multiplexer.layout.pack_raw(payload, branch)
        for name, raw in raws.items():
            signal = self.message.signals[name]
            if _is_in(signal, branch):
                payload = signal.layout.pack_raw(payload, raw)
        for entries, given in ((self.signals, values), (self.applied, applied)):
            for name, entry in entries.items():
                if name in given and _is_in(entry.signal, branch):
                    payload = entry.pack(payload, given[name])
        return payload


@dataclass(frozen=True, kw_only=True)
class StateSignal:
    """Where the node says in which state it is."""

    message: str
    signal: DbcSignal
    failed: tuple[str, ...]  # in these the node does not follow its commands until it is armed again
    names: Mapping[str, str] = field(default_factory=dict)  # by mode of a safety gate, where it has one

    @property
    def unarmed(self) -> str | None:
        """State of a node that was never armed; None where it looks like an armed one."""
        name = self.names.get("init")
        return None if name == self.names.get("armed") else name

    def codes(self) -> dict[str, int]:
        """Give the raw value by mode of a safety gate; ParameterError where a mode has no state."""
        if missing := [mode for mode in GATE_MODES if mode not in self.names]:
            choices = ", ".join(self.signal.choices) or "none"
            raise ParameterError.of(
                f"states of {self.message}.{self.signal.name}", choices,
                f"named for the modes {', '.join(missing)} of a virtual node: add names = "
                f'{{ {missing[0]} = "STATE", ... }} to [state] of the map',
            )  # fmt: skip
        return {mode: self.signal.choices[self.names[mode]] for mode in GATE_MODES}

    def name_of(self, payload: bytes) -> str:
        """Return the name of the state, or its raw number."""
        raw = self.signal.layout.unpack_raw(payload)
        return self.signal.names.get(int(raw), str(raw))


def _is_in(signal: DbcSignal, branch: int | None) -> bool:
    return not signal.branches or branch in signal.branches
