"""Analysis of a record of cycles: every cycle as alone, the scatter of the figures, the averaged cycle."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from mgdd.engine import Cylinder, OperatingPoint, analyze, simulate
from mgdd.errors import DataError
from mgdd.io import pressure_trace
from mgdd.results.labels import check_labels

CYLINDER, POINT = Cylinder(), OperatingPoint(ivc_temperature_k=337.0)
SOC = np.array([-9.0, -7.0, -6.0, -6.0, -5.0, 1.0])  # skewed: mean and middle differ


def record(noise_bar=0.0, seed=0):
    """Cycles whose start of combustion scatters, as `mgdd.io.read_pressure` gives a file of several."""
    cycles = [simulate(CYLINDER, POINT, soc_cad=float(soc), step_cad=0.5) for soc in SOC]
    noise = noise_bar * np.random.default_rng(seed).standard_normal((len(SOC), cycles[0].sizes["crank_angle_cad"]))
    pressure = np.stack([cycle.pressure_bar.values for cycle in cycles]) + noise
    return xr.Dataset(
        {"pressure_bar": (("cycle", "crank_angle_cad"), pressure)},
        coords={"cycle": np.arange(1, len(SOC) + 1), "crank_angle_cad": cycles[0].crank_angle_cad.values},
        attrs={"file": "record.csv"},
    )


def test_every_cycle_is_analysed_as_alone():
    trace = record(0.05)
    many = analyze(trace, CYLINDER, point=POINT)
    check_labels(many)
    assert many.pressure_bar.dims == ("cycle", "crank_angle_cad")
    assert many.attrs["cycles"] == 6
    assert many.attrs["heat_window"] == "found"
    angle = trace.crank_angle_cad.values
    for cycle in (1, 4, 6):
        alone = analyze(pressure_trace(angle, trace.pressure_bar.sel(cycle=cycle).values), CYLINDER, point=POINT)
        one = many.sel(cycle=cycle)
        for name in ("ca50_cad", "imep_closed_bar", "heat_net_j", "n_compression", "dp_max_bar_per_cad"):
            assert float(one[name]) == float(alone[name]), name
        np.testing.assert_array_equal(one.heat_release_net_j_per_cad, alone.heat_release_net_j_per_cad)
    turned = analyze(trace.transpose("crank_angle_cad", "cycle"), CYLINDER, point=POINT)
    xr.testing.assert_identical(many, turned)


def test_scatter_is_that_of_the_cycles():
    many = analyze(record(), CYLINDER, point=POINT)
    imep = many.imep_closed_bar.values
    assert float(many.mean_imep_closed_bar) == pytest.approx(imep.sum() / 6, rel=1e-12)
    by_hand = np.sqrt(((imep - imep.mean()) ** 2).sum() / 5)
    assert float(many.std_imep_closed_bar) == pytest.approx(by_hand, rel=1e-12)
    assert float(many.cov_imep_closed_bar_percent) == pytest.approx(100.0 * by_hand / imep.mean(), rel=1e-12)
    assert float(many.lnv_imep_closed_percent) == pytest.approx(100.0 * imep.min() / imep.mean(), rel=1e-12)
    np.testing.assert_allclose(np.diff(many.ca50_cad), np.diff(SOC), atol=0.35)
    assert "cov_ca50_cad_percent" not in many  # the zero of an angle is a convention
    assert many.std_ca50_cad.attrs["units"] == "degree"


def test_the_averaged_cycle_stands_beside_the_mean_of_the_cycles():
    trace = record()
    many = analyze(trace, CYLINDER, point=POINT)
    mean = pressure_trace(trace.crank_angle_cad.values, trace.pressure_bar.values.mean(axis=0))
    alone = analyze(mean, CYLINDER, point=POINT)
    assert float(many.cycle_mean_ca50_cad) == float(alone.ca50_cad)
    assert float(many.cycle_mean_imep_closed_bar) == pytest.approx(float(many.mean_imep_closed_bar), rel=1e-12)
    # Work is linear in pressure, peak and burn angles are not.
    assert float(many.cycle_mean_p_max_bar) < float(many.mean_p_max_bar) - 0.5
    assert abs(float(many.cycle_mean_ca50_cad) - float(many.mean_ca50_cad)) > 0.02


def test_warnings_are_said_once_with_their_count(caplog):
    trace = record()
    trace["pressure_bar"][{"cycle": [1, 4], "crank_angle_cad": 70}] += 40.0
    warnings = analyze(trace, CYLINDER, point=POINT).attrs["warnings"].splitlines()
    assert len([line for line in warnings if line.startswith("2 of 6 cycles: the sample at -105")]) == 1
    assert len([line for line in warnings if line.startswith("mean of 6 cycles: the sample at -105")]) == 1
    assert "record.csv: 2 of 6 cycles" in caplog.text


def test_a_bad_cycle_is_named():
    trace = record()
    trace["pressure_bar"][{"cycle": 3, "crank_angle_cad": 5}] = np.nan
    with pytest.raises(DataError, match=r"cycle 4: pressure_bar\[5\] = nan"):
        analyze(trace, CYLINDER, point=POINT)


def test_motored_cycles_are_counted():
    trace = record()
    motored = simulate(CYLINDER, POINT.replace(fuel_mg=0.0), step_cad=0.5).pressure_bar.values
    trace["pressure_bar"][{"cycle": 2}] = motored
    many = analyze(trace, CYLINDER, point=POINT)
    assert many.attrs["motored"] == 1
    assert np.isnan(many.ca50_cad.values).tolist() == [False, False, True, False, False, False]
    assert not np.isnan(float(many.mean_ca50_cad))
    assert abs(float(many.tdc_offset_cad[2])) < 0.7


def test_the_record_survives_json():
    from mgdd.results.labels import to_jsonable

    many = analyze(record(), CYLINDER, point=POINT)
    again = json.loads(json.dumps(to_jsonable(many), allow_nan=False))
    told = again.get("data_vars", again)["ca50_cad"]
    values = told["data"] if isinstance(told, dict) else told
    np.testing.assert_array_equal(values, many["ca50_cad"].values)
