"""Ten tasks as somebody guesses them from the names, without having read a page; and what a wrong guess is told."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import mgdd
from mgdd.errors import ParameterError

TIME = np.arange(4000) * 1e-3
DUTY = 0.15 + 0.2 * np.sin(2.0 * np.pi * (0.5 * TIME + 0.6 * TIME**2))


def frame() -> pd.DataFrame:
    return mgdd.throttle.simulate_throttle("P1", DUTY, time_s=TIME).to_dataframe()


def test_simulate_a_preset_by_name_at_a_speed() -> None:
    run = mgdd.engine.simulate("puma_single", speed_rpm=1200)
    assert run.attrs["speed_rpm"] == 1200
    preset = mgdd.presets.load("puma_single")
    for other in (
        mgdd.engine.simulate(preset, speed_rpm=1200),
        mgdd.engine.simulate("puma_single", {"speed_rpm": 1200}),
        mgdd.engine.simulate(preset.cylinder, preset.point.replace(speed_rpm=1200)),
    ):
        xr.testing.assert_identical(run, other)
    throttle = mgdd.throttle.simulate_throttle("P1", 0.6)
    xr.testing.assert_identical(throttle, mgdd.throttle.simulate_throttle(mgdd.presets.load("P1"), 0.6))


def test_plot_it() -> None:
    run = mgdd.engine.simulate("puma_single", speed_rpm=1200)
    assert mgdd.plot.pressure(run).get_xlabel() == "crank angle [°CA aTDC]"


def test_sweep_two_inputs_and_fit_a_response() -> None:
    inputs = {"speed_rpm": [1000, 1500, 2000], "soc_cad": [-10, -6, -2, 2]}
    table = mgdd.sweep.sweep("puma_single", inputs)
    fit = mgdd.surrogate.fit_response(table, "imep_gross_bar")
    assert fit.success
    assert fit.residual.shape == (12,)
    assert fit.covariance.shape == (len(fit.report.names),) * 2
    fit.plot()
    at = fit.model.predict({"speed_rpm": [1200.0], "soc_cad": [-6.0]})
    assert 5.0 < float(at["mean"][0]) < 15.0


def test_best_timing_under_a_limit() -> None:
    best = mgdd.engine.find_optimum("puma_single", speed_rpm=1200, limits={"p_max_bar": 95})
    assert best["p_max_bar"] <= 95.01
    limit = mgdd.optimize.Limit("p_max_bar", 95)
    assert mgdd.engine.find_optimum("puma_single", speed_rpm=1200, limits=[limit])["soc_cad"] == best["soc_cad"]
    assert "p_max_bar" in best.summary()


def test_read_a_pressure_file_given_as_a_data_frame() -> None:
    run = mgdd.engine.simulate("puma_single", speed_rpm=1200)
    pressure = run["pressure_bar"].to_dataframe().reset_index()
    found = mgdd.engine.analyze(pressure, "puma_single", point=mgdd.presets.load("puma_single").point)
    assert abs(float(found["p_max_bar"]) - float(run["p_max_bar"])) < 0.1
    with pytest.raises(ParameterError, match=r"path = .*DataFrame.*mgdd.engine.analyze\(frame, cylinder\)"):
        mgdd.io.read_pressure(pressure)


def test_identify_a_throttle_log_from_a_data_frame() -> None:
    fit = mgdd.identify.identify_throttle(frame(), options=mgdd.optimize.FitOptions(n_starts=1))
    assert fit.train.nrmse_fit_percent > 95.0
    with pytest.raises(ParameterError, match=r"path = .*DataFrame.*identify_throttle\(frame\)"):
        mgdd.io.read_throttle_log(frame())


def test_plot_a_run_of_a_seeker() -> None:
    limits = {"p_max_bar": 95}
    bench = mgdd.loop.VirtualEngine("puma_single", limits=limits)
    seeker = mgdd.optimize.ExtremumSeeking(start=-2.0, bounds=(-30.0, 10.0), limits=limits)
    run = mgdd.loop.run_seeker(bench, seeker, 300)
    assert len(mgdd.plot.seeking(run).figure.axes) == len(run.plot().figure.axes)
    assert run.summary["final_soc_cad"] > -30.0
    assert "final_soc_cad" in run.summary()


def test_look_a_map_up_at_a_point() -> None:
    axes = {"speed_rpm": [1000, 2000], "fuel_mg": [10, 20]}
    table = mgdd.maps.CalibrationMap(axes, [[1.0, 2.0], [3.0, 4.0]], name="soc_cad")
    assert float(table(speed_rpm=1500, fuel_mg=15)) == 2.5
    assert float(table.lookup({"speed_rpm": 1500, "fuel_mg": 15}).values) == 2.5
    assert float(table.lookup(speed_rpm=1500, fuel_mg=15).values) == 2.5
    mgdd.plot.map_cells(table)
    with pytest.raises(ParameterError, match="coordinates with speed_rpm and fuel_mg"):
        table(1500)


def test_track_a_step_with_a_fitted_model() -> None:
    fit = mgdd.identify.identify_throttle(frame(), "first_principle", options=mgdd.optimize.FitOptions(n_starts=1))
    controller = mgdd.loop.tuned_controller("guided", fit)
    run = mgdd.loop.track(controller, mgdd.loop.Reference.step(20, 60), throttle="P1")
    assert float(run["settling_ms"]) < 200.0
    with pytest.raises(ParameterError, match=r"tuned_controller\('guided', model\) makes one"):
        mgdd.loop.track(fit.model, "step:20:60")
    with pytest.raises(ParameterError, match="reference = 20: must be a Reference, 'step:20:60'"):
        mgdd.loop.track(controller, 20)


def test_save_and_load_each_result(tmp_path: Path) -> None:
    seeker = mgdd.optimize.ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0))
    run = mgdd.loop.run_seeker(mgdd.loop.VirtualEngine("puma_single"), seeker, 50)
    run.to_netcdf(tmp_path / "run.nc")
    assert mgdd.plot.seeking(xr.load_dataset(tmp_path / "run.nc")).get_ylabel() == "soc_cad [°CA aTDC]"
    table = mgdd.maps.CalibrationMap({"fuel_mg": [10, 20]}, [1.0, 2.0], name="soc_cad")
    table.save(tmp_path / "map.nc")
    assert mgdd.maps.CalibrationMap.load(tmp_path / "map.nc") == table
    fit = mgdd.identify.identify_throttle(frame(), "first_principle", options=mgdd.optimize.FitOptions(n_starts=1))
    (tmp_path / "throttle.toml").write_text(fit.to_toml(), encoding="utf-8")
    assert mgdd.identify.load_throttle_model(tmp_path / "throttle.toml") == fit.model


class Polars:
    """What serves of a DataFrame of polars, which is not installed here: columns, and no index."""

    def __init__(self, columns: dict[str, Any]) -> None:
        self._columns, self.columns = columns, list(columns)

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def __getitem__(self, name: str) -> Any:
        return self._columns[name]


SIGNALS: dict[str, Callable[[], Any]] = {
    "mapping": lambda: {"time_s": TIME, "duty": DUTY},
    "Dataset": lambda: xr.Dataset({"duty": ("time_s", DUTY)}, {"time_s": TIME}),
    "DataArray": lambda: xr.DataArray(DUTY, {"time_s": TIME}, ["time_s"]),
    "Series": lambda: pd.Series(DUTY, pd.Index(TIME, name="time_s"), name="u"),
    "Series over floats": lambda: pd.Series(DUTY, TIME),
    "DataFrame": lambda: pd.DataFrame({"time_s": TIME, "duty": DUTY}),
    "DataFrame with index": lambda: pd.DataFrame({"duty": DUTY}, pd.Index(TIME, name="time_s")),
    "polars": lambda: Polars({"time_s": TIME, "duty": DUTY}),
}
ARRAYS: dict[str, Callable[[], Any]] = {
    "array": lambda: np.column_stack([TIME, DUTY]),
    "pair": lambda: (TIME, DUTY),
}


@pytest.mark.parametrize("form", [*SIGNALS, *ARRAYS])
def test_a_model_takes_a_signal_in_any_form(form: str) -> None:
    model = mgdd.throttle.PseudoWiener("pw_r")
    given = {**SIGNALS, **ARRAYS}[form]()
    xr.testing.assert_identical(model.simulate(given), model.simulate(SIGNALS["mapping"]()))
    if form in SIGNALS:
        wanted = mgdd.throttle.simulate_throttle("P1", DUTY, time_s=TIME)
        xr.testing.assert_identical(mgdd.throttle.simulate_throttle("P1", given), wanted)
        assert mgdd.identify.check_excitation(given, "P1").passed


@pytest.mark.parametrize("given", [pd.Series(DUTY), DUTY, DUTY.tolist(), 0.3, "duty.csv", None], ids=type)
def test_a_signal_without_its_time_is_refused(given: Any) -> None:
    with pytest.raises(ParameterError, match=r"inputs = .*a DataArray or Series over time_s"):
        mgdd.throttle.PseudoWiener("pw_r").simulate(given)


def test_a_log_with_other_columns_is_told_what_it_lacks() -> None:
    with pytest.raises(mgdd.errors.DataError, match="log have no duty: needed are time_s, duty, angle_deg; given are"):
        mgdd.identify.identify_throttle(frame().rename(columns={"duty": "u"}))


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        (lambda: mgdd.engine.simulate("puma"), "no preset 'puma'.*did you mean 'puma_single'"),
        (lambda: mgdd.engine.simulate("P1"), "preset 'P1' is a throttle, not an engine"),
        (lambda: mgdd.engine.simulate(3.0), "cylinder = 3.0: must be a Cylinder, a preset, or the name of one"),
        (lambda: mgdd.engine.simulate("puma_single", 1200), r"point = 1200: must be an OperatingPoint.*'speed_rpm'"),
        (lambda: mgdd.throttle.simulate_throttle("puma_single", 0.5), "is an engine, not a throttle"),
        (
            lambda: mgdd.loop.VirtualThrottle(3.0),
            "throttle = 3.0: must be a Throttle, a first-principle fit of one, a preset",
        ),
        (lambda: mgdd.loop.VirtualEngine(3.0), "cylinder = 3.0: must be a Cylinder"),
        (lambda: mgdd.maps.write_map(3.0, "a.csv"), "table = 3.0: must be a CalibrationMap"),
        (lambda: mgdd.engine.find_optimum("puma_single", limits=95.0), "limits = 95.0: must map names to numbers"),
    ],
)
def test_a_wrong_guess_is_told_the_right_one(wrong: Callable[[], Any], match: str) -> None:
    with pytest.raises(ParameterError, match=match):
        wrong()


def test_a_signal_keeps_its_own_time() -> None:
    signal = xr.DataArray(DUTY, {"time_s": 2.0 * TIME}, ["time_s"])
    np.testing.assert_array_equal(mgdd.throttle.simulate_throttle("P1", signal)["time_s"], 2.0 * TIME)
    wanted = xr.DataArray([20.0, 21.0, 22.0], {"time_s": [0.0, 2e-3, 4e-3]}, ["time_s"])
    run = mgdd.loop.track(mgdd.control.Pid(sample_s=2e-3), wanted)
    np.testing.assert_allclose(run["time_s"], wanted["time_s"], rtol=1e-12)


def test_limits_have_one_grammar() -> None:
    by_name, objects = {"p_max_bar": 95}, [mgdd.optimize.Limit("p_max_bar", 95)]
    start = {"start": -2.0, "bounds": (-30.0, 10.0)}
    made = []
    for limits in (by_name, objects):
        seeker = mgdd.optimize.ExtremumSeeking(**start, limits=limits)
        assert seeker.settings["limits"][0].upper == 95
        bench = mgdd.loop.VirtualEngine("puma_single", limits=limits)
        assert bench.limit_names == ("p_max_bar",)
        guard = mgdd.rig.ActuatorGuard(bench, start={"soc_cad": 0.0}, bounds={"soc_cad": (-12.0, 10.0)}, limits=limits)
        assert [limit.name for limit in guard.limits] == ["p_max_bar"]
        tuned = mgdd.optimize.tune(0.25, -0.05).seeker(**start, limits=limits)
        assert tuple(tuned.limit_names) == ("p_max_bar",)
        criteria = mgdd.loop.LoopCriteria(limits=limits)
        made.append(mgdd.loop.run_seeker(bench, seeker, 40, criteria=criteria).summary)
    assert made[0]["limit_p_max_bar"] == made[1]["limit_p_max_bar"] == 95


def test_a_point_beside_a_trace_is_a_record_a_preset_or_numbers() -> None:
    preset = mgdd.presets.load("puma_single")
    cycle = mgdd.engine.simulate(preset, soc_cad=-6.0)
    trace = pd.DataFrame({name: cycle[name] for name in ("crank_angle_cad", "pressure_bar")})
    warmer = {"intake_temperature_k": 360.0}
    found = [
        mgdd.engine.analyze(trace, preset, point=each)
        for each in (preset, preset.point, "puma_single", warmer, mgdd.engine.OperatingPoint().replace(**warmer))
    ]
    assert found[0].identical(found[1])
    assert found[0].identical(found[2])
    assert found[3].identical(found[4])
    assert not found[0].identical(found[3])
    with pytest.raises(ParameterError, match=r"point = 140\.0: must be an OperatingPoint"):
        mgdd.engine.analyze(trace, preset, point=140.0)
    with pytest.raises(ParameterError, match=r"point = 140\.0: must be an OperatingPoint"):
        mgdd.identify.fit_cylinder([trace], preset, point=140.0)
