"""Seekers on any plant, one of the user too: one ask, one cycle and one tell at a time."""

from __future__ import annotations

import contextlib
import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted, ParameterError, ShapeError, hinted
from mgdd.guide import FeedForward, GuidedEngine
from mgdd.loop.function_plant import core_of
from mgdd.loop.plant import AnnouncingPlant, Measurement, Plant
from mgdd.loop.plant_record import Cycles, Row, cycles_given, dataset_of
from mgdd.loop.summary import LoopCriteria, summarize_cycles
from mgdd.optimize import Seeker
from mgdd.optimize.map_driver import MapDriver
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.results.finding import Finding
from mgdd.results.labels import label_of
from mgdd.results.result import Figures, Result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from mgdd.optimize import Input, Limit


class OwnSeeker:
    """Hold the user's object as `own`, which maximises; it receives what its ``tell`` takes."""

    component_count = 1
    findings: tuple[Finding, ...] = ()

    def __init__(self, own: Any, inputs: Sequence[Input], limits: Sequence[Limit], *, maximize: bool) -> None:
        self.own, self.kind, self.cycle = own, type(own).__name__, 0
        self._inputs = list(inputs)
        self.settings = {"inputs": list(inputs), "limits": list(limits), "maximize": maximize}
        self.input_names, self.limit_names = [one.name for one in inputs], [one.name for one in limits]
        self._takes = set(inspect.signature(own.tell).parameters)
        if hasattr(own, "at"):
            self.at = own.at  # says at which operating point the next cycle runs
        if self.estimate.size != len(inputs):
            raise ShapeError(f"seeker: its estimate has {self.estimate.size} entries: must have {len(inputs)}, inputs")

    def __repr__(self) -> str:
        return f"<{self.kind} cycle {self.cycle}, estimate {self.estimate}>"

    @classmethod
    def of_driver(cls, driver: MapDriver) -> OwnSeeker:
        """Hold the driver of a map, whose search has inputs, limits and sense."""
        own = driver.search.settings
        return cls(driver, own["inputs"], own["limits"], maximize=own["maximize"])

    @staticmethod
    def is_one(seeker: Any) -> bool:
        """Whether an object has ``ask``, ``tell`` and ``estimate``."""
        return not isinstance(seeker, type) and all(hasattr(seeker, name) for name in ("ask", "tell", "estimate"))

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Its estimate of the optimum, in the order of the inputs."""
        return np.atleast_1d(np.array(self.own.estimate, np.float64))

    @property
    def settable(self) -> NDArray[np.float64]:
        """The same in the steps in which its inputs are set."""
        return self._on_steps(self.estimate)

    def _on_steps(self, values: Any) -> NDArray[np.float64]:
        numbers = np.atleast_1d(np.asarray(values, np.float64)).tolist()
        return np.array([one.nearest(value) for one, value in zip(self._inputs, numbers, strict=True)])

    def ask(self) -> dict[str, float]:
        """Give the inputs of the next cycle by name."""
        self._asked = self._on_steps(self.own.ask())
        return dict(zip(self.input_names, self._asked.tolist(), strict=True))

    def tell(
        self,
        J: float,  # noqa: N803
        limits: Sequence[float] | None = None,
        *,
        misfire: bool = False,
        applied: Mapping[str, float] | None = None,
    ) -> None:
        """Pass a reading on; a failed cycle is asked again where ``tell`` takes no ``misfire``."""
        self.cycle += 1
        reading: dict[str, Any] = {"limits": limits, "misfire": misfire}
        if applied is not None:
            reading["applied"] = np.array([applied[name] for name in self.input_names])
        elif any(one.step for one in self._inputs):
            reading["applied"] = self._asked
        if not misfire or "misfire" in self._takes:
            j = float(J) if self.settings["maximize"] else -float(J)
            self.own.tell(j, **{name: value for name, value in reading.items() if name in self._takes})

    def restart(self) -> None:
        """Begin anew at another operating point, where it can."""
        getattr(self.own, "restart", lambda: None)()


_CHANGED = "operating_point_changed"


@dataclass(frozen=True, kw_only=True, repr=False)
class LoopRun(Result):
    """A closed loop, cycle by cycle, and what it came to.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over ``cycle`` and ``input``: ``estimate`` before the cycle, what was ``asked`` for and what was ``applied``;
        over ``cycle`` everything that the plant measured of it.
    summary : Figures
        By name, and as a text where it is called, ``run.summary()``: for every input ``final_INPUT`` (mean
        estimate of the last 100 cycles), ``mean_INPUT``, ``rms_INPUT`` and ``mean_applied_INPUT`` (second half),
        ``lowest_INPUT`` and ``highest_INPUT`` of the estimate; ``cycles_to`` and ``cycles_stays`` (NaN: never), means
        of J, efficiency and true NOx over the second half, misfires. What an optimum judges is of the first input.
        For every limit, as measured and without any margin: ``limit_NAME``, ``worst_NAME`` and ``worst_cycle_NAME``,
        ``above_cycles_NAME`` and ``above_fraction_NAME`` from the first cycle on, ``judged_above_cycles_NAME`` and
        ``judged_above_fraction_NAME`` from cycle ``judged_from`` on. The same with ``noise_free_`` in front, where the
        plant knows the value at the applied inputs without scatter and noise. ``exceeded_fraction`` is the share of
        cycles from ``judged_from`` on above any of the thresholds ``exceed_above_NAME``.
    interrupted : bool
        Ctrl-C ended the run before all its cycles: it is the part that `mgdd.errors.Interrupted` carried.
    findings : tuple of Finding
        What the seeker holds against the run at its end, as its ``findings``: inputs that make the plant fail.
    """

    dataset: xr.Dataset
    summary: Figures = field()
    interrupted: bool = False
    findings: tuple[Finding, ...] = ()

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot import seeking

        return seeking(self, ax=ax)


def steer(plant: Plant, seeker: Seeker | FeedForward | GuidedEngine, cycles: int, criteria: LoopCriteria) -> LoopRun:
    """Run the loop of `mgdd.loop.run_seeker` from Python."""
    ParameterError.unless(cycles >= 1, "cycles", cycles, ">= 1")
    if not isinstance(plant, Plant):
        raise ParameterError(
            f"plant = {plant!r}: must have input_names, limit_names, apply() and measure(), as "
            "VirtualEngine('puma_single') has"
        )
    require_inputs_of(plant, seeker)
    if seeker.estimate.size != len(plant.input_names):
        raise ParameterError(
            f"start has {seeker.estimate.size} entries: the plant takes {len(plant.input_names)}, "
            f"{', '.join(plant.input_names)}"
        )
    require_point_for(plant, seeker)
    names = tuple(seeker.limit_names)
    if not set(names) <= set(plant.limit_names):
        raise ParameterError(
            f"limits of the seeker {list(names)} are not all measured by the plant, which has {list(plant.limit_names)}"
        )
    criteria.thresholds(names)
    uppers = criteria.limits_of(tuple(plant.limit_names), seeker)
    judged = {name: upper for name, upper in zip(plant.limit_names, uppers, strict=True) if math.isfinite(upper)}
    criteria = replace(criteria, limits=judged)
    criteria.require_counted(cycles)
    announcing = plant if isinstance(plant, AnnouncingPlant) else None
    first, log, interrupted = seeker.cycle, list[Row](), False

    def run_so_far() -> LoopRun:
        """Give the run so far, without a cycle that was measured and not reported: it is asked again."""
        del log[seeker.cycle - first :]
        guided = _guided(seeker, len(log))
        own = Cycles.of(log, len(plant.input_names))
        return _run_of(plant, seeker, own, first, criteria, uppers, guided, interrupted=interrupted)

    if isinstance(seeker, Seeker) and (compiled := core_of(plant, seeker)) is not None:
        run_function: Any = _core.loop.run_function  # one overload for each class of seeker
        done, stop = or_partial(lambda: int(run_function(compiled, seeker, cycles)))
        own = cycles_given(seeker, done)
        run = _run_of(plant, seeker, own, first, criteria, uppers, {}, interrupted=stop is not None)
        return hand_over(run, stop)
    try:
        for _ in range(cycles):
            _one_cycle(plant, announcing, seeker, log)
    except KeyboardInterrupt:
        interrupted = True
    except Exception as error:
        with contextlib.suppress(AttributeError):  # of a class with slots
            error.partial = run_so_far()  # type: ignore[attr-defined]
        raise
    run = run_so_far()
    if interrupted:
        raise Interrupted(f"interrupted after {len(log)} of {cycles} cycles, which are in .partial", run)
    return run


def _run_of(
    plant: Plant,
    seeker: Seeker | FeedForward | GuidedEngine,
    cycles: Cycles,
    first: int,
    criteria: LoopCriteria,
    uppers: Sequence[float],
    guided: Mapping[str, tuple[Any, ...]],
    *,
    interrupted: bool,
) -> LoopRun:
    dataset = dataset_of(cycles, first, plant, guided)
    dataset.attrs |= {"interrupted": int(interrupted), **criteria.attributes(tuple(plant.limit_names), uppers)}
    summary = Figures(summarize_cycles(dataset, criteria))
    return LoopRun(dataset=dataset, summary=summary, interrupted=interrupted, findings=seeker.findings)


def require_inputs_of(plant: Plant, seeker: object) -> None:
    """ParameterError where a seeker is none of the package, or names other inputs than the plant has."""
    if not isinstance(seeker, Seeker | FeedForward | GuidedEngine | OwnSeeker):
        must = "a seeker, as ExtremumSeeking(start=-10.0, bounds=(-30.0, 10.0)); mgdd.loop.seek(plant, inputs, "
        raise ParameterError.of(
            "seeker", seeker, must + "seeker=...) takes a name, or an object of your own with ask, tell, estimate"
        )
    named = list(getattr(seeker, "input_names", ()))
    if named and set(named) != set(plant.input_names):
        raise ParameterError(
            f"inputs of the seeker are {', '.join(named)}: the plant takes {', '.join(plant.input_names)}"
        )


def require_point_for(plant: Plant, seeker: Seeker | FeedForward | GuidedEngine) -> None:
    """ParameterError where a guide would never be asked."""
    unasked = isinstance(seeker, FeedForward) and seeker.guide is not None and seeker.point is None
    if unasked and not hasattr(plant, "point"):
        raise ParameterError(
            "plant has no point: the guide of a FeedForward would never be asked; give the plant a property `point`, "
            "or call at(point) of the FeedForward before the run"
        )


def _one_cycle(
    plant: Plant, announcing: AnnouncingPlant | None, seeker: Seeker | FeedForward | GuidedEngine, log: list[Row]
) -> None:
    if hasattr(seeker, "at") and hasattr(plant, "point"):
        seeker.at(plant.point)
    elif announcing is not None and announcing.operating_point_changes:
        seeker.restart()
    names = tuple(seeker.input_names) or plant.input_names
    order = [names.index(name) for name in plant.input_names]  # of what the seeker has, as the plant has it
    estimate = np.array(seeker.estimate, np.float64)[order]
    sent = seeker.ask()
    asked = np.array([sent[name] for name in plant.input_names] if isinstance(sent, dict) else sent, np.float64)
    plant.apply(dict(zip(plant.input_names, asked.tolist(), strict=True)))
    measured = plant.measure()
    _require_match(seeker, measured)
    late = announcing is None and bool(measured.values.get(_CHANGED, 0.0))
    void = measured.misfire or bool(measured.values.get("unphysical", 0.0)) or late
    summed = seeker.component_count == 1
    performance = measured.performance if summed else np.array(measured.components)
    limits = [measured.limits[name] for name in seeker.limit_names]
    applied = _applied(plant.input_names, asked, measured)
    log.append(Row(estimate, asked, applied, void, measured))
    applied_inputs = dict(zip(plant.input_names, applied.tolist(), strict=True)) if seeker.input_names else applied
    reading: dict[str, Any] = {"misfire": void, "applied": applied_inputs if measured.applied else None}
    if isinstance(seeker, GuidedEngine):
        reading["pressure_bar"] = measured.pressure_bar
    seeker.tell(performance, limits if limits else None, **reading)
    if late:
        seeker.restart()


def _applied(names: tuple[str, ...], asked: NDArray[np.float64], measured: Measurement) -> NDArray[np.float64]:
    """Give the inputs that the plant says it applied; those it does not name were applied as asked."""
    if unknown := set(measured.applied) - set(names):
        raise ParameterError(f"applied = {', '.join(sorted(unknown))}: must be among the inputs {', '.join(names)}")
    return np.array(
        [measured.applied.get(name, own) for name, own in zip(names, asked.tolist(), strict=True)], np.float64
    )


def _require_match(seeker: Seeker | FeedForward | GuidedEngine, measured: Measurement) -> None:
    if seeker.component_count not in (1, len(measured.components)):
        raise ParameterError(
            f"components has {seeker.component_count} entries: the plant measures {len(measured.components)}; give as "
            "many, or one for their sum"
        )
    for name in seeker.limit_names:
        if name not in measured.limits:
            have = ", ".join(measured.limits) or "no limited quantity"
            refused = f"limits: {name!r} is not measured by the plant: it measures {have}"
            raise ParameterError(hinted(refused, name, measured.limits))


def _guided(seeker: Seeker | FeedForward | GuidedEngine, cycles: int) -> dict[str, tuple[Any, ...]]:
    """Give what came from the guide, what from the trim, and the trust, of the last cycles of a guided engine."""
    if not isinstance(seeker, GuidedEngine) or not cycles:
        return {}
    last = seeker.history.isel(cycle=slice(-cycles, None))
    own = ("guide_optimum", "feed_forward", "trim", "estimate_sd", "trust", "wall_heat_scale")
    return {name: (last[name].dims, last[name].to_numpy(), *label_of(last[name])) for name in own}
