"""One model through the chain: a fit, its model, its file or a plant of one's own where a throttle is meant."""

import json
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.errors import DataError, ParameterError
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.loop import VirtualThrottle, track, track_many, tune_controller, tuned_controller
from mgdd.rig import Experiment, run_experiment
from mgdd.rig.experiment import check_experiment
from mgdd.rig.experiment.checked import simulated_plant
from mgdd.throttle import PseudoWiener, Throttle, simulate_throttle

FIT = FirstPrincipleModel(
    parameters={
        "tau_s": 0.04, "gain_deg_per_s2_per_duty": 6e4, "beta_above_duty": 0.12, "kappa_above_duty_per_deg": 0.9e-3,
        "beta_below_duty": 0.08, "kappa_below_duty_per_deg": 2e-3, "delta_duty": 0.06, "limp_home_deg": 9.0,
        "electrical_s": 1e-3, "viscous_share": 0.3, "delay_samples": 2.4,
    },
    closed_deg=1.0,
    open_deg=88.0,
)  # fmt: skip


PID = tuned_controller("pid", Throttle())


class Leaf:
    """A plate that lags behind what its duty lifts it to; it knows nothing of this package."""

    def __init__(self, angle_deg: float = 10.0) -> None:
        self.output = angle_deg

    def step(self, duty: float) -> None:
        self.output += 0.02 * (8.0 + 120.0 * duty - self.output)


@pytest.mark.parametrize("kind", ["mgdd1", "guided"])
def test_a_fit_moves_as_every_throttle_with_its_groups(kind: str) -> None:
    runs = []
    for known in ({"resistance_ohm": 1.3, "supply_v": 13.5, "inertia_kgm2": 9e-4}, None):
        plant = FIT if known is None else FIT.to_throttle(**known)
        runs.append(track(tuned_controller(kind, FIT), "step:20:50", throttle=plant, delay_samples=2, seed=4))
    own, fit = runs
    assert abs(own["angle_deg"] - fit["angle_deg"]).max() < 1e-6
    assert "current_a" in own
    assert "current_a" not in fit
    assert float(fit["settling_ms"]) == float(own["settling_ms"])


def test_fit_model_and_file_are_one_plant_with_its_delay(tmp_path: Path) -> None:
    file = tmp_path / "fit.toml"
    file.write_text(FIT.to_toml())
    for controller, plant in ((tuned_controller("guided", str(file)), file), (tuned_controller("guided", FIT), FIT)):
        run = track(controller, "step:40:45", throttle=plant, seed=2)
        assert run.attrs["delay_samples"] == 2  # of 2.4
        stated = track(tuned_controller("guided", FIT), "step:40:45", throttle=FIT, delay_samples=2, seed=2)
        np.testing.assert_array_equal(run["duty"], stated["duty"])
    tuned = tune_controller("pid", file, n_throttles=2, budget=30, seed=1)
    assert tuned.settings["delay_samples"] == 2
    assert tuned.cost <= tuned.start_cost


def test_a_virtual_throttle_is_the_fit_sample_by_sample_with_its_delay(tmp_path: Path) -> None:
    file = tmp_path / "fit.toml"
    file.write_text(FIT.to_toml())
    run = track(tuned_controller("guided", FIT), "step:20:50", throttle=FIT, noise_deg=0.0, seed=2)
    duty, angle = run["duty"].to_numpy(), run["angle_deg"].to_numpy()
    for given in (FIT, file):
        plant = VirtualThrottle(given, start_deg=20.0)
        assert plant.delay_samples == 2  # of 2.4
        rows: list[dict[str, Any]] = []
        for k, value in enumerate(duty[:300]):
            if k == 140:
                plant = pickle.loads(pickle.dumps(plant))
            plant.apply({"duty": value})
            rows.append(dict(plant.measure().values))
        np.testing.assert_array_equal([row["angle_deg"] for row in rows], angle[:300])
        assert all(math.isnan(row["current_a"]) and math.isnan(row["supply_v"]) for row in rows)
    stated = VirtualThrottle(Throttle(), delay_samples=1, start_deg=8.0)
    for waits in (True, False):
        stated.apply({"duty": 0.5})
        assert (stated.measure().values["current_a"] == 0.0) == waits


def test_an_experiment_simulates_a_fit_beside_it(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FIT.to_toml())
    text = (
        'kind = "experiment"\nformat = 1\nseed = 3\ntask = "track"\n[track]\nreference = "step:20:35"\n'
        'model = "mine.toml"\n[plant]\npreset = "mine.toml"\nsample_s = 0.001\n[plant.scale]\ncoulomb_nm = 1.2\n'
    )
    (tmp_path / "experiment.toml").write_text(text)
    checked = check_experiment(Experiment.load(tmp_path / "experiment.toml"))
    plant = simulated_plant(checked.experiment, sample_s=1e-3, inputs=("duty", "bridge_open"))
    assert isinstance(plant, VirtualThrottle)
    assert plant.delay_samples == 2
    whole = FIT.to_throttle(resistance_ohm=1.0, supply_v=12.0, inertia_kgm2=2e-3)
    assert plant.throttle.coulomb_nm == pytest.approx(1.2 * whole.coulomb_nm)
    result = run_experiment(checked.experiment, folder=tmp_path / "run")
    assert result.figures["settling_ms"] < 100.0


def test_a_pseudo_wiener_model_moves_as_its_free_run() -> None:
    class Play:
        def __init__(self) -> None:
            self.duty = iter(0.1 + 0.2 * np.sin(np.arange(150) / 9.0))

        def step(self, _reference: float, _measured: float) -> float:
            return float(next(self.duty))

    model = PseudoWiener("pw_r", {"delay_samples": 3.0})
    run = track(Play(), np.full(150, 20.0), throttle=model, noise_deg=0.0)
    assert run.attrs["delay_samples"] == 3
    duty = np.r_[np.zeros(3), run["duty"].to_numpy()[:-3]]
    free = model.replace(delay_samples=0.0).simulate(
        {"time_s": np.arange(151) * 1e-3, "duty": np.r_[duty, 0.0]}, initial_state={"angle_deg": 20.0}
    )
    np.testing.assert_allclose(run["angle_deg"], free["angle_deg"][1:], atol=1e-9)


def test_a_plant_of_ones_own_runs_and_is_tuned_for() -> None:
    leaf = Leaf()
    run = track(PID, "step:30:40", throttle=leaf, delay_samples=0, noise_deg=0.0)
    assert leaf.output == float(run["angle_deg"][-1])  # left in the state after the run
    assert set(run.data_vars) >= {"duty", "angle_deg", "sensed_angle_deg"}
    assert not {"current_a", "speed_deg_per_s"} & set(run.data_vars)
    assert all(run[name].units for name in run.data_vars)
    again = track(PID, "step:30:40", throttle=Leaf(), delay_samples=0, noise_deg=0.5, seed=3)
    noise = (again["sensed_angle_deg"] - again["angle_deg"]).to_numpy()
    assert 0.4 < noise.std() < 0.6
    plants = [Leaf(10.0), Leaf(12.0)]
    tuned = tune_controller("pid", plants, model=FIT, budget=30, delay_samples=0)
    assert tuned.settings["n_throttles"] == 2
    assert [plant.output for plant in plants] == [10.0, 12.0]  # every run has a copy
    made = tuned_controller("pid", FIT, numbers=tuned.numbers, delay_samples=0)
    runs = track_many({"pid": made}, ["step:30:40"], plants, delay_samples=0)
    one = track(made, "step:30:40", throttle=Leaf(12.0), delay_samples=0, seed=1)
    assert float(runs["mse_deg2"][1, 0, 0]) == float(one["mse_deg2"])


def test_simulate_runs_a_fit_as_its_model_does() -> None:
    duty = 0.2 + 0.1 * np.sin(np.arange(300) / 20.0)
    run = simulate_throttle(FIT, duty, start_deg=20.0)
    own = FIT.simulate({"time_s": np.arange(300) * 1e-3, "duty": duty}, initial_state={"angle_deg": 20.0})
    np.testing.assert_array_equal(run["angle_deg"], own["angle_deg"])


class Blind:
    def step(self, duty: float) -> None: ...


class Lost(Leaf):
    def step(self, duty: float) -> None:  # noqa: ARG002
        self.output = math.nan


@pytest.mark.parametrize(
    ("call", "kind", "word"),
    [
        (lambda: track(PID, "step:40:42", throttle=FIT, supply_v=11.0), ParameterError, "to_throttle"),
        (lambda: track(PID, "step:40:42", throttle=Leaf(), airflow_torque_nm=0.1), ParameterError, "step"),
        (lambda: track(PID, "step:40:42", throttle=Leaf(), start_deg=3.0), ParameterError, "starts where it is"),
        (lambda: track(PID, "step:40:42", throttle=Blind()), ParameterError, "output"),
        (lambda: track(PID, "step:40:42", throttle=Lost()), ParameterError, "finite"),
        (lambda: track(PID, "step:40:42", throttle=3.0), ParameterError, "first-principle fit"),
        (lambda: tune_controller("pid", Leaf()), ParameterError, "model"),
        (lambda: tune_controller("pid", []), ParameterError, "at least one"),
        (lambda: simulate_throttle(FIT, 0.3, supply_v=11.0), ParameterError, "to_throttle"),
        (lambda: simulate_throttle(FIT, 0.3, bridge="open"), ParameterError, "bridge"),
        (lambda: VirtualThrottle(FIT, inputs=("duty", "supply_v")), ParameterError, "inputs = 'supply_v'.*to_throttle"),
        (lambda: VirtualThrottle(PseudoWiener("pw_r", {})), ParameterError, "first-principle fit"),
        (lambda: VirtualThrottle(delay_samples=2.5), ParameterError, "delay_samples = 2.5: must be a whole number"),
        (lambda: track(PID, "step:40:42", delay_samples=2.5), ParameterError, "delay_samples = 2.5: must be a whole"),
        (lambda: VirtualThrottle(delay_samples=21), ParameterError, r"delay_samples = 21: must be in \[0, 20\]"),
        (lambda: track(PID, "step:40:42", throttle="P9.toml"), (DataError, FileNotFoundError), "P9"),
    ],
)
def test_refusals_name_field_and_remedy(call: Any, kind: Any, word: str) -> None:
    with pytest.raises(kind, match=word):
        call()


def test_the_command_line_takes_a_fit_where_it_takes_a_preset(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "own.toml"
    file.write_text(FIT.to_toml())
    payloads = []
    for argv in (
        ["track", "--controller", "guided", "--plant-scale", "coulomb_nm=1.4"],
        ["tune", "--controller", "pid", "--budget", "30", "--throttles", "2"],
        ["simulate", "--duty", "0.3"],
    ):
        assert main(["throttle", *argv, "--preset", str(file), "--json"]) == 0
        payloads.append(json.loads(capsys.readouterr().out))
        assert payloads[-1]["preset"] == "own"
    assert payloads[1]["delay_samples"] == 2
    assert payloads[2]["start_angle_deg"] == 9.0
    assert main(["throttle", "track", "--preset", str(file), "--airflow", "0.1"]) == 2
    assert "--airflow = 0.1" in capsys.readouterr().err
    assert main(["throttle", "tune", "--preset", str(file), "--set", "coulomb_nm=1"]) == 2
    assert "--set" in capsys.readouterr().err


def test_the_command_line_tracks_with_what_it_tuned(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, numbers = tmp_path / "own.toml", tmp_path / "pid.json"
    file.write_text(FIT.to_toml())
    own = ["--preset", str(file), "--controller", "pid", "--json"]
    assert main(["throttle", "tune", *own, "--budget", "30", "--throttles", "2"]) == 0
    numbers.write_text(capsys.readouterr().out)
    assert main(["throttle", "track", *own, "--numbers", str(numbers), "--seed", "3"]) == 0
    tracked = json.loads(capsys.readouterr().out)
    tuned = tuned_controller("pid", FIT, numbers=json.loads(numbers.read_text())["numbers"])
    assert tracked["mse_deg2"] == float(track(tuned, "step:40:42", throttle=FIT, seed=3)["mse_deg2"])
    assert main(["throttle", "track", "--controller", "guided", "--numbers", str(numbers)]) == 2
    assert "these are of pid" in capsys.readouterr().err
    numbers.write_text("{}")
    assert main(["throttle", "track", *own, "--numbers", str(numbers)]) == 2
    assert "tune --json" in capsys.readouterr().err


def test_an_excitation_is_designed_on_a_fit_and_a_file_of_one_is_no_preset(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "own.toml"
    file.write_text(FIT.to_toml())
    assert main(["throttle", "excite", "chirp", "--preset", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["preset"] == "own"
    with pytest.raises(DataError, match="load_throttle_model"):
        simulate_throttle(file, 0.3)
