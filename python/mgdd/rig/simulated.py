"""The virtual bench behind the protocol of a real rig."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from mgdd.errors import ParameterError, RigError
from mgdd.loop import EngineBench
from mgdd.rig.base import Measurement

__all__ = ["SimulatedRig"]


class SimulatedRig:
    """A virtual engine bench as a rig.

    Parameters
    ----------
    bench : EngineBench
        The bench; it advances by one cycle per measurement.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.rig import SimulatedRig
    >>> with SimulatedRig(EngineBench(limits=["p_max_bar"])) as rig:
    ...     rig.apply(-6.0)
    ...     measured = rig.measure()
    >>> sorted(measured.limits), measured.misfire
    (['p_max_bar'], False)
    """

    def __init__(self, bench: EngineBench) -> None:
        self.bench = bench
        self._soc_cad: float | None = None
        self._closed = False

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle brings a new operating point of the schedule.

        Returns
        -------
        bool
            True where speed or fuel move by more than 5 %.
        """
        return bool(self.bench.operating_point_changes)

    @property
    def limit_names(self) -> list[str]:
        """Names of the limited quantities that `measure` reports."""
        return list(self.bench.settings["limits"])

    def apply(self, soc_cad: float) -> None:
        """Set the start of combustion of the next cycle.

        Parameters
        ----------
        soc_cad : float
            Start of combustion [°CA aTDC]; the bench clamps it to its window and says so in ``values["clamped"]``.

        Raises
        ------
        mgdd.errors.ParameterError
            A timing that is not finite.
        mgdd.errors.RigError
            The rig is closed.
        """
        self._require_open()
        if not math.isfinite(soc_cad):
            raise ParameterError(f"soc_cad = {soc_cad}: must be finite")
        self._soc_cad = float(soc_cad)

    def measure(self) -> Measurement:
        """Run one cycle at the timing applied last.

        Returns
        -------
        Measurement
            ``values`` holds the indicators, actual SOC, NOx of every sensor and the flags as 0 or 1.

        Raises
        ------
        mgdd.errors.RigError
            Nothing was applied yet, or the rig is closed.
        """
        self._require_open()
        if self._soc_cad is None:
            raise RigError("measure() before apply(): apply a timing first")
        cycle = self.bench.step(self._soc_cad)
        components, limits = cycle.pop("components"), cycle.pop("limits")
        return Measurement(
            components=tuple(map(float, components)),
            limits=limits,
            misfire=cycle["misfire"],
            values={name: float(value) for name, value in cycle.items()},
        )

    def close(self) -> None:
        """Refuse further use, as a rig whose connection is gone."""
        self._closed = True

    def __enter__(self) -> Self:
        self._require_open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        self.close()

    def _require_open(self) -> None:
        if self._closed:
            raise RigError("the rig is closed: make a new one")
