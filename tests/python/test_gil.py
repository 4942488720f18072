"""Every batch call of the core lets other threads run: a second thread makes progress while it computes."""

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from mgdd import _core, presets
from mgdd.engine import Cylinder, NoxProxy, OperatingPoint
from mgdd.loop import VirtualEngine, monte_carlo, run_seeker
from mgdd.optimize import ExtremumSeeking, IterativeLearning

Call = Callable[[], Any]
CALLS: dict[str, Callable[[], Call]] = {}  # by name, what makes the inputs and returns the call

MANY, SOME = 2_000_000, 200_000
CYLINDER, POINT, THROTTLE = Cylinder(), OperatingPoint(), presets.load("P1").throttle
ANGLE = np.linspace(-140.0, 140.0, MANY)
DUTY = 0.3 + 0.2 * np.sin(0.01 * np.arange(SOME))
NONE = np.empty(0)
RUN = {"sample_s": 1e-3, "bridge": "brake", "supply_v": NONE, "airflow_torque_nm": NONE, "step_s": 1e-4}
FREE = ["gain_deg_per_s2_per_duty", "preload_duty"]


def batch(make: Callable[[], Call]) -> Callable[[], Call]:
    CALLS[make.__name__] = make
    return make


def seeker() -> ExtremumSeeking:
    return ExtremumSeeking(start=-12.0, bounds=(-30.0, 10.0))


def pseudo_wiener() -> Any:
    return _core.throttle.PseudoWienerModel("pw_r", {})


@batch
def bench() -> Call:
    return partial(VirtualEngine().run_columns, np.full(20_000, -6.0))


@batch
def loop() -> Call:
    return partial(run_seeker, VirtualEngine(), seeker(), 20_000)


@batch
def many_loops() -> Call:
    return partial(monte_carlo, VirtualEngine(), seeker(), range(20), cycles=1000)


@batch
def scan() -> Call:
    return partial(_core.engine.scan, CYLINDER, POINT, np.full(20_000, -6.0), 1.0, "trapezoid")


@batch
def cycle() -> Call:
    return partial(_core.engine.simulate, CYLINDER, POINT, -6.0, 0.001, "trapezoid")


@batch
def sensitivities() -> Call:
    names = _core.engine.differentiable_inputs()[:12]
    return partial(_core.engine.sensitivities, CYLINDER, POINT, -6.0, names, 0.005, "trapezoid")


@batch
def convergence() -> Call:
    return partial(_core.engine.convergence, CYLINDER, POINT, -6.0, 0.004, "trapezoid")


@batch
def volume() -> Call:
    return partial(_core.engine.volume_l, CYLINDER, ANGLE)


@batch
def wall_area() -> Call:
    return partial(_core.engine.wall_area_m2, CYLINDER, ANGLE)


@batch
def burned_fraction() -> Call:
    return partial(_core.engine.burned_fraction, CYLINDER, ANGLE, -6.0, 40.0)


@batch
def ignition_delay() -> Call:
    return partial(_core.engine.watson_delay_ms, 60.0, np.full(MANY, 900.0))


@batch
def film_coefficient() -> Call:
    return partial(_core.engine.woschni_coefficient, 3.26, 0.086, np.full(MANY, 80.0), 1700.0, 10.0)


@batch
def nox() -> Call:
    return partial(NoxProxy().arrhenius_ppm, np.full(MANY, 1900.0))


@batch
def nox_fit() -> Call:
    t = np.linspace(1700.0, 2100.0, MANY)
    return partial(_core.engine.fit_nox_proxy, t, NoxProxy().arrhenius_ppm(t), "arrhenius", 1900.0)


@batch
def trace_check() -> Call:
    return partial(_core.engine.check_trace, ANGLE, 20.0 + np.sin(0.01 * ANGLE))


@batch
def trace_analysis() -> Call:
    angle = np.linspace(-139.0, 100.0, SOME)
    pressure = 1.0 + 50.0 * np.exp(-((angle - 5.0) ** 2) / 800.0)
    return partial(_core.engine.analyze, angle, pressure, CYLINDER, POINT, _core.engine.TraceOptions())


@batch
def trace_cycles() -> Call:
    angle = np.linspace(-139.0, 100.0, 5_000)
    pressure = 1.0 + 50.0 * np.exp(-((angle - 5.0) ** 2) / 800.0)
    records = np.tile(pressure, (40, 1))
    return partial(_core.engine.analyze_cycles, angle, records, CYLINDER, POINT, _core.engine.TraceOptions(), 1)


@batch
def learning() -> Call:
    learner = IterativeLearning(np.zeros(MANY), law="q_filter", k_p=0.5)

    def trial() -> None:
        learner.ask()
        learner.tell(np.ones(MANY))

    return trial


@batch
def learning_theory() -> Call:
    core = _core.optimize.IterativeLearning(
        np.zeros(400), law="p", impulse_response=0.9 ** np.arange(400.0), learning_function=NONE, k_p=0.5
    )
    return core.convergence


@batch
def update_by_least_squares() -> Call:
    update = _core.identify.RecursivePwR(
        pseudo_wiener().parameters, free=FREE, every=5, noise_deg=0.03, forgetting=0.998
    )
    return partial(update.update, np.tile(DUTY, 5), np.tile(pseudo_wiener().simulate(DUTY, 10.0), 5))


@batch
def update_by_window() -> Call:
    parameters = pseudo_wiener().parameters
    update = _core.identify.WindowPwR(
        parameters, free=FREE, every=5, noise_deg=0.03, prior_spread=0.2, iterate_every=500
    )
    return partial(update.update, DUTY, pseudo_wiener().simulate(DUTY, 10.0))


@batch
def update_by_gradient() -> Call:
    update = _core.identify.GradientPwR(pseudo_wiener().parameters, free=FREE, adaptation_gain=0.05, noise_deg=0.03)
    return partial(update.update, DUTY[:30_000], pseudo_wiener().simulate(DUTY[:30_000], 10.0))


@batch
def pseudo_wiener_free_run() -> Call:
    return partial(pseudo_wiener().simulate, DUTY, 10.0)


@batch
def pseudo_wiener_prediction() -> Call:
    return partial(pseudo_wiener().predict, DUTY[:20_000], DUTY[:20_000], 20)


@batch
def pseudo_wiener_slopes() -> Call:
    return partial(pseudo_wiener().slopes, DUTY[:600], start_deg=10.0)


@batch
def pseudo_wiener_fit() -> Call:
    angle = pseudo_wiener().simulate(DUTY[:20_000], 10.0)
    return partial(
        _core.identify.fit_pseudo_wiener, kind="pw_r", records=[(DUTY[:20_000], angle)], parameters={}, sides="shared",
        free=[], delays=[0], starts=2, seed=1, only_given_start=False, try_map_start=False, max_iterations=20,
    )  # fmt: skip


@batch
def throttle() -> Call:
    return partial(_core.throttle.simulate, THROTTLE, DUTY, start_deg=10.0, **RUN)


@batch
def throttles() -> Call:
    return partial(_core.throttle.simulate_many, [THROTTLE] * 8, DUTY[:20_000], start_deg=[10.0] * 8, **RUN)


@batch
def air_torque() -> Call:
    return partial(_core.throttle.airflow_torque, THROTTLE, np.linspace(5.0, 80.0, MANY))


@batch
def sensors() -> Call:
    angle, faults = np.full(SOME, 10.0), [("none", 0.0, 0.0, None)] * 2
    return partial(_core.throttle.sense, _core.throttle.SensorPair(), angle, sample_s=1e-3, seed=1, faults=faults)


@batch
def throttle_groups() -> Call:
    values = [0.5 * (bound.lower + bound.upper) for bound in _core.identify.throttle_group_bounds()]
    frame = {"closed_deg": 0.0, "open_deg": 90.0, "substeps": 2}
    return partial(_core.identify.simulate_throttle_groups, values, DUTY, step_s=1e-3, start=[10.0, 0.0, 0.0], **frame)


@batch
def latin_hypercube() -> Call:
    return partial(_core.optimize.latin_hypercube, _core.identify.throttle_group_bounds(), 50_000, 1)


def steps_meanwhile(call: Call) -> tuple[int, float]:
    """How often another thread got on while the call ran, and how long that took [s]."""
    ticks, stop = [], threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-4)

    thread = threading.Thread(target=tick)
    thread.start()
    time.sleep(0.01)
    began = time.perf_counter()
    call()
    ended = time.perf_counter()
    stop.set()
    thread.join()
    return sum(began < t < ended for t in ticks), ended - began


@pytest.mark.parametrize("name", CALLS)
def test_another_thread_makes_progress(name: str) -> None:
    call, seen = CALLS[name](), []
    while len(seen) < 100:  # a busy machine may not let the other thread run at all for a while
        seen.append(steps_meanwhile(call))
        if seen[-1][0] >= 5:
            break
    assert seen[-1][0] >= 5, f"steps of the other thread and seconds of the call: {seen[:4]}"
