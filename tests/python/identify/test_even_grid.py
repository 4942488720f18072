"""One definition of evenly sampled, and everything that needs even times uses it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from mgdd import identify
from mgdd.errors import DataError, ShapeError
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.identify.throttle.validation import n_step_rms
from mgdd.io import throttle_log
from mgdd.optimize import FitOptions
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import check_count, common_step, even_step
from mgdd.throttle import PseudoWiener, SensorPair, Throttle, simulate_throttle
from mgdd_studies.benchmarks.drive_axis import drive_inverse_dynamics
from mgdd_studies.benchmarks.two_tanks import fit_two_tanks
from mgdd_studies.benchmarks.wiener_hammerstein import fit_linear

STEP = 1e-3
ONCE = FitOptions(n_starts=1, max_iterations=1)
EVEN = STEP * np.arange(1200)
MODEL = PseudoWiener("pw_r")
DUTY = 0.15 + 0.2 * np.sin(2.0 * np.pi * EVEN * (0.5 + 2.0 * EVEN))
GAPPED = np.delete(np.append(EVEN, EVEN[-1] + STEP), 600)
ANGLE = MODEL.simulate({"time_s": EVEN, "duty": DUTY})["angle_deg"].to_numpy()


def jittered(share: float) -> np.ndarray[Any, Any]:
    """Every second sample late: neighbouring steps are longer and shorter than the mean by this share of it."""
    time = EVEN.copy()
    time[1:-1:2] += share * STEP
    return time


def log(time: np.ndarray[Any, Any]) -> xr.Dataset:
    return labelled_dataset({"time_s": ("time_s", time), "duty": ("time_s", DUTY), "angle_deg": ("time_s", ANGLE)})


def drive(time: np.ndarray[Any, Any]) -> object:
    position = 0.01 * np.sin(6.0 * EVEN)
    record = {
        "time_s": ("time_s", time),
        "drive_v": ("time_s", DUTY, "V", "voltage"),
        "position_m": ("time_s", position, "m", "position"),
        "force_n_per_v": ((), 35.0, "N/V", "force per volt"),
    }
    return drive_inverse_dynamics(labelled_dataset(record))


def tanks(time: np.ndarray[Any, Any]) -> object:
    level = 5.0 + np.sin(3.0 * EVEN)
    record = {"pump_v": ("time_s", DUTY + 3.0, "V", "pump"), "level_v": ("time_s", level, "V", "level")}
    slow = 4.0 / STEP * time  # the tanks are sampled every 4 s
    return fit_two_tanks(labelled_dataset({"time_s": ("time_s", slow), **record}), options=ONCE)


def circuit(time: np.ndarray[Any, Any]) -> object:
    signal = np.random.default_rng(0).standard_normal((2, time.size))
    output = lfilter([0.1], [1.0, -0.9], signal[0]) + 0.01 * signal[1]
    record = {"input_v": ("time_s", signal[0], "V", "input"), "output_v": ("time_s", output, "V", "output")}
    return fit_linear(labelled_dataset({"time_s": ("time_s", time), **record}), order=1, iterations=1)


LAG = identify.OdeModel(
    derivative=lambda _, x, u, p: (p[0] * u[0] - x) / p[1], parameters={"gain": 1.0, "lag_s": 0.1},
    initial_state=(8.0,), input_names=("duty",), output_names=("angle_deg",),
)  # fmt: skip
USERS: dict[str, Callable[[np.ndarray[Any, Any]], object]] = {
    "throttle_log": lambda time: throttle_log(time, DUTY, ANGLE),
    "simulate": lambda time: simulate_throttle(Throttle(), DUTY, time_s=time),
    "sense": lambda time: SensorPair().sense(log(time)),
    "pseudo-Wiener run": lambda time: MODEL.simulate(log(time)),
    "pseudo-Wiener prediction": lambda time: MODEL.predict(log(time), 5),
    "first-principle run": lambda time: FirstPrincipleModel().simulate(log(time)),
    "fit_pseudo_wiener": lambda time: fit_pseudo_wiener(log(time), start_values=MODEL, options=ONCE),
    "identify_throttle": lambda time: identify.identify_throttle(log(time), options=FitOptions(n_starts=1)),
    "validate_throttle": lambda time: identify.validate_throttle(MODEL, log(time)),
    "n_step_rms": lambda time: n_step_rms(MODEL, log(time)),
    "check_excitation": lambda time: identify.check_excitation(
        log(time), lambda _, duty, __: 30.0 + 100.0 * np.asarray(duty)
    ),
    "fit_model": lambda time: identify.fit_model(LAG, log(time), options=ONCE),
    "drive": drive,
    "tanks": tanks,
    "circuit": circuit,
}  # fmt: skip


@pytest.mark.parametrize("user", USERS)
def test_all_accept_the_same_jitter(user: str) -> None:
    assert USERS[user](jittered(0.09)) is not None


@pytest.mark.parametrize("user", USERS)
@pytest.mark.parametrize("time", [jittered(0.15), GAPPED], ids=["jitter", "gap"])
def test_all_refuse_the_same_times(user: str, time: np.ndarray[Any, Any]) -> None:
    with pytest.raises(DataError, match=r"uneven sampling|gap from"):
        USERS[user](time)
    USERS[user](EVEN)  # a refused call changes nothing


@given(st.integers(2, 3000), st.floats(1e-6, 10.0), st.floats(-1e3, 1e3))
def test_the_step_of_an_even_grid_is_found(n: int, step: float, start: float) -> None:
    found = even_step(start + step * np.arange(n))
    assert found == pytest.approx(step, rel=1e-6, abs=2e-13 * (1.0 + abs(start) / n) + 1e-6 / (n - 1))


@pytest.mark.parametrize("step", [1e-4, 1e-3, 0.0125])
def test_six_digits_mean_the_step_they_were_written_with(step: float) -> None:
    written = np.array([float(f"{k * step + 0.1234567:.6f}") for k in range(1001)])
    assert even_step(written) == step


def test_a_rate_without_a_decimal_step_is_not_rounded() -> None:
    time = np.arange(100_000) / 51_200.0
    assert even_step(time) == pytest.approx(1.0 / 51_200.0, rel=1e-12)
    third = np.arange(4000) / 3000.0
    assert (
        simulate_throttle(Throttle(), np.full(4000, 0.2), time_s=third, step_s=1.0 / 9000.0)["angle_deg"].size == 4000
    )


def test_slow_drift_of_the_clock_is_uneven_too() -> None:
    time = EVEN * (1.0 + 1e-3 * np.sin(np.pi * EVEN / EVEN[-1]))
    with pytest.raises(DataError, match=r"time_s, sample 7\d\d: uneven sampling"):
        even_step(time)


def test_messages_name_the_sample() -> None:
    with pytest.raises(ShapeError, match=r"time_s has shape \(1,\)"):
        even_step([0.0])
    with pytest.raises(DataError, match="time_s, sample 2: time is not finite"):
        even_step([0.0, 1.0, np.nan])
    with pytest.raises(DataError, match=r"row 2: 0\.5 s does not exceed the time before, 1 s"):
        even_step([0.0, 1.0, 0.5], where="row {}".format)
    with pytest.raises(DataError, match=r"pass step_s=0\.17 to resample"):
        even_step([0.0, 0.1, 0.34], remedy="pass step_s={step:g} to resample")
    with pytest.raises(DataError, match=r"b is sampled every 0\.2 s, a every 0\.1 s"):
        common_step([[0.0, 0.1], [0.0, 0.2]], ["a", "b"])
    with pytest.raises(DataError, match="cycle 5 follows 3: must count up by one"):
        check_count([2, 3, 5])


def test_no_other_module_judges_a_step(root: Path) -> None:
    """Differences of a time column, and their comparison, stand in one place."""
    package = root / "python"
    judged = re.compile(r"np\.diff\((time|times|cycle|t)\b|1e-3 \* (steps|step|dt_s|sample)\b|JITTER\s*=")
    found = {
        str(path.relative_to(package))
        for path in package.rglob("*.py")
        if judged.search(path.read_text(encoding="utf-8"))
    }
    # The log's own checks tell fall, repeat and gap.
    assert found == {"mgdd/io/throttle_checks.py", "mgdd/signals/even_grid.py"}
