"""Visits of a search for a map: how long they take, what is read there, and the file of them."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.loop.map_result import Visit
from mgdd.loop.plant import Plant
from mgdd.optimize.map_seeking import MapSeeking
from mgdd.optimize.seeker import encoded

_SETTLING, _AVERAGED = 20, 50  # cycles of a visit on an engine
_FEWEST = 10  # cycles that tell what a mean is worth
_KNOWN = 0.5  # of what is not known at a visit: a mean that is surer teaches little more
_FAILED = 0.5  # share of the cycles of a visit
# Of an axis, and of the bounds of an input: a cycle that ran farther from its operating point, or from the inputs of
# the cycle before, as where a guard steps back and tries again, is none of the visit.
_ELSEWHERE, _MOVED = 0.01, 0.05


class Dwell(NamedTuple):
    """Cycles of a visit: those before the others, and how many are averaged at least and at most."""

    settling: int
    least: int
    most: int


def dwell_of(averaged: Any, settling: int | None, *, on_plant: bool) -> Dwell:
    """Read how long a visit takes; ParameterError for no cycles."""
    given = (_AVERAGED if on_plant else 1) if averaged is None else averaged
    least, most = given if isinstance(given, tuple) else (given, given)
    before = (_SETTLING if on_plant else 0) if settling is None else settling
    for name, value, low in (("averaged", least, 1), ("averaged", most, least), ("settling", before, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < low:
            raise ParameterError.of(name, given if name == "averaged" else value, f"a whole number of cycles >= {low}")
    return Dwell(int(before), int(least), int(most))


def visited(
    plant: Plant, seeker: MapSeeking, dwell: Dwell, at: dict[str, float], inputs: dict[str, float], sd: float
) -> Visit:
    """Drive to a point, wait, and average; a visit at which half of the cycles fail has failed."""
    names = seeker.limit_names
    near = {name: _ELSEWHERE * float(np.ptp(entries)) for name, entries in seeker.axes.items()}
    near |= {one.name: _MOVED * (one.upper - one.lower) for one in seeker.settings["inputs"]}
    ran = dict(inputs)
    rows, failed = list[list[float]](), 0
    applied = {name: list[float]() for name in inputs}
    for cycle in range(dwell.settling + dwell.most):
        plant.apply({**at, **inputs})  # in every cycle: a guard moves by steps, a bus waits for the next command
        measured = plant.measure()
        before, ran = {**ran, **at}, {**at, **inputs, **measured.applied}
        if cycle < dwell.settling:
            continue
        if measured.misfire or any(abs(ran[name] - before[name]) > width for name, width in near.items()):
            failed += 1
        else:
            row = [measured.performance, *(float(measured.limits[name]) for name in names)]
            if not np.isfinite(row).all():
                where = ", ".join(f"{name} = {value:g}" for name, value in {**at, **inputs}.items())
                listed = dict(zip(("J", *names), row, strict=True))
                raise DataError(f"the plant read {listed} at {where}: must be finite, or a misfire")
            rows.append(row)
            for name in inputs:
                applied[name].append(float(ran[name]))
        counted = len(rows) + failed
        if len(rows) >= _FEWEST and dwell.least <= counted < dwell.most:
            mean_sd = float(np.std([row[0] for row in rows], ddof=1)) / math.sqrt(len(rows))
            if 0.0 < mean_sd < _KNOWN * sd:
                break
    if failed >= _FAILED * (len(rows) + failed):
        unread = dict.fromkeys(names, math.nan)
        none = dict.fromkeys(("j", *names), 0.0)
        return Visit(at, inputs, math.nan, unread, float(len(rows) + failed), failed=True, sd=none)
    means = np.mean(rows, axis=0).tolist()
    sds = np.std(rows, axis=0, ddof=1).tolist() if len(rows) > 1 else [0.0] * len(means)
    really = {name: float(np.mean(column)) for name, column in applied.items()}
    held = dict(zip(names, means[1:], strict=True))
    scatter = dict(zip(("j", *names), sds, strict=True))
    return Visit(at, really, means[0], held, float(len(rows)), failed=False, sd=scatter)


def tell(seeker: MapSeeking, visit: Visit) -> None:
    """Pass what a visit read on to the seeker."""
    if visit.failed:
        seeker.tell(visit.at, visit.inputs, misfire=True)
    else:
        seeker.tell(visit.at, visit.inputs, visit.j, visit.limits, readings=visit.readings, sd=visit.sd)


class VisitFile:
    """Rows of visits as they are made; numbers are written in full, so that a search goes on bit for bit.

    The first line names the search by its settings, seed and guide included, the second one the columns.
    """

    def __init__(self, path: Path, seeker: MapSeeking) -> None:
        self._path = path
        read = ["j", *seeker.limit_names]
        scatter = [f"{name}_sd" for name in read]
        names = [*seeker.axes, *seeker.input_names, *read, "readings", "failed", *scatter]
        own = hashlib.sha256(json.dumps(encoded(seeker.settings), sort_keys=True).encode())
        self._head = [f"# search {own.hexdigest()[:16]}", ",".join(names)]
        self._count = len(names)

    def replayed(self, seeker: MapSeeking) -> Iterator[Visit]:
        """Tell a seeker what the file holds; DataError where it is of another search."""
        text = self._path.read_text(encoding="utf-8") if self._path.exists() else ""
        if not text.strip():
            self._path.write_text("\n".join(self._head) + "\n", encoding="utf-8")
            return
        lines = text.splitlines()
        if lines[: len(self._head)] != self._head:
            raise DataError(
                f"{self._path}: is of another search: inputs, axes, limits, guide, settings or seed differ, or it is "
                "not a record; give another file"
            )
        if not text.endswith("\n"):  # the last row was cut off as it was written
            lines = lines[:-1]
            self._path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        read = ["j", *seeker.limit_names]
        for number, line in enumerate(lines[len(self._head) :], 1):
            try:
                row = [float(entry) for entry in line.split(",")]
                if len(row) != self._count:
                    raise ValueError
            except ValueError:
                raise DataError(f"{self._path}: row {number} is {line!r}: must be {self._count} numbers") from None
            entries = iter(row)
            place, inputs, means = ({name: next(entries) for name in names}
                                    for names in (seeker.axes, seeker.input_names, read))  # fmt: skip
            visit = Visit(place, inputs, means.pop("j"), means, readings=next(entries), failed=next(entries) == 1.0,
                          sd=dict(zip(read, entries, strict=True)))  # fmt: skip
            asked = seeker.suggest()
            if asked.at != visit.at:
                at = ", ".join(f"{name} = {value:g}" for name, value in asked.at.items())
                raise DataError(
                    f"{self._path}: row {number} is at another point than this search would go to, {at}: it was "
                    "edited, or written by another version; give another file"
                )
            try:
                tell(seeker, visit)
            except DataError as error:
                raise DataError(
                    f"{self._path}: row {number}: {error}; mend or delete it, or give another file"
                ) from error
            yield visit

    def write(self, visit: Visit) -> None:
        """Add a row."""
        row = [*visit.at.values(), *visit.inputs.values(), visit.j, *visit.limits.values(), visit.readings,
               float(visit.failed), *visit.sd.values()]  # fmt: skip
        with self._path.open("a", encoding="utf-8") as out:
            out.write(",".join(map(repr, row)) + "\n")
