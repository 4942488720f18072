"""What others would take as a seeker, for the benchmarks of seekers and `loop_speed.py`.

Each contender is `contender(plant, start, seed)`: it sets `plant.estimate`, then calls `plant(x)` for one noisy J that
is to be maximised, again and again until the plant raises `FinishedError`. Peers minimise -J. A peer that is not
installed is left out and named.

Settings called tuned were found by trying on this very problem, and the trying is not counted.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

Point = float | np.ndarray  # a number for one input, one entry per input for several
PACKAGES = {"noisyopt": "noisyopt", "nevergrad": "nevergrad", "cernml": "cernml-extremum-seeking"}


class Plant(Protocol):
    """What a contender is run on."""

    estimate: Point

    def __call__(self, x: Point) -> float:
        """Return J at x, or raise FinishedError."""


class FinishedError(Exception):
    """The plant has seen enough."""


Contender = Callable[[Plant, Point, int], None]


def like(start: Point, x: np.ndarray) -> Point:
    """Return x as the plant takes it: a number where the start is one."""
    return float(x[0]) if np.ndim(start) == 0 else np.array(x, float)


def stay(plant: Plant) -> None:
    while True:
        plant(plant.estimate)


class ScaledPlant:
    """A plant whose inputs are z of x = middle + unit z."""

    def __init__(self, plant: Plant, middle: Point, unit: Point) -> None:
        self._plant, self._middle, self._unit = plant, middle, unit

    @property
    def estimate(self) -> Point:
        """Best input so far, scaled."""
        return (self._plant.estimate - self._middle) / self._unit

    @estimate.setter
    def estimate(self, z: Point) -> None:
        self._plant.estimate = self._middle + self._unit * z

    def __call__(self, z: Point) -> float:
        """Return J at z, or raise FinishedError."""
        return self._plant(self._middle + self._unit * z)


def scaled(contender: Contender, lower: Point, upper: Point, width: float) -> Contender:
    """Let a contender seek between bounds that are `width` apart in every input, with zero in the middle."""
    middle, unit = (lower + upper) / 2, (upper - lower) / width

    def run(plant: Plant, start: Point, seed: int) -> None:
        contender(ScaledPlant(plant, middle, unit), (start - middle) / unit, seed)

    return run


class HeldPlant:
    """A plant at which every input is held for some cycles, and on until there is a reading, unless one is made up."""

    def __init__(self, plant: Plant, cycles: int, instead: float | None) -> None:
        self._plant, self._cycles, self._instead = plant, cycles, instead

    @property
    def estimate(self) -> Point:
        """Best input so far."""
        return self._plant.estimate

    @estimate.setter
    def estimate(self, x: Point) -> None:
        self._plant.estimate = x

    def __call__(self, x: Point) -> float:
        """Return the last reading at x, or raise FinishedError."""
        for _ in range(self._cycles):
            j = self._plant(x)
        while math.isnan(j):
            if self._instead is not None:
                return self._instead
            j = self._plant(x)
        return j


def held(contender: Contender, cycles: int = 1, instead: float | None = None) -> Contender:
    """Let a contender that knows neither delays nor missing readings wait, or read `instead` where there is none."""

    def run(plant: Plant, start: Point, seed: int) -> None:
        contender(HeldPlant(plant, cycles, instead), start, seed)

    return run


class NullPlant:
    """Returns zero until it has been asked often enough."""

    def __init__(self, evaluations: int) -> None:
        self.estimate, self._left = 0.0, evaluations

    def __call__(self, x: float) -> float:  # noqa: ARG002 - a plant takes an input
        """Return zero, or raise FinishedError."""
        if self._left == 0:
            raise FinishedError
        self._left -= 1
        return 0.0


def run_to_end(contender: Contender, plant: Plant, start: Point, seed: int) -> None:
    with contextlib.suppress(FinishedError):
        contender(plant, start, seed)


def null_time_us(contender: Contender, start: float, evaluations: int) -> float:
    """Processor time per evaluation of a `NullPlant`, in microseconds, that of the plant included."""
    plant = NullPlant(evaluations)
    begin = time.process_time()
    run_to_end(contender, plant, start, 1)
    return (time.process_time() - begin) / evaluations * 1e6


def installed(packages: Mapping[str, str] = PACKAGES) -> dict[str, str | None]:
    """Package to its version; None where it is missing."""
    found: dict[str, str | None] = {}
    for package in packages.values():
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = None
    return found


def noisyopt(
    a: float = 1.0, c: float = 1.0, iterations: int = 6000, bounds: tuple[Point, Point] | None = None
) -> Contender:
    """`minimizeSPSA`, unpaired: an engine does not repeat its noise. Its stability constant is 0.01 iterations."""
    from noisyopt import minimizeSPSA

    limits = None if bounds is None else np.column_stack(bounds)

    def run(plant: Plant, start: Point, seed: int) -> None:
        np.random.seed(seed)  # noqa: NPY002 - the generator that the package draws from
        plant.estimate = start

        def told(x: np.ndarray) -> None:
            plant.estimate = like(start, x)

        def lost(x: np.ndarray) -> float:
            return -plant(like(start, x))

        while True:
            at = np.array(plant.estimate, float, ndmin=1)
            minimizeSPSA(lost, at, bounds=limits, niter=iterations, paired=False, a=a, c=c, callback=told)

    return run


def cobyqa(lower: Point, upper: Point, *, goes_on: bool = False, **options: object) -> Contender:
    """`minimize(method="COBYQA")` of SciPy; it stays at its end, or goes on from there with another search."""
    from scipy.optimize import Bounds, minimize

    def run(plant: Plant, start: Point, seed: int) -> None:  # noqa: ARG001 - no chance in it
        plant.estimate = start

        def told(x: np.ndarray) -> None:
            plant.estimate = like(start, x)

        def lost(x: np.ndarray) -> float:
            return -plant(like(start, x))

        while True:
            at = np.array(plant.estimate, float, ndmin=1)
            found = minimize(
                lost, at, method="COBYQA", bounds=Bounds(lower, upper), callback=told, options=dict(options)
            )
            plant.estimate = like(start, found.x)
            if not goes_on:
                stay(plant)

    return run


def nevergrad(a: float | None = None, c: float | None = None) -> Contender:
    """`SPSA`; the estimate is its iterate, which arrives earlier than the average that it recommends."""
    import nevergrad as ng

    def run(plant: Plant, start: float, seed: int) -> None:
        parameter = ng.p.Scalar(init=start)
        parameter.random_state.seed(seed)
        optimizer = ng.optimizers.registry["SPSA"](parametrization=parameter)
        optimizer.a = optimizer.a if a is None else a
        optimizer.c = optimizer.c if c is None else c
        while True:
            candidate = optimizer.ask()
            plant.estimate = start + float(optimizer.t[0])
            optimizer.tell(candidate, -plant(candidate.value))

    return run


def cernml(oscillation_size: float = 0.1, gain: float = 0.2) -> Contender:
    """Bounded extremum seeking; the estimate is the mean of the last oscillation, 17.5 evaluations by default."""
    from cernml.extremum_seeking import ExtremumSeeker

    def run(plant: Plant, start: float, seed: int) -> None:  # noqa: ARG001 - no chance in it
        seeker = ExtremumSeeker(oscillation_size=oscillation_size, gain=gain)
        last: deque[float] = deque(maxlen=round(2 * math.pi / seeker.get_time_step()))
        total = 0.0
        generator = seeker.make_generator(np.array([start]))
        step = next(generator)
        while True:
            x = float(step.params[0])
            if len(last) == last.maxlen:
                total -= last[0]
            last.append(x)
            total += x
            plant.estimate = total / len(last)
            step = generator.send(-plant(x))

    return run


def plain_esc(amplitude: float = 1.0, period: int = 10, gain: float = 0.98) -> Contender:
    """Ten lines of Python: dither, mean of the last period off, demodulate, integrate."""
    sine = [math.sin(2 * math.pi * k / period) for k in range(period)]

    def run(plant: Plant, start: float, seed: int) -> None:  # noqa: ARG001 - no chance in it
        estimate, window, total, k = start, [0.0] * period, 0.0, 0
        while True:
            plant.estimate = estimate
            phase = k % period
            j = plant(estimate + amplitude * sine[phase])
            total += j - window[phase]
            window[phase] = j
            k += 1
            if k > period:
                estimate += gain * (j - total / period) * sine[phase]

    return run
