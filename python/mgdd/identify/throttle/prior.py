"""What is known of a throttle before its log: limits, the groups that set the duty, and a simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError
from mgdd.presets.meant import throttle_model_of
from mgdd.throttle import Throttle, simulate_throttle

_TRAVEL_DEG = (0.0, 90.0)
_MARGIN_DEG = 1.0
_PW_R = (
    *("above_preload_duty", "below_preload_duty", "above_spring_duty_per_deg", "below_spring_duty_per_deg"),
    *("above_coulomb_duty", "below_coulomb_duty"),
)
_GROUPS = (
    *("beta_above_duty", "beta_below_duty", "kappa_above_duty_per_deg", "kappa_below_duty_per_deg"),
    "delta_duty",
)
# Preload plus friction of a common throttle at 12 V, for models that name neither.
_SWING = 0.3


@dataclass(frozen=True, kw_only=True)
class DutyGroups:
    """Torques over the stall torque per unit duty: what moves the plate, in duty.

    Parameters
    ----------
    preload_above, preload_below : float
        Preload of the limp-home springs [-].
    spring_above_per_deg, spring_below_per_deg : float
        Slope of the springs [1/deg].
    coulomb : float
        Dry friction [-].
    """

    preload_above: float
    preload_below: float
    spring_above_per_deg: float
    spring_below_per_deg: float
    coulomb: float


@dataclass(frozen=True, kw_only=True)
class Prior:
    """A throttle as excitation sees it; `simulate` gives the columns of a run from a start angle [deg]."""

    simulate: Callable[[NDArray[np.float64], NDArray[np.float64], float], Mapping[str, NDArray[np.float64]]]
    limp_home_deg: float | None = None
    stops_deg: tuple[float, float] = _TRAVEL_DEG
    groups: DutyGroups | None = None

    @property
    def window_deg(self) -> tuple[float, float]:
        """The travel without 1 deg at either stop."""
        return self.stops_deg[0] + _MARGIN_DEG, self.stops_deg[1] - _MARGIN_DEG

    @property
    def swing(self) -> float:
        """Duty amplitude that crosses limp-home both ways, with a tenth to spare."""
        if self.groups is None:
            return _SWING
        need = max(self.groups.preload_above, self.groups.preload_below) + self.groups.coulomb
        return min(1.0, math.ceil(110.0 * need) / 100.0)


def prior_of(model: Any) -> Prior:
    """Return what a throttle, a fitted model or a callable gives as prior."""
    model = throttle_model_of(model)
    if isinstance(model, Throttle):
        return _of_throttle(model)
    if hasattr(model, "simulate") and hasattr(model, "parameters"):
        return _of_model(model)
    if callable(model):
        return Prior(simulate=lambda time, duty, start: _columns(model(time, duty, start), time.size))
    raise ParameterError(f"prior = {type(model).__name__}: must be a Throttle, a fitted model or a callable")


def _of_throttle(throttle: Throttle) -> Prior:
    def run(time: NDArray[np.float64], duty: NDArray[np.float64], start: float) -> Mapping[str, NDArray[np.float64]]:
        result = simulate_throttle(throttle, duty, time_s=time, start_deg=start)
        return _columns({name: result[name].to_numpy() for name in ("angle_deg", "current_a")}, time.size)

    plate = throttle.plate
    sliding = max(throttle.coulomb_nm, 0.0 if throttle.friction in ("coulomb", "tanh") else throttle.stiction_nm)
    return Prior(
        simulate=run,
        limp_home_deg=throttle.limp_home_deg,
        stops_deg=(throttle.closed_deg, throttle.open_deg),
        groups=DutyGroups(
            preload_above=plate.preload_above,
            preload_below=plate.preload_below,
            spring_above_per_deg=plate.spring_above_per_deg,
            spring_below_per_deg=plate.spring_below_per_deg,
            coulomb=sliding / throttle.stall_torque_nm,
        ),
    )


def _of_model(model: Any) -> Prior:
    values: dict[str, float] = dict(model.parameters)

    def run(time: NDArray[np.float64], duty: NDArray[np.float64], start: float) -> Mapping[str, NDArray[np.float64]]:
        return _columns(model.simulate({"time_s": time, "duty": duty}, initial_state={"angle_deg": start}), time.size)

    groups = None
    names = next((names for names in (_PW_R, _GROUPS) if all(name in values for name in names)), None)
    if names is not None:
        above, below, spring_above, spring_below, *coulomb = (float(values[name]) for name in names)
        groups = DutyGroups(
            preload_above=above,
            preload_below=below,
            spring_above_per_deg=spring_above,
            spring_below_per_deg=spring_below,
            coulomb=max(coulomb),
        )
    return Prior(
        simulate=run,
        limp_home_deg=values.get("limp_home_deg"),
        stops_deg=(
            float(getattr(model, "closed_deg", values.get("closed_deg", _TRAVEL_DEG[0]))),
            float(getattr(model, "open_deg", values.get("open_deg", _TRAVEL_DEG[1]))),
        ),
        groups=groups,
    )


def _columns(answer: Any, size: int) -> Mapping[str, NDArray[np.float64]]:
    table = answer if hasattr(answer, "keys") else {"angle_deg": answer}
    out = {str(name): np.asarray(table[name], dtype=np.float64) for name in ("angle_deg", "current_a") if name in table}
    for name, values in out.items():
        if values.shape != (size,):
            raise ParameterError(f"prior: {name} has shape {values.shape}: must be one value per sample, ({size},)")
        if not np.isfinite(values).all():
            raise ParameterError(f"prior: {name} is not finite at sample {int(np.argmin(np.isfinite(values)))}")
    return out
