"""Two objectives at once: seekers of weighted sums of them, all of which receive every reading."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mgdd.errors import DataError, Interrupted, ParameterError, hinted
from mgdd.loop.front_result import FrontResult, front_of
from mgdd.loop.lower_limits import middle_of
from mgdd.loop.plant import Measurement, Plant
from mgdd.loop.seek import plant_of, seek_inputs, started
from mgdd.optimize import GaussianProcessSeeking, Input, Limit
from mgdd.optimize.optimum import limits_of

_ENDS = 0.3  # share of the cycles that looks for the best of each objective alone
_NEAREST = 6


class _Row(NamedTuple):
    weight: float
    applied: list[float]
    objectives: list[float]
    limits: list[float]
    void: bool


def seek_front(
    plant: Plant | Callable[[dict[str, float]], Any],
    inputs: Mapping[str, tuple[float, float]] | Sequence[Input],
    objectives: Mapping[str, str],
    *,
    start: Mapping[str, float] | float | None = None,
    cycles: int = 200,
    limits: Mapping[str, float] | Sequence[Limit] = (),
    delay_cycles: int = 0,
    n_weights: int = 5,
    n_points: int = 21,
    seed: int = 0,
) -> FrontResult:
    """Seek the front of two objectives, as efficiency and NOx over timing and EGR.

    Several `GaussianProcessSeeking` take turns, each on a weighted sum of both objectives, and every one receives every
    reading. The first three tenths of the cycles look for the best of each objective alone; the ranges between these
    two make the scales of the sums. At last each objective is fitted once to all readings, by a polynomial, and the
    front is what no other input beats in both fits, within what was tried.

    Parameters
    ----------
    plant : Plant or callable
        It advances by `cycles`. A function takes the inputs by name and gives objectives and limits by name, or None
        for a failed cycle.
    inputs : mapping of str to (float, float), or sequence of Input
        Bounds of every input, finite, in its unit; one to eight.
    objectives : mapping of str to {"max", "min"}
        The two, by their names in ``values`` of the plant's measurement, or in what the function gives.
    start : mapping of str to float, or float for one input, optional
        First inputs; limits should hold there. The middle of the bounds if left out.
    cycles : int
        How many.
    limits : mapping of str to float, or sequence of Limit
        Upper values of measured quantities.
    delay_cycles : int
        Transport delay between the plant and both objectives [cycles].
    n_weights : int
        Sums that are sought, the two objectives alone included, 3 to 20.
    n_points : int
        Of the front, at even distances along it, >= 2.
    seed : int
        Of the seekers; the same seed gives the same run.

    Returns
    -------
    FrontResult
        Points of the front with inputs, predictions and their uncertainty; models; every cycle; reasons to doubt it.

    Raises
    ------
    mgdd.errors.ParameterError
        As `seek`, and objectives that are not two, or fewer cycles than the fits need. The plant has not moved.
    mgdd.errors.DataError
        A reading that is missing or not a finite number. ``partial`` is the FrontResult of the cycles so far, as that
        of any error of the plant, where they are enough for one.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` as above, or None.

    References
    ----------
    Miettinen (1998), Nonlinear Multiobjective Optimization.

    Examples
    --------
    >>> from mgdd.loop import VirtualEngine, seek_front
    >>> bench = VirtualEngine(seed=1)
    >>> wanted = {"efficiency_gross": "max", "nox_soft_ppm": "min"}
    >>> front = seek_front(bench, {"soc_cad": (-15.0, 5.0)}, wanted, cycles=80)
    >>> ends = front.dataset["inputs"].sel(input="soc_cad")[[0, -1]]
    >>> bool(-6.5 < ends[0] < -4.5), round(float(ends[1]))
    (True, 5)
    """
    given, wanted = seek_inputs(inputs), limits_of(limits)
    names, held = [one.name for one in given], [limit.name for limit in wanted]
    form = "must name two, for example {'efficiency': 'max', 'nox_ppm': 'min'}"
    if not isinstance(objectives, Mapping) or len(objectives) != 2:
        raise ParameterError(f"objectives = {objectives!r}: {form}")
    for name, way in objectives.items():
        if way not in ("max", "min"):
            raise ParameterError(f"objectives: {name} = {way!r}: must be 'max' or 'min'")
    signs = {str(name): 1.0 if way == "max" else -1.0 for name, way in objectives.items()}
    terms = math.comb(len(given) + 2, 2)
    least = delay_cycles + max(4 * (len(given) + 1), terms + 3)
    for name, value, low, high in (
        ("delay_cycles", delay_cycles, 0, math.inf),
        ("n_weights", n_weights, 3, 20),
        ("n_points", n_points, 2, math.inf),
        ("cycles", cycles, least, math.inf),
    ):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
            upper = f" and <= {high}" if math.isfinite(high) else ""
            raise ParameterError.of(name, value, f"a whole number >= {low}{upper}")
    plant = plant_of(plant, given, wanted, list(signs))
    begin = started(start, given) or middle_of(given)

    def seeker() -> GaussianProcessSeeking:
        return GaussianProcessSeeking(
            inputs=list(given), start=begin, limits=list(wanted), delay_cycles=delay_cycles, seed=seed
        )

    search, log = _Search(seeker, list(signs.values()), n_weights), list[_Row]()

    def result(*, interrupted: bool = False) -> FrontResult:
        return front_of(
            given, signs, wanted, late=delay_cycles, points=n_points, seed=seed, interrupted=interrupted,
            applied=np.array([row.applied for row in log]), measured=np.array([row.objectives for row in log]),
            measured_limits=np.array([row.limits for row in log]), weight=np.array([row.weight for row in log]),
            void=np.array([row.void for row in log], np.bool_),
        )  # fmt: skip

    try:
        for cycle in range(cycles):
            if cycle == max(round(_ENDS * cycles), 2 * (len(given) + 1) + delay_cycles):
                search.between_the_ends(log, names, delay_cycles)
            weight, asked = search.ask(cycle)
            plant.apply(asked)
            row = _row(plant.measure(), weight, asked, list(signs), held)
            search.tell(row, names)
            log.append(row)
    except KeyboardInterrupt:
        part = None
        with contextlib.suppress(Exception):  # too few readings for a fit
            part = result(interrupted=True)
        raise Interrupted(f"interrupted after {len(log)} of {cycles} cycles", part) from None
    except Exception as error:
        with contextlib.suppress(Exception):
            error.partial = result()  # type: ignore[attr-defined]
        raise
    return result()


class _Search:
    """Seekers by the weight of the first objective, and the scales of their sums."""

    def __init__(self, make: Callable[[], GaussianProcessSeeking], signs: Sequence[float], weights: int) -> None:
        self._make, self._signs, self._weights = make, signs, weights
        self._seekers = {1.0: make(), 0.0: make()}
        self._turn = [1.0, 0.0]
        self._scales = (1.0, 1.0)
        self._asked = dict[float, dict[str, float]]()

    def ask(self, cycle: int) -> tuple[float, dict[str, float]]:
        """Let all ask, and take the input of the one whose turn it is."""
        self._asked = {weight: seeker.ask() for weight, seeker in self._seekers.items()}
        weight = self._turn[cycle % len(self._turn)]
        return weight, self._asked[weight]

    def tell(self, row: _Row, names: Sequence[str]) -> None:
        """Give all of them what was measured at the input that was applied."""
        for weight, seeker in self._seekers.items():
            self._tell(seeker, weight, row, names)

    def between_the_ends(self, log: Sequence[_Row], names: Sequence[str], late: int) -> None:
        """Scale by the range of each objective between the two ends, and begin the sums with all readings so far."""
        used = [(before.applied, row.objectives) for before, row in zip(log, log[late:], strict=False) if not row.void]
        if used:
            at, read = (np.array(each) for each in zip(*used, strict=True))
            bounds = np.array([(one.lower, one.upper) for one in self._seekers[1.0].settings["inputs"]])
            away = [np.linalg.norm((at - own.estimate) / np.ptp(bounds, axis=1), axis=1) for own in self._ends()]
            one, other = (read[np.argsort(each, kind="stable")[:_NEAREST]].mean(axis=0) for each in away)
            floor = 1e-9 * np.maximum(np.abs(read).max(axis=0), 1e-300)
            self._scales = tuple(np.maximum(np.abs(one - other), floor).tolist())
        for k in range(1, self._weights - 1):
            weight = k / (self._weights - 1)
            self._seekers[weight] = self._make()
            for row in log:
                self._seekers[weight].ask()
                self._tell(self._seekers[weight], weight, row, names)
        self._turn = sorted(self._seekers)

    def _ends(self) -> tuple[GaussianProcessSeeking, GaussianProcessSeeking]:
        return self._seekers[1.0], self._seekers[0.0]

    def _tell(self, seeker: GaussianProcessSeeking, weight: float, row: _Row, names: Sequence[str]) -> None:
        applied = dict(zip(names, row.applied, strict=True))
        if row.void:
            seeker.tell(math.nan, misfire=True, applied=applied)
            return
        shares = (weight, 1.0 - weight)
        scales = self._scales if 0.0 < weight < 1.0 else (1.0, 1.0)  # one objective alone needs none
        parts = zip(shares, self._signs, row.objectives, scales, strict=True)
        j = sum(share * sign * value / scale for share, sign, value, scale in parts)
        seeker.tell(j, row.limits or None, applied=applied)


def _row(
    measured: Measurement, weight: float, asked: Mapping[str, float], wanted: Sequence[str], held: Sequence[str]
) -> _Row:
    applied = [float(measured.applied.get(name, value)) for name, value in asked.items()]
    void = measured.misfire or bool(measured.values.get("unphysical", 0.0))
    where = ", ".join(f"{name} = {value:.6g}" for name, value in asked.items())
    for kind, names, values in (("objectives", wanted, measured.values), ("limits", held, measured.limits)):
        for name in names:
            if not void and name not in values:
                refused = f"{kind}: {name!r} is not measured by the plant at {where}: it measures {', '.join(values)}"
                raise DataError(hinted(refused, name, values))
            if not void and not math.isfinite(values[name]):
                raise DataError(f"{name} = {values[name]} at {where}: must be a finite number")
    objectives = [float(measured.values.get(name, math.nan)) for name in wanted]
    return _Row(weight, applied, objectives, [float(measured.limits.get(name, math.nan)) for name in held], void)
