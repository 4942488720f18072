"""Real processes that are stopped and go on: nothing that waited meanwhile may move the plate."""

import contextlib
import csv
import os
import random
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

from mgdd.rig import VirtualNode

HOST = Path(__file__).parents[1] / "support" / "steady_host.py"
PARTS = ("node", "hub", "host")
WAYS = ("goes on", "falls silent", "arms again")  # what the host does while another part stands still
LIMIT_S = 0.02  # of the command, in etb.toml
WATCHED_S = 0.2
SAMPLE_S = 0.005
LONG_S = 30.0


class Row(NamedTuple):
    """A sample of the truth."""

    at_s: float
    driven: bool
    angle_deg: float
    reason: str


class Bench:
    """Hub, node and host, each in a process of its own, and the truth of the node."""

    def __init__(self, node: VirtualNode, truth: Path) -> None:
        hub, served = (child.process for child in node._started)
        self.host = subprocess.Popen(
            [sys.executable, str(HOST), node.bus], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.parts = {"hub": hub, "node": served, "host": self.host}
        self._truth = truth.open(encoding="utf-8", newline="")
        self._rest = ""
        self._names: list[str] = []
        self._expect("ready")

    def rows(self) -> list[Row]:
        """Give the samples that were written since the last call."""
        *lines, self._rest = (self._rest + self._truth.read()).split("\n")
        if not self._names and lines:
            self._names = lines.pop(0).strip().split(",")
        read = [dict(zip(self._names, line, strict=True)) for line in csv.reader(lines)]
        return [
            Row(float(row["monotonic_ns"]) * 1e-9, row["driven"] == "1", float(row["angle_deg"]), row["reason"])
            for row in read
        ]

    def say(self, line: str, *, wait: bool = True) -> None:
        """Tell the host what to do."""
        assert self.host.stdin is not None
        print(line, file=self.host.stdin, flush=True)
        if wait:
            self._expect(line)

    def drive(self) -> float:
        """Arm and drive until the plate is open; give its angle."""
        self.say("drive")
        until = time.monotonic() + LONG_S
        while time.monotonic() < until:
            time.sleep(0.02)
            if (rows := self.rows()) and rows[-1].driven and rows[-1].angle_deg > 20.0:
                return rows[-1].angle_deg
            if rows and not rows[-1].driven and time.monotonic() > until - LONG_S + 2.0:
                self.say("drive")  # a machine that stalled in between
                until = time.monotonic() + LONG_S
        raise AssertionError("the plate does not open")

    def freeze(self, part: str, duration_s: float, way: str) -> list[Row]:
        """Stop a part for a while, and give what happened from its stop on."""
        process = self.parts[part]
        self.rows()
        os.kill(process.pid, signal.SIGSTOP)
        stopped_s = time.monotonic()
        if part != "host" and way != "goes on":
            self.say("drive" if way == "arms again" else "stop")
            if way == "arms again":  # the handshake and some commands wait, and nobody means them any more
                time.sleep(max(0.0, stopped_s + duration_s - 3.0 * LIMIT_S - time.monotonic()))
                self.say("stop")
        time.sleep(max(0.0, stopped_s + duration_s - time.monotonic()))
        os.kill(process.pid, signal.SIGCONT)
        self.went_on_s = time.monotonic()
        rows: list[Row] = []
        while not rows or rows[-1].at_s < self.went_on_s + WATCHED_S:
            assert time.monotonic() < self.went_on_s + LONG_S
            time.sleep(0.02)
            rows += self.rows()
        return [row for row in rows if row.at_s > stopped_s + LIMIT_S + 2.0 * SAMPLE_S]

    def close(self) -> None:
        self.host.kill()
        self.host.communicate()
        self._truth.close()

    def _expect(self, line: str) -> None:
        assert self.host.stdout is not None
        assert select.select([self.host.stdout], [], [], LONG_S)[0]
        assert self.host.stdout.readline().strip() == line


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with benched(tmp_path_factory.mktemp("node")) as made:
        yield made


@contextlib.contextmanager
def benched(folder: Path) -> Iterator[Bench]:
    truth = folder / "truth.csv"
    with VirtualNode("etb", seed=1, truth=truth) as node:
        made = Bench(node, truth)
        try:
            yield made
        finally:
            made.close()


def stale_moves(bench: Bench, count: int, longest_s: float, seed: int) -> list[str]:
    """Freeze parts at random, and name the cases in which the plate was driven by what had waited."""
    chance, out = random.Random(seed), []
    for number in range(count):
        part, way = PARTS[number % 3], WAYS[number // 3 % 3]
        duration_s = 0.05 * (longest_s / 0.05) ** chance.random()
        before_deg = bench.drive()
        time.sleep(0.05 * chance.random())
        rows = bench.freeze(part, duration_s, way)
        driven = [row for row in rows if row.driven]
        if driven:
            highest = max(row.angle_deg for row in driven)
            out.append(
                f"{number}: {part} for {duration_s:.3f} s, the host {way}: driven for {len(driven)} samples, from "
                f"{before_deg:.1f} to {highest:.1f} deg"
            )
    return out


def test_nothing_that_waited_moves_the_plate(bench: Bench) -> None:
    assert stale_moves(bench, 10, 0.3, seed=21) == []


def test_a_gap_of_its_clock_is_a_fault_of_the_node_until_it_is_armed_again(bench: Bench) -> None:
    bench.drive()
    rows = bench.freeze("node", 0.15, "goes on")
    assert {row.reason for row in rows} == {"deadlines"}
    assert bench.drive() > 20.0


@pytest.mark.slow
def test_in_many_freezes_nothing_that_waited_moves_the_plate(tmp_path: Path) -> None:
    """On two benches at once, which mostly wait; each part in each way three times, on each (200 were run once)."""

    def of_one(seed: int) -> list[str]:
        (folder := tmp_path / str(seed)).mkdir()
        with benched(folder) as bench:
            return stale_moves(bench, 27, 3.0, seed)

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(of_one, (22, 23))) == [[], []]
