"""Commands of `mgdd map` as a program calls them."""

from __future__ import annotations

import json
from typing import Any

import pytest

from mgdd.cli import main


def ran(capsys: pytest.CaptureFixture[str], *argv: str) -> dict[str, Any]:
    """Run a command with --json; stdout must be one object."""
    code = main([*argv, "--json", "--quiet"])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    return json.loads(captured.out)
