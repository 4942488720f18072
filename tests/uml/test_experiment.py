"""An experiment over vcan whose loop has a raw socket of its own: run by tests/python/rig/test_rig_uml.py."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from mgdd import _core
from mgdd.errors import RigError
from mgdd.rig import Experiment, SafetyEnvelope, SignalMap, read_record, run_experiment
from mgdd.rig.experiment import check_experiment, core_track
from mgdd.rig.experiment.stand import Cycle
from patient_bench import patient_experiment

CHANNEL = "vcan0"
COMMAND, STATUS, SENSORS = 0x120, 0x121, 0x122
CONTROLLER, PASSIVE = 0x04, 0x30
HALF_STEP = 2.6e-4  # of a duty in the command


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Experiment]:
    """An experiment with a node in a process of its own, deaf to error frames, on a kernel that ticks every 10 ms."""
    folder = tmp_path_factory.mktemp("bench")
    experiment = patient_experiment(folder, "sine:30:10:2", cycle_ms=20)
    patient = dict.fromkeys(("missed_deadlines", "bad_frames", "sensor_cycles"), 1e6)
    envelope = SafetyEnvelope.load("etb_node").replace(stall_s=10.0, sensor_slope_v_per_s=1e5, **patient)
    (folder / "node.toml").write_text(envelope.to_toml())
    command = [sys.executable, "-m", "mgdd", "rig", "node", "--map", str(folder / "map.toml"), "--seed", "1"]
    command += ["--envelope", str(folder / "node.toml")]
    command += ["--bus", f"socketcan:{CHANNEL}?ignore_rx_error_frames=true"]
    with pytest.MonkeyPatch.context() as patch, subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as node:
        patch.setattr(core_track, "LEAD_S", 2.0)
        assert node.stdout is not None
        assert "ready" in node.stdout.readline()
        yield experiment.with_mode("hil", connection=f"socketcan:{CHANNEL}")
        node.terminate()
        node.communicate(timeout=10.0)


@pytest.fixture
def peer() -> Iterator[can.BusABC]:
    with can.Bus(interface="socketcan", channel=CHANNEL, ignore_config=True) as bus:
        yield bus


def at_cycle(number: int, act: Callable[[], None]) -> Callable[[Cycle], None]:
    def watch(cycle: Cycle) -> None:
        if cycle.number == number:
            act()

    return watch


def frames_of(folder: Path, identifier: int, *, received: bool) -> Any:
    frames = read_record(folder / "run.rec").frames
    chosen = (frames["id"] == identifier) & (frames["received"].astype(bool) == received)
    return frames.isel(frame=chosen.to_numpy())


def test_a_run_is_recorded_whole_and_replays_bit_for_bit(known: Experiment, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    result = run_experiment(known, folder)
    assert result.figures["loop"] == "core"
    assert result.figures["loop_reason"] == "a bus at real-time pace, by raw socket"
    assert np.abs(result.dataset["sensed_angle_deg"] - 30.0).max() > 3.0  # it was driven
    loop = result.counters["loop"]
    assert loop["commands_heard"] == loop["bus"]["sent"] > 100
    assert (loop["foreign"], loop["bus"]["lost"]) == (0, 0)

    record = read_record(folder / "run.rec")
    assert len(frames_of(folder, COMMAND, received=True)["id"]) == 0
    sent = frames_of(folder, COMMAND, received=False)
    assert len(sent["id"]) >= loop["bus"]["sent"]
    for measured in (STATUS, SENSORS):
        assert len(frames_of(folder, measured, received=False)["id"]) == 0
        assert len(frames_of(folder, measured, received=True)["id"]) > 100

    rows = record.samples["loop"]  # every command that the loop says it sent is there, in order, with its duty
    taken = rows["duty"].to_numpy()[rows["send_result"].to_numpy() == _core.rig.send_results.index("sent")]
    (command,) = SignalMap.load(known.folder / "map.toml").commands.values()
    said = np.array([command.read(bytes(data))["duty"] for data in sent["data"].to_numpy()])
    places = [
        k for k in range(len(said) - len(taken) + 1) if np.allclose(said[k : k + len(taken)], taken, atol=HALF_STEP)
    ]
    assert np.abs(taken).max() > 0.02
    assert places

    again = run_experiment(known.with_mode("replay", record=folder / "run.rec"))
    assert again.counters["replay"]["different"] == 0
    assert again.counters["replay"]["samples"] == np.isfinite(rows["asked_duty"].to_numpy()).sum() > 100
    assert again.figures["sensed_mse_deg2"] == result.figures["sensed_mse_deg2"]


def test_another_sender_of_the_command_ends_the_run(known: Experiment, peer: can.BusABC, tmp_path: Path) -> None:
    def send() -> None:
        peer.send(can.Message(arbitration_id=0x3FF, data=bytes(8), is_extended_id=False))  # nobody's, and no fault
        peer.send(can.Message(arbitration_id=COMMAND, data=bytes(8), is_extended_id=True))
        peer.send(can.Message(arbitration_id=COMMAND, data=bytes(8), is_extended_id=False))

    with pytest.raises(RigError, match="0x120 arrived, which this host sends: two nodes have one identifier"):
        run_experiment(known, tmp_path / "run", watch=at_cycle(20, send))
    rows = read_record(tmp_path / "run" / "run.rec").samples["loop"]
    assert (rows["bridge_open"].to_numpy()[-5:] == 1.0).all()


def test_strangers_that_send_something_else_do_no_harm(known: Experiment, peer: can.BusABC, tmp_path: Path) -> None:
    def send() -> None:
        peer.send(can.Message(arbitration_id=0x3FF, data=bytes(8), is_extended_id=False))
        peer.send(can.Message(arbitration_id=COMMAND, data=bytes(8), is_extended_id=True))
        peer.send(can.Message(arbitration_id=0x100, data=bytes(8), is_error_frame=True, is_extended_id=False))

    result = run_experiment(known, tmp_path / "run", watch=at_cycle(20, send))
    assert not result.interrupted
    assert result.counters["loop"]["bus"]["error_frames"] == 1
    assert len(frames_of(tmp_path / "run", 0x3FF, received=True)["id"]) == 1


def test_an_error_frame_reaches_the_loop(known: Experiment, peer: can.BusABC, tmp_path: Path) -> None:
    def send() -> None:
        data = [0, PASSIVE, 0, 0, 0, 0, 0, 0]
        peer.send(can.Message(arbitration_id=CONTROLLER, data=data, is_error_frame=True, is_extended_id=False))

    # The host names the state of the bus, or finds the gate closed by it: whichever looks first.
    with pytest.raises(RigError, match=r"error_passive|bus_fault"):
        run_experiment(known, tmp_path / "run", watch=at_cycle(20, send))
    rows = read_record(tmp_path / "run" / "run.rec").samples["loop"]
    assert rows["bus_state"].to_numpy().max() == _core.rig.bus_states.index("passive")
    assert rows["bridge_open"].to_numpy()[-1] == 1.0


def test_a_dry_run_hears_the_commands_of_another(known: Experiment, peer: can.BusABC, tmp_path: Path) -> None:
    def send() -> None:
        peer.send(can.Message(arbitration_id=COMMAND, data=bytes(8), is_extended_id=False))

    dry = known.with_mode("dry_run", connection=f"socketcan:{CHANNEL}")
    result = run_experiment(dry, tmp_path / "run", watch=at_cycle(20, send))
    assert result.figures["loop_reason"].endswith("raw socket")
    assert (result.counters["commands"], result.counters["loop"]["bus"]["sent"]) == (0, 0)
    assert read_record(tmp_path / "run" / "run.rec").frames["received"].to_numpy().all()
    assert len(frames_of(tmp_path / "run", COMMAND, received=True)["id"]) == 1
    assert np.nanmax(np.abs(result.dataset["asked_duty"])) > 0.02


def test_the_same_by_a_bridge(known: Experiment, tmp_path: Path) -> None:
    """With an option the frames go through Python, as over any other interface."""
    bridged = known.with_mode("hil", connection=f"socketcan:{CHANNEL}?receive_own_messages=false")
    checked = check_experiment(bridged)
    assert checked.to_dict()["loop_reason"] == "a bus at real-time pace, by bridge"
    result = run_experiment(checked, tmp_path / "run")
    assert (
        len(frames_of(tmp_path / "run", COMMAND, received=False)["id"]) >= result.counters["loop"]["bus"]["sent"] > 100
    )
