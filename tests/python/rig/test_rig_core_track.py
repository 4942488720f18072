"""Tracking over a bus on the real-time loop of the core: its messages, its record and replay, and how it ends."""

import json
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.control import Pid
from mgdd.errors import ParameterError, RigError
from mgdd.loop import VirtualThrottle
from mgdd.rig import Experiment, SafetyEnvelope, SignalMap, read_record, run_experiment
from mgdd.rig.can.node_core import NodeCore, node_plant
from mgdd.rig.can.signal_map import LOOP_NAMES, loop_messages
from mgdd.rig.can.transport import changed
from mgdd.rig.experiment import check_experiment, core_track
from mgdd.rig.experiment.core_samples import RUN, LoopSamples
from mgdd.rig.experiment.core_track import WatchedBus
from mgdd.rig.experiment.stand import Cycle
from mgdd.rig.realtime import Frame, RealtimeLoop, RingTransport
from patient_bench import patient_experiment
from realtime_loops import becomes
from user_buses import dbc_of, write_bus

pytestmark = pytest.mark.slow


# Another bus than the shipped one: Motorola, volts as they are, a duty of other sign and range, modes with gaps.
DBC = dbc_of(
    """\
BO_ 2566848001 Cmd: 8 PC
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" BOX
 SG_ Alive : 8|4@1+ (1,0) [0|15] "" BOX
 SG_ Mode : 14|3@0+ (2,3) [0|0] "" BOX
 SG_ Duty : 23|16@0- (-0.01,5) [0|0] "%" BOX
BO_ 513 Sens: 6 BOX
 SG_ Angle : 7|16@0+ (0.01,-5) [0|0] "deg" PC
 SG_ A : 16|12@1+ (0.00125,0) [0|0] "V" PC
 SG_ B : 28|12@1+ (0.00125,0) [0|0] "V" PC
""",
    {2566848001: 2, 513: 2},
    'VAL_ 513 A 4095 "invalid" ;\n',
)
MAP = """kind = "signal_map"
format = 1
dbc = "own.dbc"
trigger = "Sens"
[commands.Cmd]
timeout_ms = 20
e2e = { profile = "sae_j1850", data_id = 77, crc = "Crc", counter = "Alive" }
driven = { Mode = 17 }
safe = { Mode = 5, Duty = 0.0 }
[commands.Cmd.inputs]
duty = { signal = "Duty", unit = "%", scale = 0.01, lower = -0.5, upper = 0.75 }
[measurements.Sens.values]
sensed_angle_deg = { signal = "Angle", unit = "deg" }
first_v = { signal = "A", unit = "V" }
second_v = { signal = "B", unit = "V" }
"""


def own_map(folder: Path, text: str = MAP) -> SignalMap:
    return SignalMap.load(write_bus(folder, "own", DBC, text))


@pytest.mark.parametrize("which", ["shipped", "own"])
def test_the_loop_speaks_a_map_as_a_rig_does(which: str, tmp_path: Path) -> None:
    """The node of the package arms at its open-bridge frames, is driven by the others, and its duty is the loop's."""
    signal_map = SignalMap.load("etb") if which == "shipped" else own_map(tmp_path)
    command, measurements = loop_messages(signal_map)
    plant = VirtualThrottle(inputs=("duty", "bridge_open"), sample_s=0.002, seed=2)
    node, ring = NodeCore(node_plant(plant), signal_map), RingTransport()
    patient = dict.fromkeys(("missed_deadlines", "unsent_cycles", "largest_age_cycles"), 1e6)
    loop = RealtimeLoop(
        Pid(sample_s=0.002), ring, command=command, measurements=measurements, reference_deg=30.0, realtime=False,
        envelope=SafetyEnvelope(cycle_s=0.002, ramp_s=0.0, stall_s=10.0, sensor_slope_v_per_s=1e5, **patient),
        lock_memory=False,
    )  # fmt: skip
    states, frames = set(), list[tuple[str, Frame]]()

    def answered(wanted: str) -> bool:
        while (frame := ring.take(0.0)) is not None:
            now_ns = time.monotonic_ns()
            node.take(changed(frame, monotonic_ns=now_ns))
            for answer in node.sample(now_ns):
                ring.feed(changed(answer, monotonic_ns=time.monotonic_ns()))
            frames.append((node.gate.mode, frame))
            states.add(node.gate.mode)
        return node.gate.mode == wanted

    with loop:
        assert becomes(lambda: answered("armed"))
        assert becomes(lambda: answered("armed") and len(frames) > 60)
        assert becomes(lambda: answered("armed") and loop._core.request("arm") and loop.mode == "armed")
        assert becomes(lambda: loop._core.request("run") and answered("run"))
        assert becomes(lambda: answered("run") and abs(plant.measure().values["angle_deg"] - 30.0) < 1.0)
    assert answered("armed"), "after the frames of the stop"
    assert states == {"init", "armed", "run"}
    (own,) = signal_map.commands.values()
    driven = [own.read(frame.data)["duty"] for state, frame in frames if state == "run"]
    sent = loop.samples()
    sent = sent["duty"].to_numpy()[sent["mode"].to_numpy() == "run"]
    n = min(len(driven), len(sent))
    assert n > 10
    step = abs(own.signals["duty"].scale * own.signals["duty"].signal.layout.scale)
    np.testing.assert_allclose(
        driven[:n], np.clip(sent[:n], own.signals["duty"].lower, own.signals["duty"].upper), atol=0.51 * step
    )


def test_a_map_that_the_loop_cannot_say_is_refused_with_its_place(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="safe Duty of Cmd: must be 500, a duty of 0"):
        loop_messages(own_map(tmp_path, MAP.replace("Duty = 0.0", "Duty = 11.0")))
    known = own_map(tmp_path)
    (command,) = known.commands.values()
    with pytest.raises(ParameterError, match="safe of Cmd: must be given"):
        loop_messages(replace(known, commands={"Cmd": replace(command, safe={})}))
    with pytest.raises(ParameterError, match="one message with the input duty"):
        loop_messages(replace(known, commands={"a": command, "b": command}))


def test_the_file_decides_which_loop_runs_and_the_check_says_why(tmp_path: Path) -> None:
    known = patient_experiment(tmp_path)

    def chosen(experiment: Experiment, loop: str = "auto") -> tuple[Any, ...]:
        said = check_experiment(replace(experiment, settings=replace(experiment.settings, loop=loop))).to_dict()
        return said["loop"], said["loop_reason"]

    assert chosen(known) == ("core", "a bus at real-time pace, by bridge")
    assert chosen(known.with_mode("hil", connection="socketcan:can7")) == (
        "core", "a bus at real-time pace, by raw socket",
    )  # fmt: skip
    for connection in ("socketcan:can7?fd=true", "socketcand:can7?host=127.0.0.1&port=1", "virtual:can7"):
        assert chosen(known.with_mode("dry_run", connection=connection))[1].endswith(", by bridge")
    assert chosen(known, "python") == ("python", "track.loop = 'python'")
    assert chosen(known.with_mode("hil", pace="step")) == (
        "python", "bus.pace = 'step': every command brings one sample, without a clock",
    )  # fmt: skip
    assert chosen(known.with_mode("simulate")) == ("python", "mode = 'simulate': no bus")
    with pytest.raises(
        ParameterError, match=r"track.loop = 'core': must be 'auto' or 'python' here: mode = 'simulate'"
    ):
        chosen(known.with_mode("simulate"), "core")
    text = (tmp_path / "map.toml").read_text()
    (tmp_path / "map.toml").write_text(text.replace("DutyFF = 0.0 }", "DutyFF = 0.1 }"))
    loop, reason = chosen(known)
    assert loop == "python"
    assert "safe DutyFF of ETB_Cmd" in reason


@pytest.fixture(scope="module", autouse=True)
def patient() -> Iterator[None]:
    """Let a busy machine keep Python waiting."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(core_track, "LEAD_S", 2.0)
        yield


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any, list[Cycle]]:
    folder = tmp_path_factory.mktemp("core")
    cycles: list[Cycle] = []
    result = run_experiment(patient_experiment(folder, "sine:30:10:2"), folder / "run", watch=cycles.append)
    return folder / "run", result, cycles


def test_a_run_says_its_loop_and_its_times(run: tuple[Path, Any, list[Cycle]]) -> None:
    folder, result, cycles = run
    assert result.figures["loop"] == "core"
    timing = json.loads((folder / "timing.json").read_text())
    assert timing["loop"] == "core"
    for name in ("lateness_us", "compute_us", "age_us"):
        assert timing[name]["p50"] <= timing[name]["p99"] <= 1.34 * timing[name]["max"]
    assert {"missed", "late", "longest_row", "schedule"} <= set(timing)
    assert timing["cycles"] == len(cycles) > 100
    assert [cycle.number for cycle in cycles] == list(range(len(cycles)))
    assert np.abs(result.dataset["sensed_angle_deg"] - 30.0).max() > 5.0  # it was driven


def test_every_reference_reaches_its_grid_point(run: tuple[Path, Any, list[Cycle]]) -> None:
    folder, result, _ = run
    rows = read_record(folder / "run.rec").samples["loop"]
    driven = rows.isel(time_s=~np.isnan(rows["asked_duty"].to_numpy()))
    place = (driven["cycle"] - driven["cycle"][0]).to_numpy().astype(int)
    wanted = result.dataset["reference_deg"].to_numpy()
    inside = place < len(wanted)
    assert inside.sum() > 100
    np.testing.assert_array_equal(driven["reference_deg"].to_numpy()[inside], wanted[place[inside]])


def test_the_record_holds_frames_and_samples_and_replays_bit_for_bit(
    run: tuple[Path, Any, list[Cycle]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, result, cycles = run
    record = read_record(folder / "run.rec")
    ids = record.frames["id"].to_numpy()
    received = record.frames["received"].to_numpy().astype(bool)
    assert set(ids[~received]) == {0x120}
    assert {0x121, 0x122} <= set(ids[received])
    assert (ids == 0x120).sum() > len(cycles)
    duties = record.samples["rig"]["input.duty"].to_numpy()
    assert np.abs(duties).max() > 0.05
    assert main(["rig", "replay", str(folder), "--json", "--quiet"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["replay"]["different"] == 0
    assert said["replay"]["samples"] >= len(cycles)
    assert said["result"]["loop"] == "core"
    assert said["result"]["sensed_mse_deg2"] == result.figures["sensed_mse_deg2"]


def test_a_replay_sees_another_controller(run: tuple[Path, Any, list[Cycle]]) -> None:
    folder, _, _ = run
    known = Experiment.load(folder / "experiment.toml")
    other = replace(known, settings=replace(known.settings, controller="sliding_mode"))
    compared = run_experiment(other.with_mode("replay", record=folder / "run.rec")).counters["replay"]
    assert compared["different"] > 50
    assert compared["largest_difference"] > 1e-3


def test_a_watch_that_ends_the_run_keeps_what_was_done(tmp_path: Path) -> None:
    def watch(cycle: Cycle) -> None:
        if cycle.number == 20:
            raise KeyboardInterrupt

    known = patient_experiment(tmp_path)
    result = run_experiment(known, tmp_path / "run", watch=watch)
    assert result.interrupted
    assert 20 <= result.timing["cycles"] <= len(result.dataset["time_s"]) < 1000
    assert result.events[-1] == "safety gate: run -> init: requested"
    assert main(["rig", "replay", str(tmp_path / "run"), "--quiet"]) == 0


def test_an_exception_of_the_watch_ends_the_loop(tmp_path: Path) -> None:
    def watch(cycle: Cycle) -> None:
        if cycle.number == 20:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_experiment(patient_experiment(tmp_path), tmp_path / "run", watch=watch)
    rows = read_record(tmp_path / "run" / "run.rec").samples["loop"]
    assert (rows["bridge_open"].to_numpy()[-5:] == 1.0).all()
    assert rows["bridge_open"].to_numpy().min() == 0.0


def test_python_that_stands_still_opens_the_bridge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core_track, "LEAD_S", 0.5)

    def watch(cycle: Cycle) -> None:
        if cycle.number == 20:
            time.sleep(4.0)

    known = patient_experiment(tmp_path, "sine:30:5:0.5")
    with pytest.raises(RigError, match="Python stood still for 500 ms"):
        run_experiment(known, tmp_path / "run", watch=watch)
    rows = read_record(tmp_path / "run" / "run.rec").samples["loop"]
    driven = rows["cycle"].to_numpy()[rows["bridge_open"].to_numpy() == 0.0]
    assert 20 <= driven[-1] - driven[0] < 300  # and not the four seconds of it


def test_a_dry_run_transmits_nothing_and_steps_the_controller(tmp_path: Path) -> None:
    from mgdd.rig import VirtualNode

    known = patient_experiment(tmp_path, "sine:30:5:4")
    with VirtualNode(tmp_path / "map.toml", seed=1) as node:
        result = run_experiment(known.with_mode("dry_run", connection=node.bus), tmp_path / "run")
    assert (result.figures["loop"], result.counters["commands"]) == ("core", 0)
    assert read_record(tmp_path / "run" / "run.rec").frames["received"].to_numpy().all()
    assert np.nanmax(np.abs(result.dataset["asked_duty"])) > 0.05
    assert (result.dataset["duty"] == 0.0).all()
    assert main(["rig", "replay", str(tmp_path / "run"), "--quiet"]) == 0


def test_a_node_that_says_several_times_that_it_does_not_drive_is_believed() -> None:
    signal_map = SignalMap.load("etb")
    status = signal_map.measurements["ETB_Status"]

    def told(state: int, number: int = status.message.frame_id) -> Frame:
        known = dict.fromkeys(status.signals, 20.0)
        return Frame(id=number, data=status.payloads(known, {"State": state}, {"duty": 0.1})[0])

    class Frames:
        name = "frames"

        def __init__(self, frames: list[Frame]) -> None:
            self.left = frames

        def receive(self, timeout_s: float) -> Frame | None:  # noqa: ARG002 - never waits
            return self.left.pop(0) if self.left else None

    for states, failed in (([2, 3, 3, 2, 3, 4], False), ([2, 3, 4, 3], True), ([2, 2, 2, 1], False)):
        bus: Any = Frames([frame for state in states for frame in (told(state), told(3, 0x400))])
        watched = WatchedBus(bus, signal_map)
        while watched.receive(0.0) is not None:
            pass
        assert watched.failed == failed, states


def test_a_run_keeps_of_a_cycle_no_more_than_its_result_needs() -> None:
    """A day at 1 kHz is 86 million cycles; mappings of their 25 numbers take 1.5 kB each."""
    rows, names = 4000, (*LOOP_NAMES.values(), "asked_duty", "duty", "applied_duty", "reference_deg", "compute_us")
    samples = LoopSamples(
        None, row=lambda _: None, listener=lambda _: None, value_names=["sensed_angle_deg"], samples=rows, sample_s=1e-3
    )
    tracemalloc.start()
    try:
        for begin in range(0, rows, 100):
            columns = {name: np.arange(100.0) + begin for name in names}
            columns |= {"cycle": np.arange(100) + begin, "state": np.full(100, RUN), "deadline_ns": np.arange(100)}
            samples.take(columns)
            samples.tell()
            if begin == 0:
                at_first = tracemalloc.get_traced_memory()[0]
        kept = tracemalloc.get_traced_memory()[0] - at_first
    finally:
        tracemalloc.stop()
    assert kept < 100 * rows
    found = samples.columns()
    assert np.array_equal(found["asked_duty"], np.arange(rows - 1.0))
    assert np.array_equal(found["sensed_angle_deg"], np.arange(1.0, rows))
