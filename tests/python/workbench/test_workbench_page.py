"""The workbench in Debian's Chromium: real clicks and uploads; what the server gives away; what a hostile file does."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
from bokeh.client import pull_session

from browser import CHROMIUM, Browser
from mgdd.cli import main
from mgdd.io import throttle_log, write_csv
from mgdd.rig.can.processes import Child
from mgdd.signals import chirp
from mgdd.throttle import Throttle, simulate_throttle
from mgdd.workbench.drop import dropper
from pressure_files import CYCLES, FULL, writer_in

pytestmark = pytest.mark.slow
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no chromium: tools/system_packages.sh browser")
ENGINE = "hd_diesel_128x144"
MARKUP = "<img src=x onerror=alert(1)>.csv"
ENDLESS = {"descr": "<f8", "fortran_order": False, "shape": (99_999_999_999,)}


def becomes(condition: Callable[[], Any], within_s: float = 60.0) -> bool:
    until = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    child = Child("mgdd", "workbench", "--no-browser", "--quiet")
    yield child.line
    child.stop()


@pytest.fixture
def page(address: str, tmp_path: Path) -> Iterator[Browser]:
    with Browser(address, tmp_path / "profile", height=1800) as browser:
        assert browser.shows("Drop pressure files")
        assert becomes(lambda: browser.evaluate("document.readyState") == "complete")
        yield browser
        strange = [each for each in browser.loaded() if not each.startswith(("http://127.0.0.1:", "data:", "blob:"))]
        assert strange == []


@pytest.fixture
def drifted(tmp_path: Path) -> Path:
    bar = CYCLES[0] * (1.0 + 0.01 * np.random.default_rng(1).standard_normal((60, 1))) + 6.0
    return writer_in(tmp_path)([FULL, *bar], "angle," + ",".join(["p [bar]"] * len(bar)), "drifted.csv")


# --- the server ---------------------------------------------------------------------------------------------


def test_the_page_is_on_this_machine_alone_and_behind_its_word(address: str) -> None:
    found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{20,})", address)
    assert found is not None
    port = int(found[1])
    with urlopen(address) as answer:
        text, headers = answer.read().decode(), answer.headers
    assert "mgdd workbench" in text
    assert not re.findall(r'(?:src|href)="https?://(?!127\.0\.0\.1|localhost)', text)
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert headers["Referrer-Policy"] == "no-referrer"
    for other in ("", "/", "/ws", "/metadata", "/admin", "/rest/session_info"):
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"http://127.0.0.1:{port}{other}")
    stranger = HTTPConnection("127.0.0.1", port)
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    upgrade |= {"Sec-WebSocket-Key": "eA==", "Origin": "http://evil.example"}
    stranger.request("GET", f"/{found[2]}/ws", headers=upgrade)
    assert stranger.getresponse().status == 403
    stranger.close()
    for host in (f"evil.example:{port}", f"127.0.0.1.evil.example:{port}"):
        with socket.create_connection(("127.0.0.1", port), 10.0) as stream:
            stream.sendall(f"GET /{found[2]} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode())
            assert stream.recv(64).split()[1] == b"403"


def test_a_port_in_use_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["workbench", "--no-browser", "--port", str(port)]) == 2
    assert f"port {port} is in use" in capsys.readouterr().err
    assert main(["workbench", "--no-browser", "--port", "70000"]) == 2


def test_each_window_has_a_session_of_its_own(address: str) -> None:
    dropper(lambda *_: None, 1).get_root()  # or its document cannot be read here
    windows = [pull_session(url=address) for _ in range(10)]
    try:
        assert len({window.id for window in windows}) == 10
        begun = time.monotonic()
        with urlopen(address) as answer:
            assert answer.status == 200
        assert time.monotonic() - begun < 30.0
        assert all(len(window.document.roots) == len(windows[0].document.roots) for window in windows)
    finally:
        for window in windows:
            window.close()


# --- in a browser -------------------------------------------------------------------------------------------


@needs_chromium
def test_from_a_file_over_its_doubt_and_remedy_to_a_page(page: Browser, drifted: Path, tmp_path: Path) -> None:
    page.saves_into(tmp_path)
    page.upload(drifted)
    assert page.shows("no engine")  # it is drawn, and not judged
    page.choose("engine", ENGINE)
    assert page.shows("doubt")
    assert page.shows("guessed")
    page.tab("Check")
    assert page.shows("of 13 checks made")
    assert becomes(lambda: page.shown_beside("level").startswith("doubt"))
    level = page.shown_beside("level")
    page.click("Peg by two points")
    assert becomes(lambda: page.shown_beside("level") == "no fault found")
    page.click("Undo the last remedy")
    assert becomes(lambda: page.shown_beside("level") == level)
    page.click("Peg by two points")
    assert becomes(lambda: page.shown_beside("level") == "no fault found")
    assert page.shows("--pegging=two_point")
    page.tab("Cycles")
    page.click("Analyse")
    assert becomes(lambda: page.count("canvas") >= 4)
    page.click("Make the page")
    page.click("Save drifted.html")
    saved = tmp_path / "drifted.html"
    assert becomes(saved.exists)
    assert becomes(lambda: "no fault found: " in saved.read_text(encoding="utf-8"))


@needs_chromium
def test_a_calibration_is_cancelled_and_the_page_goes_on(page: Browser, drifted: Path) -> None:
    page.upload(drifted)
    page.choose("engine", ENGINE)
    assert page.shows("doubt")
    page.tab("Best timing")
    page.click("Calibrate")
    assert page.shows("calibrating")
    begun = time.monotonic()
    page.tab("Check")
    assert page.shows("checks made")  # meanwhile
    assert time.monotonic() - begun < 30.0
    page.tab("Best timing")
    page.click("Cancel")
    assert page.shows("cancelled")
    page.tab("Throttle")
    page.click("Compare")
    assert page.shows("settling time [ms]")


@needs_chromium
def test_a_search_is_stopped_and_resumed(page: Browser) -> None:
    page.tab("Search")
    page.choose("pace", "20 cycles a second")
    page.click("Seek")
    assert page.shows("seeking: cycle 1")
    page.click("Stop")
    assert page.shows("stopped")
    assert page.shows("CurveSeeking")
    assert "cycles 200" not in page.text()
    page.choose("pace", "as fast as it goes")
    page.click("Resume")
    assert becomes(lambda: "seeking: cycle" not in page.text() and "soc_cad -6" in page.text())
    assert becomes(lambda: page.evaluate(page.button("Resume") + ".disabled") is True)


@needs_chromium
def test_a_map_of_24_visits_is_saved(page: Browser, tmp_path: Path) -> None:
    page.saves_into(tmp_path)
    page.tab("Map")
    page.click("Seek the map")
    page.click("Save map.dcm")
    assert page.shows("24 visits")
    assert becomes((tmp_path / "map.dcm").exists)
    assert becomes(lambda: "KENNFELD" in (tmp_path / "map.dcm").read_text(encoding="utf-8"))


@needs_chromium
def test_the_map_of_a_sweep_stands_beside_the_sought_one(page: Browser, tmp_path: Path) -> None:
    page.saves_into(tmp_path)
    page.tab("Map")
    page.click("Sweep, optimise, smooth")
    assert page.shows("swept: every cell at every 0.5 °CA")
    page.click("Save swept.dcm")
    assert becomes((tmp_path / "swept.dcm").exists)
    page.click("Seek the map")
    assert page.shows("Save map.dcm")
    page.click("Smooth it")
    assert page.shows("Save smooth.dcm")


@needs_chromium
def test_an_experiment_that_is_dropped_runs(page: Browser, tmp_path: Path) -> None:
    file = tmp_path / "seek.toml"
    file.write_text('kind = "experiment"\nformat = 1\ntask = "seek"\n[seek]\ncycles = 50\n', encoding="utf-8")
    page.tab("Search")
    assert becomes(lambda: "Drop pressure files" not in page.text() and "An experiment from a file" in page.text())
    page.upload(file)
    assert page.shows("ExperimentResult")
    assert becomes(lambda: page.count("canvas") >= 2)


@needs_chromium
def test_from_a_log_to_a_controller(page: Browser, tmp_path: Path) -> None:
    page.saves_into(tmp_path)
    signal = chirp(3.0, offset=0.15, amplitude=0.2)
    run = simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])
    write_csv(throttle_log(run["time_s"], run["duty"], run["angle_deg"]), tmp_path / "log.csv")
    page.tab("Throttle")
    assert page.shows("Drop a log")
    page.upload(tmp_path / "log.csv")
    assert becomes(lambda: page.count("canvas") >= 2)
    page.click("Identify")
    assert page.shows("free-run fit", 300.0)
    page.click("Save fit.toml")
    assert becomes((tmp_path / "fit.toml").exists)
    page.click("Compare")
    assert page.shows("settling time [ms]")
    page.click("Export as C++")
    page.click("Save pid.zip")
    assert becomes((tmp_path / "pid.zip").exists)


def hostile(folder: Path) -> list[Path]:
    """Files that no reader takes, or that would eat one alive."""
    folder.mkdir()
    rows = "".join(f"{angle},{60.0 - 0.01 * angle * angle:.4f}\n" for angle in range(-60, 61, 4))
    contents: dict[str, bytes] = {
        "empty.csv": b"",
        "noise.csv": bytes(range(256)) * 50,
        "cut.h5": b"\x89HDF\r\n\x1a\n" + b"\xff" * 200,
        "bomb.npy": b"\x93NUMPY\x01\x00v\x00" + f"{ENDLESS}".encode().ljust(118),
        "script.csv": b"<script>document.title = 'taken'</script>\n1,2\n",
        "wide.csv": b"1," * 200_000,
        "cut.parquet": b"PAR1" + b"\x00" * 50,
        "nan.csv": b"angle,p [bar]\n" + b"1,nan\n" * 500,
        MARKUP: f"crank_angle_cad,p [bar] <b>\n{rows}".encode(),
        "zip.xlsx": b"PK\x03\x04" + b"\x00" * 100,
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    return [folder / name for name in contents]


@needs_chromium
def test_hostile_files_are_a_sentence_and_the_page_lives(page: Browser, drifted: Path, tmp_path: Path) -> None:
    page.choose("engine", ENGINE)
    files = hostile(tmp_path / "hostile")
    page.upload(*files)
    for file in files:
        assert page.shows(file.name), file.name
    assert becomes(lambda: page.text().count("waits") == 0, 180.0)
    assert page.evaluate("document.title") == "mgdd workbench"
    assert page.evaluate("document.querySelectorAll('img[src=x]').length") == 0
    page.upload(drifted)
    assert becomes(lambda: page.shown_beside("drifted.csv").startswith("doubt"), 180.0)


@needs_chromium
def test_a_file_of_90_mb_is_refused_with_a_sentence(page: Browser, tmp_path: Path) -> None:
    large = tmp_path / "large.csv"
    large.write_bytes(b"1.0,2.0\n" * (90_000_000 // 8))
    page.upload(large)
    assert page.shows("large.csv: 90 MB; a file may have 64 MB here: use mgdd engine analyze FILE --chunk-cycles 100")
    assert page.shown_beside("large.csv") == ""


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("theme", ["default", "dark"])
def test_the_page_has_all_widths_and_both_themes(address: str, tmp_path: Path, width: int, theme: str) -> None:
    with Browser(f"{address}?theme={theme}", tmp_path / "profile", width=width) as browser:
        assert browser.shows("Drop pressure files")
        assert browser.shows("Live")
        assert becomes(lambda: browser.evaluate("document.documentElement.scrollWidth") <= width)
        colour = browser.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (sum(map(int, re.findall(r"\d+", colour)[:3])) < 200) == (theme == "dark"), colour
