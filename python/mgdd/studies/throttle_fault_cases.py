"""Faults of a throttle in the loop, each with its reference, when it can be seen, and what must follow."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mgdd.control import SupervisedController, ThrottleSupervisor
from mgdd.loop import ThrottleFault, VirtualThrottle
from mgdd.throttle import SensorFault, SensorPair, Throttle, holding_duty

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.control.supervised import Controller

__all__ = ["CASES", "FaultCase", "FaultRun", "run_case"]

MODES = ("normal", "holding", "limited", "limp_home")
SAMPLE_S = 1e-3
ONSET_S, REPAIR_S, ACKNOWLEDGE_S, LENGTH_S = 1.0, 2.0, 2.9, 3.4
SENSORS = SensorPair(noise_v=0.03 * 4.0 / 90.0, lag_s=0.0)  # 0.03 deg of noise, 12 bits
SLOW_DEG_PER_S, LASTS = 100.0, 20


@dataclass(frozen=True, kw_only=True)
class FaultRun:
    """What happened, sample by sample; the duty and the bridge are those ordered at the sample."""

    throttle: Throttle
    time_s: NDArray[np.float64]
    reference_deg: NDArray[np.float64]
    angle_deg: NDArray[np.float64]
    speed_deg_per_s: NDArray[np.float64]
    duty: NDArray[np.float64]
    bridge_open: NDArray[np.bool_]
    mode: NDArray[np.int64]
    reason: list[str]
    refused: str
    accepted: str


@dataclass(frozen=True, kw_only=True)
class FaultCase:
    """One scenario.

    Parameters
    ----------
    mode, reason : str
        What the supervisor must report.
    faults : tuple of SensorFault and ThrottleFault
        Of the plant.
    reference_deg : callable
        Of the time [s].
    visible_s : float or callable
        From when on the supervisor can see the fault [s], or that of a run.
    repair_s : float
        When the fault ends [s].
    returns : bool
        Whether the springs can bring the plate to limp-home meanwhile.
    """

    mode: str
    reason: str
    faults: tuple[SensorFault | ThrottleFault, ...] = ()
    reference_deg: Callable[[float], float] = field(repr=False)
    visible_s: float | Callable[[FaultRun], float] = field(default=ONSET_S, repr=False)
    repair_s: float = REPAIR_S
    returns: bool = True

    def seen_s(self, run: FaultRun) -> float:
        """From when on the fault could be seen in this run [s]."""
        return self.visible_s(run) if callable(self.visible_s) else self.visible_s


def run_case(
    case: FaultCase, throttle: Throttle, controller: Controller, supervisor: ThrottleSupervisor, *, seed: int = 0
) -> FaultRun:
    """Run a case from rest at 40 deg; orders act one sample late, an early acknowledgement is tried before the end."""
    plant = VirtualThrottle(
        throttle, inputs=("duty", "bridge_open"), sensors=SENSORS, faults=case.faults, start_deg=40.0, seed=seed
    )
    loop = SupervisedController(controller, supervisor)
    values = {"first_angle_deg": 40.0, "second_angle_deg": 40.0, "supply_v": throttle.supply_v}
    order = {"duty": 0.0, "bridge_open": 0.0}
    columns: dict[str, list[float]] = {name: [] for name in ("reference", "angle", "speed", "duty", "open", "mode")}
    reasons, answers = [], {}
    early, last = round((case.repair_s - 0.02) / SAMPLE_S), round(ACKNOWLEDGE_S / SAMPLE_S)
    n = round(LENGTH_S / SAMPLE_S)
    for k in range(n):
        reference = case.reference_deg(k * SAMPLE_S)
        acting, order = order, loop.step(reference, values)
        if k in (early, last):
            answers[k] = loop.acknowledge()
        plant.apply(acting)
        values = dict(plant.measure().values)
        row = (reference, values["angle_deg"], values["speed_deg_per_s"], order["duty"], order["bridge_open"])
        for name, value in zip(columns, (*row, MODES.index(loop.supervisor.mode)), strict=True):
            columns[name].append(value)
        reasons.append(loop.supervisor.reason)
    array = {name: np.array(values) for name, values in columns.items()}
    return FaultRun(
        throttle=throttle,
        time_s=np.array([k * SAMPLE_S for k in range(n)]),
        reference_deg=array["reference"],
        angle_deg=array["angle"],
        speed_deg_per_s=array["speed"],
        duty=array["duty"],
        bridge_open=array["open"] > 0.0,
        mode=array["mode"].astype(np.int64),
        reason=reasons,
        refused=answers[early],
        accepted=answers[last],
    )


def _opens(time_s: float) -> float:
    """40 deg, 60 deg from the onset to the repair."""
    return 60.0 if ONSET_S <= time_s < REPAIR_S else 40.0


def _closes(time_s: float) -> float:
    """40 deg, down to 20 deg at 40 deg/s from the onset, back after the repair."""
    return 40.0 if time_s >= REPAIR_S else 40.0 - min(max(time_s - ONSET_S, 0.0), 0.5) * 40.0


def _asks(outside_deg: float) -> Callable[[float], float]:
    return lambda time_s: outside_deg if ONSET_S <= time_s < REPAIR_S else 40.0


def _first(run: FaultRun, seen: NDArray[np.bool_]) -> float:
    """Time of the first sample from the onset on at which something is seen [s]; NaN if never."""
    seen = seen & (run.time_s >= ONSET_S)
    return float(run.time_s[int(np.argmax(seen))]) if seen.any() else math.nan


def _first_lasting(run: FaultRun, seen: NDArray[np.bool_]) -> float:
    """Give the same of what is seen for 20 ms on end, or until the bridge opens [s]."""
    seen = seen | run.bridge_open
    return _first(run, np.array([seen[k : k + LASTS].all() for k in range(seen.size)]))


def _differ(run: FaultRun) -> float:
    """Say when the plate has left the angle at which a sensor is stuck by the tolerance of 0.2 V [s]."""
    stuck_deg = run.angle_deg[round(ONSET_S / SAMPLE_S)]
    return _first(run, np.abs(run.angle_deg - stuck_deg) >= 4.5)


def _stands(run: FaultRun) -> float:
    """Say when it stands 2 deg from the reference under a duty that would move a whole one there, for 20 ms [s]."""
    inside = np.clip(run.angle_deg, run.throttle.closed_deg, run.throttle.open_deg)
    band = holding_duty(run.throttle, inside)
    up = (run.reference_deg - run.angle_deg > 2.0) & (run.duty > band["duty_breakaway_up"].to_numpy())
    down = (run.reference_deg - run.angle_deg < -2.0) & (run.duty < band["duty_breakaway_down"].to_numpy())
    return _first_lasting(run, (up | down) & (run.speed_deg_per_s == 0.0))


def _unsprung(run: FaultRun) -> float:
    """Say when it is driven closed slowly above limp-home, where a spring would have done so, for 20 ms [s]."""
    return _first_lasting(run, (run.duty < 0.0) & (np.abs(run.speed_deg_per_s) < SLOW_DEG_PER_S))


def _throttle(kind: str, from_s: float = ONSET_S, **more: float) -> tuple[ThrottleFault, ...]:
    return (ThrottleFault(kind=kind, from_s=from_s, **({"until_s": REPAIR_S} | more)),)


def _sensor(kind: str, sensor: int, size: float = 0.0) -> tuple[SensorFault, ...]:
    return (SensorFault(kind=kind, sensor=sensor, from_s=ONSET_S, until_s=_SENSOR_END_S, size=size),)


_MOVING = ONSET_S + 0.015  # the plate is on its way
_SENSOR_END_S = ONSET_S + 0.15  # before the check of the pair itself would latch

CASES: dict[str, FaultCase] = {
    "NaN measurement": FaultCase(
        mode="limp_home",
        reason="missing_sample",
        faults=_throttle("nan_sample", _MOVING),
        reference_deg=_opens,
        visible_s=_MOVING,
    ),
    "no measurement": FaultCase(
        mode="limp_home",
        reason="missing_sample",
        faults=_throttle("missing_sample", _MOVING),
        reference_deg=_opens,
        visible_s=_MOVING,
    ),
    "three samples missing": FaultCase(
        mode="holding",
        reason="missing_sample",
        faults=_throttle("missing_sample", _MOVING, until_s=_MOVING + 0.003),
        reference_deg=_opens,
        visible_s=_MOVING,
    ),
    "stale measurement": FaultCase(
        mode="limp_home",
        reason="stale_sample",
        faults=_throttle("stale_sample", _MOVING),
        reference_deg=_opens,
        visible_s=_MOVING,
    ),
    "sensors disagree": FaultCase(
        mode="limp_home",
        reason="sensor_disagreement",
        faults=_sensor("offset", 2, 0.3),
        reference_deg=_opens,
        repair_s=_SENSOR_END_S,
    ),
    "first sensor stuck": FaultCase(
        mode="limp_home",
        reason="sensor_disagreement",
        faults=_sensor("stuck", 1),
        reference_deg=_opens,
        visible_s=_differ,
        repair_s=_SENSOR_END_S,
    ),
    "first sensor open wire": FaultCase(
        mode="limp_home",
        reason="sensor_range",
        faults=_sensor("open_wire", 1),
        reference_deg=_opens,
        repair_s=_SENSOR_END_S,
    ),
    "jammed at rest": FaultCase(
        mode="limp_home",
        reason="jammed",
        faults=_throttle("jammed", 0.9),
        reference_deg=_opens,
        visible_s=_stands,
        returns=False,
    ),
    "jammed in flight": FaultCase(
        mode="limp_home",
        reason="jammed",
        faults=_throttle("jammed_at", 0.9, size=50.0),
        reference_deg=_opens,
        visible_s=_stands,
        returns=False,
    ),
    "broken spring": FaultCase(
        mode="limp_home",
        reason="spring_lost",
        faults=_throttle("spring_above", 0.99),
        reference_deg=_closes,
        visible_s=_unsprung,
        returns=False,
    ),
    "supply 8 V": FaultCase(
        mode="limited",
        reason="supply_low",
        faults=_throttle("supply_sag", size=8.0),
        reference_deg=_opens,
    ),
    "supply 5 V": FaultCase(
        mode="limp_home",
        reason="supply_lost",
        faults=_throttle("supply_sag", size=5.0),
        reference_deg=_opens,
    ),
    "reference above the travel": FaultCase(mode="limited", reason="reference_range", reference_deg=_asks(95.0)),
    "reference below the travel": FaultCase(mode="limited", reason="reference_range", reference_deg=_asks(-5.0)),
    "no reference": FaultCase(mode="limp_home", reason="missing_reference", reference_deg=_asks(math.nan)),
}
