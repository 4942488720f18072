"""The study `seekers-several-inputs`: its tables say what their runs did, and the order of the seekers holds."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from mgdd.errors import Interrupted
from mgdd.optimize import Spsa
from mgdd.results.labels import check_labels
from mgdd_studies import three_input_bench as three
from mgdd_studies.base import StudyResult
from mgdd_studies.seekers_several_inputs import _Runs, run_seekers_several_inputs

GP, BENT, USELESS = "Gaussian process", "Gaussian process, guide bent by half", "Gaussian process, guide of no use"
DITHERS = ("SPSA by tune", "extremum seeking by tune")


@pytest.fixture(scope="module")
def result(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("seekers-several-inputs")


def test_the_result_is_whole(result: StudyResult) -> None:
    rows = result.summary["rows"]
    assert [(row["map"], row["inputs"]) for row in rows[::6]] == [
        ("coupled", 2),
        ("skewed", 2),
        ("ridge", 2),
        ("three", 3),
    ]
    assert len({(row["map"], row["seeker"]) for row in rows}) == len(rows) == 24
    assert result.dataset.sizes["cycle"] == result.summary["cycles"] == 120


def test_a_process_loses_less_than_tuned_dithers_and_a_good_guide_saves(result: StudyResult) -> None:
    lost = {(row["map"], row["seeker"]): row["j_lost"] for row in result.summary["rows"]}
    for name in ("coupled", "skewed", "ridge", "three"):
        assert lost[name, GP] < 0.7 * min(lost[name, dither] for dither in DITHERS)
        assert lost[name, BENT] < lost[name, GP]
        assert lost[name, USELESS] > 1.15 * lost[name, GP]


def test_bars_are_those_of_the_rows(result: StudyResult) -> None:
    lost = {(row["map"], row["seeker"]): row["j_lost"] for row in result.summary["rows"]}
    bars = {bar["bar"]: bar for bar in result.summary["bars"]}
    assert len(bars) == 10
    useless = bars["guide of no use: loss over that without a guide [-]"]
    assert useless["worst"] == max(lost[name, USELESS] / lost[name, GP] for name in dict.fromkeys(at for at, _ in lost))
    assert (useless["met"], useless["cases"]) == (False, 4)
    bench = bars["bench: cycles truly above a limit [%]"]
    assert bench["worst"] == max(row["above_percent"] for row in result.summary["bench"][:3])


def test_a_row_counts_readings_until_near_and_runs_that_never_are() -> None:
    estimate = np.full((4, 60), 0.5)
    estimate[0, 7:] = 0.06  # near to the end, the threshold of two inputs included
    estimate[1, 3:9] = 0.01  # near, and away again
    estimate[2, 12:] = 0.061  # never
    lost = np.ones((4, 60))
    lost[:, :40] = np.array([[1.0], [2.0], [3.0], [6.0]])
    row = _Runs(field="m", inputs=2, seeker="s", lost=lost, estimate_lost=estimate).row()
    assert row["j_lost_early"] == 3.0
    assert row["j_lost"] == pytest.approx((40 * 3.0 + 20 * 1.0) / 60)
    assert (row["never_near_percent"], row["away_at_end_percent"]) == (50.0, 75.0)
    assert row["cycles_to_near"] is None  # 3, 7, never, never
    assert row["j_lost_at_end"] == pytest.approx((0.06 + 0.5 + 0.061 + 0.5) / 4)
    three_runs = _Runs(field="m", inputs=3, seeker="s", lost=lost, estimate_lost=estimate).row()
    assert three_runs["cycles_to_near"] == (7 + 12) / 2


def test_paths_begin_at_one_start_and_stay_within_the_bounds(result: StudyResult) -> None:
    data = result.dataset
    assert data.sizes["path"] == 4
    for name, (low, high) in {"soc_cad": (-20.0, 20.0), "egr": (0.0, 0.4)}.items():
        assert len(set(data[f"estimate_{name}"].to_numpy()[:, 0])) == 1
        assert float(data[f"applied_{name}"].min()) >= low
        assert float(data[f"applied_{name}"].max()) <= high
    assert 0.0 <= float(data["map_j_lost"].min()) < 0.02


# --- bench --------------------------------------------------------------------------------------------------
def test_a_run_in_parts_is_the_same_run() -> None:
    def seeker() -> Spsa:
        return Spsa(inputs=three.BOUNDS, start=three.START, seed=3)

    whole = three.bench_run(three.noisy_bench(3), seeker(), (90,), 56.0)
    parts = three.bench_run(three.noisy_bench(3), seeker(), (60, 90), 57.0)
    np.testing.assert_array_equal(parts.excess, whole.excess)
    assert parts.estimates[1] == whole.estimates[0] != parts.estimates[0]
    assert parts.lost[1] == pytest.approx(whole.lost[0] + 1.0)
    assert list(whole.estimates[0]) == ["soc_cad", "egr", "intake_pressure_kpa"]


def test_the_optimum_loses_nothing_and_lies_on_both_limits() -> None:
    best = three.bench_optimum()
    inside = best.inputs | {"intake_pressure_kpa": 219.999}  # room for a perturbation
    hold = Spsa(inputs=three.BOUNDS, start=inside, perturbation=1e-6)
    run = three.bench_run(three.noisy_bench(0), hold, (1,), best.value)
    assert run.lost[0] == pytest.approx(0.0, abs=1e-3)
    assert run.estimate_excess[0] == pytest.approx(0.0, abs=1e-3)
    start = three.bench_run(three.noisy_bench(0), Spsa(inputs=three.BOUNDS, start=three.START), (1,), best.value)
    assert start.lost[0] == pytest.approx(1.92, abs=0.01)
    assert start.estimate_excess[0] < -0.1
    assert start.excess[0].max() < -0.1


def test_a_row_of_the_bench_counts_cycles_above_any_limit() -> None:
    excess = np.full((10, 2), -0.1)
    excess[2, 0] = excess[2, 1] = excess[5, 1] = 0.03
    excess[6, 1] = 0.08
    calm = np.full((10, 2), -0.2)

    def run(over: np.ndarray, lost: tuple[float, float], at: float) -> three.BenchRun:
        return three.BenchRun(excess=over, estimates=({}, {}), lost=lost, estimate_excess=(at, 0.5))

    row = three.OnBench(seeker="s", runs=[run(excess, (0.4, 0.1), 0.01), run(calm, (0.2, 0.3), 0.0)]).row()
    assert (row["j_lost_after_40"], row["j_lost_after_200"]) == (pytest.approx(0.3), pytest.approx(0.2))
    assert row["estimates_above_percent"] == 50.0
    assert row["above_percent"] == pytest.approx(15.0)
    assert (row["above_p_max_bar_percent"], row["above_nox_fast_ppm_percent"]) == (
        pytest.approx(5.0),
        pytest.approx(15.0),
    )
    assert row["worst_percent"] == pytest.approx(8.0)


def test_on_the_bench_the_process_ends_nearer_than_untouched_dithers_and_keeps_the_limits(result: StudyResult) -> None:
    rows = {row["seeker"]: row for row in result.summary["bench"]}
    assert list(rows) == list(three.SEEKERS)
    for name in (three.PLAIN, three.GUIDED, three.LIMITS_TOO):
        assert rows[name]["j_lost_after_40"] < 0.5 * rows[three.SPSA]["j_lost_after_40"]
        assert rows[name]["above_percent"] < 3.0
    uppers = [float(result.dataset[f"upper_{name}"]) for name in three.LIMITS]
    assert uppers == [118.0, 150.0]
    late = result.dataset["applied_p_max_median_bar"].sel(bench_seeker=three.PLAIN)[100:]
    assert 105.0 < float(late.median()) < 118.0


def test_ctrl_c_keeps_what_is_finished() -> None:
    seen: list[str] = []

    def press(text: str) -> None:
        seen.append(text)
        if len(seen) == 3:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="2 finished rows") as stop:
        run_seekers_several_inputs(n_seeds=1, quick=True, progress=press)
    part = stop.value.partial
    assert [row["seeker"] for row in part.summary["rows"]] == [GP, BENT]
    assert part.summary["bench"] == []
    assert len(part.figures) == 1
    assert math.isfinite(part.summary["bars"][0]["worst"])
    check_labels(part.dataset)
