"""How each kind of controller follows from the groups of a throttle and a few numbers without a unit to tune."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mgdd._core.control import Plate
from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode
from mgdd.errors import ParameterError
from mgdd.loop.plates import model_of
from mgdd.throttle.pseudo_wiener import PseudoWiener

Controller = GuidedPredictive | Mgdd1 | Pid | SlidingMode
_SIDES = ("above", "below")
_CONVERTER_DEG = 0.01  # what 12 bits leave of a sensor without noise


_SPRINGS = (
    "limp_home_deg", "ramp_deg", "preload_above", "spring_above_per_deg", "preload_below", "spring_below_per_deg",
)  # fmt: skip
_MOTION = ("gain_deg_per_s2", "time_constant_s")


@dataclass(frozen=True)
class Groups:
    """What duty and angle say about a throttle: all that a controller knows."""

    plate: Plate
    delay_s: float | None = None  # None: the model says nothing about it

    @property
    def spring(self) -> dict[str, Any]:
        """Keywords of the springs that all controllers share."""
        return {name: getattr(self.plate, name) for name in _SPRINGS}

    @property
    def motion(self) -> dict[str, Any]:
        """Keywords of gain and time constant."""
        return {name: getattr(self.plate, name) for name in _MOTION}


def groups_of(model: Any) -> Groups:
    """Give the groups of a throttle, of PW-R, of fitted first-principle groups, or of the model of a fit.

    ParameterError for anything else.
    """
    model = model_of(model)
    if hasattr(model, "stall_torque_nm"):
        return Groups(model.plate)
    numbers = getattr(model, "parameters", None)
    if isinstance(numbers, Mapping):
        if "beta_above_duty" in numbers:
            plate = Plate(
                gain_deg_per_s2=numbers["gain_deg_per_s2_per_duty"],
                time_constant_s=numbers["tau_s"],
                electrical_s=numbers["electrical_s"],
                friction=numbers["delta_duty"],
                limp_home_deg=numbers["limp_home_deg"],
                preload_above=numbers["beta_above_duty"],
                preload_below=numbers["beta_below_duty"],
                spring_above_per_deg=numbers["kappa_above_duty_per_deg"],
                spring_below_per_deg=numbers["kappa_below_duty_per_deg"],
                closed_deg=model.closed_deg,
                open_deg=model.open_deg,
            )
            return Groups(plate, numbers["delay_samples"] * model.sample_s)
        if getattr(model, "kind", None) == "pw_r":
            return _of_pw_r(numbers)
    raise ParameterError.of(
        "model", model, "a Throttle, PW-R or fitted first-principle groups: other models have no groups to design with"
    )


def _of_pw_r(numbers: Mapping[str, float]) -> Groups:
    def mean(name: str) -> float:
        return math.sqrt(numbers[f"above_{name}"] * numbers[f"below_{name}"])

    plate = Plate(
        gain_deg_per_s2=mean("gain_deg_per_s2_per_duty"),
        time_constant_s=mean("tau_s"),
        electrical_s=0.0,
        friction=mean("coulomb_duty"),
        limp_home_deg=numbers["limp_home_deg"],
        preload_above=numbers["above_preload_duty"],
        preload_below=numbers["below_preload_duty"],
        spring_above_per_deg=numbers["above_spring_duty_per_deg"],
        spring_below_per_deg=numbers["below_spring_duty_per_deg"],
        closed_deg=numbers["closed_deg"],
        open_deg=numbers["open_deg"],
    )
    return Groups(plate, numbers["delay_samples"] * numbers["sample_s"])


def pw_r_of(groups: Groups, sample_s: float) -> PseudoWiener:
    """PW-R of the groups as a guide: friction by tanh, the ramp of 0.5 deg that control uses, no delay of its own."""
    from mgdd.throttle.pseudo_wiener import PseudoWiener

    plate = groups.plate
    numbers = {"limp_home_deg": plate.limp_home_deg, "closed_deg": plate.closed_deg, "open_deg": plate.open_deg}
    for side in _SIDES:
        numbers[f"{side}_tau_s"] = plate.time_constant_s
        numbers[f"{side}_gain_deg_per_s2_per_duty"] = plate.gain_deg_per_s2
        numbers[f"{side}_preload_duty"] = getattr(plate, f"preload_{side}")
        numbers[f"{side}_spring_duty_per_deg"] = getattr(plate, f"spring_{side}_per_deg")
        numbers[f"{side}_coulomb_duty"] = plate.friction
    numbers |= {"sample_s": sample_s, "substeps": 1, "ramp_deg": 0.5, "tanh_deg_per_s": 40.0}
    return PseudoWiener("pw_r", numbers, friction="tanh")


@dataclass(frozen=True)
class Setup:
    """What is not tuned: sampling, delay, noise."""

    sample_s: float = 1e-3
    delay_samples: int = 1
    noise_deg: float = 0.03


@dataclass(frozen=True)
class Family:
    """A kind of controller: what of it is tuned, how it is built, and how far its shipped numbers were tested.

    The numbers were tuned at samples of 1 ms with a delay of one. Up to `longest_sample_s`, and up to `longest_dead_s`
    of delay and half a sample, at most 2 % of 108 runs on 36 throttles within 20 % of the presets end in a limit cycle
    of more than 0.5 deg (``benchmarks/tuned_rates.py``).
    """

    label: str
    space: Mapping[str, tuple[float, float, bool]]  # lower, upper, as a logarithm
    build: Callable[[Groups, Mapping[str, float], Setup], Controller]
    loop_gains: tuple[str, ...] = ()  # numbers that a throttle of twice the gain wants half of
    longest_sample_s: float = 2e-3
    longest_dead_s: float = 2.5e-3


_TUNED_SAMPLE_S, _DERIVATIVE_LAG_S = 1e-3, 3e-3  # of the shipped numbers, with a delay of one; of the measured speed

# A bias that learns faster than this, per sample and over what a sample of acceleration moves, chases its own delay.
_MOST_BIAS = 0.1
_PREDICTION_STEP_S = 2e-3
_FEWEST_SAMPLES = 4  # of the horizon of MGDD-1: a shorter one overshoots and swings, whatever it is in seconds


def _guided(groups: Groups, x: Mapping[str, float], setup: Setup, **fixed: Any) -> GuidedPredictive:
    first, second = round(x["first_move"]), round(x["second_move"])
    settings: dict[str, Any] = {name: value for name, value in x.items() if not name.endswith("_move")}
    settings["move_steps"] = (first, second, 20 - first - second)
    if "bias_rate_per_deg_s" in settings:
        most = _MOST_BIAS / (groups.plate.gain_deg_per_s2 * setup.sample_s**3)
        settings["bias_rate_per_deg_s"] = min(settings["bias_rate_per_deg_s"], most)
    step_s = max(_PREDICTION_STEP_S, setup.sample_s)  # a move cannot be shorter than a sample
    settings["duty_change_weight"] *= (step_s / _PREDICTION_STEP_S) ** 4  # as the squared way that a duty makes in it
    return GuidedPredictive(
        sample_s=setup.sample_s,
        prediction_step_s=step_s,
        delay_samples=setup.delay_samples,
        noise_deg=max(setup.noise_deg, _CONVERTER_DEG),
        **groups.plate.to_dict(),
        **settings,
        **fixed,
    )


def _mgdd1(groups: Groups, x: Mapping[str, float], setup: Setup) -> Mgdd1:
    return Mgdd1(
        pw_r_of(groups, setup.sample_s),
        delay_samples=setup.delay_samples,
        horizon_samples=max(_FEWEST_SAMPLES, round(x["horizon_s"] / setup.sample_s)),
        adaptation_gain=x["adaptation_gain"],
        duty_change_weight=x["duty_change_weight"],
        trim_rate_per_deg_s=x["trim_rate_per_deg_s"],
    )


def slowed(setup: Setup) -> float:
    """Give the factor of time by which a loop without a model is slower, so that its dead time costs as much phase."""
    dead_s = (setup.delay_samples + 0.5) * setup.sample_s + _DERIVATIVE_LAG_S
    return min(1.0, (1.5 * _TUNED_SAMPLE_S + _DERIVATIVE_LAG_S) / dead_s)


def _pid(groups: Groups, x: Mapping[str, float], setup: Setup) -> Pid:
    gains, slower = {}, slowed(setup)
    for side in _SIDES:
        gains[f"proportional_{side}_per_deg"] = slower**2 * x["proportional"] / 90.0
        gains[f"integral_{side}_per_deg_s"] = slower**3 * x["integral_per_s"] / 90.0
        gains[f"derivative_{side}_s_per_deg"] = slower * x["derivative_s"] / 90.0
    return Pid(
        sample_s=setup.sample_s,
        kick=min(x["kick"] * groups.plate.friction, 1.0),
        kick_width_deg=x["kick_width_deg"],
        integral_window_deg=x["integral_window_deg"],
        dead_band_deg=x["dead_band_deg"],
        rate_s_per_deg=x["rate"] / (groups.plate.time_constant_s * groups.plate.gain_deg_per_s2),
        friction=min(x["friction"] * groups.plate.friction, 1.0),
        **groups.spring,
        **gains,
    )


def _sliding_mode(groups: Groups, x: Mapping[str, float], setup: Setup) -> SlidingMode:
    own = {**x, "friction": min(x["friction"] * groups.plate.friction, 1.0)}
    slower = slowed(setup)
    # The rate of the surface inside its layer, with what implicit switching adds to it.
    push, tuned_s = x["switching"] * groups.plate.gain_deg_per_s2, _TUNED_SAMPLE_S
    rate_per_s = push / (x["layer_deg"] * x["bandwidth_per_s"] + tuned_s * push)
    own["bandwidth_per_s"] *= slower
    own["integral_per_s"] *= slower
    own["reference_pole_per_s"] *= slower
    own["layer_deg"] = max(push / (slower * rate_per_s) - setup.sample_s * push, 0.0) / own["bandwidth_per_s"]
    return SlidingMode(sample_s=setup.sample_s, reaching="implicit", **own, **groups.spring, **groups.motion)


_PREDICTIVE: dict[str, tuple[float, float, bool]] = {
    "first_move": (1.0, 6.0, False),
    "second_move": (3.0, 10.0, False),
    "duty_change_weight": (0.3, 100.0, True),
    "speed_weight": (1e-7, 1e-4, True),
    "observer_angle_per_s": (200.0, 900.0, True),
    "observer_speed_per_s2": (9e3, 1e5, True),
}
_PLAIN = _PREDICTIVE | {"bias_rate_per_deg_s": (0.3, 40.0, True), "trim_rate_per_deg_s": (0.05, 5.0, True)}

FAMILIES: Mapping[str, Family] = {
    "guided": Family(
        "model-guided predictive",
        _PREDICTIVE
        | {
            "learning_rate_per_s": (30.0, 150.0, True),  # faster: limit cycles where all numbers are 40 % off
            "gain_weight": (3.0, 300.0, True),
            "damping_weight": (3.0, 300.0, True),
        },
        _guided,
        longest_sample_s=5e-3,
        longest_dead_s=7.5e-3,
    ),
    "mgdd1": Family(
        "MGDD-1",
        {
            "horizon_s": (4e-3, 30e-3, False),
            "adaptation_gain": (0.1, 1.0, False),
            "duty_change_weight": (1.0, 200.0, True),
            "trim_rate_per_deg_s": (0.05, 5.0, True),
        },
        _mgdd1,
        longest_sample_s=5e-3,
        longest_dead_s=7.5e-3,
    ),
    "pid": Family(
        "PID",
        {
            "proportional": (2.0, 30.0, True),
            "integral_per_s": (1.0, 300.0, True),
            "derivative_s": (0.02, 0.4, True),
            "kick": (0.0, 1.5, False),
            "kick_width_deg": (0.01, 1.0, True),
            "integral_window_deg": (0.3, 20.0, True),
            "dead_band_deg": (0.0, 0.15, False),
            "rate": (0.0, 1.5, False),
            "friction": (0.0, 1.5, False),
        },
        _pid,
        loop_gains=("proportional", "integral_per_s", "derivative_s"),
        longest_sample_s=5e-3,
        longest_dead_s=7e-3,
    ),
    "sliding_mode": Family(
        "sliding mode",
        {
            "switching": (0.1, 1.0, True),
            "layer_deg": (0.3, 6.0, True),
            "integral_per_s": (0.5, 40.0, True),
            "bandwidth_per_s": (30.0, 200.0, True),
            "reference_pole_per_s": (60.0, 300.0, True),
            "friction": (0.0, 1.5, False),
            "integral_layers": (0.3, 5.0, True),
        },
        _sliding_mode,
        longest_sample_s=5e-3,
        longest_dead_s=7.5e-3,
    ),
    "linear_mpc": Family(
        "linear MPC",
        _PLAIN,
        lambda groups, x, setup: _guided(groups, x, setup, friction_learning=False, prediction="linear"),
    ),
    "nmpc": Family(
        "nonlinear MPC",
        _PLAIN,
        lambda groups, x, setup: _guided(groups, x, setup, friction_learning=False, gauss_newton_steps=10),
    ),
}
