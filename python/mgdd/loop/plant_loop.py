"""A seeker on any plant, one ask, one cycle and one tell at a time."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import Interrupted, ParameterError, hinted
from mgdd.guide import FeedForward, GuidedEngine
from mgdd.loop.bench_record import FLAGS, OWN_LABELS
from mgdd.loop.criteria import LoopCriteria
from mgdd.loop.limit_figures import noise_free_variable
from mgdd.loop.plant import AnnouncingPlant, Measurement, Plant
from mgdd.loop.summary import summarize_cycles
from mgdd.results.finding import Finding
from mgdd.results.labels import VARIABLES, labelled_dataset
from mgdd.results.result import Figures, Result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from mgdd.optimize import Seeker

__all__ = ["LoopRun", "require_inputs_of", "steer"]

_CHANGED = "operating_point_changed"
_UNKNOWN = "not given by the plant"
_OWN = ("estimate_cad", "soc_requested_cad", "soc_applied_cad", "j", "misfire")  # columns that the loop itself knows


class _Row(NamedTuple):
    """One measured cycle."""

    estimate: NDArray[np.float64]
    asked: NDArray[np.float64]
    applied: NDArray[np.float64]
    void: bool
    measured: Measurement


@dataclass(frozen=True, kw_only=True, repr=False)
class LoopRun(Result):
    """A closed loop, cycle by cycle, and what it came to.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over ``cycle``: ``estimate_cad`` before the cycle and everything that the plant measured of it. A plant whose
        one input is not ``soc_cad`` has ``estimate``, ``asked`` and ``applied`` over ``cycle`` and ``input`` instead.
    summary : Figures
        By name, and as a text where it is called, ``run.summary()``: ``final_cad`` (mean estimate of the last 100
        cycles), ``mean_cad`` and ``rms_cad`` (second half), ``cycles_to`` and ``cycles_stays`` (NaN: never), means of
        J, efficiency and true NOx over the second half, extremes of the estimate, misfires. Of several inputs, or one
        that is not an angle, only what does not need the estimate.
        For every limit, as measured and without any margin: ``limit_NAME``, ``worst_NAME`` and ``worst_cycle_NAME``,
        ``above_cycles_NAME`` and ``above_fraction_NAME`` from the first cycle on, ``judged_above_cycles_NAME`` and
        ``judged_above_fraction_NAME`` from cycle ``judged_from`` on. The same with ``noise_free_`` in front, where the
        plant knows the value at the applied inputs without scatter and noise. ``exceeded_fraction`` is the share of
        cycles from ``judged_from`` on above any of the thresholds ``exceed_above_NAME``.
    interrupted : bool
        Ctrl-C ended the run before all its cycles: it is the part that `mgdd.errors.Interrupted` carried.
    findings : tuple of Finding
        What the seeker holds against the run at its end, as its ``findings``: inputs that make the plant fail.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking
    >>> run = run_seeker(EngineBench(seed=1), ExtremumSeeking(start=-20.0, lower=-30.0, upper=10.0), 600)
    >>> abs(run.summary["final_cad"] + 5.63) < 2.0
    True
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
    if cycles < 1:
        raise ParameterError.of("cycles", cycles, ">= 1")
    if not isinstance(plant, Plant):
        raise ParameterError(
            f"plant = {plant!r}: must have input_names, limit_names, apply() and measure(), as "
            "EngineBench('puma_single') has"
        )
    require_inputs_of(plant, seeker)
    if seeker.estimate.size != len(plant.input_names):
        raise ParameterError(
            f"start has {seeker.estimate.size} entries: the plant takes {len(plant.input_names)}, "
            f"{', '.join(plant.input_names)}"
        )
    unasked = isinstance(seeker, FeedForward) and seeker.guide is not None and seeker.point is None
    if unasked and not hasattr(plant, "point"):
        raise ParameterError(
            "plant has no point: the guide of a FeedForward would never be asked; give the plant a property `point`, "
            "or call at(point) of the FeedForward before the run"
        )
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
    first, log, interrupted = seeker.cycle, list[_Row](), False
    try:
        for _ in range(cycles):
            _one_cycle(plant, announcing, seeker, log)
    except KeyboardInterrupt:
        interrupted = True
        del log[seeker.cycle - first :]  # a cycle that was measured and not told: it is asked again
    except Exception as error:
        del log[seeker.cycle - first :]
        with contextlib.suppress(AttributeError):  # of a class with slots
            error.partial = _run_of(plant, seeker, log, first, criteria, uppers)  # type: ignore[attr-defined]
        raise
    run = _run_of(plant, seeker, log, first, criteria, uppers, interrupted=interrupted)
    if interrupted:
        raise Interrupted(f"interrupted after {len(log)} of {cycles} cycles, which are in .partial", run)
    return run


def _run_of(
    plant: Plant,
    seeker: Seeker | FeedForward | GuidedEngine,
    log: list[_Row],
    first: int,
    criteria: LoopCriteria,
    uppers: Sequence[float],
    *,
    interrupted: bool = False,
) -> LoopRun:
    dataset = _dataset(log, first, plant.input_names, _guided(seeker, len(log)))
    dataset.attrs |= {"interrupted": int(interrupted), **criteria.attributes(tuple(plant.limit_names), uppers)}
    summary = Figures(summarize_cycles(dataset, criteria))
    return LoopRun(dataset=dataset, summary=summary, interrupted=interrupted, findings=seeker.findings)


def require_inputs_of(plant: Plant, seeker: Seeker | FeedForward | GuidedEngine) -> None:
    """ParameterError where a seeker names other inputs than the plant has."""
    named = list(getattr(seeker, "input_names", ()))
    if named and set(named) != set(plant.input_names):
        raise ParameterError(
            f"inputs of the seeker are {', '.join(named)}: the plant takes {', '.join(plant.input_names)}"
        )


def _one_cycle(
    plant: Plant, announcing: AnnouncingPlant | None, seeker: Seeker | FeedForward | GuidedEngine, log: list[_Row]
) -> None:
    if isinstance(seeker, FeedForward | GuidedEngine) and hasattr(plant, "point"):
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
    told = measured.performance if summed else np.array(measured.components)
    limits = [measured.limits[name] for name in seeker.limit_names]
    applied = _applied(plant.input_names, asked, measured)
    log.append(_Row(estimate, asked, applied, void, measured))
    told_inputs = dict(zip(plant.input_names, applied.tolist(), strict=True)) if seeker.input_names else applied
    reading: dict[str, Any] = {"misfire": void, "applied": told_inputs if measured.applied else None}
    if isinstance(seeker, GuidedEngine):
        reading["pressure_bar"] = measured.pressure_bar
    seeker.tell(told, limits if limits else None, **reading)
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


def _steered(log: list[_Row], inputs: tuple[str, ...]) -> dict[str, tuple[Any, ...]]:
    """Label what the seeker thought and asked for."""
    estimate = np.array([row.estimate for row in log], np.float64).reshape(-1, len(inputs))
    asked = np.array([row.asked for row in log], np.float64).reshape(-1, len(inputs))
    applied = np.array([row.applied for row in log], np.float64).reshape(-1, len(inputs))
    if inputs == ("soc_cad",):
        return {
            "estimate_cad": ("cycle", estimate[:, 0]),
            "soc_requested_cad": ("cycle", asked[:, 0]),
            "soc_applied_cad": ("cycle", applied[:, 0]),
        }
    over, unit = ("cycle", "input"), "unit of the input"
    return {
        "input": ("input", list(inputs), "-", "input of the plant"),
        "estimate": (over, estimate, unit, "estimate of the best input"),
        "asked": (over, asked, unit, "input that was asked for"),
        "applied": (over, applied, unit, "input that the plant applied"),
    }


def _guided(seeker: Seeker | FeedForward | GuidedEngine, cycles: int) -> dict[str, tuple[Any, ...]]:
    """Give what came from the guide, what from the trim, and the trust, of the last cycles of a guided engine."""
    if not isinstance(seeker, GuidedEngine) or not cycles:
        return {}
    last = seeker.history.isel(cycle=slice(-cycles, None))
    names = ("guide_cad", "feed_forward_cad", "trim_cad", "estimate_sd_cad", "trust", "wall_heat_scale")
    labels = {name: (last[name].attrs["units"], last[name].attrs["long_name"]) for name in names}
    return {name: ("cycle", last[name].to_numpy(), *labels[name]) for name in names}


def _dataset(log: list[_Row], first: int, inputs: tuple[str, ...], guided: dict[str, tuple[Any, ...]]) -> xr.Dataset:
    """Label what was measured; a value that is missing in some cycles is NaN there."""
    rows = [row.measured for row in log]
    names = dict.fromkeys(name for row in rows for name in row.values)
    columns = {name: np.array([row.values.get(name, math.nan) for row in rows]) for name in names}
    count = columns.pop("cycle", None)
    cycle = np.arange(first, first + len(rows)) if count is None or not np.isfinite(count).all() else count
    variables: dict[str, tuple[Any, ...]] = {
        "cycle": ("cycle", cycle.astype(np.int64)),
        **_steered(log, inputs),
        "j": ("cycle", np.array([row.performance for row in rows], np.float64)),
        "misfire": ("cycle", np.array([row.misfire for row in rows], np.bool_), "-", FLAGS["misfire"]),
        "void": ("cycle", np.array([row.void for row in log], np.bool_), "-", "cycle that the seeker did not use"),
        **guided,
    }
    for name, values in columns.items():
        if name in FLAGS and name not in _OWN:
            variables[name] = ("cycle", values == 1.0, "-", FLAGS[name])
        elif name not in _OWN:
            labels: dict[str, tuple[str, str]] = OWN_LABELS if "intake_o2_fraction" in names else {}  # of a bench
            said: tuple[str, ...] = () if name in VARIABLES else labels.get(name, (_UNKNOWN, name))
            variables[name] = ("cycle", values, *said)
    width = max((len(row.components) for row in rows), default=1)
    components = np.full((len(rows), width), math.nan)
    for at, row in enumerate(rows):
        components[at, : len(row.components)] = row.components
    variables["component"] = ("component", np.arange(width), "-", "term of the performance")
    variables["components"] = (("cycle", "component"), components, "unit of J", "component of the performance")
    limits = list(dict.fromkeys(name for row in rows for name in row.limits))
    if limits:
        table = np.array([[row.limits.get(name, math.nan) for name in limits] for row in rows])
        units = [VARIABLES[name].units if name in VARIABLES else _UNKNOWN for name in limits]
        own = "unit of the limit"
        variables["limit"] = ("limit", limits, "-", "limited quantity")
        variables["limit_units"] = ("limit", units, "-", own)
        variables["limits"] = (("cycle", "limit"), table, own, "measured value of a limited quantity")
        if any(row.noise_free_limits for row in rows):
            known = np.array([[row.noise_free_limits.get(name, math.nan) for name in limits] for row in rows])
            variables["noise_free_limits"] = noise_free_variable(known)
    out = labelled_dataset(variables)
    return out.set_coords("limit_units") if limits else out
