"""Calibration and best timing of engines that share no code with the package: their gas, four wall-heat laws, leaks."""

import numpy as np
import pytest
import xarray as xr

from independent_engine import LAWS, Engine, best_soc, draw, record
from mgdd.engine import OperatingPoint
from mgdd.identify import best_timing, fit_cylinder
from mgdd.identify.engine.timing_records import BestTiming
from mgdd.io import pressure_trace

# Laws of the model that contradict the engine; the rest of the findings say that parameters are not identifiable.
DOUBTS = {"implausible_wall_heat", "implausible_efficiency", "implausible_gamma", "imep_error", "poor_fit"}


def own(number: int) -> tuple[Engine, xr.Dataset, OperatingPoint, float]:
    """Give an engine of either kind and any law, its mean cycle, what its bench states, the heat that burned [J]."""
    random = np.random.default_rng(1000 + number)
    engine = draw(random, ("diesel", "spark")[number % 2], LAWS[number // 2 % 4])
    measured = record(random, engine, 20, step=1.0)
    trace = pressure_trace(measured.angle, measured.bar.mean(axis=0), name=f"engine {number}")
    point = OperatingPoint(
        speed_rpm=engine.speed, intake_pressure_kpa=100.0 * engine.intake_bar, intake_temperature_k=engine.intake_k
    )
    heat = engine.fuel_heat * engine.completeness * float(measured.fuel_mg.mean()) / engine.fuel_mg
    return engine, trace.assign_attrs(speed_rpm=engine.speed), point, heat


@pytest.mark.parametrize("number", range(0, 40, 3))
def test_a_fit_that_is_far_off_says_so_or_states_it(number: int) -> None:
    engine, trace, point, heat = own(number)
    fit = fit_cylinder([trace], engine.cylinder(), point=point)
    (error,) = (stderr for name, stderr in fit.stderr.items() if name.startswith("fuel_heat_j"))
    off = abs(fit.loads[0].fuel_heat_j - heat)
    assert DOUBTS & {finding.code for finding in fit.findings} or off < 2.0 * error
    assert error > 0.01 * heat  # nobody knows fuel heat to a thousandth from a trace


def test_what_is_not_plausible_is_a_finding_of_the_fit_and_a_reason_of_the_member() -> None:
    engine, trace, point, _ = own(8)
    fit = fit_cylinder([trace], engine.cylinder(), point=point)
    (found,) = (finding for finding in fit.findings if finding.code == "implausible_wall_heat")
    scale = fit.model.wall_heat_scale
    assert found.text.startswith(f"wall heat {scale:.2f} outside 0.3 to 1.5")
    (row,) = best_timing([trace.assign_attrs(fuel_mg=0.7 * engine.fuel_mg)], engine.cylinder(), point=point)
    assert scale > 2.0
    assert all("of the stated fuel, outside 0.86 to 1.04" in member.why_not for member in row.members)


def ranges(numbers: range) -> list[tuple[float, BestTiming]]:
    """Give how far each engine's best start of combustion is from its own, and the answer."""
    out = []
    for number in numbers:
        engine, trace, point, _ = own(number)
        (row,) = best_timing([trace], engine.cylinder(), point=point, step_cad=1.0)
        out.append((best_soc(engine) - engine.soc, row))
    return out


def judge(answers: list[tuple[float, BestTiming]], share: float) -> None:
    held = [row.free_shift_cad[0] <= true <= row.free_shift_cad[1] for true, row in answers]
    widths = [row.free_shift_cad[1] - row.free_shift_cad[0] for _, row in answers]
    late = [row.best.free_shift_cad - true for true, row in answers]
    assert np.mean(held) >= share
    assert min(widths) >= 2.0  # never a point
    assert np.median(widths) < 9.0
    assert abs(np.mean(late)) < 1.5
    sides = {"earlier": -1.0, "later": 1.0}
    said = [(row.free_direction, true) for true, row in answers if row.free_direction != "not determined"]
    assert said
    assert all(sides[direction] * true > 0.0 for direction, true in said)
    open_ = [row for _, row in answers if row.free_direction == "not determined"]
    assert open_
    assert all(row.free_gain_percent[0] <= 0.0 for row in open_)


def test_the_range_holds_the_best_timing_of_engines_with_other_wall_heat() -> None:
    judge(ranges(range(2, 6)), 1.0)


@pytest.mark.slow
def test_the_range_holds_the_best_timing_of_forty_engines() -> None:
    judge(ranges(range(40)), 0.85)
