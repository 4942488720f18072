"""A map from a table with a row per point, or from arrays: axes as vectors and the values as a matrix over them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import DataError, argument, did_you_mean
from mgdd.io.array_table import ArrayTable
from mgdd.io.row_text import parse_number
from mgdd.io.table import Table, TextTable
from mgdd.maps.calibration_map import CalibrationMap
from mgdd.maps.cells import cell_at
from mgdd.maps.plain_grid import number_in, require_two, value_heading
from mgdd.maps.written import NOT_GIVEN, Heading, heading_of

Array = NDArray[np.float64]

_SHOWN = 3  # cells that a message names
_NUMBERED = re.compile(r"(.*?) ?(\d+)")


def map_of_points(
    table: Table, *, name: str | None, rows: str | None, columns: str | None, decimal: str = "."
) -> CalibrationMap:
    """Make a map of the points of a table, in any order; points that are repeated count with their mean.

    Columns that are not named are taken in their order, the axes first; there must be no more of them than a map needs.
    """
    labels = table.header
    if labels is None:
        raise DataError(
            f"{table.source}: the columns have no names: add a line of names, as speed_rpm,fuel_mg,soc_cad, or name "
            r"the axes of a grid in its corner, as rpm\Nm"
        )
    if isinstance(table, ArrayTable):
        made = _of_matrix(table, name, rows, columns)
        if made is not None:
            return made
    numeric = table.numeric(range(table.width))
    numbers = next((labels[k] for k in numeric if parse_number(labels[k], decimal) is not None), None)
    if numbers is not None:
        raise DataError(
            f"{table.source}: {numbers!r} stands where a column has its name: name the columns, or give a grid at "
            "least two breakpoints in each direction"
        )
    given = {what: _index(table, label, what) for what, label in (("rows", rows), ("columns", columns), ("name", name))}
    chosen = _chosen(table, numeric, given)
    axes = [_column(table, k, gap=False) for k in chosen[:-1]]
    values = _column(table, chosen[-1], gap=True)
    value = value_heading(None, labels[chosen[-1]], table.unit(chosen[-1]) or "")
    heads: list[Heading] = []
    for k, fallback in zip(chosen[:-1], ("y", "x"), strict=False):
        taken = (value.name, *(each.name for each in heads))
        heads.append(heading_of(labels[k], unit=table.unit(k) or "", fallback=fallback, taken=taken))
    return _of_columns(table.source, heads, axes, value, values)


def _of_columns(
    source: str, heads: Sequence[Heading], columns: Sequence[Array], value: Heading, values: Array
) -> CalibrationMap:
    """Sort points into the cells of their grid, every one of which needs a point."""
    axes = {head.name: np.unique(column + 0.0) for head, column in zip(heads, columns, strict=True)}
    require_two(source, axes)
    shape = tuple(entries.size for entries in axes.values())
    if math.prod(shape) > max(4 * values.size, 4096):
        sizes = " x ".join(f"{entries.size} values of {name}" for name, entries in axes.items())
        raise DataError(
            f"{source}: {values.size} points with {sizes} are no grid: fit them and predict one (mgdd map fit, mgdd "
            "map predict), or round the columns if they only scatter"
        )
    places = [np.searchsorted(entries, column) for entries, column in zip(axes.values(), columns, strict=True)]
    cell = np.ravel_multi_index(tuple(places), shape)
    there = np.bincount(cell, minlength=math.prod(shape)) > 0
    if not there.all():
        lacking = np.flatnonzero(~there)
        shown = "; ".join(cell_at(axes, int(k)) for k in lacking[:_SHOWN])
        more = f" and {lacking.size - _SHOWN} more" if lacking.size > _SHOWN else ""
        size = " x ".join(map(str, shape))
        raise DataError(
            f"{source}: no point at {shown}{more}: {lacking.size} of {there.size} cells of the grid {size}: add their "
            f"rows with an empty value, which smooth_map with {argument('fill', 'True')} fills, or fit the points and "
            "predict a grid (mgdd map fit, mgdd map predict)"
        )
    finite = np.isfinite(values)
    order = np.argsort(cell[finite], kind="stable")
    support = np.bincount(cell[finite], minlength=there.size)
    groups = np.split(values[finite][order], np.cumsum(support)[:-1])
    means = np.array([math.fsum(group) / len(group) if len(group) else np.nan for group in groups])
    several = support > 1
    notes = {}
    if several.any():
        apart = max(float(np.abs(groups[k] - means[k]).max()) for k in np.flatnonzero(several))
        unit = "" if value.unit.startswith(NOT_GIVEN) else f" {value.unit}"
        notes["repeated"] = (
            f"{several.sum()} of {there.size} cells have several points: their mean, from which they differ by at most "
            f"{apart:.4g}{unit}"
        )
    return CalibrationMap(
        axes,
        means.reshape(shape),
        name=value.name,
        labels={each.name: (each.unit, each.long_name) for each in (*heads, value)},
        cells={
            "source": np.where(np.isnan(means), "unattainable", "given").reshape(shape),
            "support": support.astype(np.float64).reshape(shape),
        },
        provenance=notes,
    )


def _index(table: Table, label: str | None, what: str) -> int | None:
    """Find a column by the label that it has in the file, or by the name that a map gives it."""
    if label is None:
        return None
    labels = table.header or ()
    names = [heading_of(each, unit=table.unit(k) or "", fallback="").name for k, each in enumerate(labels)]
    places = [k for k, (each, name) in enumerate(zip(labels, names, strict=True)) if label in (each, name)]
    if len(places) != 1:
        near = did_you_mean(label, (*labels, *names)) or f"the file has {', '.join(map(repr, labels))}"
        count = "no column" if not places else "more than one column"
        raise DataError(f"{table.source}: {count} {label!r} for {argument(what)}: {near}")
    return places[0]


def _chosen(table: Table, numeric: Sequence[int], given: dict[str, int | None]) -> list[int]:
    """Choose the columns of one or two axes and of the value, in this order."""
    labels, taken = table.header or (), [k for k in given.values() if k is not None]
    if len(set(taken)) < len(taken):
        raise DataError(f"{table.source}: one column cannot be two of axes and value: name others")
    free = [k for k in numeric if k not in taken]
    needed = [what for what in ("rows", "columns", "name") if given[what] is None]
    if len(free) == len(needed) - 1 and "columns" in needed:
        needed.remove("columns")  # a curve
    if needed and len(free) != len(needed):
        names = ", ".join(repr(labels[k]) for k in free) or "none"
        choices = ", ".join(argument(what, repr("…")) for what in needed) or "fewer names"
        raise DataError(
            f"{table.source}: {len(free)} columns with numbers ({names}) for {len(needed)} of the axes and value of "
            f"a map: choose one with {choices}, or remove the others"
        )
    columns = given | dict(zip(needed, free if needed else (), strict=True))
    return [k for what in ("rows", "columns", "name") if (k := columns[what]) is not None]


def _column(table: Table, index: int, *, gap: bool) -> Array:
    label = (table.header or ())[index]
    if isinstance(table, TextTable):
        return np.array(
            [
                number_in(row[index], table.decimal, f"{table.source}, line {line}", repr(label), gap=gap)
                for line, row in zip(table.lines.tolist(), table.cells, strict=True)
            ]
        )
    column = np.asarray(table.numbers(index), np.float64)
    bad = ~np.isfinite(column) if not gap else np.isinf(column)
    if bad.any():
        at = int(np.argmax(bad))
        raise DataError(
            f"{table.source}, column {label!r}, row {at}: {column[at]} is not a finite number: remove or repair it"
        )
    return column


def _of_matrix(table: ArrayTable, name: str | None, rows: str | None, columns: str | None) -> CalibrationMap | None:
    """Read vectors of breakpoints and a matrix over them; None where the file has no matrix."""
    labels = table.header or ()
    groups: dict[str, list[int]] = {}
    for k, label in enumerate(labels):
        numbered = _NUMBERED.fullmatch(label)
        if numbered and int(numbered[2]) == len(groups.get(numbered[1], ())) + 1:
            groups.setdefault(numbered[1], []).append(k)
    matrices = {label: of for label, of in groups.items() if len(of) > 1 and len({table.lengths[k] for k in of}) == 1}
    if not matrices:
        return None
    vectors = [k for k in range(table.width) if not any(k in of for of in matrices.values())]
    matrix = name or (next(iter(matrices)) if len(matrices) == 1 else "")
    if matrix not in matrices:
        raise DataError(
            f"{table.source}: the matrices are {', '.join(matrices)}: name one with {argument('name', repr('…'))}"
        )
    members = matrices[matrix]
    shape = (table.lengths[members[0]], len(members))
    chosen = []
    for side, size, named in (("rows", shape[0], rows), ("columns", shape[1], columns)):
        fit = [k for k in vectors if table.lengths[k] == size]
        index = _index(table, named, side) if named is not None else fit[0] if len(fit) == 1 else None
        if index is None or index not in fit:
            names = ", ".join(labels[k] for k in fit) or "none"
            raise DataError(
                f"{table.source}: {matrix} is {shape[0]} x {shape[1]}, and of length {size} are {names}: name the axis "
                f"with {argument(side, repr('…'))}"
            )
        chosen.append(index)
    if chosen[0] == chosen[1]:
        raise DataError(
            f"{table.source}: {matrix} is {shape[0]} x {shape[1]} and only {labels[chosen[0]]} has that length: add "
            "the other axis"
        )
    value = value_heading(None, matrix, table.unit(members[0]) or "")
    heads = [
        heading_of(labels[k], unit=table.unit(k) or "", fallback="yx"[k == chosen[1]], taken=(value.name,))
        for k in chosen
    ]
    grid = table.matrix(members).T
    return CalibrationMap(
        {head.name: _column(table, k, gap=False) for head, k in zip(heads, chosen, strict=True)},
        grid,
        name=value.name,
        labels={each.name: (each.unit, each.long_name) for each in (*heads, value)},
        cells={"source": np.where(np.isnan(grid), "unattainable", "given")},
    )
