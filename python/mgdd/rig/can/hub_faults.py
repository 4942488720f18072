"""What can go wrong between two clients of a hub: rules with a probability, an identifier and a time."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

from mgdd.errors import ParameterError, did_you_mean

KINDS = ("drop", "duplicate", "delay", "reorder", "corrupt", "error", "freeze")
_KEYS = {"p": float, "id": int, "from_s": float, "until_s": float, "ms": float, "client": int, "class": int}
_NEEDS = {"delay": "ms", "error": "class", "freeze": "client"}


def fault_of(text: str, keys: Mapping[str, type]) -> tuple[str, dict[str, Any]]:
    """Read ``KIND:KEY=VALUE,...``, as ``drop:p=0.01,id=0x121``: kind, for the caller to check, and values by key."""
    kind, _, rest = text.partition(":")
    given: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        key, _, value = part.partition("=")
        if key not in keys:
            guess = did_you_mean(key, keys)
            raise ParameterError.of(
                "fault", text, f"KIND:KEY=VALUE,... with keys {', '.join(keys)}{'; ' + guess if guess else ''}"
            )
        try:
            given[key] = int(value, 0) if keys[key] is int else float(value)
        except ValueError:
            raise ParameterError.of(f"fault {kind}: {key}", value, "a number") from None
    return kind, given


@dataclass(frozen=True, kw_only=True)
class BusFault:
    """A fault of the bus, for each frame with a probability, and for a time after the start of the hub.

    A frame is lost, comes twice, comes late, comes after the next one of whatever sender, comes with one byte changed;
    every client, its sender too, gets an error frame instead of it; nothing goes to or comes from one client.
    """

    kind: str
    p: float = 1.0  # in [0, 1]
    id: int | None = None  # all if left out
    from_s: float = 0.0
    until_s: float = math.inf
    ms: float = 0.0  # of delay: how late
    client: int = 0  # of freeze: its number, from 1 in the order in which they came
    error_class: int = 0  # of error: bits of the error frame, for example 0x40 for bus-off

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        ParameterError.unless(self.kind in KINDS, "fault", self.kind, f"one of {', '.join(KINDS)}")
        ParameterError.unless(0.0 <= self.p <= 1.0, "p", self.p, "in [0, 1]")
        ParameterError.unless(0.0 <= self.ms <= 60_000.0, "ms", self.ms, "in [0, 60000] ms")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``KIND:KEY=VALUE,...``, as ``delay:ms=5,id=0x121`` or ``freeze:client=1,from_s=2,until_s=3``."""
        kind, given = fault_of(text, _KEYS)
        needed = _NEEDS.get(kind)
        if needed is not None and needed not in given:
            raise ParameterError.of("fault", text, f"given {needed}, for example {kind}:{needed}=1")
        if "class" in given:
            given["error_class"] = given.pop("class")
        return cls(kind=kind, **given)


class Delivery(NamedTuple):
    """A frame on its way: all get it but who sent it; how late [s]; as error frame, which all get."""

    sender: Any
    identifier: int
    data: bytes
    extended: bool = False
    late_s: float = 0.0
    error_class: int = 0


class FaultInjector:
    """Applies rules in their order, with noise of its own."""

    def __init__(self, faults: Sequence[BusFault], seed: int = 0) -> None:
        self._faults = tuple(faults)
        self._random = random.Random(seed)
        self._held: list[Delivery] = []
        self.counts = dict.fromkeys(KINDS, 0)

    def frozen(self, client: int, now_s: float) -> bool:
        """Whether a frame does not go to, or come from, a client now."""
        frozen = any(
            fault.kind == "freeze" and fault.client == client and fault.from_s <= now_s < fault.until_s
            for fault in self._faults
        )
        self.counts["freeze"] += frozen
        return frozen

    def deliver(self, frame: Delivery, now_s: float) -> list[Delivery]:
        """Say what leaves now for a frame: nothing where it was lost or is held back until the next one."""
        out = [frame]
        hold = False
        for fault in self._faults:
            if not self._strikes(fault, frame.identifier, now_s) or not out:
                continue
            if fault.kind == "corrupt" and not frame.data:
                continue
            self.counts[fault.kind] += 1
            if fault.kind == "drop":
                out = []
            elif fault.kind == "duplicate":
                out = out * 2
            elif fault.kind == "delay":
                out = [one._replace(late_s=one.late_s + fault.ms * 1e-3) for one in out]
            elif fault.kind == "corrupt":
                out = [one._replace(data=self._changed(one.data)) for one in out]
            elif fault.kind == "error":
                out = [frame._replace(error_class=fault.error_class)]
            elif fault.kind == "reorder":
                hold = True
        if hold and not self._held:
            self._held = out
            return []
        held, self._held = self._held, []
        return out + held

    def _strikes(self, fault: BusFault, identifier: int, now_s: float) -> bool:
        if fault.kind == "freeze" or not fault.from_s <= now_s < fault.until_s:
            return False
        return fault.id in (None, identifier) and self._random.random() < fault.p

    def _changed(self, data: bytes) -> bytes:
        place = self._random.randrange(len(data))
        flipped = data[place] ^ self._random.randrange(1, 256)
        return data[:place] + bytes([flipped]) + data[place + 1 :]
