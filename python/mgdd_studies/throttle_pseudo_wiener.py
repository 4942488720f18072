"""Three pseudo-Wiener models on two throttles: what each can do in free run, and what corrected, ahead of now."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.errors import ParameterError
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.optimize import FitOptions
from mgdd.plot.style import BLACK, BLUE, GREY, ORANGE, new_figure
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import Throttle
from mgdd_studies.base import Parts, Progress, StudyResult
from mgdd_studies.figures import names_of
from mgdd_studies.throttle_cases import DURATION_S, NOISE_DEG, RECORDS, SAMPLE_S, judged_run, noisy_records

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_throttle_pseudo_wiener"]

KINDS = ("pw_r", "pw_w", "pw_p")  # friction inside, strict Wiener, Wiener with play
HORIZONS = (5, 20, 50)
_STYLES = {"pw_r": (BLUE, "-"), "pw_w": (ORANGE, "--"), "pw_p": (GREY, "-.")}
GROWTH = (1, 2, 5, 10, 20, 35, 50, 75, 100)
# A higher level of friction at rest than in the models, and the inductance: neither is in a pseudo-Wiener model.
_STICTION_NM = {"P1": 0.30, "P2": 0.11}


def run_throttle_pseudo_wiener(
    *, starts: int = 24, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Fit PW-R, PW-W and PW-P to a chirp of two simulated throttles and test them on two other records.

    Parameters
    ----------
    starts : int
        A fifth of the searches per fit of PW-W and PW-P with their lags at rest, half of those where the better start
        rule of the lags is kept.
    quick : bool
        At most six starts.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``plant model lag_start fit_train_percent fit_chirp_percent fit_steps_percent ahead_5_ms_deg
        ahead_20_ms_deg ahead_50_ms_deg starts n_best``: free-run fits without the first 50 ms, and the RMS error
        against the true angle of the prediction ``measured(k) + simulated(k + H) - simulated(k)`` on the validation
        chirp. ``n_best`` counts the searches that ended at the best fit. Every record starts at limp-home without duty,
        so ``lag_start`` is *rest* in the first rows; *best* also lets the lags start from the first angle. The row
        *persistence* predicts that nothing moves.

    References
    ----------
    Tan (2018), section 7.2.4, for the question; the throttles are simulated and the numbers of this package.

    Examples
    --------
    >>> from mgdd_studies.throttle_pseudo_wiener import run_throttle_pseudo_wiener
    >>> rows = run_throttle_pseudo_wiener(starts=1, figures=False).summary["rows"]
    >>> rows[0]["model"], rows[0]["fit_steps_percent"] > 96.0
    ('pw_r', True)
    """
    if starts < 1:
        raise ParameterError.of("starts", starts, ">= 1")
    count = min(starts, 6) if quick else starts
    cases = [(kind, "rest") for kind in KINDS] + [("pw_w", "best"), ("pw_p", "best")]
    work = Parts(progress)
    done = work(
        (f"{kind} on {plant}, lags from {rule}", partial(_judge, plant, kind, rule, count))
        for plant in ("P1", "P2")
        for kind, rule in cases
    )
    rows = [row for row, _ in done]
    done = [(row, extra) for row, extra in done if row["lag_start"] == "rest"]
    for plant in dict.fromkeys(row["plant"] for row in rows):
        named = {"plant": plant, "model": "persistence", "lag_start": None}
        still = _columns(None, _ahead(_records(plant)["chirp"], None, HORIZONS))
        rows.append({**named, **still, "starts": None, "n_best": None})
    return work.finish(
        "throttle-pseudo-wiener", _dataset(done), _draw if figures else None,
        seeds=0,
        rows=rows,
        parameters=[{"plant": row["plant"], "model": row["model"], **extra["parameters"]} for row, extra in done],
        duration_s=DURATION_S,
        noise_deg=NOISE_DEG,
    )  # fmt: skip


def study_throttle(plant: str) -> Throttle:
    """Give the preset with more friction at rest than in motion."""
    throttle: Throttle = presets.load(plant).throttle
    return throttle.replace(friction="stribeck", stiction_nm=_STICTION_NM[plant])


def _records(plant: str) -> dict[str, xr.Dataset]:
    return noisy_records(study_throttle(plant), [np.random.default_rng(seed) for seed in range(len(RECORDS))])


def _judge(plant: str, kind: str, rule: str, starts: int) -> tuple[dict[str, Any], dict[str, Any]]:
    logs = _records(plant)
    limp_home = study_throttle(plant).limp_home_deg
    # PW-P at rest ends in a flat valley of no play: one search in thirty reaches its floor.
    count = None if kind == "pw_r" else 5 * starts if rule == "rest" else starts
    fit = fit_pseudo_wiener(
        logs["train"], kind, limp_home_deg=limp_home, lag_start=rule, options=FitOptions(n_starts=count)
    )
    judged = {name: judged_run(fit.model, log) for name, log in logs.items()}
    runs = {name: run["model_deg"].to_numpy() for name, (run, _) in judged.items()}
    free = {name: percent for name, (_, percent) in judged.items()}
    ahead = _ahead(logs["chirp"], runs["chirp"], HORIZONS)
    row = {
        "plant": plant,
        "model": kind,
        "lag_start": rule,
        **_columns(free, ahead),
        "starts": len(fit.start_rmse),
        "n_best": fit.n_best,
    }
    extra = {
        "parameters": dict(fit.parameters),
        "steps": (logs["steps"], runs["steps"]),
        "growth": _ahead(logs["chirp"], runs["chirp"], GROWTH),
        "persistence": _ahead(logs["chirp"], None, GROWTH),
    }
    return row, extra


def _columns(free: dict[str, float] | None, ahead: list[float]) -> dict[str, float | None]:
    fits = {f"fit_{name}_percent": None if free is None else free[name] for name in RECORDS}
    return {**fits, **{f"ahead_{h}_ms_deg": error for h, error in zip(HORIZONS, ahead, strict=True)}}


def _ahead(log: xr.Dataset, simulated: NDArray[np.float64] | None, horizons: tuple[int, ...]) -> list[float]:
    """RMS of measured(k) + simulated(k + H) - simulated(k) against the true angle [deg]."""
    measured, true = log["angle_deg"].to_numpy(), log["true_deg"].to_numpy()
    run = np.zeros_like(true) if simulated is None else simulated
    errors = [measured[:-h] + run[h:] - run[:-h] - true[h:] for h in horizons]
    return [float(np.sqrt(np.mean(error**2))) for error in errors]


def _dataset(done: list[tuple[dict[str, Any], dict[str, Any]]]) -> xr.Dataset:
    cases = [f"{row['plant']} {row['model']}" for row, _ in done]
    log = done[0][1]["steps"][0]
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", cases, "-", "plant and model"),
        "time_s": ("time_s", log["time_s"].to_numpy(), "s", "time"),
        "horizon_s": ("horizon_s", np.array(GROWTH) * SAMPLE_S, "s", "horizon"),
        "angle_deg": (("case", "time_s"), [e["steps"][0]["angle_deg"].to_numpy() for _, e in done], "deg", "angle"),
        "model_deg": (("case", "time_s"), [e["steps"][1] for _, e in done], "deg", "angle of the free run"),
        "n_step_rms_deg": (("case", "horizon_s"), [e["growth"] for _, e in done], "deg", "RMS prediction error"),
        "persistence_deg": (
            ("case", "horizon_s"),
            [e["persistence"] for _, e in done],
            "deg",
            "RMS error of persistence",
        ),
    }
    for name in RECORDS:
        column = f"fit_{name}_percent"
        variables[column] = ("case", [row[column] for row, _ in done], "%", f"free-run fit, {name}")
    return labelled_dataset(variables)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    cases = names_of(dataset, "case")
    horizon_ms = 1e3 * dataset["horizon_s"].to_numpy()
    window = dataset.sel(time_s=slice(0.0, 4.0))
    out: dict[str, Figure] = {}
    for plant in dict.fromkeys(case.split()[0] for case in cases):
        own = [case for case in cases if case.startswith(plant)]
        runs = new_figure(7.4, 3.8)
        left = runs.add_subplot()
        left.plot(window["time_s"], window["angle_deg"].sel(case=own[0]), color=BLACK, label="measured")
        ahead = new_figure(7.4, 3.8)
        right = ahead.add_subplot()
        right.plot(horizon_ms, dataset["persistence_deg"].sel(case=own[0]), ":", color=BLACK, label="persistence")
        for case in own:
            kind = case.split()[1]
            color, line = _STYLES[kind]
            left.plot(window["time_s"], window["model_deg"].sel(case=case), line, color=color, label=kind)
            right.plot(horizon_ms, dataset["n_step_rms_deg"].sel(case=case), line, color=color, label=kind)
        left.set(xlabel="time [s]", ylabel="angle [deg]")
        left.legend(ncols=4)
        right.set(xlabel="horizon [ms]", ylabel="RMS prediction error [deg]", xscale="log", yscale="log")
        right.legend()
        out[f"{plant}: free run on random steps"] = runs
        out[f"{plant}: error ahead of the last measurement, validation chirp"] = ahead
    return out
