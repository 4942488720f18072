"""The one result of a search for a best point: where it is, what holds it, and how flat it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mgdd._core.optimize import Limit
from mgdd.errors import ParameterError, argument
from mgdd.results.finding import Finding
from mgdd.results.labels import labelled_dataset, named_label, to_jsonable
from mgdd.results.result import NumbersResult

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, repr=False)
class Optimum(NumbersResult):
    """A best point of a model, a surrogate or a bench.

    Every number is read by its name, inputs first: ``best["soc_cad"]``, ``best["ca50_cad"]``.

    Parameters
    ----------
    inputs : mapping of str to float
        The best point, in the units of the names.
    objective : str
        What was maximised.
    value : float
        The objective there.
    values : mapping of str to float
        Other quantities there, in the units of the names.
    limits : tuple of Limit
        Limits that were kept.
    active_limits : tuple of str
        Those that hold the optimum back.
    at_bound : bool
        Whether it lies on the edge of the searched range.
    bounds : mapping of str to (float, float)
        Searched range of each input.
    curvature : float
        Second difference of the objective around the optimum [per squared unit of the input]; NaN where a neighbour
        leaves the range.
    free_inputs : mapping of str to float
        The best point without limits, where it was sought.
    findings : tuple of Finding
        ``idle_limit``: a limit that nothing in the searched range reaches.
    scan : mapping of str to array
        The input, the objective and the limited quantities over the searched range, for `plot`; empty if not scanned.
    """

    inputs: Mapping[str, float]
    objective: str
    value: float
    values: Mapping[str, float] = field(default_factory=dict)
    limits: tuple[Limit, ...] = ()
    active_limits: tuple[str, ...] = ()
    at_bound: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    curvature: float = math.nan
    free_inputs: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    scan: Mapping[str, NDArray[np.float64]] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("inputs", "values", "bounds", "free_inputs", "scan"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __getitem__(self, name: str) -> float:
        for numbers in (self.inputs, self.values):
            if name in numbers:
                return numbers[name]
        raise KeyError(f"{name!r}: this optimum has {', '.join([*self.inputs, *self.values])}")

    def __reduce__(self) -> tuple[Any, ...]:
        own: dict[str, Any] = {name: getattr(self, name) for name in self.__dataclass_fields__}
        for name, value in own.items():
            own[name] = dict(value) if isinstance(value, Mapping) else value  # a read-only one cannot be pickled
        return partial(type(self), **own), ()

    def __repr__(self) -> str:
        at = ", ".join(f"{name} {value:.4g}" for name, value in self.inputs.items())
        held = f", held by {', '.join(self.active_limits)}" if self.active_limits else ""
        edge = ", at the edge of the range" if self.at_bound else ""
        return f"<Optimum {self.objective} {self.value:.4g} at {at}{held}{edge}>"

    def _draw(self, ax: Any) -> Any:
        if not self.scan:
            return super()._draw(ax)
        from mgdd.plot.timing import scanned

        over = next(iter(self.scan))
        data = labelled_dataset({name: (over, values, *named_label(name)) for name, values in self.scan.items()})
        caps = {limit.name: limit.upper for limit in self.limits}
        return scanned(data, self.objective, self.inputs[over], self.value, caps, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the scan as plain Python values."""
        out = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "scan"}
        out["limits"] = {limit.name: limit.upper for limit in self.limits}
        out["findings"] = [vars(finding) for finding in self.findings]
        plain: dict[str, Any] = to_jsonable({k: dict(v) if isinstance(v, Mapping) else v for k, v in out.items()})
        return plain


def idle_limits(caps: Mapping[str, float], highest: Mapping[str, float], where: str) -> tuple[Finding, ...]:
    """Find the limits that nothing reaches: they hold nothing back, perhaps because another quantity was meant."""
    return tuple(
        Finding(
            "idle_limit",
            (name,),
            f"the limit {name} <= {cap:g} is not reached {where}: at most {highest[name]:.4g}",
            "look whether this is the quantity, and its unit, that you mean",
        )
        for name, cap in caps.items()
        if highest[name] < cap
    )


def limits_of(limits: Mapping[str, float] | Sequence[Limit] | None) -> tuple[Limit, ...]:
    """Read limits in either form: `Limit` objects, or upper values by name."""
    if limits is None:
        return ()
    if isinstance(limits, Mapping):
        for name, value in limits.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ParameterError(f"{argument('limits')}: {name} = {value!r}: must be a finite number")
        return tuple(Limit(str(name), float(value)) for name, value in limits.items())
    if isinstance(limits, Sequence) and all(isinstance(limit, Limit) for limit in limits):
        names = [limit.name for limit in limits]
        if len(set(names)) < len(names):
            raise ParameterError(f"limits: {', '.join(names)}: each name once")
        return tuple(limits)
    raise ParameterError(
        f"limits = {limits!r}: must map names to numbers, for example {{'p_max_bar': 95.0}}, or be Limit objects"
    )


def limit_names_of(limits: Mapping[str, float] | Sequence[Limit | str]) -> list[str]:
    """Return the names of limited quantities, given as names or as limits in either form."""
    ParameterError.unless(not isinstance(limits, str), "limits", limits, "a sequence of names")
    return [limit.name if isinstance(limit, Limit) else limit for limit in limits]
