"""A recorded rig: the measurements of a record, for the inputs of the record."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import NamedTuple, Self

from mgdd.errors import ParameterError, RigError
from mgdd.loop import Measurement
from mgdd.loop.plant import checked_inputs
from mgdd.rig.exchange import RigRecord

__all__ = ["Difference", "ReplayRig"]


class Difference(NamedTuple):
    """An input that was asked for and is not the recorded one."""

    sample: int
    name: str
    asked: float
    recorded: float


class ReplayRig:
    """A rig that gives back what was recorded.

    A measurement belongs to the inputs it was recorded at: where others are asked for, the replay ends there, or with
    ``strict=False`` goes on and lists them in `differences`.

    Parameters
    ----------
    record : RigRecord
        What `RecordingRig` remembered.
    tolerance : float
        Largest difference of an input that counts as none, in its unit.
    strict : bool
        Whether another input is an error.

    Raises
    ------
    mgdd.errors.ParameterError
        A negative tolerance.

    Examples
    --------
    >>> from mgdd.loop import VirtualThrottle
    >>> from mgdd.rig import RecordingRig, ReplayRig, SimulatedRig
    >>> with RecordingRig(SimulatedRig(VirtualThrottle(seed=1))) as rig:
    ...     rig.apply({"duty": 0.6})
    ...     live = rig.measure()
    >>> with ReplayRig(rig.record) as again:
    ...     again.apply({"duty": 0.6})
    ...     replayed = again.measure()
    >>> replayed == live
    True
    """

    def __init__(self, record: RigRecord, *, tolerance: float = 0.0, strict: bool = True) -> None:
        if not tolerance >= 0.0:
            raise ParameterError.of("tolerance", tolerance, ">= 0")
        self.record, self.tolerance, self.strict = record, tolerance, strict
        self.differences: list[Difference] = []
        self.sample = 0
        self._asked: dict[str, float] | None = None
        self._closed = False

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.record.input_names

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities that `measure` reports."""
        return self.record.limit_names

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Ask for the inputs of the next sample.

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
        values = checked_inputs(inputs, self.input_names)
        self._asked = dict(zip(self.input_names, values, strict=True))

    def measure(self) -> Measurement:
        """Give the next recorded measurement.

        Returns
        -------
        mgdd.loop.Measurement
            As it was recorded.

        Raises
        ------
        mgdd.errors.RigError
            Nothing was applied yet, the rig is closed, the record is at its end, or another input was asked for.
        """
        self._require_open()
        if self._asked is None:
            raise RigError("measure() before apply(): apply the inputs first")
        if self.sample >= len(self.record):
            raise RigError(f"the record ends after {len(self.record)} samples: ask for fewer")
        recorded = self.record[self.sample]
        found = [
            Difference(self.sample, name, asked, recorded.inputs[name])
            for name, asked in self._asked.items()
            if not abs(asked - recorded.inputs[name]) <= self.tolerance
        ]
        if found and self.strict:
            one = found[0]
            raise RigError(
                f"sample {one.sample}: {one.name} = {one.asked:g} was asked for, {one.recorded:g} is recorded; "
                "strict=False goes on and lists the differences"
            )
        self.differences += found
        self.sample += 1
        return recorded.measurement

    def close(self) -> None:
        """Refuse further use."""
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
