"""Which loop steps the controller of an experiment: the real-time loop of the core, or one in Python, and why."""

from __future__ import annotations

from typing import NamedTuple

from mgdd.errors import ParameterError
from mgdd.rig.can.loop_map import loop_messages
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.settings import TrackTask

__all__ = ["LoopChoice", "chosen_loop"]

_BUS_MODES = ("hil", "dry_run", "bench")


class LoopChoice(NamedTuple):
    """A loop and why it is that one."""

    name: str
    reason: str  # also how the loop of the core reaches its bus: by raw socket or bridge
    channel: str | None = None  # of SocketCAN, where that loop has a raw socket of its own


def chosen_loop(experiment: Experiment, signal_map: SignalMap | None) -> LoopChoice | None:
    """Choose the loop of a task; None without a controller, ParameterError where ``loop = "core"`` cannot serve."""
    settings = experiment.settings
    if not isinstance(settings, TrackTask):
        return None
    if experiment.mode == "replay":
        return LoopChoice("python", "mode = 'replay': what was recorded is computed again")
    if settings.loop == "python":
        return LoopChoice("python", "track.loop = 'python'")
    against = _against_core(experiment, signal_map)
    if not against:
        channel = _own_socket(experiment.bus.connection)
        by = "bridge" if channel is None else "raw socket"
        return LoopChoice("core", f"a bus at real-time pace, by {by}", channel)
    if settings.loop == "core":
        raise ParameterError(
            f"{experiment.origin}: track.loop = 'core': must be 'auto' or 'python' here: {against}",
            field="track.loop", value="core", bound="'auto' or 'python'",
        )  # fmt: skip
    return LoopChoice("python", against)


def _against_core(experiment: Experiment, signal_map: SignalMap | None) -> str:
    """Say what stands against the loop of the core; empty where nothing does."""
    if experiment.mode not in _BUS_MODES or signal_map is None:
        return f"mode = {experiment.mode!r}: no bus"
    if experiment.bus.pace == "step":
        return "bus.pace = 'step': every command brings one sample, without a clock"
    try:
        loop_messages(signal_map)
    except ParameterError as error:
        return str(error)
    return ""


def _own_socket(connection: str | None) -> str | None:
    """Give the channel of a connection by SocketCAN without options: they would be those of python-can."""
    if connection is None:
        return None
    bus = CanTransport.parse(connection)
    return str(bus.channel) if bus.interface == "socketcan" and not bus.options else None
