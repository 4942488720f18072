"""Seven cases of delay: the phase decides over the sign of the step, and the counts hold."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from mgdd.errors import Interrupted, ParameterError
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.sensor_delay import run_sensor_delay

KEYS = ["case", "period_cycles", "phase_deg", "step_sign", "cycles_stays", "final_cad"]


@pytest.fixture(scope="module")
def result(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("sensor-delay")


def test_seven_rows_in_order(result: StudyResult) -> None:
    rows = result.summary["rows"]
    assert [list(row) for row in rows] == [KEYS] * 7
    assert [row["period_cycles"] for row in rows] == [10, 10, 10, 120, 400, 120, 60]
    phases = [0.0, 140.5, 212.5, 165.1, 55.2, 165.1, 294.1]
    assert [row["phase_deg"] for row in rows] == pytest.approx(phases, abs=0.1)


def test_the_sign_is_that_of_the_cosine_and_decides(result: StudyResult) -> None:
    rows = result.summary["rows"]
    for row in rows[:5]:
        assert row["step_sign"] == np.sign(math.cos(math.radians(row["phase_deg"])))
    assert [row["step_sign"] for row in rows] == [1, -1, -1, -1, 1, 1, 1]
    assert [row["cycles_stays"] is not None for row in rows] == [row["step_sign"] > 0 for row in rows]
    counts = [72, None, None, None, 3690, 698, 268]
    assert [row["cycles_stays"] for row in rows] == [
        pytest.approx(count, rel=0.15) if count else None for count in counts
    ]


def test_frozen_slopes_follow_gain_and_phase(result: StudyResult) -> None:
    from mgdd.optimize import ComponentLag

    slopes = result.summary["frozen_slope_percent_per_cad"]
    late = [(42, 10), (34, 10), (38, 120), (38, 400)]
    for slope, (delay, period) in zip(slopes[1:5], late, strict=True):
        gain, phase = ComponentLag(delay_cycles=delay, lag_cycles=25).response(period=period)
        assert slope / slopes[0] == pytest.approx(gain * math.cos(math.radians(phase)), abs=0.02)
    assert slopes[5:] == pytest.approx([slopes[0]] * 2, rel=0.01)  # compensation restores the slope


def test_final_estimates(result: StudyResult) -> None:
    best = result.summary["optimum_cad"]
    for row in result.summary["rows"]:
        if row["step_sign"] > 0:
            assert row["final_cad"] == pytest.approx(best, abs=0.15)
        else:
            assert row["final_cad"] < best - 15.0


def test_the_period_must_follow_the_lag(result: StudyResult) -> None:
    fast, slow = result.summary["component_wise"]
    assert (fast["period_cycles"], slow["period_cycles"]) == (10, 60)
    assert fast["rms_cad"] == pytest.approx(2.7, rel=0.15)
    assert slow["rms_cad"] == pytest.approx(0.34, rel=0.15)
    assert "analyser, NOx demodulated with its own phase" not in [row["case"] for row in result.summary["rows"]]


def test_ctrl_c_in_the_first_part_of_a_later_group_keeps_the_earlier_ones() -> None:
    def press(text: str) -> None:
        if text.startswith("component by component"):
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="7 finished rows") as stop:
        run_sensor_delay(n_seeds=1, quick=True, figures=False, progress=press)
    part = stop.value.partial
    assert len(part.summary["rows"]) == 7
    assert part.summary["component_wise"] == []


def test_bad_requests_are_named() -> None:
    with pytest.raises(ParameterError, match=r"study = 'nothing': must be one of .*sensor-delay"):
        run_study("nothing")
    with pytest.raises(ParameterError, match="traces: study 'sensor-delay' takes n_seeds"):
        run_study("sensor-delay", traces=[])
