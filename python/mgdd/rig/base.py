"""What a test rig adds to a plant, what stands around another plant, and the simulated rig."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

from mgdd.errors import RigError
from mgdd.loop import Measurement, Plant


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
    def operating_point_changes(self) -> bool:
        """Whether the next cycle brings a new operating point; False for a plant that announces none."""
        return bool(getattr(self.plant, "operating_point_changes", False))

    @property
    def point(self) -> Any:
        """Operating point of the next cycle, for a guide; as absent as the plant's own."""
        return getattr(self.plant, "point")  # noqa: B009 - the protocol of a plant does not have it


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
