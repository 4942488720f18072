"""Plants that fail for some inputs: every seeker backs off, says so, tries again, and goes on where the region goes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.guide import FeedForward
from mgdd.loop import Measurement, run_seeker
from mgdd.optimize import (
    ExtremumSeeking,
    GaussianProcessSeeking,
    GradientDescent,
    Seeker,
    Spsa,
)

SPACE: dict[str, Any] = {"start": -5.0, "bounds": (-20.0, 20.0)}
# A process knows by itself which inputs fail, and sets no edges.
MAKERS = {name: make for name, make in stepped(**SPACE).items() if name != "GaussianProcessSeeking"}
every = pytest.mark.parametrize("name", MAKERS)


class Failing:
    """J is best at 6; what is asked above `edge` fails, and so does a share of all cycles."""

    input_names = ("u",)
    limit_names = ()

    def __init__(self, edge: float = 3.0, share: float = 0.0, seed: int = 0) -> None:
        self.edge, self.share, self.rng, self.u = edge, share, np.random.default_rng(seed), 0.0

    def apply(self, inputs: Mapping[str, float]) -> None:
        self.u = inputs["u"]

    def measure(self) -> Measurement:
        failed = self.u > self.edge or self.rng.random() < self.share
        j = 50.0 - 0.03 * (self.u - 6.0) ** 2 + self.rng.normal(0.0, 0.3)
        return Measurement(components=(j,), misfire=bool(failed))


@every
def test_at_most_a_tenth_fails_and_the_run_says_where(name: str) -> None:
    for seed in range(5):
        seeker = MAKERS[name]()
        run = run_seeker(Failing(seed=seed), seeker, 600)
        assert run.dataset["misfire"].to_numpy()[200:].mean() <= 0.05, seed
        assert 3.0 < seeker.failing_above[0] < 9.0
        assert np.isneginf(seeker.failing_below[0])
        assert not seeker.failing_everywhere
        assert seeker.estimate[0] <= 3.0
        assert [(finding.code, finding.names) for finding in run.findings] == [("failing_inputs", ("input[0]",))]
        assert "fails at input[0]" in str(run.findings[0])


@every
def test_a_region_that_goes_away_is_entered_again(name: str) -> None:
    for seed in range(3):
        plant, seeker = Failing(seed=seed), MAKERS[name]()
        run_seeker(plant, seeker, 300)
        plant.edge = 99.0
        run = run_seeker(plant, seeker, 2000)
        assert not run.findings
        assert run.dataset["estimate"].to_numpy()[-300:].mean() == pytest.approx(6.0, abs=2.5), seed


@every
def test_a_region_that_comes_nearer_drives_the_seeker_back(name: str) -> None:
    plant, seeker = Failing(edge=99.0), MAKERS[name]()
    run_seeker(plant, seeker, 600)
    plant.edge = 0.0
    run = run_seeker(plant, seeker, 600)
    assert run.dataset["misfire"].to_numpy()[200:].mean() <= 0.1
    assert seeker.estimate[0] <= 0.5


@every
def test_failures_that_do_not_depend_on_the_input_change_nothing_for_long(name: str) -> None:
    plant, seeker = Failing(edge=99.0, share=0.05, seed=1), MAKERS[name]()
    run_seeker(plant, seeker, 1500)
    plant.edge = -99.0  # no ignition at all
    run_seeker(plant, seeker, 60)
    assert seeker.failing_everywhere
    assert [finding.code for finding in seeker.findings] == ["failing_everywhere"]
    plant.edge = 99.0
    run = run_seeker(plant, seeker, 1500)
    assert not seeker.failing_everywhere
    assert run.dataset["estimate"].to_numpy()[-300:].mean() == pytest.approx(6.0, abs=2.5)


@every
def test_three_failures_in_ten_by_chance_are_said_and_set_no_edge(name: str) -> None:
    said = []
    for seed in range(8):
        plant, seeker = Failing(edge=99.0, share=0.3, seed=seed), MAKERS[name]()
        run = run_seeker(plant, seeker, 600)
        said += [
            (finding.code, str(run.dataset["misfire"].to_numpy().sum()) in finding.text) for finding in run.findings
        ]
    assert said.count(("failing_cycles", True)) >= 6, said
    assert len(said) == 8


def test_a_process_says_that_cycles_fail() -> None:
    plant = Failing(edge=99.0, share=0.3, seed=1)
    run = run_seeker(plant, GaussianProcessSeeking(start=-5.0, bounds=(-20.0, 20.0), seed=2), 60)
    assert [finding.code for finding in run.findings] == ["failing_cycles"]
    assert "of 60 cycles" in run.findings[0].text


def test_what_is_asked_in_its_place_stands_in_the_history_and_survives_a_journey(tmp_path: Path) -> None:
    for name, make in MAKERS.items():
        seeker, twin = make(), make()
        plant, other = Failing(seed=3), Failing(seed=3)
        run = run_seeker(plant, seeker, 400)
        assert np.array_equal(run.dataset["asked"][:, 0], seeker.history["applied"][:, 0]), name
        run_seeker(other, twin, 150)
        twin.save(tmp_path / "seeker.json")
        loaded = Seeker.load(tmp_path / "seeker.json")
        run_seeker(other, loaded, 250)
        assert loaded.state == seeker.state, name
        assert json.dumps(seeker.state)


def test_asking_twice_and_a_start_that_fails_are_the_same_input() -> None:
    seeker = GradientDescent(start=5.0)
    for _ in range(12):  # after these other inputs are tried
        assert seeker.ask() == seeker.ask() == pytest.approx(5.0 + 0.5, abs=0.5)
        seeker.tell(misfire=True)
    assert seeker.failing_everywhere
    assert np.isposinf(seeker.failing_above[0])
    seeker.ask()
    seeker.tell(1.0)
    assert [finding.code for finding in seeker.findings] == ["failing_cycles"]


def test_two_inputs_of_which_one_fails_or_both_together() -> None:
    two: dict[str, Any] = {"start": [-5.0, -5.0], "bounds": (-20.0, 20.0)}
    makers: list[Callable[[], Any]] = [
        lambda: ExtremumSeeking(**two, period=40, harmonics=[4, 5]),
        lambda: Spsa(**two),
        lambda: GradientDescent(**two),
    ]
    regions: list[Callable[[Any], bool]] = [lambda x: x[0] > 3.0, lambda x: x[0] + x[1] > 3.0]
    for region in regions:
        for make in makers:
            seeker, rng, failed = make(), np.random.default_rng(1), []
            for _ in range(1200):
                x = seeker.ask()
                failed.append(region(x))
                j = -0.03 * float((x - 6.0) @ (x - 6.0)) + rng.normal(0.0, 0.3)
                seeker.tell(None if failed[-1] else j, misfire=failed[-1])
            assert np.mean(failed[200:]) <= 0.1, seeker
            assert seeker.findings


def test_the_tests_of_a_guide_back_off_too() -> None:
    guided = FeedForward(ExtremumSeeking(**SPACE), lambda point: point, noise_sd=0.3)
    plant, failed = Failing(), []
    for cycle in range(600):
        guided.at(-4.0 if cycle < 200 else 8.0)
        plant.apply({"u": float(guided.ask()[0])})
        told = plant.measure()
        failed.append(told.misfire)
        guided.tell(told.performance, misfire=told.misfire)
    assert np.mean(failed[300:]) <= 0.1
