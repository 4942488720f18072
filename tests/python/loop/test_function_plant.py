"""A compiled function as a plant: the bits of the same function in Python, in loops of the core."""

import copy
import ctypes
import math
import os
import pickle
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.python.support.stepped import stepped

from mgdd import optimize
from mgdd.errors import Interrupted, ParameterError, RigError
from mgdd.guide import FeedForward
from mgdd.loop import FunctionPlant, LoopCriteria, VirtualEngine, monte_carlo, run_seeker, seek, seek_front

SOURCE = r"""
#include <math.h>
#include <stddef.h>
/* J = 50 - bend (x - best)^2, limit = 90 - 2 x; fails above 8; with data {bend, best} */
int plant(const double *in, size_t n, double *out, size_t m, void *data) {
  const double *set = (const double *)data;
  double bend = set ? set[0] : 0.03, best = set ? set[1] : -4.0, away = in[0] - best;
  out[0] = 50.0 - bend * away * away;
  if (n > 1) out[0] -= 300.0 * (in[1] - 0.15) * (in[1] - 0.15);
  if (m > 1) out[1] = 90.0 - 2.0 * in[0];
  return in[0] > 8.0 ? 7 : 0;
}
int not_a_number(const double *in, size_t n, double *out, size_t m, void *data) {
  out[0] = in[0] > -5.0 ? NAN : in[0];
  return 0;
}
int unwritten(const double *in, size_t n, double *out, size_t m, void *data) { return 0; }
int overload(const double *in, size_t n, double *out, size_t m, void *data) { out[0] = 9.9e37; return 0; }
int two(const double *in, size_t n, double *out, size_t m, void *data) {
  out[0] = in[0] * in[0]; out[1] = (in[0] - 3.0) * (in[0] - 3.0); return 0;
}
int slow(const double *in, size_t n, double *out, size_t m, void *data) {
  double sum = 0.0;
  for (int k = 1; k < 200000; ++k) sum += sqrt((double)k);
  out[0] = -in[0] * in[0] + 0.0 * sum;
  return 0;
}
"""
SPACE = {"start": -12.0, "bounds": (-30.0, 10.0)}
CAPS = [optimize.Limit("p_max_bar", 95.0)]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    folder = tmp_path_factory.mktemp("plant")
    (folder / "plant.c").write_text(SOURCE, encoding="utf-8")
    command = [compiler, "-shared", "-fPIC", "-O2", "-ffp-contract=off", "plant.c", "-o", "plant.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(Path(folder) / "plant.so"))


def of(library: ctypes.CDLL, name: str = "plant", inputs: Any = ("soc_cad",), limits: Any = (), **more: Any) -> Any:
    return FunctionPlant(FunctionPlant.C_TYPE((name, library)), inputs, limits, **more)


def in_python(inputs: Any = ("soc_cad",), limits: Any = (), **more: Any) -> FunctionPlant:
    """The same arithmetic as in C, in the same order."""

    def plant(x: dict[str, float]) -> Any:
        first, *rest = (x[name] for name in inputs)
        if first > 8.0:
            return None
        j = 50.0 - 0.03 * (first + 4.0) * (first + 4.0)
        for other in rest:
            j -= 300.0 * (other - 0.15) * (other - 0.15)
        return (j, dict.fromkeys(limits, 90.0 - 2.0 * first)) if limits else j

    return FunctionPlant(plant, inputs, limits, **more)


SEEKERS = stepped(**SPACE)


@pytest.mark.parametrize("kind", SEEKERS)
def test_compiled_and_python_have_the_same_bits(library: ctypes.CDLL, kind: str) -> None:
    goal = LoopCriteria(optimum=-4.0)
    fast, slow = (SEEKERS[kind](), SEEKERS[kind]())
    plants = of(library, noise_sd=0.2, seed=3), in_python(noise_sd=0.2, seed=3)
    for cycles in (70, 50):  # the second run goes on
        runs = [run_seeker(p, s, cycles, criteria=goal) for p, s in zip(plants, (fast, slow), strict=True)]
        xr.testing.assert_identical(runs[0].dataset, runs[1].dataset)
        assert str(runs[0].summary) == str(runs[1].summary)
        assert runs[0].findings == runs[1].findings
    xr.testing.assert_identical(fast.history, slow.history)
    assert fast.state == slow.state
    assert plants[0].cycle == plants[1].cycle == 120


@pytest.mark.parametrize("named", [False, True])
def test_several_inputs_and_limits_too(library: ctypes.CDLL, named: bool) -> None:
    names = ("x", "egr")
    if named:
        given = {"inputs": {"x": (-30.0, 20.0), "egr": (0.0, 0.4)}, "start": {"x": -9.0, "egr": 0.05}}
    else:
        given = {"start": [-9.0, 0.05], "bounds": ([-30.0, 0.0], [20.0, 0.4])}
    runs = [
        run_seeker(make(names, ("p_max_bar",)), optimize.GaussianProcessSeeking(**given, limits=CAPS, seed=1), 60)
        for make in (lambda *a: of(library, "plant", *a), in_python)
    ]
    xr.testing.assert_identical(runs[0].dataset, runs[1].dataset)
    assert runs[0].dataset["limits"].shape == (60, 1)
    assert str(runs[0].summary) == str(runs[1].summary)


def test_what_the_core_cannot_match_runs_from_python(library: ctypes.CDLL) -> None:
    """A limit that the seeker does not keep, and inputs in another order."""
    free = [
        run_seeker(p, SEEKERS["Spsa first_order"](), 40) for p in (of(library, limits=["q"]), in_python(limits=["q"]))
    ]
    xr.testing.assert_identical(free[0].dataset, free[1].dataset)
    assert np.isfinite(free[0].dataset["limits"]).all()
    turned = {"inputs": {"egr": (0.0, 0.4), "x": (-30.0, 20.0)}, "start": {"x": -9.0, "egr": 0.05}}
    runs = [
        run_seeker(p, optimize.GaussianProcessSeeking(**turned), 30)
        for p in (of(library, inputs=("x", "egr")), in_python(("x", "egr")))
    ]
    xr.testing.assert_identical(runs[0].dataset, runs[1].dataset)
    assert runs[0].dataset["asked"].sel(input="x").min() < -1.0


def test_a_failed_cycle_is_a_misfire(library: ctypes.CDLL) -> None:
    late = {"start": 6.0, "bounds": (-30.0, 30.0)}
    runs = [run_seeker(p, optimize.ExtremumSeeking(**late, amplitude=4.0), 200) for p in (of(library), in_python())]
    xr.testing.assert_identical(runs[0].dataset, runs[1].dataset)
    assert runs[0].summary["misfires"] > 0
    for name in ("unwritten", "overload"):
        run = run_seeker(of(library, name), SEEKERS["Spsa first_order"](), 9)
        assert run.summary["misfires"] == 9
        assert math.isnan(run.dataset["j"][0])
    half = run_seeker(of(library, "not_a_number"), optimize.ExtremumSeeking(start=-5.0, bounds=(-9.0, 0.0)), 50)
    assert 0 < half.summary["misfires"] < 50


def test_seek_takes_one(library: ctypes.CDLL) -> None:
    bounds = {"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}
    found = seek(FunctionPlant.C_TYPE(("plant", library)), bounds, cycles=40, limits={"p_max_bar": 120.0})
    twin = seek(in_python(tuple(bounds), ("p_max_bar",)), bounds, cycles=40, limits={"p_max_bar": 120.0})
    assert found.inputs == twin.inputs
    assert found.inputs["soc_cad"] == pytest.approx(-4.0, abs=0.5)
    front = seek_front(
        FunctionPlant.C_TYPE(("two", library)), {"x": (-1.0, 4.0)}, {"a": "min", "b": "min"}, cycles=30, n_points=5
    )
    ends = front.dataset["inputs"].sel(input="x").to_numpy()[[0, -1]]
    assert ends == pytest.approx([0.0, 3.0], abs=0.3)


# --- many loops ---------------------------------------------------------------------------------------------
def test_many_loops_have_the_numbers_of_run_seeker(library: ctypes.CDLL) -> None:
    seekers = [
        SEEKERS["ExtremumSeeking batch"](),
        optimize.Spsa(**SPACE, seed=5),
        FeedForward(SEEKERS["GradientDescent"]()),
    ]
    data = np.array([0.05, -7.0])
    plants = [of(library, noise_sd=0.2), of(library, noise_sd=0.1, user_data=data)]
    goal = LoopCriteria(optimum=-4.0)

    def loops(**how: Any) -> xr.Dataset:
        return monte_carlo(plants, seekers, [4, 5, 9], cycles=150, criteria=goal, **how)

    table = loops(workers=1)
    xr.testing.assert_identical(table, loops(workers=2))
    xr.testing.assert_identical(table, loops(progress=lambda *_: None))
    xr.testing.assert_identical(table, loops(executor=ThreadPoolExecutor))
    assert plants[0].cycle == 0
    for b, more in enumerate(({"noise_sd": 0.2}, {"noise_sd": 0.1, "user_data": data})):
        for s in (0, 1, 2):
            alone = run_seeker(of(library, seed=5, **more), copy.deepcopy(seekers[s]), 150, criteria=goal)
            for name, value in alone.summary.items():
                if name in table:
                    one = float(table[name][b, s, 1])
                    assert one == pytest.approx(value, rel=1e-13, abs=1e-12, nan_ok=True), name
    assert "mean_nox_ppm" not in table
    assert float(table["mean_j"][0, 0, 0]) != float(table["mean_j"][0, 0, 1])


def test_figures_of_an_input_that_is_no_angle_are_in_its_unit(library: ctypes.CDLL) -> None:
    table = monte_carlo(of(library, inputs=["x"]), SEEKERS["CurveSeeking"](), range(3), cycles=60)
    assert table["final_x"].to_numpy() == pytest.approx(-4.0, abs=0.1)
    assert table["final_x"].attrs["long_name"] == "mean estimate of the last cycles"
    assert not [name for name in table if str(name).endswith("_cad")]


# --- what it may be -----------------------------------------------------------------------------------------
def test_every_form_is_the_same_function(library: ctypes.CDLL) -> None:
    declared = library.plant
    declared.argtypes, declared.restype = FunctionPlant.C_TYPE._argtypes_, ctypes.c_int
    address = ctypes.cast(declared, ctypes.c_void_p).value
    data = (ctypes.c_double * 2)(0.05, -7.0)
    pointer = ctypes.cast(data, ctypes.c_void_p)
    for function, more in (
        (declared, {"user_data": data}),
        (address, {"user_data": np.array([0.05, -7.0])}),
        (np.uint64(address), {"user_data": pointer.value}),
        (SimpleNamespace(address=address, ctypes=declared), {"user_data": data}),  # as a function of Numba
    ):
        plant = FunctionPlant(function, ["x"], **more)
        plant.apply({"x": -5.0})
        assert plant.measure().performance == 50.0 - 0.05 * 2.0 * 2.0


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_callback_into_python_is_kept_alive_and_may_fail() -> None:
    def plant() -> FunctionPlant:
        def called(x: Any, n: int, out: Any, m: int, data: Any) -> int:  # noqa: ARG001
            if x[0] < -12.5:
                raise ValueError("not there")
            out[0] = 50.0 - 0.03 * (x[0] + 4.0) * (x[0] + 4.0)
            return 0

        return FunctionPlant(FunctionPlant.C_TYPE(called), ["soc_cad"])

    run = run_seeker(plant(), SEEKERS["ExtremumSeeking batch"](), 80)
    good = ~run.dataset["misfire"].to_numpy()
    assert 0 < good.sum() < 80
    assert (run.dataset["applied"][:, 0].to_numpy()[good] >= -12.5).all()
    table = monte_carlo(plant(), SEEKERS["Spsa first_order"](), range(4), cycles=30, workers=2)
    assert bool(table["finished"].all())


def test_what_is_not_one_is_refused_by_name(library: ctypes.CDLL) -> None:
    wrong = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(("plant", library))
    single = list(FunctionPlant.C_TYPE._argtypes_)
    single[2] = ctypes.POINTER(ctypes.c_float)
    for function, message in (
        (0, "function = 0: must be the address of a function, not null"),
        (FunctionPlant.C_TYPE(), "not null"),
        (wrong, r"its signature is c_double \(c_double\): must be int \(const double \*inputs"),
        (ctypes.CFUNCTYPE(ctypes.c_int, *single)(("plant", library)), r"LP_c_float, c_\w+, c_void_p\): must be int"),
        (ctypes.CDLL(None).printf, "argtypes are not declared"),
        (-4, "function = -4"),
        (True, "function = True: must be a function of the inputs by name"),
        ("plant", "function = 'plant'"),
    ):
        with pytest.raises(ParameterError, match=message):
            FunctionPlant(function, ["x"])
    for change, message in (
        ({"noise_sd": -1.0}, "noise_sd = -1: must be finite and >= 0"),
        ({"seed": -1}, "seed = -1"),
        ({"inputs": "x"}, "inputs = 'x': must be a sequence of different names"),
        ({"limits": ["q", "q"]}, "limits = "),
        ({"inputs": []}, r"inputs = 0: must be in \[1, 8\]"),
        ({"limits": [f"q{k}" for k in range(9)]}, r"limits = 9: must be in \[0, 8\]"),
        ({"user_data": "text"}, "user_data = 'text'"),
        ({"user_data": np.zeros((4, 4))[:, 1]}, "user_data"),
        ({"values": ["a"], "noise_sd": 1.0}, "noise_sd and values"),
    ):
        with pytest.raises(ParameterError, match=message):
            of(library, **change)
    with pytest.raises(ParameterError, match="user_data: goes to a compiled function"):
        FunctionPlant(lambda _: 0.0, ["x"], user_data=data_of_two())
    with pytest.raises(RigError, match="apply inputs first"):
        of(library).measure()


def data_of_two() -> np.ndarray[Any, Any]:
    return np.array([0.05, -7.0])


def test_loops_refuse_what_does_not_fit_and_nothing_has_moved(library: ctypes.CDLL) -> None:
    plant, seeker = of(library), SEEKERS["Spsa first_order"]()
    two = optimize.Spsa(start=[0.0, 0.0])
    guided = FeedForward(SEEKERS["Spsa first_order"](), lambda _: 0.0)
    for call in (run_seeker, lambda plant, seeker, cycles: monte_carlo(plant, seeker, [1], cycles=cycles)):
        for own, cycles, message in (
            (two, 5, "start has 2 entries"),
            (seeker, 0, "cycles = 0: must be >= 1"),
            (guided, 5, "plant has no point"),
            (optimize.Spsa(**SPACE, limits=CAPS), 5, "limits of the seeker"),
        ):
            with pytest.raises(ParameterError, match=message):
                call(plant, own, cycles)
    assert (plant.cycle, seeker.cycle) == (0, 0)
    for plants, message in (
        ([plant, VirtualEngine()], "one after the other"),
        (in_python(), "must be compiled and give J"),
        ([plant, of(library, inputs=["x"])], "the same inputs"),
    ):
        with pytest.raises(ParameterError, match=message):
            monte_carlo(plants, seeker, [1], cycles=5)


def test_copies_share_the_function_and_no_other_process_has_it(library: ctypes.CDLL) -> None:
    plant = of(library, noise_sd=0.3, seed=8)
    run_seeker(plant, SEEKERS["Spsa first_order"](), 7)
    twins = copy.copy(plant), copy.deepcopy(plant)
    for each in (plant, *twins):
        each.apply({"soc_cad": -3.0})
    assert len({each.measure().performance for each in (plant, *twins)}) == 1
    assert twins[0].cycle == 8
    with pytest.raises(TypeError, match="works in this process only"):
        pickle.dumps(plant)
    with pytest.raises(ParameterError, match="this process only"):
        monte_carlo(plant, SEEKERS["Spsa first_order"](), range(4), cycles=5, executor=lambda: ProcessPoolExecutor(1))
    assert pickle.loads(pickle.dumps(FunctionPlant(math.hypot, ["x"]))).input_names == ("x",)


def test_ctrl_c_leaves_what_was_run(library: ctypes.CDLL) -> None:
    def interrupted(call: Callable[[], Any]) -> Any:
        timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(Interrupted) as stop:
            call()
        return stop.value.partial

    plant, seeker = of(library, "slow"), SEEKERS["Spsa first_order"]()
    run = interrupted(lambda: run_seeker(plant, seeker, 100_000))
    n = run.dataset.sizes["cycle"]
    assert run.interrupted
    assert 0 < n == plant.cycle == seeker.cycle < 100_000
    begun = run_seeker(of(library, "slow"), SEEKERS["Spsa first_order"](), n)
    np.testing.assert_array_equal(run.dataset["estimate"][:, 0], begun.dataset["estimate"][:, 0])
    assert run.summary["mean_j"] == begun.summary["mean_j"]
    table = interrupted(lambda: monte_carlo(plant, SEEKERS["Spsa first_order"](), range(3), cycles=100_000))
    assert not table["finished"].any()
    assert np.isnan(table["mean_j"]).all()
