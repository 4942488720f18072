"""Multiple shooting: a start for the search of the free run, from stretches whose gaps close step by step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mgdd.errors import ParameterError
from mgdd.identify.grey_box.models import SimulatorModel, first_states
from mgdd.identify.grey_box.search import Search, Ties, Vector
from mgdd.optimize import least_squares

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
        x = _search(search, x, Ties(length, price * spread * np.sqrt(length) / scale))
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


def _search(search: Search, x: Vector, ties: Ties) -> Vector:
    unknowns, n = search.unknowns, len(search.unknowns.names)
    more = x.size - n
    report = least_squares(
        lambda at: search.residual(at, ties),
        x,
        names=[*unknowns.names, *(f"stretch_{i}" for i in range(more))],
        bounds=(np.r_[unknowns.lower, np.full(more, -np.inf)], np.r_[unknowns.upper, np.full(more, np.inf)]),
        log_scaled=np.r_[np.array(unknowns.logs, dtype=bool), np.zeros(more, dtype=bool)],
        max_iterations=_TRIALS,
        cost_tolerance=1e-4,
    )
    return report.values
