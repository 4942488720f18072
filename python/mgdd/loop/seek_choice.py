"""Which seeker a search takes, from where and how long; the figures are those of the page of the benchmarks."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from mgdd._core.engine import OperatingPoint
from mgdd.errors import ParameterError, argument, hinted
from mgdd.guide import Curve, CurveSeeking, FeedForward, GuidedEngine, TimingMap
from mgdd.loop.engine_guide import EngineGuide
from mgdd.loop.lower_limits import middle_of, safe_side
from mgdd.maps import CalibrationMap
from mgdd.optimize import (
    ComponentLag,
    ExtremumSeeking,
    GaussianProcessSeeking,
    GoldenSection,
    GradientDescent,
    Input,
    Limit,
    Seeker,
    Spsa,
    tune,
)

_BEND, _REACH = -80.0, 1.5  # of the parabola; -0.05 over bounds that are 40 wide, as in the benchmark
_CYCLES, _DITHER_CYCLES = 200, 2000  # estimates stand after tens of readings, after hundreds with a dither
_PER_LATE = 25.0  # cycles more per cycle that J is late: each reading says as much, and comes that much later
_OWN_WORDS = (
    "start", "bounds", "inputs", "limits", "maximize", "seed", "components", "delay_cycles", "lag_cycles",
    "guide", "curve", "limit_curves", "limit_guides",
)  # fmt: skip
_PERIODS = 64  # of a dither: 16 time constants of four periods
_STRIDE = 0.1  # share of the bounds a cycle, so that a limit no guide knows is read before it is reached
_DITHER = 2.0  # scales of an input: the widest dither of the defaults
_FIRST = (CurveSeeking, GaussianProcessSeeking)
SEEKERS: Mapping[str, type[Seeker]] = {
    re.sub(r"(?<!^)(?=[A-Z])", "_", cls.kind).lower(): cls
    for cls in (*_FIRST, ExtremumSeeking, Spsa, GradientDescent, GoldenSection)
}


class Choice(NamedTuple):
    """A seeker, why it was taken, the cycles without which it has not looked to every side, and how many to take."""

    seeker: Any
    reason: str
    first_cycles: int
    cycles: int


@dataclass(frozen=True, kw_only=True)
class Question:
    """What is sought, and what is known of it."""

    inputs: Sequence[Input]
    start: Mapping[str, float] | None = None
    limits: Sequence[Limit] = ()
    noise_sd: float | None = None
    delay_cycles: float = 0.0
    lag_cycles: float = 0.0
    components: Sequence[ComponentLag] | None = None
    guide: Any = None
    maximize: bool = True
    seed: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    point: OperatingPoint | None = None
    own_model: bool = False  # the guide is what the plant itself is made of

    @property
    def late_cycles(self) -> float:
        """How long after its input the last component of J is read."""
        lags = self.components or [ComponentLag(delay_cycles=self.delay_cycles, lag_cycles=self.lag_cycles)]
        return max(lag.delay_cycles + lag.lag_cycles for lag in lags)

    @property
    def first_cycles(self) -> int:
        """How many readings look to every side once."""
        lags = self.components or [ComponentLag(delay_cycles=self.delay_cycles, lag_cycles=self.lag_cycles)]
        delay, lag = max(each.delay_cycles for each in lags), max(each.lag_cycles for each in lags)
        return math.ceil(delay) + (len(self.inputs) + 1) * max(1, math.ceil(2.0 * lag))

    @property
    def started_blindly(self) -> bool:
        """Whether it is unknown if the limits hold where it begins."""
        has_start = self.start is not None or isinstance(self.guide, EngineGuide)
        return bool(self.limits) and not has_start and not safe_side(self.inputs, self.limits)

    def first(self, scales: float = 0.0) -> dict[str, float]:
        """Give where to begin: the start, else the safe side less so many scales of the input, else the middle."""
        if self.start is not None:
            return dict(self.start)
        at = middle_of(self.inputs) | safe_side(self.inputs, self.limits)
        return {one.name: _inside(one, at[one.name], scales) for one in self.inputs}

    def made(self, cls: type[Seeker], start: Mapping[str, float] | None, **own: Any) -> Seeker:
        """Make a seeker of that class; ParameterError for what is known that it cannot know."""
        takes = inspect.signature(cls).parameters
        arguments: dict[str, Any] = {
            "inputs": list(self.inputs), "maximize": self.maximize, "limits": list(self.limits),
            "start": start or self.first(0.0 if cls in _FIRST else _DITHER),
        }  # fmt: skip
        lags = None if self.components is None else list(self.components)
        late = {"delay_cycles": self.delay_cycles, "lag_cycles": self.lag_cycles}
        if any(late.values()) and lags is not None:
            raise ParameterError("components: hold the delays: leave delay_cycles and lag_cycles out")
        if "delay_cycles" in takes and lags is None:
            arguments |= late
        elif self.late_cycles > 0.0:
            if "components" not in takes:
                late_ones = ", ".join(name for name, one in SEEKERS.items() if _bears_delay(one))
                raise ParameterError(
                    f"{argument('seeker', _name_of(cls))}: takes J of the same cycle, and J is late here: take one of "
                    f"{late_ones}"
                )
            arguments["components"] = lags or [ComponentLag(**late)]
            if "period" in takes:
                slowest = max(arguments["components"], key=lambda lag: lag.delay_cycles + lag.lag_cycles)
                slow = tune(
                    1.0, -1.0, delay_cycles=slowest.delay_cycles, lag_cycles=slowest.lag_cycles
                )  # whose period does not depend on noise and curvature
                arguments["period"] = max(takes["period"].default, slow.period)
        elif lags is not None:
            arguments["components"] = lags
        if self.noise_sd is not None and "noise_sd" in takes:
            arguments["noise_sd"] = self.noise_sd
        elif cls is GoldenSection and "noise_sd" not in self.settings:
            raise ParameterError(
                f"{argument('seeker', _name_of(cls))}: needs {argument('noise_sd')}, the standard deviation of one "
                "reading"
            )
        if "seed" in takes:
            arguments["seed"] = self.seed
        for name in self.settings:
            if name in _OWN_WORDS:
                raise ParameterError(
                    f"{argument('settings')}: {name!r} is not one of them: the search gives it, leave it out"
                )
            if name not in takes:
                have = [each for each in takes if each not in _OWN_WORDS]
                raise ParameterError(
                    hinted(f"{argument('settings')}: {name!r}: {cls.kind} takes {', '.join(have)}", name, have)
                )
        try:
            return cls(**arguments | own | dict(self.settings))
        except ParameterError as error:
            if error.field not in self.settings:
                raise
            raise error.reworded(f"{argument('settings')}: {error}") from error

    def budget(self, seeker: Any) -> int:
        """How many cycles a search takes by default."""
        kind = getattr(seeker, "_seeker_kind", None) or seeker.kind
        if kind in {cls.kind for cls in _FIRST}:
            return _CYCLES + math.ceil(_PER_LATE * self.late_cycles)
        return max(_DITHER_CYCLES, _PERIODS * int(seeker.settings.get("period", 0)))


def chosen(asked: Question, seeker: str | type[Seeker] = "auto") -> Choice:
    """Choose a seeker, or make the one that is named."""
    if isinstance(asked.guide, Curve) and len(asked.inputs) > 1:
        names = ", ".join(one.name for one in asked.inputs)
        raise ParameterError(f"guide = {asked.guide!r}: a Curve has one input, not {names}; give a function of them")
    if isinstance(asked.guide, CalibrationMap) and not {one.name for one in asked.inputs} & set(asked.guide.axes):
        asked = replace(asked, guide=TimingMap(asked.guide))
    if isinstance(asked.guide, EngineGuide | TimingMap):
        made, reason = _led(asked, seeker)
    elif seeker == "auto":
        made, reason = _automatic(asked)
    else:
        made, reason = _named(asked, seeker), "as asked for"
    return Choice(made, reason, asked.first_cycles, asked.budget(made))


def _class_of(seeker: Any) -> type[Seeker]:
    if isinstance(seeker, type) and issubclass(seeker, Seeker):
        return seeker
    if isinstance(seeker, str):
        named = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", seeker).lower()
        if named in SEEKERS:
            return SEEKERS[named]
        message = f"{argument('seeker', seeker)}: must be auto or one of {', '.join(SEEKERS)}"
        raise ParameterError(hinted(message, seeker, list(SEEKERS)), field="seeker", value=seeker)
    raise ParameterError.of("seeker", seeker, f"auto, a name ({', '.join(SEEKERS)}) or a seeker")


def _name_of(cls: type[Seeker]) -> str:
    return next((name for name, one in SEEKERS.items() if one is cls), cls.kind)


def _bears_delay(cls: type[Seeker]) -> bool:
    return bool({"components", "delay_cycles"} & inspect.signature(cls).parameters.keys())


def _named(asked: Question, seeker: Any) -> Seeker:
    cls = _class_of(seeker)
    if cls is CurveSeeking:
        return _by_curve(asked)
    guided: dict[str, Any] = {}
    if asked.guide is not None:
        if cls is not GaussianProcessSeeking:
            raise ParameterError(
                f"{argument('seeker', _name_of(cls))}: takes no guide of J; give an EngineGuide of kind "
                "feed_forward or a TimingMap, or leave the guide out"
            )
        guided = {"guide": asked.guide}
    return asked.made(cls, asked.start, **guided)


def _by_curve(asked: Question, **own: Any) -> Seeker:
    if len(asked.inputs) != 1:
        raise ParameterError(f"{argument('seeker', 'curve_seeking')}: seeks one input, not {len(asked.inputs)}")
    (one,) = asked.inputs
    curve = asked.guide if isinstance(asked.guide, Curve) else own.pop("curve", None) or _parabola(one)
    best = {one.name: min(max(curve.best, one.lower), one.upper)}
    if asked.limits and own.get("limit_curves") is None:
        stride = min(one.rate, max(_STRIDE * (one.upper - one.lower), one.step))
        asked = replace(asked, inputs=[one.replace(rate=stride)])
    begin = asked.start or best | safe_side(asked.inputs, asked.limits)
    return asked.made(CurveSeeking, begin, curve=curve, **own)


def _automatic(asked: Question) -> tuple[Seeker, str]:
    """Take a curve for one input, a Gaussian process for several and for components of their own delays."""
    guide, inputs = asked.guide, asked.inputs
    if asked.components is None and (isinstance(guide, Curve) or (guide is None and len(inputs) == 1)):
        basis = "one input and the curve of a guide" if guide else "one input: a parabola serves as the guide"
        return _by_curve(asked), f"{basis}, placed by the readings"
    start = asked.start
    if start is None and guide is not None and not asked.limits and asked.components is None:
        start = _best_of(guide, inputs, asked.maximize)
    guided: dict[str, Any] = {} if guide is None else {"guide": guide}
    count = "one input" if len(inputs) == 1 else f"{len(inputs)} inputs"
    kept = f", {', '.join(limit.name for limit in asked.limits)} to keep" if asked.limits else ""
    by = " and a guide" if guided else ""
    return (
        asked.made(GaussianProcessSeeking, start, **guided),
        f"{count}{by}{kept}: smallest cumulative loss, whatever their units",
    )


def _led(asked: Question, seeker: Any) -> tuple[Any, str]:
    """Put a model or a table in front: it says where to begin, and the readings decide."""
    guide, (one, *more), point = asked.guide, asked.inputs, asked.point
    if more or one.name != "soc_cad":
        names = ", ".join(each.name for each in asked.inputs)
        raise ParameterError(f"{argument('guide')}: guides soc_cad alone, not {names}: leave it out")
    if point is None:
        raise ParameterError(f"{argument('guide')}: the plant has no operating point: give EngineGuide its point")
    plain = replace(asked, guide=None)
    if isinstance(guide, TimingMap):
        timing_cad = guide(point)
        if timing_cad is None:
            raise ParameterError(
                f"{argument('guide_table')}: gives no timing at {point}: its axes end before: widen them"
            )
        inner = _inner(plain, seeker, float(timing_cad))
        return FeedForward(inner, guide, keep_start=True), f"{inner.kind} after the timing of a table"
    model = guide.model((one.lower, one.upper))
    if guide.kind == "feed_forward":
        best = guide.best_of(model, point)
        inner = _inner(plain, seeker, guide.start(model, point, asked.limits, best))
        return GuidedEngine(inner, model, point, keep_start=True), f"{inner.kind} after the best timing of a model"
    if seeker not in ("auto", "curve_seeking"):
        raise ParameterError(
            f"{argument('seeker')} acts with {argument('guide', 'none')}, feed_forward or map: "
            f"{argument('guide', guide.kind)} is a seeker itself"
        )
    curve = guide.curve(model, point)
    begin = asked.start or {one.name: guide.start(model, point, asked.limits, curve.best)}
    drawn = model.limit_curves(point, [limit.name for limit in asked.limits]) if asked.limits else None
    if asked.components is not None:
        if guide.kind == "calibrated" or guide.shape == "parabola":
            raise ParameterError(
                f"{argument('guide', guide.kind)} takes J of the same cycle, and a component of J is late: use "
                f"{argument('nox_sensor', 'soft')}, or {argument('guide', 'curve')} with the model's shape"
            )
        own: dict[str, Any] = {"guide": guide.component_guides((one.lower, one.upper), point)}
        if drawn is not None:
            own["limit_guides"] = [lambda x, each=each: each(x[one.name]) for each in drawn]
        return plain.made(GaussianProcessSeeking, begin, **own), "one input, late components and a model of each"
    made = _by_curve(replace(plain, start=begin), curve=curve, limit_curves=drawn)
    if guide.kind == "curve":
        return made, "one input and the curve of a model, placed by the readings"
    return (
        GuidedEngine(made, model, point, calibration=guide.calibration(), keep_start=True),
        "one input and the curve of a model that learns from the pressure",
    )


def _inner(asked: Question, seeker: Any, best: float) -> Seeker:
    """Make the seeker of what is left; a dither without a model of J is the default behind a feed-forward."""
    cls = ExtremumSeeking if seeker == "auto" else _class_of(seeker)
    if cls in (GoldenSection, CurveSeeking):
        raise ParameterError(
            f"{argument('seeker', _name_of(cls))} searches its whole range, whatever the guide says: use another one"
        )
    (one,) = asked.inputs
    if asked.start is not None:
        return asked.made(cls, asked.start)
    return asked.made(cls, {one.name: _inside(one, best, _DITHER)})


def _inside(one: Input, value: float, scales: float) -> float:
    room = scales * (one.scale or (one.upper - one.lower) / 40.0)
    return min(max(value, one.lower + room), one.upper - room)


def _best_of(guide: Any, inputs: Sequence[Input], maximize: bool) -> dict[str, float]:
    """Return where a guide of several inputs is best: without limits a search begins there."""
    (surface,) = GaussianProcessSeeking(start=middle_of(inputs), inputs=list(inputs), guide=guide).settings["guide"]
    values = surface.values if maximize else -surface.values
    at = np.unravel_index(int(np.argmax(values)), values.shape)
    return {one.name: axis[k] for one, axis, k in zip(inputs, surface.axes, at, strict=True)}


def _parabola(one: Input) -> Curve:
    width = one.upper - one.lower
    return Curve.parabola(curvature=_BEND / width**2, best=0.5 * (one.lower + one.upper), reach=_REACH * width)
