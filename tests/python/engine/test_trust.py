"""The trust report: verdicts, what stays open, and that nothing raises where a file is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from independent_engine import draw, record
from mgdd import datasets
from mgdd.engine import OperatingPoint, check_pressure
from mgdd.errors import DataError, ParameterError
from mgdd.io import pressure_trace, read_pressure
from mgdd.results.labels import check_labels

ENGINE = draw(np.random.default_rng(5))
RECORD = record(np.random.default_rng(6), ENGINE, 12)
ANGLE, BAR, FUEL = RECORD.angle, RECORD.bar, RECORD.fuel_mg


def seen(bar: np.ndarray = BAR, angle: np.ndarray = ANGLE, **options: object):
    return check_pressure(pressure_trace(angle, bar, name="bench 4"), ENGINE.cylinder(), **options)


def test_a_sound_record_passes_and_says_what_stays_open() -> None:
    report = seen()
    assert report.verdict == "no fault found"
    assert {check.name: check.verdict for check in report.checks if check.verdict != "no fault found"} == {
        "top dead centre": "open", "work and heat": "open", "amplifier": "open", "crank angle": "open",
    }  # fmt: skip
    assert "1 °CA moves the closed IMEP by" in report["top dead centre"].text
    assert "is not seen" in report["crank angle"].text
    assert report.summary().splitlines()[0] == "bench 4: no fault found, 9 of 13 checks made"
    assert float(report.analysis["mean_imep_net_bar"]) < float(report.analysis["mean_imep_gross_bar"])
    check_labels(report.dataset)
    assert report.to_dataframe().loc["samples", "verdict"] == "no fault found"


def test_one_closed_cycle_leaves_more_open() -> None:
    report = check_pressure(datasets.read("hd_diesel_128x144")[2], "hd_diesel_128x144")
    opened = {check.name for check in report.checks if check.verdict == "open"}
    assert opened == {"crank angle", "top dead centre", "work and heat", "gas exchange", "cycles", "amplifier"}


def test_stated_fuel_judges_the_gain() -> None:
    fuel = float(FUEL.mean())
    assert seen(fuel_mg=fuel)["work and heat"].verdict == "no fault found"
    doubted = seen(1.3 * BAR, fuel_mg=fuel)["work and heat"]
    assert doubted.verdict == "doubt"
    assert "gain" in doubted.remedy
    assert check_pressure(
        pressure_trace(ANGLE, BAR).assign_attrs(fuel_mg=fuel), ENGINE.cylinder()
    )["work and heat"].verdict == "no fault found"  # fmt: skip


def test_fuel_means_the_same_by_keyword_and_in_the_point() -> None:
    right, threefold = float(FUEL.mean()), 3.0 * float(FUEL.mean())
    for fuel, verdict in ((right, "no fault found"), (threefold, "doubt")):
        by_keyword, by_point = seen(fuel_mg=fuel), seen(point={"fuel_mg": fuel})
        assert by_point["work and heat"] == by_keyword["work and heat"]
        assert by_point["work and heat"].verdict == verdict
    with pytest.raises(ParameterError, match=r"fuel_mg = .* and point\['fuel_mg'\] = .* contradict"):
        seen(fuel_mg=right, point={"fuel_mg": threefold})
    # What has every field may be of another load: its fuel judges nothing.
    assert seen(point=OperatingPoint(fuel_mg=threefold))["work and heat"].verdict == "open"


def test_an_intake_pressure_by_name_is_judged_as_the_keyword_is() -> None:
    far = {"intake_pressure_kpa": 180.0 * ENGINE.intake_bar}
    assert seen(point=far)["level"].verdict == "doubt"
    assert seen(point=OperatingPoint(**far))["level"].verdict == "no fault found"
    with pytest.raises(ParameterError, match="intake_pressure_kpa"):
        seen(pegging="inlet", point={"speed_rpm": 1500.0})


def test_a_guessed_engine_is_open_whatever_the_trace() -> None:
    report = seen(assumed="bore_mm = 86 of puma_single")
    assert (report.verdict, report["engine"].verdict) == ("open", "open")
    assert "bore_mm = 86" in report["engine"].text
    assert report.summary().splitlines()[0] == "bench 4: open, 9 of 14 checks made"
    assert seen(0.9 * np.minimum(BAR, 0.9 * BAR.max()), assumed="bore_mm = 86").verdict == "fail"


def test_the_worst_comes_first_and_the_reader_is_told_what_to_do() -> None:
    report = seen(np.minimum(BAR, 0.9 * BAR.max()))
    first = report.summary().splitlines()[1]
    assert report.verdict == report["samples"].verdict == "fail"
    assert first.split()[:2] == ["samples", "fail:"]
    assert "amplifier" in first
    with pytest.raises(ParameterError, match="no check 'sample'"):
        report["sample"]


def test_every_doubt_of_the_reader_is_passed_on() -> None:
    trace = pressure_trace(ANGLE, BAR).assign_attrs(warnings="one thing\nanother thing")
    assert check_pressure(trace, ENGINE.cylinder())["file"].text == "one thing; another thing"


def test_a_motored_record_decides_dead_centre_and_not_the_burn() -> None:
    report = seen(record(np.random.default_rng(7), ENGINE, 5, motored=True).bar, fuel_mg=20.0)
    opened = {check.name for check in report.checks if check.verdict == "open"}
    assert opened == {"burn", "work and heat", "crank angle"}


def test_a_swing_of_the_speed_is_the_first_cause_where_the_angle_is_a_time(tmp_path: Path) -> None:
    swung = np.deg2rad(ANGLE)
    turned = np.cumsum(1.0 / (1.0 + 0.05 * np.cos(swung)))  # slow at the dead centres
    seconds = (np.arange(12)[:, None] + turned / turned[-1]) * 120.0 / ENGINE.speed
    file = tmp_path / "time.csv"
    np.savetxt(file, np.column_stack([seconds.ravel(), BAR.ravel()]), delimiter=",", header="time_s,p_bar", comments="")
    even = np.arange(BAR.size) * (120.0 / ENGINE.speed / ANGLE.size)
    np.savetxt(file, np.column_stack([even, np.interp(even, seconds.ravel(), BAR.ravel())]), delimiter=",",
               header="time_s,p_bar", comments="", fmt="%.9f")  # fmt: skip
    report = check_pressure(read_pressure(file, speed_rpm=ENGINE.speed, firing_tdc_deg=360.0), ENGINE.cylinder())
    named = [check for check in report.checks if check.verdict == "doubt" and check.remedy]
    assert any(check.remedy.startswith("take the angle of an encoder") for check in named), report.summary()


def test_levels_of_cycles_are_compared() -> None:
    bar = BAR.copy()
    bar[7] += 0.4
    assert "cycle 8 by +0.4 bar" in seen(bar)["cycles"].text
    drifting = seen(BAR + np.linspace(0.0, 0.4, len(BAR))[:, None])["cycles"]
    assert "moves by +0.4" in drifting.text
    assert "from cycle 1 to cycle 12" in drifting.text
    assert seen(BAR + np.linspace(0.0, 0.04, len(BAR))[:, None])["cycles"].verdict == "no fault found"


def test_the_gas_exchange_is_judged() -> None:
    low = np.where((ANGLE < -190.0) | (ANGLE > 190.0), BAR - ENGINE.intake_bar, BAR)
    assert seen(low)["gas exchange"].verdict == "doubt"
    lifted = np.where(ANGLE < -200.0, 1.9 * BAR, BAR)
    assert "intake stroke" in seen(lifted)["gas exchange"].text


def test_a_refused_file_fails_and_raises_nothing(tmp_path: Path) -> None:
    file = tmp_path / "torn.csv"
    file.write_text("crank_angle_cad,p\n-30,5\n-29,x\n", encoding="utf-8")
    report = check_pressure(str(file), ENGINE.cylinder())
    assert report.verdict == "fail"
    assert report.analysis is None
    assert "torn.csv" in report["file"].text
    assert report.dataset.sizes["check"] == 1
    with pytest.raises(FileNotFoundError):
        check_pressure(str(tmp_path / "none.csv"), ENGINE.cylinder())
    with pytest.raises(DataError):  # an analysis says why
        pressure_trace(ANGLE, np.roll(BAR, 480, axis=1))


def test_every_kind_of_doubt_belongs_to_a_check() -> None:
    source = Path(__file__).parents[3] / "cpp" / "src" / "engine" / "pressure"
    text = "".join(file.read_text(encoding="utf-8") for file in source.glob("*.cpp"))
    import re

    from mgdd.engine.pressure_check import _CHECKS, _REMEDIES

    kinds = set(re.findall(r'warnings\.push_back\(\s*\{\s*"(\w+)"', text)) | {"clipped", "stuck"}
    known = {kind for own in _CHECKS.values() for kind in own}
    assert len(kinds) > 12
    assert kinds <= known
    assert known - {"reading"} == set(_REMEDIES)
