"""The views of the workbench without a browser: work runs here and at once, and commands are run beside it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from typing import Any

import pytest

from mgdd.cli import main
from mgdd.errors import Error, Interrupted


class InlineJob:
    """Work that is over once it was begun, with the face of `mgdd.workbench.jobs.Job`."""

    def __init__(self, function: Callable[..., Any], given: tuple[Any, ...], **_: float) -> None:
        self.over, self.interrupted, self.error, self.result = True, False, "", None
        self._told: list[Any] = []
        try:
            self.result = function(self._told.append, *given)
        except Interrupted as stop:
            self.result, self.interrupted = stop.partial, True
        except (Error, OSError, ValueError) as error:
            self.error = str(error)

    def look(self) -> list[Any]:
        told, self._told = self._told, []
        return told

    def stop(self) -> None: ...

    def end(self, why: str = "") -> None: ...


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    """All views of a window; what they begin is over when `begin` returns."""
    from mgdd.workbench import parts
    from mgdd.workbench.page import Bench

    monkeypatch.setattr(parts, "Job", InlineJob)
    begin = parts.Work.begin

    def at_once(self: Any, *given: Any, **options: Any) -> None:
        begin(self, *given, **options)
        self.look()

    monkeypatch.setattr(parts.Work, "begin", at_once)
    window = Bench()
    yield window
    window.close()


def said(work: Any) -> str:
    """What stands below the bar of a view."""
    return work._said.object


def run_command(shell: str, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """Run commands as they are shown, the last with --json; the working folder holds their files."""
    *before, last = (shlex.split(line) for line in shell.splitlines())
    for words in before:
        assert main([*words[1:], "--quiet"]) in (0, 1), capsys.readouterr().err
    assert last[0] == "mgdd"
    capsys.readouterr()
    code = main([*last[1:], "--json", "--quiet"])
    out = capsys.readouterr()
    assert code in (0, 1), out.err
    return json.loads(out.out)


def run_python(text: str) -> dict[str, Any]:
    """Run Python as it is shown; give what it has made."""
    names: dict[str, Any] = {}
    exec(text, names)  # noqa: S102 - what the page offers to be run
    return names
