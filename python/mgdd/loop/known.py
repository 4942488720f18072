"""Readings of before a search, told to its seeker."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mgdd.errors import ParameterError, argument, hinted
from mgdd.guide import CurveSeeking
from mgdd.loop.seek_choice import Choice, Question, chosen
from mgdd.optimize import GaussianProcessSeeking


def tell_known(asked: Question, seeker: Any, choice: Choice, known: Any) -> tuple[Question, Choice]:
    """Tell the readings, in their order, to a seeker that begins at the best of them where no start is given."""
    if not isinstance(choice.seeker, CurveSeeking | GaussianProcessSeeking):
        raise ParameterError(
            f"{argument('known')}: goes to curve_seeking or gaussian_process_seeking, not to "
            f"{type(choice.seeker).__name__}, which asks for the readings that it needs: leave it out"
        )
    names, held = [one.name for one in asked.inputs], [limit.name for limit in asked.limits]
    x = np.column_stack([_column(known, name, "applied", "input") for name in names])
    j = _column(known, "j", "objective", None)
    limits = np.column_stack([_column(known, name, "limits", "limit") for name in held] or [np.empty((j.size, 0))])
    for at, one in enumerate(asked.inputs):
        if outside := [value for value in x[:, at].tolist() if not one.lower <= value <= one.upper]:
            raise ParameterError(
                f"{argument('known')}: {one.name} = {outside[0]:g}: must be in [{one.lower:g}, {one.upper:g}]"
            )
    read = np.isfinite(j) & np.isfinite(limits).all(axis=1)
    if asked.start is None and asked.late_cycles == 0.0 and read.any():
        uppers = np.array([limit.upper for limit in asked.limits])
        kept = read & (limits <= uppers).all(axis=1)
        worth = np.where(kept if kept.any() else read, j if asked.maximize else -j, -math.inf)
        best = dict(zip(names, x[int(np.argmax(worth))].tolist(), strict=True))
        asked = replace(asked, start=best)
        choice = chosen(asked, seeker)
    for row, value, measured, fired in zip(x.tolist(), j.tolist(), limits.tolist(), read.tolist(), strict=True):
        choice.seeker.ask()
        applied = dict(zip(names, row, strict=True))
        if fired:
            choice.seeker.tell(value, measured or None, applied=applied)
        else:
            choice.seeker.tell(math.nan, misfire=True, applied=applied)
    return asked, choice._replace(reason=f"{choice.reason}, after {j.size} readings of before", first_cycles=1)


def _column(known: Any, name: str, table: str, over: str | None) -> Any:
    """Take a column by its name, or from the table that results of ours have."""
    there = known if isinstance(known, Mapping) else getattr(known, "variables", getattr(known, "columns", None))
    if there is None:
        raise ParameterError(f"{argument('known')} = {type(known).__name__}: must be a table with columns by name")
    if over is not None and table in there and name in known.coords[over].to_numpy():
        values = known[table].sel({over: name})
    elif f"{table}_{name}" in there:  # of a table that the command wrote
        values = known[f"{table}_{name}"]
    elif name in there:
        values = known[name]
    elif over is None and table in there:
        values = known[table]
    else:
        raise ParameterError(
            hinted(
                f"{argument('known')}: has no column {name!r}, but {', '.join(map(str, there))}",
                name,
                [str(each) for each in there],
            )
        )
    column = np.asarray(values, np.float64)
    if column.ndim != 1:
        raise ParameterError(f"{argument('known')}: {name} has shape {column.shape}: must be a column")
    if table == "applied" and not np.isfinite(column).all():
        raise ParameterError(f"{argument('known')}: {name} must be finite in every row")
    return column
