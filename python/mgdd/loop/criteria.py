"""What to look for in a closed loop."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mgdd._core.optimize import Limit
from mgdd.errors import ParameterError
from mgdd.optimize.optimum import limits_of

if TYPE_CHECKING:
    from mgdd.guide import FeedForward, GuidedEngine
    from mgdd.optimize import Seeker

_LONGEST_SETTLING = 1000  # cycles that do not count for the limits unless the caller says so; as in the core


@dataclass(frozen=True, kw_only=True)
class LoopCriteria:
    """What a loop is judged by: where its estimate should go, and which limits count from when.

    Parameters
    ----------
    optimum : float, optional
        Where the estimate of the first input should go [its unit]; without it arrival and distance are not judged.
    arrival : float
        Distance to the optimum that counts as arrived [unit of the input].
    tail_cycles : int
        Cycles behind ``final_INPUT``.
    exceed_from : int, optional
        First cycle that counts for ``exceeded_fraction`` and the figures ``judged_...``; by default 1000, or the middle
        of a run of fewer than 2000 cycles. The summary repeats it as ``judged_from``.
    exceed_above : mapping of str to float
        Per limit, the value above which a cycle counts for ``exceeded_fraction``, for example the limit and a margin
        for its scatter; the summary repeats it as ``exceed_above_NAME``.
    limits : mapping of str to float, or sequence of Limit, optional
        Limits of which the summary gives ``worst_NAME``, ``above_fraction_NAME`` and so on, without any margin; those
        of the seeker if left out.

    Raises
    ------
    mgdd.errors.ParameterError
        A criterion outside its domain.

    Examples
    --------
    >>> from mgdd.loop import EngineBench, LoopCriteria, run_seeker
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-20.0, lower=-30.0, upper=10.0, noise_sd=0.25)
    >>> run = run_seeker(EngineBench(seed=1), seeker, 300, criteria=LoopCriteria(optimum=-5.63))
    >>> run.summary["cycles_to"] < 100
    True
    """

    optimum: float | None = None
    arrival: float = 1.0
    tail_cycles: int = 100
    exceed_from: int | None = None
    exceed_above: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] | Sequence[Limit] | None = None

    def __post_init__(self) -> None:
        number = isinstance(self.optimum, int | float) and math.isfinite(self.optimum)
        if self.optimum is not None and not number:
            raise ParameterError.of("optimum", self.optimum, "one finite number, or None")
        if not self.arrival > 0.0:
            raise ParameterError.of("arrival", self.arrival, "> 0")
        if self.tail_cycles < 1:
            raise ParameterError.of("tail_cycles", self.tail_cycles, ">= 1")
        if self.exceed_from is not None and self.exceed_from < 0:
            raise ParameterError.of("exceed_from", self.exceed_from, ">= 0")
        for what, values in (("exceed_above", self.exceed_above), ("limits", self._uppers())):
            for name, value in values.items():
                if math.isnan(value):
                    raise ParameterError(f"{what}: {name} = nan: give a number, or leave it out")

    def _uppers(self) -> Mapping[str, float]:
        own = self.limits or {}
        return own if isinstance(own, Mapping) else {limit.name: limit.upper for limit in limits_of(own)}

    def counted_from(self, cycles: int) -> int:
        """Give the first cycle that counts for ``exceeded_fraction``."""
        return min(_LONGEST_SETTLING, cycles // 2) if self.exceed_from is None else self.exceed_from

    def require_counted(self, cycles: int) -> None:
        """Raise where no cycle of a run would count for ``exceeded_fraction``."""
        if self.exceed_above and self.exceed_from is not None and self.exceed_from >= cycles:
            raise ParameterError.of("exceed_from", self.exceed_from, f"< cycles = {cycles}, or no cycle counts")

    def thresholds(self, names: tuple[str, ...]) -> list[float]:
        """Give ``exceed_above`` in the order of the limits, infinite where it has none; empty if it is empty."""
        return _in_order("exceed_above", self.exceed_above, names) if self.exceed_above else []

    def limits_of(
        self, names: tuple[str, ...], seeker: Seeker | FeedForward | GuidedEngine | None = None
    ) -> list[float]:
        """Give ``limits`` or those of the seeker in the order of the names, infinite where there is none."""
        if self.limits is not None or seeker is None:
            return _in_order("limits", self._uppers(), names)
        return _in_order("limits", {limit.name: limit.upper for limit in seeker.settings["limits"]}, names)

    def attributes(self, names: tuple[str, ...], uppers: Sequence[float]) -> dict[str, float]:
        """Give what a figure of the run marks: ``optimum``, and ``limit_NAME`` where there is one."""
        found = {f"limit_{name}": upper for name, upper in zip(names, uppers, strict=True) if math.isfinite(upper)}
        return found if self.optimum is None else {"optimum": float(self.optimum), **found}

    def to_core(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Give what the loops of the core take."""
        return {
            "optimum_cad": math.nan if self.optimum is None else self.optimum,
            "arrival_cad": self.arrival,
            "tail_cycles": self.tail_cycles,
            "exceed_from": self.exceed_from,
            "exceed_above": self.thresholds(names),
            "limits": [] if self.limits is None else self.limits_of(names),
        }


def _in_order(what: str, values: Mapping[str, float], names: tuple[str, ...]) -> list[float]:
    if unknown := sorted(set(values) - set(names)):
        raise ParameterError(f"{what}: {unknown} not among the limits, {list(names)}")
    return [float(values.get(name, math.inf)) for name in names]
