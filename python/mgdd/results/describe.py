"""What an object shows of itself: a short text and an HTML table, both from rows of name, value and unit."""

from __future__ import annotations

import dataclasses
import html
import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from mgdd import _core
from mgdd.errors import printable
from mgdd.results.labels import label_of, named_label
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH, _LINES = 100, 15
_LONG = 60  # of a text in a table
_LEAD, _MANY = 8, 60  # rows in HTML: that are seen at once, and behind a fold
_CELLS = 25  # along an axis of a map in a small picture
_DIGITS = 6
_FEW = 4  # numbers that are shown rather than their range
PLAIN = ("inputs", "values", "numbers", "parameters", "summary")  # mappings whose keys need no owner in front
T = TypeVar("T")


class Row(NamedTuple):
    """A name, its value as printed, and its unit."""

    name: str
    value: str
    unit: str = "-"


def as_text(title: str, rows: Iterable[Row]) -> str:
    """Lay out rows as text of at most 15 lines and 100 columns."""
    cells = [f"{row.name} {row.value}" + ("" if row.unit == "-" else f" {row.unit}") for row in rows]
    head = textwrap.shorten(title, _WIDTH, placeholder=" …")
    most = _LINES - 1
    lines = [f"  {textwrap.shorten(cell, _WIDTH - 2, placeholder=' …')}" for cell in cells]
    if len(cells) > most:
        flow = textwrap.wrap(", ".join(cell.replace(" ", "\0") for cell in cells), _WIDTH - 2, break_long_words=False)
        lines = [f"  {line}".replace("\0", " ") for line in flow]
        if len(lines) > most:
            shown = sum(line.count(", ") + line.endswith(",") for line in flow[: most - 1])
            lines = [*lines[: most - 1], f"  … and {len(cells) - shown} more"]
    return printable("\n".join([head, *lines]))


def as_html(title: str, rows: Iterable[Row], picture: str = "") -> str:
    """Lay out rows as an HTML table, for notebooks."""
    entries = list(rows)
    lead = len(entries) if len(entries) <= _LEAD + 2 else _LEAD  # a fold of one or two rows saves nothing
    rest = entries[lead:_MANY]
    fold = f"<details><summary>{len(entries) - lead} more</summary>{_table(rest)}</details>" if rest else ""
    more = f"<p>… and {len(entries) - _MANY} more</p>" if len(entries) > _MANY else ""
    return f"<div><p><b>{html.escape(title)}</b></p>{picture}{_table(entries[:lead])}{fold}{more}</div>"


def _table(rows: Sequence[Row]) -> str:
    body = "".join(
        f"<tr><th style='text-align:left'>{html.escape(row.name)}</th>"
        f"<td style='text-align:right'>{html.escape(row.value)}</td>"
        f"<td style='text-align:left'>{'' if row.unit == '-' else html.escape(row.unit)}</td></tr>"
        for row in rows
    )
    return f"<table><tbody>{body}</tbody></table>"


def picture_of(data: Any) -> str:
    """Draw the first numbers of a Dataset over one or two axes as a small SVG; empty where there are none.

    Made by hand: importing matplotlib takes half a second.
    """
    for name, variable in data.data_vars.items():
        values = variable.to_numpy() if variable.dtype.kind == "f" else np.empty(0)
        finite = values[np.isfinite(values)]
        if finite.size < 2 or not np.ptp(finite) > 0.0:
            continue
        places, shades = [data[dim].to_numpy() for dim in variable.dims], (values - finite.min()) / np.ptp(finite)
        if values.ndim == 1 and values.size >= (2 if places[0].dtype.kind == "f" else 10):
            x = places[0] if places[0].dtype.kind == "f" else np.arange(values.size)
            at = np.unique(np.linspace(0, x.size - 1, 200).astype(int))
            at = at[np.isfinite(shades[at])]
            across = 240 * (x[at] - x[0]) / (x[-1] - x[0])
            points = " ".join(f"{left:.0f},{46 - 42 * up:.1f}" for left, up in zip(across, shades[at], strict=True))
            drawing = f"<polyline fill='none' stroke='#0072B2' points='{points}'></polyline>"
        elif values.ndim == 2 and max(values.shape) <= _CELLS:
            width, height = 240 // len(shades), 50 // len(shades[0])
            dark_to_pale = ((0, 124, 254), (34, 123, 232), (78, 120, 56))  # red, green and blue of cividis
            drawing = ""
            for (i, j), shade in np.ndenumerate(shades):
                if np.isfinite(shade):
                    color = ",".join(f"{np.interp(shade, (0.0, 0.5, 1.0), channel):.0f}" for channel in dark_to_pale)
                    size = f"width='{width}' height='{height}'"
                    drawing += f"<rect x='{i * width}' y='{50 - (j + 1) * height}' {size} fill='rgb({color})'></rect>"
        else:
            continue
        text = html.escape(f"{name} over {' and '.join(map(str, variable.dims))}")
        picture = f"<svg width='240' height='50' role='img'><title>{text}</title>{drawing}</svg>"
        return f"{picture}<br><small>{text}</small>"
    return ""


def as_figure(title: str, rows: Iterable[Row], ax: Axes | None = None) -> Axes:
    """Draw rows as a table."""
    cells = [(row.name, row.value, "" if row.unit == "-" else row.unit) for row in rows] or [("", "", "")]
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=(6.6, 0.6 + 0.24 * len(cells)), layout="constrained")[1]
    ax.set_axis_off()
    ax.set_title(textwrap.shorten(title, _WIDTH, placeholder=" …"), fontsize="small")
    table = ax.table(cellText=cells, colWidths=(0.4, 0.4, 0.2), cellLoc="left", edges="open", loc="upper center")
    table.auto_set_font_size(value=False)
    table.set_fontsize(8)
    return ax


def rows_of(values: Mapping[str, Any], units: Mapping[str, str] | None = None) -> list[Row]:
    """Make rows of names and values; units as given, else as the results' labels or the names give."""
    lines = []
    for name, value in values.items():
        if isinstance(value, Mapping) and value and all(_is_scalar(item) for item in value.values()):
            owner, shared = "" if name in PLAIN else f"{name}.", unit_of(name)
            for key, item in value.items():
                (row,) = rows_of({str(key): item}, units)
                unit = row.unit if shared == "-" or row.value == "–" else shared
                lines.append(Row(f"{owner}{row.name}", row.value, unit))
        else:
            unit = (units or {}).get(name) or named_label(name).units
            shown = _shown(value)
            lines.append(Row(name, shown, unit if shown != "–" else "-"))
    return lines


def dataset_text(data: Any) -> str:
    """Lay out a Dataset as text: its size, and the value or the range of every variable."""
    over = " × ".join(f"{size} {dim}" for dim, size in data.sizes.items())
    shown: dict[str, Any] = {}
    for name, each in sorted(data.data_vars.items(), key=lambda item: item[1].ndim):  # numbers before ranges
        values = each.to_numpy()
        few = values.size <= _FEW and values.ndim == 1
        shown[str(name)] = each.item() if not each.ndim else values if few else _range(values, "")
    units = {str(name): label_of(each).units for name, each in data.data_vars.items() if "units" in each.attrs}
    text = as_text(f"Dataset over {over}" if over else "Dataset", rows_of(shown, units))
    return "\n".join([text, *(f"  {line}" for line in str(data.attrs.get("findings", "")).splitlines())])


def described(
    cls: type[T], *, title: Callable[[Any], str] | None = None, rows: Callable[[Any], Any] | None = None
) -> type[T]:
    """Give a class a short text and an HTML form."""
    head = title_of if title is None else title

    def listed(obj: Any) -> list[Row]:
        fields = fields_of(obj) if rows is None else rows(obj)
        return rows_of(fields) if isinstance(fields, Mapping) else list(fields)

    def text(self: Any) -> str:
        return as_text(head(self), listed(self))

    def markup(self: Any) -> str:
        return as_html(head(self), listed(self))

    for name, function in (("__repr__", text), ("_repr_html_", markup)):
        function.__name__, function.__qualname__ = name, f"{cls.__name__}.{name}"
        setattr(cls, name, function)
    return cls


def title_of(obj: Any) -> str:
    """Name an object by its class, name and kind."""
    labels = [str(value) for name in ("name", "kind") if isinstance(value := getattr(obj, name, None), str)]
    return " ".join([type(obj).__name__, *labels])


def fields_of(obj: Any) -> dict[str, Any]:
    """Give the fields of a dataclass but name, kind and those that its text leaves out."""
    shown = (item.name for item in dataclasses.fields(obj) if item.repr and item.name not in ("name", "kind"))
    return {name: getattr(obj, name) for name in shown}


def _is_scalar(value: Any) -> bool:
    return value is None or isinstance(value, bool | int | float | str | np.generic)


def _shown(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return "–" if math.isnan(value) else f"{float(value):.{_DIGITS}g}"
    if isinstance(value, int | np.integer):
        return str(value)
    if isinstance(value, str):
        return textwrap.shorten(value, _LONG, placeholder=" …") or "–"
    if isinstance(value, np.ndarray):
        few = value.size <= _FEW and value.ndim <= 1
        return _shown(value.tolist()) if few else _range(value, f" ({' × '.join(map(str, value.shape))})")
    if hasattr(value, "sizes") and hasattr(value, "dims"):
        return "Dataset (" + ", ".join(f"{dim}: {size}" for dim, size in value.sizes.items()) + ")"
    if isinstance(value, Mapping | Sequence | set | frozenset):
        named = value.items() if isinstance(value, Mapping) else [("", entry) for entry in value]
        entries = [f"{name} {_shown(entry)}".lstrip() for name, entry in named]
        joined = ", ".join(entries) or "none"
        short = textwrap.shorten(joined, _LONG, placeholder=" …")
        return short if short == joined else f"{len(value)}: {short}"
    if isinstance(value, _core.optimize.Limit):
        return f"{value.name} <= {value.upper:g}"
    if callable(value):
        return getattr(value, "__qualname__", type(value).__qualname__)
    text = repr(value)
    return text if len(text) <= _LONG and "\n" not in text and " object at " not in text else title_of(value)


def _range(values: np.ndarray[Any, Any], shape: str) -> str:
    """Show an array by its least and its largest number."""
    if values.dtype.kind == "b":
        return f"{int(values.sum())} of {values.size} yes"
    finite = values[np.isfinite(values)] if values.dtype.kind in "iuf" else values[:0]
    if not finite.size:
        return f"array{shape or ' without numbers'}"
    low, high = _shown(finite.min()), _shown(finite.max())
    return f"{low if low == high else f'{low} to {high}'}{shape}"


def core_rows(record: Any) -> list[Row]:
    """Make rows of a record of the core, with the units that it states."""
    kind = type(record)
    if not hasattr(kind, "to_dict"):
        return rows_of({name: getattr(record, name) for name, item in vars(kind).items() if isinstance(item, property)})
    units = {name: str(info["unit"]) for name, info in kind.fields().items()} if hasattr(kind, "fields") else {}
    return rows_of(record.to_dict(), units)


def _markup_of_core(self: Any) -> str:
    return as_html(type(self).__name__, core_rows(self))


def _wrapped(plain: Callable[[Any], str]) -> Callable[[Any], str]:
    def text(self: Any) -> str:
        whole = plain(self)
        lines = textwrap.wrap(whole, _WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
        return whole if len(whole) <= _WIDTH else "\n".join(lines)

    return text


# The records of the core keep their text, which evaluates to an equal record, in lines that can be read, and get a
# table beside it.
def _classes(module: ModuleType) -> Iterable[Any]:
    for member in vars(module).values():
        if isinstance(member, ModuleType) and member.__name__.startswith(f"{module.__name__}."):
            yield from _classes(member)
        elif isinstance(member, type) and not issubclass(member, BaseException):
            yield member


for _class in _classes(_core):
    _class._repr_html_ = _markup_of_core
    if hasattr(_class, "to_dict"):
        _class.__repr__ = _wrapped(_class.__repr__)
del _class
