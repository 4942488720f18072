"""One question, three doors: `seek`, `mgdd engine seek` and ``task = "seek"`` give the same bits."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.engine import Cylinder
from mgdd.loop import EngineGuide, VirtualEngine, seek, seek_map
from mgdd.loop.summary import FIGURES_OF_INPUT
from mgdd.maps import read_map
from mgdd.results.labels import to_jsonable
from mgdd.rig import Experiment, run_experiment

HEAD = 'kind = "experiment"\nformat = 1\ntask = "seek"\nseed = {seed}\n[safety]\nrate_cad = 100.0\n[seek]\n'
ROUGH = 'scale = { wall_heat_scale = 1.6 }\nguide = "%s"\n'
BOTH = "limits.imep_gross_bar = [9.5, inf]\nlimits.p_max_bar = [-inf, 100]\n"
QUESTIONS: dict[str, tuple[dict[str, Any], list[str], str]] = {
    "nothing said": ({"inputs": {"soc_cad": (-20.0, 5.0)}}, [], "[seek.inputs]\nsoc_cad = [-20, 5]\n"),
    "a limit and a start": (
        {"inputs": {"soc_cad": (-25.0, 8.0)}, "limits": {"p_max_bar": 95.0}, "start": {"soc_cad": 2.0}, "cycles": 120},
        ["--limit", "p_max_bar=95", "--start", "soc_cad=2", "--cycles", "120"],
        "cycles = 120\n[seek.limits]\np_max_bar = 95\n[seek.start]\nsoc_cad = 2\n[seek.inputs]\nsoc_cad = [-25, 8]\n",
    ),
    "a limit without a start": (
        {"inputs": {"soc_cad": (-25.0, 8.0)}, "limits": {"p_max_bar": 95.0}},
        ["--limit", "p_max_bar=95"],
        "[seek.limits]\np_max_bar = 95\n[seek.inputs]\nsoc_cad = [-25, 8]\n",
    ),
    "a seeker by name": (
        {"inputs": {"soc_cad": (-20.0, 5.0)}, "seeker": "spsa"},
        ["--seeker", "spsa"],
        'seeker = "spsa"\n[seek.inputs]\nsoc_cad = [-20, 5]\n',
    ),
    "a setting": (
        {
            "inputs": {"soc_cad": (-20.0, 5.0)},
            "seeker": "extremum_seeking",
            "settings": {"form": "washout", "gain": 0.4},
        },
        ["--seeker", "extremum_seeking", "--seeker-set", "form=washout", "--seeker-set", "gain=0.4"],
        'seeker = "extremum_seeking"\nsettings = { form = "washout", gain = 0.4 }\n[seek.inputs]\nsoc_cad = [-20, 5]\n',
    ),
    "limits on both sides": (
        {
            "inputs": {"soc_cad": (-25.0, 8.0)},
            "start": {"soc_cad": 0.0},
            "cycles": 80,
            "limits": {"imep_gross_bar": (9.5, None), "p_max_bar": (None, 100.0), "ca50_cad": (5.0, 20.0)},
        },
        "--start soc_cad=0 --cycles 80 --limit imep-gross-bar=9.5: --limit p_max_bar=:100 --limit ca50_cad=5:20".split(),  # noqa: E501
        "cycles = 80\nstart.soc_cad = 0\ninputs.soc_cad = [-25, 8]\nlimits.ca50_cad = [5, 20]\n" + BOTH,
    ),
    "two inputs": (
        {"inputs": {"soc_cad": (-20.0, 5.0), "egr": (0.0, 0.3)}, "cycles": 40, "start": {"soc_cad": 2.0, "egr": 0.1}},
        ["--cycles", "40", "--start", "soc_cad=2", "--start", "egr=0.1"],
        "cycles = 40\n[seek.start]\nsoc_cad = 2\negr = 0.1\n[seek.inputs]\nsoc_cad = [-20, 5]\negr = [0, 0.3]\n",
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
    given = dict(asked)
    if "guide" in given:
        rough = Cylinder(wall_heat_scale=1.6 * Cylinder().wall_heat_scale)
        given["guide"] = EngineGuide(cylinder=rough, kind=given["guide"])
    bench = VirtualEngine(seed=3, limits=list(asked.get("limits", ())), inputs=list(asked["inputs"]))
    found = seek(bench, seed=3, **given)

    bounds = [word for name, (low, high) in asked["inputs"].items() for word in ("--input", f"{name}={low}:{high}")]
    assert main(["engine", "seek", *bounds, *options, "--seed", "3", "--json", "--quiet"]) == 0
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
    np.testing.assert_array_equal(by_experiment.dataset["applied"], found.dataset["applied"])


def test_readings_of_before_go_through_every_door(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    options = ["engine", "seek", "--input", "soc_cad=-25:8", "--limit", "t_evo_k=960", "--quiet"]
    before, after = tmp_path / "before.csv", ["--seed", "4", "--cycles", "30", "--json"]
    assert main([*options, "--seed", "3", "--cycles", "40", "-o", str(before)]) == 0
    capsys.readouterr()
    assert main([*options, *after, "--known", str(before)]) == 0
    by_command = json.loads(capsys.readouterr().out)
    asked: dict[str, Any] = {"inputs": {"soc_cad": (-25.0, 8.0)}, "limits": {"t_evo_k": 960.0}}
    first = seek(VirtualEngine(seed=3, limits=["t_evo_k"]), seed=3, cycles=40, **asked)
    found = seek(VirtualEngine(seed=4, limits=["t_evo_k"]), seed=4, cycles=30, known=first.dataset, **asked)
    assert "after 40 readings" in by_command["reason"]
    table = "cycles = 30\nknown = 'before.csv'\ninputs.soc_cad = [-25, 8]\nlimits.t_evo_k = 960\n"
    (tmp_path / "known.toml").write_text(HEAD.format(seed=4) + table)
    by_experiment = run_experiment(Experiment.load(tmp_path / "known.toml"), tmp_path / "run")
    assert (tmp_path / "run" / "inputs" / "before.csv").read_bytes() == before.read_bytes()
    for other in (by_command, by_experiment.figures):
        assert other["inputs"] == pytest.approx(found.inputs, abs=1e-9)  # a table has fewer digits than a number


def test_one_input_and_two_have_the_same_layout(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    keys, columns = [], []
    for more in ([], ["--input", "egr=0:0.3"]):
        options = ["--input", "soc_cad=-20:5", *more, "--cycles", "12", "--json", "--quiet"]
        assert main(["engine", "seek", *options, "-o", str(tmp_path / "run.csv")]) == 0
        out = json.loads(capsys.readouterr().out)
        keys.append([set(own) - {f"{name}_egr" for name in FIGURES_OF_INPUT} for own in (out, out["figures"])])
        names = (tmp_path / "run.csv").read_text().splitlines()
        columns.append(set(next(line for line in names if not line.startswith("#")).split(",")))
    assert keys[0] == keys[1]
    steered = {f"{what}_soc_cad" for what in ("estimate", "asked", "applied")}
    assert all(steered <= own for own in columns)


@pytest.mark.parametrize("inputs", [("soc_cad",), ("soc_cad", "egr"), ("x",), ("x", "y")], ids="-".join)
def test_the_cycles_of_every_plant_have_one_layout(inputs: tuple[str, ...]) -> None:
    bounds = {name: (-20.0, 5.0) if name == "soc_cad" else (0.0, 0.3) for name in inputs}

    def linear(x: Any) -> float:
        return -sum(x[name] for name in inputs)

    found = seek(linear if "x" in inputs else VirtualEngine(inputs=list(inputs), seed=1), bounds, cycles=12)
    for name in ("estimate", "asked", "applied"):
        assert found.dataset[name].dims == ("cycle", "input")
        assert found.dataset[name].sel(input=list(inputs)).shape == (12, len(inputs))
    assert found.dataset["void"].dims == ("cycle",)
    for name in inputs:
        mean = float(found.dataset["estimate"].sel(input=name).mean())
        assert found.run.summary[f"final_{name}"] == pytest.approx(mean)
    assert not {"estimate_cad", "soc_requested_cad", "soc_applied_cad"} & set(found.dataset.variables)


def test_gains_do_not_come_from_the_truth_of_the_plant() -> None:
    """Whatever the plant would say of itself without noise, a search does not ask it."""

    class Closed(VirtualEngine):
        def _refused(self, *_: Any, **__: Any) -> Any:
            raise AssertionError("a search has asked the plant for its truth")

        find_optimum = steady_map = _refused

    for seeker in ("auto", "extremum_seeking", "spsa", "gradient_descent"):
        found = seek(Closed(seed=2), {"soc_cad": (-20.0, 5.0)}, seeker=seeker, cycles=600)
        assert abs(found.inputs["soc_cad"] + 5.63) < 2.5, seeker


MAPS: dict[str, tuple[dict[str, Any], list[str], str]] = {
    "a model and limits on both sides": (
        {"guide": True, "limits": {"p_max_bar": (60.0, 120.0)}, "settling": 10, "averaged": 20},
        "--limit p_max_bar=60:120 --guide model --guide-set wall_heat_scale=0.8 --settling 10 --averaged 20".split(),
        ROUGH % "model" + "settling = 10\naveraged = 20\nlimits.p_max_bar = [60, 120]\n",
    ),
    "a start and a tolerance": (
        {"start": {"soc_cad": 2.0}, "tolerance": 0.3},
        "--start soc_cad=2 --tolerance 0.3".split(),
        "start.soc_cad = 2\ntolerance = 0.3\n",
    ),
}


@pytest.mark.parametrize("question", MAPS)
def test_three_doors_seek_the_same_map(question: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    asked, options, table = MAPS[question]
    axes = {"speed_rpm": [1200.0, 1800.0, 2400.0], "fuel_mg": [12.0, 28.0]}
    guide = Cylinder(wall_heat_scale=1.6 * Cylinder().wall_heat_scale) if "guide" in asked else None
    seen = list[Any]()
    found = seek_map(
        VirtualEngine(seed=3), {"soc_cad": (-20.0, 5.0)}, axes, visits=5, seed=3, on_visit=seen.append,
        **{**asked, "guide": guide},
    )  # fmt: skip
    assert seen[-1].regret == found.regret
    assert seen[-1].settled == ((found.cells["regret"] <= asked["tolerance"]).sum() if "tolerance" in asked else 0)

    file = tmp_path / "map.nc"
    over = ["--over", "speed_rpm=1200:2400:3", "--over", "fuel_mg=12,28", "--input", "soc_cad=-20:5", "--visits", "5"]
    assert main(["map", "seek", *over, *options, "--seed", "3", "--json", "--quiet", "-o", str(file)]) == 0
    by_command, own = json.loads(capsys.readouterr().out), to_jsonable(found.to_dict())
    assert {name: by_command[name] for name in own} == own
    assert read_map(file) == found.map

    entries = "inputs.soc_cad = [-20, 5]\naxes.speed_rpm = [1200, 1800, 2400]\naxes.fuel_mg = [12, 28]\nvisits = 5\n"
    head = HEAD.format(seed=3).replace("seek", "map")
    by_experiment = run_experiment(Experiment.from_toml(head + entries + table))
    assert by_experiment.dataset.identical(found.dataset)
