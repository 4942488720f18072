"""Commands as a program types them."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from mgdd.cli import main

Capsys = pytest.CaptureFixture[str]


def commands(*own: str) -> tuple[Callable[..., dict[str, Any]], Callable[..., str]]:
    """What gives the one JSON object that a command prints, and what gives the message of one that is refused."""

    def ran(capsys: Capsys, *argv: str, code: int = 0) -> dict[str, Any]:
        returned = main([*own, *argv, "--json", "--quiet"])
        captured = capsys.readouterr()
        assert returned == code, captured.err
        return dict(json.loads(captured.out))  # fails unless stdout is exactly one JSON value

    def refused(capsys: Capsys, *argv: str, code: int = 2) -> str:
        try:
            returned = main([*own, *argv, "--quiet"])
        except SystemExit as stop:
            returned = int(str(stop.code))
        captured = capsys.readouterr()
        assert (returned, captured.out) == (code, "")
        return captured.err

    return ran, refused


ran, refused = commands()
