"""The tuner for several inputs: what it predicts is what runs come to, for unlike units and coupled inputs."""

from __future__ import annotations

import pickle
from itertools import combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize import ExtremumSeeking, Input, Spsa, measure_map, tune
from mgdd.optimize.tuning_forms import harmonics_of, spsa_moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NOISE = 0.25
METHODS = ["batch", "moving_average", "spsa"]
BENDS = np.array([-0.06, -600.0, -2e-6])  # timing, EGR, rail pressure
LENGTHS = np.sqrt(NOISE / -BENDS)


def coupled(correlations: list[list[float]]) -> Array:
    size = np.sqrt(-BENDS[: len(correlations)])
    return -np.array(correlations) * np.outer(size, size)


MAPS = {
    "two": np.diag(BENDS[:2]),
    "three": np.diag(BENDS),
    "two coupled": coupled([[1.0, -0.6], [-0.6, 1.0]]),
    "three coupled": coupled([[1.0, 0.5, 0.3], [0.5, 1.0, 0.2], [0.3, 0.2, 1.0]]),
}


def runs_of(tuning: Any, hessian: Array, start: Array, *, seeds: int, delay: int = 0) -> tuple[Array, float, float]:
    """Return rms and mean loss of the second half of runs, and mean cycles to arrive at 0.45 lengths in all inputs."""
    lengths = LENGTHS[: len(hessian)]
    squares, losses, counts = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        begin = start if seed % 2 else -start
        late = [0.5 * begin @ hessian @ begin] * delay
        true: list[float] = []

        def j(x: Any, late: list[float] = late, true: list[float] = true, rng: np.random.Generator = rng) -> float:
            true.append(0.5 * x @ hessian @ x)
            late.append(true[-1])
            return late.pop(0) + rng.normal(0.0, NOISE)

        path = tuning.seeker(start=begin, seed=seed).run(j, int(8.0 * tuning.cycles))["estimate"].to_numpy()
        half = len(path) // 2
        counts.append(int(np.argmax((np.abs(path) <= 0.45 * lengths).all(axis=1))))
        squares.append((path[half:] ** 2).mean(axis=0))
        losses.append(-np.mean(true[half:]))
    return np.sqrt(np.mean(squares, axis=0)), float(np.mean(losses)), float(np.mean(counts))


# --- the laws -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("hessian", MAPS.values(), ids=MAPS)
@pytest.mark.parametrize("method", METHODS)
def test_runs_come_to_what_is_predicted(method: str, hessian: Array) -> None:
    tuning = tune(NOISE, hessian, method=method)
    scaled = -hessian * np.outer(LENGTHS, LENGTHS)[: len(hessian), : len(hessian)]
    slowest = np.sign(np.linalg.eigh(scaled).eigenvectors[:, 0] + 1e-12)
    start = 5.0 * slowest * LENGTHS[: len(hessian)]
    rms, loss, cycles = runs_of(tuning, hessian, start, seeds=100)
    np.testing.assert_allclose(rms, tuning.rms, rtol=0.1)
    assert loss == pytest.approx(tuning.dither_cost + tuning.jitter_cost, rel=0.07)
    assert cycles == pytest.approx(tuning.cycles, rel=0.2)


@pytest.mark.parametrize(("method", "tolerance"), [("batch", 0.15), ("moving_average", 0.25)])
def test_runs_behind_a_delay_come_to_what_is_predicted(method: str, tolerance: float) -> None:
    tuning = tune(NOISE, MAPS["two"], method=method, delay_cycles=5.0)
    assert (tuning.period, tuning.harmonics.tolist()) == (36, [2, 3])
    rms, loss, cycles = runs_of(tuning, MAPS["two"], 5.0 * LENGTHS[:2], seeds=30, delay=5)
    np.testing.assert_allclose(rms, tuning.rms, rtol=0.12)
    assert loss == pytest.approx(tuning.dither_cost + tuning.jitter_cost, rel=0.07)
    assert cycles == pytest.approx(tuning.cycles, rel=tolerance)


@pytest.mark.parametrize("error", [-2, 2])
def test_a_delay_that_is_wrong_by_two_cycles_is_survived(error: int) -> None:
    tuning = tune(NOISE, MAPS["two"], delay_cycles=10.0)
    rms, *_ = runs_of(tuning, MAPS["two"], 5.0 * LENGTHS[:2], seeds=10, delay=10 + error)
    assert (rms < LENGTHS[:2]).all()
    bold = tune(NOISE, MAPS["two"], delay_cycles=10.0, delay_uncertainty=0.0)
    lost, *_ = runs_of(bold, MAPS["two"], 5.0 * LENGTHS[:2], seeds=4, delay=10 + error)
    assert (lost > 5.0 * LENGTHS[:2]).any()


@pytest.mark.parametrize("method", ["batch", "moving_average"])
@pytest.mark.parametrize(
    ("lag", "period", "least"),  # the least time constant, in cycles
    [
        ({}, (6, 10), None),
        ({"delay_cycles": 7.0, "lag_cycles": 11.0, "delay_uncertainty": 0.0}, (27, 27), 108.0),  # 2.4 x 11, rounded up
        ({"delay_cycles": 70.0, "lag_cycles": 1.0, "delay_uncertainty": 0.0}, (6, 10), 213.0),
        ({"delay_cycles": 38.0, "lag_cycles": 25.0}, (76, 76), 304.0),  # a fifth of 63 is not known: 60 degrees
        ({"delay_cycles": 5.0}, (12, 12), 48.0),  # two cycles at least
    ],
)
def test_period_and_time_constant_follow_the_sensor(
    method: str, lag: dict[str, Any], period: tuple[int, int], least: float | None
) -> None:
    tuning = tune(0.31, -0.083, method=method, cycles=30.0, rms=4.0, distance=9.0, arrival=0.8, **lag)
    assert tuning.period == period[method == "moving_average"]
    assert tuning.time_constant_cycles == pytest.approx(least or 2.0 * tuning.period)
    pole = np.exp(-1.0 / lag["lag_cycles"]) if "lag_cycles" in lag else 0.0
    z = np.exp(2j * np.pi / tuning.period)
    sensor = z ** -lag.get("delay_cycles", 0.0) * (1.0 - pole) / (1.0 - pole / z)
    assert tuning.sensor_gain == pytest.approx(abs(sensor))
    turned = np.exp(-1j * np.radians(tuning.sensor_phase_deg))
    assert turned == pytest.approx(sensor / abs(sensor))
    tau, size, step = tuning.time_constant_cycles, tuning.amplitude, tuning.period
    noisy = max(size, 3.0 * np.sqrt(2.0 * step / tau) * tuning.rms) / step  # three deviations of a batch pass
    assert tuning.rate == pytest.approx(noisy if method == "batch" else max(3.0 * size / step, 2.0 * 9.0 / tau))
    assert not tuning.met


def test_what_is_asked_for_in_less_time_or_with_less_room_is_not_met() -> None:
    spec: dict[str, Any] = {"rms": 0.9, "distance": 9.0, "arrival": 0.8}
    for method in METHODS:
        assert tune(0.31, -0.083, method=method, cycles=240.0, amplitude_max=2.6, **spec).met
        late = tune(0.31, -0.083, method=method, cycles=4.0, amplitude_max=2.6, **spec)
        rough = tune(0.31, -0.083, method=method, cycles=240.0, amplitude_max=0.1, **spec)
        assert (late.met, late.cycles > 4.0, rough.met, rough.amplitude) == (False, True, False, 0.1)
        asked = {**spec, "cycles": 240.0, "amplitude_max": 0.1}
        assert [tune(0.31, -0.083, method=method, **asked | {"rms": s * rough.rms}).met for s in (0.97, 1.0)] == [0, 1]
    assert late.rate == pytest.approx(max(2.0 * late.amplitude, 1.2 * 0.083 * late.gain * 9.0))  # of SPSA


@pytest.mark.parametrize("curvature", [-0.1, [-0.1, -40.0]], ids=["one", "two"])
@pytest.mark.parametrize("method", METHODS)
def test_what_is_left_open_scales_with_the_length_of_the_noise(method: str, curvature: Any) -> None:
    lengths = np.sqrt(0.4 / -np.array(curvature))
    shares = {"rms": 0.2, "distance": 5.0, "arrival": 0.45, "amplitude_max": 1.8}
    stated = {name: share * lengths for name, share in shares.items()}
    left_open, given = tune(0.4, curvature, method=method), tune(0.4, curvature, method=method, **stated)
    for name in ("amplitude", "gain", "rate", "rms"):
        np.testing.assert_allclose(getattr(left_open, name), getattr(given, name), rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("method", METHODS)
def test_other_units_change_nothing_else(method: str) -> None:
    units = np.array([50.0, 1e-3])
    hessian = MAPS["two coupled"]
    plain = tune(NOISE, hessian, method=method)
    other = tune(1e-2 * NOISE, 1e-2 * hessian / np.outer(units, units), method=method)
    for name in ("amplitude", "rate", "rms"):
        np.testing.assert_allclose(getattr(other, name), getattr(plain, name) * units, rtol=1e-9)
    assert (other.period, other.met) == (plain.period, plain.met)
    assert other.cycles == pytest.approx(plain.cycles)
    assert other.jitter_cost == pytest.approx(1e-2 * plain.jitter_cost)


def test_coupling_slows_the_approach_and_is_told() -> None:
    plain, bound = (tune(NOISE, MAPS[name]) for name in ("two", "two coupled"))
    assert bound.time_constant_cycles == pytest.approx(plain.time_constant_cycles * 1.6 / 0.4)
    assert "the inputs are coupled: in the flattest direction J has 0.4" in bound.summary()
    assert "2.5 times as long" in bound.summary()
    assert "coupled" not in plain.summary()


def test_the_moments_of_spsa_are_those_of_all_signs() -> None:
    bend = np.array([[1.0, 0.7, -0.2], [0.7, 1.0, 0.1], [-0.2, 0.1, 1.0]])
    c, q = np.array([0.5, 1.2, 3.0]), 0.3
    given = np.array([[2.0, -0.4, 0.3], [-0.4, 1.0, 0.6], [0.3, 0.6, 3.0]])
    mean = np.zeros((3, 3))
    for signs in product([-1.0, 1.0], repeat=3):
        step = np.eye(3) - q * np.outer(np.array(signs) / c, np.array(signs) * c) @ bend
        mean += step @ given @ step.T / 8.0
    size = np.outer(c, c)
    np.testing.assert_allclose(spsa_moments(bend, q, c) @ (given * size).ravel(), (mean * size).ravel(), rtol=1e-12)


# --- harmonics ----------------------------------------------------------------------------------------------
def mixes(harmonics: tuple[int, ...], period: int) -> bool:
    """Whether an echo of a curvature is seen at the frequency of a slope."""
    k = np.arange(period)
    wave = np.exp(2j * np.pi * np.outer(harmonics, k) / period)
    waves = [wave[i].imag * wave[j].imag for i in range(len(wave)) for j in range(i, len(wave))]
    return any(abs(echo @ own) > 1e-9 * period for echo in waves for own in wave)


@pytest.mark.parametrize(("inputs", "period"), [(1, 6), (2, 8), (3, 12), (4, 16)])
def test_harmonics_do_not_mix_on_the_shortest_period(inputs: int, period: int) -> None:
    assert harmonics_of(inputs, least=6)[0] == period
    assert not mixes(harmonics_of(inputs, least=6)[1], period)
    for shorter in range(6, period):
        assert all(mixes(own, shorter) for own in combinations(range(1, (shorter + 1) // 2), inputs))
    ExtremumSeeking(start=[0.0] * inputs, period=period, harmonics=list(harmonics_of(inputs, least=6)[1]))


@pytest.mark.parametrize("inputs", [1, 2, 3])
def test_a_dither_whose_harmonics_mix_is_refused(inputs: int) -> None:
    taken = 0
    for period, own in product(range(4, 17 if inputs < 3 else 13), product(range(9), repeat=inputs)):
        if 0 in own or 2 * max(own) >= period or len({*own}) < inputs or mixes(own, period):
            with pytest.raises(ParameterError, match="harmonics"):
                ExtremumSeeking(start=[0.0] * inputs, period=period, harmonics=list(own))
        else:
            taken += 1
            ExtremumSeeking(start=[0.0] * inputs, period=period, harmonics=list(own))
    assert taken >= 6


@pytest.mark.parametrize("inputs", [1, 2, 3])
def test_harmonics_do_not_mix_on_any_period(inputs: int) -> None:
    for least in range(6, 31):
        period, harmonics = harmonics_of(inputs, least=least)
        assert period >= least
        assert not mixes(harmonics, period)


@pytest.mark.parametrize("inputs", [1, 2, 3, 8])
def test_an_unknown_delay_turns_the_fastest_harmonic_by_60_degrees_at_most(inputs: int) -> None:
    period, harmonics = harmonics_of(inputs, least=6, per_harmonic=12.0)
    assert 360.0 * 2.0 * max(harmonics) / period <= 60.0
    assert not mixes(harmonics, period)


# --- seekers and names --------------------------------------------------------------------------------------
@pytest.mark.parametrize("method", METHODS)
def test_the_seeker_carries_what_was_tuned_in_its_own_order(method: str) -> None:
    tuning = tune(NOISE, {"soc_cad": -0.06, "egr": -600.0}, method=method)
    start = {"soc_cad": -9.0, "egr": 0.25}
    seeker = tuning.seeker(start=start, inputs=[Input("egr", 0.0, 0.4, rate=0.01), Input("soc_cad", -25.0, 15.0)])
    settings = seeker.settings
    assert seeker.input_names == ["egr", "soc_cad"]
    assert settings["gain"] == tuning.gain[::-1].tolist()
    assert settings["perturbation" if method == "spsa" else "amplitude"] == tuning.amplitude[::-1].tolist()
    if isinstance(seeker, Spsa):
        assert settings["step_max"] == [min(tuning.rate[1], 0.01), tuning.rate[0]]
    else:
        assert settings["harmonics"] == tuning.harmonics[::-1].tolist()
    in_order = tuning.seeker(start=[-9.0, 0.25], inputs={"egr": (0.0, 0.4), "soc_cad": (-25.0, 15.0)})
    assert in_order.estimate.tolist() == seeker.estimate.tolist() == [0.25, -9.0]
    plain = tuning.seeker(start=start, bounds={"egr": (0.0, 0.4), "soc_cad": (-25.0, 15.0)})
    assert plain.settings["inputs"] == [Input("soc_cad", -25.0, 15.0), Input("egr", 0.0, 0.4)]
    assert set(plain.ask()) == {"soc_cad", "egr"}


def test_measure_tune_and_seek_by_name() -> None:
    rng = np.random.default_rng(11)

    def engine(x: Any) -> Any:
        away = x["soc_cad"] + 4.0, x["egr"] - 0.15
        return 56.0 - 0.03 * away[0] ** 2 - 300.0 * away[1] ** 2 - 2.0 * away[0] * away[1] + rng.normal(0.0, NOISE)

    tried = {"soc_cad": rng.uniform(-15.0, 5.0, 60), "egr": rng.uniform(0.0, 0.3, 60)}
    j = [engine({"soc_cad": a, "egr": b}) for a, b in zip(*tried.values(), strict=True)]
    found = measure_map(tried, j)
    tuning = tune(found.noise_sd, found.curvature, inputs=found.inputs)
    seeker = tuning.seeker(start={"soc_cad": -12.0, "egr": 0.25}, inputs={"egr": (0.0, 0.4), "soc_cad": (-25.0, 15.0)})
    late = seeker.run(engine, int(6 * tuning.cycles))["estimate"][-200:].mean("cycle")
    assert abs(late.sel(input="soc_cad") + 4.0) < 1.0
    assert abs(late.sel(input="egr") - 0.15) < 0.01


def test_a_name_of_one_input_stays() -> None:
    tuning = tune(NOISE, {"soc_cad": -0.051}, distance={"soc_cad": 12.0})
    assert tuning == tune(NOISE, -0.051, distance=12.0, inputs=["soc_cad"])
    assert tuning != tune(NOISE, -0.051, distance=12.0)
    assert isinstance(tuning.gain, float)
    assert set(tuning.seeker(start=-9.0, bounds=(-30.0, 10.0)).ask()) == {"soc_cad"}


def test_tuning_of_several_inputs_is_a_value() -> None:
    tuning = tune(NOISE, {"soc_cad": -0.06, "egr": -600.0})
    assert pickle.loads(pickle.dumps(tuning)) == tuning
    assert hash(tuning) == hash(tune(NOISE, {"soc_cad": 0.06, "egr": -600.0}))
    assert tuning != tune(NOISE, {"soc_cad": -0.06, "egr": -601.0})
    assert float(tuning.dataset["gain"].sel(input="egr")) == tuning.gain[1]
    assert "period 8 cycles at 1 and 3 oscillations" in tuning.summary()


PAIR = {"soc_cad": -0.06, "egr": -600.0}
OPEN = ("rms", "cycles", "distance", "arrival", "amplitude_max", "delay_uncertainty")


def test_a_specification_per_input_is_kept_or_told_by_name() -> None:
    spec = {"rms": {"egr": 0.002, "soc_cad": 0.3}, "cycles": 100.0}
    tuning = tune(NOISE, PAIR, **spec, amplitude_max={"soc_cad": 9.0, "egr": 0.003})
    assert tuning.rms[0] == pytest.approx(0.3)
    assert tuning.amplitude[1] == pytest.approx(0.003)
    (reason,) = tuning.reasons
    assert reason.startswith("rms of egr = 0.002 is out of reach with amplitude_max = 0.003: expect ")
    enough = float(reason.split("an amplitude of ")[1].split()[0])
    assert tune(NOISE, PAIR, **spec, amplitude_max={"soc_cad": 9.0, "egr": 1.01 * enough}).met
    assert "cycles = 9 is too few" in tune(NOISE, PAIR, cycles=9.0).summary()


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"rms": 1.0}, ShapeError, r"rms has shape \(\): must be \(2,\), one number per input"),
        ({"rms": {"egr": 0.1}}, ShapeError, "rms has egr: must have one number for each of soc_cad, egr"),
        ({"arrival": [1.0, -1.0]}, ParameterError, "arrival of egr = -1: must be > 0"),
        ({"arrival": [1.0, 9.0]}, ParameterError, "arrival of egr = 9: must be below distance"),
        ({"curvature": [-1.0, 0.0]}, ParameterError, "curvature. = 0: must be > 0; measure J"),
        ({"curvature": [[-1.0, 2.0], [2.0, -1.0]]}, ParameterError, "bend one way in every direction"),
        ({"curvature": [[-1.0, 0.0], [0.0, 1.0]]}, ParameterError, "bend one way in every direction"),
        ({"curvature": [[-1.0, 0.1], [0.2, -1.0]]}, ParameterError, "symmetric"),
        ({"curvature": np.ones((2, 3))}, ShapeError, r"curvature has shape \(2, 3\)"),
        ({"curvature": np.ones(9)}, ShapeError, "at most 8 inputs"),
        ({"inputs": ["a"]}, ShapeError, "curvature has soc_cad, egr: must have one number for each of a"),
        ({"curvature": [-1.0, -2.0], "inputs": ["a"]}, ShapeError, "inputs has 1 entries: must have 2"),
        ({"noise_sd": 0.0}, ParameterError, "noise_sd = 0: must be > 0; repeat one set-point"),
        ({"method": "annealing"}, ParameterError, "method = .annealing."),
        ({"method": "spsa", "lag_cycles": 3.0}, ParameterError, "without delay and lag"),
        ({"method": "moving_average", "lag_cycles": 3.0, "compensated": False}, ParameterError, "use 'batch'"),
        ({"cycles": -1.0}, ParameterError, "cycles = -1"),
        ({"delay_cycles": -1.0}, ParameterError, "delay_cycles = -1"),
        ({"delay_uncertainty": -1.0}, ParameterError, "delay_uncertainty = -1: must be >= 0"),
        ({"curvature": np.nan}, ParameterError, "curvature. = nan"),
        *(({"curvature": -0.05, name: np.nan}, ParameterError, f"{name} = nan") for name in OPEN),
    ],
)
def test_wishes_are_refused_by_name(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        tune(**({"noise_sd": NOISE, "curvature": PAIR} | arguments))


def test_inputs_that_were_not_tuned_are_refused() -> None:
    tuning = tune(NOISE, PAIR)
    with pytest.raises(ParameterError, match="inputs are egr, soi_cad: this was tuned for soc_cad, egr"):
        tuning.seeker(start=[0.0, 0.2], inputs={"egr": (0.0, 0.4), "soi_cad": (-9.0, 9.0)})
    with pytest.raises(ParameterError, match="bounds: inputs hold them"):
        tuning.seeker(
            start=[0.0, 0.2], bounds=([-9.0, 0.0], [9.0, 0.4]), inputs={"egr": (0.0, 0.4), "soc_cad": (-9.0, 9.0)}
        )
    with pytest.raises(ShapeError, match="rms has 2 entries: must be one number"):
        tune(NOISE, -0.06, rms=[1.0, 2.0])
