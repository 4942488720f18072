"""Maps of J over several inputs of unlike units that seekers are judged on."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from support.seeking_maps import AWAY, CURVATURE, CYCLES, NOISE, WIDTH, SeekingMap, Setting

LOWER = np.array([-20.0, 0.0, 100.0])  # injection timing [CAD], EGR rate, intake pressure [kPa]
UPPER = np.array([20.0, 0.4, 250.0])
NEAR = 0.03  # J lost per input
TURN = math.radians(35.0)
THREE = np.array([[1.0, 0.5, -0.25], [0.5, 1.0, 0.35], [-0.25, 0.35, 1.0]])  # condition 6

Drop = Callable[[np.ndarray], float]  # of the distances from the best input, each in a fortieth of its bounds


def coupled(d: np.ndarray) -> float:
    return -0.03 * float(d[0] ** 2 + d[1] ** 2 + 1.2 * d[0] * d[1])


def turned(drop: Callable[[float, float], float]) -> Drop:
    """Let a formula be one of axes that no input is along."""
    cos, sin = math.cos(TURN), math.sin(TURN)
    return lambda d: drop(cos * d[0] + sin * d[1], cos * d[1] - sin * d[0])


def several(name: str, inputs: int, drop: Drop) -> SeekingMap:
    """Make a map of its formula; the optimum is drawn 4 to 5 off the middle of each input, the start 12 from it."""
    lower, upper = LOWER[:inputs], UPPER[:inputs]
    unit = (upper - lower) / WIDTH

    def setting(seed: int, noisy: bool) -> Setting:
        rng = np.random.default_rng(seed)
        sides = np.array([1 if seed >> k & 1 else -1 for k in range(inputs)])
        best = (lower + upper) / 2 + sides * rng.uniform(4.0, 5.0, inputs) * unit
        way = rng.standard_normal(inputs)
        noise = ((NOISE if noisy else 0.0) * rng.standard_normal(CYCLES)).tolist()

        def level(x: np.ndarray) -> float:
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
    return [
        several("coupled", 2, coupled),
        several("skewed", 2, turned(lambda u, v: -6.0 * (math.exp(0.1 * u) - 1.0 - 0.1 * u) - 0.03 * v * v)),
        several("ridge", 2, turned(lambda u, v: -0.03 * u * u - 0.002 * v * v)),
        several("three", 3, lambda d: -0.03 * float(d @ THREE @ d)),
    ]
