"""Guided seeking on any plant that takes a start of combustion: the virtual bench, or one behind a bus."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mgdd import presets
from mgdd.engine import Performance
from mgdd.errors import Interrupted, ParameterError
from mgdd.guide import CurveSeeking, GuidedEngine, ModelOptimum
from mgdd.loop import LoopCriteria, Plant, run_seeker
from mgdd.loop.plant_loop import LoopRun
from mgdd.optimize import ExtremumSeeking, Limit
from mgdd.plot.style import drawn
from mgdd.results.labels import to_jsonable
from mgdd.rig.experiment.outcome import Outcome
from mgdd.rig.experiment.settings import SeekTask, scaled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from mgdd.optimize import Seeker
    from mgdd.presets.preset import Preset

__all__ = ["SeekPlan", "engine_named"]

_START_CAD = -20.0
_DITHER_CAD = 1.0  # amplitude of extremum seeking
_ARRIVAL_CAD = 1.0


def engine_named(name: str, folder: Path) -> Preset:
    """Load the engine of a preset or of a TOML file."""
    beside = folder / name
    return presets.load(beside if beside.is_file() else name, kind="engine")


class SeekPlan:
    """A seeker and what guides it, made and checked before anything moves.

    Parameters
    ----------
    task : SeekTask
        What is asked.
    folder : pathlib.Path
        Where files of the task are looked for.
    """

    def __init__(self, task: SeekTask, *, folder: Path) -> None:
        self.task = task
        if not task.lower_cad < task.upper_cad:
            raise ParameterError.of("seek.lower_cad", task.lower_cad, f"< upper_cad, {task.upper_cad:g}")
        known = engine_named(task.model, folder)
        cylinder = scaled(known.cylinder, task.scale, "seek")
        self.point = known.point
        self.model = ModelOptimum(
            cylinder, performance=Performance.efficiency_only(), bounds_cad=(task.lower_cad, task.upper_cad)
        )
        best = self.model(self.point)
        self.guide_cad = None if best is None else float(best["soc_cad"])
        if task.guide != "none" and self.guide_cad is None:
            raise ParameterError(
                f"seek.model {task.model}: has no best timing between {task.lower_cad:g} and {task.upper_cad:g} °CA: "
                "move the bounds or change scale"
            )
        curve = self.model.curve(self.point) if task.guide == "curve" else None
        self._curve = curve
        room = 0.0 if task.guide == "curve" else _DITHER_CAD
        start = task.start_cad
        if start is None:
            start = _START_CAD if self.guide_cad is None or task.guide == "none" else self.guide_cad
            start = min(max(start, task.lower_cad + room), task.upper_cad - room)
        elif not task.lower_cad + room <= start <= task.upper_cad - room:
            raise ParameterError.of(
                "seek.start_cad", start, f"in [{task.lower_cad + room:g}, {task.upper_cad - room:g}] °CA aTDC"
            )
        self.start_cad = start

    @property
    def samples(self) -> int:
        """How many cycles it takes."""
        return self.task.cycles

    def seeker(self) -> Seeker | GuidedEngine:
        """Make the seeker, at its beginning."""
        task = self.task
        limits = [Limit(name, upper) for name, upper in task.limits.items()]
        if self._curve is not None:
            curves = self.model.limit_curves(self.point, list(task.limits)) if limits else None
            return CurveSeeking(
                start=self.start_cad, lower=task.lower_cad, upper=task.upper_cad, curve=self._curve, limits=limits,
                limit_curves=curves,
            )  # fmt: skip
        plain = ExtremumSeeking(
            start=self.start_cad, lower=task.lower_cad, upper=task.upper_cad, amplitude=_DITHER_CAD, limits=limits
        )
        return plain if task.guide == "none" else GuidedEngine(plain, self.model, self.point, keep_start=True)

    def run(self, plant: Plant, most: int | None = None) -> Outcome:
        """Run it on a plant, for at most so many cycles."""
        cycles = self.task.cycles if most is None else min(self.task.cycles, most)
        criteria = LoopCriteria(arrival=_ARRIVAL_CAD, limits=dict(self.task.limits) or None)
        try:
            run = run_seeker(plant, self.seeker(), cycles, criteria=criteria)
        except Interrupted as stop:
            if not isinstance(stop.partial, LoopRun):
                raise
            run = stop.partial
        summary = {name: value for name, value in run.summary.items() if value == value}
        said = {"guide": self.task.guide, "guide_cad": self.guide_cad, "start_cad": self.start_cad}
        return Outcome(
            figures=to_jsonable(
                {**said, "cycles": run.dataset.sizes["cycle"], **summary, "findings": [str(f) for f in run.findings]}
            ),
            dataset=run.dataset,
            interrupted=run.interrupted,
            drawings={"seek": partial(_draw, run.dataset, dict(self.task.limits))},
        )


def _draw(cycles: xr.Dataset, limits: dict[str, float]) -> Figure:
    from mgdd import plot

    return drawn(plot.seeking, cycles, size=(8.0, 7.0), optimum_cad=None, limit_values=limits)
