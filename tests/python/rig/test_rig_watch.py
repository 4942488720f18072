"""The live page: what it reads, what it refuses, and what its stop button does, in a real browser too."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest

from browser import CHROMIUM, Browser
from mgdd.cli import main
from mgdd.errors import DataError
from mgdd.io import extras
from mgdd.rig import Experiment, Recorder, SignalMap, read_record, run_experiment, watch
from mgdd.rig.live.live_data import LiveData, thinned
from mgdd.rig.live.page import _status_text
from mgdd.rig.live.record_tail import RecordTail
from mgdd.rig.live.sources import RecordSource, source_of
from mgdd.rig.realtime import Frame

MARKUP = "<img src=x onerror=alert(1)>"
LIMP_HOME_DEG = 8.0
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no chromium: tools/system_packages.sh browser")


def becomes(condition: Any, within_s: float = 60.0) -> bool:
    until = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True


def small_record(path: Path, rows: int = 3) -> Path:
    with Recorder(path) as record:
        for row in range(rows):
            record.sample("plate", {"angle_deg": 10.0 + row, "duty": 0.1 * (row + 2)})
        record.event("safety gate", "init -> armed: requested")
    return path


def shown(path: Path) -> tuple[LiveData, str]:
    tail, data = RecordTail(path), LiveData()
    data.take(tail.look(), tail.start_ns)
    return data, tail.trouble


# --- what is read -------------------------------------------------------------------------------------------


def test_a_tail_reads_what_the_reader_of_the_core_reads(tmp_path: Path) -> None:
    path = small_record(tmp_path / "run.rec", 500)
    data, trouble = shown(path)
    table, known = data.tables["plate"], read_record(path).samples["plate"]
    assert trouble == ""
    assert np.array_equal(table.values[: table.rows], np.column_stack([known["angle_deg"], known["duty"]]))
    np.testing.assert_allclose(table.time_s[: table.rows], known["time_s"], atol=1e-9)
    assert (data.gate, data.reason) == ("armed", "requested")
    assert list(data.panels()) == ["plate angle [deg]", "duty [-]"]


def test_a_record_that_grows_is_read_from_where_the_last_look_ended(tmp_path: Path) -> None:
    path, data = tmp_path / "run.rec", LiveData()
    with Recorder(path) as record:
        tail = RecordTail(path)
        for rows in range(1, 5):
            record.sample("plate", {"angle_deg": float(rows)})
            data.take(tail.look(), tail.start_ns)
            assert data.tables["plate"].rows == rows
        assert tail.look().rows == {}


def test_a_record_of_which_half_an_entry_is_written_is_read_when_it_is_whole(tmp_path: Path) -> None:
    whole = small_record(tmp_path / "run.rec").read_bytes()
    path = tmp_path / "half.rec"
    path.write_bytes(whole[:-5])
    tail = RecordTail(path)
    assert (len(tail.look().events), tail.trouble) == (0, "")
    path.write_bytes(whole)
    assert len(tail.look().events) == 1


def test_a_record_that_was_cut_or_replaced_is_read_anew(tmp_path: Path) -> None:
    path, data = small_record(tmp_path / "run.rec", 200), LiveData()
    tail = RecordTail(path)
    data.take(tail.look(), tail.start_ns)
    os.truncate(path, path.stat().st_size // 2)
    data.take(tail.look(), tail.start_ns)
    assert 0 < data.tables["plate"].rows < 150
    small_record(tmp_path / "new.rec", 7).replace(path)
    data.take(tail.look(), tail.start_ns)
    assert data.tables["plate"].rows == 7


@pytest.mark.parametrize(
    ("at", "new", "why"),
    [
        (0, b"PK", "not a record"),
        (8, b"\x02", "another version"),
        (50, b"\xff", "damaged"),
        (-9, b"\xff", "damaged at"),
    ],
)
def test_a_foreign_or_damaged_record_is_told_by_its_trouble(tmp_path: Path, at: int, new: bytes, why: str) -> None:
    path = small_record(tmp_path / "run.rec")
    raw = bytearray(path.read_bytes())
    raw[at : at + len(new) or None] = new
    path.write_bytes(raw)
    _, trouble = shown(path)
    assert why in trouble
    path.unlink()
    assert "No such file" in shown(path)[1]


def test_rows_beyond_the_most_that_is_kept_push_the_oldest_out(monkeypatch: pytest.MonkeyPatch) -> None:
    from mgdd.rig.live import live_data

    monkeypatch.setattr(live_data, "_MOST_ROWS", 5000)
    table = live_data.Table(["angle_deg"])
    for begin in range(0, 20_000, 500):
        table.add(np.arange(begin, begin + 500.0), np.arange(begin, begin + 500.0)[:, None])
    assert 500 <= table.rows <= 10_000
    assert np.array_equal(table.time_s[: table.rows], np.arange(20_000.0 - table.rows, 20_000.0))


def test_thinning_keeps_every_peak_and_bears_gaps() -> None:
    time_s, values = np.arange(10_007.0), np.zeros(10_007)
    values[[5000, 9000]] = 7.0, -7.0
    values[6000:6200] = np.nan
    thin_s, thin = thinned(time_s, values, 300)
    assert len(thin) == 600
    assert (np.diff(thin_s) >= 0.0).all()
    assert (np.nanmax(thin), np.nanmin(thin)) == (7.0, -7.0)
    assert np.isnan(thin).any()
    assert thinned(time_s[:5], values[:5])[1].tolist() == [0.0] * 5


def test_times_of_a_loop_are_counted_with_the_deadlines_it_missed(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.rec") as record:
        for lateness_us in (5.0,) * 999 + (400.0,):
            record.sample("loop", {"lateness_us": lateness_us, "compute_us": 9.0, "missed": 1.0, "mode": 2, "cause": 0})
    data, _ = shown(tmp_path / "run.rec")
    assert data.missed == 1000
    assert (data.gate, data.cause) == ("run", "none")
    assert 5.0 <= data.quantile_us("lateness", 0.5) < 8.0
    assert data.quantile_us("lateness", 1.0) == 400.0


def test_a_seeker_is_shown_with_its_interval(tmp_path: Path) -> None:
    text = 'kind = "experiment"\nformat = 1\ntask = "seek"\n[seek]\ncycles = 40\nguide = "{}"\n'
    for guide, has_sd in (("curve", True), ("feed_forward", False)):
        run_experiment(Experiment.from_toml(text.format(guide)), tmp_path / guide)
        source = source_of(tmp_path / guide)
        assert isinstance(source, RecordSource)
        source.look()
        seeker = source.data.tables["seeker"]
        assert seeker.rows == 40
        assert np.isfinite(seeker.values[: seeker.rows]).all(axis=0).tolist() == [True, has_sd]
        first = source.data.panels()["timing [°CA aTDC]"][0]
        assert (first.label, first.sd_column) == ("start of combustion, estimate", 1)


def test_frames_of_a_bus_are_read_by_the_map() -> None:
    etb = SignalMap.load("etb")
    from mgdd.loop import VirtualThrottle
    from mgdd.rig import CanRig

    heard: list[Frame] = []
    with CanRig(etb, plant=VirtualThrottle(inputs=["duty", "bridge_open"], seed=1), on_frame=heard.append) as rig:
        for _ in range(20):
            rig.apply({"duty": 0.3})
            rig.measure()
    data, tail = LiveData(etb), RecordTail(Path("none"))
    data.take(tail.look()._replace(frames=heard), 0)
    table = data.tables["bus"]
    assert table.rows >= 20
    assert table.values[table.rows - 1, table.columns.index("value.sensed_angle_deg")] > 8.0
    assert data.last_commands.keys() == {"ETB_Cmd"}


def test_names_with_markup_are_shown_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / f"{MARKUP.replace('/', '')}.rec"
    with Recorder(path) as record:
        record.sample(MARKUP, {f"$$\\alpha$$ {MARKUP}": 3.0})
        record.event("safety gate", f"init -> {MARKUP}: {MARKUP}")
        record.event(MARKUP, MARKUP)
    source = RecordSource(path)
    source.look()
    text = _status_text(source, MARKUP)
    assert "<img" not in text
    assert text.count("&lt;img") >= 5


# --- stop without a browser -----------------------------------------------------------------------------------

WRITER = """
import sys, time
from mgdd.rig import Recorder
with Recorder(sys.argv[1]) as record:
    record.sample("plate", {"angle_deg": 40.0})
    try:
        print("ready", flush=True)  # whoever reads it may stop us at once
        time.sleep(60.0)
    except KeyboardInterrupt:
        record.event("note", "ended by Ctrl-C")
"""


def test_stop_is_ctrl_c_to_the_process_that_writes_the_record_and_to_no_other(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    with subprocess.Popen([sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        source = RecordSource(path)
        source.look()
        with path.open("rb"):  # who only reads is not meant
            assert source.state == f"running, process {writer.pid}"
            source.stop()
            source.stop()  # a double click
        assert writer.wait(30.0) == 0
    assert read_record(path).events["text"].to_numpy().tolist() == ["ended by Ctrl-C"]
    assert f"SIGINT sent to process {writer.pid}" in source.said
    late = RecordSource(path)
    late.stop()
    assert "nothing to stop" in late.said


def test_stop_of_a_process_that_ignores_ctrl_c_is_sigterm_at_the_next_click(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mgdd.rig.live import sources

    monkeypatch.setattr(sources, "_PATIENCE_S", 0.0)
    path = tmp_path / "run.rec"
    deaf = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{WRITER}"
    with subprocess.Popen([sys.executable, "-c", deaf, path], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        source = RecordSource(path)
        source.stop()
        assert source.state == f"running, process {writer.pid}"
        source.stop()
        assert writer.wait(30.0) == -signal.SIGTERM


def test_stop_on_a_bus_sends_safe_frames_that_go_on_from_the_counter_of_the_host() -> None:
    from mgdd._core.rig import E2eCheck
    from mgdd.rig.can.link import Sender
    from mgdd.rig.can.transport import CanTransport

    etb, name = SignalMap.load("etb"), f"virtual:watch{time.monotonic_ns()}"
    command = etb.commands["ETB_Cmd"]
    assert command.e2e is not None
    check, sender = E2eCheck(command.e2e), Sender()
    with CanTransport.parse(name) as host:
        source = source_of(name)
        try:
            for _ in range(5):
                for frame in sender.frames(command, command.payloads({"duty": 0.3}, command.driven)):
                    check.push(frame.data)
                    host.send(frame)
            status = etb.measurements["ETB_Status"]
            answers = Sender().frames(status, status.payloads({"sensed_angle_deg": 20.0}, {}) * 5)
            for frame in answers:
                host.send(frame)
            assert becomes(lambda: (source.look(), source.data.last_commands)[1])
            source.stop()
            sent = [host.receive(5.0) for _ in range(5)]
            assert becomes(lambda: source.said)
        finally:
            source.close()
    assert "5 safe frames" in source.said
    assert all(frame is not None and command.rests(frame.data) for frame in sent)
    assert [check.push(frame.data) for frame in sent if frame is not None] == ["ok"] * 5


# --- the server ---------------------------------------------------------------------------------------------


def test_what_is_neither_run_nor_record_nor_bus_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DataError, match=r"holds no run\.rec"):
        source_of(tmp_path)
    assert main(["rig", "watch", str(tmp_path / "no.rec"), "--no-browser"]) == 2
    assert "no such folder or record" in capsys.readouterr().err
    assert main(["rig", "watch", "--port", "70000"]) == 2


def test_without_bokeh_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def missing(module: str) -> None:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    monkeypatch.setattr(extras, "importlib", SimpleNamespace(import_module=missing))
    assert main(["rig", "watch", "--no-browser"]) == 2
    assert 'pip install "mgdd[watch]"' in capsys.readouterr().err
    with pytest.raises(ImportError, match=r"mgdd\[watch\]"):
        watch()


def test_a_port_in_use_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = small_record(tmp_path / "run.rec")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["rig", "watch", str(path), "--no-browser", "--port", str(port)]) == 2
    assert f"port {port} is in use: name another one, 0 takes a free one" in capsys.readouterr().err


@pytest.fixture
def page(tmp_path: Path) -> Iterator[str]:
    with watch(small_record(tmp_path / "run.rec")) as opened:
        assert opened.url in opened._repr_html_()
        yield opened.url


def test_the_page_is_on_this_machine_alone_and_behind_its_word(page: str) -> None:
    address = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{20,})", page)
    assert address is not None
    with urlopen(page) as answer:
        text = answer.read().decode()
    assert "mgdd rig watch" in text
    assert not re.findall(r'(?:src|href)="https?://(?!127\.0\.0\.1|localhost)', text)  # nothing from elsewhere
    for other in ("", "/", "/ws", "/metadata"):
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"http://127.0.0.1:{address[1]}{other}")
    upgrade = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "eA==",
    }
    stranger = HTTPConnection("127.0.0.1", int(address[1]))
    stranger.request("GET", f"/{address[2]}/ws", headers={**upgrade, "Origin": "http://evil.example"})
    assert stranger.getresponse().status == 403
    stranger.close()
    own = [a for a in _addresses() if not a.startswith("127.")]
    for address_of_machine in own:
        with pytest.raises(OSError, match="refused"):
            socket.create_connection((address_of_machine, int(address[1])), 5.0).close()


def test_a_name_of_somebody_else_that_means_this_machine_gets_nothing(page: str) -> None:
    """DNS rebinding: the browser takes the page for one of the attacker, and sends his name as its host."""
    address = re.fullmatch(r"http://127\.0\.0\.1:(\d+)(/[\w-]{20,})", page)
    assert address is not None
    port, path = int(address[1]), address[2]

    def answer(host: str | None, what: str) -> int:
        with socket.create_connection(("127.0.0.1", port), 10.0) as stream:
            said = "" if host is None else f"Host: {host}\r\n"
            stream.sendall(f"GET {what} HTTP/1.1\r\n{said}Connection: close\r\n\r\n".encode())
            return int(stream.recv(64).split()[1])

    for host in ("127.0.0.1", f"127.0.0.1:{port}", f"localhost:{port}", "LOCALHOST", "localhost:5006"):
        assert answer(host, path) == 200, host
    for host in (f"evil.example:{port}", "evil.example", f"127.0.0.1.evil.example:{port}", f"localhost.evil:{port}",
                 "10.0.0.1", f"evil.example:{port}@127.0.0.1", None):  # fmt: skip
        for what in (path, f"{path}/ws", "/static/js/bokeh.min.js", f"{path}/metadata"):
            assert answer(host, what) in (400, 403), (host, what)


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="no /proc")
def test_the_word_stands_in_the_arguments_of_no_process(tmp_path: Path) -> None:
    told, browser = tmp_path / "told", tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\nprintf "%s" "$*" > "{told}.new"\nmv "{told}.new" "{told}"\n', encoding="utf-8")
    browser.chmod(0o700)
    command = [sys.executable, "-m", "mgdd", "rig", "watch", str(small_record(tmp_path / "run.rec"))]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "BROWSER": str(browser)}
    ) as watching:
        assert watching.stdout is not None
        url = watching.stdout.readline().strip()
        assert becomes(told.exists)
        word, arguments = url.rpartition("/")[2], told.read_text(encoding="utf-8")
        assert len(word) > 20
        assert word not in arguments
        for process in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                assert word.encode() not in process.read_bytes()
            except OSError:
                continue
        way = Path(arguments.removeprefix("file://"))
        assert f'url={url}"' in way.read_text(encoding="utf-8")
        assert way.parent.stat().st_mode & 0o077 == 0
        assert os.getpriority(os.PRIO_PROCESS, watching.pid) > os.getpriority(os.PRIO_PROCESS, 0)
        watching.send_signal(signal.SIGINT)
        watching.wait(30.0)
    assert not way.exists()


def _addresses() -> list[str]:
    try:
        return sorted({info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)})
    except OSError:
        return []


# --- in a browser -------------------------------------------------------------------------------------------


@pytest.mark.slow
@needs_chromium
def test_bad_records_and_markup_make_a_clear_page(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    with Recorder(path) as record:
        record.sample(MARKUP, {f"$$x$$ {MARKUP}_deg": 3.0})
        record.event("safety gate", f"init -> {MARKUP}: {MARKUP}")
        with watch(path) as opened, Browser(opened.url, tmp_path / "one") as browser:
            assert browser.shows(f"running, process {os.getpid()}")
            assert browser.shows(MARKUP)
            assert browser.evaluate("document.querySelectorAll('img').length") == 0
            record.event("note", "it has grown")
            assert browser.shows("it has grown")
            path.write_bytes(b"another file altogether")
            assert browser.shows("not a record of mgdd")
            path.unlink()
            small_record(path)
            assert browser.shows("over: no process writes it")
            opened.close()
            assert becomes(lambda: browser.evaluate("document.getElementById('lost').style.display") == "block")


@pytest.mark.slow
@needs_chromium
def test_a_click_on_stop_brings_the_plate_home_and_browsers_leave_the_loop_alone(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    command = [sys.executable, "-m", "mgdd.rig.live.simulated", str(path), "5"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as rig:
        try:
            assert becomes(path.exists)

            def rows() -> Any:
                return read_record(path).samples["loop"]

            def cycles_of_two_seconds() -> tuple[int, int]:
                begin = rows().sizes["time_s"]
                time.sleep(2.0)
                new = rows().isel(time_s=slice(begin, None))
                return new.sizes["time_s"], int(new["missed"].sum())

            with (
                watch(path) as opened,
                Browser(opened.url, tmp_path / "one") as first,
                Browser(opened.url, tmp_path / "two") as second,
            ):
                assert first.shows("requested")
                assert second.shows("requested")
                second.freeze()  # a slow one, then a killed one
                assert sum(cycles_of_two_seconds()) >= 300
                second.kill()
                assert sum(cycles_of_two_seconds()) >= 300
                assert first.shows("deadlines missed")
                # The loop goes on whatever its pages do; how late it was is in the benchmark, not in a test.
                assert float(rows()["mode"][-1]) == 2.0
                first.click("STOP")
                assert first.shows("aborted")
                assert rig.wait(30.0) == 0
                assert first.shows("over: no process writes it")
                assert first.shows(f"SIGINT sent to process {rig.pid}")
        finally:
            rig.kill()
    last = rows().isel(time_s=-1)
    assert float(last["bridge_open"]) == 1.0
    assert abs(float(last["sensed_angle_deg"]) - LIMP_HOME_DEG) < 1.0
