"""``task = "map"`` of an experiment: what is told belongs to its point, and a record gives the same map again."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.errors import Error, ParameterError
from mgdd.loop import VirtualTestBed
from mgdd.maps import read_map
from mgdd.rig import Experiment, run_experiment
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.experiment import check_experiment
from mgdd.rig.experiment.stand import Cycle

HEAD = 'kind = "experiment"\nformat = 1\nseed = 3\ntask = "map"\n'
AXES = "[map.axes]\nspeed_rpm = [1200, 1800, 2400]\nfuel_mg = [12, 20, 28]\n"
MODEL = 'guide = "model"\nscale = { wall_heat_scale = 2.0 }\n'
MAP = HEAD + "[map]\nvisits = 4\naveraged = 20\nsettling = 10\n" + MODEL + AXES + "[map.limits]\np_max_bar = 120\n"


def again(folder: Path) -> Any:
    return run_experiment(Experiment.load(folder / "experiment.toml").with_mode("replay", record=folder / "run.rec"))


def off(run: Any) -> np.ndarray[Any, Any]:
    """By how much each visit read another J than the engine has there, without noise."""
    visits = {name: run.dataset[f"visit_{name}"].to_numpy() for name in ("speed_rpm", "fuel_mg", "soc_cad", "j")}
    return np.asarray(visits["j"] - VirtualTestBed("puma_single").steady(visits)["j"])


def test_a_record_gives_the_same_map_whole_and_interrupted(tmp_path: Path) -> None:
    def stop(cycle: Cycle) -> None:
        if cycle.number == 75:  # in the third visit
            raise KeyboardInterrupt

    for name, watch, visits in (("whole", None, 4), ("cut", stop, 2)):
        run = run_experiment(Experiment.from_toml(MAP), tmp_path / name, watch=watch)
        assert run.interrupted is (watch is not None)
        assert run.dataset.sizes["visit"] == visits
        kept = read_map(tmp_path / name / "soc_cad.nc")
        np.testing.assert_array_equal(kept.values, run.dataset["soc_cad"])
        replayed = again(tmp_path / name)
        assert replayed.counters["replay"]["different"] == 0
        assert replayed.interrupted is run.interrupted
        assert replayed.dataset.identical(run.dataset)
    assert run.plot().get_xlabel() == "speed [rpm]"


@pytest.mark.parametrize("settling", [0, 20])
def test_what_is_told_was_read_at_its_point(settling: int) -> None:
    """A guard that steps back runs other points and inputs in between, and one that is slow is on its way to them."""
    keys = f"[map]\nvisits = 8\naveraged = 20\nsettling = {settling}\nstart = {{ soc_cad = 4 }}\n"
    guard = "[safety]\nrates = { speed_rpm = 100.0, fuel_mg = 2.0 }\nlimits = { p_max_bar = 95.0 }\n"
    quiet = "[plant]\nefficiency_noise_percent = 0.1\n"
    run = run_experiment(Experiment.from_toml(HEAD + keys + AXES + quiet + guard))
    assert run.counters["guard"]["limit"] > 5
    assert 4 <= np.isfinite(off(run)).sum() < 8
    assert np.nanmax(np.abs(off(run))) < 0.12  # points; the cells lie up to three apart
    assert [one["code"] for one in run.figures["findings"]] == ["failed_visits"]


@pytest.mark.slow
def test_a_bus_that_carries_the_axes_carries_the_search(tmp_path: Path) -> None:
    with pytest.raises(
        ParameterError, match=r"inputs = 'soc_cad': must be speed_rpm, fuel_mg, soc_cad: so task = 'map'"
    ):
        check_experiment(Experiment.from_toml(MAP).with_mode("hil"))
    shipped = SignalMap.load("engine").file
    shutil.copy(shipped.with_name("engine.dbc"), tmp_path)
    own = shipped.read_text(encoding="utf-8").replace(", Speed = 1500.0, Fuel = 0.0 }", " }", 1)
    axes = (
        'speed_rpm = { signal = "Speed", unit = "rpm", lower = 600.0, upper = 4000.0 }\n'
        'fuel_mg = { signal = "Fuel", unit = "mg", lower = 1.0, upper = 60.0 }\n'
        'soc_cad = { signal = "Timing"'
    )
    own = own.replace('soc_cad = { signal = "Timing"', axes, 1)
    (tmp_path / "bed.toml").write_text(own, encoding="utf-8")
    text = MAP.replace("visits = 4", "visits = 2") + f"[bus]\nmap = '{tmp_path / 'bed.toml'}'\n"
    there = run_experiment(Experiment.from_toml(text).with_mode("hil"), tmp_path / "run")
    assert np.abs(off(there)).max() < 0.3
    assert again(tmp_path / "run").dataset.identical(there.dataset)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[1200, 1800, 2400]", "3", "map.axes.speed_rpm = 3: must be a list of numbers"),
        ("[1200, 1800, 2400]", "[1200]", r"map.axes of speed_rpm = \[1200.0\]: must be two entries at least"),
        ("[1200, 1800, 2400]", "[0, 1800]", "map.axes at speed_rpm = 0, fuel_mg = 12: speed_rpm = 0"),
        ("speed_rpm", "speed", "map.axes: 'speed' is not a number of an operating point; did you mean 'speed_rpm'"),
        (AXES, "", "map.axes = {}: must be names with their entries"),
        ("visits = 4", "visits = 0", r"map.visits = 0: must be in \[1, "),
        ("visits = 4", "cycles = 4", "map: unknown.*cycles|map.cycles"),
        ('"model"', '"curve"', "map.guide = 'curve': must be one of none, model"),
        ("visits = 4", 'model = "nope"', "map.model = 'nope': no preset"),
        ("visits = 4", "tolerance = 0", "map.tolerance = 0: must be > 0"),
        ("visits = 4", "start = { egr = 1 }", "map.start has egr"),
        ("visits = 4", "inputs = { boost = [0, 1] }", "map.inputs = 'boost': must be one of soc_cad"),
        ("visits = 4", "inputs = { fuel_mg = [10, 20] }", "map.inputs: fuel_mg is an axis too"),
        ("visits = 4", "settings = { reach = 9 }", "map.settings: reach = 9: must be in"),
        ("visits = 4", "settings = { kep = 9 }", "map.settings: 'kep': must be one of .*did you mean 'kept'"),
        ("p_max_bar = 120", "p_mx_bar = 120", "map.limits.*p_mx_bar.*did you mean 'p_max_bar'"),
        ("p_max_bar = 120", "cov_imep_percent = 3", "map.limits: cov_imep_percent has no steady value"),
    ],
)  # fmt: skip
def test_what_a_search_refuses_is_named_as_its_key(old: str, new: str, said: str) -> None:
    assert old in MAP
    with pytest.raises(Error, match=said):
        check_experiment(Experiment.from_toml(MAP.replace(old, new), origin="file"))
