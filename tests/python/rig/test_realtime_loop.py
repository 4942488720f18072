"""The real-time loop from Python: drives a throttle behind a bus, follows references, says what it did.

No test here asserts how late anything is: a busy machine may be late, and must count it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode
from mgdd.errors import ParameterError, RigError
from mgdd.results.labels import check_labels
from mgdd.rig.realtime import LoopMessage, RingTransport
from realtime_loops import becomes, driving, go, make_loop
from throttle_node import ANGLE, PERIOD_S, SENSORS, STATUS, ThrottleNode, patient_envelope


def test_drives_a_throttle_and_leaves_it_open() -> None:
    transport = RingTransport()
    with ThrottleNode.on(transport) as node:
        with make_loop(transport, reference_deg=30.0) as loop:
            assert loop.running
            go(loop)
            assert becomes(lambda: abs(node.angle_deg - 30.0) < 1.0)
            loop.set_reference(55.0)
            assert becomes(lambda: abs(node.angle_deg - 55.0) < 1.0)
            assert loop.mode == "run"
            assert node.commands[-1][1] == 1.0
        assert not loop.running
        assert becomes(lambda: transport.waiting_to_send == 0)
    assert node.commands[-5:] == [(0.0, 0.0)] * 5
    assert node.check.counts["wrong_crc"] == 0
    assert [(e.before, e.after, e.reason) for e in loop.events()] == [
        ("init", "armed", "requested"),
        ("armed", "run", "requested"),
        ("run", "init", "requested"),
    ]


@pytest.mark.parametrize("kind", ["guided", "sliding", "mgdd1"])
def test_every_controller_runs(kind: str) -> None:
    controllers: dict[str, Callable[[], Any]] = {
        "guided": lambda: GuidedPredictive(sample_s=PERIOD_S),
        "sliding": lambda: SlidingMode(sample_s=PERIOD_S),
        "mgdd1": Mgdd1,
    }
    envelope = patient_envelope(cycle_s=0.001 if kind == "mgdd1" else PERIOD_S)
    with driving(controllers[kind](), envelope=envelope, reference_deg=40.0) as (_, loop):
        assert becomes(lambda: loop.report()["fresh_cycles"] > 30)
        samples = loop.samples()
    driven = samples["asked_duty"].values[samples["mode"].values == "run"]
    assert driven.size > 0
    assert np.isfinite(driven).all()


def test_samples_are_labelled_and_continue() -> None:
    with driving(reference_deg=20.0) as (_, loop):
        assert becomes(lambda: loop.report()["cycles"] > 50)
        first = loop.samples()
        assert becomes(lambda: loop.report()["cycles"] > 80)
    second = loop.samples()
    for dataset in (first, second):
        check_labels(dataset)
    assert float(second["time_s"][0]) > float(first["time_s"][-1]) > float(first["time_s"][0]) == 0.0
    cycles = np.concatenate([first["cycle"].values, second["cycle"].values])
    assert (np.diff(cycles) >= 1).all()
    assert int((np.diff(cycles) - 1).sum()) <= loop.report()["missed"]
    np.testing.assert_allclose(first["time_s"].values / PERIOD_S, first["cycle"].values - cycles[0], atol=1e-6)
    assert set(np.unique(first["mode"])) >= {"init", "run"}
    assert loop.samples().sizes["time_s"] == 0


def test_the_report_adds_up() -> None:
    transport = RingTransport()
    with ThrottleNode.on(transport), make_loop(transport, sample_capacity=4) as loop:
        assert becomes(lambda: loop.report()["cycles"] > 40)
    report = loop.report()
    assert report["compute_us"]["count"] == report["cycles"]
    assert report["lateness_us"]["count"] >= report["cycles"]
    assert report["late"] <= report["missed"]
    for name in ("lateness_us", "compute_us", "age_us", "send_us"):
        h = report[name]
        assert 0.0 <= h["p50"] <= h["p99"] <= h["p99_9"] <= h["max"], name
    assert report["dropped_samples"] == report["cycles"] - 4
    assert report["bus"]["sent"] + report["bus"]["full"] == report["cycles"]
    assert report["schedule"]["realtime"] is False
    assert f"{report['cycles']} cycles of 2 ms" in loop.summary()


def test_queued_references_are_followed_in_order() -> None:
    transport = RingTransport()
    track = 20.0 + 0.1 * np.arange(1.0, 201.0)
    with ThrottleNode.on(transport), make_loop(transport, reference_deg=20.0) as loop:
        loop.queue_references(track)
        assert loop.queued_references == 200
        go(loop)
        assert becomes(lambda: loop.queued_references == 0)
        assert becomes(lambda: loop.samples()["reference_deg"].values[-1:].tolist() == [track[-1]])
        loop.set_reference(11.0)
        assert becomes(lambda: loop.samples()["reference_deg"].values[-1:].tolist() == [11.0])


def test_what_a_controller_learnt_comes_back() -> None:
    pid = Pid(sample_s=PERIOD_S)
    before = dict(pid.state)
    with driving(pid, reference_deg=40.0) as (_, loop):
        assert becomes(lambda: loop.report()["fresh_cycles"] > 50)
        assert dict(pid.state) == before
    assert dict(pid.state) != before


def test_a_reference_that_is_not_renewed_aborts() -> None:
    with driving(reference_timeout_s=0.3, reference_deg=30.0) as (_, loop):
        loop.set_reference(31.0)
        assert becomes(lambda: loop.mode == "limp")
        assert loop.reason == "aborted"
        assert loop.report()["reference_timeouts"] >= 1


def test_bad_arguments_are_refused() -> None:
    transport = RingTransport()
    with pytest.raises(ParameterError, match=r"sample_s = 0\.001 s: must be 0\.002 s, the period of the loop"):
        make_loop(transport, Pid())
    with pytest.raises(ParameterError, match="angle_deg is read from no signal"):
        make_loop(transport, measurements=[SENSORS])
    with pytest.raises(ParameterError, match="must belong to one message"):
        make_loop(transport, measurements=[STATUS, SENSORS, LoopMessage(can_id=0x120, signals={})])
    with pytest.raises(ParameterError, match="signals"):
        make_loop(transport, measurements=[STATUS, LoopMessage(can_id=0x122, signals={"speed": ANGLE})])
    with pytest.raises(ParameterError, match="fixed"):
        make_loop(transport, measurements=[STATUS, SENSORS, LoopMessage(can_id=1, signals={}, fixed=[(ANGLE, 1.0)])])
    with pytest.raises(ParameterError, match="controller"):
        make_loop(transport, object())
    with pytest.raises(ParameterError, match="transport"):
        make_loop("can0")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="stop_frames"):
        make_loop(transport, stop_frames=0)
    loop = make_loop(transport)  # what was refused has taken nothing
    with pytest.raises(RigError, match="serves another loop"):
        make_loop(transport)
    with pytest.raises(ParameterError, match="finite"):
        loop.set_reference(float("nan"))
    with pytest.raises(ParameterError, match="finite"):
        loop.queue_references([1.0, float("inf")])
    with pytest.raises(RigError, match="do not fit"):
        loop.queue_references(np.zeros(70_000))
    assert loop.queued_references == 0
