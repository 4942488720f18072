"""Studies whose parts are shared by workers: the same tables, and what is left when the work is cut short."""

import inspect
import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

import parallel_work as work
from mgdd.cli import main
from mgdd.errors import Interrupted, ParameterError, WorkerLostError
from mgdd.parallel.pool import processes
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.registry import available_studies, function_of

# Their parts are made of the same pieces as those of the others, or take minutes.
LONG = {
    "calibrated-guide",
    "guided-transients",
    "identification-benchmarks",
    "measured-engine-seek",
    "model-validation",
    "throttle-pseudo-wiener",
}
DELAYS: dict[str, Any] = {"n_seeds": 2, "quick": True, "figures": False}


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
    options |= {"n_seeds": 1} if "n_seeds" in inspect.signature(function_of(name)).parameters else {}
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
