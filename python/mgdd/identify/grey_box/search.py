"""The residual of a grey-box model and its slopes, of whole records or of stretches tied by continuity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError
from mgdd.identify.grey_box.model import GreyBoxModel
from mgdd.identify.grey_box.models import SimulatorModel, first_states
from mgdd.identify.grey_box.records import Record
from mgdd.optimize import least_squares
from mgdd.optimize.least_squares import Resolved
from mgdd.results.fit_report import FitReport

# Central differences: the truncation h^2 and the rounding eps/h meet near eps^(1/3).
_STEP = 6e-6

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Ties:
    """Cuts of the records into stretches of `length` samples, whose later starts are free, and the price of a gap.

    `weight` has one value per state, in the unit of the residual over that of the state.
    """

    length: int
    weight: Vector


@dataclass(frozen=True, kw_only=True)
class Unknowns:
    """What is estimated: parameters, the delay where it is, and states at the begin of every record, in this order."""

    names: tuple[str, ...]
    lower: Vector
    upper: Vector
    logs: tuple[bool, ...]
    where: tuple[int, ...]
    delay_free: bool
    free_state: tuple[int, ...]

    @property
    def shared(self) -> int:
        """How many belong to all records."""
        return len(self.where) + self.delay_free


@dataclass(frozen=True, kw_only=True)
class Search:
    """All that a search needs beside its start."""

    model: GreyBoxModel
    records: Sequence[Record]
    states: Vector
    unknowns: Unknowns
    options: Resolved

    def solve(
        self,
        start: Sequence[float] | Vector,
        *,
        ties: Ties | None = None,
        held: int | None = None,
        iterations: int | None = None,
        tolerance: float | None = None,
    ) -> FitReport:
        """Search from a start: on whole records, or on tied stretches whose later starts follow; one may be held."""
        unknowns, x = self.unknowns, np.array(start, dtype=np.float64)
        outputs = [output for record in self.records for output in record.outputs]
        free, more = [j for j in range(x.size) if j != held], x.size - len(unknowns.names)
        data = [output.of(output.values) for output in outputs]
        if len(self.model.output_names) > 1:
            data = [each - each.mean() for each in data]

        def residual(part: Vector) -> tuple[Vector, Vector] | None:
            at = x.copy()
            at[free] = part
            evaluated = self.residual(at, ties)
            return None if evaluated is None else (evaluated[0], evaluated[1][:, free])

        names = (*unknowns.names, *(f"stretch_{i}" for i in range(more)))
        lower, upper = np.r_[unknowns.lower, [-np.inf] * more], np.r_[unknowns.upper, [np.inf] * more]
        return least_squares(
            residual,
            x[free],
            names=[names[j] for j in free],
            bounds=(lower[free], upper[free]),
            log_scaled=np.array([*unknowns.logs, *[False] * more], dtype=bool)[free],
            data=None if ties else np.concatenate(data),
            records=None if ties else [output.kept.size for output in outputs],
            max_iterations=iterations or self.options.max_iterations,
            cost_tolerance=tolerance or self.options.tolerance,
        )

    def check(self, x: Vector) -> None:
        """Refuse functions that cannot be run, by the start of the first record."""
        p, delay = self.shared_columns(x[: self.unknowns.shared, None])
        with np.errstate(all="ignore"):
            self.model.check(self.records[0].drive.acting(float(delay[0])), self.start_of(x, 0)[:, None], p)

    def explain(self, x: Vector) -> None:
        """Say why a point cannot be evaluated: which sample is not finite, or beside which parameter."""
        lost = self._lost(x)
        if lost is not None:
            raise ParameterError(
                f"the model gives no finite simulation at the start values: {lost}: change them, raise substeps of an "
                "OdeModel, or give shooting_samples"
            )
        ends = self._beside(x[None], np.arange(x.size)[None])
        for i, name in enumerate(self.unknowns.names):
            for end in ends:
                beside = x.copy()
                beside[i] = end[0, i]
                lost = self._lost(beside)
                if lost is not None:
                    raise ParameterError(
                        f"{name} = {x[i]:g}: the model has no slope there, since it is not finite beside it ({lost} at "
                        f"{beside[i]:g}): give bounds={{{name!r}: ...}} that leave this out, or another start value"
                    )
        raise ParameterError("the square of the residual is not finite at the start values: change them")

    def _lost(self, x: Vector) -> str | None:
        """Say which sample of a simulation is the first that is not finite."""
        p, delay = self.shared_columns(x[: self.unknowns.shared, None])
        for k, record in enumerate(self.records):
            acting = record.drive.acting(float(delay[0]))
            with np.errstate(all="ignore"):
                y = self.model.run_columns(acting, self.start_of(x, k)[:, None], p)[0][:, :, 0]
            if not np.isfinite(y).all():
                at, output = np.argwhere(~np.isfinite(y))[0]
                return f"{self.model.output_names[output]} of record {k} is {y[at, output]} from sample {at} on"
        return None

    def residual(self, x: Vector, ties: Ties | None = None) -> tuple[Vector, Vector] | None:
        """Return residual and Jacobian; None where the simulation is not finite.

        With `ties`, `x` goes on with the states at the begin of every later stretch, and the residual with the gaps.
        """
        parts, at = [], len(self.unknowns.names)
        for k in range(len(self.records)):
            stretches = self.stretches(k, ties)
            part = self._of_record(np.asarray(x), k, at, stretches, ties)
            if not all(np.isfinite(each).all() for each in part):
                return None
            parts.append(part)
            at += (stretches - 1) * self.states.shape[1]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def stretches(self, k: int, ties: Ties | None) -> int:
        """Count the stretches of a record."""
        return 1 if ties is None else -(-self.records[k].drive.time_s.size // ties.length)

    def _of_record(self, x: Vector, k: int, later: int, m: int, ties: Ties | None) -> tuple[Vector, Vector]:
        """Differentiate one record by central differences: their columns run side by side, for each of m stretches."""
        record, shared, n_states = self.records[k], self.unknowns.shared, self.states.shape[1]
        moved = list(range(n_states)) if m > 1 else list(self.unknowns.free_state)
        starts = np.vstack([self.start_of(x, k), x[later : later + (m - 1) * n_states].reshape(m - 1, n_states)])
        own = self._places(k, later, m, moved)  # in x, a row per stretch; -1 for what is fixed
        up, down = self._beside(np.hstack([np.tile(x[:shared], (m, 1)), starts[:, moved]]), own)
        q = own.shape[1]
        columns = np.repeat(x[:shared, None], 2 * q + 1, axis=1)
        states = np.repeat(starts[:, :, None], 2 * q + 1, axis=2)
        for j in range(q):
            at = columns[j] if j < shared else states[:, moved[j - shared]]
            at[..., 1 + j], at[..., 1 + q + j] = (up[0, j], down[0, j]) if j < shared else (up[:, j], down[:, j])
        p, delay = self.shared_columns(columns)
        acting, length = record.drive.acting(delay), record.drive.time_s.size
        if ties is not None:
            acting, length = acting.stretches(ties.length, 2 * q + 1), ties.length
        stacked = np.moveaxis(states, 0, 1).reshape(n_states, m * (2 * q + 1))
        with np.errstate(all="ignore"):
            y, ends = self.model.run_columns(acting, stacked, np.tile(p, (1, m)))
            y, ends = (each.reshape(*each.shape[:-1], m, 2 * q + 1) for each in (y[:length], ends))
            y_slope, end_slope = ((e[..., 1 : 1 + q] - e[..., 1 + q :]) / (up - down) for e in (y, ends))
        run, slope = np.empty((y.shape[1], m * length)), np.zeros((y.shape[1], m * length, x.size))
        gaps, along = ends[:, :-1, 0] - starts[1:].T, np.zeros((n_states, m - 1, x.size))
        for j in range(m):
            rows, to = slice(j * length, (j + 1) * length), own[j] >= 0
            run[:, rows] = y[:, :, j, 0].T
            slope[:, rows, own[j][to]] = y_slope[:, :, j][..., to].swapaxes(0, 1)
            if j < m - 1:
                along[:, j, own[j][to]] = end_slope[:, j][:, to]
                along[np.arange(n_states), j, own[j + 1][shared:]] -= 1.0
        values = [output.of(run[i, : output.values.size] - output.values) for i, output in enumerate(record.outputs)]
        slopes = [output.of(slope[i]) for i, output in enumerate(record.outputs)]
        if ties is not None:
            values.append((ties.weight[:, None] * gaps).ravel())
            slopes.append((ties.weight[:, None, None] * along).reshape(-1, x.size))
        return np.concatenate(values), np.concatenate(slopes)

    def _places(self, k: int, later: int, m: int, moved: Sequence[int]) -> NDArray[np.int_]:
        """Tell for each stretch where in the unknowns stands what its columns move: parameters, delay, its start."""
        shared, free = self.unknowns.shared, self.unknowns.free_state
        own = np.full((m, shared + len(moved)), -1)
        own[:, :shared] = np.arange(shared)
        for j, state in enumerate(moved):
            if state in free:
                own[0, shared + j] = shared + k * len(free) + free.index(state)
            own[1:, shared + j] = later + len(moved) * np.arange(m - 1) + j
        return own

    def _beside(self, at: Vector, own: NDArray[np.int_]) -> tuple[Vector, Vector]:
        """Return the upper and lower ends of the differences, inside the bounds."""
        n = len(self.unknowns.names)
        count = max(n, own.max(initial=0) + 1) + 1
        lower, upper, least = np.full(count, -np.inf), np.full(count, np.inf), np.full(count, 1e-3)
        lower[:n], upper[:n] = self.unknowns.lower, self.unknowns.upper
        least[:n] = np.where(self.unknowns.logs, 0.0, 1e-3)
        lower[-1], upper[-1] = -np.inf, np.inf
        step = _STEP * np.maximum(np.abs(at), least[own])
        return np.minimum(at + step, upper[own]), np.maximum(at - step, lower[own])

    def shared_columns(self, x: Vector) -> tuple[Vector, Vector]:
        """Return the parameters, (n_parameters, m), and the delay, (m,), of columns of what belongs to all records."""
        p = np.repeat(np.array(list(self.model.parameters.values()))[:, None], x.shape[1], axis=1)
        p[list(self.unknowns.where)] = x[: len(self.unknowns.where)]
        delay = x[self.unknowns.shared - 1] if self.unknowns.delay_free else None
        return p, np.full(x.shape[1], self.model.input_delay_s) if delay is None else delay

    def start_of(self, x: Vector, k: int) -> Vector:
        """Return the state at the begin of a record."""
        free, state = self.unknowns.free_state, np.array(self.states[k])
        at = self.unknowns.shared + k * len(free)
        state[list(free)] = x[at : at + len(free)]
        return state


# Price of a gap of one standard deviation of a state, over that of a stretch that misses the output by one.
_PRICES = (0.03, 0.3, 3.0)
_TRIALS = 30  # steps of a search at one price


def check_shooting(search: Search, length: int) -> None:
    """Refuse stretches that a model or its records cannot have."""
    shortest = min(record.drive.time_s.size for record in search.records)
    bound = f"more samples than the {search.states.shape[1]} states, and fewer than the {shortest} of a record"
    if isinstance(search.model, SimulatorModel):
        raise ParameterError("shooting_samples: a SimulatorModel runs whole records and has no state to cut them at")
    ParameterError.unless(search.states.shape[1] < length < shortest, "shooting_samples", length, bound)


def shoot(search: Search, start: Mapping[str, float], length: int) -> dict[str, float]:
    """Return a start that the stretches of all records lead to.

    The state at the begin of every stretch is free; a gap to the end of the one before costs more from stage to stage
    (Bock 1983, with penalties in place of constraints). Measured states start at the measurement.
    """
    n, n_states = len(start), search.states.shape[1]
    x = np.array(list(start.values()))
    later = [_later_starts(search, k, length) for k in range(len(search.records))]
    x = np.concatenate([x, *(each.ravel() for each in later)])
    whole = [output.of(output.values) for record in search.records for output in record.outputs]
    spread = float(np.sqrt(np.mean(np.concatenate([each - each.mean() for each in whole]) ** 2)))
    for price in _PRICES:
        states = x[n:].reshape(-1, n_states)
        scale = states.std(axis=0)
        scale = np.where(scale > 0.0, scale, np.maximum(np.abs(states).max(axis=0), 1.0))
        ties = Ties(length, price * spread * np.sqrt(length) / scale)
        x = search.solve(x, ties=ties, iterations=_TRIALS, tolerance=1e-4).values
    found = np.clip(x[:n], search.unknowns.lower, search.unknowns.upper)
    return dict(zip(start, found.tolist(), strict=True))


def _later_starts(search: Search, k: int, length: int) -> Vector:
    """Guess the states at the begin of the later stretches of a record: measured where the outputs are states."""
    record = search.records[k]
    n = record.drive.time_s.size
    at = np.arange(length, n, length)
    states = np.repeat(search.states[k][None], at.size, axis=0)
    if getattr(search.model, "output", None) is first_states:
        for i, output in enumerate(record.outputs):
            seen = np.flatnonzero(np.isfinite(output.values))
            states[:, i] = np.interp(at, seen, output.values[seen])
    return states
