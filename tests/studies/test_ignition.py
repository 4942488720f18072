"""The study of the ignition delay: laws of injection and combustion, and what few cells and seeds already show."""

from collections.abc import Callable

import numpy as np
import pytest

from mgdd.engine import OperatingPoint, ignition_delay
from mgdd.loop import VirtualEngine
from mgdd_studies.base import StudyResult
from mgdd_studies.guide_cases import PLANT, Guide, SpeedLoadPlane, curve_seeker, drive, trimmed
from mgdd_studies.ignition_cases import MEASURED_AT, MEASURED_SOI_CAD, TRUTHS, DelayLaw, InjectionGuide, assumed_laws
from mgdd_studies.ignition_delay import plane_of

WATSON, WOLFER, HARDENBERG = TRUTHS
LATE = OperatingPoint(speed_rpm=1900.0, fuel_mg=13.0)


@pytest.fixture(scope="module")
def result(quick_study: Callable[..., StudyResult]) -> StudyResult:
    return quick_study("ignition-delay")


def assumed(truth: DelayLaw, name: str) -> DelayLaw:
    return next(law for law in assumed_laws(truth) if law.name == name)


def test_a_guide_that_is_told_the_truth_asks_for_the_best_combustion() -> None:
    for law in TRUTHS:
        guide = InjectionGuide(law)
        burns = ignition_delay(law.cylinder, LATE, soi_cad=guide(LATE)["soi_cad"]).soc_cad
        assert burns == pytest.approx(VirtualEngine(point=LATE).find_optimum()["soc_cad"], abs=0.05), law.name
        assert guide.curve(LATE).best == pytest.approx(guide(LATE)["soi_cad"], abs=0.15), law.name


def test_the_curvature_over_the_injection_is_that_of_its_curve() -> None:
    guide = InjectionGuide(WATSON)
    best, curve = guide(LATE), guide.curve(LATE)
    around = curve(best["soi_cad"] + np.array([-1.5, 0.0, 1.5]))
    assert best.curvature == pytest.approx((around[0] - 2.0 * around[1] + around[2]) / 1.5**2, rel=0.1)
    assert best.curvature > 0.8 * guide.best_soc(LATE).curvature  # flatter than over the combustion


def test_the_measured_delays_make_the_polynomial_and_the_constant() -> None:
    for truth in TRUTHS:
        polynomial = assumed(truth, "polynomial of 1500 rpm").cylinder
        for soi in MEASURED_SOI_CAD.tolist():
            own = ignition_delay(truth.cylinder, MEASURED_AT, soi_cad=soi).delay_cad
            assert ignition_delay(polynomial, MEASURED_AT, soi_cad=soi).delay_cad == pytest.approx(own, abs=0.7)
        for name in ("constant of 1500 rpm", "polynomial of 1500 rpm"):
            right, said = (InjectionGuide(law).timing(MEASURED_AT).soi_cad for law in (truth, assumed(truth, name)))
            assert said == pytest.approx(right, abs=0.15), (truth.name, name)


def test_a_constant_delay_is_a_shift_of_the_input() -> None:
    late = DelayLaw("late", PLANT.replace(ignition_model="polynomial", ignition_c0_cad=5.5, ignition_c1=0.0))
    bench, twin = (VirtualEngine(schedule=[(0, MEASURED_AT), (40, LATE)], seed=4) for _ in range(2))
    injected = drive(bench, trimmed(InjectionGuide(late)), 90, soc_of=late.soc_of)
    burning = drive(twin, trimmed(Guide("exact", PLANT)), 90)
    assert injected.applied == pytest.approx(burning.applied, abs=1e-6)
    assert injected.estimate + 5.5 == pytest.approx(burning.estimate, abs=1e-6)


def test_the_trim_of_a_point_cancels_every_error_there() -> None:
    own = SpeedLoadPlane([MEASURED_AT.speed_rpm], [MEASURED_AT.fuel_mg])
    for truth in TRUTHS:
        for law in assumed_laws(truth):
            plane = plane_of(truth, law, own)
            assert plane.soi_error_cad[0, 0] == pytest.approx(-plane.trim_cad, abs=1e-12), law.name
            assert plane.lost_trimmed[0, 0] == pytest.approx(0.0, abs=1e-3), law.name
    bare = plane_of(WATSON, assumed(WATSON, "no delay"), own)
    assert bare.trim_cad == pytest.approx(-ignition_delay(PLANT, MEASURED_AT, soi_cad=-10.3).delay_cad, abs=0.05)


def test_what_a_cell_loses_is_what_the_bench_loses() -> None:
    bench = VirtualEngine(point=LATE)
    plane = plane_of(WATSON, HARDENBERG, SpeedLoadPlane([LATE.speed_rpm], [LATE.fuel_mg]))
    said = InjectionGuide(HARDENBERG)(LATE)["soi_cad"]
    burns = ignition_delay(WATSON.cylinder, LATE, soi_cad=said).soc_cad
    best = bench.find_optimum()
    lost = best.value - float(bench.steady_map([burns])["j"][0])
    assert plane.lost[0, 0] == pytest.approx(lost, abs=2e-3)
    assert lost > 0.1
    assert plane.soi_error_cad[0, 0] > 3.0  # with too short a delay it injects too late


def test_an_injection_that_does_not_ignite_counts_apart() -> None:
    fast = OperatingPoint(speed_rpm=3000.0, fuel_mg=40.0)
    assert InjectionGuide(WOLFER).timing(fast).clipped  # so early that Hardenberg and Hase have no value there
    own = SpeedLoadPlane([3000.0], [40.0])
    plane = plane_of(HARDENBERG, WOLFER, own)
    assert np.isinf(plane.lost).all()
    assert plane_of(WOLFER, WOLFER, own).lost[0, 0] == 0.0


def test_few_cells(result: StudyResult) -> None:
    rows = {(row["truth"], row["assumed"]): row for row in result.summary["rows"]}
    assert len(rows) == 18
    for (truth, law), row in rows.items():
        assert row["lost_mean"] >= 0.0
        assert (row["soi_error_largest_cad"] == 0.0) == (truth == law)
    assert all(
        rows[law.name, "no delay"]["lost_mean"] > rows[law.name, "constant of 1500 rpm"]["lost_mean"] for law in TRUTHS
    )
    slopes = {row["truth"]: row for row in result.summary["slopes"]}
    assert (
        slopes["Wolfer"]["slope_median"] < slopes["Watson"]["slope_median"] < slopes["Hardenberg-Hase"]["slope_median"]
    )


def test_few_seeds(result: StudyResult) -> None:
    runs = {(row["form"], row["assumed"]): row for row in result.summary["runs"]}
    assert len(runs) == 12
    assert runs["feed-forward", "no delay"]["start_lost"] > 3.0 * runs["feed-forward", "Watson"]["start_lost"]
    assert runs["curve", "no delay"]["start_lost"] < 0.5 * runs["feed-forward", "no delay"]["start_lost"]


def test_a_new_curve_is_drawn_after_the_step() -> None:
    bench = VirtualEngine(schedule=[(0, MEASURED_AT), (30, LATE)], seed=7)
    guide = InjectionGuide(WATSON)
    run = drive(bench, curve_seeker(guide.curve(MEASURED_AT)), 31, curve_at=guide.curve, soc_of=WATSON.soc_of)
    move = guide(LATE)["soi_cad"] - guide(MEASURED_AT)["soi_cad"]
    assert run.estimate[30] - run.estimate[29] == pytest.approx(move, abs=0.8)
