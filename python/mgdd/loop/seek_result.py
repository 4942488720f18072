"""Result of one call of `seek`: the best inputs, what they give, the seeker, and reasons to doubt the result."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import argument
from mgdd.loop.lower_limits import measured_names, plain_name
from mgdd.loop.plant_loop import LoopRun
from mgdd.optimize.inputs import unit_of_input
from mgdd.results.describe import Row
from mgdd.results.finding import Finding, findings_html, unique
from mgdd.results.labels import label_of, labelled_dataset, to_jsonable
from mgdd.results.result import Result
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from mgdd.loop.seek_choice import Question
    from mgdd.optimize import Input

_NEAREST = 10  # readings that say what J and limits are at the estimate
_PER_INPUT = 10  # cycles; the estimate is near after 7 to 10 in the median, docs/benchmarks.md
_MOVES, _EDGE = 0.1, 0.01  # shares of the bounds
_SURE = 2.0  # standard deviations
_BLOCKS, _FEWEST = 6, 60  # of the last half, where a move that goes on shows; cycles
# Standard deviations of the steps between blocks; share of the bounds.
_GOES_ON, _FAR = 2.2, 0.05  # one jump in the second block or later has 1.0 to 1.7 of the first
_TRUSTED = 0.5
_PER_DOUBT = 200  # cycles; maps that stand still make a seeker doubt once in them in 15 of 100 runs, never twice


class Mean(NamedTuple):
    """A mean with its standard deviation."""

    value: float
    sd: float


class Readings:
    """The cycles of a run whose reading counts."""

    def __init__(
        self, data: xr.Dataset, inputs: Sequence[Input], estimate: NDArray[np.float64], noise_sd: float
    ) -> None:
        self._data, self._estimate, self._noise_sd = data, estimate, noise_sd
        names = [one.name for one in inputs]
        self.estimates, self.applied = (data[name].sel(input=names).to_numpy() for name in ("estimate", "applied"))
        bounds = np.array([(each.lower, each.upper) for each in inputs])
        tried = np.maximum(np.ptp(self.applied, axis=0), 1e-300) if len(self.applied) else np.ones(len(names))
        width = bounds[:, 1] - bounds[:, 0]
        self.width = np.where(np.isfinite(width), width, tried)
        self.counts = ~data["void"].to_numpy().astype(bool)
        self.j = np.where(self.counts, data["j"].to_numpy(), math.nan)

    @property
    def measured(self) -> list[str]:
        """Names of the quantities that may be limited."""
        return [str(name) for name in self._data["limit"].values] if "limits" in self._data else []

    def limit(self, name: str) -> NDArray[np.float64]:
        """Give the readings of a limit, NaN where the cycle does not count."""
        if "limits" not in self._data:
            return np.full(self.j.size, math.nan)
        values = self._data["limits"].sel(limit=name).to_numpy()
        return np.where(self.counts, values, math.nan)

    def near_estimate(self, values: NDArray[np.float64], late_cycles: float) -> Mean:
        """Average the readings whose inputs were nearest to the last estimate."""
        late = round(late_cycles)
        read, caused = values[late:], self.applied[: max(values.size - late, 0)]
        finite = np.isfinite(read)
        away = np.linalg.norm((caused - self._estimate) / self.width, axis=1)[finite]
        return _mean(read[finite][np.argsort(away, kind="stable")[:_NEAREST]])

    def velocities(self, late_cycles: float, *, maximize: bool) -> list[Mean]:
        """Give the steady velocity of the best of every input per cycle in the last half, NaN where there is none.

        One jump, or an estimate that wanders, has steps from block to block that scatter as far as their mean. One
        that still approaches has steady ones, but then the slope of J over the input changes by the input alone.
        """
        late, cycles, names = round(late_cycles), self.j.size, self.width.size
        out = [Mean(math.nan, math.nan)] * names
        if cycles < _FEWEST:
            return out
        half = np.array_split(np.arange(cycles // 2, cycles), _BLOCKS)
        steps = np.diff([self.estimates[block].mean(axis=0) for block in half], axis=0) / (len(half[0]))
        cycles_read = np.flatnonzero(np.isfinite(self.j[max(cycles // 2, late) :])) + max(cycles // 2, late)
        u = (self.applied[cycles_read - late] - self.applied[cycles_read - late].mean(axis=0)) / self.width
        k = (cycles_read - cycles_read.mean()) / cycles
        for i in range(names):
            mean, sd = float(steps[:, i].mean()), float(np.std(steps[:, i], ddof=1)) / math.sqrt(len(steps))
            slower = 2.0 * abs(steps[-2:, i].mean()) < abs(steps[:2, i].mean())  # as towards a best that stands still
            if slower or abs(mean) <= _GOES_ON * sd or abs(mean) * cycles / 2 <= _FAR * self.width[i]:
                continue
            terms = np.column_stack([np.ones_like(k), k, k**2, u, u**2, k * u[:, i]])
            fit, left, rank, _ = np.linalg.lstsq(terms, self.j[cycles_read], rcond=None)
            if rank < terms.shape[1] or len(cycles_read) <= rank:
                continue
            turn = math.sqrt(float(left[0]) / (len(cycles_read) - rank) * np.linalg.inv(terms.T @ terms)[-1, -1])
            if math.copysign(1.0 if maximize else -1.0, mean) * float(fit[-1]) > _SURE * turn:
                out[i] = Mean(mean, sd)
        return out

    def gain(self, late_cycles: float) -> Mean:
        """Compare the mean of the last quarter with the first reading."""
        first = self.j[math.ceil(late_cycles) :]
        first, last = first[np.isfinite(first)], self.j[self.j.size - max(self.j.size // 4, 1) :]
        last = last[np.isfinite(last)]
        if first.size < 2 or not last.size:
            return Mean(math.nan, math.nan)
        noise = self._noise_sd
        if not math.isfinite(noise):
            noise = float(np.std(last))
        return Mean(float(last.mean() - first[0]), noise * math.sqrt(1.0 + 1.0 / last.size))


def _mean(values: NDArray[np.float64]) -> Mean:
    if not values.size:
        return Mean(math.nan, math.nan)
    sd = float(np.std(values, ddof=1)) / math.sqrt(values.size) if values.size > 1 else math.nan
    return Mean(float(values.mean()), sd)


def doubts_about(
    seeker: Any, run: LoopRun, readings: Readings, gain: Mean, kept: Mapping[str, Mean], asked: Question
) -> list[Finding]:
    """Give reasons to doubt a result: its gain over the start, positive is better, and its limits as they are."""
    return [
        *_about_run(run, readings, asked, gain),
        *_about_limits(readings, asked, kept),
        *_about_seeker(seeker, asked, readings.j.size, seen=gain.value > _SURE * gain.sd),
    ]


def _about_run(run: LoopRun, readings: Readings, asked: Question, gain: Mean) -> Iterator[Finding]:
    inputs, cycles = asked.inputs, readings.j.size
    if run.interrupted:
        yield Finding(
            "interrupted", (), f"interrupted after {cycles} cycles", "seek(plant, seeker=found.seeker) goes on"
        )
    if not readings.counts.any():
        yield Finding("no_reading", (), "no cycle gave a reading", "look at the plant, or start where it runs")
        return
    if cycles < _PER_INPUT * len(inputs):
        remedy = f"take {_PER_INPUT * len(inputs)} cycles at least"
        yield Finding("few_cycles", (), f"{cycles} cycles of {len(inputs)} inputs are few", remedy)
    late = readings.estimates[cycles - max(cycles // 4, 1) :]
    moves = np.ptp(late, axis=0) / readings.width
    velocities = readings.velocities(asked.late_cycles, maximize=asked.maximize)
    for one, move, velocity in zip(inputs, moves, velocities, strict=True):
        if math.isfinite(velocity.value):
            per = f"{100.0 * velocity.value:.3g} ± {100.0 * velocity.sd:.1g}"
            text = f"the best {one.name} moves all the time, by {per} in 100 cycles; the estimate lags behind"
            yield Finding("moving", (one.name,), text, "go on seeking while the plant runs, or find what moves it")
        elif move > _MOVES:
            text = f"the estimate of {one.name} moved by {move:.0%} of its bounds over the last {len(late)} cycles"
            yield Finding("not_settled", (one.name,), text, "take more cycles; the objective may be flat along it")
    for one, value, width in zip(inputs, late[-1], readings.width, strict=True):
        if min(value - one.lower, one.upper - value) <= _EDGE * width:
            side = "lower" if value - one.lower <= _EDGE * width else "upper"
            text = f"the best {one.name} lies at its {side} bound, {getattr(one, side):.6g}"
            yield Finding("at_bound", (one.name,), text, "widen it where the plant allows that")
    if gain.value <= _SURE * gain.sd:
        text = f"the gain over the start, {gain.value:.3g} ± {gain.sd:.2g}, may be noise"
        yield Finding("no_gain", (), text, "start elsewhere, or measure start and best in turn")


def _about_limits(readings: Readings, asked: Question, estimates: Mapping[str, Mean]) -> Iterator[Finding]:
    if asked.started_blindly:
        names = tuple(measured_names(asked.limits))
        text = f"no start given, and it is unknown where {', '.join(names)} would hold: it began where that was open"
        yield Finding("start_unknown", names, text, f"give {argument('start')} where the limits hold")
    idle = dict.fromkeys(plain_name(name)[0] for name in readings.measured)
    if names := tuple(name for name in idle if name not in measured_names(asked.limits)):
        text = f"{', '.join(names)}: measured, but no limit on it is kept"
        yield Finding("limit_not_kept", names, text, f"a plant only measures: give the value in {argument('limits')}")
    for limit in asked.limits:
        values = readings.limit(limit.name)
        values = values[np.isfinite(values)]
        mean = estimates[limit.name]
        name, side = plain_name(limit.name)
        bound = f"{'above its' if side > 0.0 else 'below its lower'} limit, {side * limit.upper:.6g}"
        if values.size and values[0] > limit.upper:
            text = f"the first reading of {name}, {side * values[0]:.6g}, is {bound}"
            yield Finding("start_above_limit", (name,), text, "start where it holds")
        if mean.value - _SURE * mean.sd > limit.upper:
            text = f"{name} is {side * mean.value:.6g} at the best inputs, {bound}"
            yield Finding("limit_broken", (name,), text, "widen the bounds: none of the inputs tried holds it")


def _about_seeker(seeker: Any, asked: Question, cycles: int, *, seen: bool) -> Iterator[Finding]:
    guided, doubts = asked.guide is not None, int(getattr(seeker, "doubts", 0))
    if doubts > 1 + cycles // _PER_DOUBT:
        text = f"readings were not explained by earlier ones, {doubts} times: the objective drifts or jumps"
        yield Finding("unexplained", (), text, "look at what else changes; the newest readings count")
    if asked.own_model:
        text = "the guide is the model that the plant is made of: no engine has so good a guide"
        yield Finding("own_model", (), text, "change its cylinder, as Cylinder(wall_heat_scale=1.0)")
    if getattr(seeker, "handed_over", False):
        which = "of the guide" if guided else "of a parabola"
        text = f"the shape {which} did not explain the readings, and extremum seeking took over"
        yield Finding("handed_over", (), text, "take more cycles" + ("" if guided else ", or give a guide"))
    elif guided and getattr(seeker, "trust", 1.0) < _TRUSTED:
        text = f"the guide explains the readings badly: trust {float(seeker.trust):.2f}"
        yield Finding("untrusted_guide", (), text, "look at its shape and its height")
    stated, taken = asked.delay_cycles, getattr(seeker, "delay_cycles", None)
    if seen and isinstance(taken, int | float) and asked.components is None and taken != stated:
        text = f"the readings fit a delay of {taken:g} cycles, not {stated:g} as configured"
        yield Finding("delay", (), text, "correct delay_cycles")


@dataclass(frozen=True, kw_only=True, repr=False)
class SeekResult(Result):
    """Best inputs that were found on a plant, and how far to trust them.

    Parameters
    ----------
    inputs : dict of str to float
        The best inputs by name, in their units, on the steps of those that have some.
    value, value_sd : float
        J expected there, and its standard deviation without the noise of a reading [unit of J]: by the process of the
        seeker where it has one, otherwise by the ten readings nearest to it.
    gain, gain_sd : float
        By how much the mean J of the last quarter of the cycles is better than the reading at the start, positive is
        better, and the standard deviation of that [unit of J].
    start : dict of str to float
        Where it began.
    limits : dict of str to float
        Mean of the ten readings nearest to the best inputs, by limit.
    seeker : Seeker
        What sought; ``seek(plant, seeker=found.seeker)`` goes on with it.
    reason : str
        Why that one.
    findings : tuple of Finding
        Reasons to doubt the result: codes ``few_cycles``, ``moving``, ``not_settled``, ``at_bound``, ``no_gain``,
        ``start_unknown``, ``start_above_limit``, ``limit_broken``, ``no_reading``, ``unexplained``, ``handed_over``,
        ``untrusted_guide``, ``delay``, ``interrupted``, and those of the seeker.
    run : LoopRun
        Every cycle.
    asked : Question
        Inputs, limits and what was given of J.
    """

    inputs: dict[str, float]
    value: float
    value_sd: float
    gain: float
    gain_sd: float
    start: dict[str, float]
    limits: dict[str, float]
    seeker: Any
    reason: str
    findings: tuple[Finding, ...]
    run: LoopRun
    asked: Question

    @property
    def _kind(self) -> str:
        return str(getattr(self.seeker, "_seeker_kind", None) or self.seeker.kind)

    def _title(self) -> str:
        return f"{self._kind}: {self.reason}"

    def _rows(self) -> list[Row]:
        rows = [
            Row(one.name, f"{self.inputs[one.name]:.6g} (from {self.start[one.name]:.6g})", unit_of_input(one))
            for one in self.asked.inputs
        ]
        unit, objective = label_of(self.run.dataset["j"])
        rows.append(Row(objective, f"{self.value:.6g} ± {self.value_sd:.2g}", unit))
        rows.append(Row("gain", f"{self.gain:.4g} ± {self.gain_sd:.2g}", unit))
        for limit in self.asked.limits:
            name, side = plain_name(limit.name)
            reading = f"{self.limits[name]:.6g} ({'limit' if side > 0.0 else 'lower limit'} {side * limit.upper:.6g})"
            rows.append(Row(name, reading, unit_of(name)))
        rows.append(Row("cycles", str(self.run.dataset.sizes["cycle"])))
        return rows + [Row("doubt", str(finding)) for finding in self.findings]

    def _repr_html_(self) -> str:
        return super()._repr_html_() + findings_html("Reasons to doubt it", self.findings)

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it before all its cycles."""
        return self.run.interrupted

    @property
    def dataset(self) -> xr.Dataset:
        """Every cycle as in `LoopRun`, and what was found; seeker, reason and findings as attributes."""
        names = list(self.inputs)
        unit, (unit_of_j, objective) = "unit of the input", label_of(self.run.dataset["j"])
        columns: dict[str, tuple[Any, ...]] = {
            "input": ("input", names, "-", "input of the plant"),
            "best": ("input", list(self.inputs.values()), unit, "best input found"),
            "start": ("input", list(self.start.values()), unit, "input at the start"),
            "value": ((), self.value, unit_of_j, f"{objective} expected at the best inputs"),
            "value_sd": ((), self.value_sd, unit_of_j, "its standard deviation"),
            "gain": ((), self.gain, unit_of_j, f"gain of {objective} over the start"),
            "gain_sd": ((), self.gain_sd, unit_of_j, "its standard deviation"),
        }
        if self.limits:
            measured = [str(name) for name in self.run.dataset["limit"].to_numpy()]
            sides = [plain_name(name) for name in measured]
            at_best = [side * self.limits.get(name, math.nan) for name, side in sides]
            own = "unit of the limit"
            columns["limit"] = ("limit", measured, "-", "limited quantity")
            columns["limits_at_best"] = ("limit", at_best, own, "limited quantity at the best inputs")
        out = self.run.dataset.assign(labelled_dataset(columns).variables)
        out.attrs |= {"seeker": self._kind, "reason": self.reason}
        if self.findings:
            out.attrs["findings"] = "\n".join(map(str, self.findings))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the cycles as plain values.

        Returns
        -------
        dict
            Fields by name; ``seeker`` as the name of its kind, ``figures`` as the summary of the run,
            ``estimate_sd`` and ``trust`` of a seeker that has them, None otherwise. `mgdd engine seek --json` and the
            figures of an experiment begin with them.
        """
        names = ("inputs", "value", "value_sd", "gain", "gain_sd", "start", "limits", "reason", "interrupted")
        out = {name: getattr(self, name) for name in names}
        out |= {"seeker": self._kind, "findings": [finding.to_dict() for finding in self.findings]}
        out |= {name: _finite(getattr(self.seeker, name, None)) for name in ("estimate_sd", "trust")}
        figures = {name: value for name, value in self.run.summary.items() if math.isfinite(value)}
        plain: dict[str, Any] = to_jsonable(out | {"cycles": self.run.dataset.sizes["cycle"], "figures": figures})
        return plain

    def _draw(self, ax: Axes | None) -> Axes:
        return self.run._draw(ax)


def found_by(seeker: Any, reason: str, run: LoopRun, start: Mapping[str, float], asked: Question) -> SeekResult:
    """Sum up a run of what was asked."""
    sign = 1.0 if asked.maximize else -1.0
    readings = Readings(run.dataset, asked.inputs, seeker.estimate, float(getattr(seeker, "noise_sd", math.nan)))
    at_best = readings.near_estimate(readings.j, asked.late_cycles)
    if getattr(seeker, "expected_sd", 0.0) > 0.0:  # 0 before the process is fitted
        at_best = Mean(float(seeker.expected), float(seeker.expected_sd))
    gained = readings.gain(asked.late_cycles)
    estimates = {
        limit.name: readings.near_estimate(readings.limit(limit.name), limit.delay_cycles + limit.lag_cycles)
        for limit in asked.limits
    }
    gain = Mean(sign * gained.value, gained.sd)
    doubts = doubts_about(seeker, run, readings, gain, estimates, asked)
    return SeekResult(
        inputs=dict(zip([one.name for one in asked.inputs], seeker.settable.tolist(), strict=True)),
        value=at_best.value,
        value_sd=at_best.sd,
        gain=gain.value,
        gain_sd=gain.sd,
        start=dict(start),
        limits={name: sign * estimates[given].value for given in estimates for name, sign in [plain_name(given)]},
        seeker=seeker,
        reason=reason,
        findings=unique([*seeker.findings, *doubts]),
        run=run,
        asked=asked,
    )


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, float) and math.isfinite(value) else None
