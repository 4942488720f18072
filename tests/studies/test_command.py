"""`mgdd study`: the list, the JSON object, the table, the figures, refusals, Ctrl-C, workers."""

from __future__ import annotations

import inspect
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import parallel_work as work
from mgdd.cli import main
from mgdd.cli.output import show
from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.parallel.pool import processes
from mgdd_studies import run_study, sensor_delay
from mgdd_studies.base import StudyResult
from mgdd_studies.command import rows_table
from mgdd_studies.registry import available_studies, function_of


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

    whole = run_study("sensor-delay", seeds=2, quick=True, figures=False)
    monkeypatch.setattr("matplotlib.figure.Figure.__init__", stop)
    with pytest.raises(Interrupted, match=r"while it drew: all \d+ rows are in \.partial") as stopped:
        run_study("sensor-delay", seeds=2, quick=True, figures=True)
    assert isinstance(stopped.value.partial, StudyResult)
    assert stopped.value.partial.summary["rows"] == whole.summary["rows"]


# Their parts are made of the same pieces as those of the others, or take minutes.
LONG = {
    "calibrated-guide",
    "guided-transients",
    "identification-benchmarks",
    "measured-engine-seek",
    "model-validation",
    "throttle-pseudo-wiener",
}
DELAYS: dict[str, Any] = {"seeds": 2, "quick": True, "figures": False}


def same(one: StudyResult, two: StudyResult) -> bool:
    return one.dataset.identical(two.dataset) and json.dumps(one.summary) == json.dumps(two.summary)


@pytest.fixture(scope="module")
def plain() -> StudyResult:
    return run_study("sensor-delay", **DELAYS)


SHORT = {"throttle-characteristics", "torque-demand"}
ALL = sorted(set(available_studies()) - LONG - {"measured-traces"})


@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name in SHORT else pytest.mark.slow) for name in ALL])
def test_parts_that_travel_give_the_same_table(name: str) -> None:
    options = {"quick": True, "figures": False}
    options |= {"seeds": 1} if "seeds" in inspect.signature(function_of(name)).parameters else {}
    assert same(run_study(name, executor=work.Pickling(), **options), run_study(name, **options))


@pytest.mark.parametrize(
    "how",
    [
        {"workers": 3},
        pytest.param({"executor": processes(2)}, marks=pytest.mark.slow),  # what the command line takes, too
        {"executor": work.LateReversed()},
    ],
)
def test_workers_change_nothing(how: dict[str, Any], plain: StudyResult) -> None:
    said: list[str] = []
    assert same(run_study("sensor-delay", progress=said.append, **how, **DELAYS), plain)
    assert len(said) == len(set(said)) == 9


def test_a_lost_worker_leaves_the_first_parts(plain: StudyResult) -> None:
    with pytest.raises(WorkerLostError, match="a worker was lost with") as lost:
        run_study("sensor-delay", executor=work.Dropping("cancelled", after=5), workers=1, **DELAYS)
    part = lost.value.partial
    assert part.summary["interrupted"] is True
    assert 0 < len(part.summary["rows"]) < 7
    assert part.summary["rows"] == plain.summary["rows"][: len(part.summary["rows"])]
    with pytest.raises(WorkerLostError) as lost:
        run_study("sensor-delay", executor=work.Dropping("error"), workers=1, **DELAYS)
    assert lost.value.partial is None


def test_ctrl_c_leaves_the_first_parts(plain: StudyResult) -> None:
    said: list[str] = []

    def progress(text: str) -> None:
        said.append(text)
        if len(said) == 4:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(Interrupted, match=r"finished rows are in \.partial") as stop:
        run_study("sensor-delay", executor=ThreadPoolExecutor, workers=1, progress=progress, **DELAYS)
    rows = stop.value.partial.summary["rows"]
    assert 0 < len(rows) < 7
    assert rows == plain.summary["rows"][: len(rows)]


def test_ctrl_c_before_anything_is_finished() -> None:
    def press(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"^interrupted: nothing was finished$") as stop:
        run_study("sensor-delay", executor=ThreadPoolExecutor, workers=1, progress=press, **DELAYS)
    assert stop.value.partial is None


def test_a_study_of_one_part_takes_no_workers() -> None:
    for how in ({"workers": 2}, {"executor": ThreadPoolExecutor}):
        with pytest.raises(ParameterError, match="'measured-traces' is one part"):
            run_study("measured-traces", **how)


def test_the_command_line(plain: StudyResult, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "sensor-delay", "--quick", "--seeds", "2", "--workers", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(plain.summary))
    for given, message in (
        (["sensor-delay", "--workers", "0"], "workers = 0: must be >= 1"),
        (["measured-traces", "--workers", "2"], "is one part"),
        (["--list", "--workers", "2"], "--workers does not act here"),
    ):
        assert main(["study", *given]) == 2
        assert message in capsys.readouterr().err
