"""What a loop may ask of a test rig, and what it gets back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from mgdd._describe import described

__all__ = ["AnnouncingRig", "Measurement", "Rig"]


@described
@dataclass(frozen=True, kw_only=True)
class Measurement:
    """What was measured of one engine cycle.

    Parameters
    ----------
    components : tuple of float
        Terms of the performance J, to be maximised.
    limits : mapping of str to float
        Measured values of limited quantities, by name.
    misfire : bool
        Whether the cycle burned nothing: its performance says nothing about the timing.
    values : mapping of str to float
        Everything else that the rig measured, by name.

    Examples
    --------
    >>> from mgdd.rig import Measurement
    >>> Measurement(components=(56.0, -6.0)).performance
    50.0
    """

    components: tuple[float, ...]
    limits: Mapping[str, float] = field(default_factory=dict)
    misfire: bool = False
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def performance(self) -> float:
        """Sum of the components, J.

        Returns
        -------
        float
            In the unit of J.
        """
        total = 0.0
        for component in self.components:  # plain order: the built-in sum rounds otherwise from Python 3.12 on
            total += component
        return total


@runtime_checkable
class Rig(Protocol):
    """A test rig: takes a timing, gives back what was measured; used as a context manager.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.rig import Rig, SimulatedRig
    >>> isinstance(SimulatedRig(EngineBench()), Rig)
    True
    """

    def apply(self, soc_cad: float) -> None:
        """Set the start of combustion of the next cycle.

        Parameters
        ----------
        soc_cad : float
            Start of combustion [°CA aTDC].
        """
        ...

    def measure(self) -> Measurement:
        """Wait for the next cycle and measure it.

        Returns
        -------
        Measurement
            Of one cycle at the timing applied last.

        Raises
        ------
        mgdd.errors.RigError
            Nothing was applied yet, or the rig is closed.
        """
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None: ...


@runtime_checkable
class AnnouncingRig(Rig, Protocol):
    """A rig that knows of a new operating point before the cycle, as one that sets speed and fuel itself does.

    Other rigs may say it afterwards, in ``values["operating_point_changed"]``; that costs one cycle.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.rig import AnnouncingRig, SimulatedRig
    >>> rig = SimulatedRig(EngineBench())
    >>> isinstance(rig, AnnouncingRig), rig.operating_point_changes
    (True, False)
    """

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle runs at another operating point than the last one.

        Returns
        -------
        bool
            True once per change, until that cycle is measured.
        """
        ...
