"""First guesses of a newcomer: what works, and what the message of the others names; nothing is paid for it."""

import inspect
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes

import mgdd
from mgdd import (
    control,
    datasets,
    design,
    engine,
    identify,
    io,
    loop,
    maps,
    parallel,
    presets,
    signals,
    surrogate,
)
from mgdd import sweep as sweep_module
from mgdd import throttle as throttle_module
from mgdd.errors import DataError, ParameterError
from public_objects import ROOMS

ENGINE = "puma_single"
POINTS = {"load_bar": [2.0, 4.0, 6.0, 8.0, 10.0], "nox_ppm": [210.0, 395.0, 610.0, 790.0, 1005.0]}


def untyped(room: Any, name: str) -> Any:
    return getattr(room, name)


GUESSES: dict[str, tuple[Callable[[], Any], str]] = {
    # A function that stands elsewhere, or has another name.
    "of the package": (lambda: untyped(mgdd, "find_optimum"), r"did you mean mgdd\.engine\.find_optimum\?"),
    "several places": (lambda: untyped(mgdd, "simulate"), r"mgdd\.engine\.simulate or mgdd\.throttle\.simulate_thr"),
    "reader of another library": (lambda: untyped(mgdd, "read_csv"), r"mgdd\.io\.read\?"),
    "class": (lambda: untyped(mgdd, "Spsa"), r"did you mean mgdd\.optimize\.Spsa\?"),
    "of another module": (lambda: untyped(engine, "seek_front"), r"did you mean mgdd\.loop\.seek_front\?"),
    "studies": (lambda: untyped(mgdd, "studies"), "did you mean the package mgdd_studies"),
    "load": (lambda: untyped(datasets, "open"), "did you mean 'read'"),
    "list": (lambda: untyped(presets, "ls"), "did you mean 'available'"),
    "by its form": (lambda: untyped(io, "load_csv"), "'read' or 'read_pressure' or 'read_throttle_log'"),
    "words turned": (lambda: untyped(identify, "throttle_fit"), "did you mean 'identify_throttle'"),
    "typing error": (lambda: untyped(maps, "CalibrationMpa"), "did you mean 'CalibrationMap'"),
    "nothing near": (lambda: untyped(design, "zzz"), "it has FeasibleRegion, design_points"),
    "import": (lambda: exec("from mgdd.engine import simulte"), "did you mean 'simulate'"),  # noqa: S102
    "module called": (untyped(mgdd, "engine"), r"mgdd\.engine is a module, of Cylinder"),
    # An argument that has another name, is missing, or belongs to a record.
    "unit alone": (lambda: engine.find_optimum(ENGINE, rpm=1500), "did you mean 'speed_rpm'"),
    "without unit": (lambda: engine.ignition_delay(ENGINE, soi=-12), "did you mean 'soi_cad'"),
    "count": (lambda: loop.run_seeker(None, None, num_cycles=9), "did you mean 'cycles'"),
    "field's word": (lambda: engine.timing_sweep(ENGINE, spark_timing=[1.0]), "did you mean 'soc_cad'"),
    "other library's word": (lambda: loop.seek(None, algorithm="spsa"), "did you mean 'seeker'"),
    "of the core": (lambda: control.Pid(ki=2.0), "'integral_above_per_deg_s' or 'integral_below_per_deg_s'"),
    "two for one": (lambda: control.Pid(range=(-1.0, 1.0)), "did you mean 'lower' or 'upper'"),
    "of a class": (lambda: loop.VirtualEngine(noise_seed=3), "has no argument 'noise_seed'"),
    "of the cylinder": (lambda: engine.simulate(ENGINE, evo_cad=120), r"setting \[°CA aTDC\] of the cylinder.*replace"),
    "of the point": (lambda: engine.simulate(ENGINE, intake_pressure_kpa=90), r"point=\{'intake_pressure_kpa'"),
    "of the throttle": (lambda: throttle_module.characteristics("P1", supply=9.0), "has no argument 'supply'"),
    "missing": (engine.timing_sweep, r"lacks cylinder \(As in `simulate`"),
    "missing first": (engine.simulate, r"lacks cylinder \(Cylinder, Preset, str or path-like"),
    "missing by keyword": (lambda: signals.prbs(3.0), r"lacks offset, amplitude \(float: Mean"),
    "missing of a class": (lambda: maps.CalibrationMap({"a": [1]}, [2]), r"lacks name \(str: What the values are"),
    "twice": (lambda: engine.simulate(ENGINE, cylinder=ENGINE), "got 'cylinder' twice"),
    "too many": (
        lambda: presets.load("P1", "throttle"),
        "takes 1 positional arguments, 2 were given; give kind by name",
    ),
    "order": (lambda: engine.analyze(ENGINE, xr.Dataset()), r"did you mean analyze\(trace, cylinder\) in this order"),
    "bench by its engine": (lambda: loop.seek(ENGINE, {"soc_cad": (-9.0, 9.0)}), r"as VirtualEngine\('puma_single'\)"),
    "input beside": (lambda: sweep_module.sweep(ENGINE, soc_cad=[1.0]), r"as \{'soc_cad': \["),  # type: ignore[arg-type]
    # A method that a result has not.
    "method": (lambda: engine.find_optimum(ENGINE).summarize(), "did you mean 'summary'"),  # type: ignore[attr-defined]
    "form of a file": (lambda: engine.simulate(ENGINE).save("run.csv"), r"path = 'run.csv': .*\.nc.*to_csv"),
    "no model file": (lambda: engine.find_optimum(ENGINE).save("best.toml"), r"path = 'best.toml': .*\.nc"),
}


@pytest.mark.parametrize("guess", GUESSES)
def test_a_wrong_guess_leads_to_the_right_name(guess: str) -> None:
    call, leads = GUESSES[guess]
    with pytest.raises((AttributeError, ImportError, TypeError, ParameterError), match=leads) as info:
        call()
    assert len(str(info.value)) < 400


RETURNED: dict[str, Callable[[], Any]] = {
    "simulate": lambda: engine.simulate(ENGINE),
    "analyze": lambda: engine.analyze(engine.simulate(ENGINE), ENGINE),
    "timing_sweep": lambda: engine.timing_sweep(ENGINE),
    "sweep of a line": lambda: untyped(mgdd, "sweep")(ENGINE, {"speed_rpm": [900.0, 1500.0, 2100.0]}),
    "sweep of a plane": lambda: sweep_module.sweep(ENGINE, {"speed_rpm": [900.0, 1500.0], "soc_cad": [-9.0, 0.0]}),
    "track": lambda: loop.track(control.Pid(), "step:20:60"),
    "simulate_throttle": lambda: throttle_module.simulate_throttle("P1", 0.3),
    "run of a bench": lambda: loop.VirtualEngine().run([-6.0] * 5),
    "one cycle of a bench": lambda: loop.VirtualEngine().run([-6.0]),
    "design": lambda: design.design_points({"fuel_mg": (6.0, 40.0)}, 8),
    "excitation": lambda: signals.chirp(5.0, offset=0.1, amplitude=0.1),
}


@pytest.mark.parametrize("name", RETURNED)
def test_data_have_a_summary_and_a_figure_and_stay_data(name: str, tmp_path: Path) -> None:
    data = RETURNED[name]()
    first = next(iter(data.data_vars))
    for own in (data, data.isel({}), data[[first]], pickle.loads(pickle.dumps(data))):
        assert isinstance(own, xr.Dataset)
        assert str(first) in own.summary()
        assert isinstance(own.plot(), Axes)
    assert str(float(f"{float(data[first].max()):.6g}")).removesuffix(".0") in data[[first]].summary()
    data.save(tmp_path / "data.nc")
    assert data.equals(xr.load_dataset(tmp_path / "data.nc"))


def test_every_dataset_is_made_in_one_place(root: Path) -> None:
    calls = re.compile(r"^(?!\s*(?:>>>|\.\.\.)).*\b(?:xr|xarray)\.(?:Dataset|merge)\(", re.MULTILINE)
    files = (root / "python" / "mgdd").rglob("*.py")
    made = {path.name for path in files if calls.search(path.read_text(encoding="utf-8"))}
    assert made == {"result.py"}  # which makes one of ours of what it merged


def test_a_fit_predicts_and_goes_through_a_file(tmp_path: Path) -> None:
    fit = surrogate.fit_response(POINTS, "nox_ppm", degree=1)
    file = tmp_path / "nox.toml"
    fit.save(file)
    line = np.polynomial.Polynomial.fit(POINTS["load_bar"], POINTS["nox_ppm"], 1)
    for own in (fit, surrogate.ResponseModel.load(file)):
        assert own.predict({"load_bar": [5.0]})["mean"].item() == pytest.approx(line(5.0))
    cylinder = identify.fit_cylinder(datasets.read("hd_diesel_128x144")[:1], "hd_diesel_128x144")
    with pytest.raises(DataError, match="has no predict: simulate it"):
        cylinder.predict({"soc_cad": [1.0]})


def test_an_optimum_is_drawn_over_the_timing_with_its_limit() -> None:
    best = engine.find_optimum(ENGINE, limits={"p_max_bar": 95.0})
    top, below = best.plot().figure.axes
    assert (top.get_ylabel(), below.get_xlabel()) == (
        "gross indicated efficiency [-]",
        "start of combustion [°CA aTDC]",
    )
    x, y = (line.get_xydata() for line in top.get_lines() if line.get_label() == "all timings").__next__().T
    at_limit = next(line for line in below.get_lines() if line.get_label() == "limit p_max_bar 95 bar")
    assert list(at_limit.get_ydata()) == [95.0, 95.0]
    assert y[np.abs(x - best["soc_cad"]).argmin()] == pytest.approx(best.value, abs=1e-3)
    assert "limits p_max_bar <= 95" in best.summary()
    assert "bounds soc_cad -30, 10" in best.summary()


@pytest.mark.parametrize("room", ROOMS)
def test_functions_stay_what_they_are(room: str) -> None:
    own = sys.modules[room]
    for name in own.__all__:
        thing = getattr(own, name)
        if inspect.isfunction(thing):
            assert pickle.loads(pickle.dumps(thing)) is thing
            assert (thing.__name__, bool(thing.__doc__)) == (name, True)
            assert inspect.signature(thing) == inspect.signature(inspect.unwrap(thing))


def test_an_error_from_inside_is_left_alone() -> None:
    def broken(_: float) -> float:
        raise TypeError("own trouble")

    with pytest.raises(TypeError, match=r"^own trouble$"):
        parallel.map_items(broken, [1.0])


def test_nothing_of_it_is_imported_before_a_guess() -> None:
    code = "import sys, mgdd, mgdd.engine; print([m for m in ('inspect', 'xarray', 'matplotlib') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "xarray" not in out
    assert "matplotlib" not in out
