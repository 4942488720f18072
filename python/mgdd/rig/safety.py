"""The safety gate below every controller, and its envelope as a file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from typing import Any, NamedTuple, Self

from mgdd import _core
from mgdd._core.rig import Drive
from mgdd.errors import DataError, RigError, did_you_mean
from mgdd.io.parameters import ParameterFile, Parameters, Wanted, entries

_KIND = "safety_envelope"
_CHOICE = "bus_fault_from"


class SafetyEnvelope(Parameters, _core.rig.SafetyEnvelope):  # noqa: D101 the core's text
    __doc__ = _core.rig.SafetyEnvelope.__doc__

    @classmethod
    def load(cls, name: str | os.PathLike[str]) -> SafetyEnvelope:
        """Read an envelope: a shipped one by its name, or a file.

        Parameters
        ----------
        name : str or path
            ``"etb"`` for the host of a throttle, ``"etb_node"`` for the node that drives its bridge, or the path of a
            file that `to_toml` wrote.

        Raises
        ------
        FileNotFoundError
            No such file.
        mgdd.errors.DataError
            Neither a shipped name nor a file of this kind, a missing key.
        mgdd.errors.ParameterError
            An unknown key, another unit, a value outside its domain.

        Examples
        --------
        >>> from mgdd.rig import SafetyEnvelope
        >>> SafetyEnvelope.load("etb") == SafetyEnvelope()
        True
        """
        text = os.fspath(name)
        if "." in text or os.sep in text:
            return cls.of_file(ParameterFile.read(text))
        folder = resources.files("mgdd.rig").joinpath("envelopes")
        shipped = sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir())
        if text not in shipped:
            hint = did_you_mean(text, shipped) or f"shipped are {', '.join(shipped)}"
            raise DataError(f"no shipped envelope {text!r}: {hint}; the path of a file ends in .toml")
        shipped_text = folder.joinpath(f"{text}.toml").read_text(encoding="utf-8")
        return cls.from_toml(shipped_text, origin=f"envelope {text!r}")

    def to_parameters(self) -> ParameterFile:
        """Give all fields, as `to_toml` writes them."""
        units = {name: wanted.unit for name, wanted in _wanted().items()}
        return ParameterFile(kind=_KIND, tables={"parameters": entries(self.to_dict(), units)})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> SafetyEnvelope:
        """Make the envelope of a file that `to_toml` wrote."""
        file.expect(kinds=(_KIND,), tables=("parameters",), notes=("name", "title", "source"))
        return cls(**file.values("parameters", _wanted()))

    def replace(self, **changes: Any) -> SafetyEnvelope:
        """Give a validated copy with some fields changed; an unknown name is a ParameterError."""
        return type(self)(**super().replace(**changes).to_dict())


def _wanted() -> dict[str, Wanted]:
    fields = _core.rig.SafetyEnvelope.fields()
    return {n: Wanted(form="text") if n == _CHOICE else Wanted(field["unit"]) for n, field in fields.items()}


class SafetyChange(NamedTuple):
    """A change of mode of a safety gate, with why, and how often this reason has led to one so far.

    Examples
    --------
    >>> from mgdd.rig import SafetyGate
    >>> gate = SafetyGate()
    >>> for _ in range(20):
    ...     gate.observe(good_frames=1, age_s=0.0, sensor_v=(1.5, 3.5), angle_deg=22.5)
    ...     drive = gate.command(0.0)
    >>> gate.arm()
    >>> gate.drain()
    [SafetyChange(cycle=20, before='init', after='armed', reason='requested', times=1)]
    """

    cycle: int
    before: str
    after: str
    reason: str
    times: int


class SafetyGate:
    """What a duty passes last before it leaves the machine, whatever controller or optimiser asked for it.

    In every cycle: `observe` what is known of it, then `command` the duty of the controller, and send the drive that
    comes back. Modes: ``init``, ``armed``, ``run``, ``limp`` and ``fault``. Only in ``run`` is the actuator driven;
    everywhere else the duty is 0 and the bridge open, so that the springs bring the plate to limp-home. What goes wrong
    leads from ``armed`` and ``run`` to ``limp``; sensors that cannot be right and a duty that is not finite lead from
    everywhere to ``fault``. Both are left by `reset` alone, after the cause is gone. As a context manager it aborts on
    an exception and disarms at the end. Not a certified safety function: an emergency stop belongs into the supply of
    the motor.

    Parameters
    ----------
    envelope : SafetyEnvelope, optional
        Its numbers; the shipped ``etb`` if left out.

    See Also
    --------
    mgdd.rig.GatedThrottle : a throttle behind a gate, as a plant of the loop.
    mgdd.rig.ActuatorGuard : the guard of an engine bench.
    mgdd.control.ThrottleSupervisor : a monitor that knows the plate, beside its controller.

    Notes
    -----
    Reasons of ``limp``: ``stale``, ``bad_frames``, ``bus_fault``, ``not_sent``, ``deadlines``, ``not_observed``,
    ``heat``, ``stall`` and ``aborted``. Of ``fault``: ``sensor_range``, ``sensor_disagreement``, ``sensor_slope``,
    ``travel`` and ``invalid_duty``. One thread at a time: a loop in another one passes requests on in
    ``observe(request=...)``.

    Examples
    --------
    >>> from mgdd.rig import SafetyGate
    >>> gate = SafetyGate()
    >>> well = {"good_frames": 1, "age_s": 0.0, "sensor_v": (1.5, 3.5), "angle_deg": 22.5}
    >>> for _ in range(20):
    ...     gate.observe(**well)
    ...     drive = gate.command(0.1)
    >>> gate.arm(), gate.run()
    (None, None)
    >>> for _ in range(300):
    ...     gate.observe(**well)
    ...     drive = gate.command(0.1)
    >>> drive
    Drive(duty=0.1, bridge_open=False, send=True)
    >>> gate.observe(**well)
    >>> gate.command(float("nan")), gate.mode, gate.reason
    (Drive(duty=0.0, bridge_open=True, send=True), 'fault', 'invalid_duty')
    >>> gate.reset()
    Traceback (most recent call last):
      ...
    mgdd.errors.RigError: reset refused in mode 'fault': invalid_duty
    """

    def __init__(self, envelope: SafetyEnvelope | None = None) -> None:
        self._envelope = SafetyEnvelope.load("etb") if envelope is None else envelope
        self._core = _core.rig.SafetyGate(self._envelope)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._envelope, self.state)

    @property
    def envelope(self) -> SafetyEnvelope:
        """The numbers that it keeps."""
        return self._envelope

    @property
    def mode(self) -> str:
        """``init``, ``armed``, ``run``, ``limp`` or ``fault``."""
        return self._core.mode

    @property
    def reason(self) -> str:
        """Why that mode was entered."""
        return self._core.reason

    @property
    def cause(self) -> str:
        """What is wrong now, ``none`` if nothing; arming, starting and a reset wait for its end."""
        return self._core.cause

    @property
    def drive(self) -> Drive:
        """The drive of the last cycle."""
        return self._core.drive

    @property
    def rms_duty(self) -> float:
        """RMS duty of the heat model [-]."""
        return self._core.rms_duty

    @property
    def cycle(self) -> int:
        """Cycles so far, missed ones included."""
        return self._core.cycle

    @property
    def counts(self) -> dict[str, int]:
        """Duties so far that were ``clamped`` or ``slewed``, ``dropped`` changes, and changes of mode by reason."""
        core = self._core
        own = {"clamped": core.clamped, "slewed": core.slewed, "dropped": core.dropped}
        return own | {name: core.count(name) for name in _core.rig.safety_reasons if core.count(name)}

    @property
    def state(self) -> dict[str, list[float]]:
        """What a run needs to go on bit for bit, the waiting changes included; setting it restores the run."""
        return self._core.state

    @state.setter
    def state(self, saved: Mapping[str, Sequence[float]]) -> None:
        self._core.state = {name: list(values) for name, values in saved.items()}

    def observe(
        self,
        *,
        good_frames: int = 0,
        bad_frames: int = 0,
        age_s: float | None = None,
        sensor_v: tuple[float, float] | None = None,
        angle_deg: float | None = None,
        bus: str = "active",
        sent: bool = True,
        missed_deadlines: int = 0,
        request: str = "none",
    ) -> None:
        """Take what is known of this cycle, before the controller runs.

        Parameters
        ----------
        good_frames, bad_frames : int
            Frames that arrived since the last cycle and passed or failed their checks, >= 0.
        age_s : float, optional
            Age of the last good one [s]; it grows by a cycle if left out.
        sensor_v : pair of float, optional
            Both position sensors [V]; looked at where a good frame arrived.
        angle_deg : float, optional
            Angle of the plate [deg]; the same.
        bus : {"active", "warning", "passive", "off"}
            Error state of the CAN controller.
        sent : bool
            Whether the last command left.
        missed_deadlines : int
            Since the last cycle, >= 0.
        request : {"none", "arm", "run", "stop", "disarm", "reset", "abort"}
            What the operator asks for, after all checks of the cycle; ignored where it is refused.

        Raises
        ------
        mgdd.errors.ParameterError
            A negative count, an unknown name.
        """
        self._core.observe(
            good_frames=good_frames, bad_frames=bad_frames, age_s=age_s, sensor_v=sensor_v, angle_deg=angle_deg,
            bus=bus, sent=sent, missed_deadlines=missed_deadlines, request=request,
        )  # fmt: skip

    def command(self, duty: float) -> Drive:
        """Give the drive that may leave in this cycle for the duty that the controller asks for [-].

        It is limited, or open. NaN is a fault of the controller; without `observe` before it: open, and ``limp``.
        """
        return self._core.command(duty)

    def arm(self) -> None:
        """Go from ``init`` to ``armed``; RigError where something stands against it."""
        self._request("arm")

    def run(self) -> None:
        """Go from ``armed`` to ``run``; RigError where something stands against it."""
        self._request("run")

    def stop(self) -> None:
        """Go from ``run`` to ``armed``; RigError in another mode."""
        self._request("stop")

    def disarm(self) -> None:
        """Go from ``armed`` or ``run`` to ``init``; RigError in another mode."""
        self._request("disarm")

    def reset(self) -> None:
        """Go from ``limp`` to ``armed`` or from ``fault`` to ``init``; RigError while the cause stands."""
        self._request("reset")

    def abort(self) -> None:
        """Go from ``armed`` or ``run`` to ``limp``; never refused."""
        self._request("abort")

    def _request(self, name: str) -> None:
        against = self._core.request(name)
        if against != "none":
            raise RigError(f"{name} refused in mode {self.mode!r}: {against}")

    def drain(self) -> list[SafetyChange]:
        """Take the waiting changes of mode, oldest first; beyond 64 they are ``counts["dropped"]``."""
        return [SafetyChange(*entry) for entry in self._core.drain()]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self.abort()
        elif self.mode in ("armed", "run"):
            self.disarm()


def said_of(changes: Iterable[SafetyChange]) -> list[str]:
    """Say changes of mode as events of a run."""
    return [f"safety gate: {c.before} -> {c.after}: {c.reason}" for c in changes]


def _restored(envelope: SafetyEnvelope, state: Mapping[str, Sequence[float]]) -> SafetyGate:
    gate = SafetyGate(envelope)
    gate.state = dict(state)
    return gate
