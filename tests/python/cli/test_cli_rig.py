"""`mgdd rig` from the shell: hub, node, run, check, record, export, in a terminal, as text and as JSON."""

import json
import os
import pty
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from mgdd.cli import main
from mgdd.rig import read_record
from typed import Capsys

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
        (["node", "--bus", BUS], "no answer there"),
        (["node", "--bus", "can0"], "bus = 'can0': must be INTERFACE:CHANNEL"),
        (["node", "--bus", BUS, "--map", "etp"], "no such file: shipped maps are etb, engine, surrogate"),
        (["node", "--bus", BUS, "--duration-s", "-1"], "--duration-s = -1: must be > 0"),
        (["node", "--bus", BUS, "--period-ms", "0"], "--period-ms = 0: must be > 0"),
        (["node", "--bus", BUS, "--sample-ms", "nan"], "--sample-ms = nan: must be > 0"),
        (["node", "--bus", BUS, "--map", "surrogate"], "must be those of a virtual throttle"),
        (["node", "--bus", BUS, "--envelope", "etb_nod"], "no shipped envelope 'etb_nod': did you mean 'etb_node'"),
        (["node", "--bus", BUS, "--truth", "truth.xls"], "the ending must be one of .csv"),
        (
            ["node", "--bus", "virtual:cli", "--map", "engine", "--period-ms", "0.01"],
            "period_s = 1e-05: must be >= 1e-4 s",
        ),
    ],
)
def test_wrong_options_are_named(arguments: list[str], text: str, capsys: Capsys) -> None:
    assert main(["rig", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_a_port_that_is_taken_is_named(capsys: Capsys) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert main(["rig", "hub", "--port", str(port)]) == 2
    said = capsys.readouterr().err
    assert f"127.0.0.1:{port}: the hub cannot listen there" in said
    assert "--port 0 takes a free one" in said


def test_a_node_ends_in_time_and_says_what_it_did(tmp_path: Path, capsys: Capsys) -> None:
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


TRACK = """
kind = "experiment"
format = 1
task = "track"
[track]
reference = "step:20:35"
controller = "pid"
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "track.toml"
    path.write_text(TRACK)
    return path


def in_terminal(command: list[str]) -> str:
    """Run a command in a terminal; give what a person sees."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"}
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    seen = b""
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # how Linux says that the other side has closed
            break
        if not part:
            break
        seen += part
    os.close(ours)
    assert process.wait(60.0) == 0
    return seen.decode(errors="replace")


def test_a_terminal_gets_progress_and_then_the_result(file: Path, tmp_path: Path) -> None:
    seen = in_terminal([sys.executable, "-m", "mgdd", "rig", "run", str(file), "--folder", str(tmp_path / "one")])
    assert "track, simulate: duty 0." in seen
    assert seen.rindex("settling_ms") > seen.rindex("track, simulate: duty 0.")


@pytest.mark.slow
def test_a_quiet_terminal_gets_the_result_alone(file: Path, tmp_path: Path) -> None:
    quiet = in_terminal(
        [sys.executable, "-m", "mgdd", "rig", "run", str(file), "--folder", str(tmp_path / "two"), "--quiet"]
    )
    assert "track, simulate" not in quiet
    assert "settling_ms" in quiet


def test_a_pipe_gets_text_or_one_object(file: Path, tmp_path: Path, capsys: Capsys) -> None:
    assert main(["rig", "run", str(file), "--folder", str(tmp_path / "one")]) == 0
    text = capsys.readouterr().out
    assert "settling_ms" in text
    assert "of 1500" not in text
    assert main(["rig", "run", str(file), "--folder", str(tmp_path / "two"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["mode"], said["timing"]["cycles"], said["interrupted"]) == ("simulate", 1500, False)
    assert said["folder"] == str(tmp_path / "two")
    assert main(["rig", "replay", str(tmp_path / "two"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["same"] is True


def test_the_default_folder_is_new_for_every_run(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["rig", "run", str(file), "--json", "--quiet"]) == 0
    folder = Path(json.loads(capsys.readouterr().out)["folder"])
    assert folder.parts[0] == "mgdd-runs"
    assert folder.name.startswith("track-simulate-")
    assert (folder / "result.json").is_file()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "away.toml"], "away.toml"),
        (["check", "away.toml"], "away.toml"),
        (["run", "FILE", "--arm"], "--arm = True: must be left out with mode = 'simulate'"),
        (["run", "FILE", "--mode", "bench"], "needs [bus] connection"),
        (["run", "FILE", "--mode", "replay"], "needs [replay] record"),
        (["replay", "."], "holds no experiment.toml"),
        (["export", "away.rec", "run.csv"], "away.rec"),
        (["record", "new.rec", "--bus", "nowhere"], "INTERFACE:CHANNEL"),
        (["record", "new.rec", "--bus", "virtual:x", "--duration-s", "-1"], "--duration-s = -1: must be > 0 s"),
        (["run", "FILE", "--connection", "virtual:x"], "--connection does not act here; mode = 'simulate' has no bus"),
        (["check", "FILE", "--pace", "step"], "--pace does not act here; mode = 'simulate' has no bus"),
        (["run", "FILE", "--record", "run.rec"], "--record does not act here; mode = 'simulate' replays nothing"),
        (
            ["run", "FILE", "--mode", "bench", "--connection", "virtual:x", "--pace", "real_time"],
            "drives real hardware: give --arm, and a --key-file or a confirmation",
        ),
        (["run", "FILE", "--key-file", "key.txt"], "--key-file = 'key.txt': must be left out with mode = 'simulate'"),
    ],
)
def test_bad_input_is_named(
    file: Path, arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: Capsys,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    given = [str(file) if word == "FILE" else word for word in arguments]
    assert main(["rig", *given, "--json", "--quiet"]) == 2
    captured = capsys.readouterr()
    assert said in json.loads(captured.out)["error"]["message"]
    assert said in captured.err
    assert not (tmp_path / "mgdd-runs").exists()


def test_check_prints_what_is_compared_before_a_bench(file: Path, capsys: Capsys) -> None:
    """Inputs, time limits and the whole envelope: the list before a run on a bench asks for them."""
    assert main(["rig", "check", str(file), "--mode", "hil"]) == 0
    said = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines() if " " in line)
    assert said["inputs"] == "duty"
    assert "first_v" in said["values"]
    assert float(said["timeouts_ms.ETB_Cmd"]) == 20.0
    assert float(said["envelope.duty_limit"]) == 0.8
    assert said["envelope.bus_fault_from"] == "passive"


def test_a_recording_lasts_as_long_as_was_asked(tmp_path: Path) -> None:
    """The clock starts when the bus is open: importing python-can takes longer than a short recording."""
    can = pytest.importorskip("can")
    from mgdd.rig.can import transport

    stop, slow = threading.Event(), transport.connected

    def send() -> None:
        with can.Bus(interface="virtual", channel="lasts") as bus:
            while not stop.wait(0.01):
                bus.send(can.Message(arbitration_id=0x321, data=b"x", is_extended_id=False))

    def late(*given: Any) -> Any:
        time.sleep(0.4)
        return slow(*given)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(transport, "connected", late)
            file = str(tmp_path / "new.rec")
            assert main(["rig", "record", file, "--bus", "virtual:lasts", "--duration-s", "0.3", "--json"]) == 0
    finally:
        stop.set()
        sender.join()
    assert read_record(file).frames.sizes["frame"] > 5


def test_an_export_that_cannot_be_written_names_its_target(file: Path, tmp_path: Path, capsys: Capsys) -> None:
    assert main(["rig", "run", str(file), "--folder", str(tmp_path / "run"), "--quiet"]) == 0
    target = tmp_path / "away" / "run"
    assert main(["rig", "export", str(tmp_path / "run" / "run.rec"), str(target), "--kind", "csv"]) == 2
    assert f"{target}: No such file or directory" in capsys.readouterr().err


@pytest.mark.slow
def test_without_the_extra_a_simulation_runs_and_a_bus_names_it(file: Path, tmp_path: Path) -> None:
    blocked = "import sys; sys.modules.update(can=None, cantools=None)"
    blocked += "\nfrom mgdd.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", blocked, "rig", "run", str(file), "--folder", str(tmp_path / "run"), "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([*command, "--mode", "hil"], capture_output=True, text=True)
    assert done.returncode == 2
    assert 'pip install "mgdd[can]"' in json.loads(done.stdout)["error"]["message"]
