"""Two processes and a hub: six ways to die, and the same bits as in one process."""

from __future__ import annotations

import csv
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mgdd.control import Pid
from mgdd.errors import RigError
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.io import throttle_log
from mgdd.loop import EngineBench, Measurement, Reference, VirtualThrottle, run_seeker
from mgdd.optimize import ExtremumSeeking, FitOptions
from mgdd.rig import CanRig, VirtualNode
from mgdd.rig.base import Rig

pytest.importorskip("can", reason="the extra `can` is not installed")
pytest.importorskip("cantools", reason="the extra `can` is not installed")

HOST = Path(__file__).parent / "support" / "doomed_host.py"
WAYS = ("exception", "nan", "sigint", "sigterm", "sigkill", "hang")
LIMIT_S = 0.4
LIMP_HOME_DEG, BAND_DEG = 8.0, 2.0


# --- six ways to die ----------------------------------------------------------------------------------------


class Bench:
    """A node with a clock, its truth, and the host that dies next, already started."""

    def __init__(self, bus: str, truth: Path) -> None:
        self.bus, self._truth = bus, truth
        self._hosts: dict[str, subprocess.Popen[str]] = {}
        self.start(WAYS[0])

    def start(self, way: str) -> subprocess.Popen[str]:
        if way not in self._hosts:
            self._hosts[way] = subprocess.Popen(
                [sys.executable, str(HOST), way, self.bus],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        return self._hosts[way]

    def truth(self) -> dict[str, np.ndarray]:
        with self._truth.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        if rows and None in rows[-1].values():
            del rows[-1]  # a line that is being written
        names = ("monotonic_ns", "driven", "angle_deg")
        return {name: np.array([float(row[name]) for row in rows]) for name in names}

    def stop(self) -> None:
        for host in self._hosts.values():
            host.kill()
            host.communicate()


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    truth = tmp_path_factory.mktemp("node") / "truth.csv"
    with VirtualNode("etb", seed=1, truth=truth) as node:
        made = Bench(node.bus, truth)
        try:
            yield made
        finally:
            made.stop()


@pytest.mark.parametrize("way", WAYS)
def test_whatever_the_host_dies_of_the_plate_goes_home(bench: Bench, way: str) -> None:
    host = bench.start(way)
    later = WAYS[WAYS.index(way) + 1 :]
    assert host.stdin is not None
    assert host.stdout is not None
    assert host.stdout.readline() == "ready\n"
    print("go", file=host.stdin, flush=True)
    assert host.stdout.readline() == "open\n"
    if way.startswith("sig"):
        dying_ns = time.monotonic_ns()
        host.send_signal(getattr(signal, way.upper()))
    else:
        dying_ns = int(host.stdout.readline().split()[1])
    if way != "hang":
        host.wait(30.0)
    if later:
        bench.start(later[0])  # it imports while the plate falls
    deadline_ns = dying_ns + round(LIMIT_S * 1e9)
    time.sleep(max(0.0, (deadline_ns - time.monotonic_ns()) * 1e-9) + 0.1)
    truth = bench.truth()
    until = time.monotonic() + 20.0
    while truth["monotonic_ns"][-1] < deadline_ns + 50e6:  # a machine under load: the log comes, later
        assert time.monotonic() < until
        time.sleep(0.1)
        truth = bench.truth()
    host.kill()  # the one that hangs
    host.communicate()

    time_ns, angle = truth["monotonic_ns"], truth["angle_deg"]
    before = (time_ns > dying_ns - 0.3e9) & (time_ns <= dying_ns)
    after = time_ns >= deadline_ns
    assert angle[before].max() > 35.0, "it was not open"
    assert after.sum() > 5
    np.testing.assert_array_less(np.abs(angle[after] - LIMP_HOME_DEG), BAND_DEG)
    assert not truth["driven"][after].any()


# --- the same bits ------------------------------------------------------------------------------------------

N_SAMPLES = 400


@pytest.fixture(scope="module")
def duty() -> np.ndarray:
    """A sweep from 0.2 to 4 Hz, so that the plate opens and closes."""
    time_s = np.arange(N_SAMPLES) * 5e-3
    return 0.15 + 0.2 * np.sin(2.0 * np.pi * (0.2 * time_s + 0.95 * time_s**2))


def respond(rig: Rig, duty: np.ndarray) -> np.ndarray:
    out = []
    for value in duty:
        rig.apply({"duty": float(value)})
        out.append(rig.measure().values["sensed_angle_deg"])
    return np.array(out)


def on_grid(values: np.ndarray | float, scale: float, offset: float = 0.0) -> np.ndarray:
    """What a signal makes of a value."""
    return np.round((np.asarray(values) - offset) / scale) * scale + offset


def plant(sample_s: float = 5e-3) -> VirtualThrottle:
    return VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=sample_s, seed=7)


def identified(duty: np.ndarray, angle: np.ndarray) -> dict[str, float]:
    log = throttle_log(np.arange(len(duty)) * 5e-3, duty, angle)
    fit = fit_pseudo_wiener(log, limp_home_deg=8.0, options=FitOptions(n_starts=1, max_iterations=30))
    return dict(fit.parameters)


@pytest.mark.slow
def test_identification_over_the_bus_is_that_of_one_process(duty: np.ndarray) -> None:
    """Rounded by hand to the grids of both signals, the plant without a bus gives the same bits."""
    own, straight = plant(), []
    for value in on_grid(duty, 0.0005):
        own.apply({"duty": float(value), "bridge_open": 0.0})
        straight.append(own.measure().values["sensed_angle_deg"])
    angle = on_grid(np.array(straight), 0.01, -20.0)
    with VirtualNode("etb", step=True, seed=7) as node, CanRig("etb", node.bus, mode="hil", timeout_s=20.0) as rig:
        over_the_bus = respond(rig, duty)
    np.testing.assert_array_equal(over_the_bus, angle)
    with CanRig("etb", plant=plant()) as rig:
        np.testing.assert_array_equal(respond(rig, duty), angle)
    assert identified(duty, over_the_bus) == identified(duty, angle)
    free = identified(duty, np.array(straight))
    for name, value in identified(duty, over_the_bus).items():
        assert value == pytest.approx(free[name], rel=0.05, abs=1e-6), name


def follow(rig: Rig, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """A controller along a reference on any rig."""
    controller, measured = Pid(), 8.0
    duties, angles = [], []
    for wanted in reference.angle_deg:
        duties.append(controller.step(float(wanted), measured))
        rig.apply({"duty": duties[-1]})
        measured = rig.measure().values["sensed_angle_deg"]
        angles.append(measured)
    return np.array(duties), np.array(angles)


@pytest.mark.slow
def test_tracking_over_the_bus_is_that_of_one_process() -> None:
    reference = Reference(angle_deg=np.r_[np.full(150, 20.0), np.full(150, 40.0)])
    own, controller, measured = plant(1e-3), Pid(), 8.0
    angles = []
    for wanted in reference.angle_deg:
        duty = controller.step(float(wanted), measured)
        own.apply({"duty": float(on_grid(duty, 0.0005)), "bridge_open": 0.0})
        measured = float(on_grid(own.measure().values["sensed_angle_deg"], 0.01, -20.0))
        angles.append(measured)
    node = VirtualNode("etb", step=True, seed=7, sample_ms=1.0)
    with node, CanRig("etb", node.bus, mode="hil", timeout_s=20.0) as rig:
        duties, over_the_bus = follow(rig, reference)
    np.testing.assert_array_equal(over_the_bus, angles)
    assert duties[-1] == duty
    assert abs(over_the_bus[-30:].mean() - 40.0) < 1.0


@pytest.mark.slow
def test_seeking_on_the_engine_bench_over_the_bus() -> None:
    def seeker() -> ExtremumSeeking:
        return ExtremumSeeking(start=-12.0, lower=-30.0, upper=10.0)

    with CanRig(
        "engine", plant=EngineBench(limits=["cov_imep_percent", "p_max_bar", "dp_max_bar_per_cad"], seed=4)
    ) as rig:
        simulated = run_seeker(rig, seeker(), 250)
    with (
        VirtualNode("engine", step=True, seed=4) as node,
        CanRig("engine", node.bus, mode="hil", timeout_s=20.0) as rig,
    ):
        over_the_bus = run_seeker(rig, seeker(), 250)
    xr.testing.assert_identical(over_the_bus.dataset, simulated.dataset)
    straight = run_seeker(EngineBench(seed=4), seeker(), 250)
    assert over_the_bus.summary["final_cad"] == pytest.approx(straight.summary["final_cad"], abs=0.3)


def test_a_node_that_cannot_start_says_why() -> None:
    with pytest.raises(RigError, match=r"mgdd rig node did not start: .*did you mean 'from_s'"):
        VirtualNode("etb", faults=["jammed:form_s=1"]).start()


@pytest.mark.slow
def test_a_node_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    code = (
        "import sys; from mgdd.rig import VirtualNode\n"
        "node = VirtualNode('etb', truth=sys.argv[1]); node.start()\n"
        "print(*(process.pid for process, _ in node._started), flush=True)\n"
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


def test_measured_values_of_a_bus_with_faults_are_right_or_missing(duty: np.ndarray) -> None:
    """A hub that loses, doubles and changes frames never brings a wrong number."""
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
