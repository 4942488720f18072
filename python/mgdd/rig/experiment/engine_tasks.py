"""Seek the best inputs of an engine, or a map of them, on any plant with the right inputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import presets
from mgdd.errors import Error, Interrupted, ParameterError, arguments_written
from mgdd.io.point_table import read_points
from mgdd.loop import Measurement, Plant, VirtualTestBed, seek_map
from mgdd.loop.closed_loop import stillness
from mgdd.loop.engine_guide import EngineGuide
from mgdd.loop.lower_limits import both_sides, measured_names
from mgdd.loop.map_result import MapSearch
from mgdd.loop.map_visits import dwell_of
from mgdd.loop.seek import require_cycles, searched, seek_inputs, started, tell_known
from mgdd.loop.seek_choice import Choice, Question, chosen
from mgdd.loop.seek_map import Progress, map_seeker, model_of, require_end
from mgdd.loop.seek_result import SeekResult
from mgdd.optimize.map_seeking import entries_of
from mgdd.plot.style import drawn
from mgdd.rig.experiment.settings import MapTask, SeekTask, beside, scaled
from mgdd.rig.experiment.tasks import Outcome, fewer

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from mgdd.engine import Cylinder, OperatingPoint
    from mgdd.presets.preset import Preset


def engine_named(name: str, folder: Path) -> Preset:
    """Load the engine of a preset or of a TOML file."""
    return presets.load(beside(folder, name), kind="engine")


class SeekPlan:
    """A search, made and checked before anything moves."""

    def __init__(self, task: SeekTask, *, folder: Path, seed: int) -> None:
        self.task = task
        self.bounds = {name: (low, high) for name, (low, high, *_) in task.inputs.items()}
        with _keys("seek", task):
            self._prepare(task, folder, seed)

    def _prepare(self, task: SeekTask, folder: Path, seed: int) -> None:
        cylinder, point = _model_of("seek", task, folder)
        guide = None
        if task.guide != "none":
            guide = EngineGuide(cylinder=cylinder, kind=task.guide, point=point)
        inputs = seek_inputs(task.inputs)
        self._asked = Question(
            inputs=inputs, start=started(task.start or None, inputs), limits=both_sides(task.limits),
            noise_sd=task.noise_sd, delay_cycles=task.delay_cycles or 0.0, lag_cycles=task.lag_cycles or 0.0,
            guide=guide, seed=seed, point=point, settings=dict(task.settings),
        )  # fmt: skip
        self._earlier_points = None if task.known is None else read_points(beside(folder, task.known))
        self._still = stillness(self._asked, task.tolerance or None)
        choice = self._chosen()
        self.samples = choice.cycles if task.cycles is None else task.cycles
        require_cycles(choice, self.samples)
        self.start = dict(zip(task.inputs, choice.seeker.estimate.tolist(), strict=True))

    def _chosen(self) -> Choice:
        choice = chosen(self._asked, self.task.seeker)
        if self._earlier_points is None:
            return choice
        return tell_known(self._asked, self.task.seeker, choice, self._earlier_points)[1]

    def estimate(self) -> dict[str, float]:
        """Give what the running seeker takes for the best inputs, and standard deviations: NaN where it has none."""
        best = self._running.estimate.tolist()
        sds = np.broadcast_to(getattr(self._running, "estimate_sd", math.nan), len(best)).tolist()
        named = zip(self.task.inputs, best, sds, strict=True)
        return {
            f"{what}.{name}": own[at] for name, *own in named for at, what in enumerate(("estimate", "estimate_sd"))
        }

    def run(self, plant: Plant, _first_cad: float, most: int | None = None) -> Outcome:
        """Run it on a plant, for at most so many cycles."""
        choice = self._chosen()
        self._running = choice.seeker
        try:
            result = searched(plant, choice, self._asked, fewer(self.samples, most), self._still)
        except Interrupted as stop:
            if not isinstance(stop.partial, SeekResult):
                raise
            result = stop.partial
        return Outcome(
            figures=result.to_dict() | {"guide": self.task.guide},
            dataset=result.run.dataset,
            interrupted=result.interrupted,
            drawings={"seek": partial(_drawn, "seeking", result.run.dataset, (8.0, 7.0))},
        )


class MapPlan:
    """A search for a map, made and checked before anything moves."""

    def __init__(self, task: MapTask, *, folder: Path, seed: int) -> None:
        self.task, self._visits, self._regret = task, 0, math.nan
        with _keys("map", task):
            self._prepare(task, folder, seed)

    def _prepare(self, task: MapTask, folder: Path, seed: int) -> None:
        cylinder, point = _model_of("map", task, folder)
        inputs, sides = seek_inputs(task.inputs), both_sides(task.limits)
        entries = entries_of(task.axes, list(task.inputs))
        guide: Any = (None, None)
        if task.guide == "model":
            bed = VirtualTestBed(cylinder, list(entries), point=point, limits=measured_names(sides),
                                 inputs=list(task.inputs))  # fmt: skip
            bed.require_cells(entries)
            guide = model_of(bed, cylinder, entries, inputs, [limit.name for limit in sides])
        require_end(task.visits, task.tolerance)
        dwell = dwell_of(task.averaged, task.settling, on_plant=True)
        self._made = partial(
            map_seeker, task.inputs, entries, dwell, task.settings, limits=sides, guide=guide[0],
            limit_guides=guide[1], start=started(task.start or None, inputs), smoothness=task.smoothness, seed=seed,
        )  # fmt: skip
        first = self._made().suggest()
        self.start = {**first.at, **first.inputs}
        self.bounds = {name: (float(column[0]), float(column[-1])) for name, column in entries.items()}
        self.bounds |= {one.name: (one.lower, one.upper) for one in inputs}
        self.samples = task.visits * (dwell.settling + dwell.most)

    def estimate(self) -> dict[str, float]:
        """Give how many visits were made, and the regret that is expected of the map now."""
        return {"visits": float(self._visits), "regret": self._regret}

    def run(self, plant: Plant, _first: float, most: int | None = None) -> Outcome:
        """Run it on a plant; a record that ends after so many cycles ends it, as Ctrl-C does."""
        task, interrupted = self.task, False

        def so_far(made: Progress) -> None:
            self._visits, self._regret = made.visit, made.regret

        try:
            found = seek_map(
                plant if most is None else _Ending(plant, most), task.inputs, task.axes, visits=task.visits,
                tolerance=task.tolerance, averaged=task.averaged, settling=task.settling, seeker=self._made(),
                on_visit=so_far,
            )  # fmt: skip
        except Interrupted as stop:
            if not isinstance(stop.partial, MapSearch):
                raise
            found, interrupted = stop.partial, True
        maps = {name: table.to_dataset() for name, table in found.maps.items()}
        return Outcome(
            figures=found.to_dict() | {"guide": task.guide},
            dataset=found.dataset,
            interrupted=interrupted,
            files={f"{name}.nc": table for name, table in maps.items()},
            drawings={name: partial(_drawn, "map_cells", table, (6.6, 4.6)) for name, table in maps.items()},
        )


class _Ending:
    """A plant that is interrupted after so many cycles."""

    def __init__(self, plant: Plant, cycles: int) -> None:
        self._plant, self._left = plant, cycles
        self.input_names, self.limit_names = plant.input_names, plant.limit_names

    def apply(self, inputs: Mapping[str, float]) -> None:
        if self._left == 0:
            raise KeyboardInterrupt
        self._plant.apply(inputs)

    def measure(self) -> Measurement:
        self._left -= 1
        return self._plant.measure()


def _model_of(table: str, task: SeekTask | MapTask, folder: Path) -> tuple[Cylinder, OperatingPoint]:
    """Load the engine of the guide."""
    try:
        engine = engine_named(task.model, folder)
    except Error as error:
        raise error.reworded(f"{table}.model = {task.model!r}: {error}") from error
    return scaled(engine.cylinder, task.scale, table), engine.point


@contextmanager
def _keys(table: str, task: SeekTask | MapTask) -> Iterator[None]:
    """Let messages and errors of the library name the keys of a table."""

    def written(name: str, text: str | None = None) -> str:
        return f"{table}.{name}" if text is None else f"{table}.{name} = {text!r}"

    try:
        with arguments_written(written):
            yield
    except ParameterError as error:
        if error.field not in task.__dataclass_fields__:
            raise
        raise error.reworded(f"{table}.{error}") from error


def _drawn(figure: str, data: xr.Dataset, size: tuple[float, float]) -> Figure:
    from mgdd import plot

    return drawn(getattr(plot, figure), data, size=size)
