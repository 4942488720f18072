"""What a test rig adds to a plant, what stands around another plant, the simulated rig and the guard."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType, TracebackType
from typing import Any, NamedTuple, Protocol, Self, runtime_checkable

from mgdd.errors import ParameterError, RigError, did_you_mean
from mgdd.loop import Measurement, Plant
from mgdd.optimize import Limit
from mgdd.optimize.optimum import limits_of


@runtime_checkable
class Rig(Plant, Protocol):
    """A plant behind a connection, used as a context manager; `mgdd.loop.run_seeker` steers it like any other.

    A rig that knows of a new operating point before its cycle says so in a property ``operating_point_changes``.
    """

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...


class AroundPlant:
    """Passes on what the plant inside says of itself."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.plant.input_names

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities that `measure` reports."""
        return self.plant.limit_names

    @property
    def objective(self) -> Mapping[str, float]:
        """Weights of the quantities in J, by name; empty where the plant does not say."""
        return getattr(self.plant, "objective", {})

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle brings a new operating point; False for a plant that announces none."""
        return bool(getattr(self.plant, "operating_point_changes", False))

    @property
    def point(self) -> Any:
        """Operating point of the next cycle, for a guide; as absent as the plant's own."""
        return getattr(self.plant, "point")  # noqa: B009 - the protocol of a plant does not have it

    def begin(self, visit: int) -> None:
        """Say that a visit of a search for a map begins, to a plant whose noise follows from its number."""
        if hasattr(self.plant, "begin"):
            self.plant.begin(visit)


class OpenOnce:
    """Open until it is closed, and then never again."""

    _closed = False

    def close(self) -> None:
        """Refuse further use, as a rig whose connection is gone."""
        self._closed = True

    def __enter__(self) -> Self:
        self._require_open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _require_open(self) -> None:
        if self._closed:
            raise RigError("the rig is closed: make a new one")


class SimulatedRig(AroundPlant, OpenOnce):
    """A simulated plant as a rig: the same numbers, with a connection that can be closed.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        A bench, a surrogate or a throttle; it advances by one cycle or sample per measurement.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine
    >>> from mgdd.rig import SimulatedRig
    >>> with SimulatedRig(VirtualEngine(limits=["p_max_bar"])) as rig:
    ...     rig.apply({"soc_cad": -6.0})
    ...     measured = rig.measure()
    >>> sorted(measured.limits), measured.misfire
    (['p_max_bar'], False)
    """

    _applied = False

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next cycle or sample, as `mgdd.loop.Plant.apply`; RigError where the rig is closed."""
        self._require_open()
        self.plant.apply(inputs)
        self._applied = True

    def measure(self) -> Measurement:
        """Run one cycle or sample at the inputs applied last; RigError before them, and where the rig is closed."""
        self._require_open()
        if not self._applied:
            raise RigError("measure() before apply(): apply the inputs first")
        return self.plant.measure()


_LOGGED = 10_000
_GOOD = 32  # points to step back to, the start apart
_LAGS = 3.0  # so many time constants until a reading shows its input


class GuardedAsk(NamedTuple):
    """An ask of an optimiser that was not applied as it was."""

    cycle: int  # of the guard, from 0 on
    reason: str  # not_finite, bounds, limit (these apply the last good point) or rate
    name: str  # input or limited quantity to blame
    asked: Mapping[str, float]
    applied: Mapping[str, float]


class ActuatorGuard(AroundPlant):
    """A plant that applies what an optimiser asks for only where it is safe; itself a plant of the loop.

    An ask that is not finite or outside the bounds of any input is rejected: the last good point is applied instead,
    and `log` says so. A move faster than the rate of an input is cut to it. Where a limit was exceeded, asks are
    rejected and the last good point stands for `hold_cycles`; a point that itself exceeds one is good no longer, and
    the one before it follows, down to the start. What was applied comes back in ``Measurement.applied``: a seeker
    judges the reading on it.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        A bench, a surrogate or a rig, of any number of inputs.
    start : mapping of str to float
        A point known to be safe, applied wherever no other has proved good.
    bounds : mapping of str to (float, float)
        Lower and upper bound of every input.
    rates : mapping of str to float
        Largest change per cycle; an input that is left out has none. A step back is not cut.
    limits : mapping of str to float, or sequence of mgdd.optimize.Limit
        Measured quantities and their `upper`; `delay_cycles` and `lag_cycles` say which input caused a reading. A
        reading that is missing or NaN counts as exceeded. Their other fields belong to seekers.
    hold_cycles : int
        For how long asks are rejected after a limit was exceeded, beyond the delay of that limit; >= 1.

    Raises
    ------
    mgdd.errors.ParameterError
        An input without bounds or start, a start outside them, an unknown name, a rate not > 0.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine, run_seeker
    >>> from mgdd.optimize import ExtremumSeeking, Limit
    >>> from mgdd.rig import ActuatorGuard
    >>> bench = VirtualEngine(limits=["p_max_bar"], seed=1)
    >>> guard = ActuatorGuard(
    ...     bench, start={"soc_cad": 0.0}, bounds={"soc_cad": (-12.0, 10.0)}, limits=[Limit("p_max_bar", 80.0)]
    ... )
    >>> run = run_seeker(guard, ExtremumSeeking(start=0.0, bounds=(-30.0, 10.0)), 400)
    >>> guard.counts["limit"] > 0, float(run.dataset["applied"][:, 0].min()) >= -12.0
    (True, True)
    """

    def __init__(
        self,
        plant: Plant,
        *,
        start: Mapping[str, float],
        bounds: Mapping[str, tuple[float, float]],
        rates: Mapping[str, float] = MappingProxyType({}),
        limits: Mapping[str, float] | Sequence[Limit] = (),
        hold_cycles: int = 1,
    ) -> None:
        names, limits_kept = plant.input_names, limits_of(limits)
        for argument, given in (("start", start), ("bounds", bounds), ("rates", rates)):
            _require_known(argument, given, names)
        _require_known("limits", [limit.name for limit in limits_kept], plant.limit_names)
        for name in names:
            if name not in bounds or name not in start:
                raise ParameterError(f"{name}: needs a start and bounds")
            lower, upper = bounds[name]
            if not -math.inf < lower < upper < math.inf:
                raise ParameterError.of(f"bounds[{name!r}]", bounds[name], "finite, the lower below the upper")
            if not lower <= start[name] <= upper:
                raise ParameterError.of(f"start[{name!r}]", start[name], f"in [{lower:g}, {upper:g}]")
        for name, rate in rates.items():
            ParameterError.unless(rate > 0.0, f"rates[{name!r}]", rate, "> 0")
        ParameterError.unless(hold_cycles >= 1, "hold_cycles", hold_cycles, ">= 1")
        super().__init__(plant)
        self.start = {name: float(start[name]) for name in names}
        self.bounds = {name: (float(bounds[name][0]), float(bounds[name][1])) for name in names}
        self.rates = {name: float(rate) for name, rate in rates.items()}
        self.limits = limits_kept
        self.hold_cycles = int(hold_cycles)
        self._delay = max((_delay(limit) for limit in limits_kept), default=0)
        self._goods = [self.start]
        self._applied: dict[str, float] | None = None
        self._recent: deque[dict[str, float]] = deque(maxlen=self._delay + 1)
        self._unproved = 0
        self._held, self._exceeded, self._cycle = 0, "", 0
        self._log: deque[GuardedAsk] = deque(maxlen=_LOGGED)
        self._counts: Counter[str] = Counter()

    @property
    def good(self) -> dict[str, float]:
        """The last good point."""
        return dict(self._goods[-1])

    @property
    def log(self) -> list[GuardedAsk]:
        """Asks that were not applied as they were, oldest first; the last 10000."""
        return list(self._log)

    @property
    def counts(self) -> dict[str, int]:
        """All of them by reason."""
        return {reason: self._counts[reason] for reason in ("not_finite", "bounds", "rate", "limit")}

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next cycle, as far as they are safe; ParameterError for a missing or unknown one."""
        if set(inputs) != set(self.input_names):
            raise ParameterError(
                f"inputs = {', '.join(map(str, inputs)) or 'none'}: must be {', '.join(self.input_names)}"
            )
        asked = {name: float(inputs[name]) for name in self.input_names}
        reason, name = self._objection(asked)
        applied = self.good
        if not reason:
            applied, name = self._cut(asked)
            reason = "rate" if name else ""
        if reason:
            self._counts[reason] += 1
            self._log.append(GuardedAsk(self._cycle, reason, name, asked, dict(applied)))
        self.plant.apply(applied)
        self._applied = applied

    def measure(self) -> Measurement:
        """Run one cycle and judge what was applied, which stands in the measurement; RigError before `apply`."""
        if self._applied is None:
            raise RigError("measure() before apply(): apply the inputs first")
        measured = self.plant.measure()
        applied = {**self._applied, **measured.applied}
        self._cycle += 1
        self._held = max(0, self._held - 1)
        over = next(
            (limit for limit in self.limits if not measured.limits.get(limit.name, math.nan) <= limit.upper), None
        )
        self._recent.append({name: applied[name] for name in self.input_names})
        self._unproved += 1
        if over is not None:
            cause = self._recent[max(-1 - _delay(over), -len(self._recent))]
            self._goods[1:] = [good for good in self._goods[1:] if good != cause]
            self._held, self._exceeded = self.hold_cycles + _delay(over), over.name
            self._unproved = 0
        elif self._unproved > self._delay and not measured.misfire and self._recent[0] != self._goods[-1]:
            self._goods = [self.start, *self._goods[1:][1 - _GOOD :], self._recent[0]]
        return replace(measured, applied=applied)

    def _objection(self, asked: Mapping[str, float]) -> tuple[str, str]:
        for name, value in asked.items():
            if not math.isfinite(value):
                return "not_finite", name
        for name, value in asked.items():
            lower, upper = self.bounds[name]
            if not lower <= value <= upper:
                return "bounds", name
        return ("limit", self._exceeded) if self._held else ("", "")

    def _cut(self, asked: Mapping[str, float]) -> tuple[dict[str, float], str]:
        before = self.start if self._applied is None else self._applied
        applied, cut = dict(asked), ""
        for name, rate in self.rates.items():
            applied[name] = min(max(asked[name], before[name] - rate), before[name] + rate)
            cut = cut or (name if applied[name] != asked[name] else "")
        return applied, cut


def _require_known(argument: str, given: Any, names: Sequence[str]) -> None:
    for name in given:
        if name not in names:
            raise ParameterError(f"{argument}: unknown name {name!r}: {did_you_mean(name, names) or ', '.join(names)}")


def _delay(limit: Limit) -> int:
    return math.ceil(limit.delay_cycles + _LAGS * limit.lag_cycles)
