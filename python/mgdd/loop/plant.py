"""The one protocol of what a loop can steer: a bench, a surrogate, a throttle, a rig over a bus, a replay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from mgdd._arguments import require_plain
from mgdd.errors import ParameterError
from mgdd.results.describe import described

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@described
@dataclass(frozen=True, kw_only=True)
class Measurement:
    """What was measured of one engine cycle, or at one sample.

    Parameters
    ----------
    components : tuple of float
        Terms of the objective J, to be maximised; none where the plant has no objective of its own.
    limits : mapping of str to float
        Measured values of limited quantities, by name.
    misfire : bool
        Whether the cycle burned nothing: its performance says nothing about the inputs.
    values : mapping of str to float
        Everything else that was measured, by name.
    noise_free_limits : mapping of str to float
        Limited quantities at these inputs without scatter and noise; empty where the plant does not know them.
    applied : mapping of str to float
        Inputs that were really applied, by name, for a plant that clamps them; what is missing was applied as asked.
    pressure_bar : ndarray, optional
        Cylinder pressure of the cycle [bar], for a guide that learns from it (`mgdd.guide.GuidedEngine`).

    Examples
    --------
    >>> from mgdd.loop import Measurement
    >>> Measurement(components=(56.0, -6.0)).performance
    50.0
    """

    components: tuple[float, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    misfire: bool = False
    values: Mapping[str, float] = field(default_factory=dict)
    noise_free_limits: Mapping[str, float] = field(default_factory=dict)
    applied: Mapping[str, float] = field(default_factory=dict)
    pressure_bar: NDArray[np.float64] | None = field(default=None, compare=False)

    @property
    def performance(self) -> float:
        """Sum of the components, J."""
        total = 0.0
        for component in self.components:  # plain order: the built-in sum rounds otherwise from Python 3.12 on
            total += component
        return total


@runtime_checkable
class Plant(Protocol):
    """Takes inputs by name, gives back what was measured.

    `VirtualEngine`, `VirtualThrottle` and every rig of `mgdd.rig` are plants; so is a class of yours
    with these members. One that also has `objective`, weights of quantities by name, names J in figures and texts.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine, Plant
    >>> bench = VirtualEngine(seed=1)
    >>> isinstance(bench, Plant), bench.input_names
    (True, ('soc_cad',))
    >>> bench.apply({"soc_cad": -6.0})
    >>> round(bench.measure().values["imep_gross_bar"], 1)
    9.6
    """

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in the order that a seeker or controller uses; each ends in its unit."""
        ...

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities that `measure` reports."""
        ...

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next cycle or sample.

        Parameters
        ----------
        inputs : mapping of str to float
            One finite number for every name of `input_names`.
        """
        ...

    def measure(self) -> Measurement:
        """Wait for the next cycle or sample and measure it.

        Returns
        -------
        Measurement
            At the inputs applied last.

        Raises
        ------
        mgdd.errors.RigError
            Nothing was applied yet, or the plant is closed.
        """
        ...


@runtime_checkable
class AnnouncingPlant(Plant, Protocol):
    """A plant that knows of a new operating point before the cycle, as one that sets speed and fuel itself does.

    Other plants may say it afterwards, in ``values["operating_point_changed"]``; that costs one cycle.
    """

    @property
    def operating_point_changes(self) -> bool:
        """Whether the next cycle runs at another operating point than the last one."""
        ...


def checked_inputs(inputs: Mapping[str, float], names: tuple[str, ...]) -> tuple[float, ...]:
    """Give the inputs in the order of `names`; ParameterError for a missing, unknown or non-finite one."""
    if not isinstance(inputs, Mapping):
        raise ParameterError(f"inputs = {inputs!r}: must map names to numbers, for example {{{names[0]!r}: 0.0}}")
    if set(inputs) != set(names):
        raise ParameterError(f"inputs = {', '.join(map(str, inputs)) or 'none'}: must be {', '.join(names)}")
    for name in names:
        require_plain(name, inputs[name])
        if not math.isfinite(inputs[name]):
            raise ParameterError.of(name, inputs[name], "finite")
    return tuple(float(inputs[name]) for name in names)
