"""Every seeker on one problem: the best efficiency of the virtual bench, with its noise, from a far start."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.loop import LoopCriteria, VirtualEngine
from mgdd.optimize import (
    ExtremumSeeking,
    GoldenSection,
    GradientDescent,
    IterativeLearning,
    Spsa,
    tune,
)
from mgdd.optimize.optimum import Optimum
from mgdd.optimize.tuning import Tuning
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import convergence_panels, names_of
from mgdd_studies.statistics import OVER_SEEDS, band_variables, estimates, loops, rms, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_seeker_comparison"]

_STEP_CYCLES, STEP_AT, LOW_MG, HIGH_MG = 40, 15, 12.0, 28.0
TARGET_CA50_CAD, FIRST_SOC_CAD = 9.0, -4.0
_LAG = 0.6 * 0.4 ** np.arange(_STEP_CYCLES)  # impulse response of the timing actuator, first order
LAWS: dict[str, dict[str, Any]] = {
    "p": {"law": "p"},
    "q_filter": {"law": "q_filter", "cutoff": 0.5},
    "norm_optimal": {"law": "norm_optimal"},
}


@dataclass(frozen=True, kw_only=True)
class Learned:
    """Error of CA50 by seed and trial [°CA], as rms over the cycles of a trial, and what the law promises."""

    law: str
    rms_cad: NDArray[np.float64]
    sigma_max: float

    def row(self) -> dict[str, Any]:
        """Give the row of this law."""
        over_seeds = [rms(column) for column in self.rms_cad.T]
        first = next((n for n, value in enumerate(over_seeds) if value <= 0.1 * over_seeds[0]), None)
        return {
            "law": self.law,
            "trials": len(over_seeds),
            "sigma_max": self.sigma_max,
            "first_rms_cad": over_seeds[0],
            "third_rms_cad": over_seeds[min(3, len(over_seeds) - 1)],
            "last_rms_cad": over_seeds[-1],
            "trials_to_a_tenth": first,
        }


def learn(law: str, n_seeds: int, *, trials: int = 12, scatter_cad: float = 0.3) -> Learned:
    """Learn the commanded timing of the load step trial by trial; the scatter of combustion differs in every trial."""
    points = [(0, OperatingPoint(fuel_mg=LOW_MG)), (STEP_AT, OperatingPoint(fuel_mg=HIGH_MG))]
    bench = VirtualEngine(schedule=points, soc_scatter_cad=scatter_cad, efficiency_noise_percent=0.0)
    errors = np.empty((n_seeds, trials))
    sigma_max = math.nan
    for seed in range(n_seeds):
        learner = IterativeLearning(
            np.full(_STEP_CYCLES, FIRST_SOC_CAD), impulse_response=_LAG, bounds=(-25.0, 8.0), **LAWS[law]
        )
        sigma_max = learner.convergence().sigma_max
        for trial in range(trials):
            bench.reset(seed * trials + trial)
            soc = FIRST_SOC_CAD + np.convolve(_LAG, learner.ask() - FIRST_SOC_CAD)[:_STEP_CYCLES]
            error = TARGET_CA50_CAD - bench.run(soc)["ca50_cad"].to_numpy()
            errors[seed, trial] = rms(error)
            learner.tell(error)
    return Learned(law=law, rms_cad=errors, sigma_max=sigma_max)


START_CAD, BOUNDS_CAD, CYCLES, ARRIVAL_CAD, NOISE_PERCENT = -20.0, (-30.0, 10.0), 2000, 1.0, 0.25
_SHOWN, _BAND_SEEDS = 600, 50


class _Contender(NamedTuple):
    name: str
    settings: str
    seeker: Any


@dataclass(frozen=True, kw_only=True)
class _Outcome:
    row: dict[str, Any]
    runs: NDArray[np.float64]
    table: xr.Dataset


def run_seeker_comparison(
    *, n_seeds: int = 50, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Compare every seeker on the same engine, noise, start and budget of 2000 cycles.

    The problem is the gross efficiency of the virtual bench with its default noise (0.3 CAD scatter of combustion,
    0.25 points of efficiency), from SOC -20 °CA aTDC, without limits. Every seeker has its default settings except
    where ``settings`` says so; those called tuned are what `mgdd.optimize.tune` makes of noise, curvature and
    distance. Iterative learning solves another task, a load step that is repeated, and has a table of its own.

    Parameters
    ----------
    n_seeds : int
        Runs of each seeker.
    quick : bool
        At most six seeds.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``seeker settings cycles_to_1_cad share_arrived rms_cad final_cad j_lost`` with the 95 % interval of each
        mean: first cycle within 1 CAD of the optimum and the share of seeds that get there, rms error over cycles 1000
        to 2000, mean estimate of the last 100, mean loss of J against the optimum over cycles 1000 to 2000 (dither,
        jitter, and 0.002 points by the scatter of combustion). ``summary["iterative_learning"]`` has one row per law.

    References
    ----------
    Tan (2018), chapter 3, surveys these methods; the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd_studies.seeker_comparison import run_seeker_comparison
    >>> result = run_seeker_comparison(n_seeds=2, quick=True, figures=False)
    >>> min(row["share_arrived"] for row in result.summary["rows"])
    1.0
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=6)
    work = Parts(progress)
    best = VirtualEngine().find_optimum()
    done = work((c.name, partial(_run, c, best, n_seeds)) for c in _contenders(best))
    learned = work((f"iterative learning, {law}", partial(learn, law, min(n_seeds, 20))) for law in LAWS)
    return work.finish(
        "seeker-comparison", _dataset(done, learned, best), _draw if figures else None,
        seeds=n_seeds,
        rows=[outcome.row for outcome in done],
        iterative_learning=[own.row() for own in learned],
        iterative_learning_seeds=min(n_seeds, 20),
        optimum_cad=best["soc_cad"],
        curvature_percent_per_cad2=best.curvature,
        start_cad=START_CAD,
        cycles=CYCLES,
    )  # fmt: skip


def _contenders(best: Optimum) -> list[_Contender]:
    box: dict[str, Any] = {"start": START_CAD, "bounds": BOUNDS_CAD}
    wish: dict[str, Any] = {"distance": best["soc_cad"] - START_CAD, "arrival": ARRIVAL_CAD}
    batch = tune(NOISE_PERCENT, best.curvature, method="batch", **wish)
    spsa = tune(NOISE_PERCENT, best.curvature, method="spsa", **wish)
    dither = "amplitude 1, period 10, gain 0.98"
    bend: dict[str, Any] = {"initial_hessian": -0.051}
    vanishing = ExtremumSeeking(**box, gain=0.98, amplitude_floor=0.3, full_gradient=0.2)
    return [
        _Contender("extremum seeking, batch", dither, ExtremumSeeking(**box, gain=0.98)),
        _Contender("extremum seeking, batch, tuned", _short(batch), batch.seeker(**box)),
        _Contender("extremum seeking, vanishing dither", f"{dither}, floor 0.3 below slope 0.2", vanishing),
        _Contender(
            "extremum seeking, moving average", dither, ExtremumSeeking(**box, gain=0.98, form="moving_average")
        ),
        _Contender(
            "extremum seeking, washout", f"{dither}, pole 0.9", ExtremumSeeking(**box, gain=0.98, form="washout")
        ),
        _Contender("SPSA, first order", "a 20, c 1.5, decreasing", Spsa(**box, gain=20.0)),
        _Contender("SPSA, tuned", _short(spsa), spsa.seeker(**box)),
        _Contender("SPSA, second order", "a 3, c 1.5, decreasing", Spsa(**box, **bend, form="second_order")),
        _Contender("two-sided differences", "step size 15, c 1", GradientDescent(**box, step_size=15.0)),
        _Contender("golden section", f"noise {NOISE_PERCENT:g}", GoldenSection(**box, noise_sd=NOISE_PERCENT)),
    ]


def _short(tuning: Tuning) -> str:
    if tuning.method == "spsa":
        return f"a {tuning.gain:.2f}, c {tuning.amplitude:.2f}, constant"
    return f"amplitude {tuning.amplitude:.2f}, period {tuning.period}, gain {tuning.gain:.2f}"


def _run(contender: _Contender, best: Optimum, n_seeds: int) -> _Outcome:
    seeker = contender.seeker
    table = loops(
        VirtualEngine(), seeker, range(n_seeds), cycles=CYCLES,
        criteria=LoopCriteria(optimum=best["soc_cad"], arrival=ARRIVAL_CAD),
    )  # fmt: skip

    def make(seed: int) -> tuple[VirtualEngine, Any]:
        fresh = Spsa(**{**seeker.settings, "seed": seed}) if isinstance(seeker, Spsa) else copy.deepcopy(seeker)
        return VirtualEngine(seed=seed), fresh

    row = {
        "seeker": contender.name,
        "settings": contender.settings,
        **with_interval("cycles_to_1_cad", table["cycles_to"]),
        "share_arrived": float(np.isfinite(table["cycles_to"]).mean()),
        "rms_cad": rms(table["rms_soc_cad"]),
        **with_interval("final_cad", table["final_soc_cad"]),
        **with_interval("j_lost", best.value - table["mean_j"]),
    }
    return _Outcome(row=row, runs=estimates(make, range(min(n_seeds, _BAND_SEEDS)), _SHOWN), table=table)


def _dataset(done: Sequence[_Outcome], learned: Sequence[Learned], best: Optimum) -> xr.Dataset:
    cad = "°CA aTDC"

    def by_seed(name: str) -> list[NDArray[np.float64]]:
        return [outcome.table[name].to_numpy() for outcome in done]

    own = ("seeker", "seed")
    seeds = done[0].table["seed"].to_numpy().astype(np.int64)
    variables: dict[str, tuple[Any, ...]] = {
        "seeker": ("seeker", [outcome.row["seeker"] for outcome in done], "-", "seeker"),
        "seed": ("seed", seeds, "-", "seed"),
        "cycle": ("cycle", np.arange(_SHOWN)),
        **band_variables("estimate_{}_cad", ("seeker", "cycle"), [outcome.runs for outcome in done], cad, OVER_SEEDS),
        "cycles_to": (own, by_seed("cycles_to"), "-", "first cycle within 1 °CA of the optimum"),
        "rms_cad": (own, by_seed("rms_soc_cad"), "°CA", "rms error of the estimate, second half"),
        "final_cad": (own, by_seed("final_soc_cad"), cad, "mean estimate of the last 100 cycles"),
        "mean_j": (own, by_seed("mean_j"), "%", "mean efficiency, second half"),
        "optimum_cad": ((), best["soc_cad"], cad, "optimum"),
    }
    if learned:
        trials = learned[0].rms_cad.shape[1]
        over_seeds = [[rms(column) for column in law.rms_cad.T] for law in learned]
        variables["law"] = ("law", [law.law for law in learned], "-", "learning law")
        variables["trial"] = ("trial", np.arange(trials), "-", "trial")
        variables["ca50_error_cad"] = (("law", "trial"), over_seeds, "°CA", "rms error of CA50 over the load step")
    return labelled_dataset(variables)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    from mgdd_studies.curves import learning as learning_curves

    tracks = dataset[["estimate_median_cad", "estimate_low_cad", "estimate_high_cad", "optimum_cad"]]
    names = names_of(dataset, "seeker")
    panels = [(name, tracks.isel(seeker=[at])) for at, name in enumerate(names)]
    figure = convergence_panels(panels, height=2.0 * -(-len(names) // 4) + 0.4)
    out = {"Estimate over cycles: median of the seeds, with the band that holds 80 % of them": figure}
    if "law" in dataset:
        out["Iterative learning of a repeated load step"] = drawn(learning_curves, dataset, size=(6.6, 3.8))
    return out
