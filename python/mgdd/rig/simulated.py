"""Any plant behind the protocol of a real rig."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

from mgdd.errors import RigError
from mgdd.loop import Measurement, Plant

__all__ = ["SimulatedRig"]


class SimulatedRig:
    """A simulated plant as a rig: the same numbers, with a connection that can be closed.

    Parameters
    ----------
    plant : mgdd.loop.Plant
        A bench, a surrogate or a throttle; it advances by one cycle or sample per measurement.

    Examples
    --------
    >>> from mgdd.loop import EngineBench
    >>> from mgdd.rig import SimulatedRig
    >>> with SimulatedRig(EngineBench(limits=["p_max_bar"])) as rig:
    ...     rig.apply({"soc_cad": -6.0})
    ...     measured = rig.measure()
    >>> sorted(measured.limits), measured.misfire
    (['p_max_bar'], False)
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._applied = False
        self._closed = False

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.plant.input_names

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities that `measure` reports."""
        return self.plant.limit_names

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle brings a new operating point; False for a plant that announces none."""
        return bool(getattr(self.plant, "operating_point_changes", False))

    @property
    def point(self) -> Any:
        """Operating point of the next cycle, for a guide; as absent as the plant's own."""
        return getattr(self.plant, "point")  # noqa: B009 - the protocol of a plant does not have it

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next cycle or sample.

        Parameters
        ----------
        inputs : mapping of str to float
            One number per name of `input_names`.

        Raises
        ------
        mgdd.errors.ParameterError
            A missing, unknown or non-finite input.
        mgdd.errors.RigError
            The rig is closed.
        """
        self._require_open()
        self.plant.apply(inputs)
        self._applied = True

    def measure(self) -> Measurement:
        """Run one cycle or sample at the inputs applied last.

        Returns
        -------
        mgdd.loop.Measurement
            As the plant gives it.

        Raises
        ------
        mgdd.errors.RigError
            Nothing was applied yet, or the rig is closed.
        """
        self._require_open()
        if not self._applied:
            raise RigError("measure() before apply(): apply the inputs first")
        return self.plant.measure()

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
