"""A call with arrays for every public function that takes arrays; `test_array_inputs` gives them in other forms."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from mgdd import guide, identify, io, optimize, signals, surrogate, throttle
from mgdd.control import Pid
from mgdd.engine import (
    Cylinder,
    Indicating,
    OperatingPoint,
    ThermalNo,
    fit_nox_proxy,
    nox_at_reference_humidity,
    nox_g_per_kwh,
    simulate,
    timing_sweep,
)
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.io.pressure_checks import check_trace
from mgdd.loop import Reference, VirtualEngine, VirtualTestBed, seek_map, simulate_drive, track, track_many
from mgdd.maps import CalibrationMap
from mgdd.rig.exchange import RigRecord, flat
from mgdd.rig.realtime import RingTransport
from mgdd.signals.even_grid import even_step
from mgdd.signals.metrics import mse, residual_tests, rmse, vaf_percent
from mgdd.sweep import sweep
from mgdd.throttle.characteristics import airflow_torque_nm
from realtime_loops import make_loop

Array = np.ndarray[Any, Any]
Call = Callable[..., Any]

TIME = np.arange(600) * 1e-3
DUTY = 0.15 + 0.2 * np.sin(2.0 * np.pi * TIME * (0.5 + 4.0 * TIME))
MODEL = throttle.PseudoWiener("pw_r")
ANGLE = MODEL.simulate({"time_s": TIME, "duty": DUTY})["angle_deg"].to_numpy()
GROUPS = FirstPrincipleModel()
CRANK = np.arange(-90.0, 91.0)
BAR = 40.0 * np.exp(-((CRANK / 40.0) ** 2)) + 1.0
WHOLE = np.random.default_rng(3).standard_normal(720)
NOISE = np.random.default_rng(0).standard_normal(600)
KELVIN, PPM = np.linspace(1900.0, 2500.0, 7), np.array([60.0, 110.0, 150.0, 230.0, 320.0, 450.0, 640.0])
SOC = np.array([-8.0, -6.0, -4.0])
SWEEP = np.linspace(-3.0, 3.0, 40)
OPEN = np.array([10.0, 30.0, 60.0])
CHAIN = throttle.DemandChain()
FUEL, TIMING = np.array([6.0, 20.0, 40.0]), np.array([-2.0, -6.0, -11.0])


def lag(_: float, x: Any, u: Any, p: Any) -> Any:
    return (p[0] * u[0] - x) / p[1]


def fitted(time: Any, u: Any, y: Any, start: Any) -> Any:
    parameters = {"gain": 100.0, "lag_s": 0.1}
    options = optimize.FitOptions(max_iterations=2)
    record = {"time_s": time, "u": u, "y": y}
    return identify.fit_ode(lag, record, parameters=parameters, initial_state=start, options=options).report.values


def stepped(time: Any, u: Any, y: Any, start: Any) -> Any:
    model = identify.DiscreteModel(
        step=lambda x, u, p: p[0] * x + p[1] * u[0], parameters={"pole": 0.9, "gain": 10.0}, initial_state=(0.0,)
    )
    options = optimize.FitOptions(max_iterations=2)
    return identify.fit_model(
        model, {"time_s": time, "u": u, "y": y}, initial_state=start, options=options
    ).report.values


def ode(time: Any, u: Any, start: Any) -> Any:
    parameters = {"gain": 100.0, "lag_s": 0.1}
    model = identify.OdeModel(
        derivative=lag, output=lambda x, *_: x[0], parameters=parameters,
        initial_state=(0.0,),
    )  # fmt: skip
    return model.simulate({"time_s": time, "u": u}, initial_state=start)["y"].to_numpy()


def indicating(angle: Any) -> Indicating:
    return Indicating(Cylinder(), angle, speed_rpm=6000.0)


def run(model: Any) -> Call:
    return lambda time, duty: model.simulate({"time_s": time, "duty": duty})["angle_deg"].to_numpy()


def ahead(model: Any) -> Call:
    return lambda time, duty, angle: model.predict({"time_s": time, "duty": duty, "angle_deg": angle}, 5)[
        "angle_deg"
    ].to_numpy()


def updated(duty: Any, angle: Any) -> Any:
    update = identify.OnlineUpdate(MODEL)
    update.update(duty, angle)
    return list(update.model.parameters.values())


def learned(initial: Any, response: Any, error: Any) -> Any:
    learner = optimize.IterativeLearning(initial, impulse_response=response, k_p=0.5)
    learner.ask()
    learner.tell(error)
    return learner.ask()


def taps(initial: Any, function: Any) -> Any:
    return optimize.IterativeLearning(initial, law="q_filter", learning_function=function, lead=1, guard=False).ask()


def line(x: Array) -> tuple[Array, Array]:
    return OPEN * x[0] - 2.0 * OPEN, OPEN[:, None]


def searched(x0: Any, lower: Any, upper: Any, data: Any) -> Any:
    return optimize.least_squares(line, x0, bounds=(lower, upper), data=data).values


def logged(*columns: Any) -> Any:
    log = io.throttle_log(*columns[:3], current_a=columns[3], supply_v=columns[4])
    return [log[name].to_numpy() for name in log.variables]


def swept(**options: Any) -> Any:
    return throttle.simulate_throttle(throttle.Throttle(), **options)["angle_deg"].to_numpy()


def many(duty: Any, time: Any, start: Any, supply: Any, air: Any) -> Any:
    return throttle.simulate_throttle(
        throttle.Throttle(), duty, time_s=time, start_deg=start, supply_v=supply, airflow_torque_nm=air
    )["angle_deg"].to_numpy()


def pressure() -> Array:
    bench = VirtualEngine(soc_scatter_cad=0.0)
    bench.step(-6.0)
    return bench.pressure()[1]


def calibrated(trace: Any) -> Any:
    calibration = guide.OnlineCalibration(Cylinder(wall_heat_scale=1.0), window_cycles=2, steady_cycles=0)
    statuses = [calibration.offer(trace, OperatingPoint(), -6.0) for _ in range(3)]
    calibration.update()
    return [calibration.cylinder.wall_heat_scale, statuses.count("accepted")]


def guided(trace: Any) -> Any:
    rough, point = Cylinder(wall_heat_scale=1.0), OperatingPoint()
    calibration = guide.OnlineCalibration(rough, window_cycles=2, steady_cycles=0)
    seeker = optimize.ExtremumSeeking(start=-6.0, bounds=(-30.0, 10.0))
    engine = guide.GuidedEngine(seeker, guide.ModelOptimum(rough), point, calibration=calibration)
    for _ in range(3):
        engine.ask()
        engine.tell(56.0, pressure_bar=trace)
    return [engine.cylinder.wall_heat_scale, *engine.estimate]


def wheel(time: Any, signal: Any) -> Any:
    return io.Encoder(teeth=4).angle(time, signal)["crank_angle_deg"].to_numpy()


def no_factor(ppm: Any) -> Any:
    cycles = [engine_cycle() for _ in ppm]
    return [ThermalNo().fit(cycles, ppm, "puma_single").model.calibration]


@cache
def engine_cycle() -> xr.Dataset:
    return simulate("puma_single", step_cad=5.0)


def table(fuel: Any, timing: Any, sd: Any) -> CalibrationMap:
    return CalibrationMap({"fuel_mg": fuel}, timing, name="soc_cad", cells={"sd": sd})


def held(fuel: Any, timing: Any, sd: Any) -> Any:
    made = table(fuel, timing, sd)
    return np.concatenate([made.axes["fuel_mg"], made.values, made.cells["sd"]])


def log() -> xr.Dataset:
    return io.throttle_log(TIME, DUTY, ANGLE)


def pedals(pedal: Any, speed: Any, wanted: Any) -> Any:
    rows = [wanted, wanted]
    return throttle.PedalMap(pedal_percent=pedal, speed_rpm=speed, wanted_nm=rows).torque_nm(25.0, 2500.0)


def exchanged(row: Any) -> Any:
    record = RigRecord.from_columns(["misfire", "input.duty", "value.angle_deg"], [row, row])
    return [list(flat(exchange).values()) for exchange in record]


def whole_cycle(pressure: Any) -> xr.Dataset:
    return Indicating(Cylinder(), np.arange(-360.0, 360.0), speed_rpm=6000.0).noise(pressure)


def queued(references: Any) -> Any:
    loop = make_loop(RingTransport())
    loop.queue_references(references)
    return loop.queued_references


CALLS: dict[str, tuple[Call, tuple[Array, ...]]] = {
    "engine.Indicating.__init__": (lambda a, p: list(indicating(a).cycle(p).values()), (CRANK, BAR)),
    "engine.Indicating.cycle": (lambda p: list(indicating(CRANK).cycle(p).values()), (BAR,)),
    "engine.Indicating.noise": (lambda p: whole_cycle(p)["pressure_level_db"].to_numpy(), (WHOLE,)),
    "engine.Indicating.oscillation": (lambda p: indicating(CRANK).oscillation(p)["oscillation_bar"].to_numpy(), (BAR,)),
    "engine.Indicating.record": (lambda p: indicating(CRANK).record([p, p])["ca50_cad"].to_numpy(), (BAR,)),
    "engine.nox_at_reference_humidity": (lambda ppm: nox_at_reference_humidity(ppm, 0.01), (PPM,)),
    "engine.nox_g_per_kwh": (lambda ppm: nox_g_per_kwh(ppm, exhaust_kg_per_h=300.0, power_kw=50.0), (PPM,)),
    "engine.fit_nox_proxy": (lambda t, ppm: list(fit_nox_proxy(t, ppm).proxy.to_dict().values()), (KELVIN, PPM)),
    "engine.ThermalNo.fit": (no_factor, (PPM[:2],)),
    "engine.timing_sweep": (
        lambda soc: timing_sweep(Cylinder(), OperatingPoint(), soc_cad=soc)["imep_gross_bar"].to_numpy(), (SOC,),
    ),
    "guide.GuidedEngine.tell": (guided, (pressure(),)),
    "guide.OnlineCalibration.offer": (calibrated, (pressure(),)),
    "identify.OnlineUpdate.update": (updated, (DUTY, ANGLE)),
    "identify.fit_model": (stepped, (TIME, DUTY, ANGLE, np.array([8.0]))),
    "identify.fit_ode": (fitted, (TIME, DUTY, ANGLE, np.array([8.0]))),
    "io.Encoder.angle": (wheel, (np.arange(0.0, 0.4, 1e-3), np.sin(200.0 * np.arange(0.0, 0.4, 1e-3)))),
    "io.pressure_trace": (lambda a, p: io.pressure_trace(a, p)["pressure_bar"].to_numpy(), (CRANK, BAR)),
    "io.throttle_log": (logged, (TIME, DUTY, ANGLE, 0.1 * DUTY, 12.0 + DUTY)),
    "maps.CalibrationMap.__init__": (held, (FUEL, TIMING, 0.1 * FUEL)),
    "maps.CalibrationMap.replaced": (lambda t: table(FUEL, TIMING, 0.2).replaced(t).values, (TIMING - 1.0,)),
    "maps.CalibrationMap.lookup": (lambda x: table(FUEL, TIMING, 0.2).lookup({"fuel_mg": x}).values, (OPEN,)),
    "maps.CalibrationMap.place": (lambda x: table(FUEL, TIMING, 0.2).place({"fuel_mg": x}).weights, (OPEN,)),
    "maps.CalibrationMap.__call__": (lambda x: table(FUEL, TIMING, 0.2)(fuel_mg=x), (OPEN,)),
    "maps.CalibrationMap.sd_at": (lambda x: table(FUEL, TIMING, 0.1 * FUEL).sd_at({"fuel_mg": x}), (OPEN,)),
    "loop.VirtualEngine.run": (lambda soc: VirtualEngine(seed=1).run(soc)["j"].to_numpy(), (SOC,)),
    "loop.VirtualEngine.steady_map": (lambda soc: VirtualEngine().steady_map(soc)["j"].to_numpy(), (SOC,)),
    "loop.VirtualTestBed.steady": (
        lambda soc: VirtualTestBed().steady({"speed_rpm": 1500.0, "fuel_mg": 20.0, "soc_cad": soc})["j"], (SOC,),
    ),
    "loop.seek_map": (
        lambda fuel: seek_map(
            lambda x: -((x["x"] - 0.1 * x["fuel_mg"]) ** 2), {"x": (-2.0, 8.0)}, {"fuel_mg": fuel}, visits=4
        ).map.values,
        (FUEL,),
    ),
    "optimize.MapSeeking.__init__": (
        lambda fuel: optimize.MapSeeking({"x": (-2.0, 2.0)}, {"fuel_mg": fuel}).axes["fuel_mg"], (FUEL,),
    ),
    "loop.track": (
        lambda wanted, air: track(Pid(), wanted, airflow_torque_nm=air)["angle_deg"].to_numpy(), (OPEN, 1e-3 * OPEN),
    ),
    "loop.track_many": (
        lambda air: track_many(
            {"pid": Pid()},
            [Reference(angle_deg=np.linspace(20.0, 30.0, len(air)), name="ramp")],
            [throttle.Throttle()],
            airflow_torque_nm={"ramp": air},
        )["mse_deg2"].to_numpy(),
        (1e-3 * OPEN,),
    ),
    "loop.simulate_drive": (
        lambda pedal, speed: simulate_drive(CHAIN, pedal, speed)["torque_nm"].to_numpy(), (OPEN, 2000.0 + OPEN),
    ),
    "optimize.IterativeLearning.__init__": (taps, (np.zeros(5), np.array([0.1, 0.5, 0.1]))),
    "optimize.IterativeLearning.tell": (learned, (np.zeros(5), np.array([0.5, 0.3]), np.arange(5.0))),
    "optimize.least_squares": (searched, (np.array([1.0]), np.array([0.0]), np.array([9.0]), OPEN)),
    "optimize.measure_map": (
        lambda x, y: optimize.measure_map(x, y).curvature, (SWEEP, -SWEEP**2),
    ),
    "signals.nrmse_fit_percent": (signals.nrmse_fit_percent, (ANGLE, ANGLE + NOISE)),
    "surrogate.fit_response": (
        lambda fuel, imep: surrogate.fit_response({"fuel_mg": fuel}, imep, degree=1).diagnostics["left_out"].to_numpy(),
        (np.array([6.0, 13.0, 20.0, 30.0, 41.0]), np.array([1.1, 2.9, 6.1, 8.8, 12.1])),
    ),
    "sweep.sweep": (
        lambda soc, fuel: sweep(Cylinder(), OperatingPoint(), {"soc_cad": soc, "fuel_mg": fuel})["t_max_k"].to_numpy(),
        (SOC, 0.5 * OPEN),
    ),
    "throttle.DemandChain.steady": (
        lambda pedal, speed: CHAIN.steady(pedal, speed)["opening_deg"].to_numpy(), (OPEN, 2000.0 + OPEN),
    ),
    "throttle.PseudoWiener.slopes": (lambda u: MODEL.slopes(u, initial_state={"angle_deg": 8.0})[1], (DUTY[:20],)),
    "throttle.characteristics": (
        lambda a: throttle.characteristics(throttle.Throttle(), a)["duty_rising"].to_numpy(), (OPEN,),
    ),
    "throttle.simulate_throttle": (
        lambda u, t, v, m: swept(duty=u, time_s=t, supply_v=v, airflow_torque_nm=m),
        (DUTY, TIME, 12.0 + DUTY, 0.01 * DUTY),
    ),
}  # fmt: skip

# Models take columns by name; what is not exported takes arrays all the same.
MORE: dict[str, tuple[Call, tuple[Array, ...]]] = {
    "throttle.simulate_throttle, many cases": (many, (DUTY, TIME, OPEN, 12.0 + DUTY, 0.01 * DUTY)),
    "signals.even_grid.even_step": (even_step, (TIME,)),
    **{f"throttle.DemandChain.{name}": (getattr(CHAIN, name), (OPEN,)) for name in ("area_mm2", "angle_of_area_deg")},
    **{
        f"throttle.DemandChain.{name}": (getattr(CHAIN, name), (OPEN, 20.0 + OPEN))
        for name in (
            "air_g_per_s", "torque_nm", "pressure_kpa", "cylinder_g_per_s", "throttle_g_per_s", "opening_deg",
            "steady_kpa",
        )
    },
    "throttle.PedalMap": (pedals, (np.array([0.0, 100.0]), np.array([1e3, 3e3, 6e3]), OPEN)),
    "throttle.PedalMap.torque_nm": (CHAIN.pedal_map.torque_nm, (OPEN, 2000.0 + OPEN)),
    "throttle.airflow_torque_nm": (lambda a: airflow_torque_nm(throttle.Throttle(), a), (OPEN,)),
    "identify.FirstPrincipleModel.simulate": (run(GROUPS), (TIME, DUTY)),
    "identify.FirstPrincipleModel.predict": (ahead(GROUPS), (TIME, DUTY, ANGLE)),
    "identify.OdeModel.simulate": (ode, (TIME, DUTY, np.array([8.0]))),
    "throttle.PseudoWiener.simulate": (run(MODEL), (TIME, DUTY)),
    "throttle.PseudoWiener.predict": (ahead(MODEL), (TIME, DUTY, ANGLE)),
    "io.pressure_checks.check_trace": (check_trace, (CRANK, BAR)),
    "rig.RealtimeLoop.queue_references": (queued, (OPEN,)),
    "rig.RigRecord.from_columns": (exchanged, (np.array([0.0, 0.3, 41.5]),)),
    "signals.residual_tests": (lambda e, u: residual_tests(e, u).share_white, (NOISE, DUTY)),
    "signals.rmse": (rmse, (ANGLE, ANGLE + NOISE)),
    "signals.vaf_percent": (vaf_percent, (ANGLE, ANGLE + NOISE)),
    "signals.metrics.mse": (mse, (ANGLE, ANGLE + NOISE)),
}  # fmt: skip
