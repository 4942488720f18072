"""Recorded frames through the checks of a bus."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bus_node import ETB, node, rig_on
from mgdd._core.rig import Frame
from mgdd.errors import DataError, RigError
from mgdd.loop import Measurement, VirtualThrottle
from mgdd.rig import CanRig, Recorder, RecordingRig, ReplayRig, SignalMap
from mgdd.rig.base import Rig
from mgdd.rig.can.replay_bus import ReplayBus
from mgdd.rig.can.transport import changed
from mgdd.rig.exchange import RigRecord


def answers(rig: Rig, duties: list[float]) -> list[Measurement]:
    out = []
    for duty in duties:
        rig.apply({"duty": duty})
        out.append(rig.measure())
    return out


def recorded_run(duties: list[float]) -> tuple[list[Frame], list[Measurement]]:
    frames: list[Frame] = []
    with CanRig(ETB, plant=VirtualThrottle(inputs=["duty", "bridge_open"], seed=2), on_frame=frames.append) as rig:
        return frames, answers(rig, duties)


def replayed(frames: list[Frame], duties: list[float], *, strict: bool = True) -> tuple[list[Measurement], ReplayBus]:
    bus = ReplayBus(frames, ETB, strict=strict)
    with CanRig(ETB, bus, mode="replay") as rig:
        return answers(rig, duties), bus


DUTIES = [0.1 * (k % 7) for k in range(30)]


def test_recorded_frames_pass_the_same_checks_and_give_the_same_measurements() -> None:
    frames, measured = recorded_run(DUTIES)
    assert sum(not frame.received for frame in frames) == 5 + 30 + 5  # three usable safe frames arm it
    again, _ = replayed(frames, DUTIES)
    assert [m.values for m in again] == [m.values for m in measured]
    assert [m.applied for m in again] == [m.applied for m in measured]
    frames[-20] = changed(frames[-20], data=bytes(8))
    with pytest.raises(RigError):  # a changed frame of the record is seen as on the bus
        replayed(frames, DUTIES)


def test_a_replay_of_frames_says_where_a_command_differs() -> None:
    frames, measured = recorded_run(DUTIES)
    other = [*DUTIES]
    other[12] += 0.25
    with pytest.raises(RigError, match=r"command 12: {'duty': 0.75.*} was asked for, {'duty': 0.5} is recorded"):
        replayed(frames, other)
    again, bus = replayed(frames, other, strict=False)
    assert [number for number, _, _ in bus.differences] == [12]
    assert [m.values for m in again] == [m.values for m in measured]
    with pytest.raises(RigError, match="the record ends after 30 commands"):
        replayed(frames, [*DUTIES, 0.0])


def test_a_run_in_real_time_is_replayed_from_its_file(tmp_path: Path) -> None:
    """Frames through the checks, and measurements as they were: both from one record."""
    file = tmp_path / "patient.toml"  # neither node nor host lets go when this machine stops for a moment
    (tmp_path / "etb.dbc").write_bytes(ETB.dbc.file.read_bytes())
    text = ETB.file.read_text(encoding="utf-8").replace("timeout_ms = 20", "timeout_ms = 20000")
    file.write_text(text, encoding="utf-8")
    patient, file = SignalMap.load(file), tmp_path / "run.rec"
    with Recorder(file) as recorder, node("record", step=False, signal_map=patient):
        live = rig_on("record", signal_map=patient, on_frame=recorder.frame)
        with RecordingRig(live, lambda row: recorder.sample("rig", row)) as rig:
            measured = [dict(live.values) for live in answers(rig, DUTIES)]
    with CanRig(patient, ReplayBus.read(file, patient), mode="replay") as again:
        np.testing.assert_equal([dict(m.values) for m in answers(again, DUTIES)], measured)
    with ReplayRig(RigRecord.read(file)) as again:
        np.testing.assert_equal([dict(m.values) for m in answers(again, DUTIES)], measured)
    with pytest.raises(DataError, match="has no table 'bench': it has rig"):
        RigRecord.read(file, table="bench")
