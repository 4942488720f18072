"""What a run says of its limits: from the first cycle on, without a margin, measured and noise-free apart."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from mgdd.engine import OperatingPoint
from mgdd.errors import Interrupted, ParameterError
from mgdd.loop import LoopCriteria, Measurement, VirtualEngine, VirtualThrottle, monte_carlo, run_seeker
from mgdd.loop.summary import summarize_cycles
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.results.labels import check_labels
from mgdd.rig import SimulatedRig
from mgdd_studies.measured_engine import SurrogatePlant, fit_surrogate, random_step_records

SPACE = {"start": -20.0, "bounds": (-30.0, 10.0)}
SEEDS = range(20)


class Scripted:
    """A plant whose limited quantities follow a script; the timing does not matter."""

    input_names = ("soc_cad",)

    def __init__(self, **readings: Sequence[float]) -> None:
        self.readings, self.cycle = readings, 0
        self.limit_names = tuple(readings)

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Take any timing."""

    def measure(self) -> Measurement:
        now = {name: values[self.cycle] for name, values in self.readings.items()}
        self.cycle += 1
        return Measurement(components=(1.0,), limits=now)


def seeker(**limits: float) -> ExtremumSeeking:
    return ExtremumSeeking(**SPACE, limits=[Limit(name, upper) for name, upper in limits.items()])


def test_the_first_cycles_count_and_the_limit_itself_is_not_above_it() -> None:
    pressure = [160.0, 120.0, 95.0, 95.1, 80.0, 95.0, 95.0, 96.0, 94.0, 95.0]
    rise = [3.0, 4.0, 9.5, 3.0, 3.0, 3.0, 3.0, 3.0, 3.0, 3.0]
    plant = Scripted(p_max_bar=pressure, dp_max_bar_per_cad=rise)
    run = run_seeker(plant, seeker(p_max_bar=95.0, dp_max_bar_per_cad=8.0), 10)
    expected = {
        "judged_from": 5.0,
        "limit_p_max_bar": 95.0,
        "worst_p_max_bar": 160.0,
        "worst_cycle_p_max_bar": 0.0,
        "above_cycles_p_max_bar": 4.0,  # 0, 1, 3 and 7
        "above_fraction_p_max_bar": 0.4,
        "judged_above_cycles_p_max_bar": 1.0,
        "judged_above_fraction_p_max_bar": 0.2,
        "limit_dp_max_bar_per_cad": 8.0,
        "worst_dp_max_bar_per_cad": 9.5,
        "worst_cycle_dp_max_bar_per_cad": 2.0,
        "above_cycles_dp_max_bar_per_cad": 1.0,
        "above_fraction_dp_max_bar_per_cad": 0.1,
        "judged_above_cycles_dp_max_bar_per_cad": 0.0,
        "judged_above_fraction_dp_max_bar_per_cad": 0.0,
    }
    assert {name: run.summary[name] for name in expected} == expected
    assert not [name for name in run.summary if name.startswith("noise_free")]  # such a plant does not know it
    at = run_seeker(Scripted(p_max_bar=[95.0] * 6), seeker(p_max_bar=95.0), 6).summary
    assert (at["above_cycles_p_max_bar"], at["above_fraction_p_max_bar"], at["worst_p_max_bar"]) == (0.0, 0.0, 95.0)


def test_the_limits_may_be_named_and_the_thresholds_are_repeated() -> None:
    plant = Scripted(p_max_bar=[90.0, 99.0, 70.0, 91.0])
    goal = LoopCriteria(limits={"p_max_bar": 89.0}, exceed_above={"p_max_bar": 90.5}, exceed_from=1)
    summary = run_seeker(plant, ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", 200.0)]), 4, criteria=goal).summary
    assert (summary["limit_p_max_bar"], summary["exceed_above_p_max_bar"], summary["judged_from"]) == (89.0, 90.5, 1.0)
    assert (summary["above_cycles_p_max_bar"], summary["judged_above_cycles_p_max_bar"]) == (3.0, 2.0)
    assert summary["exceeded_fraction"] == 2 / 3
    none = run_seeker(Scripted(p_max_bar=[1.0]), seeker(p_max_bar=2.0), 1, criteria=LoopCriteria(limits={}))
    assert not [name for name in none.summary if name.endswith("p_max_bar")]
    for limits, message in (({"p_max": 1.0}, r"limits: \['p_max'\]"), ({"p_max_bar": math.nan}, "limits: p_max_bar")):
        for other in (VirtualEngine(limits=["p_max_bar"]), Scripted(p_max_bar=[1.0])):
            with pytest.raises(ParameterError, match=message):
                run_seeker(other, seeker(p_max_bar=95.0), 1, criteria=LoopCriteria(limits=limits))


def test_the_bench_from_the_core_the_rig_and_the_dataset_say_the_same() -> None:
    def bench() -> VirtualEngine:
        schedule = [(0, OperatingPoint()), (150, OperatingPoint(fuel_mg=20.0))]
        drift = {"soc_drift_cad_per_kcycle": 5.0, "wall_heat_drift_per_kcycle": 2.0}
        return VirtualEngine(schedule=schedule, limits=["p_max_bar", "cov_imep_percent"], seed=3, **drift)

    goal = LoopCriteria(exceed_above={"p_max_bar": 99.0})
    core = run_seeker(bench(), seeker(p_max_bar=95.0, cov_imep_percent=1.0), 300, criteria=goal)
    check_labels(core.dataset)
    rig = run_seeker(SimulatedRig(bench()), seeker(p_max_bar=95.0, cov_imep_percent=1.0), 300, criteria=goal)
    again = summarize_cycles(
        core.dataset,
        LoopCriteria(exceed_above={"p_max_bar": 99.0}, limits={"p_max_bar": 95.0, "cov_imep_percent": 1.0}),
    )
    for other in (rig.summary, again):
        assert set(other) == set(core.summary)
        for name, value in core.summary.items():
            assert other[name] == pytest.approx(value, rel=1e-12, nan_ok=True), name
    pressure = core.dataset["p_max_bar"].to_numpy()
    assert core.summary["worst_p_max_bar"] == pressure.max() > 150.0
    assert core.summary["worst_cycle_p_max_bar"] == pressure.argmax()
    assert core.summary["above_cycles_p_max_bar"] == (pressure > 95.0).sum() > 10
    assert core.summary["judged_above_cycles_p_max_bar"] == (pressure[150:] > 95.0).sum()
    assert "noise_free_worst_cov_imep_percent" not in core.summary
    assert np.isnan(core.dataset["noise_free_limits"].sel(limit="cov_imep_percent")).all()


def test_noise_free_is_the_same_bench_without_scatter_and_noise() -> None:
    noisy = {"soc_scatter_cad": 1.0, "efficiency_noise_percent": 2.0, "misfire_probability": 0.2}
    quiet = dict.fromkeys(noisy, 0.0)
    names = ["p_max_bar", "imep_gross_bar"]
    more = {"limits": names, "soc_drift_cad_per_kcycle": 90.0, "wall_heat_drift_per_kcycle": 80.0}
    timings = [-20.0, -70.0, -3.0]
    bench = VirtualEngine(**noisy, **more, seed=5)
    state = bench.state
    table = bench.noise_free_limits(timings, [0, 1, 2])
    assert bench.state == state
    still = VirtualEngine(**quiet, **more).run(timings)
    np.testing.assert_array_equal(table, np.column_stack([still[name] for name in names]))
    assert abs(table[2, 0] - bench.noise_free_limits([-3.0], [0])[0, 0]) > 0.5  # the drift
    with pytest.raises(ParameterError, match="cycle = -1: must be >= 0"):
        bench.noise_free_limits([0.0], [-1])


def test_the_surrogate_knows_its_surfaces_and_the_throttle_has_no_limits() -> None:
    surrogate = fit_surrogate(random_step_records(1500))
    run = run_seeker(SurrogatePlant(surrogate, limits=["mprr"], seed=4), seeker(mprr=5.0), 60)
    plain = run_seeker(SurrogatePlant(surrogate, limits=["mprr"], residuals=False), seeker(mprr=5.0), 60)
    np.testing.assert_array_equal(plain.dataset["limits"], plain.dataset["noise_free_limits"])
    assert run.summary["noise_free_worst_mprr"] != run.summary["worst_mprr"]
    first = float(run.dataset["noise_free_limits"][0, 0])
    assert first == float(plain.dataset["limits"][0, 0])  # the same first timing
    throttle = ExtremumSeeking(start=0.1, bounds=(-0.5, 0.5), amplitude=0.05)
    summary = run_seeker(VirtualThrottle(), throttle, 5).summary
    assert not [name for name in summary if "above" in name or "worst" in name]


def test_monte_carlo_tells_the_limits_of_every_loop() -> None:
    def bench(seed: int = 0) -> VirtualEngine:
        return VirtualEngine(limits=["p_max_bar"], seed=seed)

    chosen = [seeker(p_max_bar=95.0), seeker(p_max_bar=110.0)]
    table = monte_carlo(bench(), chosen, range(3), cycles=200, criteria=LoopCriteria(exceed_above={"p_max_bar": 99.0}))
    check_labels(table)
    assert table["worst_p_max_bar"].attrs["units"] == "bar"
    np.testing.assert_array_equal(table["limit_p_max_bar"][0, :, 0], [95.0, 110.0])
    np.testing.assert_array_equal(table["exceed_above_p_max_bar"], [99.0])
    alone = run_seeker(bench(2), seeker(p_max_bar=110.0), 200).summary
    own = [name for name in alone if name.endswith("_p_max_bar") and not name.startswith("noise_free")]
    assert len(own) == 7
    for name in own:
        assert float(table[name][0, 1, 2]) == alone[name], name


def test_a_run_that_ends_before_its_first_cycle_is_interrupted_and_nothing_else() -> None:
    class Stopping(Scripted):
        def measure(self) -> Measurement:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as stop:
        run_seeker(Stopping(p_max_bar=[]), seeker(p_max_bar=95.0), 5)
    run = stop.value.partial
    assert (run.interrupted, run.dataset.sizes["cycle"], run.summary["judged_from"]) == (True, 0, 0.0)
    assert np.isnan(run.summary["final_soc_cad"])


def test_the_seeker_returns_below_the_limit_after_a_load_step() -> None:
    """With more fuel and boost the old timing breaks the limit by far: and soon it must be kept again."""
    low, high = OperatingPoint(fuel_mg=12.0), OperatingPoint(fuel_mg=30.0, intake_pressure_kpa=170.0)
    schedule = [(0, low), (1000, high)]
    bench = VirtualEngine(schedule=schedule, limits=["p_max_bar"])
    upper = 92.0
    best = bench.find_optimum({"p_max_bar": upper}, cycle=1000)
    seeker = ExtremumSeeking(**SPACE, limits=[Limit("p_max_bar", upper)])
    above = {"p_max_bar": upper + 3.0 * best["scatter_p_max_bar"]}
    table = monte_carlo(bench, seeker, SEEDS, cycles=2500, criteria=LoopCriteria(exceed_from=1150, exceed_above=above))
    assert float(table["exceeded_fraction"].max()) < 0.01
    before = monte_carlo(bench, seeker, SEEDS, cycles=1100, criteria=LoopCriteria(exceed_from=1000, exceed_above=above))
    assert float(before["exceeded_fraction"].mean()) > 0.005  # the step does break it for some cycles
