"""`mgdd rig hub | node` from the shell: what they say when ready, at the end, and about wrong options."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from mgdd.cli import main

pytest.importorskip("can", reason="the extra `can` is not installed")
pytest.importorskip("cantools", reason="the extra `can` is not installed")

BUS = "socketcand:can0?host=127.0.0.1&port=1"


def test_a_hub_says_its_bus_and_at_the_end_its_counts() -> None:
    command = [sys.executable, "-m", "mgdd", "rig", "hub", "--port", "0", "--json", "--fault", "drop:p=0.5"]
    hub = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert hub.stderr is not None
    bus = hub.stderr.readline().strip()
    assert bus.startswith("socketcand:can0?host=127.0.0.1&port=")
    port = int(bus.rpartition("=")[2])
    with socket.create_connection(("127.0.0.1", port)) as client:
        assert client.recv(16) == b"< hi >"
        client.sendall(b"< open can0 >")
        assert client.recv(16) == b"< ok >"
        client.sendall(b"< rawmode >")
        assert client.recv(16) == b"< ok >"
        client.sendall(b"< send 120 2 1 f >< send nonsense >< send 121 8 1 >< send 7 0 >< unknown >")
        client.sendall(b"< echo >")
        client.shutdown(socket.SHUT_WR)
        client.recv(16)
    hub.send_signal(signal.SIGTERM)
    out, _ = hub.communicate(timeout=30)
    assert hub.returncode == 0
    counts = json.loads(out)
    assert counts["frames"] == 2  # a frame whose bytes are not all there is none
    assert 0 <= counts["drop"] <= 2


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["hub", "--fault", "dropp:p=1"], "fault = 'dropp': must be one of drop"),
        (["hub", "--port", "70000"], "port = 70000: must be in [0, 65535]"),
        (["hub", "--bit-rate", "1"], "bit_rate = 1: must be in [1e3, 1e8] bit/s"),
        (["node", "--bus", BUS], "nobody answers there"),
        (["node", "--bus", "can0"], "bus = 'can0': must be INTERFACE:CHANNEL"),
        (["hub", "--fault", "drop:q=1"], "with keys p, id, from_s, until_s, ms, client, class"),
        (["node", "--bus", BUS.replace("port=1", "port=one")], "port = 'one': must be a whole number"),
        (["node", "--bus", BUS, "--map", "etp"], "no such file: shipped maps are etb, engine, surrogate"),
        (["node", "--bus", BUS, "--duration-s", "-1"], "--duration-s = -1: must be > 0"),
        (["node", "--bus", BUS, "--period-ms", "0"], "--period-ms = 0: must be > 0"),
        (["node", "--bus", BUS, "--sample-ms", "nan"], "--sample-ms = nan: must be > 0"),
        (["node", "--bus", BUS, "--map", "surrogate"], "must be those of a virtual throttle"),
        (["node", "--bus", BUS, "--fault", "melted"], "kind = 'melted': must be one of"),
        (["node", "--bus", BUS, "--envelope", "etb_nod"], "no shipped envelope 'etb_nod': did you mean 'etb_node'"),
        (["node", "--bus", BUS, "--truth", "truth.xls"], "the ending must be one of .csv"),
        (
            ["node", "--bus", "virtual:cli", "--map", "engine", "--period-ms", "0.01"],
            "period_s = 1e-05: must be >= 1e-4 s",
        ),
    ],
)
def test_wrong_options_are_named(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rig", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_a_port_that_is_taken_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert main(["rig", "hub", "--port", str(port)]) == 2
    said = capsys.readouterr().err
    assert f"127.0.0.1:{port}: the hub cannot listen there" in said
    assert "--port 0 takes a free one" in said


def test_a_node_ends_in_time_and_says_what_it_did(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    truth = tmp_path / "truth.csv"
    options = ["--bus", "virtual:cli-node", "--duration-s", "0.2", "--truth", str(truth), "--json"]
    assert main(["rig", "node", *options]) == 0
    assert {number: signal.getsignal(number) for number in before} == before
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert said["mode"] == "init"
    assert said["samples"] >= 20
    assert "etb on virtual:cli-node: ready" in err
    assert len(truth.read_text(encoding="utf-8").splitlines()) == said["samples"] + 1
