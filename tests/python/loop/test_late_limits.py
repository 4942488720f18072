"""Limits that come late: on the engine bench, in files, pickles and histories."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from tests.python.support.stepped import stepped

from mgdd.errors import ParameterError
from mgdd.loop import Measurement, VirtualEngine, run_seeker
from mgdd.optimize import (
    ExtremumSeeking,
    GaussianProcessSeeking,
    Limit,
)
from mgdd.results.labels import check_labels

DELAY, UPPER = 10, 95.0
SPACE: dict[str, Any] = {"bounds": (-30.0, 10.0)}


class LatePressure:
    """An engine bench whose reading of the peak pressure takes ten cycles."""

    input_names = ("soc_cad",)
    limit_names = ("p_max_bar",)

    def __init__(self, seed: int) -> None:
        self.bench, self.past = VirtualEngine(seed=seed, limits=["p_max_bar"]), deque[float]()

    def apply(self, inputs: Mapping[str, float]) -> None:
        self.bench.apply(inputs)

    def measure(self) -> Measurement:
        now = self.bench.measure()
        self.past.append(now.limits["p_max_bar"])
        late = self.past.popleft() if len(self.past) > DELAY else self.past[0]
        return Measurement(
            components=now.components,
            limits={"p_max_bar": late},
            values={"imep_gross_bar": now.values["imep_gross_bar"]},
            noise_free_limits=now.noise_free_limits,
            applied=now.applied,
        )


def seekers(limit: Limit, seed: int) -> dict[str, Callable[[], Any]]:
    """Make one of each; those that draw, of this seed."""
    makers = stepped(start=-5.0, limits=[limit], **SPACE)
    makers.pop("GaussianProcessSeeking")  # its limits have tests of their own
    return {name: lambda make=make: seeded(make(), seed) for name, make in makers.items()}


def seeded(seeker: Any, seed: int) -> Any:
    return type(seeker)(**{**seeker.settings, **({"seed": seed} if "seed" in seeker.settings else {})})


@pytest.mark.parametrize("name", list(seekers(Limit("p_max_bar", UPPER), 0)))
def test_a_peak_pressure_ten_cycles_late_is_truly_kept(name: str) -> None:
    limit = Limit("p_max_bar", UPPER, delay_cycles=DELAY)
    best = VirtualEngine(limits=["p_max_bar"]).find_optimum({"p_max_bar": UPPER})["soc_cad"]
    above, applied = [], []
    for seed in range(4):
        run = run_seeker(LatePressure(seed), seekers(limit, seed)[name](), 2000)
        above.append(run.summary["noise_free_judged_above_fraction_p_max_bar"])
        applied.append(run.summary["mean_applied_soc_cad"])
    assert np.mean(above) <= 0.01, above
    assert 0.0 < np.mean(applied) - best < 2.0, applied


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"delay_cycles": -1.0}, r"limit p: delay_cycles = -1: must lie in \[0, 1e6\]"),
        ({"lag_cycles": math.nan}, r"limit p: lag_cycles = nan: must lie in \[0, 1e6\]"),
        ({"margin_sd": -0.5}, r"limit p: margin_sd = -0.5: must lie in \[0, 100\]"),
        ({"upper": math.inf}, "limit p: upper = inf"),
        ({"margin": -1.0}, "margin = -1"),
        ({"method": "penalty", "weight": 0.0}, "weight = 0"),
        ({"method": "penalty", "scale": math.nan}, "scale = nan"),
    ],
)
def test_what_cannot_be_is_named(wrong: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        Limit("p", **{"upper": 1.0, **wrong})


def test_history_and_states_tell_of_the_limits() -> None:
    both = [Limit("low", -1.0, scale=1.0), Limit("high", -5.0, scale=3.0), Limit("far", 90.0)]
    seeker = ExtremumSeeking(start=-8.0, bounds=(-20.0, 20.0), limits=both)
    assert seeker.limit_states == {"low": "free", "high": "free", "far": "free"}
    history = seeker.run(lambda x: (-0.0255 * (x[0] - 8.0) ** 2, [x[0], -x[0], x[0]]), 1500)
    check_labels(history)
    # x <= -1 and x >= 5 cannot both be: the largest excess, in scales of 1 and 3, is smallest at 0.5, and at 0.25
    # where half the dither is kept free of both.
    assert seeker.limit_states == {"low": "infeasible", "high": "infeasible", "far": "free"}
    assert float(seeker.estimate[0]) == pytest.approx(0.25, abs=0.02)
    assert history["limit"].to_numpy().tolist() == ["low", "high", "far"]
    np.testing.assert_array_equal(history["limits"].sel(limit="low"), history["applied"][:, 0])
    assert history["limit_states"][-1].to_numpy().tolist() == [2, 2, 0]
    assert "limits" not in ExtremumSeeking(start=0.0).history


@pytest.mark.parametrize("late", [0, 5])
@pytest.mark.parametrize(("start", "best"), [(-18.0, 6.0), (-2.0, -14.0)])  # from below to the limit; from it down
def test_a_limit_that_passes_zero_is_kept_as_the_same_one_far_above(start: float, best: float, late: int) -> None:
    lost, above = {}, {}
    for shift in (0.0, 100.0):
        limit = Limit("ca50_cad", 8.0 + shift, delay_cycles=late)
        seeker = GaussianProcessSeeking(
            start={"soc_cad": start, "egr": 0.05},
            inputs={"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)},
            limits=[limit],
            seed=2,
        )
        rng, ca50 = np.random.default_rng(2), []
        for _ in range(120):
            asked = seeker.ask()
            ca50.append(asked["soc_cad"] + 9.0 + 20.0 * asked["egr"])
            j = 50.0 - 0.03 * (asked["soc_cad"] - best) ** 2 - 100.0 * (asked["egr"] - 0.25) ** 2
            seeker.tell(j + rng.normal(0.0, 0.3), [ca50[max(0, len(ca50) - 1 - late)] + rng.normal(0.0, 0.5) + shift])
        soc, egr = seeker.estimate
        lost[shift] = 0.03 * (soc - best) ** 2 + 100.0 * (egr - 0.25) ** 2
        above[shift] = np.mean(np.array(ca50) > 8.0)
    assert above[0.0] <= 0.02
    assert lost[0.0] < lost[100.0] + 0.3
