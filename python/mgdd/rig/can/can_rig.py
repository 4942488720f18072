"""A plant over a CAN bus: inputs by name go out as protected frames, measurements come back through their checks."""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

from mgdd._core.rig import Frame
from mgdd.errors import ParameterError, RigError, argument
from mgdd.io.files import read_plain_text
from mgdd.loop import Measurement, Plant
from mgdd.loop.plant import checked_inputs
from mgdd.rig.can.link import Inbox, Punctual, Sender
from mgdd.rig.can.mapped import MappedMessage
from mgdd.rig.can.node import LocalBus
from mgdd.rig.can.processes import SignalsAsExceptions, undisturbed
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.can.transport import Bus, CanTransport, changed

# `simulate`: a node in this process and a virtual clock; `hil`: a node in another process, real time; `dry_run`: a real
# bus, to which nothing is sent; `replay`: a record in place of a bus; `bench`: real hardware, armed.
MODES = ("simulate", "hil", "dry_run", "replay", "bench")
BUS_MODES = ("hil", "dry_run", "bench")
_SAFE_FRAMES = 5
_SAFE_PAUSE_S = 0.002
_LISTEN_CYCLES = 10
_LISTEN_S = 0.1  # at least
_ARMING_ROUNDS = 3
_PEER_CYCLES = 20
_PEER_S = 1.0  # at least so long for the first valid frame


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
            lines = read_plain_text(key_file).splitlines()
        except FileNotFoundError as error:
            raise RigError(
                f"{key_file}: no such key file: write the line {line!r} into it when the bench is safe"
            ) from error
        if line not in lines:
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
    ParameterError.unless(mode in ("simulate", *BUS_MODES), "mode", mode, f"one of simulate, {', '.join(BUS_MODES)}")
    if mode == "simulate":
        if bus is not None:
            bound = "given for a bus: 'hil', 'dry_run' or 'bench'; 'simulate' takes a plant instead"
            raise ParameterError.of("mode", mode, bound)
        if plant is None:
            raise ParameterError("plant = None: must be given for mode='simulate', or give a bus and another mode")
        return LocalBus(plant, signal_map)
    if plant is not None or bus is None:
        raise ParameterError(f"mode = {mode!r}: must have a bus, and no plant: that is in the node")
    return CanTransport.parse(bus) if isinstance(bus, str) else bus


class CanRig:
    """A plant behind a CAN bus, with the protocol of any other plant.

    Used in a ``with`` block. Entering it checks the bus and arms the node, before anything drives; leaving it, in
    whatever way Python leaves, sends five safe frames and then nothing. What Python cannot do, because it was killed
    or hangs, the time limit of the node does. SIGINT and SIGTERM become exceptions inside the block, where it runs in
    the main thread.

    Parameters
    ----------
    signal_map : SignalMap, str or path-like
        Messages and names, or where `SignalMap.load` finds them.
    bus : CanTransport, str or other bus, optional
        What `CanTransport.parse` reads, or a bus; with ``plant`` it is left out.
    plant : mgdd.loop.Plant, optional
        Of the mode ``simulate``: what the node in this process drives.
    mode : str
        ``simulate``, ``hil``, ``dry_run`` or ``bench``, as the page *Experiments over CAN* says.
    limits, objective : optional
        Instead of those of the map, as in `SignalMap.with_goals`.
    timeout_s : float, optional
        Longest time to wait for a measurement [s]; that of the trigger message in the map if left out.
    on_frame : callable, optional
        Called with every frame, sent or received, in this thread: to record it. What it raises leaves the rig.
    arm : bool
        Must be True for ``bench``, and for ``hil`` on a bus that leaves this machine.
    key_file : path-like, optional
        Confirms them instead of a person at the terminal.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown mode, or a bus that does not go with it: no frame leaves because an argument was forgotten.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> from mgdd.rig import CanRig
    >>> with CanRig("etb", plant=VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=5e-3, seed=1)) as rig:
    ...     for _ in range(60):
    ...         rig.apply({"duty": 0.3333})
    ...         measured = rig.measure()
    >>> measured.applied, 20.0 < measured.values["sensed_angle_deg"] < 90.0
    ({'duty': 0.3335}, True)
    """

    def __init__(
        self,
        signal_map: SignalMap | str | os.PathLike[str],
        bus: Bus | str | None = None,
        *,
        plant: Plant | None = None,
        mode: str = "simulate",
        limits: Sequence[str] | None = None,
        objective: Mapping[str, float] | None = None,
        timeout_s: float | None = None,
        on_frame: Callable[[Frame], None] | None = None,
        arm: bool = False,
        key_file: str | os.PathLike[str] | None = None,
    ) -> None:
        self.mode = mode
        loaded = signal_map if isinstance(signal_map, SignalMap) else SignalMap.load(signal_map)
        self.map = loaded.with_goals(limits=limits, objective=objective)
        self.input_names, self.limit_names = self.map.input_names, self.map.limits
        self.bus = bus_of(self.mode, self.map, bus, plant)
        trigger = self.map.measurements[self.map.trigger]
        self.timeout_s = trigger.timeout_s or 0.0 if timeout_s is None else float(timeout_s)
        ParameterError.unless(0.0 < self.timeout_s < math.inf, "timeout_s", timeout_s, "> 0 s")
        self._arm, self._key_file = arm, key_file
        self._on_frame = on_frame
        self._signals = SignalsAsExceptions()
        self._inputs: tuple[float, ...] | None = None
        self._is_open = self._has_sent = False
        self._punctual = Punctual(self.map, self.bus.name, self.timeout_s)
        self._commands = 0
        self._inbox, self._sender = Inbox(self.map), Sender()

    @property
    def objective(self) -> Mapping[str, float]:
        """Weights of the measured values in J, by name."""
        return self.map.objective

    @property
    def state(self) -> str:
        """State that the node reported last; empty where it reports none."""
        return self._inbox.state

    @property
    def counters(self) -> dict[str, Any]:
        """Commands sent, measurements that were not read, the checks by message, and what the bus counts."""
        return {
            "commands": self._commands,
            "skipped": self._inbox.skipped,
            "checks": self._inbox.counts,
            "bus": dict(getattr(self.bus, "counters", {})),
        }

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Send the inputs, clamped to the bounds of the map; in ``dry_run`` nothing is sent.

        ParameterError, and nothing sent, for a missing, unknown or non-finite input. RigError where the rig is not open
        or the bus has a fault; behind a node with a clock also for a command that comes later than their time limit:
        call `arm`.
        """
        self._require_open()
        values = checked_inputs(inputs, self.input_names)
        mapped = self.map.inputs
        clamped = {
            name: min(max(value, mapped[name].lower), mapped[name].upper)
            for name, value in zip(self.input_names, values, strict=True)
        }
        self._take_all()
        self._inbox.skip()  # older than this command
        self._punctual.require_command()
        self._inputs = tuple(clamped.values())
        for message in self.map.commands.values():
            self._send(message, {name: clamped[name] for name in message.signals})
        self._punctual.commanded()

    def measure(self) -> Measurement:
        """Wait for the next complete measurement after the inputs applied last: NaN for what is missing or too old.

        RigError before `apply`, for no valid measurement in time or only one that waited too long, a node that does not
        follow its commands, and a fault of the bus.
        """
        self._require_open()
        if self._inputs is None:
            raise RigError("measure() before apply(): apply the inputs first")
        if not self._receive_cycle(self.timeout_s):
            raise RigError(f"{self.bus.name}: within {self.timeout_s * 1e3:g} ms {self._inbox.no_answer()}")
        if self._inbox.failed and self._sends:
            raise RigError(
                f"{self.bus.name}: the node is in state {self.state!r} and does not drive; look for the cause, then "
                "call arm() or enter the rig again"
            )
        arrived_ns, measured = self._inbox.read()
        self._punctual.require_measurement(arrived_ns)
        return measured

    def arm(self) -> None:
        """Send safe frames until the node is ready to be driven; RigError where it does not answer or stays failed."""
        self._require_open()
        self._take_all()
        self._inbox.skip()  # what waited says nothing of now
        self._punctual.armed_again()
        wait_s = max(_PEER_S, _PEER_CYCLES * self.map.cycle_s, self.timeout_s)
        until, rounds, before = time.monotonic() + wait_s, 0, self._inbox.answers
        checks = [message.e2e.good_until_valid for message in self.map.commands.values() if message.e2e is not None]
        enough = _ARMING_ROUNDS + max(checks, default=0)  # for a node that does not say its state
        while True:
            if self._sends:
                self._send_safe()
            rounds += 1
            received = self._receive_cycle(self.map.cycle_s if self.bus.shared else 0.0)
            self._inbox.skip()
            refuses = self._sends and (self._inbox.failed or self._inbox.unarmed)
            if received and not refuses and (rounds >= enough or not self._sends):
                self._drain_answers(before + (rounds if self._sends and self.bus.shared else 0))
                return
            if time.monotonic() > until if self.bus.shared else rounds > _PEER_CYCLES:
                if received:
                    raise RigError(f"{self.bus.name}: the node stays in state {self.state!r}: it cannot be armed")
                raise RigError(
                    f"{self.bus.name}: within {wait_s:g} s {self._inbox.no_answer()}; is the node on, is this its DBC?"
                )

    def _drain_answers(self, answers: int) -> None:
        """Wait for answers that are late: one to a safe frame must not pass for that to the first command."""
        until = time.monotonic() + self.timeout_s
        while self._inbox.answers < answers and (left_s := until - time.monotonic()) > 0.0:
            self._receive(left_s)
        self._inbox.skip()

    def open(self) -> None:
        """Connect, look who is there, and arm the node, until `close`; a RigError says what stands against it."""
        if self._is_open:
            raise RigError("the rig is open already")
        if may_be_real(self.mode, self.bus):
            require_key(self.map, self.bus.name, self.mode, arm=self._arm, key_file=self._key_file)
        self._inbox, self._sender = Inbox(self.map), Sender()
        self._inputs, self._has_sent, self._commands = None, False, 0
        self._punctual = Punctual(self.map, self.bus.name, self.timeout_s)
        self.bus.claim({message.key for message in self.map.commands.values()} if self._sends else set())
        self.bus.open()
        self._is_open = True
        self._signals.install()
        try:
            self._listen()
            self.arm()
            self._inbox.skipped = 0  # those of the arming
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Send five safe frames, then stop sending and disconnect; closing twice does nothing."""
        if not self._is_open:
            return
        self._is_open = False
        try:
            with undisturbed():
                self._leave()
        finally:
            self._signals.restore()

    def _leave(self) -> None:
        try:
            for _ in range(_SAFE_FRAMES if self._has_sent else 0):
                with contextlib.suppress(RigError):  # a dead bus must not hide why we leave
                    self._send_safe(final=True)
                if self.bus.shared:
                    time.sleep(_SAFE_PAUSE_S)
        finally:
            self.bus.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def _sends(self) -> bool:
        return self.mode != "dry_run"

    def _require_open(self) -> None:
        if not self._is_open:
            raise RigError("the rig is not open: use it in a with block")

    def _listen(self) -> None:
        """Before the first frame of ours: two senders of one identifier show themselves within some cycles."""
        if not self.bus.shared or not self._sends:
            return
        cycles = [m.message.cycle_s for m in self.map.commands.values() if m.message.cycle_s is not None]
        until = time.monotonic() + max(_LISTEN_S, _LISTEN_CYCLES * max([*cycles, self.map.cycle_s]))
        while (left := until - time.monotonic()) > 0.0:
            self._receive(left)
        self._punctual.is_timed = self._inbox.answers > 0  # it has received no request yet
        if jumping := self._inbox.jumping():
            raise RigError(f"{self.bus.name}: {jumping}: two nodes send it, or most frames are lost")

    def _send(self, message: MappedMessage, values: Mapping[str, float]) -> None:
        payloads = message.payloads(values, message.driven)
        if not self._sends:
            return
        self._has_sent = True
        self._hand_over(self._sender.frames(message, payloads))
        self._commands += 1

    def _hand_over(self, frames: Sequence[Frame], *, final: bool = False) -> None:
        for frame in frames:
            self.bus.send(frame, final=final)
            if self._on_frame is not None:
                self._on_frame(changed(frame, monotonic_ns=time.monotonic_ns()))

    def _receive(self, timeout_s: float) -> bool:
        """Take the next frame; False where none came."""
        frame = self.bus.receive(timeout_s)
        if frame is None:
            return False
        if self._on_frame is not None:
            self._on_frame(frame)
        self._inbox.take(frame)
        return True

    def _send_safe(self, *, final: bool = False) -> None:
        self._has_sent = True
        for message in self.map.commands.values():
            if message.safe:
                self._hand_over(self._sender.frames(message, message.payloads({}, message.safe)), final=final)

    def _receive_cycle(self, timeout_s: float) -> bool:
        """Wait for a whole cycle, then take all that came: the newest state counts, the oldest cycle is next."""
        until = time.monotonic() + timeout_s
        while not self._inbox.ready:
            left_s = until - time.monotonic() if self.bus.shared else timeout_s
            if not self._receive(max(0.0, left_s)):
                return False
        self._take_all()
        return True

    def _take_all(self) -> None:
        while self._receive(0.0):
            pass
