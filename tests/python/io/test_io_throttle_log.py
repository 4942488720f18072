"""Throttle logs: each refusal names row, column and remedy, and the remedy works."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io import read_throttle_log, throttle_log, write_csv
from mgdd.io.throttle_checks import check_sides, check_throttle_log

TIME = np.arange(1200) * 1e-3
DUTY = 0.25 * np.sin(2.0 * np.pi * 2.0 * TIME)
ANGLE = 20.0 + 16.0 * np.sin(2.0 * np.pi * 2.0 * TIME - 0.8)


def log(time: Any = TIME, duty: Any = DUTY, angle: Any = ANGLE, **options: Any) -> Any:
    return throttle_log(time, duty, angle, **options)


def csv(path: Path, columns: dict[str, Any]) -> Path:
    rows = zip(*columns.values(), strict=True)
    text = "\n".join(",".join(repr(float(v)) for v in row) for row in rows)
    path.write_text(",".join(columns) + "\n" + text + "\n", encoding="utf-8")
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return csv(tmp_path / "bench.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": ANGLE})


def test_arrays_are_copied_and_labelled() -> None:
    made = log(current_a=DUTY * 8.0, supply_v=np.full(1200, 13.8), name="bench 3")
    made["duty"][:] = 0.0
    assert DUTY.any()
    assert {name: made[name].attrs["units"] for name in made.variables} == {
        "time_s": "s", "duty": "1", "angle_deg": "degree", "current_a": "A", "supply_v": "V",
    }  # fmt: skip
    assert made.attrs["file"] == "bench 3"


def test_csv_round_trip_is_bit_exact(tmp_path: Path) -> None:
    made = log(np.arange(1200) / 1.7e3 + 17.1, current_a=DUTY * 8.0, supply_v=np.full(1200, 13.8), name="log.csv")
    for dataset in (made, made.drop_vars("supply_v")):
        write_csv(dataset, tmp_path / "log.csv")
        assert read_throttle_log(tmp_path / "log.csv").identical(dataset)


def test_a_refused_log_leaves_the_file(file: Path) -> None:
    before = file.read_bytes()
    bad = log().assign(duty=("time_s", DUTY * 9.0, log()["duty"].attrs))
    with pytest.raises(DataError, match="beyond ±1"):
        write_csv(bad, file)
    assert file.read_bytes() == before


def test_columns_by_name_number_and_unit(tmp_path: Path) -> None:
    path = csv(tmp_path / "own.csv", {"theta": np.deg2rad(ANGLE), "t": TIME * 1e3, "u": DUTY * 100.0, "ibat": DUTY})
    options: dict[str, Any] = {"time_unit": "ms", "duty_unit": "%", "angle_unit": "rad"}
    named = read_throttle_log(path, time="t", duty="u", angle="theta", current="ibat", **options)
    numbered = read_throttle_log(path, time=1, duty=2, angle=0, current=3, **options)
    assert named.identical(numbered)
    np.testing.assert_allclose(named["angle_deg"], ANGLE, rtol=1e-14)
    np.testing.assert_allclose(named["duty"], DUTY, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(named["current_a"], DUTY)


COLUMNS = {"t": TIME * 1e3, "u": DUTY * 100.0, "theta": np.deg2rad(ANGLE)}


@pytest.mark.parametrize(
    "form", ["t [ms],u [%],theta [rad]", "t (ms),u (%),theta (rad)", "t,u,theta\nms,%,rad", "t/ms,u/%,theta_plate/rad"]
)
def test_what_the_file_says_of_its_units_is_taken(tmp_path: Path, form: str) -> None:
    path = csv(tmp_path / "own.csv", COLUMNS)
    path.write_text(path.read_text().replace("t,u,theta", form, 1))
    said = read_throttle_log(path, time=0, duty=1, angle=2)
    np.testing.assert_allclose(said["time_s"], TIME, atol=1e-12)
    np.testing.assert_allclose(said["duty"], DUTY, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(said["angle_deg"], ANGLE, rtol=1e-14)
    assert said.identical(read_throttle_log(path, time=0, duty=1, angle=2, time_unit="ms", angle_unit="rad"))
    for option, wrong, column in (("time_unit", "s", "ms"), ("duty_unit", "-", "%"), ("angle_unit", "%", "rad")):
        with pytest.raises(DataError, match=f"is in '{column}' as the file says: leave {option} out"):
            read_throttle_log(path, time=0, duty=1, angle=2, **{option: wrong})


@pytest.mark.parametrize(
    ("form", "message"),
    [
        ("t [min],u [%],theta [rad]", r"'t \[min\]' is in 'min' as the file says: convert it to s or ms, or correct"),
        ("t [ms],u [V],theta [rad]", "in 'V' as the file says: convert it to - or %"),
        ("t [ms],u [%],theta (deg/s)", "in 'deg/s' as the file says: convert it to deg or rad or %"),
        ("t,u,theta\nms,%,gon", "column 'theta' is in 'gon' as the file says"),
    ],
)
def test_a_unit_that_is_not_known_is_refused(tmp_path: Path, form: str, message: str) -> None:
    path = csv(tmp_path / "own.csv", COLUMNS)
    path.write_text(path.read_text().replace("t,u,theta", form, 1))
    with pytest.raises(DataError, match=message):
        read_throttle_log(path, time=0, duty=1, angle=2)


def test_a_remark_in_brackets_is_settled_by_the_user(tmp_path: Path) -> None:
    path = csv(tmp_path / "own.csv", COLUMNS)
    path.write_text(path.read_text().replace("t,u,theta", "t (since start),u [%],theta (plate) [rad]", 1))
    with pytest.raises(
        DataError, match=r"in 'since start' as the file says: .*, or pass time_unit= if that is a remark"
    ):
        read_throttle_log(path, time=0, duty=1, angle=2)
    np.testing.assert_allclose(
        read_throttle_log(path, time=0, duty=1, angle=2, time_unit="ms")["time_s"], TIME, atol=1e-12
    )


def test_a_current_in_another_unit_is_refused(tmp_path: Path) -> None:
    path = csv(tmp_path / "own.csv", {**COLUMNS, "ibat": DUTY})
    path.write_text(path.read_text().replace("ibat", "ibat [mA]", 1))
    with pytest.raises(DataError, match="in 'mA' as the file says: convert it to A"):
        read_throttle_log(path, time=0, duty=1, angle=2, current=3, time_unit="ms", duty_unit="%", angle_unit="rad")


def test_semicolons_and_decimal_commas(tmp_path: Path) -> None:
    path = tmp_path / "de.csv"
    rows = (f"{t:.4f};{u:.6f};{a:.5f}".replace(".", ",") for t, u, a in zip(TIME, DUTY, ANGLE, strict=True))
    path.write_text("time_s;duty;angle_deg\n" + "\n".join(rows), encoding="utf-8")
    np.testing.assert_allclose(read_throttle_log(path, decimal=",")["angle_deg"], ANGLE, atol=1e-5)


def test_a_missing_column_names_those_there(file: Path) -> None:
    with pytest.raises(DataError, match=r"no column 'theta': the header has 'time_s', 'duty', 'angle_deg'"):
        read_throttle_log(file, angle="theta")


def test_matlab_structs_matrices_and_compression(tmp_path: Path) -> None:
    from scipy.io import savemat

    record = {"rec": {"time_s": TIME, "y": {"th": ANGLE}}, "u": DUTY, "note": "bench"}
    savemat(tmp_path / "a.mat", record, do_compression=True)
    made = read_throttle_log(tmp_path / "a.mat", time="rec.time_s", duty="u", angle="rec.y.th")
    savemat(tmp_path / "b.mat", {"all": np.column_stack([TIME, DUTY, ANGLE])})
    matrix = read_throttle_log(tmp_path / "b.mat", time=0, duty=1, angle=2)
    np.testing.assert_array_equal(made["angle_deg"], matrix["angle_deg"])
    with pytest.raises(DataError, match="numbered from 0"):
        read_throttle_log(tmp_path / "b.mat", time=0, duty=1, angle=3)
    by_number = read_throttle_log(tmp_path / "a.mat", time=0, angle=1, duty=2)  # in the order of the file
    np.testing.assert_array_equal(by_number["angle_deg"], ANGLE)


def test_what_is_no_matlab_file_says_how_to_save(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(b"nothing of the kind" * 20)
    with pytest.raises(DataError, match="-v7"):
        read_throttle_log(path)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n" * 20)
    with pytest.raises(DataError, match=r"cannot be read \(OSError"):
        read_throttle_log(path)
    with pytest.raises(FileNotFoundError):
        read_throttle_log(tmp_path / "none.mat")


def test_the_line_of_the_file_is_named(tmp_path: Path) -> None:
    time = TIME.copy()
    time[700:] += 0.25
    path = csv(tmp_path / "gap.csv", {"t": time, "duty": DUTY, "angle_deg": ANGLE})
    said = r"gap\.csv, line 702, column 't': gap from 0.699 to 0.95 s .*pass stop_s=0.699 or start_s=0.95 to keep"
    with pytest.raises(DataError, match=said):
        read_throttle_log(path, time="t")
    assert read_throttle_log(path, time="t", stop_s=0.699).sizes["time_s"] == 700
    with pytest.raises(DataError, match=r"0.499 s; at least 0.5 s"):
        read_throttle_log(path, time="t", start_s=0.95)
    with pytest.raises(ParameterError, match="no row of"):
        read_throttle_log(path, time="t", start_s=5.0)


def test_repeated_and_falling_time() -> None:
    twice = TIME.copy()
    twice[500] = twice[499]
    with pytest.raises(DataError, match=r"log, sample 500, column 'time_s': time 0.499 s is repeated: keep one row"):
        log(twice)
    keep = np.delete(np.arange(1200), 500)
    log(np.delete(TIME, 1199), DUTY[keep], ANGLE[keep])
    order = np.r_[0:500, 501, 500, 502:1200]
    with pytest.raises(DataError, match=r"sample 501.*falls from 0.501 to 0.5 s: sort the rows"):
        log(TIME[order], DUTY[order], ANGLE[order])
    back = np.argsort(TIME[order])
    assert log(TIME[order][back], DUTY[order][back], ANGLE[order][back]).equals(log())
    with pytest.raises(DataError, match="one record per file"):
        log(np.r_[TIME[:600], TIME[:600]])


@pytest.mark.parametrize("name", ["time", "duty", "angle"])
def test_nan(name: str) -> None:
    columns = {"time": TIME.copy(), "duty": DUTY.copy(), "angle": ANGLE.copy()}
    columns[name][77] = np.nan
    column = {"time": "time_s", "angle": "angle_deg"}.get(name, name)
    with pytest.raises(DataError, match=rf"log, sample 77, column '{column}': nan is not finite: repair it or cut"):
        log(**columns)
    columns[name][77] = (columns[name][76] + columns[name][78]) / 2.0
    log(**columns)


def test_percent_duty_and_back(tmp_path: Path) -> None:
    path = csv(tmp_path / "p.csv", {"time_s": TIME, "duty": DUTY * 100.0, "angle_deg": ANGLE})
    with pytest.raises(DataError, match=r"p\.csv, line \d+, column 'duty': duty .* is beyond ±1: .*duty_unit='%'"):
        read_throttle_log(path)
    np.testing.assert_allclose(read_throttle_log(path, duty_unit="%")["duty"], DUTY, rtol=1e-14, atol=1e-16)
    path = csv(tmp_path / "f.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": ANGLE})
    with pytest.raises(DataError, match="fraction; pass duty_unit='-'"):
        read_throttle_log(path, duty_unit="%")
    with pytest.raises(DataError, match="clip it"):
        log(duty=DUTY * 4.1)
    log(duty=np.clip(DUTY * 4.1, -1.0, 1.0))
    with pytest.raises(DataError, match="divide by the supply"):
        log(duty=DUTY * 1000.0)


def test_a_still_angle() -> None:
    noise = 0.03 * np.random.default_rng(1).standard_normal(1200)
    with pytest.raises(DataError, match=r"column 'angle_deg': the angle stays within .* of 8"):
        log(angle=8.0 + noise)
    log(angle=8.0 + noise + 0.01 * np.arange(1200))


def test_exchanged_columns(tmp_path: Path) -> None:
    path = csv(tmp_path / "x.csv", {"time_s": TIME, "duty": ANGLE, "angle_deg": DUTY})
    with pytest.raises(DataError, match=r"x\.csv, line \d+, column 'duty': 35\S+ beside .*columns look exchanged"):
        read_throttle_log(path)
    made = read_throttle_log(path, duty="angle_deg", angle="duty")
    np.testing.assert_array_equal(made["duty"], DUTY)
    percent = csv(tmp_path / "y.csv", {"time_s": TIME, "duty": ANGLE, "angle_deg": DUTY * 100.0})
    with pytest.raises(DataError, match=r"column 'angle_deg': -25 .*exchanged"):
        read_throttle_log(percent, duty_unit="%")
    read_throttle_log(percent, duty="angle_deg", angle="duty", duty_unit="%")


def test_a_still_duty(tmp_path: Path) -> None:
    path = csv(tmp_path / "s.csv", {"time_s": TIME, "u": np.full(1200, 0.2), "angle_deg": ANGLE, "supply_v": DUTY + 13})
    with pytest.raises(
        DataError,
        match=r"s\.csv, lines 2 to 1201, column 'u': the duty stays at 0\.2: check the column; .*log a varied",
    ):
        read_throttle_log(path, duty="u")
    with pytest.raises(DataError, match=r"log, samples 0 to 1199, column 'duty': the duty stays at -0\.3"):
        log(duty=np.full(1200, -0.3))
    log(duty=np.where(TIME < 0.6, 0.2, 0.25))
    read_throttle_log(csv(tmp_path / "t.csv", {"time_s": TIME, "u": DUTY, "angle_deg": ANGLE}), duty="u")


def test_exchanged_time(tmp_path: Path) -> None:
    path = csv(tmp_path / "x.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": ANGLE})
    with pytest.raises(
        DataError, match=r"x\.csv, line \d+, column 'angle_deg': time falls at \d+ of 1199.*'time_s' rises"
    ):
        read_throttle_log(path, time="angle_deg", angle="time_s")
    with pytest.raises(DataError, match="the columns look exchanged; exchange time= and angle="):
        read_throttle_log(path, time="angle_deg", angle="time_s")
    stairs = np.repeat([0.1, 0.2, 0.3, 0.2, 0.1, 0.0], 200)  # mostly repeated
    for duty in (DUTY, stairs):
        with pytest.raises(DataError, match="the columns look exchanged; exchange time_s and duty"):
            log(duty, TIME, ANGLE)
    with pytest.raises(
        DataError, match="columns exchanged\\? check time_s, duty and angle_deg; if they are right, sort"
    ):
        log(ANGLE, DUTY, ANGLE)
    read_throttle_log(path)


def test_percent_and_radians_beside_each_other_are_both_offered(tmp_path: Path) -> None:
    path = csv(tmp_path / "z.csv", {"time_s": TIME, "duty": DUTY * 100.0 + 30.0, "angle_deg": np.deg2rad(ANGLE)})
    with pytest.raises(
        DataError, match="exchange duty= and angle=, or, if they are right, pass duty_unit='%' and angle_u"
    ):
        read_throttle_log(path)
    read_throttle_log(path, duty_unit="%", angle_unit="rad")


def test_radians_and_percent_of_travel(tmp_path: Path) -> None:
    path = csv(tmp_path / "r.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": np.deg2rad(2.2 * ANGLE)})
    with pytest.raises(DataError, match=r"column 'angle_deg': the highest angle is 1.38. deg: .*angle_unit='rad'"):
        read_throttle_log(path)
    np.testing.assert_allclose(read_throttle_log(path, angle_unit="rad")["angle_deg"], 2.2 * ANGLE, rtol=1e-13)
    degrees = csv(tmp_path / "d.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": ANGLE})
    with pytest.raises(DataError, match=r"this looks like degrees; pass angle_unit='deg'"):
        read_throttle_log(degrees, angle_unit="rad")
    read_throttle_log(degrees)
    percent = csv(tmp_path / "q.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": 64.0 + ANGLE})
    with pytest.raises(DataError, match=r"beyond 95: this looks like percent of travel; pass angle_unit='%'"):
        read_throttle_log(percent)
    assert float(read_throttle_log(percent, angle_unit="%")["angle_deg"].max()) == pytest.approx(90.0, abs=0.01)
    with pytest.raises(DataError, match="count from the closed plate"):
        log(angle=ANGLE - 40.0)


def test_a_fraction_of_the_travel(tmp_path: Path) -> None:
    path = csv(tmp_path / "f.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": ANGLE / 38.0})
    with pytest.raises(
        DataError, match="angle_unit='rad'; or like a fraction of the travel; multiply it by 100 and pass"
    ):
        read_throttle_log(path)
    again = csv(tmp_path / "g.csv", {"time_s": TIME, "duty": DUTY, "angle_deg": ANGLE / 38.0 * 100.0})
    np.testing.assert_allclose(read_throttle_log(again, angle_unit="%", travel_deg=38.0)["angle_deg"], ANGLE)


def test_too_short() -> None:
    with pytest.raises(DataError, match="49 samples; at least 50"):
        log(TIME[:49], DUTY[:49], ANGLE[:49])
    with pytest.raises(DataError, match=r"0\.299 s; at least 0\.5 s"):
        log(TIME[:300], DUTY[:300], ANGLE[:300])
    log(TIME[:502], DUTY[:502], ANGLE[:502])


def test_milliseconds(tmp_path: Path) -> None:
    path = csv(tmp_path / "ms.csv", {"time_s": TIME * 1e3, "duty": DUTY, "angle_deg": ANGLE})
    with pytest.raises(DataError, match="time_unit='ms'"):
        read_throttle_log(path)
    np.testing.assert_allclose(read_throttle_log(path, time_unit="ms")["time_s"], TIME, atol=1e-15)


def test_uneven_sampling_is_resampled() -> None:
    rng = np.random.default_rng(3)
    uneven = TIME + np.r_[0.0, rng.uniform(-0.2e-3, 0.2e-3, 1198), 0.0]
    angle = np.interp(uneven, TIME, ANGLE)
    with pytest.raises(DataError, match=r"column 'time_s': uneven sampling: .*pass sample_s=0.001 to resample"):
        log(uneven, angle=angle)
    made = log(uneven, angle=angle, sample_s=1e-3)
    np.testing.assert_allclose(made["time_s"], TIME, atol=1e-12)
    np.testing.assert_allclose(made["angle_deg"], ANGLE, atol=0.05)
    assert set(made["duty"].to_numpy()) <= set(DUTY), "the duty holds"
    drifting = np.cumsum(np.r_[0.0, np.where(np.arange(1199) < 600, 1.0e-3, 1.08e-3)])
    with pytest.raises(DataError, match="uneven sampling"):
        log(drifting)
    with pytest.raises(ParameterError, match="sample_s"):
        log(uneven, sample_s=-1.0)


def test_jitter_is_no_gap() -> None:
    for seed in range(20):
        time = np.arange(4000) * 1e-3
        jittered = time + 0.1e-3 * np.random.default_rng(seed).standard_normal(4000)
        duty, angle = np.interp(time % 1.0, TIME, DUTY), np.interp(time % 1.0, TIME, ANGLE)
        with pytest.raises(DataError, match=r"uneven sampling: .*pass sample_s=0.001 to resample"):
            log(jittered, duty, angle)
        assert log(jittered, duty, angle, sample_s=1e-3).sizes["time_s"] >= 3999
        for at in (2000, 3990):  # one sample that is missing is still seen, by its own row
            keep = np.delete(np.arange(4000), at)
            with pytest.raises(DataError, match=rf"sample {at}, column 'time_s': gap from"):
                log(jittered[keep], duty[keep], angle[keep], sample_s=1e-3)


def test_a_two_sided_fit_needs_both_sides() -> None:
    made = log()
    with pytest.raises(
        DataError, match=r"column 'angle_deg': 0 s below limp-home \(2 deg; the lowest angle is 4 deg\)"
    ):
        check_sides(made, 2.0)
    with pytest.raises(DataError, match=r"above limp-home .*add positive duty"):
        check_sides(made, 40.0)
    check_sides(made, 8.0)
    assert check_throttle_log(made) is made, "the remedy: one side only"


def test_what_is_no_log(file: Path) -> None:
    with pytest.raises(ShapeError, match="equally long"):
        log(duty=DUTY[:-1])
    with pytest.raises(ShapeError, match="dimension"):
        log(duty=DUTY[:, None])
    with pytest.raises(DataError, match="no angle_deg"):
        check_throttle_log(log().drop_vars("angle_deg"))
    for option in ("time_unit", "duty_unit", "angle_unit"):
        with pytest.raises(DataError, match=option):
            read_throttle_log(file, **{option: "furlong"})
