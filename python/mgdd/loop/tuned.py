"""Controllers with the numbers that `tune_controller` has found."""

from __future__ import annotations

import math
import tomllib
import warnings
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from mgdd.errors import ParameterError
from mgdd.loop.controller_families import FAMILIES, Family, Groups, Setup, groups_of

if TYPE_CHECKING:
    from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode

    Controller = GuidedPredictive | Mgdd1 | Pid | SlidingMode


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
        What the controller knows: a `Throttle`, PW-R, fitted first-principle groups, or a fit of either; the preset
        ``P1`` if left out.
    numbers : mapping of str to float, optional
        Of `tune_controller`; those of the preset whose groups are nearest to the model's if left out. These were found
        at samples of 1 ms with a delay of one: a `UserWarning` says where they are not known to serve.
    sample_s, noise_deg : float
        Time between samples [s], and standard deviation of the measured angle [deg].
    delay_samples : int, optional
        Samples of `sample_s` from a duty to its effect. Left out: the delay of the model in seconds, to the nearest
        sample, or 1 where the model has none. ``pid`` and ``sliding_mode`` predict nothing: a longer delay, as a longer
        sample, makes them slower by as much as keeps the phase.

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
    controller, doubts = tuned_with_doubts(
        kind, model, numbers=numbers, sample_s=sample_s, delay_samples=delay_samples, noise_deg=noise_deg
    )
    for doubt in doubts:
        warnings.warn(doubt, UserWarning, stacklevel=3)
    return controller


def tuned_with_doubts(
    kind: str,
    model: Any = None,
    *,
    numbers: Mapping[str, float] | None = None,
    sample_s: float = 1e-3,
    delay_samples: int | None = None,
    noise_deg: float = 0.03,
) -> tuple[Controller, tuple[str, ...]]:
    """Give what `tuned_controller` gives, and its doubts as texts rather than as warnings."""
    family = family_of(kind)
    if model is None:
        from mgdd.throttle import Throttle

        model = Throttle()
    groups = groups_of(model)
    chosen = shipped_numbers(kind, groups) if numbers is None else dict(numbers)
    if set(chosen) != set(family.space):
        raise ParameterError.of("numbers", sorted(chosen), f"exactly {', '.join(family.space)}")
    if delay_samples is None:
        delay_samples = 1 if groups.delay_s is None else math.floor(groups.delay_s / sample_s + 0.5)
    controller = family.build(groups, chosen, Setup(sample_s, delay_samples, noise_deg))
    if numbers is not None:
        return controller, ()
    return controller, _doubts(kind, family, sample_s, delay_samples)


_SAME = 1.0 + 1e-9  # of two times


def _dead_s(sample_s: float, delay_samples: int) -> float:
    """Give the mean time from a measurement to the effect of its duty, less rounding."""
    return (delay_samples + 0.5) * sample_s / _SAME


def _doubts(kind: str, family: Family, sample_s: float, delay_samples: int) -> tuple[str, ...]:
    """Say where shipped numbers are used beyond what they were tested for."""
    remedy = "look at a run of mgdd.loop.track with both, take a shorter sample time, or give own numbers"
    doubts = []
    if sample_s > family.longest_sample_s * _SAME:
        doubts.append(
            f"sample_s = {sample_s:g}: the numbers of {kind!r} were tuned at 0.001 s and have been tested up to "
            f"{family.longest_sample_s:g} s; {remedy}"
        )
    elif _dead_s(sample_s, delay_samples) > family.longest_dead_s:
        most = family.longest_dead_s / sample_s - 0.5
        doubts.append(
            f"delay_samples = {delay_samples} at sample_s = {sample_s:g}: the numbers of {kind!r} were tuned at "
            f"0.001 s and have been tested up to {most:.3g} samples here; {remedy}"
        )
    return tuple(doubts)


def family_of(kind: str) -> Family:
    """Look up a kind of controller."""
    ParameterError.unless(kind in FAMILIES, "kind", kind, f"one of {', '.join(FAMILIES)}")
    return FAMILIES[kind]


def _distance(a: Groups, b: Groups) -> float:
    names = ("gain_deg_per_s2", "time_constant_s", "friction", "preload_above", "spring_above_per_deg")
    pairs = [(getattr(a.plate, name), getattr(b.plate, name)) for name in names]
    return sum(math.log(max(x, 1e-9) / max(y, 1e-9)) ** 2 for x, y in pairs)


@cache
def tuned_sets() -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Read the numbers of each kind of controller and each preset, as ``tools/tune_controllers.py`` found them."""
    return tomllib.loads((resources.files("mgdd") / "data" / "tuned_controllers.toml").read_text(encoding="utf-8"))


def shipped_numbers(kind: str, groups: Groups) -> dict[str, float]:
    """Give the tuned numbers of the preset whose groups are nearest, at the gain of these."""
    from mgdd import presets

    sets = tuned_sets()[kind]
    known = {name: groups_of(presets.load(name, kind="throttle").throttle) for name in sets}
    near = min(sets, key=lambda name: _distance(groups, known[name]))
    more = groups.plate.gain_deg_per_s2 / known[near].plate.gain_deg_per_s2
    gains = FAMILIES[kind].loop_gains
    return {name: value / more if name in gains else value for name, value in sets[near].items()}
