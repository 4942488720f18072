"""The standard sections of a study's page, made of its summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mgdd.report import Section, Table
from mgdd.report.report import as_number
from mgdd.results.labels import VARIABLES, label_of
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["cells", "column_names", "standard_sections"]

_ENDS = ("_low", "_high")
_INTERVAL = "Brackets: 95 % interval over seeds, of the mean or, for cycles, of the median."
_SAID = ("study", "seeds", "rows", "interrupted", "mgdd", "verdict")


def cells(row: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    """Print a flat row; the ends of an interval stand in brackets behind their mean."""
    out = []
    for name in names:
        ends = [row.get(name + end) for end in _ENDS]
        own = _cell(row.get(name))
        out.append(own if None in ends else f"{own} [{as_number(ends[0])}, {as_number(ends[1])}]")
    return out


def column_names(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Name the columns of flat rows, without the ends of intervals."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [name for name in names if not (name.endswith(_ENDS) and name.rpartition("_")[0] in names)]


def table_of(rows: Sequence[Mapping[str, Any]], dataset: xr.Dataset | None = None) -> Table:
    """Make a table of flat rows; heads come from the labels of variables of that name, else from the name."""
    names = column_names(rows)
    return Table(
        columns=tuple(_head(name, dataset) for name in names), rows=tuple(tuple(cells(row, names)) for row in rows)
    )


def standard_sections(
    summary: Mapping[str, Any], figures: Mapping[str, Figure], dataset: xr.Dataset
) -> tuple[Section, ...]:
    """Turn a summary into sections: its rows, its other tables, its numbers and lists, the figures and the data."""
    rows = summary.get("rows", ())
    text = []
    if summary.get("seeds"):
        text.append(f"Statistics over {summary['seeds']} seed{'s' if summary['seeds'] != 1 else ''}.")
    if any(name.endswith(_ENDS[0]) for row in rows for name in row):
        text.append(_INTERVAL)
    if summary.get("interrupted"):
        text.append("The study was interrupted: only the parts that were finished are here.")
    sections = [Section(title="Results", text=tuple(text), table=table_of(rows, dataset) if rows else None)]
    numbers: dict[str, Any] = {}
    for name, value in summary.items():
        if name in _SAID:
            continue
        if _is_table(value):
            sections.append(Section(title=_title(name), table=table_of(value, dataset)))
        elif isinstance(value, Mapping):
            sections.append(Section(title=_title(name), table=_pairs(value, dataset)))
        elif isinstance(value, list) and value and all(isinstance(item, str) for item in value):
            sections.append(Section(title=_title(name), items=tuple(value)))
        elif value not in ([], None):
            numbers[name] = value
    if numbers:
        sections.append(Section(title="Settings and further numbers", table=_pairs(numbers, dataset)))
    if figures:
        sections.append(Section(title="Figures", figures=figures))
    sections.append(_data(dataset))
    return tuple(sections)


def _data(dataset: xr.Dataset) -> Section:
    rows = [
        (str(name), " × ".join(map(str, array.dims)) or "–", *label_of(array))
        for name, array in dataset.variables.items()
    ]
    sizes = ", ".join(f"{size} along {dim}" for dim, size in dataset.sizes.items())
    return Section(
        title="Data",
        text=(f"What the dataset of the study holds: {sizes or 'scalars'}.",),
        table=Table(columns=("variable", "over", "unit", "meaning"), rows=tuple(rows)),
    )


def _pairs(values: Mapping[str, Any], dataset: xr.Dataset | None) -> Table:
    rows = []
    for name, value in values.items():
        head, _, unit = _head(name, dataset).partition(" [")
        rows.append((head, _cell(value), unit.removesuffix("]")))
    return Table(columns=("what", "value", "unit"), rows=tuple(rows))


def _cell(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_cell(item)}" for name, item in value.items())
    return ", ".join(_cell(item) for item in value) if isinstance(value, list | tuple) else as_number(value)


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(row, Mapping) for row in value)


def _head(name: str, dataset: xr.Dataset | None) -> str:
    """Head a column: long name and unit of the variable of that name, else the name as words and its unit."""
    label = VARIABLES.get(name)
    if label is not None:
        return _with_unit(label.long_name, label.units)
    if dataset is not None and name in dataset.variables:
        own = label_of(dataset[name])
        return _with_unit(own.long_name, own.units)
    return _with_unit(name.replace("_", " "), unit_of(name) if "_" in name else "-")  # a "bar" may be no pressure


def _with_unit(text: str, unit: str) -> str:
    return text if unit == "-" else f"{text} [{unit}]"


def _title(name: str) -> str:
    return name.replace("_", " ").capitalize()
