"""Faults of a throttle in the loop beside those of its sensors: plate, springs, supply, and lost measurements."""

from __future__ import annotations

from dataclasses import dataclass

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.results.describe import described

__all__ = ["ThrottleFault"]

_SIZED = {"jammed_at": "deg", "spring_above": "-", "spring_below": "-", "supply_sag": "V"}


@described
@dataclass(frozen=True, kw_only=True)
class ThrottleFault:
    """A fault of plate, springs, supply or measurement, from a time on.

    Parameters
    ----------
    kind : str
        ``jammed``: plate and gear stay where they are. ``jammed_at``: they catch when the plate comes to `size`.
        ``spring_above``, ``spring_below``: the spring of that side of limp-home loses the share `size` of preload and
        stiffness. ``supply_sag``: the bridge has `size` at most. ``missing_sample``: no measurement arrives.
        ``nan_sample``: one arrives, and its numbers are NaN. ``stale_sample``: the last good one arrives again.
    from_s : float
        Onset [s], >= 0.
    until_s : float, optional
        End [s]; it stays if left out. A loss of n samples ends n samples after its onset.
    size : float, optional
        Angle [deg], share in (0, 1] or voltage [V] of the kinds that have one; a spring breaks as a whole if left out.

    Raises
    ------
    mgdd.errors.ParameterError
        No such kind, a size for a kind that has none or none for one that needs it. `mgdd.loop.VirtualThrottle` refuses
        a time or size outside its domain.

    Examples
    --------
    >>> from mgdd.loop import ThrottleFault, VirtualThrottle
    >>> plant = VirtualThrottle(faults=[ThrottleFault(kind="jammed_at", size=20.0)])
    >>> for _ in range(200):
    ...     plant.apply({"duty": 0.6})
    ...     values = plant.measure().values
    >>> abs(values["angle_deg"] - 20.0) < 0.2
    True
    """

    kind: str
    from_s: float = 0.0
    until_s: float | None = None
    size: float | None = None

    def __post_init__(self) -> None:
        kinds = _core.loop.throttle_fault_kinds
        if self.kind not in kinds:
            raise ParameterError.of("kind", self.kind, f"one of {', '.join(kinds)}")
        if self.kind.startswith("spring") and self.size is None:
            object.__setattr__(self, "size", 1.0)
        if (self.kind in _SIZED) != (self.size is not None):
            sized = ", ".join(f"{kind!r} [{unit}]" for kind, unit in _SIZED.items())
            raise ParameterError(f"size = {self.size}: goes with {sized}, which need it")

    def to_core(self) -> tuple[str, float, float, float | None]:
        """Give kind, onset [s], size and end [s] as the core reads them."""
        until = None if self.until_s is None else float(self.until_s)
        return self.kind, float(self.from_s), float(self.size or 0.0), until
