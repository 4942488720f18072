"""A throttle in python-control: the same response as our own simulation, alone and in a loop."""

import builtins
from typing import Any

import control
import numpy as np
import pytest

from mgdd.errors import ParameterError
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.signals import amplitude_random_steps
from mgdd.throttle import PseudoWiener, Throttle, simulate_throttle, to_iosystem


@pytest.mark.parametrize(
    "throttle",
    [Throttle(), Throttle(inductance_mh=0.0, friction="lugre", stiction_nm=0.3), Throttle(backlash="compliance")],
    ids=["P1", "lugre", "backlash"],
)
def test_the_response_is_our_simulation(throttle: Throttle) -> None:
    signal = amplitude_random_steps(0.6, offset=0.1, amplitude=0.4, hold_s=0.05)
    time, duty = signal["time_s"].to_numpy(), signal["duty"].to_numpy()
    ours = simulate_throttle(throttle, duty, time_s=time, start_deg=20.0)["angle_deg"].to_numpy()
    system, start = to_iosystem(throttle, start_deg=20.0)
    response = control.input_output_response(system, time, duty, start)
    assert system.dt == 1e-3
    assert np.ptp(ours) > 5.0
    np.testing.assert_allclose(response.outputs, ours, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["pw_r", "pw_w", "pw_p"])
@pytest.mark.parametrize("delay", [0, 2])
def test_pseudo_wiener_models_respond_as_they_simulate(kind: str, delay: int) -> None:
    own = {
        "pw_r": {},
        "pw_w": {f"rise_{i}_deg": 12.0 for i in range(1, 7)},
        "pw_p": {"gain_1_deg_per_duty": 200.0, "radius_1_duty": 0.03},
    }[kind]
    model = PseudoWiener(kind, {"delay_samples": float(delay), "sample_s": 2e-3, **own})
    signal = amplitude_random_steps(0.6, offset=0.1, amplitude=0.4, hold_s=0.05, sample_s=2e-3)
    time, duty = signal["time_s"].to_numpy(), signal["duty"].to_numpy()
    ours = model.simulate(signal, initial_state={"angle_deg": 20.0})["angle_deg"].to_numpy()
    system, start = to_iosystem(model, sample_s=2e-3, start_deg=20.0)
    response = control.input_output_response(system, time, duty, start)
    assert np.ptp(ours) > 5.0
    np.testing.assert_array_equal(response.outputs, ours)


def test_a_loop_closes_around_it() -> None:
    plant, rest = to_iosystem(Throttle(), sample_s=2e-3)
    gain = control.tf([0.02], [1.0], 2e-3, inputs=["error"], outputs=["duty"], name="gain")
    add = control.summing_junction(inputs=["reference", "-angle_deg"], output="error", name="add", dt=2e-3)
    loop = control.interconnect([plant, gain, add], inputs=["reference"], outputs=["angle_deg"], dt=2e-3)
    time = np.arange(400) * 2e-3
    start = np.concatenate([rest, np.zeros(loop.nstates - 7)])
    angle = control.input_output_response(loop, time, np.full(time.size, 40.0), start).outputs
    assert angle[0] == pytest.approx(8.0)
    assert 25.0 < angle[-1] < 40.0, "a proportional loop stops where friction and spring hold it"


def test_bad_samples_and_starts_are_refused() -> None:
    with pytest.raises(ParameterError, match="sample"):
        to_iosystem(Throttle(), sample_s=1.5e-4)
    with pytest.raises(ParameterError, match=r"start_deg = 95: must lie within the travel"):
        to_iosystem(Throttle(), start_deg=95.0)


def test_the_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "control":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install 'mgdd\[control\]'"):
        to_iosystem(Throttle())


def test_a_fit_responds_as_its_model_runs_with_its_delay() -> None:
    numbers = {**FirstPrincipleModel().parameters, "tau_s": 0.05, "delay_samples": 3.0}
    model = FirstPrincipleModel(parameters=numbers, substeps=20)
    signal = amplitude_random_steps(0.6, offset=0.1, amplitude=0.3, hold_s=0.05)
    time, duty = signal["time_s"].to_numpy(), signal["duty"].to_numpy()
    ours = model.simulate(signal, initial_state={"angle_deg": 20.0})["angle_deg"].to_numpy()
    system, start = to_iosystem(model, start_deg=20.0)
    response = control.input_output_response(system, time, duty, start)
    assert np.ptp(ours) > 5.0
    assert start.size == 10
    assert np.abs(response.outputs - ours).max() < 0.005 * np.ptp(ours)
    late = to_iosystem(FirstPrincipleModel(parameters=numbers | {"delay_samples": 0.0}), start_deg=20.0)
    assert np.abs(control.input_output_response(late[0], time, duty, late[1]).outputs - ours).max() > 0.02 * np.ptp(
        ours
    )
