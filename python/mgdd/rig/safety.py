"""The safety gate below every controller, its envelope as a file, and a throttle behind it."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib import resources
from typing import Any, NamedTuple, Self, TypeVar

from mgdd import _core
from mgdd._core.rig import Drive
from mgdd._settings import remade
from mgdd.control import GuidedPredictive
from mgdd.errors import DataError, ParameterError, RigError, did_you_mean
from mgdd.io.parameters import ParameterFile, Parameters, Wanted, entries
from mgdd.loop import Measurement, Plant

_KIND = "safety_envelope"
_CHOICE = "bus_fault_from"
_Made = TypeVar("_Made")


class SafetyEnvelope(Parameters, _core.rig.SafetyEnvelope):  # noqa: D101 the core's text
    __doc__ = _core.rig.SafetyEnvelope.__doc__

    @classmethod
    def load(cls, name: str | os.PathLike[str]) -> SafetyEnvelope:
        """Read an envelope by its shipped name or the path of a file that `to_toml` wrote.

        ``"etb"`` is for the host of a throttle, ``"etb_node"`` for the node that drives its bridge. FileNotFoundError;
        `mgdd.errors.DataError` for neither a shipped name nor a file of this kind, and a missing key;
        `mgdd.errors.ParameterError` for an unknown key, another unit, a value outside its domain.
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
        units = {name: wanted.unit for name, wanted in _entries().items()}
        return ParameterFile(kind=_KIND, tables={"parameters": entries(self.to_dict(), units)})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> SafetyEnvelope:
        """Make the envelope of a file that `to_toml` wrote."""
        file.expect(kinds=(_KIND,), tables=("parameters",), notes=("name", "title", "source"))
        return cls(**file.values("parameters", _entries()))

    def replace(self, **changes: Any) -> SafetyEnvelope:
        """Give a validated copy with some fields changed; an unknown name is a ParameterError."""
        return type(self)(**super().replace(**changes).to_dict())


def _entries() -> dict[str, Wanted]:
    fields = _core.rig.SafetyEnvelope.fields()
    return {n: Wanted(form="text") if n == _CHOICE else Wanted(field["unit"]) for n, field in fields.items()}


def bounded_by(controller: _Made, envelope: SafetyEnvelope) -> _Made:
    """Give a controller that learns the bounds of the gate behind it to plan with, others as they are.

    `set_sent` says what left; a slew of 12/s that is not planned with settles a step in twice the time.
    """
    if not isinstance(controller, GuidedPredictive) or not controller.settings["friction_learning"]:
        return controller
    own, limit = controller.settings, envelope.duty_limit
    own["lower"], own["upper"] = max(own["lower"], -limit), min(own["upper"], limit)
    own["duty_rate_per_s"] = min(own["duty_rate_per_s"], envelope.slew_per_s)
    return type(controller)(**own)


class SafetyChange(NamedTuple):
    """A change of mode of a safety gate, with why, and how often this reason has led to one so far."""

    cycle: int
    before: str
    after: str
    reason: str
    times: int


class SafetyGate(_core.rig.SafetyGate):
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
        super().__init__(self._envelope)

    def __reduce__(self) -> tuple[Any, ...]:
        return remade, (SafetyGate, (self._envelope,), {}, {"state": dict(self.state)})

    @property
    def envelope(self) -> SafetyEnvelope:
        """The numbers that it keeps."""
        return self._envelope

    @property
    def counts(self) -> dict[str, int]:
        """Duties so far that were ``clamped`` or ``slewed``, ``dropped`` changes, and changes of mode by reason."""
        own = {"clamped": self.clamped, "slewed": self.slewed, "dropped": self.dropped}
        return own | {name: self.count(name) for name in _core.rig.safety_reasons if self.count(name)}

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
        against = self.request(name)
        if against != "none":
            raise RigError(f"{name} refused in mode {self.mode!r}: {against}")

    def drain(self) -> list[SafetyChange]:  # type: ignore[override]
        """Take the waiting changes of mode, oldest first; beyond 64 they are ``counts["dropped"]``."""
        return [SafetyChange(*entry) for entry in super().drain()]

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


class GatedThrottle:
    """A throttle whose duty passes a safety gate: one `apply` and one `measure` per cycle.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        Takes ``duty`` and, where it can, ``bridge_open``; gives ``first_v``, ``second_v``, ``sensed_angle_deg`` and,
        where known, ``age_s``: `mgdd.loop.VirtualThrottle`, or a rig. The bridge of a plant without ``bridge_open``
        opens when its rig is left: there `apply` raises once the gate takes the drive away.
    gate : SafetyGate, optional
        With the envelope ``etb`` if left out.
    shadow : bool
        The plant does not follow, as in ``dry_run`` and ``replay``: nothing is raised, and the run goes on at zero
        duty.

    Raises
    ------
    mgdd.errors.ParameterError
        A plant with other inputs.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> from mgdd.rig import GatedThrottle
    >>> plant = GatedThrottle(VirtualThrottle(inputs=("duty", "bridge_open"), seed=1))
    >>> start_deg = plant.start()
    >>> for _ in range(400):
    ...     plant.apply({"duty": 0.3})
    ...     measured = plant.measure()
    >>> measured.applied["duty"], measured.values["angle_deg"] > 20.0
    (0.3, True)
    >>> plant.gate.abort()
    >>> for _ in range(400):
    ...     plant.apply({"duty": 0.3})
    ...     measured = plant.measure()
    >>> measured.applied, abs(measured.values["angle_deg"] - 8.0) < 1.0
    ({'duty': 0.0, 'bridge_open': 1.0}, True)
    """

    input_names = ("duty",)

    def __init__(self, plant: Plant, gate: SafetyGate | None = None, *, shadow: bool = False) -> None:
        if set(plant.input_names) not in ({"duty"}, {"duty", "bridge_open"}):
            raise ParameterError(f"plant takes {', '.join(plant.input_names)}: must take duty, or duty and bridge_open")
        self.plant, self.limit_names = plant, plant.limit_names
        self.gate = SafetyGate() if gate is None else gate
        self.shadow = shadow
        self._opens = "bridge_open" in plant.input_names
        self._values: Mapping[str, float] | None = None
        self._applied: dict[str, float] | None = None

    def start(self) -> float:
        """Measure without drive until the gate can be armed, then arm and run it; give the angle measured last [deg].

        RigError where something stands against it after twice the good frames that it needs.
        """
        angle_deg = math.nan
        for _ in range(2 * max(math.ceil(self.gate.envelope.good_frames), 1)):
            self._send(self._passed(0.0))
            angle_deg = float(self.measure().values["sensed_angle_deg"])
        if self.gate.mode == "init":
            self.gate.arm()
        self.gate.run()
        return angle_deg

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Pass the duty of the next cycle through the gate, with what was measured last.

        NaN is a fault of the controller and opens the bridge. Any input but ``duty`` is a ParameterError; a RigError
        has the reason why the gate takes the drive away from a plant that cannot open its bridge.
        """
        if set(inputs) != {"duty"}:
            raise ParameterError(f"inputs = {', '.join(map(str, inputs)) or 'none'}: must be duty")
        drive = self._passed(inputs["duty"])
        if drive.bridge_open and not (self._opens or self.shadow):
            raise drive_taken(self.gate.mode, self.gate.reason)
        self._send(drive)

    def measure(self) -> Measurement:
        """Run one cycle; ``applied`` has what left: the ``duty``, and ``bridge_open`` where the plant takes it."""
        if self._applied is None:
            raise RigError("measure() before apply(): apply a duty first")
        measured = self.plant.measure()
        self._values = measured.values
        return replace(measured, applied={**self._applied, **measured.applied})

    def _passed(self, duty: float) -> Drive:
        self.gate.observe(**facts_of(self._values, self.gate.envelope.cycle_s))
        return self.gate.command(duty)

    def _send(self, drive: Drive) -> None:
        self._applied = {"duty": drive.duty}
        if self._opens:
            self._applied["bridge_open"] = float(drive.bridge_open)
        self.plant.apply(self._applied)


def facts_of(values: Mapping[str, float] | None, cycle_s: float) -> dict[str, Any]:
    """Give a gate's inputs from measured values of a throttle; a measurement is new while its age is below a cycle."""
    if values is None:
        return {}
    age_s = values.get("age_s", 0.0)
    return {
        "good_frames": int(age_s < 0.5 * cycle_s),
        "age_s": age_s,
        "sensor_v": (values["first_v"], values["second_v"]),
        "angle_deg": values["sensed_angle_deg"],
    }


def drive_taken(mode: str, reason: str) -> RigError:
    """Make the error of a run whose gate took the drive away."""
    return RigError(f"the safety gate went to {mode!r}: {reason}; look for the cause before the next run")
