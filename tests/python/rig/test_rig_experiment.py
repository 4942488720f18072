"""Experiments from a file: what the file may hold, runs in process, the folder of a run, and what a kill leaves."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd._core.loop import tracking_figures
from mgdd.errors import DataError, Error, ParameterError, RigError
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.loop import Reference
from mgdd.results.labels import check_labels
from mgdd.rig import Experiment, SafetyEnvelope, read_record, recorded, run_experiment
from mgdd.rig.experiment import check_experiment
from mgdd.rig.experiment.stand import Cycle
from mgdd.rig.experiment.tasks import TrackPlan

HEAD = 'kind = "experiment"\nformat = 1\nseed = 5\n'
TRACK = HEAD + 'task = "track"\n[track]\nreference = "step:20:35"\ncontroller = "pid"\n'
SEEK = HEAD + 'task = "seek"\n[seek]\ncycles = 60\n[seek.limits]\np_max_bar = 110.0\n'
IDENTIFY = HEAD + 'task = "identify"\n[identify]\nmodel = "pw_r"\nduration_s = 4.0\n'


def experiment(text: str) -> Experiment:
    return Experiment.from_toml(text)


@pytest.mark.parametrize("text", [TRACK, SEEK, IDENTIFY])
def test_a_file_comes_back_equal(text: str) -> None:
    known = experiment(text)
    again = experiment(known.to_toml())
    assert again == known
    assert again.to_toml() == known.to_toml()
    assert known.mode == "simulate"


def test_bounds_and_start_have_the_names_of_inputs() -> None:
    known = experiment(SEEK + "[seek.inputs]\nsoc_cad = [-20, 5.5]\n[seek.start]\nsoc_cad = 2\n")
    assert known.settings.inputs == {"soc_cad": (-20.0, 5.5)}
    assert Experiment.from_toml(known.to_toml()) == known


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TRACK.replace('"experiment"', '"signal_map"'), r"file: kind = 'signal_map': must be 'experiment'"),
        (TRACK.replace("format = 1", "format = 2"), r"format = 2: must be 1"),
        (TRACK.replace('task = "track"', 'task = "drive"'), r"task = 'drive': must be one of identify, track, seek"),
        (SEEK + "[seek.inputs]\nsoc_cad = [-20]\n", r"seek.inputs.soc_cad = \[-20\]: must be \[lower, upper\]"),
        (SEEK + "[seek.inputs]\negr = [1, 0]\n", r"seek.inputs.egr = .*must be lower < upper, both finite"),
        (SEEK.replace("110.0", "[1, 2, 3]"), r"seek.limits.p_max_bar = .*\[lower, upper\], one of which"),
        (SEEK + "[seek.inputs]\nsoc_cad = [5, -20]\n", r"seek.inputs.soc_cad = .*must be lower < upper"),
        (SEEK.replace("cycles", 'seeker = "nelder"\ncycles'), r"seek.seeker = 'nelder': must be one of auto, curve_"),
        (TRACK + "speed = 3\n", r"track.speed = 3: must be one of the keys reference"),
        (TRACK + "controllr = 'pid'\n", r"track.controllr = 'pid': .*did you mean 'controller'"),
        (TRACK.replace('"pid"', '"bang"'), r"track.controller = 'bang': must be one of guided"),
        (TRACK.replace('"pid"', "3"), r"track.controller = 3: must be text in quotes"),
        (TRACK + "[seek]\ncycles = 3\n", r"file: seek = .*: must be one of the keys"),
        (TRACK + "[plant]\nnoise_deg = -1.0\n", r"plant.noise_deg = -1: must be in \[0, 10\]"),
        (TRACK + "[plant]\nnoise_deg = nan\n", r"plant.noise_deg = nan: must be in \[0, 10\]"),
        (TRACK + "[plant.scale]\ncoulomb_nm = 'more'\n", r"plant.scale.coulomb_nm = 'more': must be a finite number"),
        (TRACK + "[bus]\npace = 'slow'\n", r"bus.pace = 'slow': must be one of step, real_time"),
        (TRACK.replace("seed = 5", "seed = -1"), r"seed = -1: must be in \[0, 2\*\*64\)"),
        (TRACK.replace("seed = 5", "mode = 'bench_now'"), r"mode = 'bench_now': must be one of simulate, hil"),
        (SEEK.replace("cycles = 60", "cycles = 0"), r"seek.cycles = 0: must be in \[1, "),
        (SEEK.replace("cycles = 60", "cycles = 60.5"), r"seek.cycles = 60.5: must be a whole number"),
    ],
)
def test_a_wrong_key_is_named_with_its_value_and_remedy(text: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        Experiment.from_toml(text, origin="file")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("start = { soc_cad = 50 }", "seek.start: soc_cad = 50: must be in"),
        ("tolerance = { egr = 1 }", "seek.tolerance has egr: must have one number for each of soc_cad"),
        ('settings = { memory_cycles = "x" }', "seek.settings: memory_cycles = 'x'"),
        ("settings = { start = 1 }", "seek.settings: 'start' is not one of them"),
        ("cycles = 1", "seek.cycles = 1: must be >= 2"),
        ("noise_sd = 0", "seek.noise_sd = 0: must be > 0"),
        ('model = "nope"', "seek.model = 'nope': no preset"),
        ("scale = { a = 1 }", "seek.scale = 'a'"),
        ("inputs = { boost = [0, 1] }", "seek.inputs = 'boost': must be one of soc_cad"),
        ("limits = { p_mx_bar = [9, inf] }", "seek.limits: 'p_mx_bar' is not measured.*did you mean 'p_max_bar'"),
    ],
)
def test_what_a_search_refuses_is_named_as_its_key(keys: str, said: str) -> None:
    text = f'kind = "experiment"\nformat = 1\ntask = "seek"\n[seek]\n{keys}\n'
    with pytest.raises(Error, match=said):
        check_experiment(experiment(text))


def test_a_missing_key_or_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="task is missing"):
        experiment(HEAD)
    with pytest.raises(DataError, match="not valid TOML"):
        experiment("kind = ")
    with pytest.raises(FileNotFoundError, match=r"away\.toml"):
        Experiment.load(tmp_path / "away.toml")


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        (TRACK.replace("step:20:35", "steps:20"), ParameterError, "reference = 'steps:20'"),
        (TRACK + 'model = "P9"\n', ParameterError, "P9"),
        (TRACK + 'model = "away.toml"\n', FileNotFoundError, r"away\.toml"),
        (TRACK + '[safety]\nenvelope = "ebt"\n', DataError, "ebt"),
        (SEEK + '[plant]\npreset = "P1"\n', ParameterError, "P1"),
        (SEEK + "[seek.start]\nsoc_cad = 40\n", ParameterError, r"soc_cad = 40: must be in \[-30, 10\], its bounds"),
        (
            SEEK.replace("cycles", 'seeker = "golden_section"\ncycles'),
            ParameterError,
            r"golden_section': needs seek.noise_sd",
        ),
        (TRACK + "[plant.scale]\ncoulomb = 1.2\n", ParameterError, r"plant.scale = 'coulomb': must be a number of"),
        (TRACK + "[plant.scale]\ncoulomb_nm = -1.2\n", ParameterError, r"plant.scale: coulomb_nm = -0.34\d* N m"),
        (TRACK + '[plant]\npreset = "puma_single"\n', ParameterError, "is an engine, not a throttle"),
        (SEEK.replace("p_max_bar", "p_max"), ParameterError, "'p_max' is not measured"),
        (TRACK + "[safety]\nrate_cad = 2.0\n", ParameterError, r"safety.rate_cad = 2: must be left out for a throttle"),
        (TRACK + "[safety.limits]\ncurrent_a = 3.0\n", ParameterError, r"safety.limits = .*current_a.* for a throttle"),
        (SEEK + '[safety]\nenvelope = "my.toml"\n', ParameterError, r"safety.envelope = 'my.toml': .* for an engine"),
        (TRACK.replace("20:35", "20:95"), ParameterError, r"track.reference = '20 to 95 deg': must be within .*90 deg"),
    ],
)
def test_what_a_file_names_is_checked_before_anything_runs(text: str, error: type[Exception], said: str) -> None:
    known = experiment(text)
    for call in (check_experiment, run_experiment):
        with pytest.raises(error, match=said) as caught:
            call(known)
        assert "experiment: " in str(caught.value)  # the file


def test_a_run_that_never_began_leaves_no_folder(tmp_path: Path) -> None:
    """The same folder serves once the cause is mended; one that was there stays, empty as it was."""
    known = experiment(TRACK + '[bus]\nconnection = "virtual:none"\npace = "real_time"\n').with_mode("bench")
    with pytest.raises(RigError, match="drives real hardware"):
        run_experiment(known, tmp_path / "run")
    assert not (tmp_path / "run").exists()
    (tmp_path / "made").mkdir()
    with pytest.raises(RigError, match="drives real hardware"):
        run_experiment(known, tmp_path / "made")
    assert list((tmp_path / "made").iterdir()) == []


def test_modes_that_drive_or_listen_need_what_they_need() -> None:
    known = experiment(TRACK)
    wired = experiment(TRACK + '[bus]\nconnection = "virtual:none"\n')
    with pytest.raises(ParameterError, match=r"bus\.pace = 'step': must be 'real_time' with mode = 'bench'"):
        check_experiment(wired.with_mode("bench"))
    with pytest.raises(ParameterError, match="arm = True: must be left out with mode = 'simulate'"):
        run_experiment(known, arm=True)
    slow = experiment(TRACK + '[bus]\nconnection = "virtual:none"\npace = "real_time"\n[plant]\nsample_s = 0.001\n')
    with pytest.raises(ParameterError, match=r"sample_s = 0.001: must be 0.005 s, the cycle time of ETB_Status"):
        check_experiment(slow.with_mode("dry_run"))


def test_tracking_is_the_loop_of_the_library_behind_a_gate() -> None:
    """The same controller on the same throttle: once the plate has arrived, both stand where the reference is."""
    result = run_experiment(experiment(TRACK))
    check_labels(result.dataset)
    late = result.dataset["sensed_angle_deg"].to_numpy()[-200:]
    assert abs(late.mean() - 35.0) < 0.1
    assert result.figures["static_error_deg"] < 0.1
    assert result.counters["gate"]["requested"] == 2
    assert result.events == ("safety gate: init -> armed: requested", "safety gate: armed -> run: requested")
    duty = result.dataset["duty"].to_numpy()
    envelope = check_experiment(experiment(TRACK)).envelope
    assert envelope is not None
    assert np.abs(duty).max() <= envelope.duty_limit
    assert np.abs(np.diff(duty)).max() <= envelope.slew_per_s * 1e-3 + 1e-12


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_controller_that_learns_knows_the_bounds_of_its_gate(tmp_path: Path, seed: int) -> None:
    """Untold, it takes the slew of the gate for a delay and moves the plate about at rest: variation 14 to 26."""
    text = TRACK.replace("seed = 5", f"seed = {seed}").replace('"pid"', '"guided"').replace("20:35", "20:45")
    run = run_experiment(experiment(text + "[plant]\nscale = { coulomb_nm = 1.2 }\n"), tmp_path / "run")
    assert run.figures["total_variation"] < 10.0
    assert run.figures["settling_ms"] < 80.0


def test_equal_seeds_are_equal_runs_and_others_are_not() -> None:
    first, again = run_experiment(experiment(TRACK)), run_experiment(experiment(TRACK))
    other = run_experiment(experiment(TRACK.replace("seed = 5", "seed = 6")))
    name = "sensed_angle_deg"
    np.testing.assert_array_equal(first.dataset[name], again.dataset[name])
    assert (first.dataset[name].to_numpy() != other.dataset[name].to_numpy()).any()


def test_one_name_of_a_figure_has_one_meaning(tmp_path: Path) -> None:
    """`settling_ms` is of the true angle, as in `mgdd.loop.track`; of the measured one it has a name of its own."""
    known = Experiment.from_toml(TRACK + "[plant]\nnoise_deg = 0.1\n")
    result = run_experiment(known, tmp_path / "run")
    wanted = Reference.parse("step:20:35")
    for prefix, name in (("", "angle_deg"), ("sensed_", "sensed_angle_deg")):
        angle, duty = result.dataset[name].to_numpy(), result.dataset["duty"].to_numpy()
        expected = tracking_figures(
            reference_deg=wanted.angle_deg, angle_deg=angle, duty=duty, sample_s=1e-3,
            from_sample=wanted.from_sample, band_deg=wanted.band_deg,
        )  # fmt: skip
        assert {f"{prefix}{figure}" for figure in expected} - set(result.figures) <= {"sensed_total_variation"}
        for figure in ("settling_ms", "mse_deg2", "limit_cycle_deg", "static_error_deg"):
            assert result.figures[prefix + figure] == float(expected[figure])
    assert result.figures["sensed_limit_cycle_deg"] > result.figures["limit_cycle_deg"]
    check_labels(result.dataset)
    again = run_experiment(known.with_mode("replay", record=str(tmp_path / "run" / "run.rec")))
    assert again.figures["settling_ms"] == result.figures["settling_ms"]
    over_bus = run_experiment(known.with_mode("hil"))
    assert "settling_ms" not in over_bus.figures
    assert over_bus.figures["sensed_mse_deg2"] == pytest.approx(result.figures["sensed_mse_deg2"], rel=0.2)


def test_a_plant_that_differs_from_the_model_is_scaled_with_its_stiction() -> None:
    weak = run_experiment(experiment(TRACK))
    sticky = run_experiment(experiment(TRACK + "[plant.scale]\ncoulomb_nm = 1.5\n"))
    assert sticky.figures["mse_deg2"] != weak.figures["mse_deg2"]


def test_identification_finds_the_throttle_and_keeps_the_model(tmp_path: Path) -> None:
    result = run_experiment(experiment(IDENTIFY), tmp_path / "run")
    assert result.figures["fit_percent_train"] > 98.0
    assert result.figures["parameters"]["above_coulomb_duty"] == pytest.approx(0.0925, rel=0.03)
    from mgdd.identify import load_throttle_model

    assert load_throttle_model(tmp_path / "run" / "fit.toml") is not None
    again = Experiment.from_toml(TRACK + f'model = "{tmp_path / "run" / "fit.toml"}"\n')
    assert abs(run_experiment(again).figures["static_error_deg"]) < 0.2


def test_the_controller_of_a_run_takes_the_delay_of_its_model_and_doubts_are_told(tmp_path: Path) -> None:
    """The model of a log at 2 ms with four samples of delay: eight of the run's; a preset has none."""
    groups = {**FirstPrincipleModel().parameters, "delay_samples": 4.0}
    (tmp_path / "late.toml").write_text(FirstPrincipleModel(parameters=groups, sample_s=2e-3).to_toml())
    late = TRACK + f'model = "{tmp_path / "late.toml"}"\n'
    for text, delay in ((TRACK, 0), (late, 8), (late + "delay_samples = 1\n", 1)):
        plan = check_experiment(experiment(text.replace('"pid"', '"guided"'))).plan
        assert isinstance(plan, TrackPlan)
        assert plan.controller().settings["delay_samples"] == delay  # type: ignore[attr-defined]
    known = check_experiment(experiment(late))
    assert "delay_samples = 8 at sample_s = 0.001: the numbers of 'pid'" in known.to_dict()["warnings"][0]
    assert run_experiment(known).figures["warnings"] == known.to_dict()["warnings"]
    assert check_experiment(experiment(TRACK + "delay_samples = 3\n")).to_dict()["warnings"] == []


def test_a_clamp_of_the_gate_is_no_delay_of_the_plate(tmp_path: Path) -> None:
    """Where the controller does not hear of it, the duty moves by 2.2 to 4.5, and by 7 to 38 without the bounds."""
    (tmp_path / "tight.toml").write_text(SafetyEnvelope(duty_limit=0.35).to_toml())
    text = TRACK.replace('"pid"', '"guided"') + f'[safety]\nenvelope = "{tmp_path / "tight.toml"}"\n'
    figures = run_experiment(experiment(text + "[plant]\nscale = { coulomb_nm = 1.2 }\n")).figures
    assert figures["total_variation"] < 1.8
    assert figures["settling_ms"] < 120.0


@pytest.mark.parametrize("guide", ["curve", "feed_forward", "none"])
def test_seeking_stays_inside_its_bounds_and_says_what_guided_it(guide: str) -> None:
    result = run_experiment(
        experiment(
            SEEK.replace("cycles = 60", f'cycles = 60\nguide = "{guide}"') + "[seek.inputs]\nsoc_cad = [-12, 10]\n"
        )
    )
    check_labels(result.dataset)
    applied = result.dataset["applied"][:, 0].to_numpy()
    assert applied.min() >= -12.0
    assert result.figures["guide"] == guide
    assert result.counters["guard"]["bounds"] == 0
    assert np.abs(np.diff(applied)).max() <= 5.0 + 1e-12


def test_hard_limits_step_back_and_are_told() -> None:
    text = SEEK.replace("p_max_bar = 110.0", "p_max_bar = 130.0") + "[safety.limits]\np_max_bar = 85.0\n"
    result = run_experiment(experiment(text))
    assert result.counters["guard"]["limit"] > 0
    assert any("limit p_max_bar" in event for event in result.events)


def test_the_folder_of_a_run_holds_what_belongs_to_it(tmp_path: Path) -> None:
    known = experiment(TRACK)
    result = run_experiment(known, tmp_path / "runs" / "one")
    folder = tmp_path / "runs" / "one"
    assert {"experiment.toml", "run.json", "run.rec", "timing.json", "signals.nc", "result.json", "track.png"} == {
        entry.name for entry in folder.iterdir()
    }
    assert Experiment.load(folder / "experiment.toml") == known
    kept: dict[str, Any] = json.loads((folder / "result.json").read_text())
    assert kept["result"]["settling_ms"] == result.figures["settling_ms"]
    said = json.loads((folder / "run.json").read_text())
    assert said["mgdd"]
    assert said["envelope"]["duty_limit"] == 0.8
    with xr.open_dataset(folder / "signals.nc", engine="scipy") as stored:
        np.testing.assert_array_equal(stored["duty"], result.dataset["duty"])
    with pytest.raises(RigError, match=r"holds experiment.toml already; name a new folder"):
        run_experiment(known, folder)
    (tmp_path / "a_file").write_text("")
    with pytest.raises(RigError, match=r"a_file.*name another one"):
        run_experiment(known, tmp_path / "a_file")


def test_a_folder_keeps_the_files_that_a_run_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run moved elsewhere can be replayed: reference, envelope and plant are with it."""
    home, run = tmp_path / "home", tmp_path / "elsewhere" / "run"
    home.mkdir()
    time_s = np.arange(600) * 1e-3
    rows = np.c_[time_s, 20.0 + 10.0 * (time_s > 0.3)]
    np.savetxt(home / "steps.csv", rows, delimiter=",", header="time_s,reference_deg", comments="")
    (home / "mine.toml").write_text(SafetyEnvelope.load("etb").replace(duty_limit=0.5).to_toml())
    text = TRACK.replace("step:20:35", "steps.csv") + '[safety]\nenvelope = "mine.toml"\n'
    (home / "track.toml").write_text(text)
    result = run_experiment(Experiment.load(home / "track.toml"), run)
    assert np.abs(result.dataset["duty"]).max() <= 0.5
    (home / "steps.csv").unlink()
    (home / "mine.toml").unlink()
    monkeypatch.chdir(tmp_path)
    again = Experiment.load(run / "experiment.toml").with_mode("replay", record=run / "run.rec")
    read, whole = [], recorded.read_record
    monkeypatch.setattr(recorded, "read_record", lambda path: read.append(path) or whole(path))
    assert run_experiment(again).counters["replay"]["different"] == 0
    assert len(read) == 1, "a record may be long"


def test_a_gate_that_takes_the_drive_away_ends_the_run_and_keeps_what_was_recorded(tmp_path: Path) -> None:
    """A plate held against its stop by full duty: the heat model or the stall monitor acts."""
    text = TRACK.replace("step:20:35", "step:20:89.9").replace(
        '"pid"', '"pid"\n[plant.scale]\nspring_above_nm_per_rad = 60.0'
    )
    with pytest.raises(RigError, match=r"the safety gate went to 'limp': (stall|heat)"):
        run_experiment(experiment(text), tmp_path / "run")
    left = {entry.name for entry in (tmp_path / "run").iterdir()}
    assert "run.rec" in left
    assert "result.json" not in left


def test_ctrl_c_keeps_the_cycles_so_far(tmp_path: Path) -> None:
    def watch(cycle: Cycle) -> None:
        if cycle.number == 700:
            raise KeyboardInterrupt

    result = run_experiment(experiment(TRACK), tmp_path / "run", watch=watch)
    assert result.interrupted
    assert result.dataset.sizes["time_s"] == 700
    assert json.loads((tmp_path / "run" / "result.json").read_text())["interrupted"] is True


def test_a_killed_run_keeps_its_record(tmp_path: Path) -> None:
    file, folder = tmp_path / "slow.toml", tmp_path / "run"
    file.write_text(TRACK)
    code = (
        "import sys, time; from mgdd.rig import Experiment, run_experiment\n"
        "def watch(cycle):\n"
        "    if cycle.number == 400: print('there', flush=True); time.sleep(60)\n"
        f"run_experiment(Experiment.load({str(file)!r}), {str(folder)!r}, watch=watch)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    time.sleep(0.05)
    assert Experiment.load(folder / "experiment.toml") == experiment(TRACK)
    envelope = check_experiment(experiment(TRACK)).envelope
    assert envelope is not None
    before = 2 * math.ceil(envelope.good_frames)  # until the gate runs
    record = read_record(folder / "run.rec")
    assert record.samples["rig"].sizes["time_s"] == before + 401
    assert record.ignored_bytes == 0
    assert not (folder / "result.json").exists()
