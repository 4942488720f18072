"""Inputs with names, units, bounds and scales: one record that every seeker, loop and file understands."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.errors import ParameterError, ShapeError
from mgdd.guide import FeedForward
from mgdd.loop import Measurement, VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import (
    ExtremumSeeking,
    GoldenSection,
    GradientDescent,
    Input,
    Limit,
    Seeker,
    Spsa,
)
from mgdd.results.labels import check_labels

PAIR = [Input("soc_cad", -25.0, 15.0), Input("egr", 0.0, 0.4)]  # one hundred to one
START = {"egr": 0.3, "soc_cad": 8.0}
DITHER = {"period": 40, "harmonics": [4, 5]}

Make = Callable[..., Seeker]
SEVERAL = list(stepped(start=START, inputs=PAIR))


def path(seeker: Seeker, factors: list[float], factor_of_j: float, cycles: int = 320) -> np.ndarray:
    """Return what a seeker applies to a coupled quadratic whose inputs and J are told in other units."""
    names = seeker.input_names
    rng = np.random.default_rng(5)
    for _ in range(cycles):
        sent = seeker.ask()
        x, y = (sent[name] / factor for name, factor in zip(names, factors, strict=True))
        j = -0.03 * ((x + 4.0) ** 2 + 1.5e4 * (y - 0.15) ** 2 + 60.0 * (x + 4.0) * (y - 0.15)) + 0.2 * rng.normal()
        seeker.tell(factor_of_j * j, [factor_of_j * (2.0 * x - 30.0 * y)] if seeker.limit_names else None)
    return seeker.history["applied"].to_numpy() / factors


@pytest.mark.parametrize("limited", [False, True], ids=["free", "limited"])
@pytest.mark.parametrize("name", SEVERAL)
def test_other_units_of_inputs_and_j_lead_along_the_same_path(name: str, limited: bool) -> None:
    limits = [Limit("p", 4.0, scale=1.0)] if limited else []
    plain = path(stepped(start=START, inputs=PAIR, limits=limits)[name](), [1.0, 1.0], 1.0)
    wide = [Input("soc_cad", 50.0 * -25.0, 50.0 * 15.0), Input("egr", 0.0, 0.4e-3)]
    start = {"soc_cad": 50.0 * 8.0, "egr": 0.3e-3}
    limits = [Limit("p", 4.0e-3, scale=1e-3)] if limited else []
    other = path(stepped(start=start, inputs=wide, limits=limits)[name](), [50.0, 1e-3], 1e-3)
    close = 1e-2 if name == "GaussianProcessSeeking" else 1e-5  # the top of a smooth J is known to a root of rounding
    np.testing.assert_allclose(other * [1.0, 100.0], plain * [1.0, 100.0], rtol=0.0, atol=close)
    assert np.ptp(plain[:, 0]) > 1.5, "it has not moved"


def test_steps_count_in_scales_and_stay_within_rates() -> None:
    own = [Input("a", 0.0, 80.0), Input("b", scale=0.5, rate=0.01), Input("c")]
    start = [40.0, 0.0, 0.0]
    assert Spsa(start=start, inputs=own).settings["perturbation"] == [3.0, 0.75, 1.5]
    assert GradientDescent(start=start, inputs=own).settings["difference"] == [2.0, 0.5, 1.0]
    dither = {"period": 40, "harmonics": [4, 5, 7], "start": start, "inputs": own}
    assert ExtremumSeeking(**dither).settings["amplitude"] == [2.0, 0.5, 1.0]
    assert ExtremumSeeking(**dither).settings["rate"][1] == 0.01
    moved = Spsa(start=start, inputs=own).run(lambda x: 5.0 * x["b"], 100)["estimate"].to_numpy()[:, 1]
    assert 0.0 < np.abs(np.diff(moved)).max() <= 0.01 + 1e-12


def test_names_stay_with_history_files_and_copies(tmp_path: Path) -> None:
    seeker = Spsa(start=START, inputs=PAIR, seed=2)
    history = seeker.run(lambda x: -((x["egr"] - 0.2) ** 2), 24)
    check_labels(history)
    assert history["input"].to_numpy().tolist() == ["soc_cad", "egr"]
    assert float(history["applied"].sel(input="egr").max()) > 0.3
    one = GoldenSection(start=1.0, inputs={"soc_cad": (-20.0, 10.0)}).run(lambda x: -(x["soc_cad"] ** 2), 3)
    assert one["applied"].attrs["units"] == "degree"
    seeker.save(tmp_path / "seeker.json")
    for again in (Seeker.load(tmp_path / "seeker.json"), pickle.loads(pickle.dumps(seeker))):
        assert again.settings["inputs"] == PAIR
        assert again.ask() == seeker.ask()
    assert "egr" in repr(seeker)


def test_what_was_applied_may_be_told_by_name() -> None:
    by_name, in_order = (Spsa(start=START, inputs=PAIR) for _ in range(2))
    for _ in range(40):
        sent = by_name.ask()
        in_order.ask()
        j = -sent["egr"] - 0.01 * sent["soc_cad"] ** 2
        by_name.tell(j, applied={"egr": min(sent["egr"], 0.3), "soc_cad": sent["soc_cad"]})
        in_order.tell(j, applied=[sent["soc_cad"], min(sent["egr"], 0.3)])
    assert by_name.estimate.tolist() == in_order.estimate.tolist()
    before = by_name.state
    by_name.ask()
    for wrong, field in (({"egr": 0.1}, "soc_cad"), ({"egr": 0.1, "soc_cad": 1.0, "x": 2.0}, "3 names")):
        with pytest.raises(ShapeError, match=f"applied.*{field}"):
            by_name.tell(1.0, applied=wrong)
    by_name.tell(1.0, misfire=True)
    assert by_name.state["candidate"] == before["candidate"]


class Two:
    """A plant whose inputs stand in another order than those of the seeker."""

    input_names, limit_names = ("egr", "soc_cad"), ("nox_ppm",)

    def apply(self, inputs: dict[str, float]) -> None:
        self._x = dict(inputs)

    def measure(self) -> Measurement:
        egr = min(self._x["egr"], 0.25)
        j = -0.03 * (self._x["soc_cad"] + 4.0) ** 2 - 300.0 * (egr - 0.15) ** 2
        return Measurement(components=(j,), limits={"nox_ppm": 900.0 - 2000.0 * egr}, applied={"egr": egr})


def test_a_loop_goes_by_names() -> None:
    run = run_seeker(Two(), Spsa(start=START, inputs=PAIR, seed=4), 400)
    check_labels(run.dataset)
    assert run.dataset["input"].to_numpy().tolist() == ["egr", "soc_cad"]
    last = run.dataset["estimate"][-1].to_numpy()
    np.testing.assert_allclose(last * [100.0, 1.0], [15.0, -4.0], atol=1.5)
    assert run.dataset["applied"].sel(input="egr").max() == 0.25
    assert run.dataset["asked"].sel(input="egr").max() > 0.25


def test_inputs_that_the_plant_does_not_have_are_refused() -> None:
    wrong = Spsa(start=-8.0, inputs={"soi_cad": (-30.0, 10.0)})
    for call in (
        lambda: run_seeker(VirtualEngine(seed=1), wrong, 5),
        lambda: run_seeker(Two(), wrong, 5),
        lambda: run_seeker(VirtualEngine(seed=1), FeedForward(wrong, None), 5),
        lambda: monte_carlo(VirtualEngine(), wrong, range(2), cycles=5),
    ):
        with pytest.raises(ParameterError, match=r"inputs of the seeker are soi_cad: the plant takes"):
            call()
    named = Spsa(start=-8.0, inputs={"soc_cad": (-30.0, 10.0)})
    plain = Spsa(start=-8.0, bounds=(-30.0, 10.0))
    runs = [run_seeker(VirtualEngine(seed=1), seeker, 60).dataset["asked"][:, 0] for seeker in (named, plain)]
    assert runs[0].equals(runs[1])


@pytest.mark.parametrize(
    ("own", "error", "message"),
    [
        ({"start": {"a": 1.0}}, ParameterError, "start.*names need `inputs`"),
        ({"start": [1.0, 2.0], "inputs": {"a": (0.0, 3.0)}}, ShapeError, "inputs has 1 entries: must have 2"),
        ({"start": {"a": 1.0, "c": 2.0}, "inputs": {"a": (0, 3), "b": (0, 3)}}, ShapeError, "start has a, c.*a, b"),
        ({"start": 1.0, "inputs": {"a": (0.0, 3.0)}, "bounds": (0.5, None)}, ParameterError, "lower = 0.5.*say of a"),
        ({"start": 1.0, "inputs": {"a": (3.0, 0.0)}}, ParameterError, "inputs: a lower = 3: must be < upper = 0"),
        ({"start": 1.0, "inputs": {"a": (0.0, np.nan)}}, ParameterError, "inputs: a lower"),
        ({"start": 1.0, "inputs": {"a": (-1e308, 1e308)}}, ParameterError, "inputs: a upper = 1e[+]308"),
        ({"start": 1.0, "inputs": {"a": 3.0}}, ParameterError, r"a = 3.0: must be \(lower, upper\)"),
        ({"start": 1.0, "inputs": "a"}, ParameterError, "inputs = 'a': must map names to bounds"),
        ({"start": 1.0, "inputs": {"": (0.0, 3.0)}}, ParameterError, "a name is empty"),
        ({"start": [1.0, 1.0], "inputs": [PAIR[0], PAIR[0]]}, ParameterError, "soc_cad, soc_cad: each name once"),
        ({"start": 1.0, "inputs": {"a": PAIR[1]}}, ParameterError, "'a' is called 'egr'"),
    ],
)  # fmt: skip
def test_bad_inputs_are_refused_by_name(own: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Spsa(**own)


@pytest.mark.parametrize(
    ("own", "message"),
    [({"scale": -1.0}, "a scale = -1"), ({"scale": np.inf}, "a scale = inf"), ({"rate": 0.0}, "a rate = 0"),
     ({"rate": np.nan}, "a rate = nan"), ({"lower": 1.0, "upper": 1.0}, "a lower = 1")],
)  # fmt: skip
def test_an_input_says_what_it_may_not_be(own: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Input("a", **own)
