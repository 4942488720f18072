"""What a loop may ask of a test rig, and what it gets back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

__all__ = ["Measurement", "Rig"]


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
        return sum(self.components)


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
