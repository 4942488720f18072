"""One contract of every result: data, text, HTML, figure, file and table; and every figure takes it or its Dataset."""

import importlib
import inspect
import pickle
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import mgdd
from map_cases import sweep as map_sweep
from mgdd import datasets, identify, io, plot, presets
from mgdd.engine import Indicating, analyze, check_pressure, find_optimum, ignition_delay, simulate
from mgdd.errors import Error, ParameterError
from mgdd.guide import OnlineCalibration
from mgdd.identify.throttle.automatic import fit_groups
from mgdd.loop import VirtualEngine, run_seeker, seek, seek_front, seek_map, tune_controller
from mgdd.maps import optimize_map
from mgdd.optimize import ExtremumSeeking, FitOptions, IterativeLearning, measure_map, tune
from mgdd.plot.identification import response_diagnostics
from mgdd.report import Report
from mgdd.results.labels import check_labels
from mgdd.results.result import Result
from mgdd.rig import Experiment, Recorder, read_record, run_experiment
from mgdd.rig.experiment.self_test import WAYS_OF, SelfTest
from mgdd.signals import chirp
from mgdd.surrogate import fit_response
from mgdd.throttle import Throttle, simulate_throttle
from mgdd_studies import run_study
from mgdd_studies.measured_engine import SurrogatePlant, fit_surrogate, random_step_records
from public_objects import MODULES

EXPERIMENT = 'kind = "experiment"\nformat = 1\ntask = "track"\nmode = "simulate"\n'


@cache
def log() -> xr.Dataset:
    signal = chirp(4.0, offset=0.01, amplitude=0.34, high_hz=5.0)
    return simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])


@cache
def cylinder_fit() -> Any:
    traces = datasets.read("hd_diesel_128x144")[:2]
    return identify.fit_cylinder(traces, presets.load("hd_diesel_128x144").cylinder)


@cache
def throttle_fit() -> Any:
    return fit_groups(log(), delays=[0.0], options=FitOptions(n_starts=1))


@cache
def run() -> Any:
    limits = {"p_max_bar": 95.0}
    seeker = ExtremumSeeking(start=-2.0, bounds=(-30.0, 10.0), limits=limits)
    return run_seeker(VirtualEngine(seed=1, limits=limits), seeker, 300)


@cache
def response() -> Any:
    points = {"fuel_mg": [5.0, 10.0, 20.0, 30.0, 40.0], "imep_bar": [1.1, 2.9, 6.1, 8.8, 12.1]}
    return fit_response(points, "imep_bar", degree=1)


def two_inputs() -> Any:
    rng = np.random.default_rng(2)
    tried = {"soc_cad": rng.uniform(-15.0, 5.0, 40), "egr": rng.uniform(0.0, 0.3, 40)}
    return measure_map(tried, -0.03 * (tried["soc_cad"] + 4.0) ** 2 - 300.0 * (tried["egr"] - 0.15) ** 2)


def timing() -> Any:
    family = identify.ModelFamily(burn_shapes=["double_wiebe"], gammas=[("linear", 1.40)], wall_heat_scales=[1.0])
    traces, cylinder = datasets.read("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder
    return identify.best_timing(traces, cylinder, family=family)[1]


def fading(x: Any, _u: Any, p: Any) -> Any:
    return p[0] * x


def grey_box() -> Any:
    model = identify.DiscreteModel(step=fading, parameters={"pole": 0.8}, initial_state=(1.0,))
    data = model.simulate({"time_s": np.arange(40.0), "u": np.zeros(40)})
    return identify.fit_model(model, data.assign(y=data["y"] + 0.02 * np.cos(2.0 * data["time_s"])))


def tdc() -> Any:
    traces, cylinder = datasets.read("hd_diesel_128x144")[1:2], presets.load("hd_diesel_128x144").cylinder
    return identify.estimate_tdc(traces, cylinder, span_cad=0.5)


def record(folder: Path) -> Any:
    with Recorder(folder / "run.rec") as recorder:
        recorder.sample("plate", {"angle_deg": 9.0})
        recorder.sample("plate", {"angle_deg": 9.5})
        recorder.event("gate", "armed")
    return read_record(folder / "run.rec")


MADE: dict[str, Callable[[Path], Any]] = {
    "LoopRun": lambda _: run(),
    "SeekResult": lambda _: seek(VirtualEngine(seed=1), {"soc_cad": (-25.0, 10.0)}, cycles=40),
    "FrontResult": lambda _: seek_front(
        VirtualEngine(seed=1), {"soc_cad": (-15.0, 5.0)}, {"efficiency_gross": "max", "nox_soft_ppm": "min"}, cycles=60
    ),
    "MapSearch": lambda _: seek_map(
        lambda x: -((x["soc_cad"] + 0.1 * x["fuel_mg"]) ** 2), {"soc_cad": (-9.0, 5.0)}, {"fuel_mg": [10, 20]}, visits=5
    ),
    "Fit": lambda _: throttle_fit(),
    "CylinderFit": lambda _: cylinder_fit(),
    "GreyBoxFit": lambda _: grey_box(),
    "LikelihoodProfile": lambda _: identify.profile_likelihood(grey_box(), "pole"),
    "ResponseFit": lambda _: response(),
    "FitReport": lambda _: throttle_fit().report,
    "Load": lambda _: cylinder_fit().loads[0],
    "BestTiming": lambda _: timing(),
    "TdcEstimate": lambda _: tdc(),
    "WallHeatProfile": lambda _: identify.wall_heat_profile(cylinder_fit(), scales=[0.5, 1.0]),
    "ThrottleValidation": lambda _: identify.validate_throttle(throttle_fit(), log()),
    "ResidualTests": lambda _: identify.validate_throttle(throttle_fit(), log()).tests,
    "PressureCheck": lambda _: check_pressure(datasets.read("hd_diesel_128x144")[1], "hd_diesel_128x144"),
    "ExcitationCheck": lambda _: identify.check_excitation(chirp(offset=0.15, amplitude=0.1), Throttle()),
    "RecordContent": lambda _: identify.check_excitation(chirp(offset=0.15, amplitude=0.1), Throttle()).content,
    "CalibrationMap": lambda _: optimize_map(map_sweep(), "efficiency_gross"),
    "Optimum": lambda _: find_optimum("puma_single", limits={"p_max_bar": 95.0}),
    "Timing": lambda _: ignition_delay("puma_single", soi_cad=-10.0),
    "MeasuredMap": lambda _: measure_map([-2, -1, 0, 1, 2], [-4.0, -1.1, 0.0, -0.9, -4.0]),
    "several MeasuredMap": lambda _: two_inputs(),
    "optimize Tuning": lambda _: tune(0.25, -0.051, cycles=10.0),
    "several Tuning": lambda _: tune(0.25, {"soc_cad": -0.06, "egr": -600.0, "rail_bar": -1e-4}, cycles=10.0),
    "loop Tuning": lambda _: tune_controller("mgdd1", "P1", n_throttles=1, budget=30),
    "ConvergenceReport": lambda _: IterativeLearning([0.0] * 5, impulse_response=[1.0, 0.5], k_p=0.9).convergence(),
    "ParameterVerdict": lambda _: OnlineCalibration("puma_single").verdicts["wall_heat_scale"],
    "ExperimentResult": lambda _: run_experiment(Experiment.from_toml(EXPERIMENT)),
    "RecordedRun": record,
    "SelfTest": lambda _: SelfTest(ways_to_die=dict.fromkeys(WAYS_OF["python"], 0.1), limit_s=0.5, notes={}),
    "Report": lambda _: Report(name="one cycle", dataset=simulate("puma_single"), verdict=("It runs.",)),
    "StudyResult": lambda _: run_study("sensor-delay", quick=True),
}


def subclasses(cls: type) -> set[type]:
    return {cls}.union(*(subclasses(below) for below in cls.__subclasses__()))


def test_every_class_of_results_is_here() -> None:
    for module in MODULES:
        importlib.import_module(module)
    kinds = {kind.__name__ for kind in subclasses(Result) if kind.__module__.split(".")[0] in ("mgdd", "mgdd_studies")}
    kinds -= {"Result", "NumbersResult", "InputNumbers", "MapForms"}
    assert kinds == {name.split()[-1] for name in MADE}


@pytest.mark.parametrize("name", MADE)
def test_a_result_can_do_what_every_result_can(name: str, tmp_path: Path) -> None:
    made = MADE[name](tmp_path)
    assert isinstance(made, Result)
    assert type(made).__name__ == name.split()[-1]
    data = made.dataset
    check_labels(data)
    assert len(data) > 0
    assert len(made.summary().splitlines()) >= 2
    assert "object at 0x" not in repr(made) + str(made)
    assert made._repr_html_().startswith("<div>")
    made.to_netcdf(tmp_path / "made.nc")
    back = xr.load_dataset(tmp_path / "made.nc")
    assert data.equals(back)
    assert set(back.attrs) == set(data.attrs)
    table = made.to_dataframe()
    assert len(table) >= 1
    assert len(table.columns) >= 1
    ax = made.plot(ax=Figure(layout="constrained").add_subplot())
    assert isinstance(ax, Axes)
    ax.figure.canvas.draw()
    assert isinstance(made.plot(), Axes)
    again = pickle.loads(pickle.dumps(made))
    xr.testing.assert_identical(again.dataset, data)


def test_tables_are_over_the_main_dimension() -> None:
    table = run().to_dataframe()
    assert table.index.name == "cycle"
    assert len(table) == 300
    np.testing.assert_array_equal(table["limits[p_max_bar]"], run().dataset["limits"].sel(limit="p_max_bar"))
    assert list(find_optimum("puma_single").to_dataframe()["soc_cad"]) == [find_optimum("puma_single")["soc_cad"]]


def test_a_fit_has_what_its_report_has() -> None:
    fit = throttle_fit()
    assert fit.residual is fit.report.residual
    assert fit.covariance is fit.report.covariance
    assert fit.success is fit.report.success


def test_figures_of_a_run_are_a_mapping_and_a_text() -> None:
    summary = run().summary
    assert summary["final_soc_cad"] == summary.get("final_soc_cad")
    assert f"final_soc_cad {summary['final_soc_cad']:.6g} °CA aTDC" in run().summary().replace("\n  ", " ")


# Every public figure and two more: a result, or the Dataset that it takes where no class has it; other arguments.
DRAWN: dict[str, tuple[Callable[[], Any], tuple[Any, ...]]] = {
    "seeking": (run, ()),
    "map_cells": (lambda: MADE["CalibrationMap"](Path()), ()),
    "map_contour": (lambda: MADE["CalibrationMap"](Path()), ("soc_cad",)),
    "correlation_matrix": (throttle_fit, ()),
    "response_diagnostics": (response, ()),
    "pressure": (lambda: Drawn(simulate("puma_single")), ()),
    "pressure of cycles": (lambda: Drawn(analyze(pressures(), "puma_single", quiet=True)), ()),
    "cycles": (lambda: Drawn(record()), ("ca50_cad",)),
    "spectrum of cycles": (lambda: Drawn(analysed()), ("pressure_psd_bar2_per_khz",)),
    "map of cycles": (lambda: Drawn(analysed()), ("heat_release_net_j_per_cad",)),
    "holding_duty": (lambda: MADE["ExcitationCheck"](Path()), ()),
    "log_pv": (lambda: Drawn(simulate("puma_single")), ()),
    "throttle_run": (lambda: MADE["ExcitationCheck"](Path()), ()),
    "sensors": (lambda: Drawn(VirtualEngine(seed=1).run([-6.0] * 20)), ()),
    "timing": (lambda: Drawn(mgdd.engine.timing_sweep("puma_single")), ()),
    "trade_off": (lambda: Drawn(mgdd.engine.timing_sweep("puma_single")), ("p_max_bar", "efficiency_gross")),
}


DRAWN_BY = {
    "pressure of cycles": plot.pressure,
    "spectrum of cycles": plot.cycles,
    "map of cycles": plot.cycles,
    "response_diagnostics": response_diagnostics,
    "log_pv": partial(plot.pressure, log_pv=True),
}


def pressures(step_cad: float = 1.0) -> xr.Dataset:
    fuels_mg = (20.0, 0.0, 12.0, 21.0, 20.5)
    runs = [simulate("puma_single", {"fuel_mg": mg}, soc_cad=-5.0, step_cad=step_cad) for mg in fuels_mg]
    return io.pressure_trace(runs[0]["crank_angle_cad"], [run["pressure_bar"] for run in runs])


def analysed() -> xr.Dataset:
    return analyze(pressures(step_cad=0.25), "puma_single", point={"speed_rpm": 1500.0}, quiet=True)


def record() -> xr.Dataset:
    made = pressures()
    return Indicating("puma_single", made["crank_angle_cad"], speed_rpm=1500.0).record(made["pressure_bar"])


class Drawn(Result):
    """A result of a user."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self.dataset = dataset  # type: ignore[misc]


def test_every_public_figure_is_here() -> None:
    assert set(plot.__all__) <= set(DRAWN)


@pytest.mark.parametrize("name", DRAWN)
def test_a_figure_takes_a_result_or_its_dataset_and_nothing_else(name: str) -> None:
    draw = DRAWN_BY.get(name) or getattr(plot, name)
    first, *_ = inspect.signature(draw).parameters.values()
    assert first.annotation == "xr.Dataset | Result"
    make, more = DRAWN[name]
    made = make()
    labels = [draw(each, *more, ax=Figure().add_subplot()).get_ylabel() for each in (made, made.dataset)]
    assert labels[0] == labels[1]
    for wrong in (3.0, "run.nc", None, {"a": 1}, [made.dataset], Throttle()):
        with pytest.raises(
            ParameterError, match=f"^{first.name} = .*must be a Dataset or a result of mgdd, as"
        ) as info:
            draw(wrong, *more)
        assert info.value.field == first.name
    with pytest.raises(Error, match=r"mgdd|no variable"):
        draw(xr.Dataset(), *more)


def test_a_run_of_several_inputs_has_a_panel_each() -> None:
    surrogate = fit_surrogate(random_step_records(1500))
    start = [surrogate.medians[name] for name in ("soi_cad", "doi_main_ms")]
    seeker = ExtremumSeeking(
        start=start, bounds=([start[0] - 5.0, start[1] - 0.2], [start[0] + 5.0, start[1] + 0.2]),
        amplitude=[0.5, 0.02], period=40, harmonics=[4, 5],
    )  # fmt: skip
    run = run_seeker(SurrogatePlant(surrogate, inputs=["soi_cad", "doi_main_ms"]), seeker, 40)
    labels = [panel.get_ylabel() for panel in run.plot().figure.axes]
    assert labels[:3] == ["soi_cad [°CA aTDC]", "doi_main_ms [ms]", "imep [bar]"]
