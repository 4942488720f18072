"""README and tour are true today: their numbers are recomputed, their commands exist, their pictures are there."""

import re
from pathlib import Path

import pytest

from mgdd.cli import main

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOUR = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")


def test_pictures_and_links_exist() -> None:
    targets = re.findall(r"\]\((?!https?:)([^)#]+)\)", README)
    assert targets
    missing = [target for target in targets if not (ROOT / target).exists()]
    assert not missing


def test_commands_parse(capsys: pytest.CaptureFixture[str]) -> None:
    block = re.findall(r"```console\n(.*?)```", TOUR, re.DOTALL)
    commands = {tuple(line.split()[1:3]) for text in block for line in text.splitlines() if line.startswith("mgdd ")}
    assert ("engine", "calibrate") in commands
    for command in sorted(commands):
        words = [word for word in command if word.isalpha()]
        with pytest.raises(SystemExit) as stop:
            main([*words, "--help"])
        assert stop.value.code == 0
        assert "example" in capsys.readouterr().out


def test_it_is_short() -> None:
    assert len(README.split()) <= 380


def test_numbers_in_comments_are_what_the_code_prints(capsys: pytest.CaptureFixture[str]) -> None:
    code = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    written = [number for text in code for number in re.findall(r"^print\(.*\)  # ([-\d.]+)", text, re.MULTILINE)]
    exec("\n".join(code), {})  # noqa: S102
    assert capsys.readouterr().out.split() == written
    assert len(written) > 2
