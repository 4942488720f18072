"""What an experiment names, loaded and checked before anything opens, and which loop steps its controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from mgdd.errors import DataError, Error, ParameterError, RigError
from mgdd.io.files import existing_file
from mgdd.loop import Plant, VirtualEngine, VirtualTestBed, VirtualThrottle
from mgdd.loop.plates import model_of
from mgdd.loop.track import sensors_of
from mgdd.presets.meant import moving_throttle_of, whole_delay_of
from mgdd.results.describe import described
from mgdd.rig.can.can_rig import BUS_MODES
from mgdd.rig.can.signal_map import SignalMap, loop_messages
from mgdd.rig.can.transport import CanTransport
from mgdd.rig.experiment.engine_tasks import MapPlan, SeekPlan, engine_named
from mgdd.rig.experiment.experiment import Experiment
from mgdd.rig.experiment.settings import (
    SAMPLE_S,
    EnginePlant,
    IdentifyTask,
    MapTask,
    SafetySettings,
    SeekTask,
    TrackTask,
    beside,
    scaled,
)
from mgdd.rig.experiment.tasks import IdentifyPlan, TrackPlan
from mgdd.rig.recorded import RecordedRun, readable_record
from mgdd.rig.safety import SafetyEnvelope

_SIMULATED = ("simulate", "hil")


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
        # Options of a connection by SocketCAN would be those of python-can: then a bridge serves the loop.
        bus = None if experiment.bus.connection is None else CanTransport.parse(experiment.bus.connection)
        channel = str(bus.channel) if bus is not None and bus.interface == "socketcan" and not bus.options else None
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
    if experiment.mode not in BUS_MODES or signal_map is None:
        return f"mode = {experiment.mode!r}: no bus"
    if experiment.bus.pace == "step":
        return "bus.pace = 'step': every command brings one sample, without a clock"
    try:
        loop_messages(signal_map)
    except ParameterError as error:
        return str(error)
    return ""


@dataclass(frozen=True, kw_only=True)
class CheckedExperiment:
    """An experiment with all that it names."""

    experiment: Experiment
    plan: IdentifyPlan | TrackPlan | SeekPlan | MapPlan  # what will be done, made with its models
    sample_s: float | None  # between samples of a throttle
    envelope: SafetyEnvelope | None  # of a throttle
    signal_map: SignalMap | None  # of a mode with a bus
    record: Path | None  # of replay, with what was read from it
    recorded: RecordedRun | None = field(default=None, compare=False)
    loop: LoopChoice | None = None  # of a task with a controller

    @property
    def bus_map(self) -> SignalMap:
        """Map of an experiment over a bus; RigError for one without."""
        if self.signal_map is None:
            raise RigError(f"mode = {self.experiment.mode!r}: no bus; must be one of {', '.join(BUS_MODES)}")
        return self.signal_map

    def to_dict(self) -> dict[str, Any]:
        """Say what would run, as JSON holds it."""
        experiment, known = self.experiment, self.signal_map
        out: dict[str, Any] = {"task": experiment.task, "mode": experiment.mode, "seed": experiment.seed}
        out |= {"samples": self.plan.samples, "sample_s": self.sample_s}
        out |= {"transmits": experiment.mode in ("hil", "bench")}
        if experiment.mode in BUS_MODES:
            out["connection"] = experiment.bus.connection or "a hub and a node of its own"
            out["pace"] = experiment.bus.pace
        if self.loop is not None:
            out |= {"loop": self.loop.name, "loop_reason": self.loop.reason}
        if known is not None:
            out |= {
                "map": str(known.file), "dbc": str(known.dbc.file), "dbc_sha256": known.dbc.sha256,
                "inputs": list(known.input_names), "values": list(known.value_names),
                "timeouts_ms": {name: own.timeout_s * 1e3 for name, own in known.commands.items() if own.timeout_s},
            }  # fmt: skip
        if self.envelope is not None:
            out["envelope"] = self.envelope.to_dict()
        else:
            out["guard"] = experiment.safety.to_dict()
        if self.record is not None:
            out["record"] = str(self.record)
        if isinstance(self.plan, TrackPlan):
            out["warnings"] = list(self.plan.doubts)
        return out


def check_experiment(experiment: Experiment) -> CheckedExperiment:
    """Load and check all that an experiment names; nothing is opened.

    FileNotFoundError, ImportError for a mode with a bus without the extra ``can``, and each `mgdd.errors.Error` of a
    plant, model, map, envelope, limit or reference name the file of the experiment first.
    """
    try:
        return _checked(experiment)
    except Error as error:
        raise error.reworded(f"{experiment.origin}: {error}") from error
    except FileNotFoundError as error:
        raise FileNotFoundError(error.errno, f"{experiment.origin}: {error.strerror}", error.filename) from error


def _checked(experiment: Experiment) -> CheckedExperiment:
    mode, settings = experiment.mode, experiment.settings
    _require_acting(experiment)
    map_name = experiment.bus.map or ("engine" if isinstance(experiment.plant, EnginePlant) else "etb")
    signal_map = SignalMap.load(beside(experiment.folder, map_name)) if mode in BUS_MODES else None
    _require_bus(experiment)
    record = _record_of(experiment)
    recorded = None if record is None else readable_record(record)
    plan: IdentifyPlan | TrackPlan | SeekPlan | MapPlan
    if isinstance(settings, SeekTask | MapTask):
        make: Any = SeekPlan if isinstance(settings, SeekTask) else MapPlan
        plan, sample_s, envelope = make(settings, folder=experiment.folder, seed=experiment.seed), None, None
    else:
        # Over a bus the DBC of the recorded run gave the time between its samples.
        recorded_s = None if recorded is None else recorded.config.get("sample_s")
        sample_s = _sample_s(experiment, signal_map) if recorded_s is None else float(recorded_s)
        envelope = SafetyEnvelope.load(beside(experiment.folder, experiment.safety.envelope)).replace(cycle_s=sample_s)
        plan = _throttle_plan(settings, sample_s, experiment, envelope)
    if mode in _SIMULATED:
        simulated_plant(experiment, sample_s=sample_s, inputs=("duty",))  # a wrong preset, scale or limit shows itself
    checked = CheckedExperiment(
        experiment=experiment, plan=plan, sample_s=sample_s, envelope=envelope, signal_map=signal_map, record=record,
        recorded=recorded,
    )  # fmt: skip
    if signal_map is not None:
        _require_names(checked, signal_map)
    return replace(checked, loop=chosen_loop(experiment, signal_map))


def _record_of(experiment: Experiment) -> Path | None:
    if experiment.mode != "replay":
        return None
    if experiment.replay.record is None:
        raise ParameterError("mode = 'replay': needs [replay] record, the file of a run")
    return existing_file(beside(experiment.folder, experiment.replay.record))


def _require_acting(experiment: Experiment) -> None:
    """Refuse what would guard another plant: a limit that does not act must not pass for one."""
    is_engine, default = isinstance(experiment.plant, EnginePlant), SafetySettings()
    for name in ("envelope",) if is_engine else ("rate_cad", "rates", "limits"):
        value = getattr(experiment.safety, name)
        if value != getattr(default, name):
            why = (
                "for an engine: rate_cad, rates and limits guard it"
                if is_engine
                else "for a throttle: its envelope guards it"
            )
            raise ParameterError.of(f"safety.{name}", value, f"left out {why}")


def _require_bus(experiment: Experiment) -> None:
    bus, mode = experiment.bus, experiment.mode
    if mode in ("dry_run", "bench") and bus.connection is None:
        raise ParameterError(
            f"mode = {mode!r}: needs [bus] connection, for example 'socketcan:can0'",
            field="bus.connection", value=None, bound="given",
        )  # fmt: skip
    if mode in ("dry_run", "bench") and bus.pace == "step":
        raise ParameterError(
            f"bus.pace = 'step': must be 'real_time' with mode = {mode!r}; only a simulated node steps",
            field="bus.pace", value="step", bound="'real_time'",
        )  # fmt: skip


def _sample_s(experiment: Experiment, signal_map: SignalMap | None) -> float:
    plant, given = experiment.plant, getattr(experiment.plant, "sample_s", None)
    if isinstance(plant, EnginePlant) or signal_map is None or experiment.bus.pace == "step":
        return SAMPLE_S if given is None else float(given)
    if given is not None and abs(given / signal_map.cycle_s - 1.0) > 1e-9:
        raise ParameterError(
            f"plant.sample_s = {given:g}: must be {signal_map.cycle_s:g} s, the cycle time of {signal_map.trigger} in "
            f"{signal_map.dbc.file.name}, or left out; bus.pace = 'step' takes any",
            field="plant.sample_s", value=given, bound=f"{signal_map.cycle_s:g} s",
        )  # fmt: skip
    return signal_map.cycle_s


def _throttle_plan(
    settings: IdentifyTask | TrackTask, sample_s: float, experiment: Experiment, envelope: SafetyEnvelope
) -> IdentifyPlan | TrackPlan:
    if isinstance(settings, TrackTask):
        plan = TrackPlan(settings, sample_s=sample_s, folder=experiment.folder, envelope=envelope)
        low, high = float(plan.reference.angle_deg.min()), float(plan.reference.angle_deg.max())
        if not envelope.closed_deg <= low <= high <= envelope.open_deg:
            raise ParameterError.of(
                "track.reference", f"{low:g} to {high:g} deg",
                f"within the travel of the envelope, {envelope.closed_deg:g} to {envelope.open_deg:g} deg: a stop that "
                "is driven against stalls the motor",
            )  # fmt: skip
        return plan
    return IdentifyPlan(settings, sample_s=sample_s, seed=experiment.seed, folder=experiment.folder)


def simulated_plant(experiment: Experiment, *, sample_s: float | None, inputs: Sequence[str]) -> Plant:
    """Make the plant of ``simulate``, or of a node of our own."""
    plant, folder = experiment.plant, experiment.folder
    if isinstance(plant, EnginePlant):
        engine, steered = engine_named(plant.preset, folder), getattr(experiment.settings, "inputs", ("soc_cad",))
        cylinder = scaled(engine.cylinder, plant.scale, "plant")
        how: dict[str, Any] = {
            "limits": experiment.limit_names, "inputs": list(steered), "soc_scatter_cad": plant.soc_scatter_cad,
            "efficiency_noise_percent": plant.efficiency_noise_percent, "seed": experiment.seed,
        }  # fmt: skip
        try:
            if isinstance(experiment.settings, MapTask):
                bed = VirtualTestBed(cylinder, list(experiment.settings.axes), point=engine.point, **how)
                bed.require_cells(experiment.settings.axes)
                return bed
            return VirtualEngine(cylinder, engine.point, **how)
        except ParameterError as error:
            if error.field not in ("inputs", "limits"):
                raise
            table = "safety" if error.value in experiment.safety.limits else experiment.task
            raise error.reworded(f"{table}.{error}") from error
    sample_s = sample_s or SAMPLE_S
    body, fitted = moving_throttle_of(model_of(beside(folder, plant.preset)))
    return VirtualThrottle(
        scaled(body, plant.scale, "plant"), inputs=inputs, delay_samples=whole_delay_of(fitted, sample_s),
        sensors=sensors_of(plant.noise_deg), sample_s=sample_s, seed=experiment.seed,
    )  # fmt: skip


def _require_names(checked: CheckedExperiment, signal_map: SignalMap) -> None:
    """Refuse a map without what the task applies and measures."""
    experiment = checked.experiment
    seeks = isinstance(checked.plan, SeekPlan | MapPlan)
    inputs = tuple(checked.plan.start) if isinstance(checked.plan, SeekPlan | MapPlan) else ("duty",)
    needed = experiment.limit_names if seeks else ("sensed_angle_deg", "first_v", "second_v")
    if signal_map.input_names != inputs:
        raise ParameterError.of(
            f"{signal_map.file}: inputs", ", ".join(signal_map.input_names),
            f"{', '.join(inputs)}: so task = {experiment.task!r} calls what it commands",
        )  # fmt: skip
    if missing := [name for name in needed if name not in signal_map.value_names]:
        raise ParameterError.of(
            f"{signal_map.file}: measured values", ", ".join(signal_map.value_names),
            f"completed by {', '.join(missing)}: so task = {experiment.task!r} calls what it measures; map them",
        )  # fmt: skip
    if seeks and not signal_map.objective:
        raise DataError(
            f"{signal_map.file}: [[objective]] is missing: task = {experiment.task!r} needs a value and its weight"
        )
    if experiment.mode == "hil" and experiment.bus.connection is None and signal_map.state is not None:
        try:
            signal_map.state.codes()
        except ParameterError as error:
            raise error.reworded(f"{signal_map.file}: {error}") from error


described(CheckedExperiment, rows=lambda checked: checked.to_dict())
