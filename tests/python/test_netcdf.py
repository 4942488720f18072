"""Every Dataset that a public name hands out can be written as netCDF, and pint reads its units."""

import importlib
import inspect
import io
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
import xarray as xr

import mgdd
import mgdd_studies
from map_cases import sweep as map_sweep
from map_cases import timing_table
from mgdd import datasets, design, identify, optimize, presets, signals, surrogate
from mgdd.control import Pid
from mgdd.engine import (
    Cylinder,
    Indicating,
    OperatingPoint,
    ThermalNo,
    analyze,
    check_pressure,
    sensitivities,
    simulate,
    timing_sweep,
)
from mgdd.engine.cycle import convergence
from mgdd.guide import FeedForward, GuidedEngine, ModelOptimum, OnlineCalibration
from mgdd.identify.throttle.automatic import fit_groups
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.validation import ThrottleValidation
from mgdd.io import (
    Encoder,
    pressure_chunks,
    pressure_trace,
    read,
    read_pressure,
    read_throttle_log,
    throttle_log,
    write_csv,
)
from mgdd.loop import (
    ThrottleFault,
    VirtualEngine,
    export_controller,
    monte_carlo,
    run_seeker,
    simulate_drive,
    track,
    track_many,
)
from mgdd.maps import apply_map, compare_maps, optimize_map
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import check_labels
from mgdd.rig import SimulatedRig
from mgdd.rig.realtime import RingTransport
from mgdd.sweep import sweep
from mgdd.throttle import DemandChain, PseudoWiener, SensorPair, Throttle, characteristics, simulate_throttle
from realtime_loops import make_loop
from study_cache import quick_study

POINT = OperatingPoint()
REGISTRY = pint.UnitRegistry()
TIME = np.arange(2000) * 1e-3


def log() -> xr.Dataset:
    run = simulate_throttle(Throttle(), 0.15 + 0.3 * np.sin(6.0 * TIME), time_s=TIME)
    return throttle_log(TIME, run["duty"], run["angle_deg"])


def written_log(folder: Path) -> xr.Dataset:
    write_csv(log(), folder / "log.csv")
    return read_throttle_log(folder / "log.csv")


def whole_file(folder: Path) -> Any:
    angle = np.arange(-180.0, 180.0)
    hump = np.exp(-(((angle - 8.0) / 30.0) ** 2))
    columns = {"CAD": angle, "p 1": 2.0 + 50.0 * hump, "p 2": 2.0 + 60.0 * hump, "lift 1": hump, "lift 2": 2.0 * hump}
    slow = {"time_s": np.arange(7.0), "T_exh": 600.0 + np.arange(7.0), "imep": np.array([5.0, 6.0])}
    np.savez(folder / "whole.npz", **columns, **slow)
    return read(folder / "whole.npz")


def pressure_file(folder: Path) -> Path:
    trace = datasets.read("hd_diesel_128x144")[0]
    columns = np.column_stack([trace["crank_angle_cad"], trace["pressure_bar"]])
    np.savetxt(folder / "trace.csv", columns, delimiter=",")
    return folder / "trace.csv"


def bench_run() -> xr.Dataset:
    return VirtualEngine(seed=1).run(np.full(20, -6.0))


def seeker() -> optimize.ExtremumSeeking:
    return optimize.ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0))


def rig_run() -> xr.Dataset:
    with SimulatedRig(VirtualEngine(seed=1)) as rig:
        return run_seeker(rig, seeker(), 20).dataset


def learned() -> xr.Dataset:
    learner = optimize.IterativeLearning(np.zeros(10), k_p=0.5)
    learner.ask()
    learner.tell(np.ones(10))
    return learner.history


def guided() -> FeedForward:
    ff = FeedForward(optimize.ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0)), lambda fuel: -0.35 * fuel)
    for fuel in (12.0, 12.0, 30.0):
        ff.at(fuel)
        ff.tell(-float((ff.ask()[0] + 0.35 * fuel) ** 2))
    return ff


def guided_engine() -> GuidedEngine:
    bench, model = VirtualEngine(), ModelOptimum(Cylinder())
    engine = GuidedEngine(optimize.ExtremumSeeking(start=-6.0, bounds=(-30.0, 10.0)), model, bench.point)
    run_seeker(bench, engine, 3)
    return engine


def taught() -> OnlineCalibration:
    bench, calibration = VirtualEngine(), OnlineCalibration(Cylinder(), window_cycles=2, steady_cycles=0)
    for _ in range(3):
        soc_cad = bench.step(-6.0)["soc_cad"]
        calibration.offer(bench.pressure()[1], bench.point, soc_cad)
        calibration.update()
    return calibration


def validation() -> ThrottleValidation:
    model = FirstPrincipleModel()
    return identify.validate_throttle(model, log())


def planned(**options: Any) -> xr.Dataset:
    return design.design_points({"speed_rpm": (1000.0, 3000.0), "fuel_mg": (5.0, 40.0), "gear": {2, 4, 5}}, **options)


def region(columns: Any) -> list[xr.Dataset]:
    """Judge by a model, by measured points, and beside points that could not be driven."""
    hot = design.FeasibleRegion.of_model(lambda c: {"t_max_k": 50.0 * c["fuel_mg"]}, {"t_max_k": 1500.0})
    driven = {"speed_rpm": [900.0, 900.0, 3100.0, 2000.0], "fuel_mg": [4.0, 45.0, 4.0, 30.0]}
    refused = {"speed_rpm": [2500.0], "fuel_mg": [30.0]}
    measured = design.FeasibleRegion.of_points(driven, infeasible=refused)
    return [hot.evaluate(columns), measured.evaluate(columns)]


def responses() -> Iterable[surrogate.ResponseModel]:
    plan = planned(n=32)
    torque = 4.0 * plan["fuel_mg"] - 1e-5 * (plan["speed_rpm"] - 1800.0) ** 2 + np.sin(7.0 * plan["point"])
    for kind in ("polynomial", "gaussian_process"):
        yield surrogate.fit_response(plan, torque, kind=kind, n_starts=1).model


def loop_samples() -> xr.Dataset:
    with make_loop(RingTransport()) as loop:
        loop.wait(0.05)
    return loop.samples()


def whole_cycles() -> Indicating:
    return Indicating(Cylinder(), np.arange(-360.0, 360.0), speed_rpm=6000.0)


def verdict() -> Any:
    return check_pressure(datasets.read("hd_diesel_128x144")[1], "hd_diesel_128x144")


def indicating() -> Indicating:
    return Indicating(Cylinder(), np.arange(-180.0, 181.0), speed_rpm=6000.0)


def wall_heat() -> xr.Dataset:
    traces = datasets.read("hd_diesel_128x144")[:2]
    fit = identify.fit_cylinder(traces, presets.load("hd_diesel_128x144").cylinder)
    return identify.wall_heat_profile(fit, scales=[0.5, 1.0]).dataset


def report() -> FitReport:
    return optimize.least_squares(lambda x: ([x[0] - 1.0, x[1], x[0]], [[1, 0], [0, 1], [1, 0]]), [0.0, 0.0])


def fitted_load() -> xr.Dataset:
    fit = identify.fit_cylinder(datasets.read("hd_diesel_128x144")[:1], presets.load("hd_diesel_128x144").cylinder)
    return fit.loads[0].overlay


SIGNALS = ("amplitude_random_steps", "chirp", "multisine", "prbs", "staircase", "triangle")
NEEDS = ("advisor_engine_maps", "h2df_502")
MADE: dict[str, Callable[[Path], Any]] = {
    **{f"signals.{name}": lambda _, n=name: getattr(signals, n)(offset=0.15, amplitude=0.2) for name in SIGNALS},
    "datasets.read": lambda _: datasets.read("hd_diesel_128x144"),
    **{f"datasets.read.{name}": lambda _, n=name: datasets.read(n) for name in NEEDS},
    "engine.Indicating.noise": lambda _: whole_cycles().noise(np.eye(2, 720), attenuation_db={500: 90, 2000: 80}),
    "engine.Indicating.oscillation": lambda _: indicating().oscillation(np.ones((2, 361))),
    "engine.Indicating.record": lambda _: indicating().record(np.ones((2, 361))),
    "engine.ThermalNo.cycle": lambda _: ThermalNo().cycle(simulate("puma_single"), "puma_single"),
    "engine.PressureCheck.analysis": lambda _: verdict().analysis,
    "engine.PressureCheck.dataset": lambda _: verdict().dataset,
    "engine.analyze": lambda _: analyze(simulate(Cylinder(), OperatingPoint(fuel_mg=0.0)), Cylinder()),
    "engine.convergence": lambda _: convergence(Cylinder(), POINT),
    "engine.sensitivities": lambda _: sensitivities(Cylinder(), POINT),
    "engine.simulate": lambda _: simulate(Cylinder(), OperatingPoint(intake_pressure_kpa=700.0, fuel_mg=400.0)),
    "engine.timing_sweep": lambda _: timing_sweep(Cylinder(), POINT),
    "design.FeasibleRegion.evaluate": lambda _: region(planned(n=16)),
    "design.design_points": lambda _: [
        planned(n=16), planned(method="factorial"), planned(n=12, method="d_optimal", existing=planned(n=4)),
    ],
    "results.Fit.predict": lambda _: surrogate.fit_response(planned(n=16), "fuel_mg", degree=1).predict(
        planned(n=8)
    ),
    "surrogate.ResponseModel.predict": lambda _: [model.predict(planned(n=8)) for model in responses()],
    "surrogate.fit_response.diagnostics": lambda _: surrogate.fit_response(
        {"fuel_mg": [5.0, 10.0, 20.0, 30.0, 40.0], "imep_bar": [1.1, 2.9, 6.1, 8.8, 12.1]}, "imep_bar", degree=1
    ).diagnostics,
    "identify.ExcitationCheck.prediction": lambda _: identify.check_excitation(
        signals.chirp(offset=0.15, amplitude=0.1), Throttle()
    ).prediction,
    "identify.fit_cylinder.overlay": lambda _: fitted_load(),
    "signals.ResidualTests.correlations": lambda _: validation().tests.correlations,
    "identify.validate_throttle.n_step": lambda _: validation().n_step,
    "identify.validate_throttle.free_run": lambda _: validation().free_run,
    "identify.WallHeatProfile.dataset": lambda _: wall_heat(),
    "results.FitReport.dataset": lambda _: report().dataset,
    "results.Fit.dataset": lambda _: fit_groups(log(), delays=[0.0], options=optimize.FitOptions(n_starts=1)).dataset,
    "results.Fit.run": lambda _: fit_groups(log(), delays=[0.0], options=optimize.FitOptions(n_starts=1)).run,
    "throttle.PseudoWiener.predict": lambda _: PseudoWiener("pw_r").predict(log(), 5),
    "guide.FeedForward.history": lambda _: guided().history,
    "guide.GuidedEngine.history": lambda _: guided_engine().history,
    "guide.OnlineCalibration.history": lambda _: taught().history,
    "identify.design_excitation": lambda _: identify.design_excitation("chirp", Throttle())[0],
    "io.Encoder.angle": lambda _: wheel_angle(),
    "io.pressure_chunks": lambda folder: list(pressure_chunks(pressure_file(folder))),
    "io.pressure_trace": lambda _: pressure_trace(np.arange(-40.0, 41.0), 60.0 - 0.01 * np.arange(-40.0, 41.0) ** 2),
    "io.read": whole_file,
    "io.read_pressure": lambda folder: read_pressure(pressure_file(folder)),
    "io.read_throttle_log": written_log,
    "io.throttle_log": lambda _: log(),
    "rig.RealtimeLoop.samples": lambda _: loop_samples(),
    "loop.VirtualEngine.run": lambda _: bench_run(),
    "loop.LoopRun.dataset": lambda _: [run_seeker(VirtualEngine(seed=1), seeker(), 20).dataset, rig_run()],
    "loop.monte_carlo": lambda _: monte_carlo(VirtualEngine(), seeker(), [1, 2], cycles=20),
    "loop.track": lambda _: track(Pid(), "step:40:42", airflow_torque_nm=0.1),
    "loop.export_controller": lambda folder: export_controller(Pid(), folder / "target"),
    "loop.track_many": lambda _: track_many({"pid": Pid()}, ["step:40:42"], [Throttle()]),
    "loop.simulate_drive": lambda _: simulate_drive(DemandChain(), [10.0, 60.0], 2000.0),
    "loop.VirtualEngine.steady_map": lambda _: VirtualEngine().steady_map([-10.0, -6.0]),
    "optimize.IterativeLearning.history": lambda _: learned(),
    "optimize.MapSeeking.cells": lambda _: optimize.MapSeeking({"x": (-1.0, 1.0)}, {"fuel_mg": [6.0, 9.0]}).cells(),
    "optimize.Seeker.history": lambda _: optimize.Spsa(start=1.0).history,
    "optimize.Seeker.run": lambda _: optimize.GradientDescent(start=1.0).run(lambda x: -float((x[0] - 2.0) ** 2), 20),
    "maps.CalibrationMap.to_dataset": lambda _: timing_table().to_dataset(),
    "maps.apply_map": lambda _: apply_map(optimize_map(map_sweep(), "efficiency_gross"), map_sweep()),
    "maps.compare_maps": lambda _: compare_maps(timing_table(), timing_table(), tolerance=0.5),
    "report.Report.dataset": lambda _: quick_study("sensor-delay").dataset,
    "sweep.sweep": lambda _: [
        sweep(Cylinder(), POINT, {"bore_mm": [80.0, 90.0], "soc_cad": [-9.0, -6.0]}, keep_traces="pressure_bar"),
        sweep(Cylinder(), POINT, {"speed_rpm": [900.0, 2000.0]}, pointwise=True),
    ],
    "throttle.DemandChain.steady": lambda _: DemandChain().steady([10.0, 60.0], 2000.0),
    "throttle.characteristics": lambda _: characteristics(Throttle()),
    "throttle.SensorPair.sense": lambda _: SensorPair().sense(
        simulate_throttle(Throttle(), 0.3, duration_s=0.2), faults=[ThrottleFault(kind="open_wire", sensor=2)]
    ),
    "throttle.simulate_throttle": lambda _: [
        simulate_throttle(Throttle(), 0.3, duration_s=0.2, start_deg=start) for start in (None, [0.0, 20.0])
    ],
}  # fmt: skip


def wheel_angle() -> Any:
    time = np.arange(0.0, 0.3, 1e-5)
    place = 9000.0 * time % 360.0 / 6.0
    return Encoder(teeth=60, missing_teeth=2).angle(time, 1.0 * ((place < 58.0) & (place % 1.0 < 0.5)))


def is_dataset(annotation: Any) -> bool:
    return "Dataset" in str(annotation)


def sources(module: str) -> Iterable[str]:
    """Public functions and methods that return a Dataset, and public fields that are one."""
    room = importlib.import_module(f"mgdd.{module}")
    for name in room.__all__:
        thing = getattr(room, name)
        if not inspect.isclass(thing):
            if callable(thing) and is_dataset(getattr(thing, "__annotations__", {}).get("return", "")):
                yield f"{module}.{name}"
            continue
        for key, field in getattr(thing, "__annotations__", {}).items():
            if is_dataset(field):
                yield f"{module}.{name}.{key}"
        for key, member in vars(thing).items():
            function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            returned = getattr(function, "__annotations__", {}).get("return", "")
            if not key.startswith("_") and is_dataset(returned):
                yield f"{module}.{name}.{key}"


def test_every_public_source_of_a_dataset_is_here() -> None:
    modules = set(mgdd.__all__) - {"__version__", "cmake_dir"}
    found = {source for module in modules for source in sources(module)}
    assert len(found) > 30
    assert {source for source in found if not source.startswith("results.Model.")} <= set(MADE)


@pytest.mark.parametrize("source", sorted(MADE))
def test_written_and_read_back(source: str, tmp_path: Path) -> None:
    needed = source.rpartition(".")[2]
    if needed in NEEDS and needed not in datasets.names():
        pytest.skip(f"MGDD_DATA_DIR holds no folder {needed}")
    made = MADE[source](tmp_path)
    for dataset in [made] if isinstance(made, xr.Dataset) else made:
        check_labels(dataset)
        dataset.to_netcdf(tmp_path / "out.nc", engine="scipy")
        with (tmp_path / "out.nc").open("rb") as file:
            back = xr.load_dataset(io.BytesIO(file.read()), engine="scipy")
        assert set(back.variables) == set(dataset.variables)
        assert set(back.attrs) == set(dataset.attrs)
        for name, variable in dataset.variables.items():
            np.testing.assert_array_equal(back[name].to_numpy(), variable.to_numpy(), err_msg=str(name))
            assert back[name].attrs["long_name"] == variable.attrs["long_name"]
            REGISTRY.parse_units(back[name].attrs["units"])


def test_every_file_is_classic_whatever_engine_is_installed() -> None:
    """The reader of this package knows no other; without an engine's name xarray takes the first that it finds."""
    packages = [Path(each.__file__).resolve().parent for each in (mgdd, mgdd_studies)]
    files = [file for package in packages for folder in package.iterdir() for file in folder.rglob("*.py")]
    calls = [line for file in files for line in file.read_text(encoding="utf-8").splitlines() if ".to_netcdf(" in line]
    assert calls
    assert [line.strip() for line in calls if 'engine="scipy"' not in line] == []
