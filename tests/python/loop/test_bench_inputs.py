"""The bench of several inputs from Python: steps, maps, optimum under limits, loops, refusals."""

import itertools
import json
import pickle
import re

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.engine import Performance
from mgdd.errors import ParameterError, ShapeError
from mgdd.guide import GuidedEngine, ModelOptimum
from mgdd.loop import VirtualEngine, monte_carlo, run_seeker
from mgdd.loop import seek as seek_on
from mgdd.optimize import ExtremumSeeking, GaussianProcessSeeking
from mgdd.results.labels import check_labels

THREE = ["soc_cad", "egr", "intake_pressure_kpa"]
QUIET = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
BOUNDS = {"soc_cad": (-25.0, 10.0), "egr": (0.0, 0.4), "intake_pressure_kpa": (120.0, 220.0)}


def test_steps_columns_and_measurements_are_one_run() -> None:
    rng = np.random.default_rng(1)
    columns = {"soc_cad": rng.uniform(-12, 0, 40), "egr": rng.uniform(0, 0.4, 40), "intake_pressure_kpa": 170.0}
    bench = VirtualEngine(inputs=THREE, limits=["nox_fast_ppm", "p_max_bar"], seed=4)
    run = bench.run(columns)
    check_labels(run)
    np.testing.assert_array_equal(run["egr"], columns["egr"])
    assert set(np.unique(run["intake_pressure_kpa"])) == {170.0}
    again = pickle.loads(pickle.dumps(VirtualEngine(inputs=THREE, limits=["nox_fast_ppm", "p_max_bar"], seed=4)))
    assert again.input_names == tuple(THREE)
    rows = []
    for k in range(40):
        asked = {"soc_cad": columns["soc_cad"][k], "egr": columns["egr"][k], "intake_pressure_kpa": 170.0}
        if k % 2:
            rows.append(again.step(asked))
            continue
        again.apply(asked)
        measured = again.measure()
        assert measured.applied == asked
        assert measured.noise_free_limits["nox_fast_ppm"] > 0.0
        rows.append(dict(measured.values))
    for name in ("j", "p_max_bar", "nox_fast_ppm", "intake_o2_fraction"):
        np.testing.assert_array_equal([row[name] for row in rows], run[name], err_msg=name)


def test_what_is_left_out_stays() -> None:
    bench = VirtualEngine(inputs=THREE, **QUIET)
    assert bench.step({"egr": 0.2, "soc_cad": -4.0})["intake_pressure_kpa"] == 150.0
    assert bench.step({"intake_pressure_kpa": 180.0})["egr"] == 0.2
    assert bench.step(-5.0)["intake_pressure_kpa"] == 180.0
    assert bench.step(-5.0, [0.9])["egr"] == 0.5
    assert bench.input_bounds == {"soc_cad": (-60.0, 20.0), "egr": (0.0, 0.5), "intake_pressure_kpa": (50.0, 500.0)}
    assert set(bench.step(-5.0)) - set(VirtualEngine().step(-5.0)) == {
        "egr",
        "intake_pressure_kpa",
        "intake_o2_fraction",
    }


def test_the_steady_map_is_the_grid_of_what_is_named() -> None:
    bench = VirtualEngine(
        inputs=THREE, performance=Performance.efficiency_and_nox(), nox_sensor="soft_corrected", seed=2
    )
    grid = bench.steady_map({"egr": [0.0, 0.25], "soc_cad": [-8.0, -4.0, 1.0]})
    check_labels(grid)
    assert dict(grid.sizes) == {"soc_cad": 3, "egr": 2}
    assert bench.cycle == 0
    quiet = VirtualEngine(inputs=THREE, **QUIET)
    for soc, egr in itertools.product([-8.0, -4.0, 1.0], [0.0, 0.25]):
        quiet.reset()
        cycle, cell = quiet.step({"soc_cad": soc, "egr": egr}), grid.sel(soc_cad=soc, egr=egr)
        assert float(cell["nox_true_ppm"]) == cycle["nox_true_ppm"]
        expected = 100.0 * cycle["efficiency_gross"] - 0.004 * cycle["nox_soft_ppm"]
        assert float(cell["j"]) == pytest.approx(expected, abs=1e-12)
    assert float(grid["j"].sel(soc_cad=-8.0, egr=0.0)) == pytest.approx(
        float(VirtualEngine(performance=Performance.efficiency_and_nox()).steady_map([-8.0])["j"][0]), abs=1e-12
    )


@pytest.mark.parametrize(
    ("limits", "held"),
    [
        ({"p_max_bar": 118.0, "nox_fast_ppm": 150.0}, ("p_max_bar", "nox_fast_ppm")),
        ({"p_max_bar": 104.0}, ("p_max_bar",)),
        ({"t_evo_k": 668.0, "nox_true_ppm": 800.0}, ("t_evo_k",)),
    ],
)
def test_the_optimum_under_limits_is_that_of_a_fine_grid(limits: dict[str, float], held: tuple[str, ...]) -> None:
    best = VirtualEngine(inputs=THREE, seed=3).find_optimum(limits, bounds=BOUNDS)
    assert best.active_limits == held
    for name, upper in limits.items():
        assert best[name] <= upper * (1.0 + 1e-5)
    quiet = VirtualEngine(inputs=THREE, limits=list(limits), **QUIET)
    top = -np.inf
    centre, reach = np.array([-7.5, 0.2, 170.0]), np.array([17.5, 0.2, 50.0])
    for _ in range(7):  # grids of 17 a side, each of the best cells of the one before
        axes = [np.linspace(c - r, c + r, 17).clip(*b) for c, r, b in zip(centre, reach, BOUNDS.values(), strict=True)]
        grid = np.array(list(itertools.product(*axes)))
        first, *further = grid.T
        kept = (quiet.noise_free_limits(first, [0] * len(grid), further) <= list(limits.values())).all(axis=1)
        j = np.where(kept, 100.0 * np.array(quiet.run_columns(first, further)["efficiency_gross"]), -np.inf)
        centre, top = grid[int(j.argmax())], max(top, float(j.max()))
        reach *= 0.45
    assert best.value == pytest.approx(top, abs=0.01)
    assert best.value > top - 1e-4
    assert {"soc_cad", "egr", "intake_pressure_kpa"} == set(best.inputs) == set(best.free_inputs)


def test_one_input_is_bounded_by_its_name() -> None:
    bench = VirtualEngine()
    whole, part = (
        bench.find_optimum({"p_max_bar": 95.0}, bounds=own)["soc_cad"] for own in (None, {"soc_cad": (-20, 5)})
    )
    assert part == pytest.approx(whole, abs=1e-6)
    assert bench.find_optimum(bounds={"soc_cad": (-4.0, 5.0)})["soc_cad"] == pytest.approx(-4.0, abs=1e-3)
    best = bench.find_optimum({"nox_soft_ppm": 1100.0})
    assert best["nox_true_ppm"] == pytest.approx(1100.0, abs=0.01)
    assert best.active_limits == ("nox_soft_ppm",)


@pytest.mark.parametrize("inputs", [("soc_cad",), ("soc_cad", "egr")], ids="-".join)
def test_a_lower_limit_of_the_optimum_is_where_a_fine_scan_has_it(inputs: tuple[str, ...]) -> None:
    bench, pressures = VirtualEngine(inputs=list(inputs)), np.linspace(-25.0, 5.0, 601)
    bounds = {"soc_cad": (-25.0, 5.0), "egr": (0.0, 1e-3)}
    best = bench.find_optimum({"p_max_bar": (130.0, None)}, bounds={name: bounds[name] for name in inputs})
    steady = bench.steady_map({name: pressures if name == "soc_cad" else [0.0] for name in inputs})
    kept = steady.isel(soc_cad=steady["p_max_bar"].to_numpy().ravel() >= 130.0)
    assert best["soc_cad"] == pytest.approx(float(kept["soc_cad"][int(kept["j"].to_numpy().argmax())]), abs=0.1)
    assert best.active_limits == ("-p_max_bar",)
    assert best["p_max_bar"] == pytest.approx(130.0, abs=0.2)


def test_whole_loops_are_those_of_one_at_a_time() -> None:
    bench = VirtualEngine(inputs=THREE)
    start = [-6.0, 0.1, 150.0]
    seeker = GaussianProcessSeeking(inputs=BOUNDS, start=start)
    table = monte_carlo(bench, seeker, range(3), cycles=15)
    run = run_seeker(
        VirtualEngine(inputs=THREE, seed=2), GaussianProcessSeeking(inputs=BOUNDS, start=start, seed=2), 15
    )
    assert float(table["mean_j"].sel(seed=2).squeeze()) == pytest.approx(run.summary["mean_j"], rel=1e-12)
    turned = GaussianProcessSeeking(inputs={name: BOUNDS[name] for name in reversed(BOUNDS)}, start=start[::-1])
    with pytest.raises(ParameterError, match="in the order of the bench, soc_cad, egr, intake_pressure_kpa"):
        monte_carlo(bench, turned, range(3), cycles=15)
    assert bench.cycle == 0


ALONE = ExtremumSeeking(start=-6.0, bounds=(-25.0, 10.0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda b: run_seeker(b, ALONE, 5), "start has 1 entries: the plant takes 3, soc_cad, egr"),
        (
            lambda b: run_seeker(b, GuidedEngine(ALONE, ModelOptimum(b.settings["cylinder"]), b.point), 5),
            "start has 1 entries: the plant takes 3",
        ),
        (lambda b: monte_carlo(b, ALONE, [1], cycles=5), "the bench takes 3 inputs, soc_cad, egr, intake_pressure_kpa"),
        (lambda b: seek_on(b, {"soc_cad": (-20.0, 5.0)}), "inputs = soc_cad: the plant takes soc_cad, egr, intake"),
        (lambda b: b.step({"ger": 0.1}), "inputs: 'ger': the bench has .*; did you mean 'egr'"),
        (lambda b: b.apply({"soc_cad": -6.0}), "inputs = soc_cad: must be soc_cad, egr, intake_pressure_kpa"),
        (lambda b: b.steady_map({"soc_cad": [-6.0], "egr": [0.6]}), re.escape("egr = 0.6: must lie in [0, 0.5]")),
        (lambda b: b.steady_map({"egr": [0.3]}), "soc_cad is missing"),
        (lambda b: b.find_optimum(bounds={"egr": (0.3, 0.1)}), re.escape("bounds: egr = (0.3, 0.1): must increase")),
        (lambda b: b.find_optimum({"cov_imep_percent": 1.0}), "'cov_imep_percent' is not an indicator"),
        (lambda _: VirtualEngine(inputs=["egr"]), "inputs: must begin with soc_cad"),
        (
            lambda _: VirtualEngine(inputs=["soc_cad", "boost"]),
            "inputs = 'boost': must be one of soc_cad, intake_pressure",
        ),
        (lambda _: VirtualEngine(limits=["nox_ppm"]), "limits: 'nox_ppm' is not measured.*did you mean"),
    ],
)
def test_refusals(call: object, message: str) -> None:
    bench = VirtualEngine(inputs=THREE)
    with pytest.raises(ParameterError, match=message):
        call(bench)  # type: ignore[operator]
    assert bench.cycle == 0
    assert bench.step({"soc_cad": -6.0, "egr": 0.1})["cycle"] == 0


def test_columns_must_fit() -> None:
    with pytest.raises(ShapeError, match="egr has 2 entries: give one per soc_cad, 3"):
        VirtualEngine(inputs=THREE).run_columns([-6.0, -5.0, -4.0], [[0.1, 0.2]])
    with pytest.raises(ShapeError, match="further has 1 entries: the bench takes 0 besides soc_cad"):
        VirtualEngine().step(-6.0, [0.1])


def seek(capsys: pytest.CaptureFixture[str], *argv: str, code: int = 0) -> str:
    assert main(["engine", "seek", *argv]) == code
    captured = capsys.readouterr()
    return captured.out if code == 0 else captured.err


SOUGHT = ("--input", "soc_cad=-20:5", "--input", "egr=0:0.4", "--input", "intake_pressure_kpa=120:220")


def test_the_command_seeks_several_inputs(capsys: pytest.CaptureFixture[str], tmp_path: object) -> None:
    file = f"{tmp_path}/cycles.csv"
    limits = ("--limit", "nox_true_ppm=700", "--limit", "p_max_bar=120")
    out = json.loads(seek(capsys, *SOUGHT, *limits, "--cycles", "40", "--seed", "3", "--json"))
    best = VirtualEngine(inputs=THREE).find_optimum(
        {"nox_true_ppm": 700.0, "p_max_bar": 120.0}, bounds=BOUNDS | {"soc_cad": (-20.0, 5.0)}
    )
    assert out["optimum"] == pytest.approx(dict(best.inputs))
    assert out["start"].keys() == out["inputs"].keys() == best.inputs.keys()
    assert out["figures"]["limit_nox_true_ppm"] == 700.0
    assert -0.5 < out["j_lost"] < 3.0
    text = seek(capsys, *SOUGHT, *limits, "--cycles", "4", "-o", file)
    assert "egr: start 0.2, best " in text
    assert "nox_true_ppm as measured: worst " in text
    with open(file) as table:  # noqa: PTH123
        assert "estimate_egr" in table.readline()


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("--input", "soc_cad=-61:5"), "--input soc_cad=-61:5: -61 must be in [-60, 20]"),
        (("--input", "egr=0:0.9"), "--input egr=0:0.9: 0.9 must be in [0, 0.5]"),
        (("--input", "egt=0:0.4"), "did you mean 'egr'?"),
        ((*SOUGHT, "--seeker", "golden_section", "--noise-sd", "0.2"), "golden section takes one input"),
        ((*SOUGHT, "--guide", "curve"), "--guide: guides soc_cad alone"),
        ((*SOUGHT, "--sensor", "analyser", "--seeker", "spsa"), "--seeker spsa: takes J of the same cycle"),
        ((*SOUGHT, "--start", "soc_cad=7"), "must have one number for each of soc_cad, egr, intake_pressure_kpa"),
    ],
)
def test_the_command_names_the_option(argv: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert message in seek(capsys, *argv, code=2)
