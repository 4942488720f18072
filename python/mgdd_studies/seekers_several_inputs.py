"""Seekers of several inputs: a Gaussian process with and without a guide beside tuned dithers, also under limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.optimize import GaussianProcessSeeking, Seeker
from mgdd.results.labels import labelled_dataset
from mgdd_studies import several_maps as maps
from mgdd_studies import three_input_bench as three
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.guide_cases import verdicts
from mgdd_studies.seekers_several_inputs_figures import draw
from mgdd_studies.statistics import with_interval, with_median_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["run_seekers_several_inputs"]

_QUICK_CYCLES, _QUICK_SEEDS = 120, 6
_SHOWN_MAP, _SHOWN_SEED, _SHOWN_CYCLES, _SHOWN_NODES = "coupled", 3, 60, 81

PLAIN = three.PLAIN
BENT, OFF, USELESS = (f"{PLAIN}, guide {what}" for what in ("bent by half", "off by a fifth", "of no use"))
TUNED_SPSA, TUNED_DITHER = "SPSA by tune", "extremum seeking by tune"

Make = Callable[[maps.SeekingMap, Any, int], Seeker]  # map, start, seed


def _process(guide: Callable[[maps.SeekingMap, int], Any] | None) -> Make:
    def make(field: maps.SeekingMap, start: Any, seed: int) -> Seeker:
        given = None if guide is None else guide(field, seed)
        return GaussianProcessSeeking(start=start, bounds=(field.lower, field.upper), guide=given)

    return make


def _tuned(method: str) -> Make:
    def make(field: maps.SeekingMap, start: Any, seed: int) -> Seeker:
        unit = (field.upper - field.lower) / maps.WIDTH
        return maps.tuned_seeker(field, start, seed, method, field.curvature / unit**2)

    return make


_ON_MAPS: dict[str, Make] = {
    PLAIN: _process(None),
    BENT: _process(maps.bent_by_half),
    OFF: _process(maps.off_by_a_fifth),
    USELESS: _process(maps.of_no_use),
    TUNED_SPSA: _tuned("spsa"),
    TUNED_DITHER: _tuned("batch"),
}


@dataclass(frozen=True, kw_only=True)
class _Runs:
    """One seeker on one map: J lost by what was applied and by the estimate, over seed and cycle [points]."""

    field: str
    inputs: int
    seeker: str
    lost: NDArray[np.float64]
    estimate_lost: NDArray[np.float64]

    def row(self) -> dict[str, Any]:
        near = self.estimate_lost <= maps.NEAR * self.inputs
        arrivals = np.where(near.any(axis=1), near.argmax(axis=1), math.inf)
        return {
            "map": self.field,
            "inputs": self.inputs,
            "seeker": self.seeker,
            **with_interval("j_lost", self.lost.mean(axis=1)),
            **with_interval("j_lost_early", self.lost[:, : maps.EARLY].mean(axis=1)),
            **with_median_interval("cycles_to_near", arrivals),
            "never_near_percent": 100.0 * float(np.isinf(arrivals).mean()),
            "away_at_end_percent": 100.0 * float(np.mean(~near[:, -1])),
            "j_lost_at_end": float(self.estimate_lost[:, -1].mean()),
        }


@dataclass(frozen=True, kw_only=True)
class _Path:
    """One run in the plane of the inputs, shape (cycles, inputs)."""

    seeker: str
    applied: NDArray[np.float64]
    estimate: NDArray[np.float64]


def run_seekers_several_inputs(
    *, n_seeds: int = 50, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Compare seekers of two and three inputs of unlike units, and of timing, EGR and boost under two limits.

    Four maps: a coupled quadratic, a skewed one and a ridge of two inputs, a coupled quadratic of three; noise of 0.3
    points. The start is 12 fortieths of the bounds away from the best input, whose place is drawn. The Gaussian process
    has its defaults, without a guide or with one of three: the map itself with 1.5 times its bend, the map moved by a
    fifth of the bounds in every input, and waves that say nothing. SPSA and extremum seeking are made by
    `mgdd.optimize.tune`, which is given noise and curvature.

    On the virtual bench both limits hold the optimum back: 118 bar of maximum pressure, 150 ppm of NOx by the fast
    sensor. There the guide is the cycle model with 30 % more wall heat, of J alone or of both limits too; SPSA and
    extremum seeking are untouched but for a period of 20 cycles.

    Parameters
    ----------
    n_seeds : int
        Runs per seeker and map, and per seeker on the bench.
    quick : bool
        At most six seeds, and 120 instead of 300 cycles on the maps.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows ``map inputs seeker``: mean J lost per cycle by what was applied, without its noise [points], over all
        cycles and the first 40; median number of readings until the estimate first loses less than 0.03 points per
        input; shares of runs in which it never does, and whose last estimate loses more [%]; J lost by that one.
        ``summary["bench"]``: steady J of the constrained optimum less that of the estimate after 40 and 200 cycles
        [points], share of estimates after 40 cycles beyond a limit, share of cycles whose value without noise is above
        one, and the worst of them [%]. ``summary["bars"]``: what was demanded, the worst case, and whether all met it.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("seekers-several-inputs", n_seeds=4, quick=True).summary["rows"]
    >>> lost = {row["seeker"]: row["j_lost"] for row in rows if row["map"] == "coupled"}
    >>> 2.0 * lost["Gaussian process"] < lost["SPSA by tune"]
    True
    """
    n_seeds = check_seeds(n_seeds, quick=quick, most=_QUICK_SEEDS)
    cycles = _QUICK_CYCLES if quick else maps.CYCLES
    work = Parts(progress)
    best = three.bench_optimum()
    done = work(
        (f"{field.name}, {seeker}", partial(_on_map, field.name, seeker, n_seeds, cycles))
        for field in maps.several_maps()
        for seeker in _ON_MAPS
    )
    paths = work((f"path, {seeker}", partial(_path, seeker)) for seeker in (PLAIN, OFF, TUNED_SPSA, TUNED_DITHER))
    bench = work((f"bench, {seeker}", partial(three.on_bench, seeker, n_seeds, best)) for seeker in three.SEEKERS)
    rows, bench_rows = [own.row() for own in done], [own.row() for own in bench]
    return work.finish(
        "seekers-several-inputs", _dataset(done, paths, bench), draw if figures else None,
        seeds=n_seeds,
        cycles=cycles,
        rows=rows,
        bench=bench_rows,
        bench_optimum={**best.inputs, "j": best.value},
        bars=_bars(rows, bench_rows),
    )  # fmt: skip


def _field(name: str) -> maps.SeekingMap:
    return next(field for field in maps.several_maps() if field.name == name)


def _on_map(name: str, seeker: str, n_seeds: int, cycles: int) -> _Runs:
    field = _field(name)
    lost, estimate_lost = np.empty((2, n_seeds, cycles))
    for seed in range(n_seeds):
        setting = field.setting(seed, True)
        own = _ON_MAPS[seeker](field, setting.start, seed)
        for cycle in range(cycles):
            estimate_lost[seed, cycle] = setting.lost(own.estimate)
            applied = own.ask()
            lost[seed, cycle] = setting.lost(applied)
            own.tell(setting.read(applied))
    return _Runs(field=name, inputs=len(field.lower), seeker=seeker, lost=lost, estimate_lost=estimate_lost)


def _path(seeker: str) -> _Path:
    field = _field(_SHOWN_MAP)
    setting = field.setting(_SHOWN_SEED, True)
    own = _ON_MAPS[seeker](field, setting.start, _SHOWN_SEED)
    applied, estimate = np.empty((2, _SHOWN_CYCLES, len(field.lower)))
    for cycle in range(_SHOWN_CYCLES):
        estimate[cycle] = own.estimate
        applied[cycle] = own.ask()
        own.tell(setting.read(applied[cycle]))
    return _Path(seeker=seeker, applied=applied, estimate=estimate)


def _bars(rows: Sequence[dict[str, Any]], bench: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    lost = {(row["map"], row["seeker"]): row["j_lost"] for row in rows}
    plain = [row for row in rows if row["seeker"] == PLAIN]

    def over(seeker: str, *others: str) -> list[float | None]:
        """J lost by a seeker over that of the best of others, on the maps that all have run."""
        return [
            lost[row["map"], seeker] / min(lost[row["map"], other] for other in others)
            for row in plain
            if all((row["map"], name) in lost for name in (seeker, *others))
        ]

    on_bench = {row["seeker"]: row for row in bench}
    known = [on_bench[name] for name in (PLAIN, three.GUIDED, three.LIMITS_TOO) if name in on_bench]
    return verdicts([
        ("no guide: readings until near, median [cycles]", [row["cycles_to_near"] for row in plain], 15.0),
        ("no guide: runs that never are near [%]", [row["never_near_percent"] for row in plain], 5.0),
        ("no guide: runs whose last estimate is not near [%]", [row["away_at_end_percent"] for row in plain], 5.0),
        ("no guide: loss over that of the better tuned dither [-]", over(PLAIN, TUNED_SPSA, TUNED_DITHER), 0.5),
        ("guide bent by half: loss over that without a guide [-]", over(BENT, PLAIN), 0.9),
        ("guide off by a fifth: loss over that without a guide [-]", over(OFF, PLAIN), 1.05),
        ("guide of no use: loss over that without a guide [-]", over(USELESS, PLAIN), 1.1),
        ("bench: loss of the estimate after 40 cycles [points]", [row["j_lost_after_40"] for row in known], 0.1),
        ("bench: cycles truly above a limit [%]", [row["above_percent"] for row in known], 1.0),
        ("bench: worst value above a limit [%]", [row["worst_percent"] for row in known], 10.0),
    ])  # fmt: skip


def _dataset(done: Sequence[_Runs], paths: Sequence[_Path], bench: Sequence[three.OnBench]) -> xr.Dataset:
    rows = [own.row() for own in done]
    points = "points"
    variables: dict[str, tuple[Any, ...]] = {
        "case": ("case", np.arange(len(done)), "-", "seeker on map"),
        "map": ("case", [own.field for own in done], "-", "map"),
        "seeker": ("case", [own.seeker for own in done], "-", "seeker"),
        "seed": ("seed", np.arange(done[0].lost.shape[0]), "-", "seed"),
        "cycle": ("cycle", np.arange(done[0].lost.shape[1])),
        **{
            f"j_lost{end}": (
                "case",
                [row[f"j_lost{end}"] for row in rows],
                points,
                f"loss of the objective per cycle{text}",
            )
            for end, text in (("", ""), ("_low", ", low end of the interval"), ("_high", ", high end of the interval"))
        },
        "mean_j_lost": (
            ("case", "cycle"),
            [own.lost.mean(axis=0) for own in done],
            points,
            "loss of the objective, mean of the seeds",
        ),
    }
    return labelled_dataset(variables | _path_variables(paths) | three.bench_variables(bench))


def _path_variables(paths: Sequence[_Path]) -> dict[str, tuple[Any, ...]]:
    if not paths:
        return {}
    field = _field(_SHOWN_MAP)
    setting = field.setting(_SHOWN_SEED, False)
    soc, egr = np.linspace(field.lower, field.upper, _SHOWN_NODES).T
    lost = [[setting.lost(np.array([a, b])) for b in egr] for a in soc]
    over, cad = ("path", "path_cycle"), "°CA aTDC"
    each = {"applied": [own.applied for own in paths], "estimate": [own.estimate for own in paths]}
    return {
        "path": ("path", [own.seeker for own in paths], "-", "seeker"),
        "path_cycle": ("path_cycle", np.arange(_SHOWN_CYCLES), "-", "engine cycle"),
        "map_soc_cad": ("map_soc_cad", soc, cad, "timing"),
        "map_egr": ("map_egr", egr, "-", "EGR rate"),
        "map_j_lost": (("map_soc_cad", "map_egr"), lost, "points", "loss of the objective, without noise"),
        **{f"{name}_soc_cad": (over, [one[:, 0] for one in own], cad, f"timing, {name}") for name, own in each.items()},
        **{f"{name}_egr": (over, [one[:, 1] for one in own], "-", f"EGR rate, {name}") for name, own in each.items()},
    }
