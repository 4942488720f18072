"""Controllers with the numbers that `tune_controller` has found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mgdd.errors import ParameterError
from mgdd.loop.controller_families import FAMILIES, Family, Groups, Setup, groups_of
from mgdd.loop.tuned_sets import TUNED_SETS

if TYPE_CHECKING:
    from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode

    Controller = GuidedPredictive | Mgdd1 | Pid | SlidingMode

__all__ = ["family_of", "shipped_numbers", "tuned_controller"]


def tuned_controller(
    kind: str,
    model: Any = None,
    *,
    numbers: Mapping[str, float] | None = None,
    sample_s: float = 1e-3,
    delay_samples: int | None = None,
    noise_deg: float = 0.03,
) -> Controller:
    """Give a controller for a throttle, with the numbers that one tuner found for every kind.

    Parameters
    ----------
    kind : str
        ``guided`` (model-guided predictive), ``mgdd1``, ``pid``, ``sliding_mode``, ``linear_mpc`` or ``nmpc``.
    model : optional
        What the controller knows: a `Throttle`, PW-R, or fitted first-principle groups; the preset ``P1`` if left out.
    numbers : mapping of str to float, optional
        Of `tune_controller`; those of the preset whose groups are nearest to the model's if left out.
    sample_s, noise_deg : float
        Time between samples [s], and standard deviation of the measured angle [deg].
    delay_samples : int, optional
        From a duty to its effect; that of the model, or 1, if left out.

    Returns
    -------
    GuidedPredictive, Mgdd1, Pid or SlidingMode
        Ready to run.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown kind, a model without groups, unknown numbers.

    Examples
    --------
    >>> from mgdd.loop import track, tuned_controller
    >>> {kind: type(tuned_controller(kind)).__name__ for kind in ("guided", "pid", "nmpc")}
    {'guided': 'GuidedPredictive', 'pid': 'Pid', 'nmpc': 'GuidedPredictive'}
    """
    family = family_of(kind)
    if model is None:
        from mgdd.throttle import Throttle

        model = Throttle()
    groups = groups_of(model)
    chosen = shipped_numbers(kind, groups) if numbers is None else dict(numbers)
    if set(chosen) != set(family.space):
        raise ParameterError.of("numbers", sorted(chosen), f"exactly {', '.join(family.space)}")
    if delay_samples is None:
        delay_samples = 1 if groups.delay_samples is None else round(groups.delay_samples)
    return family.build(groups, chosen, Setup(sample_s, delay_samples, noise_deg))


def family_of(kind: str) -> Family:
    """Look up a kind of controller."""
    if kind not in FAMILIES:
        raise ParameterError.of("kind", kind, f"one of {', '.join(FAMILIES)}")
    return FAMILIES[kind]


def _distance(a: Groups, b: Groups) -> float:
    names = ("gain_deg_per_s2", "time_constant_s", "friction", "preload_above", "spring_above_per_deg")
    pairs = [(getattr(a, name), getattr(b, name)) for name in names]
    return sum(math.log(max(x, 1e-9) / max(y, 1e-9)) ** 2 for x, y in pairs)


def shipped_numbers(kind: str, groups: Groups) -> dict[str, float]:
    """Give the tuned numbers of the preset whose groups are nearest."""
    from mgdd import presets

    sets = TUNED_SETS[kind]
    near = min(sets, key=lambda name: _distance(groups, groups_of(presets.load(name, kind="throttle").throttle)))
    return dict(sets[near])
