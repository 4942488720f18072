"""Records over time beside an encoder: cut into the cycles that the engine made, or refused by what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from independent_engine import draw, record
from mgdd.cli import main
from mgdd.engine import Indicating
from mgdd.errors import DataError, ParameterError
from mgdd.io import Encoder, read, read_pressure

CYCLES, RATE_HZ, TDC_DEG = 7, 60e3, 114.0
FIRING_DEG = TDC_DEG + 360.0  # in the second turn behind the first mark
WHEEL = Encoder(column="crank", teeth=60, missing_teeth=2)


@pytest.fixture(scope="module")
def engine():
    random = np.random.default_rng(5)
    drawn = draw(random)
    whole = record(random, drawn, CYCLES, step=0.25, noise_bar=0.015)
    return drawn, whole.angle, whole.bar


@pytest.fixture(scope="module")
def bench(engine):
    """Give time, angle behind a mark and channels; the speed swings in each turn and rises by 2 %."""
    drawn, _, bar = engine
    length = CYCLES * 720.0 / (6.0 * drawn.speed) / 1.01
    time = np.arange(0.0, length, 1.0 / RATE_HZ)
    mean = 6.0 * drawn.speed * time * (1.0 + 0.01 * time / length)
    turned = mean + 0.8 * np.sin(np.deg2rad(2.0 * mean - 50.0))
    behind = turned + 40.0  # the record starts 40 degrees behind a mark
    pressure = np.interp((behind - FIRING_DEG + 360.0) % (720.0 * CYCLES), 0.25 * np.arange(bar.size), bar.ravel())
    place = (behind % 360.0) / 6.0
    crank = np.where((place < 58.0) & (place % 1.0 < 0.5), 4.8, 0.2)
    index = np.where(np.abs(behind % 360.0 - 1.5) < 1.4, 5.0, 0.0)
    return pd.DataFrame({"time [s]": time, "crank": crank, "pcyl [bar]": pressure, "index": index, "behind": behind})


def saved(frame: pd.DataFrame, folder: Path, *columns: str) -> Path:
    path = folder / "bench.parquet"
    frame[[*columns] or list(frame)].to_parquet(path)
    return path


def true_cycles(bench: pd.DataFrame, trace) -> np.ndarray:
    """Give the pressure that the engine had at the angles of a trace."""
    angle, first = trace["crank_angle_cad"].to_numpy(), float(bench["behind"][0]) - FIRING_DEG
    start = np.ceil((first - angle[0]) / 720.0)
    at = 720.0 * (start + np.arange(trace.sizes["cycle"]))[:, None] + angle
    return np.interp(at, bench["behind"] - FIRING_DEG, bench["pcyl [bar]"])


def test_a_wheel_with_a_gap_gives_the_cycles_of_the_engine(bench, engine, tmp_path: Path) -> None:
    trace = read_pressure(
        saved(bench, tmp_path, "time [s]", "crank", "pcyl [bar]"), encoder=WHEEL, firing_tdc_deg=TDC_DEG
    )
    off = np.abs(trace["pressure_bar"].to_numpy() - true_cycles(bench, trace))
    assert trace.sizes["cycle"] >= CYCLES - 2
    assert off.max() < 0.02 * float(trace["pressure_bar"].max())
    assert trace.attrs["speed_rpm"] == pytest.approx(engine[0].speed, rel=0.015)
    assert np.allclose(np.diff(trace["crank_angle_cad"]), trace["crank_angle_cad"][1] - trace["crank_angle_cad"][0])


@pytest.mark.parametrize("encoder", [
    Encoder(column="crank", teeth=60, missing_teeth=2, falling=True),
    Encoder(column=1, teeth=60, missing_teeth=2, level=1.0),
    Encoder(column="even", teeth=180, index_column="index"),
])  # fmt: skip
def test_other_edges_and_marks_give_the_same_figures(bench, engine, tmp_path: Path, encoder: Encoder) -> None:
    frame = bench.assign(even=np.where(bench["behind"] % 2.0 < 1.0, 3.0, -3.0))
    path = saved(frame, tmp_path, "time [s]", "crank", "pcyl [bar]", "index", "even")
    # The falling edge is half a tooth behind the rising one, the index pulse begins 0.1 behind TDC's zero.
    zero = {"crank": 3.0, 1: 0.0, "even": 0.1}[encoder.column or 0]
    trace = read_pressure(path, pressure_column="pcyl [bar]", encoder=encoder, firing_tdc_deg=TDC_DEG - zero)
    drawn, _, _ = engine
    cylinder, speed = drawn.cylinder(), trace.attrs["speed_rpm"]
    angle = trace["crank_angle_cad"].to_numpy()
    found = Indicating(cylinder, angle, speed_rpm=speed).record(trace["pressure_bar"])
    wanted = Indicating(cylinder, angle, speed_rpm=speed).record(true_cycles(bench, trace))
    for name, most in (("imep_net_bar", 0.05), ("ca50_cad", 0.05), ("p_max_bar", 0.1)):
        assert np.abs(found[name] - wanted[name]).max() < most, name


def test_read_cuts_every_channel_and_keeps_the_encoder_out(bench, tmp_path: Path) -> None:
    turned = np.interp(bench["behind"] - 360.0, bench["behind"], bench["pcyl [bar]"])
    frame = bench.assign(**{"pcyl4 [bar]": turned, "torque [Nm]": 50.0 + 0.01 * bench["behind"]})
    frame = frame.rename(columns={"pcyl [bar]": "pcyl1 [bar]"})
    path = saved(frame, tmp_path, "time [s]", "crank", "pcyl1 [bar]", "pcyl4 [bar]", "torque [Nm]")
    made = read(path, encoder=WHEEL, firing_tdc_deg=TDC_DEG, angle_step_deg=0.5)
    assert set(made.data_vars) == {"pressure_1_bar", "pressure_4_bar", "torque"}
    assert float(made["crank_angle_cad"][1] - made["crank_angle_cad"][0]) == 0.5
    peaks = {
        name: made["crank_angle_cad"][int(np.argmax(made[name].mean("cycle").to_numpy()))].item()
        for name in made
        if name != "torque"
    }
    assert abs(peaks["pressure_1_bar"]) < 15.0
    assert abs(abs(peaks["pressure_4_bar"]) - 360.0) < 15.0
    assert float(made["torque"].diff("cycle").mean()) == pytest.approx(7.2, rel=1e-3)


def test_a_miscounted_turn_costs_its_cycle_only(bench, tmp_path: Path) -> None:
    place = (bench["behind"] % 5.0) / 5.0
    bad = bench["behind"].between(FIRING_DEG + 730.0, FIRING_DEG + 850.0)
    frame = bench.assign(crank=bench["crank"].mask(bad, np.where(place < 0.5, 4.8, 0.2)))
    whole = read_pressure(
        saved(bench, tmp_path, "time [s]", "crank", "pcyl [bar]"), encoder=WHEEL, firing_tdc_deg=TDC_DEG
    )
    less = read_pressure(
        saved(frame, tmp_path, "time [s]", "crank", "pcyl [bar]"), encoder=WHEEL, firing_tdc_deg=TDC_DEG
    )
    assert "cycle 2 of 6 left out: the encoder's edges are miscounted" in less.attrs["warnings"]
    kept = whole["pressure_bar"].to_numpy()[[0, 2, 3, 4, 5]]
    assert np.abs(less["pressure_bar"].to_numpy() - kept).max() < 0.01 * kept.max()


@pytest.mark.parametrize(("edge", "late_deg"), [(1224.0, 0.9), (1224.0, 1.8), (1224.0, -1.8)])
def test_a_displaced_edge_costs_its_cycle_only(bench, tmp_path: Path, edge: float, late_deg: float) -> None:
    """A dropout begins before an edge and ends behind it, or a spike ends in it: no edge is missing, one is wrong."""
    low, high = sorted((edge, edge + late_deg))
    frame = bench.assign(crank=bench["crank"].mask(bench["behind"].between(low, high), 0.2 if late_deg > 0.0 else 4.8))
    columns = ("time [s]", "crank", "pcyl [bar]")
    whole = read_pressure(saved(bench, tmp_path, *columns), encoder=WHEEL, firing_tdc_deg=TDC_DEG)
    less = read_pressure(saved(frame, tmp_path, *columns), encoder=WHEEL, firing_tdc_deg=TDC_DEG)
    assert "cycle 2 of 6 left out: the encoder's edges are miscounted or displaced" in less.attrs["warnings"]
    kept = whole["pressure_bar"].to_numpy()[[0, 2, 3, 4, 5]]
    assert np.abs(less["pressure_bar"].to_numpy() - kept).max() < 0.01 * kept.max()


def test_a_displaced_edge_in_the_compression_of_a_short_record_says_nothing_of_its_period(
    bench, tmp_path: Path
) -> None:
    frame = bench[bench["behind"] < 2300.0]
    frame = frame.assign(crank=frame["crank"].mask(frame["behind"].between(1872.0, 1874.4), 0.2))
    path = saved(frame, tmp_path, "time [s]", "crank", "pcyl [bar]")
    trace = read_pressure(path, encoder=WHEEL, firing_tdc_deg=TDC_DEG)
    assert "cycle 3 of 3 left out: the encoder's edges" in trace.attrs["warnings"]


def test_a_bent_tooth_costs_no_cycle(bench, tmp_path: Path) -> None:
    bent = (bench["behind"] % 360.0).between(144.0, 144.9)
    frame = bench.assign(crank=bench["crank"].mask(bent, 0.2))
    path = saved(frame, tmp_path, "time [s]", "crank", "pcyl [bar]")
    assert read_pressure(path, encoder=WHEEL, firing_tdc_deg=TDC_DEG).sizes["cycle"] == 6


def test_lost_and_extra_edges_are_counted_aloud(bench, tmp_path: Path) -> None:
    behind = bench["behind"]
    lost, spike = behind.between(1500.0 - 0.1, 1504.0), behind.between(2002.2, 2002.6)
    frame = bench.assign(crank=bench["crank"].mask(lost, 0.2).mask(spike, 4.8))
    trace = read_pressure(
        saved(frame, tmp_path, "time [s]", "crank", "pcyl [bar]"), encoder=WHEEL, firing_tdc_deg=TDC_DEG
    )
    assert "1 edge missing" in trace.attrs["warnings"]
    assert "1 edge too many" in trace.attrs["warnings"]
    assert np.abs(trace["pressure_bar"].to_numpy() - true_cycles(frame, trace)).max() < 2.0


@pytest.mark.parametrize(("options", "said"), [
    ({"encoder": WHEEL}, "firing_tdc_deg= with the angle of TDC behind the mark"),
    ({"encoder": WHEEL, "firing_tdc_deg": TDC_DEG + 60.0}, "is not TDC: the pressure peaks 1"),
    ({"encoder": WHEEL, "firing_tdc_deg": TDC_DEG - 60.0}, "behind a mark, and TDC is near that"),
    ({"encoder": WHEEL, "firing_tdc_deg": 800.0}, "firing_tdc_deg = 800"),
    ({"encoder": WHEEL, "firing_tdc_deg": TDC_DEG, "speed_rpm": 900.0}, "speed_rpm and encoder are two ways"),
    ({"encoder": WHEEL, "firing_tdc_deg": TDC_DEG, "before_tdc": True}, "before_tdc and encoder are two ways"),
    ({"encoder": Encoder(teeth=60), "firing_tdc_deg": TDC_DEG}, "encoder names no column"),
    ({"encoder": Encoder(column="cam"), "firing_tdc_deg": TDC_DEG}, "no column 'cam'"),
    ({"encoder": Encoder(column="crank", teeth=36, missing_teeth=1), "firing_tdc_deg": TDC_DEG},
     "column 'crank': the signal is not one of a wheel of 36-1 teeth: every 60 pitches 2 teeth are missing"),
    ({"encoder": Encoder(column="pcyl [bar]", teeth=60), "firing_tdc_deg": TDC_DEG}, "column 'pcyl [bar]': the signal"),
])  # fmt: skip
def test_what_is_wrong_is_said(bench, tmp_path: Path, options, said: str) -> None:
    path = saved(bench, tmp_path, "time [s]", "crank", "pcyl [bar]")
    with pytest.raises(DataError) as caught:
        read_pressure(path, **options)
    assert said in str(caught.value)


def test_a_short_record_and_a_hole_are_named(bench, tmp_path: Path) -> None:
    short = bench[bench["behind"].between(300.0, 900.0)]
    with pytest.raises(DataError, match=r"the encoder covers [56]\d\d\.?\d* degrees: a cycle of 720 is needed"):
        read_pressure(saved(short, tmp_path, "time [s]", "crank", "pcyl [bar]"), encoder=WHEEL, firing_tdc_deg=TDC_DEG)
    holed = bench.copy()
    holed.loc[777, "pcyl [bar]"] = np.nan
    with pytest.raises(DataError, match=r"777"):
        read_pressure(saved(holed, tmp_path, "time [s]", "crank", "pcyl [bar]"), encoder=WHEEL, firing_tdc_deg=TDC_DEG)


def test_arrays_give_the_angle_of_each_sample_and_the_speed_of_each_turn(bench) -> None:
    found = Encoder(teeth=60, missing_teeth=2).angle(bench["time [s]"], bench["crank"])
    off = found["crank_angle_deg"] + 360.0 - bench["behind"].to_numpy()
    assert float(abs(off).max()) < 0.08  # a sample is 0.08 degrees
    assert int(np.isfinite(off).sum()) > 0.98 * off.size
    turns = np.interp(found["mark_s"], bench["time [s]"], bench["behind"])
    assert np.allclose(turns % 360.0 - 360.0 * (turns % 360.0 > 180.0), 0.0, atol=0.08)
    with pytest.raises(ParameterError, match=r"level = 9: must lie between low and high of signal, 0.2 and 4.8"):
        Encoder(teeth=60, missing_teeth=2, level=9.0).angle(bench["time [s]"], bench["crank"])
    with pytest.raises(ParameterError, match=r"teeth = -1: must be in \[2, 36000\]"):
        Encoder(teeth=-1).angle(bench["time [s]"], bench["crank"])


@pytest.fixture
def even_wheel():
    """Give time, 60 teeth at 1500 rpm, an index, and the same with one pulse that bounces within its pitch."""
    time = np.arange(40000) * 1e-5
    pitches = 1500.0 * time
    part, tooth, turn = pitches % 1.0, np.floor(pitches) % 60, np.floor(pitches / 60.0)
    index = (tooth == 10) & (part > 0.2) & (part < 0.6)
    bounces = index & ~((turn == 4) & (part >= 0.32) & (part <= 0.4))
    return time, 5.0 * (part < 0.5), 5.0 * index, 5.0 * bounces


def test_index_that_bounces_has_one_mark(even_wheel) -> None:
    time, signal, index, bounces = even_wheel
    clean, twice = (Encoder(teeth=60).angle(time, signal, each) for each in (index, bounces))
    assert int(clean["lost_marks"]) == int(twice["lost_marks"]) == 0
    off = twice["crank_angle_deg"] - clean["crank_angle_deg"]
    assert float(abs(off).max()) < 2.0  # within a pitch of 6 degrees, however the pulse is taken


@pytest.mark.parametrize("jump_s", [10.0, 1e9, 1e300])
@pytest.mark.parametrize("jumps", [1, 3])
def test_clock_that_jumps_is_refused(even_wheel, jump_s: float, jumps: int) -> None:
    time, signal, _, _ = even_wheel
    later = time.copy()
    for k in range(jumps):
        later[20000 + 6000 * k :] += jump_s * (1.0 + k * 0.01)
    with pytest.raises(DataError, match=r"clock has jumped|edges are lost|times must increase"):
        Encoder(teeth=60).angle(later, signal)


def test_the_command_line_reads_an_encoder(bench, tmp_path: Path, capsys) -> None:
    path = saved(bench, tmp_path, "time [s]", "crank", "pcyl [bar]")
    wheel = ["--encoder", "crank", "--encoder-teeth", "60", "--encoder-missing-teeth", "2"]
    assert main(["data", "info", str(path), *wheel, "--firing-tdc-deg", "114", "--json"]) == 0
    assert '"cycle": 6' in capsys.readouterr().out
    assert main(["engine", "analyze", str(path), *wheel, "--firing-tdc-deg", "114", "--json"]) == 0
    assert '"imep_net_bar"' in capsys.readouterr().out
    assert main(["engine", "analyze", str(path), *wheel[2:], "--json"]) == 2
    assert "--encoder-teeth acts with --encoder COLUMN only" in capsys.readouterr().out
