"""Debian's Chromium without a window, driven by its own protocol over the websocket client that Bokeh brings along."""

import asyncio
import base64
import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any, Self
from urllib.request import urlopen

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
_FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage --disable-background-networking "
    "--disable-component-update --disable-sync --no-first-run --hide-scrollbars --remote-debugging-port=0"
).split()
# Bokeh draws into shadow roots: a search of the document alone finds nothing.
_DEEP = """(() => { const all = (root) => [...root.querySelectorAll("*")].flatMap(
  (one) => [one, ...(one.shadowRoot ? all(one.shadowRoot) : [])]); return all(document); })()"""


async def _connected(address: str) -> Any:
    from tornado.websocket import websocket_connect

    return await websocket_connect(address, max_message_size=1 << 26)


def _labelled(label: str, kind: str) -> str:
    """Write the search of a field by the label above it."""
    return (
        f"{_DEEP}.find((one) => one.localName == 'label' && one.innerText.trim() == {json.dumps(label)})"
        f".parentElement.querySelector('{kind}')"
    )


class Browser:
    """One page in one browser process."""

    def __init__(self, url: str, folder: Path, *, width: int = 1280, height: int = 1400) -> None:
        assert CHROMIUM is not None
        self._loop = asyncio.new_event_loop()
        self._process = subprocess.Popen(
            [CHROMIUM, *_FLAGS, f"--user-data-dir={folder}", f"--window-size={width},{height}", url],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env={name: value for name, value in os.environ.items() if name != "LD_PRELOAD"},  # sanitizers end it
        )
        try:
            self._open(folder, width, height)
        except BaseException:
            self.kill()
            self._loop.close()
            raise

    def _open(self, folder: Path, width: int, height: int) -> None:
        port_file, until = folder / "DevToolsActivePort", time.monotonic() + 60.0
        while not (port_file.exists() and port_file.read_text()) and time.monotonic() < until:
            time.sleep(0.05)
        port = int(port_file.read_text().split()[0])
        pages: list[dict[str, Any]] = []
        while not pages and time.monotonic() < until:
            with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
                pages = [page for page in json.load(answer) if page["type"] == "page"]
        self._socket = self._loop.run_until_complete(_connected(pages[0]["webSocketDebuggerUrl"]))
        self._number = 0
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        return self._loop.run_until_complete(asyncio.wait_for(self._call(method, parameters), 60.0))

    async def _call(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        self._number += 1
        await self._socket.write_message(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(await self._socket.read_message() or '{"id": null}')
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def evaluate(self, expression: str) -> Any:
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def text(self) -> str:
        """All that a person reads, apart from what is drawn on a canvas."""
        return self.evaluate(
            f"{_DEEP}.filter((one) => !['style', 'script', 'template'].includes(one.localName)).flatMap((one) => "
            "[...one.childNodes].filter((own) => own.nodeType == 3).map((own) => own.data)).join('\\n')"
        )

    def shows(self, text: str, within_s: float = 60.0) -> bool:
        until = time.monotonic() + within_s
        while text not in self.text():
            if time.monotonic() > until:
                return False
            time.sleep(0.1)
        return True

    def click(self, label: str) -> None:
        """Press and release the mouse in the middle of a button, as a hand does."""
        self._press(self.button(label))

    def button(self, label: str) -> str:
        """Write the search of a button, or of a link that looks like one."""
        return (
            f"{_DEEP}.find((one) => ['button', 'a'].includes(one.localName) && "
            f"one.innerText.includes({json.dumps(label)}) && one.getBoundingClientRect().width > 0)"
        )

    def count(self, name: str) -> int:
        """Count the elements of a kind."""
        return self.evaluate(f"{_DEEP}.filter((one) => one.localName == {json.dumps(name)}).length")

    def shown_beside(self, text: str) -> str:
        """Give the badge in the row of a table or list that begins with a text; empty where there is none."""
        return self.evaluate(
            f"(() => {{ const row = {_DEEP}.find((one) => ['b', 'td'].includes(one.localName) && "
            f"one.innerText == {json.dumps(text)}); const own = row && row.parentElement.querySelector('.badge'); "
            "return own ? own.innerText : ''; })()"
        )

    def _press(self, element: str) -> None:
        middle = (
            f"(() => {{ const own = {element}; own.scrollIntoViewIfNeeded(); const box = own.getBoundingClientRect(); "
            "return own.disabled ? null : [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        box, before, until = None, None, time.monotonic() + 120.0
        while box is None or box != before:  # it is not there yet, or moves
            assert time.monotonic() < until, element
            time.sleep(0.1)
            box, before = self.evaluate(middle), box
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=box[0], y=box[1], button="left", clickCount=1)

    def upload(self, *files: Path, place: int = 0) -> None:
        """Give files to an input for them, as the dialog behind it does."""
        inputs = f"{_DEEP}.filter((one) => one.localName == 'input' && one.type == 'file')"
        handle = self.call("Runtime.evaluate", expression=f"{inputs}[{place}]")["result"]["objectId"]
        self.call("DOM.setFileInputFiles", files=[str(file) for file in files], objectId=handle)

    def choose(self, label: str, option: str) -> None:
        """Choose an option of the list with that label, once it is there."""
        change = (
            f"(() => {{ const own = {_labelled(label, 'select')}; own.value = [...own.options].find((one) => "
            f"one.text == {json.dumps(option)}).value; own.dispatchEvent(new Event('change')); return true; }})()"
        )
        until = time.monotonic() + 30.0
        while not self.evaluate(change):
            assert time.monotonic() < until, label
            time.sleep(0.1)

    def tab(self, title: str) -> None:
        """Click on the head of a tab."""
        self._press(f"{_DEEP}.find((one) => one.className == 'bk-tab' || one.className == 'bk-tab bk-active' ? "
                    f"one.innerText.trim() == {json.dumps(title)} : false)")  # fmt: skip

    def saves_into(self, folder: Path) -> None:
        """Let downloads go into a folder."""
        self.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder))

    def loaded(self) -> list[str]:
        """Give the addresses of all that the page has asked for."""
        return self.evaluate("performance.getEntriesByType('resource').map((one) => one.name)")

    def screenshot(self, file: Path) -> None:
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))

    def freeze(self) -> None:
        """Stop all of its processes, as a computer that has no time for them does."""
        self._signal(signal.SIGSTOP)

    def kill(self) -> None:
        self._signal(signal.SIGKILL)
        self._process.wait()

    def _signal(self, number: int) -> None:
        os.killpg(self._process.pid, number)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self.kill()
        self._loop.run_until_complete(self._leave())
        self._loop.close()

    async def _leave(self) -> None:
        self._socket.close()  # outside of a running loop tornado would make another one, and leave it open
