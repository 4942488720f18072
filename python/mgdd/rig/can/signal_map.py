"""A mapping file: which signal of which message is which input or measured value of a plant."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from mgdd._core.optimize import Limit
from mgdd.errors import ParameterError, did_you_mean
from mgdd.optimize.optimum import limit_names_of
from mgdd.results.describe import described
from mgdd.rig.can.dbc import DbcFile
from mgdd.rig.can.map_reader import MapReader
from mgdd.rig.can.mapped import MappedMessage, MappedSignal, StateSignal
from mgdd.rig.can.toml_table import TomlTable

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
        """Read a mapping file and its DBC, and check one against the other.

        Parameters
        ----------
        path : str or path-like
            A TOML file, or the name of a shipped one: ``etb``, ``engine``, ``surrogate``.

        Raises
        ------
        FileNotFoundError
            No such file.
        ImportError
            The extra ``can`` is not installed.
        mgdd.errors.DataError
            Not TOML or DBC, a missing key or message, overlapping signals.
        mgdd.errors.ParameterError
            An unknown key or signal, a quantity or signal mapped twice, another unit, too small a range, an
            unprotected place of counter or CRC, a signal of a command that is not set.
        """
        named = str(path)
        file = _BUSES / f"{named}.toml" if named in SHIPPED else Path(path)
        try:
            table = TomlTable.read(file)
        except FileNotFoundError as error:
            if file.suffix:
                raise
            known = f"no such file: shipped maps are {', '.join(SHIPPED)}; the path of a file ends in .toml"
            raise FileNotFoundError(errno.ENOENT, known, named) from error
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
        wanted = self.limits if limits is None else tuple(limit_names_of(limits))
        weights = dict(self.objective if objective is None else objective)
        known = self.value_names
        for what, names in (("limits", wanted), ("objective", tuple(weights))):
            for name in names:
                if name not in known:
                    guess = did_you_mean(name, known)
                    raise ParameterError.of(what, name, f"a measured value{'; ' + guess if guess else ''}")
        for name, weight in weights.items():
            if not math.isfinite(weight):
                raise ParameterError.of(f"objective of {name}", weight, "finite")
        return replace(self, limits=wanted, objective=weights)

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
