"""A seeker that is not of this package, anything that is asked and told, as the loops take one."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ShapeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.optimize import Input, Limit
    from mgdd.results.finding import Finding


class OwnSeeker:
    """Hold the user's object as `own`, which maximises; it is told what its ``tell`` takes."""

    component_count = 1
    findings: tuple[Finding, ...] = ()

    def __init__(self, own: Any, inputs: Sequence[Input], limits: Sequence[Limit], *, maximize: bool) -> None:
        self.own, self.kind, self.cycle = own, type(own).__name__, 0
        self._inputs = list(inputs)
        self.settings = {"inputs": list(inputs), "limits": list(limits), "maximize": maximize}
        self.input_names, self.limit_names = [one.name for one in inputs], [one.name for one in limits]
        self._takes = set(inspect.signature(own.tell).parameters)
        if self.estimate.size != len(inputs):
            raise ShapeError(f"seeker: its estimate has {self.estimate.size} entries: must have {len(inputs)}, inputs")

    def __repr__(self) -> str:
        return f"<{self.kind} cycle {self.cycle}, estimate {self.estimate}>"

    @staticmethod
    def is_one(seeker: Any) -> bool:
        """Whether an object can be asked and told, and says where it believes the best."""
        return not isinstance(seeker, type) and all(hasattr(seeker, name) for name in ("ask", "tell", "estimate"))

    @property
    def estimate(self) -> NDArray[np.float64]:
        """Where it believes the best, in the order of the inputs."""
        return np.atleast_1d(np.array(self.own.estimate, np.float64))

    @property
    def settable(self) -> NDArray[np.float64]:
        """The same in the steps in which its inputs are set."""
        return self._on_steps(self.estimate)

    def _on_steps(self, values: Any) -> NDArray[np.float64]:
        numbers = np.atleast_1d(np.asarray(values, np.float64)).tolist()
        return np.array([one.nearest(value) for one, value in zip(self._inputs, numbers, strict=True)])

    def ask(self) -> dict[str, float]:
        """Give the inputs of the next cycle by name."""
        self._asked = self._on_steps(self.own.ask())
        return dict(zip(self.input_names, self._asked.tolist(), strict=True))

    def tell(
        self,
        J: float,  # noqa: N803
        limits: Sequence[float] | None = None,
        *,
        misfire: bool = False,
        applied: Mapping[str, float] | None = None,
    ) -> None:
        """Pass a reading on; a failed cycle is asked again where ``tell`` takes no ``misfire``."""
        self.cycle += 1
        told: dict[str, Any] = {"limits": limits, "misfire": misfire}
        if applied is not None:
            told["applied"] = np.array([applied[name] for name in self.input_names])
        elif any(one.step for one in self._inputs):
            told["applied"] = self._asked
        if not misfire or "misfire" in self._takes:
            j = float(J) if self.settings["maximize"] else -float(J)
            self.own.tell(j, **{name: value for name, value in told.items() if name in self._takes})

    def restart(self) -> None:
        """Begin anew at another operating point, where it can."""
        getattr(self.own, "restart", lambda: None)()
