"""Faults of a throttle under a supervisor: how soon it is safe, for which reason, and how far the plate goes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.control import Pid, SupervisedController, ThrottleSupervisor
from mgdd.loop import ThrottleFault, VirtualThrottle
from mgdd.plot.style import new_figure
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import SensorPair, Throttle, characteristics
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.throttle_cases import Baseline, baselines, controller_of, supervisor_of, throttle_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mgdd.control.supervised import Controller

__all__ = ["run_throttle_faults"]

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


def _opens(time_s: float) -> float:
    """40 deg, 60 deg from the onset to the repair."""
    return 60.0 if ONSET_S <= time_s < REPAIR_S else 40.0


@dataclass(frozen=True)
class FaultCase:
    """One scenario: what the supervisor must report, faults of the plant, and the mode that it must go to."""

    reason: str
    faults: tuple[ThrottleFault, ...] = ()
    mode: str = "limp_home"
    reference_deg: Callable[[float], float] = field(default=_opens, repr=False, kw_only=True)  # of the time [s]
    # From when on the supervisor can see the fault [s], or that of a run.
    visible_s: float | Callable[[FaultRun], float] = field(default=ONSET_S, repr=False, kw_only=True)
    repair_s: float = field(default=REPAIR_S, kw_only=True)
    returns: bool = field(default=True, kw_only=True)  # whether the springs can bring the plate to limp-home meanwhile

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
        throttle=throttle, time_s=np.array([k * SAMPLE_S for k in range(n)]), reference_deg=array["reference"],
        angle_deg=array["angle"], speed_deg_per_s=array["speed"], duty=array["duty"], bridge_open=array["open"] > 0.0,
        mode=array["mode"].astype(np.int64), reason=reasons, refused=answers[early], accepted=answers[last],
    )  # fmt: skip


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
    band = characteristics(run.throttle, inside)
    up = (run.reference_deg - run.angle_deg > 2.0) & (run.duty > band["duty_breakaway_up"].to_numpy())
    down = (run.reference_deg - run.angle_deg < -2.0) & (run.duty < band["duty_breakaway_down"].to_numpy())
    return _first_lasting(run, (up | down) & (run.speed_deg_per_s == 0.0))


def _unsprung(run: FaultRun) -> float:
    """Say when it is driven closed slowly above limp-home, where a spring would have done so, for 20 ms [s]."""
    return _first_lasting(run, (run.duty < 0.0) & (np.abs(run.speed_deg_per_s) < SLOW_DEG_PER_S))


def _throttle(
    kind: str, from_s: float = ONSET_S, until_s: float = REPAIR_S, size: float | None = None
) -> tuple[ThrottleFault, ...]:
    return (ThrottleFault(kind=kind, from_s=from_s, until_s=until_s, size=size),)


def _sensor(kind: str, sensor: int, size: float = 0.0) -> tuple[ThrottleFault, ...]:
    return (ThrottleFault(kind=kind, sensor=sensor, from_s=ONSET_S, until_s=_SENSOR_END_S, size=size),)


_MOVING = ONSET_S + 0.015  # the plate is on its way
_SENSOR_END_S = ONSET_S + 0.15  # before the check of the pair itself would latch
CASES: dict[str, FaultCase] = {
    "NaN measurement": FaultCase("missing_sample", _throttle("nan_sample", _MOVING), visible_s=_MOVING),
    "no measurement": FaultCase("missing_sample", _throttle("missing_sample", _MOVING), visible_s=_MOVING),
    "three samples missing": FaultCase(
        "missing_sample", _throttle("missing_sample", _MOVING, until_s=_MOVING + 0.003), "holding", visible_s=_MOVING
    ),
    "stale measurement": FaultCase("stale_sample", _throttle("stale_sample", _MOVING), visible_s=_MOVING),
    "sensors disagree": FaultCase("sensor_disagreement", _sensor("offset", 2, 0.3), repair_s=_SENSOR_END_S),
    "first sensor stuck": FaultCase(
        "sensor_disagreement", _sensor("stuck", 1), visible_s=_differ, repair_s=_SENSOR_END_S
    ),
    "first sensor open wire": FaultCase("sensor_range", _sensor("open_wire", 1), repair_s=_SENSOR_END_S),
    "jammed at rest": FaultCase("jammed", _throttle("jammed", 0.9), visible_s=_stands, returns=False),
    "jammed in flight": FaultCase("jammed", _throttle("jammed_at", 0.9, size=50.0), visible_s=_stands, returns=False),
    "broken spring": FaultCase(
        "spring_lost", _throttle("spring_above", 0.99), reference_deg=_closes, visible_s=_unsprung, returns=False
    ),
    "supply 8 V": FaultCase("supply_low", _throttle("supply_sag", size=8.0), "limited"),
    "supply 5 V": FaultCase("supply_lost", _throttle("supply_sag", size=5.0)),
    "reference above the travel": FaultCase("reference_range", (), "limited", reference_deg=_asks(95.0)),
    "reference below the travel": FaultCase("reference_range", (), "limited", reference_deg=_asks(-5.0)),
    "no reference": FaultCase("missing_reference", reference_deg=_asks(math.nan)),
}
SHOWN = ("sensors disagree", "jammed in flight")


def run_throttle_faults(
    *, n_seeds: int = 3, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Run every labelled fault against PID and sliding mode on every preset, watched by a supervisor.

    The plate is at rest at 40 deg; at 1 s the reference steps to 60 deg (or closes slowly, or leaves the travel) and
    the fault sets in; an acknowledgement is tried while it lasts, and again well after its end.

    Parameters
    ----------
    n_seeds : int
        Noise realisations; the rows hold the worst of them.
    quick : bool
        Preset P1 and one seed only.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``fault preset controller mode reason visible_ms safe_ms beyond_deg return_ms kept recovered``: time from
        the onset until the fault can be seen and from there until the reference is limited or the bridge open [ms], the
        largest angle above reference and start [deg], time from the open bridge to the limp-home band [ms] (None
        where it never comes), whether the early acknowledgement was refused and the late one led back to normal.

    Notes
    -----
    The supervisor is a monitor of simulations and test rigs, not a certified safety function.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("throttle-faults", quick=True, figures=False).summary["rows"]
    >>> max(row["safe_ms"] for row in rows) <= 50.0, all(row["recovered"] for row in rows)
    (True, True)
    """
    n_seeds = 1 if quick else check_seeds(n_seeds)
    names = presets.available("throttle")[: 1 if quick else None]
    chosen = [b for b in baselines().values() if b.preset in names]
    work = Parts(progress)
    done = work((f"{b.preset}, {_label(b)}", partial(_all_cases, b, n_seeds)) for b in chosen)
    return work.finish(
        "throttle-faults", _dataset(done[0][1]), _draw if figures else None,
        seeds=n_seeds,
        rows=[row for rows, _ in done for row in rows],
    )  # fmt: skip


def _label(baseline: Baseline) -> str:
    return "PID" if baseline.kind is Pid else "sliding mode"


def _all_cases(baseline: Baseline, n_seeds: int) -> tuple[list[dict[str, Any]], dict[str, FaultRun]]:
    """Give a row per fault, and the runs of those that are shown."""
    rows, shown = [], {}
    throttle = throttle_of(baseline.preset)
    for name, case in CASES.items():
        runs = [
            run_case(case, throttle, controller_of(baseline), supervisor_of(baseline.preset), seed=seed)
            for seed in range(n_seeds)
        ]
        figures = [figures_of_run(case, run) for run in runs]
        row = {"fault": name, "preset": baseline.preset, "controller": _label(baseline)}
        for key in figures[0]:
            row[key] = _worst([one[key] for one in figures])
        rows.append(row)
        if name in SHOWN:
            shown[name] = runs[0]
    return rows, shown


def _worst(values: list[Any]) -> Any:
    """Give the largest number, whether all are true, or the text that differs from the first if any does."""
    if isinstance(values[0], bool):
        return all(values)
    if isinstance(values[0], str):
        return next((value for value in values if value != values[0]), values[0])
    return None if any(value is None for value in values) else max(values)


def figures_of_run(case: FaultCase, run: FaultRun) -> dict[str, Any]:
    """Give what a row says of one run."""
    wanted = MODES.index(case.mode)
    visible = case.seen_s(run)
    during = (run.time_s >= ONSET_S) & (run.time_s < case.repair_s)
    first = int(np.argmax(during & (run.mode >= wanted)))
    asked = np.fmax(
        np.clip(run.reference_deg, run.throttle.closed_deg, run.throttle.open_deg),
        run.angle_deg[round(ONSET_S / SAMPLE_S)],
    )
    returned = None
    if case.mode == "limp_home":
        there = run.bridge_open & (np.abs(run.angle_deg - run.throttle.limp_home_deg) <= 1.0)
        opened = int(np.argmax(run.bridge_open))
        if case.returns and there.any():
            returned = float(1e3 * (run.time_s[int(np.argmax(there))] - run.time_s[opened]))
    until_told = run.mode[first : round(ACKNOWLEDGE_S / SAMPLE_S)]
    kept = case.mode == "holding" or (run.refused == case.reason and bool((until_told == wanted).all()))
    return {
        "mode": MODES[int(run.mode[during].max())],
        "reason": run.reason[first],
        "visible_ms": 1e3 * (visible - ONSET_S),
        "safe_ms": 1e3 * max(0.0, float(run.time_s[first]) - visible),
        "beyond_deg": float(np.fmax(0.0, np.nanmax((run.angle_deg - asked)[during]))),
        "return_ms": returned,
        "kept": kept,
        "recovered": run.accepted == "none" and bool(run.mode[-1] == 0) and abs(run.angle_deg[-1] - 40.0) < 0.5,
    }


def _dataset(shown: dict[str, FaultRun]) -> xr.Dataset:
    runs = list(shown.values())

    def column(name: str, units: str, text: str) -> tuple[tuple[str, str], Any, str, str]:
        return ("fault", "time_s"), np.array([getattr(run, name) for run in runs]), units, text

    return labelled_dataset(
        {
            "fault": ("fault", list(shown), "-", "fault"),
            "time_s": ("time_s", runs[0].time_s),
            "reference_deg": column("reference_deg", "deg", "wanted plate angle"),
            "angle_deg": column("angle_deg", "deg", "plate angle"),
            "duty": column("duty", "-", "duty"),
            "bridge_open": column("bridge_open", "-", "bridge open"),
            "mode": column("mode", "-", "mode: " + ", ".join(f"{k} {name}" for k, name in enumerate(MODES))),
        },
        attrs={"preset": "P1", "controller": "PID", "limp_home_deg": runs[0].throttle.limp_home_deg},
    )


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    figure = new_figure(6.8, 6.0)
    grid = figure.subplots(3, dataset.sizes["fault"], sharex=True, sharey="row", squeeze=False)
    for column, name in enumerate(dataset["fault"].to_numpy()):
        run = dataset.sel(fault=name, time_s=slice(0.9, 3.3))
        time = run["time_s"]
        angle, duty, mode = grid[:, column]
        angle.set_title(str(name))
        angle.plot(time, run["reference_deg"], color="0.6", label="reference")
        angle.plot(time, run["angle_deg"], label="plate")
        angle.axhline(dataset.attrs["limp_home_deg"], color="0.6", linestyle=":", linewidth=0.8)
        duty.plot(time, run["duty"])
        mode.step(time, run["mode"], where="post")
        mode.set_yticks(range(len(MODES)), MODES)
        mode.set_xlabel("time, s")
    grid[0, 0].set_ylabel("plate angle, deg")
    grid[0, 0].legend()
    grid[1, 0].set_ylabel("duty, -")
    return {"Angle, duty and mode over time for two faults, P1 with PID": figure}
