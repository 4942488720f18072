"""`mgdd study`: the list, the JSON object, the table, the figures, refusals, and Ctrl-C."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mgdd.cli import main
from mgdd.cli.output import show
from mgdd.errors import Interrupted
from mgdd_studies import run_study, sensor_delay
from mgdd_studies.base import StudyResult
from mgdd_studies.command import rows_table
from mgdd_studies.registry import available_studies


def run(capsys: pytest.CaptureFixture[str], *argv: str, code: int = 0) -> tuple[str, str]:
    assert main(["study", *argv]) == code
    captured = capsys.readouterr()
    return captured.out, captured.err


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    titles = available_studies()
    text, _ = run(capsys, "--list")
    assert [line.split(None, 1) for line in text.splitlines()] == [[name, title] for name, title in titles.items()]
    plain, _ = run(capsys, "--list", "--json")
    assert json.loads(plain) == {"studies": [{"name": name, "title": title} for name, title in titles.items()]}


@pytest.mark.parametrize("argv", [["no-such-study"], ["no-such-study", "--json"], []])
def test_an_unknown_name_says_where_the_known_ones_are(capsys: pytest.CaptureFixture[str], argv: list[str]) -> None:
    out, err = run(capsys, *argv, code=2)
    assert "must be one of those that `mgdd study --list` prints" in err
    if "--json" in argv:
        error = json.loads(out)["error"]
        assert error["type"] == "ParameterError"
        assert f"mgdd: error: {error['message']}\n" == err
    else:
        assert out == ""


def test_refused_before_any_work(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "seeds = 0: must be >= 1" in run(capsys, "sensor-delay", "--seeds", "0", code=2)[1]
    assert "the ending must be one of .json" in run(capsys, "sensor-delay", "-o", str(tmp_path / "a.txt"), code=2)[1]
    assert "is deterministic" in run(capsys, "measured-traces", "--seeds", "4", code=2)[1]


def test_json_file_and_figures(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, folder = tmp_path / "esc.json", tmp_path / "deep" / "figures"
    argv = ("sensor-delay", "--quick", "--seeds", "2", "-o", str(file), "--figures", str(folder), "--format", "svg")
    out, _ = run(capsys, *argv, "--json")
    summary = json.loads(out)
    assert summary == json.loads(file.read_text(encoding="utf-8"))
    assert (summary["study"], summary["seeds"], len(summary["rows"])) == ("sensor-delay", 2, 7)
    assert summary["rows"][1]["cycles_stays"] is None
    assert summary["figures"] == [path.as_posix() for path in sorted(folder.iterdir())]
    assert all(Path(path).read_text(encoding="utf-8").startswith("<?xml") for path in summary["figures"])


def test_readable_table(capsys: pytest.CaptureFixture[str]) -> None:
    out, _ = run(capsys, "sensor-delay", "--quick", "--seeds", "2")
    lines = out.splitlines()
    assert lines[0].startswith("sensor-delay: ")
    assert lines[0].endswith("(2 seeds)")
    assert lines[2].split() == "case period_cycles phase_deg step_sign cycles_stays final_cad".split()
    assert len(lines) == 10
    assert lines[4].split()[-2] == "–"


def test_table_puts_the_interval_behind_its_mean() -> None:
    rows: list[dict[str, Any]] = [
        {"who": "a", "x": 1.23456, "x_low": 1.0, "x_high": 1.5, "n_low": 3},
        {"who": "bcd", "x": 2.0, "x_low": None, "x_high": None, "n_low": None},
    ]
    assert show([rows_table(rows)]).splitlines() == [
        "who               x  n_low",
        "a    1.235 [1, 1.5]      3",
        "bcd               2      –",
    ]
    assert show([rows_table([])]) == "(no rows)"


def test_ctrl_c_prints_what_is_finished(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:

    real, count = sensor_delay.run_seeker, iter(range(100))

    def interrupted(*args: Any, **how: Any) -> Any:
        if next(count) == 2:
            raise KeyboardInterrupt
        return real(*args, **how)

    monkeypatch.setattr(sensor_delay, "run_seeker", interrupted)
    out, err = run(capsys, "sensor-delay", "--quick", "--json", code=130)
    summary = json.loads(out)
    assert summary["interrupted"] is True
    assert len(summary["rows"]) == 2
    assert "interrupted: 2 finished rows are printed" in err


def test_without_the_package_of_the_studies_it_says_what_to_do(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mgdd_studies.command", None)
    with pytest.raises(SystemExit, match="2"):
        main(["study", "--list", "--json"])
    shown = capsys.readouterr()
    said = "mgdd_studies is not installed, the package of the studies: it comes with mgdd, install that again"
    assert shown.err.splitlines()[-1] == f"mgdd study: error: {said}"
    assert json.loads(shown.out)["error"]["message"] == said
    assert main(["completion", "bash"]) == 0  # every other command is whole


def test_no_command_loads_the_studies_before_it_uses_them() -> None:
    code = "import sys; from mgdd.cli import main; main(['preset', 'list']); print('mgdd_studies' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"


def test_a_study_says_what_it_holds(quick_study: Callable[..., StudyResult]) -> None:
    result = quick_study("sensor-delay")
    text = repr(result)
    assert text.startswith("StudyResult sensor-delay\n")
    assert "rows 7" in text
    assert result._repr_html_().startswith("<div>")


def test_ctrl_c_while_a_study_draws_keeps_its_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    whole = run_study("sensor-delay", n_seeds=2, quick=True, figures=False)
    monkeypatch.setattr("matplotlib.figure.Figure.__init__", stop)
    with pytest.raises(Interrupted, match=r"while it drew: all \d+ rows are in \.partial") as stopped:
        run_study("sensor-delay", n_seeds=2, quick=True, figures=True)
    assert isinstance(stopped.value.partial, StudyResult)
    assert stopped.value.partial.summary["rows"] == whole.summary["rows"]
