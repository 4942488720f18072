"""The contenders of `benchmarks/sweep_speed.py` solve the package's cycle, and its verdicts follow the figures."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from mgdd import _core

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
# On the grid, just beside it, between; first and last of the range.
TIMINGS = np.array([-20.0, -13.0 - 1e-9, -6.0, -5.37, 0.0, 4.5, 11.0])


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import a module below `benchmarks` as its scripts do."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module


@pytest.fixture
def cases(load: Any) -> dict[str, np.ndarray]:
    """Timings of one point, and points in which everything differs."""
    module = load("peers.cycle_cases")
    sweep = module.timing_sweep(_core.engine.OperatingPoint(), TIMINGS.size)
    sweep[:, 4] = TIMINGS
    return {"sweep": sweep, "points": module.arbitrary_points(engine(module), 40)}


def engine(module: ModuleType) -> Any:
    return module.engine_of(_core.engine.Cylinder())


def expected(rows: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Figures of the scalar core, case by case, without the helpers of the benchmark."""
    out = []
    for speed, fuel, pressure, temperature, soc in rows:
        point = _core.engine.OperatingPoint(
            speed_rpm=speed, fuel_mg=fuel, intake_pressure_kpa=pressure, intake_temperature_k=temperature
        )
        run = _core.engine.simulate(_core.engine.Cylinder(), point, soc, 1.0, "trapezoid")["indicators"]
        out.append([run[name] for name in names])
    return np.array(out)


@pytest.mark.parametrize(("task", "tolerance"), [("sweep", 1e-6), ("points", 1e-9)])
def test_our_call_hands_over_what_varies(load: Any, cases: dict[str, np.ndarray], task: str, tolerance: float) -> None:
    ours = load("peers.cycle_contenders").batch(threads=1, tolerance=tolerance)
    figures = ours.rows(ours.ready(cases[task])())
    wanted = expected(cases[task], load("peers.cycle_cases").FIGURES)
    np.testing.assert_allclose(figures, wanted, rtol=tolerance, atol=tolerance)


def test_a_contender_with_other_figures_is_not_timed(load: Any, cases: dict[str, np.ndarray]) -> None:
    script, module = load("sweep_speed"), load("peers.cycle_contenders")
    wanted = module.reference(cases["points"])
    wrong = wanted.copy()
    wrong[3, 1] *= 1 + 2e-9
    found = {"honest": module.takes_cases(lambda _: wanted), "wrong": module.takes_cases(lambda _: wrong)}
    assert script.check_agreement({"honest": found["honest"]}, cases["points"], wanted)[0] == {"honest": 0.0}
    with pytest.raises(
        SystemExit, match=r"wrong and the scalar core differ by 2\.0e-09 .* in imep_gross_bar of case 3"
    ):
        script.check_agreement(found, cases["points"], wanted)


def test_physics_that_the_contenders_do_not_share_are_refused(load: Any) -> None:
    module = load("peers.cycle_cases")
    with pytest.raises(ValueError, match="burn_shape = wiebe"):
        module.engine_of(_core.engine.Cylinder(burn_shape="wiebe"))
    with pytest.raises(ValueError, match="whole steps"):
        module.engine_of(_core.engine.Cylinder(evo_cad=130.5))


def test_bars_compare_with_the_fastest_form(load: Any) -> None:
    """5 M cycles/s at the minimum, 4 M at the median; the fastest JAX form is 11 times slower."""
    report = load("support.sweep_report")
    times = {"ours": [0.25, 0.2, 0.3], "literal": [9.0, 8.0], "JAX 64": [9.0], "JAX 4096": [2.2]}
    rows = report.rows_of(times, dict.fromkeys(times, 0.0), dict.fromkeys(times, 0.0))
    bars = report.bars({"timing sweep": rows}, ours="ours", literal="literal", jax="JAX", numba="Numba")
    assert [bar["verdict"] for bar in bars] == ["met", "met", "NOT MET", "not measured"]
    assert [bar["what"] for bar in bars][2] == "times faster than JAX 4096"
    assert [bar["at_min"] for bar in bars] == [pytest.approx(5e6), pytest.approx(40.0), pytest.approx(11.0), None]
    assert bars[0]["at_median"] == pytest.approx(4e6)
