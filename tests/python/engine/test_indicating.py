"""Figures of records: the stream equals the record, scatter by NumPy, misfires named, agreement with `analyze`."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mgdd.engine import Indicating, analyze, simulate
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.io import pressure_trace
from mgdd.results.labels import check_labels

ANGLE = np.arange(3600) * 0.2 - 360.0
SPEED_RPM = 1400.0


def record(n: int = 40, *, seed: int = 3, share: np.ndarray | None = None) -> np.ndarray:
    """Whole cycles of a small diesel: closed part from the model, 1.3 bar before and 1.7 bar behind it; some noise."""
    rng = np.random.default_rng(seed)
    fuel = 18.0 * (np.ones(n) if share is None else share) * rng.normal(1.0, 0.03, n)
    out = np.empty((n, ANGLE.size))
    for row, mg in zip(out, fuel, strict=True):
        run = simulate("puma_single", {"fuel_mg": mg, "speed_rpm": SPEED_RPM}, soc_cad=-5.0, step_cad=0.5)
        row[:] = np.interp(ANGLE, run["crank_angle_cad"], run["pressure_bar"], left=1.3, right=1.7)
    return out + rng.normal(0.0, 0.01, out.shape)


def indicating(**options: object) -> Indicating:
    return Indicating("puma_single", ANGLE, speed_rpm=SPEED_RPM, **options)


def test_a_stream_gives_what_the_record_gives():
    pressure = record(9)
    tool = indicating(pegging="two_point")
    for threads in (1, 4):
        made = tool.record(pressure, threads=threads)
        check_labels(made)
        for c, row in enumerate(pressure):
            alone = tool.cycle(row)
            assert {name: float(made[name][c]) for name in alone} == pytest.approx(alone, rel=0.0, abs=0.0, nan_ok=True)


def test_cylinders_are_rows_of_their_own():
    pressure = np.stack([record(6), record(6, seed=4) * 1.1])
    both = indicating().record(pressure)
    assert both["imep_net_bar"].dims == ("cylinder", "cycle")
    assert both["mean_imep_net_bar"].dims == ("cylinder",)
    for c in (0, 1):
        one = indicating().record(pressure[c])
        np.testing.assert_array_equal(both["ca50_cad"][c], one["ca50_cad"])
        assert float(both["cov_imep_gross_bar_percent"][c]) == float(one["cov_imep_gross_bar_percent"])


def test_work_is_the_integral_that_numpy_takes():
    pressure = record(5)
    made = indicating().record(pressure)
    cylinder = analyze(pressure_trace(ANGLE, pressure[0]), "puma_single", quiet=True)
    closed = cylinder["crank_angle_cad"].to_numpy()
    inside = (closed[0] - 1e-9 <= ANGLE) & (closed[-1] + 1e-9 >= ANGLE)
    work_j = np.trapezoid(pressure[:, inside] * 1e5, cylinder["volume_l"].to_numpy() * 1e-3, axis=1)
    swept = float(cylinder["work_closed_j"] / cylinder["imep_closed_bar"])
    np.testing.assert_allclose(made["imep_closed_bar"], work_j / swept, rtol=1e-10)
    np.testing.assert_allclose(made["pmep_bar"], made["imep_net_bar"] - made["imep_gross_bar"], atol=1e-12)
    assert np.all(np.abs(made["pmep_bar"] - (1.3 - 1.7)) < 0.05)  # the valves do not open at dead centre


def test_scatter_is_that_of_numpy_and_skips_what_is_not_there():
    pressure = record(30, share=np.where(np.arange(30) == 7, 0.0, 1.0))
    made = indicating().record(pressure)
    values = made["ca50_cad"].to_numpy()
    assert np.isnan(values[7])
    assert np.isfinite(np.delete(values, 7)).all()
    rest = np.delete(values, 7)
    assert float(made["mean_ca50_cad"]) == pytest.approx(rest.mean())
    assert float(made["std_ca50_cad"]) == pytest.approx(rest.std(ddof=1))
    assert float(made["p5_ca50_cad"]) == pytest.approx(np.percentile(rest, 5))
    assert float(made["p95_ca50_cad"]) == pytest.approx(np.percentile(rest, 95))
    imep = made["imep_net_bar"].to_numpy()
    assert float(made["cov_imep_net_bar_percent"]) == pytest.approx(100 * imep.std(ddof=1) / imep.mean())
    assert float(made["lnv_imep_net_percent"]) == pytest.approx(100 * imep.min() / imep.mean())
    assert "cov_ca50_cad_percent" not in made
    assert "cov_pegging_bar_percent" not in made


def test_misfires_and_partial_burns_are_named():
    share = np.ones(40)
    share[[4, 21]], share[13] = 0.0, 0.55
    trace = pressure_trace(ANGLE, record(share=share), name="bench 3").assign_attrs(speed_rpm=SPEED_RPM)
    for traces in (True, False):
        made = analyze(trace, "puma_single", keep_traces=traces, quiet=True)
        assert made["cycle"][made["misfire"].to_numpy()].values.tolist() == [5, 22]
        assert made["cycle"][made["partial_burn"].to_numpy()].values.tolist() == [14]
        assert "2 of 40 cycles do not burn: cycle 5, 22" in made.attrs["warnings"]
        assert "1 of 40 cycles burn less than four fifths of the median heat: cycle 14" in made.attrs["warnings"]
        assert int(made.attrs["motored"]) == 2


def test_motored_records_have_no_misfires():
    made = indicating().record(record(8, share=np.zeros(8)))
    assert not made["misfire"].any()
    assert np.isnan(made["ca50_cad"]).all()


def test_without_traces_the_figures_are_the_same() -> None:
    trace = pressure_trace(ANGLE, record(25), name="bench 3").assign_attrs(speed_rpm=SPEED_RPM)
    whole = analyze(trace, "puma_single", quiet=True)
    short = analyze(trace, "puma_single", keep_traces=False, quiet=True)
    check_labels(short)
    assert "crank_angle_cad" not in short.variables
    assert short.attrs == whole.attrs
    xr.testing.assert_identical(short, whole[list(short.data_vars)].drop_vars("crank_angle_cad", errors="ignore"))


def test_in_one_window_without_smoothing_the_analysis_finds_the_same() -> None:
    pressure = record(12)
    trace = pressure_trace(ANGLE, pressure).assign_attrs(speed_rpm=SPEED_RPM)
    whole = analyze(
        trace, "puma_single", keep_traces=False, quiet=True, heat_window_cad=(-12.0, 70.0), smoothing="none"
    )
    made = indicating(heat_window_cad=(-12.0, 70.0)).record(pressure)
    for name in ("imep_net_bar", "imep_gross_bar", "p_max_bar", "dp_max_bar_per_cad", "mapo_bar", "n_compression"):
        np.testing.assert_array_equal(made[name], whole[name])
    for name in ("ca10_cad", "ca50_cad", "ca90_cad", "heat_net_j"):
        np.testing.assert_allclose(made[name], whole[name], rtol=1e-9, atol=1e-9)


def test_a_ringing_of_6500_hertz_stands_in_its_band():
    pressure = record(3)
    tone = 1.8 * np.sin(2.0 * np.pi * 6500.0 / (6.0 * SPEED_RPM) * ANGLE)
    quiet, loud = indicating().record(pressure), indicating().record(pressure + tone)
    assert np.all(loud["mapo_bar"] > 1.8 * 0.98)
    assert np.all(quiet["mapo_bar"] < 0.3)
    sound = indicating().oscillation(pressure + tone)
    check_labels(sound)
    spectrum = np.abs(np.fft.rfft(sound["oscillation_bar"].to_numpy(), 8192)).sum(axis=0)
    at_hz = np.fft.rfftfreq(8192, 0.2 / (6.0 * SPEED_RPM))[spectrum.argmax()]
    assert at_hz == pytest.approx(6500.0, rel=0.01)
    none = indicating(knock_band_hz=(8000.0, 20000.0)).record(pressure + tone)
    assert np.all(none["mapo_bar"] < 0.3)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"speed_rpm": 0.0}, None, ""),
        ({"speed_rpm": -1.0}, ParameterError, "speed_rpm"),
        ({"knock_band_hz": (4000.0, 5000.0)}, ParameterError, "knock_high_hz"),
        ({"knock_window_cad": (50.0, 10.0)}, ParameterError, "knock_from_cad"),
        ({"pegging": "inlet"}, ParameterError, "inlet_pressure_kpa"),
    ],
)
def test_options_are_checked(change: dict[str, object], error: type[Exception] | None, words: str):
    options = {"speed_rpm": SPEED_RPM, **change}
    if error is None:
        made = Indicating("puma_single", ANGLE, **options).cycle(record(1)[0])
        assert np.isnan(made["mapo_bar"])  # no speed, no band
        return
    with pytest.raises(error, match=words):
        Indicating("puma_single", ANGLE, **options)


def test_bad_cycles_are_refused_by_name():
    pressure = record(4)
    pressure[2, 1700] = np.nan
    with pytest.raises(DataError, match=r"cycle 3: pressure_bar\[1700\]"):
        indicating().record(pressure)
    with pytest.raises(DataError, match=r"pressure_bar\[1700\]"):
        indicating().cycle(pressure[2])
    for shape in ((3600,), (2, 3599), (0, 3600), (1, 1, 1, 3600)):
        with pytest.raises(ShapeError):
            indicating().record(np.full(shape, 2.0))
    with pytest.raises(ShapeError, match="one cycle"):
        indicating().cycle(pressure[:2])
    with pytest.raises(ParameterError, match="traces"):
        analyze(pressure_trace(ANGLE, pressure[0]), "puma_single", keep_traces=False)
