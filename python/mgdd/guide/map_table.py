"""A timing map as a plain CSV table: a row per cell, units in the names, and where the numbers come from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, ShapeError, did_you_mean
from mgdd.io.plain_csv import write_columns
from mgdd.io.table import TextTable, read_table
from mgdd.results.labels import labelled_dataset
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

SETTINGS = {"prior_sd_cad": 3.0, "forgetting": 0.95}  # of a map that gives none
_CELLS = {"timing_cad": (-180.0, 180.0), "sd_cad": (0.0, math.inf), "support": (0.0, math.inf)}
_KNOWN = (*_CELLS, *SETTINGS, "source")


def write_map_table(dataset: xr.Dataset, path: str | os.PathLike[str], source: ArrayLike) -> None:
    """Write the Dataset of a map, a row per cell, the last axis fastest; see `TimingMap.write_csv`."""
    dims = [str(name) for name in dataset["timing_cad"].dims]
    grid = np.meshgrid(*(dataset[name].to_numpy() for name in dims), indexing="ij")
    texts = np.asarray(source, dtype=np.str_)
    if texts.ndim and texts.shape != grid[0].shape:
        raise ShapeError(f"source has shape {texts.shape}: one text, or one per cell of the map, {grid[0].shape}")
    for text in texts.ravel().tolist():
        if any(mark in text for mark in ',"\r\n'):
            raise ParameterError.of("source", text, "text without comma, quote and line break: it stands in a cell")
    columns: dict[str, Any] = {name: entries.ravel() for name, entries in zip(dims, grid, strict=True)}
    columns |= {name: dataset[name].to_numpy().ravel() for name in _CELLS}
    columns |= {name: np.full(grid[0].size, float(dataset.attrs[name])) for name in SETTINGS}
    if (texts != "").any():
        columns["source"] = np.broadcast_to(texts, grid[0].shape).ravel()
    write_columns(columns, path)


def read_map_table(path: str | os.PathLike[str], decimal: str) -> tuple[xr.Dataset, NDArray[np.str_]]:
    """Read a table into the Dataset of a map, and where each cell comes from; see `TimingMap.read_csv`."""
    table = read_table(path, decimal=decimal)
    names = _names(table)
    axes = [name for name in names if name not in _KNOWN]
    if not 1 <= len(axes) <= 2:
        axes_text = f"{len(axes)} axes, {', '.join(map(repr, axes))}" if axes else "no axis"
        raise DataError(f"{table.source}: {axes_text}: a map has one or two, for example speed_rpm and fuel_mg")
    columns = {name: _numbers(table, name) for name in names if name != "source"}
    settings = SETTINGS | {name: _one(table, name, columns[name]) for name in SETTINGS if name in columns}
    entries = {name: _entries(table, name, columns[name]) for name in axes}
    places = _places(table, {name: columns[name] for name in axes}, entries)
    shape = tuple(own.size for own in entries.values())
    if not settings["prior_sd_cad"] > 0.0 or not 0.0 < settings["forgetting"] <= 1.0:
        bad, bound = ("prior_sd_cad", "> 0") if not settings["prior_sd_cad"] > 0.0 else ("forgetting", "in (0, 1]")
        raise DataError(f"{table.source}: {bad} = {settings[bad]:g}: must be {bound}")
    cells = {"sd_cad": np.full(shape, settings["prior_sd_cad"]), "support": np.zeros(shape)}
    for name in set(_CELLS) & set(columns):
        cells[name] = np.empty(shape)
        cells[name].ravel()[places] = columns[name]
    sources = np.full(math.prod(shape), "", dtype=object)
    if "source" in names:
        sources[places] = [row[table.index("source")] for row in table.cells]
    dataset = labelled_dataset(
        {
            **{name: (name, own, unit_of(name), name) for name, own in entries.items()},
            "timing_cad": (tuple(axes), cells["timing_cad"], "°CA aTDC", "best timing"),
            "sd_cad": (tuple(axes), cells["sd_cad"], "°CA", "standard deviation of the best timing"),
            "support": (tuple(axes), cells["support"], "-", "confirmed optima"),
        },
        attrs=settings,
    )
    return dataset, sources.astype(np.str_).reshape(shape)


def _names(table: TextTable) -> tuple[str, ...]:
    """Give the names of the columns once they are plausible, and their units where the table has a row of them."""
    if table.header is None:
        raise DataError(f"{table.source}: no header: name the columns, for example speed_rpm,fuel_mg,timing_cad")
    for name in table.header:
        if table.header.count(name) > 1:
            raise DataError(f"{table.source}: column {name!r} occurs twice: keep one")
    if "timing_cad" not in table.header:
        near = did_you_mean("timing_cad", table.header)
        had = ", ".join(map(repr, table.header))
        raise DataError(f"{table.source}: no column 'timing_cad': the header has {had}; {near or 'add the timings'}")
    table.require_units_of_names("source")
    return table.header


def _numbers(table: TextTable, name: str) -> NDArray[np.float64]:
    """Give a column; the first value out of its domain is named."""
    values = table.numbers(table.index(name))
    low, high = _CELLS.get(name, (-math.inf, math.inf))
    bad = (values < low) | (values > high) | ((values == 0.0) if name == "sd_cad" else False)
    if bad.any():
        at = int(np.argmax(bad))
        bound = f"in [{low:g}, {high:g}]" if math.isfinite(high) else "> 0" if name == "sd_cad" else f">= {low:g}"
        hint = "; angles are °CA aTDC, negative before firing TDC" if name == "timing_cad" else "; correct it"
        raise DataError(
            f"{table.source}, line {table.lines[at]}, column {name!r}: {values[at]:g}: must be {bound}{hint}"
        )
    return values


def _one(table: TextTable, name: str, values: NDArray[np.float64]) -> float:
    odd = np.flatnonzero(values != values[0])
    if odd.size:
        line, first = table.lines[int(odd[0])], table.lines[0]
        raise DataError(
            f"{table.source}, line {line}, column {name!r}: {values[odd[0]]:g} where line {first} has {values[0]:g}: "
            "it is one value for the whole map"
        )
    return float(values[0])


def _entries(table: TextTable, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    own = np.unique(values)
    if own.size < 2:
        raise DataError(
            f"{table.source}, column {name!r}: one value, {own[0]:g}: an axis needs two at least; leave the column "
            "out, or add the other rows"
        )
    return np.asarray(own, np.float64)


def _places(
    table: TextTable, found: Mapping[str, NDArray[np.float64]], entries: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.intp]:
    """Give the cell of every row; each cell needs one row."""
    shape = tuple(own.size for own in entries.values())
    index = tuple(np.searchsorted(own, found[name]) for name, own in entries.items())
    places = np.ravel_multi_index(index, shape)
    first: dict[int, int] = {}
    for line, place in zip(table.lines.tolist(), places.tolist(), strict=True):
        if place in first:
            where = _cell(entries, place)
            raise DataError(f"{table.source}, line {line}: {where} stands in line {first[place]} already: remove one")
        first[place] = line
    absent = [place for place in range(math.prod(shape)) if place not in first]
    if absent:
        where, more = _cell(entries, absent[0]), f", and {len(absent) - 1} more" if len(absent) > 1 else ""
        raise DataError(f"{table.source}: no row with {where}{more}: a map has a row per cell of its grid; add it")
    return np.asarray(places, np.intp)


def _cell(entries: Mapping[str, NDArray[np.float64]], place: int) -> str:
    at = np.unravel_index(place, tuple(own.size for own in entries.values()))
    return ", ".join(f"{name} = {own[k]:g}" for (name, own), k in zip(entries.items(), at, strict=True))
