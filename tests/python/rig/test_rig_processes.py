"""Two processes and a hub: the same bits as in one process, and how a node starts and ends."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import RigError
from mgdd.loop import Measurement, VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking
from mgdd.rig import CanRig, VirtualNode


@pytest.mark.slow
def test_seeking_on_the_virtual_engine_over_the_bus() -> None:
    def seeker() -> ExtremumSeeking:
        return ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0))

    with CanRig(
        "engine", plant=VirtualEngine(limits=["cov_imep_percent", "p_max_bar", "dp_max_bar_per_cad"], seed=4)
    ) as rig:
        simulated = run_seeker(rig, seeker(), 250)
    with (
        VirtualNode("engine", step=True, seed=4) as node,
        CanRig("engine", node.bus, mode="hil", timeout_s=20.0) as rig,
    ):
        over_the_bus = run_seeker(rig, seeker(), 250)
    xr.testing.assert_identical(over_the_bus.dataset, simulated.dataset)
    straight = run_seeker(VirtualEngine(seed=4), seeker(), 250)
    assert over_the_bus.summary["final_soc_cad"] == pytest.approx(straight.summary["final_soc_cad"], abs=0.3)


def test_a_node_that_cannot_start_says_why() -> None:
    with pytest.raises(RigError, match=r"mgdd rig node did not start: .*did you mean 'from_s'"):
        VirtualNode("etb", faults=["jammed:form_s=1"]).start()


@pytest.mark.slow
def test_a_node_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    code = (
        "import sys; from mgdd.rig import VirtualNode\n"
        "node = VirtualNode('etb', truth=sys.argv[1]); node.start()\n"
        "print(*(child.process.pid for child in node._started), flush=True)\n"
        "sys.stdin.readline()\n"
    )
    truth = tmp_path / "truth.csv"
    run = subprocess.Popen(
        [sys.executable, "-c", code, str(truth)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert run.stdout is not None
    children = [int(word) for word in run.stdout.readline().split()]
    assert len(children) == 2
    run.kill()
    run.communicate()
    until = time.monotonic() + 20.0
    while any(is_running(child) for child in children):
        assert time.monotonic() < until
        time.sleep(0.05)


def is_running(process: int) -> bool:
    stat = Path(f"/proc/{process}/stat")
    try:
        return stat.read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_measured_values_of_a_bus_with_faults_are_right_or_missing() -> None:
    """A hub that loses, doubles and changes frames never brings a wrong number."""
    duty = 0.15 + 0.2 * np.sin(np.pi * (0.002 * np.arange(120) + 4.75e-5 * np.arange(120) ** 2))
    faults = ["drop:p=0.02", "duplicate:p=0.02", "corrupt:p=0.02,id=0x120", "corrupt:p=0.02,id=0x121"]
    seen: list[Measurement] = []
    with (
        VirtualNode("etb", seed=7, bus_faults=faults) as node,
        CanRig("etb", node.bus, mode="hil", timeout_s=5.0) as rig,
    ):
        for index in range(1200):  # each frame has its chance: among 120 of them there may be no wrong one
            if index >= 120 and rig.counters["checks"]["ETB_Status"]["wrong_crc"] > 0:
                break
            try:
                rig.apply({"duty": float(duty[index % 120])})
                seen.append(rig.measure())
            except RigError:
                rig.arm()
    assert rig.counters["checks"]["ETB_Status"]["wrong_crc"] > 0
    assert len(seen) > 30
    for measured in seen:
        assert -21.0 < measured.values["sensed_angle_deg"] < 100.0
        assert abs(measured.applied["duty"]) <= 0.36
