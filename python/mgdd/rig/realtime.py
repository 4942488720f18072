"""A throttle controller in a thread of the core, at a fixed period over a bus, while Python is free."""

from __future__ import annotations

import time
import weakref
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd import _core
from mgdd._core.rig import E2eSettings, Frame, RingTransport, SignalLayout, SocketCanTransport
from mgdd.errors import ParameterError, RigError
from mgdd.results.labels import VARIABLES, labelled_dataset
from mgdd.rig.loop_message import LoopMessage
from mgdd.rig.safety import SafetyChange, SafetyEnvelope

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "E2eSettings",
    "Frame",
    "LoopMessage",
    "RealtimeLoop",
    "RingTransport",
    "SignalLayout",
    "SocketCanTransport",
]

_PAUSE_S = 0.002
_LABELS: Mapping[str, tuple[str, str]] = {
    "cycle": ("-", "number of the grid point"),
    "lateness_us": ("us", "beginning after the deadline"),
    "compute_us": ("us", "time from waking until the command had left"),
    "age_us": ("us", "age of the measurement"),
    "missed": ("-", "deadlines missed since the cycle before"),
    "first_v": ("V", "first position sensor"),
    "second_v": ("V", "second position sensor"),
    "applied_duty": ("-", "duty that the node reports"),
    "asked_duty": ("-", "duty of the controller"),
    "bridge_open": ("-", "open bridge"),
    "fresh": ("-", "a new angle arrived"),
    "mode": ("-", "mode of the safety gate"),
    "cause": ("-", "what is wrong"),
    "send_result": ("-", "what became of the command"),
    "good_frames": ("-", "frames with a new angle"),
    "bad_frames": ("-", "frames that were refused"),
    "bus_state": ("-", "state of the bus"),
    "request": ("-", "request to the safety gate"),
}
_CODES = {
    "mode": _core.rig.safety_states,
    "cause": _core.rig.safety_reasons,
    "send_result": _core.rig.send_results,
    "bus_state": _core.rig.bus_states,
    "request": _core.rig.safety_requests,
}
_TIMES = {"lateness_us": "lateness", "compute_us": "compute", "age_us": "age", "send_us": "send"}


class RealtimeLoop:
    """A throttle controller over a bus, in a thread of the core with absolute deadlines.

    Every period the loop takes the frames that arrived, judges them, steps the controller, passes its duty through a
    safety gate and sends the command. Python sets references and reads samples; no cycle waits for it. A deadline that
    was missed is counted and skipped to the next grid point, never made up for; what was sent last holds meanwhile, and
    several in a row open the bridge. Used as a context manager it starts, and stops with an open bridge; so it does
    when the object or the interpreter goes.

    Parameters
    ----------
    controller : Pid, SlidingMode, GuidedPredictive or Mgdd1
        A copy runs; `stop` puts what it learnt back into this object. It is stepped while the gate is in the mode
        ``run`` only, and sees NaN, which repeats the last angle, in cycles without a new one.
    transport : RingTransport or SocketCanTransport
        The bus; it serves one loop.
    command : LoopMessage
        What the loop sends.
    measurements : sequence of LoopMessage
        What it receives.
    envelope : SafetyEnvelope, optional
        Of its safety gate, ``etb`` if left out. ``cycle_s`` is the period of the loop, and must be the sample time of
        the controller.
    reference_deg : float
        First reference [deg].
    reference_timeout_s : float, optional
        A driven loop that receives no new reference for so long aborts: against a Python that hangs [s].
    transmit : bool
        False: everything but sending, a dry run.
    stop_frames : int
        Commands with an open bridge before the silence of a stop.
    realtime, priority : bool, int
        Ask for SCHED_FIFO and its priority, 1 to 99.
    lock_memory : bool
        Ask that all memory of the process stays in RAM, until the process ends.
    sample_capacity, queue_capacity : int
        Samples that may wait for `samples`, and references for their cycle; powers of two.

    Raises
    ------
    mgdd.errors.ParameterError
        Settings outside their domain, messages that lack a signal or overlap, sample times that differ.
    mgdd.errors.RigError
        The transport serves another loop.

    See Also
    --------
    BusBridge : any adapter of python-can behind a `RingTransport`.
    SafetyGate : modes and reasons.

    Notes
    -----
    What the system refuses (real-time class, locked memory) stands in ``report()["schedule"]``, and the loop runs
    without.

    Examples
    --------
    >>> from mgdd.control import Pid
    >>> from mgdd.rig import SafetyEnvelope
    >>> from mgdd.rig.realtime import RealtimeLoop
    >>> from mgdd.rig.realtime import LoopMessage, RingTransport, SignalLayout
    >>> duty = SignalLayout(start=0, length=16, raw_type="signed", scale=5e-5)
    >>> measured = {
    ...     "angle_deg": SignalLayout(start=0, length=16, scale=0.01),
    ...     "first_v": SignalLayout(start=16, length=12, scale=0.00125),
    ...     "second_v": SignalLayout(start=32, length=12, scale=0.00125),
    ... }
    >>> loop = RealtimeLoop(
    ...     Pid(sample_s=0.002),
    ...     RingTransport(),
    ...     command=LoopMessage(can_id=0x120, signals={"duty": duty}),
    ...     measurements=[LoopMessage(can_id=0x121, signals=measured)],
    ...     envelope=SafetyEnvelope(cycle_s=0.002),
    ...     realtime=False,
    ...     lock_memory=False,
    ... )
    >>> with loop:
    ...     ended = loop.wait(0.05)
    >>> ended, loop.running, loop.mode, loop.report()["cycles"] > 0
    (False, False, 'init', True)
    """

    def __init__(
        self,
        controller: Any,
        transport: RingTransport | SocketCanTransport,
        *,
        command: LoopMessage,
        measurements: Sequence[LoopMessage],
        envelope: SafetyEnvelope | None = None,
        reference_deg: float = 0.0,
        reference_timeout_s: float | None = None,
        transmit: bool = True,
        stop_frames: int = 5,
        realtime: bool = True,
        priority: int = 50,
        lock_memory: bool = True,
        sample_capacity: int = 16_384,
        queue_capacity: int = 65_536,
    ) -> None:
        if not isinstance(transport, RingTransport | SocketCanTransport):
            raise ParameterError.of("transport", transport, "a RingTransport or a SocketCanTransport")
        for message in measurements:
            for name in ("fixed", "switched"):
                if given := getattr(message, name):
                    raise ParameterError.of(name, given, "empty in a received message")
        if command.missing:
            raise ParameterError.of("missing", command.missing, "empty in the command")
        self.envelope = SafetyEnvelope() if envelope is None else envelope
        self.controller = controller
        self.transport = transport
        self._core = _core.rig.RealtimeLoop(
            controller=getattr(controller, "_core", controller), transport=transport, envelope=self.envelope,
            command=command.to_core(), received=[message.to_core() for message in measurements],
            period_s=self.envelope.cycle_s, initial_reference_deg=reference_deg,
            reference_timeout_s=reference_timeout_s, transmit=transmit, stop_frames=stop_frames, realtime=realtime,
            priority=priority, lock_memory=lock_memory, sample_capacity=sample_capacity, queue_capacity=queue_capacity,
        )  # fmt: skip
        self._pause_s = max(_PAUSE_S, 2.0 * self.envelope.cycle_s)  # one request is taken per cycle
        self._origin_ns: int | None = None
        # Also at the end of the interpreter: a thread of the core must not outlive it.
        self._end = weakref.finalize(self, self._core.stop, self._core.patience_s)

    # --- life -------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread, once, and return: the gate is in the mode ``init``. RigError where it was started."""
        import xarray  # noqa: F401 - an import while it runs would hold up the threads that feed the transport

        self._core.start()

    def stop(self, timeout_s: float | None = None) -> None:
        """Send the last commands with an open bridge and end the thread; does nothing where it has ended.

        Without a limit it waits ``stop_frames`` periods and 2 s [s]. RigError where it did not end in time: cut the
        supply of the motor.
        """
        limit_s = self._core.patience_s if timeout_s is None else timeout_s
        if not self._core.stop(limit_s):
            raise RigError(f"the loop did not end within {limit_s:g} s: cut the supply of the motor")
        self._core.give_back(getattr(self.controller, "_core", self.controller))

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end of the loop, for so long [s] or without end, while other threads of Python run.

        Gives whether it has ended; one that was not started counts so. `mgdd.errors.Interrupted` for Ctrl-C: the loop
        goes on until `stop`.
        """
        return bool(self._core.wait(timeout_s))

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    # --- the safety gate ----------------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether the thread runs."""
        return bool(self._core.running)

    @property
    def mode(self) -> str:
        """Mode of the safety gate: ``init``, ``armed``, ``run``, ``limp`` or ``fault``."""
        return str(self._core.state)

    @property
    def reason(self) -> str:
        """Why that mode was entered."""
        return str(self._core.reason)

    @property
    def cause(self) -> str:
        """What is wrong now; ``none`` where nothing is."""
        return str(self._core.cause)

    def arm(self, timeout_s: float = 2.0) -> None:
        """Ask the gate for the mode ``armed``, for so long [s], until enough good frames have come.

        RigError where the gate refuses, with what is wrong, or the loop does not run; the same of `drive`, `release`
        and `reset`.
        """
        self._ask("arm", "armed", timeout_s)

    def drive(self, timeout_s: float = 2.0) -> None:
        """Ask the gate for the mode ``run``: the actuator is driven from now on. Otherwise as `arm`."""
        self._ask("run", "run", timeout_s)

    def release(self, timeout_s: float = 2.0) -> None:
        """Open the bridge, from ``run`` back to the mode ``armed``. Otherwise as `arm`."""
        self._ask("stop", "armed", timeout_s)

    def reset(self, timeout_s: float = 2.0) -> None:
        """Leave ``limp`` for ``armed``, or ``fault`` for ``init``, once nothing is wrong. Otherwise as `arm`."""
        self._ask("reset", "init" if self.mode == "fault" else "armed", timeout_s)

    def abort(self) -> None:
        """Open the bridge at the next cycle, whatever the mode, until a reset; RigError where it does not run."""
        self._require_running()
        while not self._core.request("abort"):
            time.sleep(_PAUSE_S)
            self._require_running()

    def _ask(self, request: str, target_mode: str, timeout_s: float) -> None:
        until = time.monotonic() + timeout_s
        while self.mode != target_mode:
            self._require_running()
            if time.monotonic() > until:
                why = self.cause if self.cause != "none" else f"too few good frames, or the wrong mode, {self.mode}"
                raise RigError(f"no {request!r} within {timeout_s:g} s: {why}")
            self._core.request(request)
            time.sleep(self._pause_s)

    def _require_running(self) -> None:
        if not self.running:
            raise RigError("the loop does not run: start() it; one that was stopped is made anew")

    # --- references -------------------------------------------------------------------------------------------

    def set_reference(self, reference_deg: float) -> None:
        """Set the wanted plate angle [deg], finite, from the next cycle on; the latest one wins."""
        self._core.set_reference(reference_deg)

    def queue_references(self, reference_deg: ArrayLike) -> None:
        """Hand over references [deg], shape (n,): one per grid point while the loop drives, then the last one holds.

        They stand behind those that wait already. None is queued where one is not finite, a ParameterError, or where
        they do not fit ``queue_capacity``, a RigError.
        """
        self._core.queue_references(np.asarray(reference_deg, dtype=float))

    @property
    def queued_references(self) -> int:
        """References that wait for their cycle."""
        return int(self._core.queued_references)

    # --- what it does -----------------------------------------------------------------------------------------

    @property
    def bus_state(self) -> str:
        """State of the bus: ``active``, ``warning``, ``passive`` or ``off``."""
        return str(self._core.bus_state)

    def samples(self) -> xr.Dataset:
        """Take the samples of all cycles since the last call.

        Along ``time_s``, that of the deadlines from the first sample ever taken: reference, measured numbers (the last
        good ones), duty asked and duty sent, mode, cause, lateness, compute time and age; NaN where unknown. What was
        not taken in time is counted in ``report()["dropped_samples"]``.
        """
        columns = self.sample_columns()
        if self._origin_ns is None and columns["deadline_ns"].size:
            self._origin_ns = int(columns["deadline_ns"][0])
        origin_ns, values = self._origin_ns or 0, columns
        time_s = (values.pop("deadline_ns") - origin_ns) * 1e-9
        values["sensed_angle_deg"] = values.pop("angle_deg")
        values["mode"] = values.pop("state")
        values |= {name: np.array(words)[values[name]] for name, words in _CODES.items()}
        variables: dict[str, Any] = {"time_s": ("time_s", time_s)}
        for name, column in values.items():
            variables[name] = ("time_s", column, *(_LABELS.get(name) or VARIABLES[name]))
        return labelled_dataset(variables, attrs={"origin_monotonic_ns": str(origin_ns)})

    def sample_columns(self) -> dict[str, NDArray[Any]]:
        """Take the same samples as plain columns, for a reader that comes every few milliseconds.

        They are as the core has them: ``deadline_ns``, times in us, ``state``, ``cause``, ``send_result``,
        ``bus_state`` and ``request`` as numbers.
        """
        return dict(self._core.samples())

    def events(self) -> list[SafetyChange]:
        """Take the changes of mode since the last call, in their order."""
        return [SafetyChange(*event) for event in self._core.events()]

    def report(self) -> dict[str, Any]:
        """Give the account of the loop so far.

        ``cycles``, ``missed`` deadlines, those of them that ran but ended ``late``, the ``longest_row``;
        ``lateness_us``, ``compute_us``, ``age_us`` and ``send_us`` with ``count mean p50 p99 p99_9 max`` (quantiles are
        never too small and at most a third too large; the largest is exact); ``frames`` by verdict, ``bus`` as the
        transport counts, dropped samples and events, and what the system granted in ``schedule``.
        """
        return dict(self._core.report())

    def summary(self) -> str:
        """Say in a few lines how punctual the loop was: deadlines, times and frames."""
        report = self.report()
        frames, bus, granted = report["frames"], report["bus"], report["schedule"]
        cycles = f"{report['cycles']} cycles of {self.envelope.cycle_s * 1e3:g} ms, {report['missed']} deadlines missed"
        lines = [f"{cycles} ({report['late']} of them too long, longest row {report['longest_row']})"]
        lines.append(f"{'':14}{'p50':>10}{'p99':>10}{'p99.9':>10}{'max':>12}")
        for name, what in _TIMES.items():
            times = report[name]
            quantiles = "".join(f"{times[q]:10.1f}" for q in ("p50", "p99", "p99_9"))
            lines.append(f"{what + ' [us]':14}{quantiles}{times['max']:12.1f}")
        received = f"frames: {frames['good']} good, {frames['bad']} bad, {bus['lost']} lost"
        lines.append(
            f"{received}, {bus['sent']} sent, {bus['full'] + bus['failed']} not sent; samples dropped:"
            f" {report['dropped_samples']}"
        )
        yes = {True: "yes", False: "no"}
        lines.append(f"SCHED_FIFO: {yes[granted['realtime']]}, memory locked: {yes[granted['memory_locked']]}")
        return "\n".join(lines)
