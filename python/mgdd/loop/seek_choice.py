"""Which seeker one call of `seek` takes, and why; the figures are those of the page of the benchmarks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.errors import ParameterError
from mgdd.guide import Curve, CurveSeeking
from mgdd.optimize import GaussianProcessSeeking, Input, Limit

if TYPE_CHECKING:
    from mgdd.optimize import Seeker

__all__ = ["Choice", "chosen"]

_BEND, _REACH = -80.0, 1.5  # of the parabola; -0.05 over bounds that are 40 wide, as in the benchmark


class Choice(NamedTuple):
    """A seeker, why it was taken, and the cycles without which it has not looked to every side."""

    seeker: Seeker
    reason: str
    first_cycles: int


def chosen(
    inputs: Sequence[Input],
    start: Mapping[str, float] | None,
    *,
    limits: Sequence[Limit],
    noise_sd: float | None,
    delay_cycles: float,
    lag_cycles: float,
    guide: Any,
    maximize: bool,
    seed: int,
) -> Choice:
    """Choose: a curve for one input, a Gaussian process for several."""
    if isinstance(guide, Curve) and len(inputs) > 1:
        names = ", ".join(one.name for one in inputs)
        raise ParameterError(f"guide = {guide!r}: a Curve has one input, not {names}; give a function of them")
    space: dict[str, Any] = {"inputs": list(inputs), "maximize": maximize, "limits": list(limits)}
    late: dict[str, Any] = {"delay_cycles": delay_cycles, "lag_cycles": lag_cycles}
    first = math.ceil(delay_cycles) + (len(inputs) + 1) * max(1, math.ceil(2.0 * lag_cycles))
    if isinstance(guide, Curve) or (guide is None and len(inputs) == 1):
        (one,) = inputs
        curve = guide or _parabola(one)
        best = {one.name: min(max(curve.best, one.lower), one.upper)}
        seeker: Seeker = CurveSeeking(start=start or best, curve=curve, noise_sd=noise_sd, **space, **late)
        told = "one input and the curve of a guide" if guide else "one input: a parabola serves as the guide"
        return Choice(seeker, f"{told}, placed by the readings", first)
    middle = {one.name: 0.5 * (one.lower + one.upper) for one in inputs}
    space["start"] = start or (middle if guide is None or limits else _best_of(guide, inputs, middle, maximize))
    guided: dict[str, Any] = {} if guide is None else {"guide": guide}
    seeker = GaussianProcessSeeking(**space, **late, **guided, noise_sd=noise_sd, seed=seed)
    count = "one input" if len(inputs) == 1 else f"{len(inputs)} inputs"
    kept = f", {', '.join(limit.name for limit in limits)} to keep" if limits else ""
    by = " and a guide" if guided else ""
    return Choice(seeker, f"{count}{by}{kept}: it loses least on the way, whatever their units", first)


def _best_of(guide: Any, inputs: Sequence[Input], middle: Mapping[str, float], maximize: bool) -> dict[str, float]:
    """Return where a guide of several inputs is best: without limits a search begins there."""
    (surface,) = GaussianProcessSeeking(start=middle, inputs=list(inputs), guide=guide).settings["guide"]
    values = surface.values if maximize else -surface.values
    at = np.unravel_index(int(np.argmax(values)), values.shape)
    return {one.name: axis[k] for one, axis, k in zip(inputs, surface.axes, at, strict=True)}


def _parabola(one: Input) -> Curve:
    width = one.upper - one.lower
    return Curve.parabola(curvature=_BEND / width**2, best=0.5 * (one.lower + one.upper), reach=_REACH * width)
