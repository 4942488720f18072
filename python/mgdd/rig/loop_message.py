"""The messages that a real-time loop sends and receives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from mgdd._core.rig import E2eSettings, SignalLayout

__all__ = ["LoopMessage"]


@dataclass(frozen=True, kw_only=True)
class LoopMessage:
    """A message of a loop: which signals it carries, and how it is protected.

    Parameters
    ----------
    can_id : int
        Identifier.
    signals : mapping of str to SignalLayout
        Of a received message some of ``angle_deg``, ``first_v``, ``second_v`` (these three a loop needs), ``supply_v``,
        ``current_a``, ``speed_deg_per_s`` and ``applied_duty``. Of the command ``duty``, and where wanted ``enable`` (1
        while the actuator is driven, 0 with an open bridge) and ``reference_deg``.
    fixed : sequence of (SignalLayout, float)
        Of the command: numbers that never change, a mode for example.
    extended : bool
        29-bit identifier.
    size : int
        Bytes of the payload, 1 to 64; more than 8 are CAN FD.
    protection : E2eSettings, optional
        Alive counter and CRC.

    Examples
    --------
    >>> from mgdd.rig import E2eSettings, LoopMessage, SignalLayout
    >>> duty = SignalLayout(start=16, length=16, raw_type="signed", scale=5e-5)
    >>> enable = SignalLayout(start=32, length=1)
    >>> command = LoopMessage(
    ...     can_id=0x120, signals={"duty": duty, "enable": enable}, protection=E2eSettings(data_id=0x120)
    ... )
    >>> command.size
    8
    """

    can_id: int
    signals: Mapping[str, SignalLayout]
    fixed: Sequence[tuple[SignalLayout, float]] = field(default=())
    extended: bool = False
    size: int = 8
    protection: E2eSettings | None = None

    def to_core(self) -> tuple[Any, ...]:
        """Give what the core takes."""
        signals = [(name, layout, 0.0) for name, layout in self.signals.items()]
        signals += [("fixed", layout, float(number)) for layout, number in self.fixed]
        return (self.can_id, self.extended, self.size, self.protection, signals)
