"""A search of the best timing on the virtual bench: which seeker, with which guide, from where and how long."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mgdd._core.engine import Cylinder
from mgdd.errors import ConvergenceError, Interrupted, ParameterError, argument
from mgdd.guide import GuidedEngine, TimingMap
from mgdd.loop.bench import EngineBench
from mgdd.loop.criteria import LoopCriteria
from mgdd.loop.plant_loop import LoopRun
from mgdd.loop.seek import run_seeker
from mgdd.loop.seek_guides import CURVES, Guidance, guidance_of, guided_seeker, late_loss, with_start
from mgdd.loop.seek_limits import COV, COV_CYCLES, choose_start, doubts_of
from mgdd.loop.seek_task import Task, amplitude_of, default_cycles, make_seeker
from mgdd.optimize.optimum import Optimum

__all__ = ["TimingSearch", "TimingSearchRun"]

_LATE = ("extremum_seeking", "newton", "gaussian_process_seeking", None)  # None: a guide that is a seeker
_COV_TRIAL = 1000
_START_CAD = -20.0
_MOST_CYCLES = 2_000_000
_ARRIVAL_CAD, _STAYS_CAD = 1.0, 1.5


@dataclass(frozen=True, kw_only=True)
class TimingSearch:
    """What is to be sought on a bench, and how.

    Parameters
    ----------
    bench : EngineBench
        Where; its sensor, noise and limits are known to the seeker.
    method : {"extremum_seeking", "newton", "bounded", "spsa", "golden", "gaussian_process_seeking"}, optional
        Seeker; extremum_seeking if left out. A guide with a curve is a seeker itself.
    form : {"batch", "moving_average", "washout"}, optional
        Of extremum_seeking; batch if left out.
    start_cad : float, optional
        First SOC [°CA aTDC]; -20 if left out, or what of the bounds is nearest to it, with a guide its best timing,
        with limits a start whose noise-free values stay below them.
    lower_cad : float
        Earliest SOC [°CA aTDC].
    upper_cad : float
        Latest SOC [°CA aTDC].
    cycles : int, optional
        Length of the run; 2000 if left out, 300 of gaussian_process_seeking, behind a late analyser 16 time constants
        of the seeker, 4000 at least.
    limits : mapping of str to float
        Upper limits on indicators of the bench, or on ``cov_imep_percent``.
    limit_method : {"switching", "penalty", "barrier"}, optional
        How J knows of the limits: not at all, by a penalty or by a barrier; switching if left out.
    guide : {"none", "feed_forward", "curve", "calibrated", "map"}
        ``feed_forward``: the model's best timing, the seeker learns the rest; ``curve``: the model's whole curve,
        placed by the measurements; ``calibrated``: the same while the model learns from the measured pressure;
        ``map``: a table of timings as feed-forward.
    guide_shape : {"model", "parabola"}, optional
        Of the curve: the model's, which it is if left out, or a plain parabola about the model's best timing.
    guide_cylinder : Cylinder, optional
        Of the model; that of the bench if left out.
    guide_table : TimingMap, optional
        Of ``map``.

    Raises
    ------
    mgdd.errors.ParameterError
        Options that would act on nothing, or that do not go together.
    """

    bench: EngineBench
    method: str | None = None
    form: str | None = None
    start_cad: float | None = None
    lower_cad: float = -30.0
    upper_cad: float = 10.0
    cycles: int | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    limit_method: str | None = None
    guide: str = "none"
    guide_shape: str | None = None
    guide_cylinder: Cylinder | None = None
    guide_table: TimingMap | None = None

    def __post_init__(self) -> None:
        if len(self.bench.input_names) > 1:
            raise ParameterError(
                f"bench takes {', '.join(self.bench.input_names)}: a search of the timing takes a bench of soc_cad "
                "alone; use mgdd.loop.run_seeker with GaussianProcessSeeking"
            )
        self._check_guide()
        if self.method is None and not self.is_curve:
            object.__setattr__(self, "method", "extremum_seeking")
        self._check_method()
        for name, value in self.limits.items():
            if not math.isfinite(value):
                raise ParameterError(f"{argument('limits', f'{name}={value:g}')}: must be finite")
        low, high = self.bench.window_cad
        for name in ("lower_cad", "upper_cad"):
            value = getattr(self, name)
            if not low <= value <= high:
                bound = f"must be in [{low:g}, {high:g}], the window of the bench"
                raise ParameterError(f"{argument(name, f'{value:g}')}: {bound}")
        if not self.lower_cad < self.upper_cad:
            lower, upper = self._bounds_written()
            raise ParameterError(f"{lower}: must be below {upper}; move one of them")

    @property
    def is_curve(self) -> bool:
        """Whether the guide is a seeker itself."""
        return self.guide in CURVES

    def _bounds_written(self) -> tuple[str, str]:
        return argument("lower_cad", f"{self.lower_cad:g}"), argument("upper_cad", f"{self.upper_cad:g}")

    def _check_guide(self) -> None:
        said = argument("guide", self.guide)
        if self.is_curve:
            for name in ("method", "form"):
                if getattr(self, name) is not None:
                    plain = argument("guide", "none")
                    raise ParameterError(
                        f"{argument(name)} acts with {plain}, feed_forward or map: {said} is a seeker itself"
                    )
            late = self.bench.settings["nox_sensor"] == "analyser"
            if late and (self.guide != "curve" or self.guide_shape == "parabola"):
                soft, other = argument("nox_sensor", "soft"), argument("guide", "curve")
                raise ParameterError(
                    f"{said} takes J of the same cycle, and the NOx of the analyser is late: use {soft}, or {other} "
                    "with the model's shape"
                )
            if self.guide == "calibrated" and self.guide_shape == "parabola":
                shape, curve = argument("guide_shape", "parabola"), argument("guide", "curve")
                raise ParameterError(f"{shape}: a parabola cannot be calibrated; use {curve}, or model")
            if self.limit_method is not None:
                raise ParameterError(
                    f"{argument('limit_method')} does not act here; {said} keeps limits in its own way"
                )
        elif self.guide_shape is not None:
            why = {"none": "has no model", "map": "has a table, not a model"}.get(
                self.guide, "takes one timing, not a curve"
            )
            raise ParameterError(f"{argument('guide_shape')} does not act here; {said} {why}")
        if self.guide != "none" and self.method == "golden":
            golden = argument("method", "golden")
            raise ParameterError(f"{golden} searches its whole bracket, whatever the guide says: use another method")

    def _check_method(self) -> None:
        method = argument("method", self.method or "")
        seeking = argument("method", "extremum_seeking")
        if self.form is not None and self.method != "extremum_seeking":
            raise ParameterError(f"{argument('form')} acts with {seeking} only, not with {self.method}: leave it out")
        if self.limit_method is not None and not self.limits:
            limit = argument("limits", "NAME=X")
            raise ParameterError(f"{argument('limit_method')} acts with {limit} only: give a limit or leave it out")
        if self.cycles is not None and not 1 <= self.cycles <= _MOST_CYCLES:
            cycles = argument("cycles", str(self.cycles))
            raise ParameterError(
                f"{cycles}: must be in [1, {_MOST_CYCLES}]; mgdd.loop.run_seeker continues longer runs"
            )
        if self.limit_method is not None and self.method == "gaussian_process_seeking":
            raise ParameterError(
                f"{argument('limit_method')} does not act here; {method} keeps limits with a probability: leave it out"
            )
        if self.method == "bounded" and COV in self.limits:
            raise ParameterError(
                f"{method} reads limits off its own oscillation, and {COV} looks back {COV_CYCLES} cycles: use another "
                "method"
            )
        if self.bench.settings["nox_sensor"] == "analyser" and self.method not in _LATE:
            raise ParameterError(
                f"{method} takes J of the same cycle, and the analyser is late: use {argument('nox_sensor', 'soft')}, "
                f"or {seeking} or newton, which turn their demodulation back by the lag, or gaussian_process_seeking"
            )

    def find_optimum(self) -> Optimum:
        """Find where the seeker should end; COV of IMEP has no steady value, so it is judged there."""
        steady = {name: value for name, value in self.limits.items() if name != COV}
        best = self.bench.find_optimum(steady, bounds_cad=(self.lower_cad, self.upper_cad))
        if not best.curvature < 0.0:
            lower, upper = self._bounds_written()
            raise ConvergenceError(
                f"the performance has no maximum near {lower} to {upper} (curvature {best.curvature:.3g} at "
                f"{best.free_inputs['soc_cad']:.1f}): move the bounds"
            )
        if COV in self.limits:
            trial = copy.deepcopy(self.bench).run([best["soc_cad"]] * _COV_TRIAL)
            cov = float(trial["limits"].sel(limit=COV)[COV_CYCLES:].mean())
            if cov > self.limits[COV]:
                noise = ("efficiency_noise_percent", "soc_scatter_cad", "misfire_probability")
                lower = " or ".join((", ".join(map(argument, noise[:2])), argument(noise[2])))
                raise ConvergenceError(
                    f"{argument('limits', f'{COV}={self.limits[COV]:g}')}: the bench has {cov:.3g} % at its best "
                    f"timing, {best['soc_cad']:.1f}; raise the limit, or lower {lower}"
                )
        return best

    def run(self) -> TimingSearchRun:
        """Let the seeker run; Ctrl-C gives the cycles until then, ``interrupted``."""
        best, bounds = self.find_optimum(), (self.lower_cad, self.upper_cad)
        guided = None
        if self.guide != "none":
            own = {"cylinder": self.guide_cylinder, "shape": self.guide_shape, "table": self.guide_table}
            guided = guidance_of(self.guide, self.bench, bounds, **own)  # type: ignore[arg-type]
        task = Task(
            method=self.guide if self.is_curve else str(self.method),
            form=self.form or "batch",
            start_cad=_START_CAD if self.start_cad is None else self.start_cad,
            bounds_cad=bounds,
            seed=int(self.bench.settings["seed"]),
            noise_sd=float(self.bench.settings["efficiency_noise_percent"]),
            limits=self.limits,
            limit_method=self.limit_method or "switching",
            late=self.bench.settings["nox_sensor"] == "analyser",
            bench=self.bench,
            best=best,
        )
        reason = "default" if self.start_cad is None else "as given"
        if self.start_cad is None and guided is not None:
            task, reason = with_start(task, guided)
        elif self.start_cad is None:
            reach = amplitude_of(task)
            task = replace(task, start_cad=max(min(_START_CAD, bounds[1] - reach), bounds[0] + reach))
        if self.start_cad is None and self.limits:
            start, reason = choose_start(task, wanted=reason)
            task = replace(task, start_cad=start)
        seeker = make_seeker(task) if guided is None else guided_seeker(task, guided)
        cycles = default_cycles(task) if self.cycles is None else self.cycles
        goal = LoopCriteria(optimum=best["soc_cad"], arrival=_ARRIVAL_CAD)
        try:
            run = run_seeker(self.bench, seeker, cycles, criteria=goal)
        except Interrupted as stop:
            if not isinstance(stop.partial, LoopRun):
                raise
            run = stop.partial
        return TimingSearchRun(
            search=self, best=best, guided=guided, seeker=seeker, run=run, cycles=cycles, start_cad=task.start_cad,
            start_reason=reason,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TimingSearchRun:
    """What became of a search: the run, where it should have ended, where it started and why there."""

    search: TimingSearch
    best: Optimum
    guided: Guidance | None
    seeker: Any
    run: LoopRun
    cycles: int
    start_cad: float
    start_reason: str

    def doubts(self) -> list[str]:
        """Doubt a run whose first reading is above a limit."""
        bracketing = self.search.start_cad is None or self.search.method == "golden"
        remedy = f"narrow {argument('lower_cad')} to {argument('upper_cad')}"
        remedy = remedy if bracketing else f"leave {argument('start_cad')} out or move it"
        return doubts_of(self.run, self.search.limits, remedy)

    def guide_figures(self) -> dict[str, Any]:
        """Say what the guide did, and what every run is compared by."""
        guided, seeker = self.guided, self.seeker
        away = np.abs(self.run.dataset["estimate_cad"].to_numpy() - self.best["soc_cad"])
        outside = np.flatnonzero(away > _STAYS_CAD)
        stays = 0 if outside.size == 0 else int(outside[-1]) + 1
        sd, trust = getattr(seeker, "estimate_sd", math.nan), getattr(seeker, "trust", math.nan)
        out: dict[str, Any] = {
            "guide": self.search.guide,
            "guide_cad": None if guided is None else guided.guide_cad,
            "cycles_stays_1_5_cad": stays if stays < away.size else None,
            "late_loss_percent": late_loss(self.search.bench, self.run.dataset, self.best),
            "estimate_sd_cad": sd if math.isfinite(sd) else None,
            "trust": trust if math.isfinite(trust) else None,
        }
        if self.search.is_curve:
            out["guide_shape"] = self.search.guide_shape or "model"
        if isinstance(seeker, GuidedEngine) and self.search.guide == "calibrated":
            out |= {"guide_wall_heat_scale": seeker.cylinder.wall_heat_scale, "recalibrations": seeker.recalibrations}
        return out
