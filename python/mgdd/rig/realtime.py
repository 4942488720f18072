"""A throttle controller in a thread of the core, at a fixed period over a bus, while Python is free."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd import _core
from mgdd._core.rig import E2eSettings, Frame, RingTransport, SignalLayout, SocketCanTransport
from mgdd.errors import ParameterError, RigError
from mgdd.rig.gate_requests import GateRequests
from mgdd.rig.loop_message import LoopMessage
from mgdd.rig.loop_samples import samples_dataset, summary
from mgdd.rig.safety import SafetyChange
from mgdd.rig.safety_envelope import SafetyEnvelope

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


class RealtimeLoop(GateRequests):
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
        A driven loop that hears of no new reference for so long aborts: against a Python that hangs [s].
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
            controller=getattr(controller, "_core", controller),
            transport=transport,
            envelope=self.envelope,
            command=command.to_core(),
            received=[message.to_core() for message in measurements],
            period_s=self.envelope.cycle_s,
            initial_reference_deg=reference_deg,
            reference_timeout_s=reference_timeout_s,
            transmit=transmit,
            stop_frames=stop_frames,
            realtime=realtime,
            priority=priority,
            lock_memory=lock_memory,
            sample_capacity=sample_capacity,
            queue_capacity=queue_capacity,
        )
        super().__init__(self._core, self.envelope.cycle_s)
        self._origin_ns: int | None = None
        # Also at the end of the interpreter: a thread of the core must not outlive it.
        self._end = weakref.finalize(self, self._core.stop, self._core.patience_s)

    # --- life -------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread; returns at once. The gate is in the mode ``init``: commands say open bridge.

        Raises
        ------
        mgdd.errors.RigError
            It was started before.
        """
        import xarray  # noqa: F401 - an import while it runs would hold up the threads that feed the transport

        self._core.start()

    def stop(self, timeout_s: float | None = None) -> None:
        """Send the last commands with an open bridge and end the thread; does nothing where it has ended.

        Parameters
        ----------
        timeout_s : float, optional
            How long to wait for the end [s]; ``stop_frames`` periods and 2 s if left out.

        Raises
        ------
        mgdd.errors.RigError
            It did not end in time: cut the supply of the motor.
        """
        limit_s = self._core.patience_s if timeout_s is None else timeout_s
        if not self._core.stop(limit_s):
            raise RigError(f"the loop did not end within {limit_s:g} s: cut the supply of the motor")
        self._core.give_back(getattr(self.controller, "_core", self.controller))

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end of the loop while other threads of Python run.

        Parameters
        ----------
        timeout_s : float, optional
            How long [s]; without end if left out.

        Returns
        -------
        bool
            Whether the loop has ended. One that was not started counts as ended.

        Raises
        ------
        mgdd.errors.Interrupted
            Ctrl-C; the loop goes on until `stop`.
        """
        return bool(self._core.wait(timeout_s))

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.stop()

    # --- references -------------------------------------------------------------------------------------------

    def set_reference(self, reference_deg: float) -> None:
        """Set the reference from the next cycle on; the latest one wins.

        Parameters
        ----------
        reference_deg : float
            Wanted plate angle [deg].

        Raises
        ------
        mgdd.errors.ParameterError
            It is not finite.
        """
        self._core.set_reference(reference_deg)

    def queue_references(self, reference_deg: ArrayLike) -> None:
        """Hand over references in advance: one per grid point while the loop drives, then the last one holds.

        Parameters
        ----------
        reference_deg : array_like, shape (n,)
            Wanted plate angles [deg], behind those that wait already.

        Raises
        ------
        mgdd.errors.ParameterError
            One is not finite; none is queued.
        mgdd.errors.RigError
            They do not fit ``queue_capacity``; none is queued.
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

        Returns
        -------
        xarray.Dataset
            Along ``time_s``, that of the deadlines from the first sample ever taken: reference, measured numbers (the
            last good ones), duty asked and duty sent, mode, cause, lateness, compute time and age. What is unknown is
            NaN. What was not taken in time is missing here and counted in ``report()["dropped_samples"]``.
        """
        columns = self.sample_columns()
        if self._origin_ns is None and columns["deadline_ns"].size:
            self._origin_ns = int(columns["deadline_ns"][0])
        return samples_dataset(columns, self._origin_ns or 0)

    def sample_columns(self) -> dict[str, NDArray[Any]]:
        """Take the same samples as plain columns, for a reader that comes every few milliseconds.

        Returns
        -------
        dict of str to ndarray
            As the core has them: ``deadline_ns``, times in us, ``state``, ``cause``, ``send_result``, ``bus_state`` and
            ``request`` as numbers.
        """
        return dict(self._core.samples())

    def events(self) -> list[SafetyChange]:
        """Take the changes of mode since the last call.

        Returns
        -------
        list of SafetyChange
            In their order.
        """
        return [SafetyChange(*event) for event in self._core.events()]

    def report(self) -> dict[str, Any]:
        """Give the account of the loop so far.

        Returns
        -------
        dict
            ``cycles``, ``missed`` deadlines, those of them that ran but ended ``late``, the ``longest_row``;
            ``lateness_us``, ``compute_us``, ``age_us`` and ``send_us`` with ``count mean p50 p99 p99_9 max`` (quantiles
            are never too small and at most a third too large; the largest is exact); ``frames`` by verdict, ``bus`` as
            the transport counts, dropped samples and events, and what the system granted in ``schedule``.
        """
        return dict(self._core.report())

    def summary(self) -> str:
        """Say in a few lines how punctual the loop was.

        Returns
        -------
        str
            Deadlines, times and frames.
        """
        return summary(self.report(), self.envelope.cycle_s)
