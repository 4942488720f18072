"""How near an experiment is to real hardware, and what it takes to come nearer."""

from __future__ import annotations

import os
import sys

from mgdd.errors import ParameterError, RigError, argument
from mgdd.io.files import read_plain_text
from mgdd.loop import Plant
from mgdd.rig.can.frame import Bus
from mgdd.rig.can.node import LocalBus
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport

# `simulate`: a node in this process and a virtual clock; `hil`: a node in another process, real time; `dry_run`: a real
# bus, to which nothing is sent; `replay`: recorded frames through the same checks; `bench`: real hardware, armed.
MODES = ("simulate", "hil", "dry_run", "replay", "bench")
BUS_MODES = ("hil", "dry_run", "bench")


def key_line(signal_map: SignalMap) -> str:
    """Return the line that a key file must hold: it names this DBC."""
    return f"arm {signal_map.dbc.file.name} {signal_map.dbc.sha256[:12]}"


def may_be_real(mode: str, bus: Bus) -> bool:
    """Whether what answers may be an actuator: on a bench, and in ``hil`` on a bus that leaves this machine."""
    return mode == "bench" or (mode == "hil" and bus.shared and not getattr(bus, "stays_here", False))


def require_key(
    signal_map: SignalMap, bus: str, mode: str, *, arm: bool, key_file: str | os.PathLike[str] | None
) -> None:
    """Refuse with a RigError to drive what may be real without a person who wants it."""
    if arm is not True:
        how = f"{argument('arm', 'True')}, and a {argument('key_file')} or a confirmation"
        why = "drives real hardware" if mode == "bench" else f"on {bus}, which leaves this machine, may, too"
        raise RigError(f"mode = {mode!r} {why}: give {how}")
    line = key_line(signal_map)
    if key_file is not None:
        try:
            said = read_plain_text(key_file).splitlines()
        except FileNotFoundError as error:
            raise RigError(
                f"{key_file}: no such key file: write the line {line!r} into it when the bench is safe"
            ) from error
        if line not in said:
            raise RigError(f"{key_file}: holds no key of this DBC: it must have the line {line!r}")
        return
    if not sys.stdin.isatty():
        raise RigError(f"mode = {mode!r} without a terminal to confirm in: give a {argument('key_file')}")
    sys.stderr.write(f"{bus} will be driven with {signal_map.file.name}. Emergency stop at hand? Type ARM: ")
    sys.stderr.flush()
    if sys.stdin.readline().strip() != "ARM":
        raise RigError("not confirmed: nothing was sent")


def bus_of(mode: str, signal_map: SignalMap, bus: Bus | str | None, plant: Plant | None) -> Bus:
    """Return the bus of a mode; ParameterError for an unknown one, or a bus or plant that does not go with it."""
    if mode not in MODES:
        raise ParameterError.of("mode", mode, f"one of {', '.join(MODES)}")
    if mode == "simulate":
        if bus is not None:
            raise ParameterError.of(
                "mode",
                mode,
                "said for a bus: 'hil', 'dry_run', 'replay' or 'bench'; 'simulate' takes a plant instead",
            )
        if plant is None:
            raise ParameterError("plant = None: must be given for mode='simulate', or give a bus and another mode")
        return LocalBus(plant, signal_map)
    if plant is not None or bus is None:
        raise ParameterError(f"mode = {mode!r}: must have a bus, and no plant: that is in the node")
    return CanTransport.parse(bus) if isinstance(bus, str) else bus
