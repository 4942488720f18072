"""The virtual bench and the simulated rig from Python: labels, chunking, state, threads, errors."""

import copy
import math
import pickle

import numpy as np
import pytest

from mgdd import _core, presets
from mgdd.engine import Cylinder, OperatingPoint, Performance, PerformanceTerm, simulate
from mgdd.errors import ParameterError, RigError, ShapeError
from mgdd.loop import SensorDynamics, VirtualEngine
from mgdd.results.labels import check_labels

QUIET = {"soc_scatter_cad": 0.0, "efficiency_noise_percent": 0.0}
RICH = {
    "performance": Performance.efficiency_and_nox(),
    "limits": ["p_max_bar", "cov_imep_percent"],
    "misfire_probability": 0.05,
    "soc_drift_cad_per_kcycle": 1.0,
    "wall_heat_drift_per_kcycle": 0.1,
    "seed": 3,
}


def requests(n: int) -> np.ndarray:
    return -6.0 + 4.0 * np.sin(np.arange(n) * 0.7)


def test_without_chance_it_is_the_cycle_model() -> None:
    preset = presets.load("hd_diesel_128x144")
    for engine in ("hd_diesel_128x144", preset):
        cycle = VirtualEngine(engine, **QUIET).step(-4.0)
        model = simulate(preset.cylinder, preset.point, soc_cad=-4.0)
        for name in ("imep_gross_bar", "p_max_bar", "efficiency_gross", "ca50_cad"):
            assert cycle[name] == float(model[name])
    own = VirtualEngine(Cylinder(bore_mm=90.0), OperatingPoint(fuel_mg=15.0), **QUIET).step(-4.0)
    assert own["p_max_bar"] == float(
        simulate(Cylinder(bore_mm=90.0), OperatingPoint(fuel_mg=15.0), soc_cad=-4.0)["p_max_bar"]
    )


def test_pressure_of_the_last_cycle_as_the_sensor_reads_it() -> None:
    truth = simulate(Cylinder(), OperatingPoint(), soc_cad=-6.0)
    with pytest.raises(RigError, match="before the first cycle"):
        VirtualEngine().pressure()
    exact = VirtualEngine(**QUIET)
    exact.step(-6.0)
    angle, pressure = exact.pressure()
    np.testing.assert_array_equal(angle, truth["crank_angle_cad"])
    np.testing.assert_array_equal(pressure, truth["pressure_bar"])
    errors = {"pressure_gain_error": 0.01, "pressure_offset_bar": -0.2, "tdc_error_cad": 2.0}
    wrong = VirtualEngine(**QUIET, **errors)
    wrong.step(-6.0)
    np.testing.assert_allclose(wrong.pressure()[1][3:], 1.01 * pressure[1:-2] - 0.2, rtol=1e-3)
    noisy = VirtualEngine(**RICH, **errors, pressure_noise_bar=0.3)
    silent = VirtualEngine(**RICH)
    assert noisy.run(requests(30)).identical(silent.run(requests(30)))
    again = pickle.loads(pickle.dumps(noisy))
    assert again.settings["pressure_noise_bar"] == 0.3
    np.testing.assert_array_equal(again.pressure()[1], noisy.pressure()[1])
    with pytest.raises(ParameterError, match="tdc_error_cad = 7"):
        VirtualEngine(tdc_error_cad=7.0)


def test_run_is_labelled_and_complete() -> None:
    out = VirtualEngine(**RICH).run(requests(80))
    check_labels(out)
    assert dict(out.sizes) == {"cycle": 80, "component": 2, "limit": 2}
    np.testing.assert_array_equal(out["cycle"], np.arange(80))
    np.testing.assert_allclose(out["components"].sum("component"), out["j"], rtol=1e-15)
    np.testing.assert_array_equal(out["limits"].sel(limit="p_max_bar"), out["p_max_bar"])
    np.testing.assert_allclose(
        out["components"].sel(component="efficiency_percent"), 100.0 * out["efficiency_gross"], rtol=1e-15
    )
    np.testing.assert_allclose(out["components"].sel(component="nox_ppm"), -0.004 * out["nox_soft_ppm"], rtol=1e-15)
    np.testing.assert_array_equal(out["soc_requested_cad"], requests(80))
    assert list(out["limit_units"].values) == ["bar", "%"]
    assert out["misfire"].dtype == bool
    assert 0 < int(out["misfire"].sum()) < 20
    assert "limits" not in VirtualEngine().run([-6.0])


def test_repeated_terms_keep_names_of_their_own() -> None:
    terms = [
        PerformanceTerm("efficiency_percent"),
        PerformanceTerm("p_max_bar", -1.0, above=100.0),
        PerformanceTerm("p_max_bar", -0.1, reference=10.0),
    ]
    out = VirtualEngine(performance=Performance(terms), **QUIET).run([-6.0])
    assert list(out["component"].values) == ["efficiency_percent", "p_max_bar_1", "p_max_bar_2"]
    p_max = float(out["p_max_bar"][0])
    np.testing.assert_allclose(out["components"][0, 1:], [-((p_max / 100.0 - 1.0) ** 2), -0.01 * p_max])


def test_steps_chunks_copies_and_pickles_give_one_run() -> None:
    soc = requests(120)
    whole = VirtualEngine(**RICH).run(soc)
    chunked = VirtualEngine(**RICH)
    parts = [chunked.run(soc[:33]), chunked.run(soc[33:34])]
    twins = [chunked, copy.deepcopy(chunked), pickle.loads(pickle.dumps(chunked)), VirtualEngine(**RICH)]
    twins[3].state = chunked.state
    for twin in twins:
        assert type(twin) is VirtualEngine
        assert twin.cycle == 34
        rest = twin.run(soc[34:])
        for name in whole.data_vars:
            if "cycle" in whole[name].dims:
                joined = np.concatenate([part[name].values for part in [*parts, rest]])
                np.testing.assert_array_equal(joined, whole[name].values, err_msg=str(name))
    one_by_one = VirtualEngine(**RICH)
    assert [one_by_one.step(x)["j"] for x in soc] == list(whole["j"].values)
    one_by_one.reset()
    assert one_by_one.step(soc[0])["j"] == float(whole["j"][0])
    one_by_one.reset(4)
    assert (one_by_one.seed, one_by_one.cycle) == (4, 0)
    assert one_by_one.step(soc[0])["j"] != float(whole["j"][0])


def test_settings_build_the_same_bench_again() -> None:
    bench = VirtualEngine(**RICH, analyser=SensorDynamics(delay_cycles=3, lag_cycles=1.5))
    again = _core.loop.VirtualEngine(**bench.settings)
    assert again.settings == bench.settings
    assert again.step(-3.0)["j"] == bench.step(-3.0)["j"]
    # The Python constructor repeats the defaults of the core.
    assert (
        VirtualEngine().settings
        == _core.loop.VirtualEngine(cylinder=Cylinder(), schedule=[(0, OperatingPoint())]).settings
    )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"point": OperatingPoint(), "schedule": [(0, OperatingPoint())]}, "point and schedule were both given"),
        ({"schedule": []}, "schedule is empty"),
        ({"schedule": [(2, OperatingPoint())]}, r"schedule\[0\].cycle = 2: must be 0"),
        ({"limits": "p_max_bar"}, "limits = 'p_max_bar': must be a sequence"),
        ({"limits": ["p_max_bar"] * 9}, "limits has 9 entries: must be at most 8"),
        ({"schedule": [(k, OperatingPoint()) for k in (0, 5, 5)]}, r"schedule\[2\].cycle = 5: must be > 5"),
        ({"inputs": ["soc_cad", "egr", "egr"]}, "egr stands there twice"),
        ({"inputs": ["soc_cad", "second_fraction"]}, "second_fraction needs burn_shape"),
        ({"seed": -1}, r"seed = -1: must be in \[0, 2\*\*64\)"),
        ({"nox_sensor": "nose"}, "nox_sensor = 'nose': must be one of none, analyser"),
        ({"nox_sensor": "none", "performance": Performance.efficiency_and_nox()}, "nox_sensor = 'none'"),
        ({"integrator": "magic"}, "integrator = 'magic'"),
        ({"cylinder": "no_such_preset"}, "no preset 'no_such_preset'"),
        ({"point": OperatingPoint(fuel_mg=0.0)}, r"schedule\[0\].fuel_mg = 0 mg: must be > 0"),
    ],
)
def test_settings_are_refused_by_name(settings: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        VirtualEngine(**settings)


def test_a_refused_call_changes_nothing() -> None:
    bench = VirtualEngine(**RICH)
    bench.run(requests(20))
    state = bench.state
    with pytest.raises(ShapeError, match="soc_cad has 2 dimensions"):
        bench.run(np.zeros((3, 3)))
    spoiled = dict(state)
    del spoiled["fast_line"]
    with pytest.raises(ParameterError, match="column 'fast_line' is missing"):
        bench.state = spoiled
    with pytest.raises(ParameterError, match="'last_t_max_k' holds nan: must be finite"):
        bench.state = {**state, "last_t_max_k": [math.nan]}
    assert all(np.array_equal(state[name], column) for name, column in bench.state.items())
    twin = VirtualEngine(**RICH)
    twin.run(requests(20))
    assert bench.step(-6.0)["j"] == twin.step(-6.0)["j"]
