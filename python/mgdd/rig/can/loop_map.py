"""A signal map of a throttle as the messages of a real-time loop, where the loop can say and read all of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from mgdd._core.rig import SignalLayout
from mgdd.errors import ParameterError
from mgdd.rig.can.mapped import MappedMessage, MappedSignal
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.loop_message import LoopMessage

# What a loop reads, by the name of the map.
LOOP_NAMES: Mapping[str, str] = {
    "sensed_angle_deg": "angle_deg",
    "first_v": "first_v",
    "second_v": "second_v",
    "supply_v": "supply_v",
    "current_a": "current_a",
    "speed_deg_per_s": "speed_deg_per_s",
}
_EXACT = 2**53  # largest integer that a float64 holds with all smaller ones


def loop_messages(signal_map: SignalMap) -> tuple[LoopMessage, list[LoopMessage]]:
    """Give the command and the measurements of a map as a `RealtimeLoop` takes them.

    With an open bridge the loop sends the safe frame of the map, so it arms a node as `mgdd.rig.CanRig` does. Values
    that a loop has no place for are left out; a ParameterError says why it cannot serve a map.
    """
    if len(signal_map.commands) != 1 or signal_map.input_names != ("duty",):
        names = ", ".join(signal_map.commands)
        raise _refused(signal_map, f"commands {names}", "one message with the input duty: a loop sends no other")
    (command,) = signal_map.commands.values()
    return _command(signal_map, command), list(_measurements(signal_map))


def _command(signal_map: SignalMap, message: MappedMessage) -> LoopMessage:
    _require_plain(signal_map, message)
    if not message.safe:
        raise _refused(signal_map, f"safe of {message.name}", "given: a loop sends it while the bridge is open")
    duty = message.signals["duty"]
    at_rest = duty.signal.layout.unpack_raw(duty.pack(bytes(message.message.size), 0.0))
    if message.safe.get(duty.signal.name, at_rest) != at_rest:
        raise _refused(signal_map, f"safe {duty.signal.name} of {message.name}", f"{at_rest}, a duty of 0")
    names = [name for name in dict.fromkeys((*message.driven, *message.safe)) if name != duty.signal.name]
    for name in names:
        for raw in (message.driven.get(name, 0), message.safe.get(name, 0)):
            if abs(raw) > _EXACT:
                raise _refused(signal_map, f"{name} of {message.name}: raw value {raw}", f"at most {_EXACT}")
    return LoopMessage(
        can_id=message.message.frame_id,
        signals={"duty": _layout(duty, lower=duty.lower, upper=duty.upper)},
        switched=[
            (
                _like(message.message.signals[name].layout, scale=1.0, offset=0.0, minimum=None, maximum=None),
                message.driven.get(name, 0),
                message.safe.get(name, 0),
            )
            for name in names
        ],
        extended=message.message.extended,
        size=message.message.size,
        protection=message.e2e,
    )


def _measurements(signal_map: SignalMap) -> Iterator[LoopMessage]:
    for message in signal_map.measurements.values():
        read = {LOOP_NAMES[name]: own for name, own in message.signals.items() if name in LOOP_NAMES}
        if "duty" in message.applied:
            read["applied_duty"] = message.applied["duty"]
        if not read:
            continue
        _require_plain(signal_map, message)
        yield LoopMessage(
            can_id=message.message.frame_id,
            signals={name: _layout(own) for name, own in read.items()},
            missing={name: own.signal.missing_raws for name, own in read.items()},
            extended=message.message.extended,
            size=message.message.size,
            protection=message.e2e,
        )


def _layout(entry: MappedSignal, lower: float = -math.inf, upper: float = math.inf) -> SignalLayout:
    """Give the layout whose physical value is the quantity itself."""
    layout = entry.signal.layout
    bounds = sorted(
        entry.scale * (side * math.inf if bound is None else bound) + entry.offset
        for side, bound in ((-1.0, layout.minimum), (1.0, layout.maximum))
    )
    low, high = max(bounds[0], lower), min(bounds[1], upper)
    return _like(
        layout,
        scale=entry.scale * layout.scale,
        offset=entry.scale * layout.offset + entry.offset,
        minimum=low if math.isfinite(low) else None,
        maximum=high if math.isfinite(high) else None,
    )


def _like(layout: SignalLayout, **fields: Any) -> SignalLayout:
    return SignalLayout(**{**layout.to_dict(), **fields})


def _require_plain(signal_map: SignalMap, message: MappedMessage) -> None:
    if message.message.multiplexer is not None:
        raise _refused(signal_map, f"message {message.name}", "without a multiplexer: a loop knows none")


def _refused(signal_map: SignalMap, what: str, bound: str) -> ParameterError:
    return ParameterError(f"{signal_map.file.name}: {what}: must be {bound}", field=what, bound=bound)
