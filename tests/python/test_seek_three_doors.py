"""One question, three doors: `seek`, `mgdd engine seek` and ``task = "seek"`` give the same bits."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.engine import Cylinder
from mgdd.loop import EngineBench, seek
from mgdd.loop.engine_guide import EngineGuide
from mgdd.results.labels import to_jsonable
from mgdd.rig import Experiment, run_experiment

HEAD = 'kind = "experiment"\nformat = 1\ntask = "seek"\nseed = {seed}\n[safety]\nrate_cad = 100.0\n[seek]\n'
ROUGH = 'scale = { wall_heat_scale = 1.6 }\nguide = "%s"\n'
QUESTIONS: dict[str, tuple[dict[str, Any], list[str], str]] = {
    "nothing said": ({"inputs": {"soc_cad": (-20.0, 5.0)}}, [], "[seek.inputs]\nsoc_cad = [-20, 5]\n"),
    "a limit and a start": (
        {"inputs": {"soc_cad": (-25.0, 8.0)}, "limits": {"p_max_bar": 95.0}, "start": {"soc_cad": 2.0}, "cycles": 120},
        ["--limit", "p_max_bar=95", "--start", "soc_cad=2", "--cycles", "120"],
        "cycles = 120\n[seek.limits]\np_max_bar = 95\n[seek.start]\nsoc_cad = 2\n[seek.inputs]\nsoc_cad = [-25, 8]\n",
    ),
    "a seeker by name": (
        {"inputs": {"soc_cad": (-20.0, 5.0)}, "seeker": "spsa"},
        ["--seeker", "spsa"],
        'seeker = "spsa"\n[seek.inputs]\nsoc_cad = [-20, 5]\n',
    ),
    "a tolerance": (
        {"inputs": {"soc_cad": (-20.0, 5.0)}, "tolerance": {"soc_cad": 1.5}},
        ["--tolerance", "soc_cad=1.5"],
        "[seek.tolerance]\nsoc_cad = 1.5\n[seek.inputs]\nsoc_cad = [-20, 5]\n",
    ),
    "a process": (
        {"inputs": {"soc_cad": (-20.0, 5.0)}, "seeker": "gaussian_process_seeking", "cycles": 40},
        ["--seeker", "gaussian_process_seeking", "--cycles", "40"],
        'seeker = "gaussian_process_seeking"\ncycles = 40\n[seek.inputs]\nsoc_cad = [-20, 5]\n',
    ),
    **{
        f"a model, {kind}": (
            {"inputs": {"soc_cad": (-20.0, 5.0)}, "guide": kind, "cycles": 80},
            ["--guide", kind, "--guide-set", "wall_heat_scale=0.8", "--cycles", "80"],
            "cycles = 80\n" + ROUGH % kind + "[seek.inputs]\nsoc_cad = [-20, 5]\n",
        )
        for kind in ("curve", "feed_forward")
    },
}


@pytest.mark.parametrize("question", QUESTIONS)
def test_three_doors_give_the_same_bits(question: str, capsys: pytest.CaptureFixture[str]) -> None:
    asked, options, table = QUESTIONS[question]
    low, high = asked["inputs"]["soc_cad"]
    given = dict(asked)
    if "guide" in given:
        rough = Cylinder(wall_heat_scale=1.6 * Cylinder().wall_heat_scale)
        given["guide"] = EngineGuide(cylinder=rough, kind=given["guide"])
    found = seek(EngineBench(seed=3, limits=list(asked.get("limits", ()))), seed=3, **given)

    bounds = f"soc_cad={low}:{high}"
    assert main(["engine", "seek", "--input", bounds, *options, "--seed", "3", "--json", "--quiet"]) == 0
    by_command = json.loads(capsys.readouterr().out)
    by_experiment = run_experiment(Experiment.from_toml(HEAD.format(seed=3) + table))

    own = found.to_dict()
    assert {name: by_command[name] for name in own} == own
    # The guard of a rig hands on what was measured; the summary of its cycles has fewer columns, and rounds otherwise.
    figures = {name: value for name, value in own.items() if name != "figures"}
    assert {name: to_jsonable(by_experiment.figures)[name] for name in figures} == figures
    shared = own["figures"].keys() & by_experiment.figures["figures"].keys()
    assert len(shared) > 5
    for name in shared:
        assert by_experiment.figures["figures"][name] == pytest.approx(own["figures"][name], rel=1e-12), name
    np.testing.assert_array_equal(by_experiment.dataset["soc_applied_cad"], found.dataset["soc_applied_cad"])


def test_one_input_and_two_have_the_same_keys(capsys: pytest.CaptureFixture[str]) -> None:
    keys = []
    for more in ([], ["--input", "egr=0:0.3"]):
        options = ["--input", "soc_cad=-20:5", *more, "--cycles", "12", "--json", "--quiet"]
        assert main(["engine", "seek", *options]) == 0
        keys.append(set(json.loads(capsys.readouterr().out)))
    assert keys[0] == keys[1]


def test_gains_do_not_come_from_the_truth_of_the_plant() -> None:
    """Whatever the plant would say of itself without noise, a search does not ask it."""

    class Closed(EngineBench):
        def _refused(self, *_: Any, **__: Any) -> Any:
            raise AssertionError("a search has asked the plant for its truth")

        find_optimum = steady_map = _refused

    for seeker in ("auto", "extremum_seeking", "spsa", "gradient_descent"):
        found = seek(Closed(seed=2), {"soc_cad": (-20.0, 5.0)}, seeker=seeker, cycles=600)
        assert abs(found.inputs["soc_cad"] + 5.63) < 2.5, seeker
