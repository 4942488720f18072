"""The keys of every JSON object that a program may read are those of the file beside the data of the tests."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mgdd.cli import main
from typed import Capsys

KEYS = Path(__file__).parents[2] / "data" / "json_keys.json"
WRITTEN: dict[str, str] = json.loads(KEYS.read_text(encoding="utf-8"))


def paths(value: Any, above: str = "") -> Iterator[str]:
    """Name every number and text by the keys that lead to it; an entry of a list is like its first."""
    if isinstance(value, dict) and value:
        for key, below in value.items():
            yield from paths(below, f"{above}.{key}" if above else str(key))
    elif isinstance(value, list) and value:
        yield from paths(value[0], f"{above}[]")
    else:
        yield above


@pytest.mark.parametrize("command", WRITTEN)
def test_keys_stay(command: str, capsys: Capsys) -> None:
    assert main([*command.split(), "--json"]) == 0
    assert sorted(paths(json.loads(capsys.readouterr().out))) == WRITTEN[command].split(" ")
