"""The first-principle model of a throttle in the groups that duty and angle determine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd._core.throttle import Throttle
from mgdd.errors import ParameterError
from mgdd.io.parameters import ModelParameters, Wanted, wanted
from mgdd.results.describe import described
from mgdd.signals.model import RunInputs, SampledModel

GROUP_NAMES = tuple(_core.identify.group_names)
# What a throttle need not have: without a word its friction does not drop or bend, its gear has no gap, its
# stops are rigid, its damping is back-EMF and its duty acts at once.
REFINEMENTS = MappingProxyType(
    {
        "stribeck_drop": 0.0,
        "stribeck_deg_per_s": 15.0,
        "ramp_deg": 0.25,
        "delay_samples": 0.0,
        "presliding_deg": 0.0,
        "presliding_damping": 0.5,
        "half_gap_deg": 0.0,
        "viscous_share": 0.0,
        "stop_duty_per_deg": 0.0,
        "stop_damping": 0.5,
    }
)
_NEEDED = tuple(name for name in GROUP_NAMES if name not in REFINEMENTS)
# Groups of a typical passenger-car throttle, the start of a fit.
TYPICAL = MappingProxyType(
    dict(zip(_NEEDED, (0.03, 5e4, 0.1, 1e-3, 0.05, 0.1, 1e-3, 8.0, 0.0), strict=True)) | REFINEMENTS
)
_POSITIVE = ("tau_s", "gain_deg_per_s2_per_duty", "stribeck_deg_per_s", "ramp_deg")
LONGEST_DELAY = 20.0
_RIGID_DUTY_PER_DEG = 200.0  # what is as stiff yields too little to be seen
_CORE_DELAY = 5.0  # of a model of the core, whose delay line is part of its state


def whole_shift(delay_samples: float, room: float = 0.0) -> int:
    """Give the whole samples of a delay that are taken off the duty, so that the rest and `room` fit into the core."""
    return max(0, math.ceil(delay_samples + room - _CORE_DELAY - 1e-9))


def shifted(duty: NDArray[np.float64], samples: int, before: float) -> NDArray[np.float64]:
    """Give a duty that many samples later, with the one that acted before."""
    if samples == 0:
        return duty
    return np.concatenate([np.full(min(samples, duty.size), before), duty[:-samples]])


@described
@dataclass(frozen=True, kw_only=True)
class FirstPrincipleModel(SampledModel, ModelParameters):
    """Throttle in groups: dry friction, springs with preload on both sides, motor as a torque source with a lag.

    Parameters
    ----------
    parameters : mapping of str to float, optional
        ``tau_s``, ``gain_deg_per_s2_per_duty``, preload ``beta_above_duty`` / ``beta_below_duty``, stiffness
        ``kappa_above_duty_per_deg`` / ``kappa_below_duty_per_deg``, friction ``delta_duty``, ``limp_home_deg`` and
        ``electrical_s`` (L/R, 0 for none); those of a typical passenger-car throttle without. Further, if they are
        given: ``stribeck_drop`` (static over sliding friction, less one; 0) and ``stribeck_deg_per_s`` (speed over
        which it drops), ``ramp_deg`` (half width of the preload's ramp at limp-home; 0.25), ``delay_samples`` of the
        duty (0 to 20; 0), ``presliding_deg`` (LuGre deflection at which friction is full; 0 for none) and
        ``presliding_damping`` (ratio; 0.5), ``half_gap_deg`` (of the gap between motor and plate; 0),
        ``viscous_share`` (of the damping, what is not back-EMF; 0), ``stop_duty_per_deg`` (stiffness of the stops; 0
        for rigid ones) with ``stop_damping`` (ratio; 0.5).
    closed_deg, open_deg : float
        Mechanical stops [deg].
    substeps : int
        Steps per sample.
    sample_s : float
        Sample time that the delay counts [s].
    """

    kind = "first_principle"
    parameter_names = GROUP_NAMES
    settings = MappingProxyType(
        wanted(("closed_deg", "open_deg")) | {"substeps": Wanted(form="integer"), "sample_s": Wanted("s")}
    )
    input_names = ("duty",)
    output_name = observed_state = "angle_deg"
    state_names = ("angle_deg", "speed_deg_per_s", "lagged_duty")

    parameters: Mapping[str, float] = field(default_factory=lambda: dict(TYPICAL))
    closed_deg: float = 0.0
    open_deg: float = 90.0
    substeps: int = 2
    sample_s: float = 1e-3

    def __post_init__(self) -> None:
        missing = set(_NEEDED) - set(self.parameters)
        if missing:
            raise ParameterError(f"parameters: {', '.join(sorted(missing))} missing")
        given = {**REFINEMENTS, **self.parameters}
        ordered = {name: float(given[name]) for name in GROUP_NAMES}
        for name, value in ordered.items():
            ParameterError.unless(math.isfinite(value), name, value, "finite")
            positive = name in _POSITIVE
            if name != "limp_home_deg" and not (value > 0.0 if positive else value >= 0.0):
                raise ParameterError.of(name, value, f"{('>' if positive else '>=')} 0")
        if ordered["delay_samples"] > LONGEST_DELAY:
            raise ParameterError.of("delay_samples", ordered["delay_samples"], f"<= {LONGEST_DELAY:g}")
        ParameterError.unless(math.isfinite(self.sample_s) and self.sample_s > 0.0, "sample_s", self.sample_s, "> 0")
        if not self.closed_deg < self.open_deg:
            raise ParameterError.of("open_deg", self.open_deg, f"above closed_deg = {self.closed_deg:.12g}")
        object.__setattr__(self, "parameters", MappingProxyType(ordered))

    def _rest(self) -> list[float]:
        return [self.parameters["limp_home_deg"], 0.0, 0.0]

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        values = dict(self.parameters)
        if not math.isclose(run.step_s, self.sample_s, rel_tol=1e-6):  # the delay keeps its seconds
            values["delay_samples"] *= self.sample_s / run.step_s
        shift = whole_shift(values["delay_samples"])
        values["delay_samples"] -= shift
        return _core.identify.simulate_throttle_groups(
            list(values.values()),
            shifted(np.clip(run.columns[0], -1.0, 1.0), shift, float(run.state[2])),
            step_s=run.step_s,
            start=run.state,
            closed_deg=self.closed_deg,
            open_deg=self.open_deg,
            substeps=self.substeps,
        )

    def to_throttle(
        self,
        *,
        resistance_ohm: float,
        supply_v: float,
        inertia_kgm2: float | None = None,
        torque_constant_nm_per_a: float | None = None,
    ) -> Throttle:
        """Compute the throttle with these groups: g = K V/R and G = g/J leave one number to be known.

        It moves as the model does, and nothing that acts is a preset's. What a log in duty and angle cannot show
        follows from the groups: of the damping the share that is not back-EMF is viscous; rigid stops and the flanks of
        a gap yield by 0.005° under the stall torque and do not rebound; behind a gap are a seventh of the inertia and
        all of the friction. A delay is none of a throttle: give `delay_samples` to `mgdd.loop.track`.

        Parameters
        ----------
        resistance_ohm, supply_v : float
            Measured at the terminals [ohm, V].
        inertia_kgm2, torque_constant_nm_per_a : float
            Exactly one of them [kg m², N m/A at the plate].

        Returns
        -------
        mgdd.throttle.Throttle
            All at the plate shaft; friction Coulomb, Stribeck or LuGre as the groups have it.

        Raises
        ------
        ParameterError
            A number that is not positive, or none or both of the two.

        Examples
        --------
        >>> from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
        >>> throttle = FirstPrincipleModel().to_throttle(resistance_ohm=1.5, supply_v=12.0, inertia_kgm2=0.0021)
        >>> round(throttle.torque_constant_nm_per_a, 3), throttle.limp_home_deg
        (0.229, 8.0)
        """
        numbers = {
            "resistance_ohm": resistance_ohm,
            "supply_v": supply_v,
            "inertia_kgm2": inertia_kgm2,
            "torque_constant_nm_per_a": torque_constant_nm_per_a,
        }
        for name, value in numbers.items():
            ParameterError.unless(value is None or (math.isfinite(value) and value > 0.0), name, value, "> 0")
        if (inertia_kgm2 is None) == (torque_constant_nm_per_a is None):
            raise ParameterError("inertia_kgm2, torque_constant_nm_per_a: give exactly one of them")
        p, per_rad = self.parameters, math.degrees(1.0)
        gain = p["gain_deg_per_s2_per_duty"] / per_rad
        if torque_constant_nm_per_a is not None:
            stall = torque_constant_nm_per_a * supply_v / resistance_ohm
        else:
            stall = gain * float(inertia_kgm2 or math.nan)
        inertia, constant = stall / gain, stall * resistance_ohm / supply_v
        damping, coulomb = inertia / p["tau_s"], p["delta_duty"] * stall
        rigid = p["stop_duty_per_deg"] == 0.0
        stop = (_RIGID_DUTY_PER_DEG if rigid else p["stop_duty_per_deg"]) * per_rad * stall
        given: dict[str, Any] = {
            "friction": "stribeck" if p["stribeck_drop"] > 0.0 and coulomb > 0.0 else "coulomb",
            "backlash": "none",
        }
        if p["presliding_deg"] > 0.0 and coulomb > 0.0:
            bristle = coulomb * per_rad / p["presliding_deg"]
            given["friction"] = "lugre"
            given["bristle_nm_per_rad"] = bristle
            given["bristle_damping_nms_per_rad"] = 2.0 * p["presliding_damping"] * math.sqrt(bristle * inertia)
        if p["half_gap_deg"] > 0.0:
            gear, plate = _RIGID_DUTY_PER_DEG * per_rad * stall, inertia / 7.0
            given |= {
                "backlash": "compliance",
                "backlash_half_deg": p["half_gap_deg"],
                "gear_stiffness_nm_per_rad": gear,
                "gear_damping_nms_per_rad": 2.0 * math.sqrt(gear * plate),
                "plate_inertia_kgm2": plate,
                "plate_friction_share": 1.0,
            }
        return Throttle(
            inertia_kgm2=inertia,
            torque_constant_nm_per_a=constant,
            viscous_nms_per_rad=p["viscous_share"] * damping,
            back_emf_vs_per_rad=(1.0 - p["viscous_share"]) * damping * resistance_ohm / constant,
            resistance_ohm=resistance_ohm,
            inductance_mh=1e3 * p["electrical_s"] * resistance_ohm,
            supply_v=supply_v,
            coulomb_nm=coulomb,
            stiction_nm=(1.0 + p["stribeck_drop"]) * coulomb,
            stribeck_rad_per_s=p["stribeck_deg_per_s"] / per_rad,
            limp_home_deg=p["limp_home_deg"],
            spring_above_nm_per_rad=p["kappa_above_duty_per_deg"] * per_rad * stall,
            spring_below_nm_per_rad=p["kappa_below_duty_per_deg"] * per_rad * stall,
            preload_above_nm=p["beta_above_duty"] * stall,
            preload_below_nm=p["beta_below_duty"] * stall,
            preload_ramp_deg=p["ramp_deg"],
            closed_deg=self.closed_deg,
            open_deg=self.open_deg,
            stop_stiffness_nm_per_rad=stop,
            stop_damping_nms_per_rad=2.0 * (1.0 if rigid else p["stop_damping"]) * math.sqrt(stop * inertia),
            **given,
        )
