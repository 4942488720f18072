"""Maps of J over several inputs of unlike units that seekers are judged on, and the guides that they are given."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mgdd.guide import Curve
from mgdd.optimize import Seeker, tune

__all__ = [
    "AWAY", "CURVATURE", "CYCLES", "EARLY", "LOWER", "NEAR", "NOISE", "UPPER", "WIDTH", "Guide", "Point",
    "SeekingMap", "Setting", "bent_by_half", "coupled", "of_no_use", "off_by_a_fifth", "several_maps", "tuned_seeker",
]  # fmt: skip

CYCLES, EARLY = 300, 40
WIDTH, AWAY = 40.0, 12.0
NOISE, CURVATURE = 0.3, -0.06
LOWER = np.array([-20.0, 0.0, 100.0])  # injection timing [°CA aTDC], EGR rate, intake pressure [kPa]
UPPER = np.array([20.0, 0.4, 250.0])
NEAR = 0.03  # J lost per input
_TURN = math.radians(35.0)
_THREE = np.array([[1.0, 0.5, -0.25], [0.5, 1.0, 0.35], [-0.25, 0.35, 1.0]])  # condition 6

Point = float | NDArray[np.float64]  # a number for one input, one entry per input for several
Readings = Callable[[Any], float]  # of a Point
Drop = Callable[[NDArray[np.float64]], float]  # of the distances from the best input, each in a fortieth of its bounds
Guide = Callable[[NDArray[np.float64]], float]


@dataclass(frozen=True)
class Setting:
    """One run: where it starts, which inputs are near the best one, what is read at an input."""

    start: Any  # a Point
    near: Callable[[Any], bool]
    read: Readings  # NaN where there is no reading
    lost: Readings  # J below that of the best input, without noise
    top: Callable[[], float] = lambda: 0.0  # J of the best input
    moved: Any = None  # callable of two Points: J at the first, of the map moved by the second


@dataclass(frozen=True)
class SeekingMap:
    """A map and what a seeker may be given of it."""

    name: str
    lower: Any  # a Point, as is upper
    upper: Any
    noise_sd: float
    curvature: float
    setting: Callable[[int, bool], Setting]  # of this seed, with or without noise
    guides: dict[str, Curve] = field(default_factory=dict)
    prior_sd: float | None = None


def coupled(d: NDArray[np.float64]) -> float:
    """Return J of the coupled quadratic of two inputs."""
    return -0.03 * float(d[0] ** 2 + d[1] ** 2 + 1.2 * d[0] * d[1])


def _turned(drop: Callable[[float, float], float]) -> Drop:
    """Let a formula be one of axes that no input is along."""
    cos, sin = math.cos(_TURN), math.sin(_TURN)
    return lambda d: drop(cos * d[0] + sin * d[1], cos * d[1] - sin * d[0])


def _several(name: str, inputs: int, drop: Drop) -> SeekingMap:
    """Make a map of its formula; the optimum is drawn 4 to 5 off the middle of each input, the start 12 from it."""
    lower, upper = LOWER[:inputs], UPPER[:inputs]
    unit = (upper - lower) / WIDTH

    def setting(seed: int, noisy: bool) -> Setting:
        rng = np.random.default_rng(seed)
        sides = np.array([1 if seed >> k & 1 else -1 for k in range(inputs)])
        best = (lower + upper) / 2 + sides * rng.uniform(4.0, 5.0, inputs) * unit
        way = rng.standard_normal(inputs)
        noise = ((NOISE if noisy else 0.0) * rng.standard_normal(CYCLES)).tolist()

        def level(x: NDArray[np.float64]) -> float:
            if np.any(x < lower - 1e-9 * unit) or np.any(x > upper + 1e-9 * unit):
                raise ValueError(f"{x} is outside {lower} to {upper}")
            return drop((x - best) / unit)

        return Setting(
            best + AWAY * way / np.linalg.norm(way) * unit,
            lambda x: -level(x) <= NEAR * inputs,
            lambda x: level(x) + noise.pop(),
            lambda x: -level(x),
            moved=lambda x, by: drop((x - best - by) / unit),
        )

    return SeekingMap(name, lower, upper, NOISE, CURVATURE, setting)


def several_maps() -> list[SeekingMap]:
    """Make the four maps: three of two inputs, one of three."""
    return [
        _several("coupled", 2, coupled),
        _several("skewed", 2, _turned(lambda u, v: -6.0 * (math.exp(0.1 * u) - 1.0 - 0.1 * u) - 0.03 * v * v)),
        _several("ridge", 2, _turned(lambda u, v: -0.03 * u * u - 0.002 * v * v)),
        _several("three", 3, lambda d: -0.03 * float(d @ _THREE @ d)),
    ]


def bent_by_half(field: SeekingMap, seed: int) -> Guide:
    """Let the map itself be the guide, with 1.5 times its bend and another level: right place, wrong height."""
    moved = field.setting(seed, False).moved
    return lambda x: 50.0 + 1.5 * moved(x, 0.0)


def off_by_a_fifth(field: SeekingMap, seed: int) -> Guide:
    """Let the map itself be the guide, moved by a fifth of the bounds in every input, to a drawn side."""
    moved = field.setting(seed, False).moved
    sides = np.random.default_rng(seed + 1000).choice([-1.0, 1.0], np.size(field.lower))
    by = 0.2 * sides * (field.upper - field.lower)
    return lambda x: 50.0 + moved(x, by)


def of_no_use(field: SeekingMap, seed: int) -> Guide:  # noqa: ARG001 - there is nothing of the map in it
    """Let waves of half the bounds be the guide."""
    period = (field.upper - field.lower) / 2.2
    return lambda x: float(np.sum(2.0 * np.sin(2.0 * np.pi * x / period + np.arange(np.size(x)))))


def tuned_seeker(field: SeekingMap, start: Point, seed: int, method: str, curvature: Any) -> Seeker:
    """Tune a seeker to the noise of a map and this curvature; its perturbation is kept inside the bounds at the start.

    One number is the curvature of every input, else it is one per input.
    """
    room = 0.99 * np.minimum(start - field.lower, field.upper - start)
    room = room if np.ndim(curvature) else np.min(room)
    found = tune(field.noise_sd, curvature, method=method)
    if np.any(found.amplitude > room):
        found = tune(field.noise_sd, curvature, method=method, amplitude_max=np.minimum(found.amplitude, room))
    return found.seeker(start=start, bounds=(field.lower, field.upper), seed=seed)
