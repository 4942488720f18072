"""Pressure files as benches write them: many cycles, times, counts, volts; what is doubtful is refused by its names."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mgdd.engine import Cylinder, OperatingPoint, simulate
from mgdd.errors import DataError, ShapeError
from mgdd.io import pressure_trace, read_pressure, write_csv
from mgdd.io.column_names import heading
from mgdd.io.pressure_checks import to_bar
from mgdd.results.labels import ANGLE, check_labels
from pressure_files import BAR, CLOSED, CYCLES, FULL, ONE, RUN, Write

Array = NDArray[np.float64]


def simulated() -> tuple[Array, Array]:
    """Cycles of rising fuel mass over one angle grid."""
    runs = [simulate(Cylinder(), OperatingPoint(fuel_mg=20.0 + fuel), soc_cad=-4.0) for fuel in range(3)]
    return runs[0][ANGLE].to_numpy(), np.stack([run["pressure_bar"].to_numpy() for run in runs])


@pytest.mark.parametrize(
    "header",
    [
        "",
        "angle," + ",".join(f"p{k}" for k in range(1, 6)),
        "angle,p,p.1,p.2,p.3,p.4",
        "angle,1,2,3,4,5",
        "Crank angle [°CA]," + ",".join(f"Cycle {k} [bar]" for k in range(7, 12)),
        "CAD," + ",".join(f"cyl1_cycle{k}" for k in range(1, 6)),
        "°KW,1. Zyklus,2. Zyklus,3. Zyklus,4. Zyklus,5. Zyklus",
    ],
)
def test_a_column_per_cycle(write: Write, header: str) -> None:
    trace = read_pressure(write([FULL, *CYCLES], header))
    check_labels(trace)
    assert trace["pressure_bar"].dims == ("cycle", ANGLE)
    assert trace["cycle"].to_numpy().tolist() == [1, 2, 3, 4, 5]
    assert (trace["cycle"].attrs["long_name"], trace["cycle"].attrs["units"]) == ("cycle", "1")
    np.testing.assert_array_equal(trace[ANGLE], FULL)
    np.testing.assert_array_equal(trace["pressure_bar"], CYCLES)
    assert trace.attrs == {"file": "bench.csv", "warnings": ""}


def test_simulated_cycles_in_columns_and_named_ones(write: Write) -> None:
    angle, pressure = simulated()
    path = write([angle, *pressure], "crank_angle_cad,p_1,p_2,p_3")
    np.testing.assert_array_equal(read_pressure(path)["pressure_bar"], pressure)
    np.testing.assert_array_equal(read_pressure(path, pressure_column=["p_3", 1])["pressure_bar"], pressure[[2, 0]])
    one = read_pressure(path, pressure_column="p_2")
    assert one["pressure_bar"].dims == (ANGLE,)
    np.testing.assert_array_equal(one["pressure_bar"], pressure[1])
    with pytest.raises(DataError, match=r"pressure_column = .*beside the angle"):
        read_pressure(path, pressure_column=[1, 1])
    with pytest.raises(DataError, match="beside the angle"):
        read_pressure(path, pressure_column=[0, 1])


def test_columns_of_other_quantities_are_no_cycles(write: Write) -> None:
    others = [CLOSED * 1e-4, CLOSED * 0.0 + 210.0, 40.0 + 8.0 * BAR, BAR * 0.01]
    path = write([CLOSED, BAR, *others], "angle,p_cyl,time_s,torque_nm,heat_J,p_intake [bar]")
    np.testing.assert_array_equal(read_pressure(path)["pressure_bar"], BAR)
    exact = write([CLOSED, BAR, 0.9 * BAR], "crank_angle_cad,pressure_bar,motored_pressure_bar")
    np.testing.assert_array_equal(read_pressure(exact)["pressure_bar"], BAR)
    noted = write([CLOSED, BAR], "angle,p").read_text().replace("\n", ",ok\n").replace("p,ok", "p,note")
    path.write_text(noted)
    np.testing.assert_array_equal(read_pressure(path)["pressure_bar"], BAR)


OTHER = np.roll(ONE, 360)  # fires 180 °CA later
NEAR = 0.6 * ONE + 0.9 * np.roll(ONE, 100)  # 50 °CA later, and still like the first
NARROW = 2.0 + 90.0 * np.exp(-np.abs(FULL - FULL[ONE.argmax()]))  # no pressure, with its peak at the same place
DOUBTFUL = {
    "a near cylinder": ([FULL, ONE, NEAR], "", "columns 1, 2 may not be"),
    "a marker": ([FULL, ONE, NARROW], "", "columns 1, 2 may not be"),
    "cylinders": ([FULL, ONE, ONE], "CAD,Cyl_1,Cyl_2", "columns 'Cyl_1', 'Cyl_2' are of several cylinders"),
    "another cylinder": ([FULL, ONE, OTHER], "CAD,p1,p2", "column 'p2' has another shape than column 'p1'"),
    "mean and max": ([FULL, ONE, CYCLES[4]], "CAD,mean,max", "columns 'mean', 'max' have unlike names: .*='mean'"),
    "torque unnamed": ([FULL, ONE, ONE * 0.0 + 7.0], "", "columns 1, 2 may not be .*pressure_column=1"),
    "inverse": ([FULL, ONE, -ONE], "", "columns 1, 2 may not be"),
    "pressure first": ([ONE, FULL], "p,angle", "column 'p' is not a crank angle: pass angle_column='angle'"),
    "time first": ([RUN[:1440], FULL, ONE], "time_s,angle,p", "and 'angle' an angle: pass angle_column='angle'"),
    "count first": ([RUN[:1440], ONE], "sample,p", "column 'sample' counts samples: .*pass angle_step_deg= with"),
    "one column": ([ONE], "", "one column only: .*pass angle_step_deg="),
    "unit unknown": ([FULL, ONE], "CAD,p [inH2O]", "says 'inH2O' for the pressure: convert it to one of bar, mbar"),
    "unit unknown in a row": ([FULL, ONE], "CAD,p\ndeg,dyn", "says 'dyn' for the pressure: convert it to one of bar"),
    "may be a unit": ([FULL, ONE], "CAD,p (dyn/cm2)", "'dyn/cm2' in the header may be a unit, .*pass pressure_unit="),
    "a unit behind a blank": ([FULL, ONE], "CAD,pressure t/m2", "'t/m2' in the header may be a unit"),
    "x first": ([RUN[:1440], FULL, ONE], "X_Value,angle,p", "first one, and 'angle' is an angle: pass angle_column="),
    "angle in gon": ([FULL, ONE], "CAD [gon],p", "is in 'gon', which is not known: convert it, or pass angle_unit="),
    "two units": ([FULL, ONE, ONE], "CAD,p1,p2\ndeg,bar,kPa", "pressures in bar, kPa"),
    "volts": ([FULL, ONE], "CAD,U [V]", "says V for the pressure: pass gain_bar_per_v= and offset_bar="),
    "unclear time": ([CLOSED + 143.0, BAR], "t,p", "column 't' looks like a time: .*angle_unit='ms' and speed_rpm="),
    "time": ([CLOSED + 143.0, BAR], "time_ms,p", "column 'time_ms' is a time: pass speed_rpm="),
    "seconds": ([(CLOSED + 143.0) / 7200.0, BAR], "", "span only 0.0369444 degrees: .*seconds; pass angle_unit='s'"),
    "milliseconds": ([(CLOSED + 143.0) / 7.2, BAR], "", "at angle 0 is 2.32 bar, .*at 20.9722: .*angle_unit='ms'"),
    "run on": ([RUN, CYCLES.ravel()], "", "run on from 0 to 3599.5, 5 cycles: pass firing_tdc_deg="),
    "dead cycle": ([FULL, ONE, 0.01 * ONE], "", "cycle 2: the highest pressure 1.8347 bar"),
    "falling cycles": ([np.tile(-CLOSED, 3), np.tile(BAR, 3)], "", "fall, and jump back: .*pass before_tdc=True"),
}  # fmt: skip


@pytest.mark.parametrize("kind", DOUBTFUL)
def test_what_is_doubtful_is_refused_with_the_remedy(write: Write, kind: str) -> None:
    columns, header, message = DOUBTFUL[kind]
    with pytest.raises(DataError, match=message) as caught:
        read_pressure(write(columns, header))
    assert "bench.csv" in str(caught.value)


def test_cycles_below_each_other(write: Write) -> None:
    angle, pressure = np.tile(FULL, 5), CYCLES.ravel()
    np.testing.assert_array_equal(read_pressure(write([angle, pressure]))["pressure_bar"], CYCLES)
    cut = read_pressure(write([angle[100:-30], pressure[100:-30]]))
    np.testing.assert_array_equal(cut["pressure_bar"], CYCLES[1:4])
    assert cut.attrs["warnings"] == "cycles 1 and 5 of 5 left out: incomplete"
    short = read_pressure(write([angle[:1500], pressure[:1500]]))
    assert short["pressure_bar"].dims == (ANGLE,)
    assert short.attrs["warnings"] == "cycle 2 of 2 left out: incomplete"
    closed = read_pressure(write([np.tile(-CLOSED, 3), np.concatenate([BAR, 2.0 * BAR, BAR])]), before_tdc=True)
    np.testing.assert_array_equal(closed[ANGLE], CLOSED)
    np.testing.assert_array_equal(closed["pressure_bar"], np.stack([BAR, 2.0 * BAR, BAR]))


def test_cycles_below_each_other_that_do_not_match(write: Write) -> None:
    angle, pressure = np.tile(FULL, 3), CYCLES[:3].ravel()
    gone = np.delete(np.arange(angle.size), 2000)
    with pytest.raises(DataError, match=r"line 1441: the cycle that starts here has other crank angles .* line 1:"):
        read_pressure(write([angle[gone], pressure[gone]]))
    gone = np.delete(np.arange(angle.size), np.arange(2500, 2880))
    with pytest.raises(
        DataError, match=r"line 1441: cycle 2 of 3 runs from -360 to 169.5, the others from -360 to 359.5"
    ):
        read_pressure(write([angle[gone], pressure[gone]]))
    halves = np.concatenate([FULL[720:], FULL[:720]])
    with pytest.raises(DataError, match=r"no cycle from -360 to 359.5 is complete"):
        read_pressure(write([halves, ONE]))
    twice = write([np.tile(FULL, 2), CYCLES[:2].ravel(), CYCLES[:2].ravel()], "angle,p1,p2")
    with pytest.raises(DataError, match="several pressure columns, and several cycles below each other"):
        read_pressure(twice)


@pytest.mark.parametrize("step", [0.25, 0.5, 1.5])
def test_angles_that_run_on_in_radians_of_three_digits_lose_no_cycle(write: Write, step: float) -> None:
    angle = np.arange(0.0, 3600.0, step)
    path = write([np.round(np.deg2rad(angle), 3), np.interp(angle, RUN, CYCLES.ravel())], "angle [rad],p [bar]")
    trace = read_pressure(path, firing_tdc_deg=360.0)
    wanted = np.interp(angle, RUN, CYCLES.ravel()).reshape(5, -1)
    np.testing.assert_allclose(trace["pressure_bar"], wanted, atol=0.05 * wanted.max() * step)


@pytest.mark.parametrize("form", ["running", "stacked", "columns"])
def test_records_that_start_at_firing_tdc_join_each_compression_to_its_own_burn(write: Write, form: str) -> None:
    late = CYCLES.ravel()[720:-720]  # from the firing TDC of cycle 1 to that of cycle 5
    angle = RUN[: late.size]
    columns = {
        "running": [angle, late],
        "stacked": [angle % 720.0, late],
        "columns": [angle[:1440], *late.reshape(4, 1440)],
    }[form]
    trace = read_pressure(write(columns), firing_tdc_deg=0.0)
    np.testing.assert_allclose(trace[ANGLE], FULL, atol=1e-9)
    np.testing.assert_array_equal(trace["pressure_bar"], CYCLES[1:4])
    assert trace.attrs["warnings"] == (
        "360 degrees at the start and 360 degrees at the end of the record left out: incomplete cycles"
    )


@pytest.mark.parametrize("tdc", [360.0, 359.5, 200.0])
def test_angles_that_run_on_are_cut_at_their_start_in_the_gas_exchange(write: Write, tdc: float) -> None:
    path = write([RUN + tdc - 360.0, CYCLES.ravel()])
    trace = read_pressure(path, firing_tdc_deg=tdc)
    np.testing.assert_array_equal(trace[ANGLE], FULL)
    np.testing.assert_array_equal(trace["pressure_bar"], CYCLES)
    shifted = read_pressure(write([RUN, CYCLES.ravel()]), firing_tdc_deg=359.5)
    # Half a degree later, the sample at 360 is the one at -360: every cycle keeps its own.
    np.testing.assert_array_equal(shifted[ANGLE], FULL)
    np.testing.assert_array_equal(shifted["pressure_bar"], np.roll(CYCLES, 1, axis=1))
    with pytest.raises(DataError, match=r"firing_tdc_deg = 721: must be in \[0, 720\]"):
        read_pressure(path, firing_tdc_deg=721.0)
    gap = np.delete(np.arange(RUN.size), np.arange(3000, 3004))
    with pytest.raises(
        DataError, match=r"line 3001: gap in the crank angle from 1499.5 to 1502: the usual step is 0.5"
    ):
        read_pressure(write([RUN[gap], CYCLES.ravel()[gap]]), firing_tdc_deg=360.0)
    with pytest.raises(DataError, match=r"no complete cycle between 0 and 799.5 with firing TDC at 90"):
        read_pressure(write([RUN[:1600], np.roll(CYCLES.ravel(), -540)[:1600]]), firing_tdc_deg=90.0)


def test_samples_without_an_angle(write: Write) -> None:
    path = write([CYCLES.ravel()])
    by_start = read_pressure(path, angle_step_deg=0.5, angle_start_deg=-360.0)
    np.testing.assert_array_equal(by_start[ANGLE], FULL)
    np.testing.assert_array_equal(by_start["pressure_bar"], CYCLES)
    assert read_pressure(path, angle_step_deg=0.5, firing_tdc_deg=360.0).identical(by_start)
    counted = write([np.arange(BAR.size), BAR], "sample,p")
    closed = read_pressure(counted, angle_step_deg=1.0, angle_start_deg=-143.0)
    np.testing.assert_array_equal(closed[ANGLE], CLOSED)
    np.testing.assert_array_equal(closed["pressure_bar"], BAR)
    unnamed = read_pressure(write([np.arange(BAR.size), BAR]), angle_step_deg=1.0, angle_start_deg=-143.0)
    np.testing.assert_array_equal(unnamed["pressure_bar"], BAR)
    with pytest.raises(DataError, match=r"gives no firing TDC: pass angle_start_deg= .*firing_tdc_deg="):
        read_pressure(path, angle_step_deg=0.5)
    with pytest.raises(DataError, match=r"angle_step_deg is for samples without .*, angle_column for a column"):
        read_pressure(path, angle_step_deg=0.5, angle_column=0)
    with pytest.raises(DataError, match="holds angles: angle_start_deg is for a time"):
        read_pressure(write([CLOSED, BAR]), angle_start_deg=-143.0)
    with pytest.raises(DataError, match="angle_step_deg = 0: must be > 0 and <= 10"):
        read_pressure(path, angle_step_deg=0.0)
    with pytest.raises(DataError, match="before_tdc is for an angle column"):
        read_pressure(path, angle_step_deg=0.5, angle_start_deg=-360.0, before_tdc=True)


@pytest.mark.parametrize(("unit", "per_s"), [("s", 1.0), ("ms", 1e3), ("us", 1e6)])
@pytest.mark.parametrize("header", ["time_{},p", "Time [{}],p [bar]", "t,p\n{},bar", ""])
def test_times_become_angles(write: Write, unit: str, per_s: float, header: str) -> None:
    seconds = 12.5 + (CLOSED + 143.0) / (6.0 * 1500.0)
    said = {} if header else {"angle_unit": unit}
    path = write([seconds * per_s, BAR], header.format(unit))
    trace = read_pressure(path, speed_rpm=1500.0, angle_start_deg=-143.0, **said)
    np.testing.assert_allclose(trace[ANGLE], CLOSED, atol=1e-8)
    assert trace.attrs["speed_rpm"] == 1500.0
    with pytest.raises(DataError, match="a time gives no firing TDC: pass angle_start_deg="):
        read_pressure(path, speed_rpm=1500.0, **said)
    if header:
        with pytest.raises(DataError, match=f"is in {unit} as the file says: leave angle_unit out"):
            read_pressure(path, angle_unit="deg")


def test_milliseconds_from_a_trigger_at_tdc_are_doubted(write: Write) -> None:
    trigger = read_pressure(write([CLOSED / 7.2, BAR]))  # -20 to 17 ms at 1200 rpm
    assert "the pressure rises 58.5 times from -19.8611 to 0 °CA aTDC" in trigger.attrs["warnings"]
    assert "pass angle_unit='ms' and speed_rpm=" in trigger.attrs["warnings"]
    near = np.abs(CLOSED) <= 25.0
    assert read_pressure(write([CLOSED[near], BAR[near]])).attrs["warnings"] == ""
    relative = read_pressure(write([CLOSED / 7.2, BAR - 2.0]))
    assert relative.attrs["warnings"] == ""  # the ratio of a relative pressure says nothing


def test_a_misfire_is_a_cycle_too(write: Write) -> None:
    runs = [simulate(Cylinder(), OperatingPoint(fuel_mg=fuel), soc_cad=-4.0) for fuel in (40.0, 0.0)]
    pressure = np.stack([run["pressure_bar"].to_numpy() for run in runs])
    assert pressure[0].max() > 1.3 * pressure[1].max()
    path = write([runs[0][ANGLE].to_numpy(), *pressure])
    np.testing.assert_array_equal(read_pressure(path)["pressure_bar"], pressure)


def test_a_long_record_over_time(write: Write) -> None:
    # 18000 samples per second at 1500 rpm are 0.5 °CA per sample.
    path = write([RUN / 9000.0, CYCLES.ravel()], "time_s,p_bar")
    trace = read_pressure(path, speed_rpm=1500.0, firing_tdc_deg=360.0)
    np.testing.assert_allclose(trace[ANGLE], FULL, atol=1e-9)
    np.testing.assert_array_equal(trace["pressure_bar"], CYCLES)
    with pytest.raises(DataError, match="speed_rpm = -1: must be > 0 and <= 30000"):
        read_pressure(path, speed_rpm=-1.0)


# In 2060 samples both cycles have 1029 samples, the second 0.3 degrees later; in 3200 samples the third has 1028.
@pytest.mark.parametrize(("samples", "cycles"), [(2060, 2), (3200, 3)])
def test_a_step_that_divides_no_cycle_is_interpolated_and_told(write: Write, samples: int, cycles: int) -> None:
    step = 0.7  # 720 / 0.7 is not an integer
    angle = step * np.arange(samples)
    signal = 60.0 + 50.0 * np.cos(np.deg2rad(angle - 360.0) / 2.0)  # every cycle is the same, and smooth
    trace = read_pressure(write([angle, signal]), firing_tdc_deg=360.0)
    assert trace.sizes["cycle"] == cycles
    assert "interpolated linearly to the angles of the first" in trace.attrs["warnings"]
    exact = 60.0 + 50.0 * np.cos(np.deg2rad(trace[ANGLE].to_numpy()) / 2.0)
    # Linear interpolation is off by at most max|f''| h^2 / 8.
    bound = 50.0 * np.deg2rad(step / 2.0) ** 2 / 8.0
    assert np.abs(trace["pressure_bar"].to_numpy() - exact).max() <= bound * (1.0 + 1e-9)


def test_volts(write: Write) -> None:
    path = write([CLOSED, (BAR + 7.5) / 25.0], "angle,U [V]")
    np.testing.assert_allclose(
        read_pressure(path, gain_bar_per_v=25.0, offset_bar=-7.5)["pressure_bar"], BAR, rtol=1e-13, atol=1e-13
    )
    relative = read_pressure(path, gain_bar_per_v=25.0)
    np.testing.assert_allclose(relative["pressure_bar"], BAR + 7.5, rtol=1e-14)
    assert relative.attrs["warnings"] == "no offset_bar: the pressure is relative, peg it"
    milli = write([CLOSED, 40.0 * (BAR + 7.5)], "angle,U [mV]")
    np.testing.assert_allclose(
        read_pressure(milli, gain_bar_per_v=25.0, offset_bar=-7.5)["pressure_bar"], BAR, atol=1e-12
    )
    with pytest.raises(DataError, match="is for volts, and the pressure is given in bar: give one"):
        read_pressure(path, gain_bar_per_v=25.0, pressure_unit="bar")
    with pytest.raises(DataError, match="is given in kPa"):
        read_pressure(write([CLOSED, BAR], "angle,p_kPa"), gain_bar_per_v=25.0)
    with pytest.raises(DataError, match="offset_bar acts on volts only"):
        read_pressure(path, offset_bar=1.0)
    with pytest.raises(DataError, match="gain_bar_per_v = 0: must be a finite number, not 0"):
        read_pressure(path, gain_bar_per_v=0.0)


# 1 psi = 6894.757 Pa: NIST SP 811, Guide for the Use of the SI, appendix B.8.
PER_BAR = {"bar": 1.0, "mbar": 1e3, "kPa": 1e2, "Pa": 1e5, "MPa": 0.1, "psi": 1e5 / 6894.757}


@pytest.mark.parametrize("unit", PER_BAR)
@pytest.mark.parametrize(
    "header", ["angle,p [{}]", "angle,Pressure_{}", "angle,Cyl_1 ({})", "angle,p\ndeg,{}", "angle,p"]
)
def test_units_of_the_header(write: Write, unit: str, header: str) -> None:
    path = write([CLOSED, BAR * PER_BAR[unit]], header.format(unit))
    said = {"pressure_unit": unit} if "{}" not in header else {}
    np.testing.assert_allclose(read_pressure(path, **said)["pressure_bar"], BAR, rtol=1e-7)
    other = "psi" if unit == "bar" else "bar"
    if not said:
        with pytest.raises(DataError, match=f"says '{unit}' .* pass pressure_unit='{unit}' instead of '{other}'"):
            read_pressure(path, pressure_unit=other)
    elif unit != "MPa" and unit != "bar":
        with pytest.raises(DataError, match=f"looks like .*{unit}.*; pass .*pressure_unit='{unit}'"):
            read_pressure(path)


# 1 kgf = 9.80665 N, 1 atm = 760 torr = 101325 Pa: NIST SP 811, appendix B.8.
@pytest.mark.parametrize(
    ("said", "per_bar"),
    [("kgf/cm2", 1e5 / 98066.5), ("kg/cm²", 1e5 / 98066.5), ("atm", 1e5 / 101325.0), ("mmHg", 760e5 / 101325.0),
     ("N/mm2", 0.1), ("kN/m²", 100.0), ("lbf/in2", 1e5 / 6894.757)],
)  # fmt: skip
@pytest.mark.parametrize(
    "header", ["angle,p [{}]", "angle,Pressure_{}", "angle,p {}", "angle,Cyl_1 ({})", "angle,p\ndeg,{}"]
)
def test_units_of_other_houses(write: Write, said: str, per_bar: float, header: str) -> None:
    path = write([CLOSED, BAR * per_bar], header.format(said))
    np.testing.assert_allclose(read_pressure(path)["pressure_bar"], BAR, rtol=1e-7)


def test_a_remark_is_no_unit_and_what_may_be_one_is_settled_by_the_user(write: Write) -> None:
    for remark in ("p (cyl 1)", "p (filtered)", "pressure (mean)", "p (12)"):
        np.testing.assert_allclose(read_pressure(write([CLOSED, BAR], f"angle,{remark}"))["pressure_bar"], BAR)
    path = write([CLOSED, BAR * 100.0], "angle,p (AVL 12)")
    with pytest.raises(DataError, match="'AVL 12' in the header may be a unit"):
        read_pressure(path)
    np.testing.assert_allclose(read_pressure(path, pressure_unit="kPa")["pressure_bar"], BAR, rtol=1e-12)


def test_psi_without_a_unit_is_told_every_unit_that_fits(write: Write) -> None:
    psi = write([FULL, ONE * PER_BAR["psi"]])  # 2661 psi over 29 psi: as kPa 26.6 bar over 0.29, a throttled engine
    with pytest.raises(DataError, match=r"this looks like kPa or psi; pass pressure_unit='kPa' or pressure_unit='psi'"):
        read_pressure(psi)
    psi = write([FULL, 0.6 * ONE * PER_BAR["psi"]])  # as kPa 0.174 bar at intake BDC: no engine runs so
    with pytest.raises(DataError, match=r"this looks like psi; pass pressure_unit='psi'$"):
        read_pressure(psi)


def test_a_level_that_no_intake_has_is_doubted_by_unit(write: Write) -> None:
    closed = read_pressure(write([CLOSED, 0.1 * BAR]))
    assert closed.attrs["warnings"] == (
        "the pressure at -143 °CA aTDC is 0.232 bar, an intake pressure of 0.25 to 6 bar is usual; "
        "pressure_unit='MPa' would make it 2.32 bar"
    )
    whole = read_pressure(write([FULL, 0.1 * ONE]))
    assert "the pressure at -180 °CA aTDC is 0.2 bar" in whole.attrs["warnings"]
    assert "'MPa' would make it 2 bar" in whole.attrs["warnings"]
    assert read_pressure(write([FULL, 0.1 * ONE]), pressure_unit="MPa").attrs["warnings"] == ""
    low = write([FULL, 0.15 * ONE * PER_BAR["psi"]])  # 399 psi, read as bar: only the level of 4.4 "bar" looks usual
    assert read_pressure(low).attrs["warnings"] == ""
    low = write([FULL, 0.15 * 2.0 * ONE.clip(4.0) * PER_BAR["psi"] * 0.6])
    assert "'psi' would make it 0.72 bar" in read_pressure(low).attrs["warnings"]
    assert read_pressure(write([FULL, ONE - 3.0])).attrs["warnings"] == ""  # relative: no level to judge


@pytest.mark.parametrize(
    ("name", "row", "unit", "quantity"),
    [
        ("p [MPa]", None, "MPa", "pressure"),
        ("pressure_psi", None, "psi", "pressure"),
        ("Cyl_1 (kPa)", None, "kPa", "pressure"),
        ("pressure_bar_12", None, "bar", "pressure"),
        ("p_A", None, None, "pressure"),
        ("p_V", None, "V", "pressure"),
        ("time_ms", None, "ms", "time"),
        ("Zeit", "s", "s", "time"),
        ("crank_angle_cad", None, "deg", "angle"),
        ("Kurbelwinkel", "°KW", "deg", "angle"),
        ("phi_rad", None, "rad", "angle"),
        ("volume_l", None, None, "other"),
        ("Torque", "Nm", None, "other"),
        ("p_intake_kPa", None, "kPa", "other"),
        ("sample", "-", None, "counter"),
        ("x", None, None, None),
        ("run.v_1", "Nm", None, "other"),
        ("p_bar.1", None, "bar", "pressure"),
    ],
)
def test_what_a_heading_says(name: str, row: str | None, unit: str | None, quantity: str | None) -> None:
    said = heading(name, row)
    assert (said.unit, said.quantity) == (unit, quantity)


def test_gauge_pressure_is_read_and_told(write: Write) -> None:
    trace = read_pressure(write([CLOSED, BAR - 1.0], "angle,p_barg"))
    np.testing.assert_array_equal(trace["pressure_bar"], BAR - 1.0)
    assert trace.attrs["warnings"] == "the file says gauge pressure, 1 atmosphere below the absolute one: peg it"
    psi = read_pressure(write([CLOSED, (BAR - 1.0) * PER_BAR["psi"]], "angle,p\ndeg,psig"))
    np.testing.assert_allclose(psi["pressure_bar"], BAR - 1.0, rtol=1e-7)
    assert "gauge" in psi.attrs["warnings"]
    assert read_pressure(write([CLOSED, BAR], "angle,p [bar abs]")).attrs["warnings"] == ""


def test_header_and_units_row_that_differ(write: Write) -> None:
    with pytest.raises(DataError, match="column 'p_bar': the header says bar and the units row 'kPa'"):
        read_pressure(write([CLOSED, BAR], "angle,p_bar\ndeg,kPa"))


def test_radians_by_header(write: Write) -> None:
    path = write([np.deg2rad(CLOSED), BAR], "angle_rad,p")
    np.testing.assert_allclose(read_pressure(path)[ANGLE], CLOSED, atol=1e-12)
    with pytest.raises(DataError, match="is in rad as the file says"):
        read_pressure(path, angle_unit="deg")
    with pytest.raises(DataError, match="looks like degrees"):
        read_pressure(write([CLOSED, BAR], "angle [rad],p"))
    several = write([np.deg2rad(RUN), CYCLES.ravel()], "angle_rad,p")
    np.testing.assert_array_equal(read_pressure(several, firing_tdc_deg=360.0)["pressure_bar"], CYCLES)


def test_the_bad_cell_of_many_is_named(write: Write) -> None:
    path = write([FULL, *CYCLES], "angle," + ",".join(f"p{k}" for k in range(5)))
    lines = path.read_text().split("\n")
    cells = lines[700].split(",")
    cells[3] = "1.2.3"
    lines[700] = ",".join(cells)
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match=r"bench.csv, line 701, column 'p2': '1.2.3' is not a number"):
        read_pressure(path)
    np.testing.assert_array_equal(read_pressure(path, pressure_column=["p1", "p3"])["pressure_bar"], CYCLES[[1, 3]])


@settings(max_examples=20)
@given(st.integers(2, 6), st.floats(0.1, 1.2), st.integers(0, 2**32 - 1))
def test_many_cycles_are_written_and_read_bit_by_bit(
    tmp_path_factory: pytest.TempPathFactory, count: int, step: float, seed: int
) -> None:
    angle = -40.0 + step * np.arange(200)
    noise = np.random.default_rng(seed).normal(0.0, 0.5, (count, angle.size))
    trace = pressure_trace(angle, 60.0 - 0.02 * angle**2 + noise, name="cycles.csv")
    path = tmp_path_factory.mktemp("cycles") / "cycles.csv"
    write_csv(trace, path)
    assert read_pressure(path).identical(trace)
    write_csv(trace.transpose(), path)
    assert read_pressure(path).identical(trace)


def test_arrays_of_cycles() -> None:
    trace = pressure_trace(FULL, CYCLES)
    assert pressure_trace(FULL, list(CYCLES)).identical(trace)
    assert pressure_trace(np.tile(FULL, 5), CYCLES.ravel()).identical(trace)
    assert pressure_trace(RUN, CYCLES.ravel(), firing_tdc_deg=360.0).identical(trace)
    assert pressure_trace(FULL, CYCLES[:1])["pressure_bar"].dims == (ANGLE,)
    with pytest.raises(ShapeError, match="one row per cycle is needed: pass the transpose"):
        pressure_trace(FULL, CYCLES.T)
    assert pressure_trace(FULL, CYCLES[0]).attrs["warnings"] == ""


def test_the_definition_of_psi() -> None:
    # One pound-force per square inch: the weight of 0.45359237 kg at 9.80665 m/s² on (0.0254 m)².
    assert float(to_bar(np.array([1.0]), "psi")[0]) == pytest.approx(0.45359237 * 9.80665 / 0.0254**2 / 1e5, rel=1e-15)
