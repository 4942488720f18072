"""A mapping file: which signal of which message is which value of a plant, or of a loop."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from mgdd._core.optimize import Limit
from mgdd._core.rig import SignalLayout
from mgdd.errors import ParameterError, did_you_mean
from mgdd.optimize.optimum import limit_names_of
from mgdd.results.describe import described
from mgdd.rig.can.dbc import DbcFile
from mgdd.rig.can.map_reader import MapReader
from mgdd.rig.can.mapped import MappedMessage, MappedSignal, StateSignal
from mgdd.rig.can.toml_table import TomlTable
from mgdd.rig.loop_message import LoopMessage

_BUSES = Path(__file__).parent / "buses"
SHIPPED = ("etb", "engine", "surrogate")
_FORMAT = 1
_KEYS = ("kind", "format", "dbc", "trigger", "limits", "objective", "state", "commands", "measurements")


@dataclass(frozen=True, kw_only=True)
class SignalMap:
    """Inputs and measured values by name, and the signals of a DBC that carry them.

    `load` reads and checks the mapping file against its DBC; the page *Experiments over CAN* lists the keys.

    Parameters
    ----------
    file : pathlib.Path
        The mapping file.
    dbc : DbcFile
        Messages.
    commands, measurements : mapping of str to MappedMessage
        What the host sends and what it receives, by the name of the message.
    trigger : str
        The message that ends a cycle: a measurement is complete when it comes.
    cycle_s : float
        Time between two measurements [s], of the trigger message.
    state : StateSignal or None
        Where the node says in which state it is.
    limits : tuple of str
        Measured values to report as limits.
    objective : mapping of str to float
        Weight of each measured value that is a component of J.

    Examples
    --------
    >>> from mgdd.rig import SignalMap
    >>> etb = SignalMap.load("etb")
    >>> etb.input_names, etb.trigger, etb.commands["ETB_Cmd"].timeout_s
    (('duty',), 'ETB_Status', 0.02)
    """

    file: Path
    dbc: DbcFile
    commands: Mapping[str, MappedMessage]
    measurements: Mapping[str, MappedMessage]
    trigger: str
    cycle_s: float
    state: StateSignal | None = None
    limits: tuple[str, ...] = ()
    objective: Mapping[str, float]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a mapping file, or a shipped one (``etb``, ``engine``, ``surrogate``), and check it against its DBC.

        FileNotFoundError; ImportError without the extra ``can``; `mgdd.errors.DataError` where it is not TOML or DBC,
        for a missing key or message and overlapping signals; `mgdd.errors.ParameterError` for an unknown key or signal,
        a quantity or signal mapped twice, another unit, too small a range, an unprotected place of counter or CRC, a
        signal of a command that is not set.
        """
        named = str(path)
        file = _BUSES / f"{named}.toml" if named in SHIPPED else Path(path)
        try:
            table = TomlTable.read(file)
        except FileNotFoundError as error:
            if file.suffix:
                raise
            hint = f"no such file: shipped maps are {', '.join(SHIPPED)}; the path of a file ends in .toml"
            raise FileNotFoundError(errno.ENOENT, hint, named) from error
        table.only(_KEYS)
        kind, version = table.take("kind", "text"), table.take("format", "integer")
        if kind != "signal_map":
            raise table.error("kind", kind, "'signal_map'")
        if version != _FORMAT:
            raise table.error("format", version, f"{_FORMAT}: this version of mgdd reads no other")
        dbc = DbcFile.read(file.parent / table.take("dbc", "text"))
        reader = MapReader(dbc=dbc)
        commands = {name: reader.command(name, inner) for name, inner in table.table("commands").tables()}
        measurements = {name: reader.measurement(name, inner) for name, inner in table.table("measurements").tables()}
        reader.require_whole(table, commands, measurements)
        trigger = table.take("trigger", "text")
        if trigger not in measurements:
            raise table.error("trigger", trigger, f"one of the measurements {', '.join(measurements)}")
        cycle_s = measurements[trigger].message.cycle_s
        if cycle_s is None:
            raise table.error("trigger", trigger, "a message with a cycle time (GenMsgCycleTime) in the DBC")
        state = reader.state(table.table("state"), measurements)
        limits = tuple(table.take("limits", "texts", []))
        objective = {row.take("value", "text"): row.take("weight", "number") for row in table.rows("objective")}
        made = cls(
            file=file, dbc=dbc, commands=commands, measurements=measurements, trigger=trigger, cycle_s=cycle_s,
            state=state, objective={},
        )  # fmt: skip
        try:
            return made.with_goals(limits=limits, objective=objective)
        except ParameterError as error:
            raise error.reworded(f"{file}: {error}") from error

    def with_goals(
        self,
        *,
        limits: Mapping[str, float] | Sequence[Limit | str] | None = None,
        objective: Mapping[str, float] | None = None,
    ) -> Self:
        """Give the same map with other limits and weights of the components of J; as they are where left out.

        ParameterError for a name that is not measured, or a weight that is not finite.
        """
        chosen_limits = self.limits if limits is None else tuple(limit_names_of(limits))
        weights = dict(self.objective if objective is None else objective)
        value_names = self.value_names
        for what, names in (("limits", chosen_limits), ("objective", tuple(weights))):
            for name in names:
                if name not in value_names:
                    guess = did_you_mean(name, value_names)
                    raise ParameterError.of(what, name, f"a measured value{'; ' + guess if guess else ''}")
        for name, weight in weights.items():
            ParameterError.unless(math.isfinite(weight), f"objective of {name}", weight, "finite")
        return replace(self, limits=chosen_limits, objective=weights)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of the file."""
        return tuple(self.inputs)

    @property
    def inputs(self) -> dict[str, MappedSignal]:
        """The inputs by name."""
        return {name: entry for message in self.commands.values() for name, entry in message.signals.items()}

    @property
    def value_names(self) -> tuple[str, ...]:
        """Names of the measured values, in the order of the file."""
        return tuple(name for message in self.measurements.values() for name in message.signals)


def _rows(signal_map: SignalMap) -> Mapping[str, Any]:
    return {
        "file": str(signal_map.file),
        "dbc": signal_map.dbc.file.name,
        "inputs": signal_map.input_names,
        "values": signal_map.value_names,
        "trigger": signal_map.trigger,
        "limits": signal_map.limits,
    }


described(SignalMap, rows=_rows)


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
