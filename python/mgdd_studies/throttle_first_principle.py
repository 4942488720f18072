"""Identification of the first-principle throttle from noisy logs, also where the plant does more than the model."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.first_principle_problem import groups_problem
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset
from mgdd.throttle import Throttle, characteristics
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.statistics import with_interval
from mgdd_studies.throttle_cases import LSB_DEG, NOISE_DEG, judged_run, noisy_records

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["run_throttle_first_principle"]

# Name in mgdd.throttle.groups, name of the fitted parameter, unit.
_GROUPS = (
    ("tau_s", "tau_s", "s"),
    ("gain_deg_per_s2", "gain_deg_per_s2_per_duty", "deg/s²"),
    ("preload_above", "beta_above_duty", "-"),
    ("spring_above_per_deg", "kappa_above_duty_per_deg", "1/deg"),
    ("coulomb", "delta_duty", "-"),
)
_SUBSTEPS = 4  # 0.25 ms at 1 kHz: the lag is then met within 5 %
_FITS = {"train": "train_percent", "chirp": "chirp_percent", "steps": "random_steps_percent"}


def run_throttle_first_principle(
    *, n_seeds: int = 5, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Fit the groups of the first-principle model to a chirp above limp-home, and test them on two other records.

    The log is the plant's angle with 0.03 deg of noise, rounded to 12 bits of 90 deg. The model has neither inductance
    nor a friction that falls with speed; two of the three plants have both.

    Parameters
    ----------
    n_seeds : int
        Noise records behind each figure.
    quick : bool
        Two seeds at most.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``case group unit true error_percent``, the mean error over seeds with its interval; ``summary["fits"]``
        has the free-run fit of the training record and of both test records in percent, without their first 50 ms.

    References
    ----------
    Tan (2018), section 7.2, whose tables and figures were not at hand; plants, records and numbers are of this package.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> fits = run_study("throttle-first-principle", n_seeds=1, quick=True, figures=False).summary["fits"]
    >>> all(fit["random_steps_percent"] > 90.0 for fit in fits)
    True
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=2)
    work = Parts(progress)
    done = work((name, partial(_case, name, throttle, n_seeds)) for name, throttle in _cases().items())
    return work.finish(
        "throttle-first-principle", _dataset(done), _draw if figures else None,
        seeds=n_seeds,
        rows=[row for rows, _, _ in done for row in rows],
        fits=[fit for _, fit, _ in done],
        noise_deg=NOISE_DEG,
        resolution_deg=LSB_DEG,
    )  # fmt: skip


def _cases() -> dict[str, Throttle]:
    p1, p2 = presets.load("P1").throttle, presets.load("P2").throttle
    return {
        "P1, as the model": p1.replace(inductance_mh=0.0),
        "P1 with inductance and Stribeck friction": p1.replace(friction="stribeck", stiction_nm=0.3),
        "P2 with inductance and Stribeck friction": p2,
    }


def _case(name: str, throttle: Throttle, n_seeds: int) -> tuple[list[dict[str, Any]], dict[str, Any], xr.Dataset]:
    """Give the rows of the groups, the row of the fits, and the last free run over the random steps."""
    truth = characteristics(throttle)
    errors: dict[str, list[float]] = {fitted: [] for _, fitted, _ in _GROUPS}
    quality: dict[str, list[float]] = {record: [] for record in _FITS}
    for seed in range(n_seeds):
        logs = noisy_records(throttle, [np.random.default_rng(seed)] * len(_FITS))
        problem = groups_problem(logs["train"])
        found = problem.search(problem.values, problem.free, substeps=_SUBSTEPS, tolerance=1e-10, max_iterations=60)
        model = FirstPrincipleModel(parameters=found.values, substeps=_SUBSTEPS, sample_s=problem.step_s)
        for own, fitted, _ in _GROUPS:
            errors[fitted].append(100.0 * (found.values[fitted] / float(truth[own]) - 1.0))
        for record, log in logs.items():
            run, percent = judged_run(model, log)
            quality[record].append(percent)
    rows = [
        {"case": name, "group": fitted, "unit": unit, "true": float(truth[own]),
         **with_interval("error_percent", errors[fitted])}
        for own, fitted, unit in _GROUPS
    ]  # fmt: skip
    fits: dict[str, Any] = {"case": name}
    for record, values in quality.items():
        fits |= with_interval(_FITS[record], np.array(values))
    return rows, fits, run


def _dataset(done: list[tuple[list[dict[str, Any]], dict[str, Any], xr.Dataset]]) -> xr.Dataset:
    runs = [run for _, _, run in done]
    stacked = {key: np.array([run[key].to_numpy() for run in runs]) for key in ("angle_deg", "model_deg")}
    both = ("case", "time_s")
    return labelled_dataset(
        {
            "case": ("case", [fit["case"] for _, fit, _ in done], "-", "case"),
            "time_s": ("time_s", runs[0]["time_s"].to_numpy()),
            "angle_deg": (both, stacked["angle_deg"]),
            "model_deg": (both, stacked["model_deg"]),
            "residual_deg": (both, stacked["model_deg"] - stacked["angle_deg"], "deg", "model minus measured angle"),
        },
        attrs={"kind": "first_principle"},
    )


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    from mgdd.plot.throttle import free_run

    return {
        f"Free run over random steps of 150 ms, {name}": drawn(free_run, dataset.sel(case=name), size=(7.2, 4.8))
        for name in dataset["case"].to_numpy()
    }
