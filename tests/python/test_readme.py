"""README and tour are true today: their numbers are recomputed, their commands exist, their pictures are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mgdd.cli import main
from study_cache import quick_study

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOUR = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")


def span(pair: list[float], form: str) -> str:
    return f"{pair[0]:{form}} to {pair[1]:{form}}"


def test_table_of_the_demo() -> None:
    table = TOUR.split("<!-- numbers: demo -->")[1].split("<!-- end numbers -->")[0]
    written = [line for line in table.splitlines() if re.match(r"\| \d+ %", line)]
    summary = quick_study("measured-traces").summary
    computed = []
    for load, row in zip((25, 50, 75, 100), summary["traces"], strict=True):
        best, fit = row["best_timing"], row["calibrated"]
        cells = (
            f"{best['best'][name]:{form}} ({span(best[name], form)})"
            for name, form in (
                ("free_ca50_cad", ".1f"),
                ("free_shift_cad", "+z.1f"),
                ("free_gain_percent", ".2f"),
                ("shift_cad", "+z.1f"),
                ("gain_percent", ".2f"),
            )
        )
        computed.append(
            f"| {load} % | {fit['rmse_percent']:.2f} | {fit['imep_closed_error_percent']:+.1f} | {' | '.join(cells)} |"
        )
    assert written == computed


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
    assert len(README.split()) < 700


def test_numbers_in_comments_are_what_the_code_prints(capsys: pytest.CaptureFixture[str]) -> None:
    code = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    written = [number for text in code for number in re.findall(r"^print\(.*\)  # ([-\d.]+)", text, re.MULTILINE)]
    exec("\n".join(code), {})  # noqa: S102
    assert capsys.readouterr().out.split() == written
    assert len(written) > 2
