"""Every seeker on one problem: the best efficiency of the virtual bench, with its noise, from a far start."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import EngineBench, LoopCriteria
from mgdd.optimize import (
    BoundedSeeking,
    ExtremumSeeking,
    GoldenSection,
    GradientDescent,
    NewtonSeeking,
    Optimum,
    Spsa,
    tune,
)
from mgdd.optimize.tuning import Tuning
from mgdd.plot.style import drawn
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.studies.base import Progress, StudyResult, check_seeds, finish, run_parts
from mgdd.studies.load_step_learning import LAWS, Learned, learn
from mgdd.studies.statistics import bands, loops, rms, with_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_seeker_comparison"]

START_CAD, BOUNDS_CAD, CYCLES, ARRIVAL_CAD, NOISE_PERCENT = -20.0, (-30.0, 10.0), 2000, 1.0, 0.25
_SHOWN, _BAND_SEEDS = 600, 50


@dataclass(frozen=True, kw_only=True)
class _Contender:
    name: str
    settings: str
    seeker: Any


@dataclass(frozen=True, kw_only=True)
class _Outcome:
    row: dict[str, Any]
    bands: NDArray[np.float64]
    table: xr.Dataset


def run_seeker_comparison(
    *, seeds: int = 50, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Compare every seeker on the same engine, noise, start and budget of 2000 cycles.

    The problem is the gross efficiency of the virtual bench with its default noise (0.3 CAD scatter of combustion,
    0.25 points of efficiency), from SOC -20 °CA aTDC, without limits. Every seeker has its default settings except
    where ``settings`` says so; those called tuned are what `mgdd.optimize.tune` makes of noise, curvature and
    distance. Iterative learning solves another task, a load step that is repeated, and has a table of its own.

    Parameters
    ----------
    seeds : int
        Runs of each seeker.
    quick : bool
        At most six seeds.
    figures : bool
        Draw figures.
    progress : callable, optional
        Called with a short text before each part.

    Returns
    -------
    StudyResult
        Rows ``seeker settings cycles_to_1_cad share_arrived rms_cad final_cad j_lost`` with the 95 % interval of each
        mean: first cycle within 1 CAD of the optimum and the share of seeds that get there, rms error over cycles 1000
        to 2000, mean estimate of the last 100, mean loss of J against the optimum over cycles 1000 to 2000 (dither,
        jitter, and 0.002 points by the scatter of combustion). ``summary["iterative_learning"]`` has one row per law.

    Raises
    ------
    mgdd.errors.ParameterError
        Fewer than one seed.

    References
    ----------
    Tan (2018), chapter 3, surveys these methods; the numbers are of this package's own bench.

    Examples
    --------
    >>> from mgdd.studies.seeker_comparison import run_seeker_comparison
    >>> result = run_seeker_comparison(seeds=2, quick=True, figures=False)
    >>> min(row["share_arrived"] for row in result.summary["rows"])
    1.0
    """
    seeds = min(check_seeds(seeds), 6) if quick else check_seeds(seeds)
    best = EngineBench().find_optimum()
    contenders = _contenders(best)
    parts = [(c.name, partial(_run, c, best, seeds)) for c in contenders]
    done, interrupted = run_parts(parts, progress)
    learned: list[Learned] = []
    if not interrupted:
        laws = [(f"iterative learning, {law}", partial(learn, law, min(seeds, 20))) for law in LAWS]
        learned, interrupted = run_parts(laws, progress)
    dataset = _dataset(done, learned, best)
    summary = {
        "study": "seeker-comparison",
        "seeds": seeds,
        "rows": [outcome.row for outcome in done],
        "iterative_learning": [own.row() for own in learned],
        "iterative_learning_seeds": min(seeds, 20),
        "optimum_cad": best["soc_cad"],
        "curvature_percent_per_cad2": best.curvature,
        "start_cad": START_CAD,
        "cycles": CYCLES,
        "interrupted": interrupted,
    }
    return finish(dataset, to_jsonable(summary), _draw if figures else None)


def _contenders(best: Optimum) -> list[_Contender]:
    box: dict[str, Any] = {"start": START_CAD, "lower": BOUNDS_CAD[0], "upper": BOUNDS_CAD[1]}
    wish: dict[str, Any] = {"distance": best["soc_cad"] - START_CAD, "arrival": ARRIVAL_CAD}
    batch = tune(NOISE_PERCENT, best.curvature, method="batch", **wish)
    spsa = tune(NOISE_PERCENT, best.curvature, method="spsa", **wish)
    dither = "amplitude 1, period 10, gain 0.98"
    return [
        _Contender(name="extremum seeking, batch", settings=dither, seeker=ExtremumSeeking(**box, gain=0.98)),
        _Contender(name="extremum seeking, batch, tuned", settings=_short(batch), seeker=batch.seeker(**box)),
        _Contender(
            name="extremum seeking, vanishing dither",
            settings=f"{dither}, floor 0.3 below slope 0.2",
            seeker=ExtremumSeeking(**box, gain=0.98, amplitude_floor=0.3, full_gradient=0.2),
        ),
        _Contender(
            name="extremum seeking, moving average",
            settings=dither,
            seeker=ExtremumSeeking(**box, gain=0.98, form="moving_average"),
        ),
        _Contender(
            name="extremum seeking, washout",
            settings=f"{dither}, pole 0.9",
            seeker=ExtremumSeeking(**box, gain=0.98, form="washout"),
        ),
        _Contender(
            name="Newton extremum seeking",
            settings="amplitude 2, period 10, time constant 40, held 300",
            seeker=NewtonSeeking(**box, initial_hessian=-0.051, initial_inverse=-20.0, largest_inverse=100.0),
        ),
        _Contender(
            name="bounded extremum seeking",
            settings="amplitude 1, period 10, kappa 1",
            seeker=BoundedSeeking(**box, kappa=1.0),
        ),
        _Contender(name="SPSA, first order", settings="a 20, c 1.5, decreasing", seeker=Spsa(**box, gain=20.0)),
        _Contender(name="SPSA, tuned", settings=_short(spsa), seeker=spsa.seeker(**box)),
        _Contender(
            name="SPSA, second order",
            settings="a 3, c 1.5, decreasing",
            seeker=Spsa(**box, form="second_order", initial_hessian=-0.051),
        ),
        _Contender(
            name="SPSA, one measurement",
            settings="a 20, c 1.5, decreasing",
            seeker=Spsa(**box, form="one_measurement", gain=20.0),
        ),
        _Contender(
            name="two-sided differences", settings="step size 15, c 1", seeker=GradientDescent(**box, step_size=15.0)
        ),
        _Contender(
            name="golden section",
            settings=f"noise {NOISE_PERCENT:g}",
            seeker=GoldenSection(**box, noise_sd=NOISE_PERCENT),
        ),
    ]


def _short(tuning: Tuning) -> str:
    if tuning.method == "spsa":
        return f"a {tuning.gain:.2f}, c {tuning.amplitude:.2f}, constant"
    return f"amplitude {tuning.amplitude:.2f}, period {tuning.period}, gain {tuning.gain:.2f}"


def _run(contender: _Contender, best: Optimum, seeds: int) -> _Outcome:
    seeker = contender.seeker
    table = loops(
        EngineBench(),
        seeker,
        range(seeds),
        cycles=CYCLES,
        criteria=LoopCriteria(optimum=best["soc_cad"], arrival=ARRIVAL_CAD),
    )

    def make(seed: int) -> tuple[EngineBench, Any]:
        fresh = Spsa(**{**seeker.settings, "seed": seed}) if isinstance(seeker, Spsa) else copy.deepcopy(seeker)
        return EngineBench(seed=seed), fresh

    row = {
        "seeker": contender.name,
        "settings": contender.settings,
        **with_interval("cycles_to_1_cad", table["cycles_to"]),
        "share_arrived": float(np.isfinite(table["cycles_to"]).mean()),
        "rms_cad": rms(table["rms_cad"]),
        **with_interval("final_cad", table["final_cad"]),
        **with_interval("j_lost", best.value - table["mean_j"]),
    }
    return _Outcome(row=row, bands=bands(make, range(min(seeds, _BAND_SEEDS)), _SHOWN), table=table)


def _dataset(done: Sequence[_Outcome], learned: Sequence[Learned], best: Optimum) -> xr.Dataset:
    cad, dims = "°CA aTDC", ("seeker", "cycle")
    tracks = np.stack([outcome.bands for outcome in done])

    def by_seed(name: str) -> list[NDArray[np.float64]]:
        return [outcome.table[name].to_numpy() for outcome in done]

    own = ("seeker", "seed")
    seeds = done[0].table["seed"].to_numpy().astype(np.int64)
    variables: dict[str, tuple[Any, ...]] = {
        "seeker": ("seeker", [outcome.row["seeker"] for outcome in done], "-", "seeker"),
        "seed": ("seed", seeds, "-", "seed"),
        "cycle": ("cycle", np.arange(_SHOWN)),
        "estimate_median_cad": (dims, tracks[:, 0], cad, "estimate of the best timing"),
        "estimate_low_cad": (dims, tracks[:, 1], cad, "10 % quantile of the estimate over seeds"),
        "estimate_high_cad": (dims, tracks[:, 2], cad, "90 % quantile of the estimate over seeds"),
        "cycles_to": (own, by_seed("cycles_to"), "-", "first cycle within 1 °CA of the optimum"),
        "rms_cad": (own, by_seed("rms_cad"), "°CA", "rms error of the estimate, second half"),
        "final_cad": (own, by_seed("final_cad"), cad, "mean estimate of the last 100 cycles"),
        "mean_j": (own, by_seed("mean_j"), "%", "mean J, second half"),
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
    from matplotlib.figure import Figure

    from mgdd import plot
    from mgdd.plot.learning import learning as learning_curves

    names = dataset["seeker"].to_numpy()
    columns = 4
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(11.0, 2.0 * rows + 0.4), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    tracks = dataset[["estimate_median_cad", "estimate_low_cad", "estimate_high_cad", "optimum_cad"]]
    for index, ax in enumerate(axes.flat):
        if index < len(names):
            plot.convergence(tracks.isel(seeker=[index]), ax=ax)
            ax.get_legend().remove()
            ax.set_title(str(names[index]), loc="left", fontsize="small")
            ax.set(xlabel="", ylabel="")
            ax.tick_params(labelbottom=index + columns >= len(names))
        else:
            ax.remove()
    figure.supylabel("estimate of the best timing [°CA aTDC]", fontsize="medium")
    figure.supxlabel("engine cycle [-]", fontsize="medium")
    out = {"Estimate over cycles: median of the seeds, with the band that holds 80 % of them": figure}
    if "law" in dataset:
        out["Iterative learning of a repeated load step"] = drawn(learning_curves, dataset, size=(6.6, 3.8))
    return out
