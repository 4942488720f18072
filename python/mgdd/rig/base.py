"""What a test rig adds to a plant: it is opened and closed."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from mgdd.loop import Plant

__all__ = ["Rig"]


@runtime_checkable
class Rig(Plant, Protocol):
    """A plant behind a connection, used as a context manager; `mgdd.loop.run_seeker` steers it like any other.

    A rig that knows of a new operating point before its cycle says so in a property ``operating_point_changes``.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.rig.base import Rig
    >>> from mgdd.rig import SimulatedRig
    >>> isinstance(SimulatedRig(EngineBench()), Rig), isinstance(EngineBench(), Rig)
    (True, False)
    """

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...
