"""How well each controller follows on throttles that it does not know, all tuned alike, and what unsettles them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mgdd.control import GuidedPredictive
from mgdd.loop import Reference, track, track_many, tuned_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.tune import draw_throttles
from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import Throttle
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import legend_outside
from mgdd_studies.statistics import mean_interval
from mgdd_studies.throttle_cases import throttle_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["driving", "run_throttle_tracking"]

DELAY_SAMPLES = 1
SEED = 2026  # not that of the tuner
_FEW = ("guided", "linear_mpc", "pid")
_REST_S = 2.0
_PRESETS = ("P1", "P2", "P3")


def references() -> dict[str, Reference]:
    """Give references by the name of their columns: steps into 2 % or 0.2 deg, a sine, and a rest after a step."""
    steps = {"large": (20.0, 60.0), "small": (40.0, 42.0), "up": (4.0, 20.0), "down": (20.0, 4.0)}
    out = {
        name: Reference.step(a, b, after_s=0.6, band_deg=max(0.2, 0.02 * abs(b - a))) for name, (a, b) in steps.items()
    }
    out["sine"] = Reference.sine(40.0, 10.0, 1.0)
    rest = Reference.step(30.0, 40.0, hold_s=0.2, after_s=0.8 + _REST_S)
    out["rest"] = Reference(angle_deg=rest.angle_deg, from_s=1.0, name="rest")
    return out


@dataclass(frozen=True)
class Case:
    """What the throttles do that the controller does not know."""

    text: str
    spread: float = 0.2
    controllers: Sequence[str] = _FEW
    presets: Sequence[str] = _PRESETS
    bristles: bool = False
    air_nm: float = 0.0
    gusts_nm: float = 0.0
    late_samples: int = 0
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


_PLAIN: dict[str, Any] = {
    "friction_learning": False,
    "move_steps": (4, 6, 10),
    "duty_change_weight": 20.0,
    "observer_speed_per_s2": 43218.0,
}
CASES: Mapping[str, Case] = {
    "unknown": Case("100 throttles within 20 %", controllers=tuple(FAMILIES)),
    "far": Case("within 40 %", spread=0.4),
    "bristles": Case("presliding (LuGre)", bristles=True),
    "air": Case("air torque -0.2 N m", air_nm=-0.2, controllers=tuple(FAMILIES)),
    "gusts": Case("gusty air, -0.1 N m with 0.03 N m rms up to 20 Hz", air_nm=-0.1, gusts_nm=0.03),
    "late": Case("duty one sample later than given", late_samples=1),
    "weights": Case(
        "plain form, weights and switching",
        controllers=("plain", "soft", "no overshoot", "side as measured", "one move"),
        presets=("P1",),
        settings={
            "plain": _PLAIN,
            "soft": _PLAIN | {"duty_change_weight": 200.0},
            "no overshoot": _PLAIN | {"speed_weight": 1e-4},
            "side as measured": _PLAIN | {"switching": "measured"},
            "one move": _PLAIN | {"move_steps": (6, 1, 1)},
        },
    ),
}


def _guided(known: Throttle) -> GuidedPredictive:
    return cast("GuidedPredictive", tuned_controller("guided", known))


def controllers_of(case: Case, known: Throttle) -> dict[str, Any]:
    """Give the controllers of a case by name; they know the throttle of the preset only."""
    out: dict[str, Any] = {}
    for name in case.controllers:
        if name in case.settings:
            base = _guided(known)
            out[name] = GuidedPredictive(**{**base.settings, "speed_weight": 0.0, **case.settings[name]})
        else:
            out[name] = tuned_controller(name, known)
    return out


def throttles_of(case: Case, preset: str, n: int) -> list[Throttle]:
    """Draw the throttles of a case."""
    drawn = draw_throttles(throttle_of(preset), n, spread=case.spread, seed=SEED)
    if not case.bristles:
        return drawn
    width_rad = 0.0035  # 0.2 deg
    return [
        throttle.replace(
            friction="lugre",
            bristle_nm_per_rad=throttle.coulomb_nm / width_rad,
            bristle_damping_nms_per_rad=math.sqrt(throttle.coulomb_nm / width_rad * throttle.inertia_kgm2),
        )
        for throttle in drawn
    ]


def run_case(name: str, preset: str, n: int) -> xr.Dataset:
    """Run all controllers of a case on all its throttles."""
    case = CASES[name]
    wanted = references()
    flows: dict[str, NDArray[np.float64]] = {}
    if case.air_nm or case.gusts_nm:
        flows = {r.name: _air(case, len(r.angle_deg)) for r in wanted.values()}
    return track_many(
        controllers_of(case, throttle_of(preset)), list(wanted.values()), throttles_of(case, preset, n),
        delay_samples=DELAY_SAMPLES + case.late_samples, airflow_torque_nm=flows, first_seed=SEED,
    )  # fmt: skip


def _air(case: Case, n: int) -> NDArray[np.float64]:
    keep = math.exp(-2.0 * math.pi * 20.0 * 1e-3)
    white = np.random.default_rng(SEED).standard_normal(n) * math.sqrt(1.0 - keep**2)
    gusts = np.empty(n)
    last = 0.0
    for k in range(n):
        last = keep * last + white[k]
        gusts[k] = last
    return np.asarray(case.air_nm + case.gusts_nm * gusts, np.float64)


def row_of(name: str, preset: str, controller: str, runs: xr.Dataset) -> dict[str, Any]:
    """Give medians and 95th percentiles over the throttles of one controller; a run that never settles is infinite."""
    one = runs.sel(controller=controller)
    wanted = {column: one.sel(reference=reference.name) for column, reference in references().items()}
    row: dict[str, Any] = {"case": CASES[name].text, "preset": preset, "controller": controller}
    for column in ("large", "small", "up", "down"):
        settling = np.nan_to_num(wanted[column]["settling_ms"].to_numpy(), nan=np.inf)
        row[f"{column}_ms"], row[f"{column}_p95_ms"] = _pair(settling)
    row["small_mse_deg2"], row["small_mse_p95_deg2"] = _pair(wanted["small"]["mse_deg2"].to_numpy())
    row["sine_mse_deg2"], row["sine_mse_p95_deg2"] = _pair(wanted["sine"]["mse_deg2"].to_numpy())
    mean, low, high = mean_interval(wanted["large"]["mse_deg2"].to_numpy())
    row |= {"large_mse_deg2": mean, "large_mse_low": low, "large_mse_high": high}
    steps = [wanted[column] for column in ("large", "small", "up", "down")]
    row["static_p95_deg"] = _pair(np.concatenate([run["static_error_deg"].to_numpy() for run in steps]))[1]
    row["overshoot_p95_deg"] = _pair(wanted["large"]["overshoot_deg"].to_numpy())[1]
    row["variation_rest"] = _pair(wanted["rest"]["total_variation"].to_numpy())[0]
    row["variation_small"] = _pair(wanted["small"]["total_variation"].to_numpy())[0]
    cycles = np.max([run["limit_cycle_deg"].to_numpy() for run in [*steps, wanted["rest"]]], axis=0)
    row["limit_cycles"] = int((cycles > 0.5).sum())
    return row


def _pair(values: NDArray[np.float64]) -> tuple[float, float]:
    ordered = np.sort(values)
    return float(ordered[len(ordered) // 2]), float(ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))])


def driving() -> Reference:
    """Give 2 s of ordinary driving: slow and fast waves, and two visits below limp-home."""
    time_s = np.arange(2000) * 1e-3
    waves = 32.0 + 20.0 * np.sin(4.2 * time_s) + 9.0 * np.sin(14.6 * time_s + 1.0) - 40.0 * (time_s % 0.7 > 0.55)
    return Reference(angle_deg=np.clip(waves, 2.0, 85.0), name="driving")


def warm_rows(preset: str, n: int) -> list[dict[str, Any]]:
    """Give what a wrong friction or preload costs a cold controller, one warmed up for 2 s, and one that knows it."""
    judged = {
        "sine": Reference.sine(40.0, 10.0, 1.0, duration_s=3.0, skip_s=0.5),
        "crossing": Reference.sine(10.0, 8.0, 1.0, duration_s=3.0, skip_s=0.5),
    }
    known = throttle_of(preset)
    rows = []
    for fault, names in (
        ("friction 40 % higher", ("coulomb_nm", "stiction_nm")),
        ("preload 40 % higher", ("preload_above_nm", "preload_below_nm")),
    ):
        plant = known.replace(**{name: 1.4 * getattr(known, name) for name in names})
        mse: dict[str, list[list[float]]] = {"cold": [], "after 2 s": [], "known": []}
        for seed in range(n):
            cold = _guided(known)
            warm, exact = _guided(known), _guided(plant)
            track(warm, driving(), throttle=plant, delay_samples=DELAY_SAMPLES, seed=1000 + seed)
            start = _guided(known)
            start.learnt = warm.learnt
            for label, controller in (("cold", cold), ("after 2 s", start), ("known", exact)):
                state = controller.state
                found = []
                for reference in judged.values():
                    controller.state = state
                    if label == "after 2 s":
                        start.learnt = warm.learnt
                    found.append(float(track(controller, reference, throttle=plant, seed=seed)["mse_deg2"]))
                mse[label].append(found)
        for label, values in mse.items():
            sine, crossing = np.median(np.array(values), axis=0)
            named = {"preset": preset, "wrong": fault, "controller": label}
            rows.append({**named, "sine_mse_deg2": float(sine), "crossing_mse_deg2": float(crossing)})
    return rows


_KEPT = ("settling_ms", "mse_deg2", "static_error_deg", "overshoot_deg", "total_variation", "limit_cycle_deg")


def run_throttle_tracking(
    *, n_seeds: int = 100, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Compare the model-guided controller with its baselines on throttles drawn around the presets.

    Every controller knows the preset and the reference, all were tuned by `mgdd.loop.tune_controller` with the same
    cost and budget on other draws. Noise of 0.03 deg, 12 bits, a delay of one sample. Steps 20 to 60 deg (`large`), 40
    to 42 (`small`), 4 to 20 (`up`) and 20 to 4 (`down`, both across limp-home), a sine of 40 +- 10 deg at 1 Hz, and 2 s
    at rest.

    Parameters
    ----------
    n_seeds : int
        Throttles per preset, and noise seeds.
    quick : bool
        Four throttles around P1, the first case only.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows per case, preset and controller: medians and 95th percentiles (``_p95``) of settling times [ms] and mean
        square errors [deg²], mean and 95 % interval of the large step's mean square error, ``static_p95_deg``,
        ``overshoot_p95_deg``, total variation of the duty at rest and over the small step, and the number of throttles
        with a limit cycle above 0.5 deg. ``summary["warm"]``: mean square errors on throttles with 40 % more friction
        or preload, cold, after 2 s of driving, and for a controller that knows it.

    References
    ----------
    Tan (2018), sections 7.3 and 7.4: the questions of figures 7-25 to 7-35 and table 7-4; its numbers are not known.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("throttle-tracking", n_seeds=3, quick=True, figures=False).summary["rows"]
    >>> [row["controller"] for row in rows][:2]
    ['guided', 'mgdd1']
    """
    n = check_seeds(n_seeds, quick=quick, most=4)
    work = Parts(progress)
    jobs = [(name, preset) for name, case in CASES.items() for preset in case.presets]
    if quick:
        jobs = [("unknown", "P1")]
    runs = work((f"{CASES[name].text}, {preset}", partial(run_case, name, preset, n)) for name, preset in jobs)
    done = jobs[: len(runs)]
    rows = [
        row_of(name, preset, str(controller), run)
        for (name, preset), run in zip(done, runs, strict=True)
        for controller in run["controller"].to_numpy()
    ]
    text = "friction and preload 40 % wrong"
    warm = work((f"{text}, {preset}", partial(warm_rows, preset, min(n, 20))) for preset in (() if quick else _PRESETS))
    return work.finish(
        "throttle-tracking", _dataset(runs, done), _draw if figures else None,
        seeds=n,
        rows=rows,
        warm=[row for part in warm for row in part],
        delay_samples=DELAY_SAMPLES,
    )  # fmt: skip


def _dataset(runs: list[xr.Dataset], done: list[tuple[str, str]]) -> xr.Dataset:
    first = [(preset, run) for (name, preset), run in zip(done, runs, strict=True) if name == "unknown"]
    run = first[0][1]
    dims = ("preset", "throttle", "controller", "reference")
    return labelled_dataset(
        {
            "preset": ("preset", [preset for preset, _ in first], "-", "preset"),
            "throttle": ("throttle", run["throttle"].to_numpy(), "-", "number of the throttle"),
            "controller": ("controller", run["controller"].to_numpy(), "-", "controller"),
            "reference": ("reference", list(references()), "-", "reference"),
            **{name: (dims, np.stack([each[name].to_numpy() for _, each in first])) for name in _KEPT},
        }
    )


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:

    colors = dict(zip(FAMILIES, (BLUE, GREY, ORANGE, GREEN, BLACK, "#8c6bb1"), strict=True))
    dashes: tuple[Any, ...] = ("-", ":", "--", "-.", "-", (0, (6, 1, 1, 1, 1, 1)))  # each also readable without colour
    styles = dict(zip(FAMILIES, dashes, strict=True))
    figure = new_figure(7.2, 6.2)
    axes = figure.subplots(2, 2)
    wanted = references()
    plant = throttles_of(CASES["unknown"], "P1", 4)[3]
    for (left, right), name, window_ms in zip(axes, ("small", "large"), (120.0, 200.0), strict=True):
        reference = wanted[name]
        for kind in FAMILIES:
            run = track(tuned_controller(kind, throttle_of("P1")), reference, throttle=plant, seed=1)
            time_ms = 1e3 * (run["time_s"].to_numpy() - reference.from_s)
            shown = (time_ms >= -10.0) & (time_ms <= window_ms)
            look = {"linestyle": styles[kind], "color": colors[kind], "linewidth": 1.2}
            left.plot(time_ms[shown], run["angle_deg"].to_numpy()[shown], **look)
            settling = np.sort(dataset["settling_ms"].sel(preset="P1", controller=kind, reference=name).to_numpy())
            share = np.arange(1, len(settling) + 1) / len(settling)
            right.step(settling, share, label=FAMILIES[kind].label, **look)
        left.set_ylabel("plate angle [deg]")
        right.set_ylabel("share of the throttles [-]")
        right.set_xlim(0.0, 3.0 * window_ms)
        right.set_ylim(0.0, 1.02)
    axes[1][0].set_xlabel("time after the step [ms]")
    axes[1][1].set_xlabel("settling time [ms]")
    legend_outside(figure, axes[0][1], 3, size=None)
    caption = (
        "Steps of 2 and of 40 deg. Left: one throttle drawn around P1. Right: share of the drawn throttles that have "
        "settled by a time; a curve that ends below 1 has throttles that never settle"
    )
    return {caption: figure}
