"""Values of a parameter file: each with its unit, what a reader wants of a key, how a value is written."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np

from mgdd.results.units import unit_of

__all__ = [
    "FORMS",
    "PARTS",
    "Entry",
    "Wanted",
    "entries",
    "entry_of",
    "fits",
    "key_line",
    "quoted",
    "wanted",
    "written",
]

Form = Literal["number", "integer", "flag", "text", "numbers", "texts"]
PARTS = ("value", "unit", "stderr", "source")


class Wanted(NamedTuple):
    """What a reader expects of one key.

    Parameters
    ----------
    unit : str
        The unit that must stand there.
    form : {"number", "integer", "flag", "text", "numbers", "texts"}
        Type of the value; ``numbers`` is a list of numbers, or a list of such lists.
    required : bool
        Whether the key must be there.
    """

    unit: str = "-"
    form: Form = "number"
    required: bool = True


FORMS = {
    "number": "a number",
    "integer": "a whole number",
    "flag": "true or false",
    "text": "text in quotes",
    "numbers": "a list of numbers",
    "texts": "a list of texts in quotes",
}


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One value of a parameter file.

    Parameters
    ----------
    value : float, int, bool, str or list
        The value; lists hold numbers, or lists of numbers.
    unit : str or None
        Its unit, ``"-"`` if dimensionless; None where the file does not say it.
    stderr : float, optional
        Standard error, in the same unit.
    source : str, optional
        Where the value comes from.
    """

    value: Any
    unit: str | None = "-"
    stderr: float | None = None
    source: str | None = None


def entries(values: Mapping[str, Any], units: Mapping[str, str] = MappingProxyType({})) -> dict[str, Entry]:
    """Make the entries of a table: units as given, else as the names end."""
    return {name: Entry(value=_plain(value), unit=units.get(name, unit_of(name))) for name, value in values.items()}


def written(values: Mapping[str, Any], wanted: Mapping[str, Wanted]) -> dict[str, Entry]:
    """Make the entries of a table that `ParameterFile.values` takes with the same `wanted`."""
    cast: dict[str, Callable[[Any], Any]] = {"number": float, "integer": int, "flag": bool, "texts": list}
    cast["numbers"] = lambda rows: np.asarray(rows, dtype=np.float64).tolist()
    return {name: Entry(value=cast.get(form, str)(values[name]), unit=unit) for name, (unit, form, _) in wanted.items()}


def wanted(
    names: Iterable[str], units: Mapping[str, str] = MappingProxyType({}), form: Form = "number"
) -> dict[str, Wanted]:
    """Ask for keys of one form, all required: units as given, else as the names end."""
    return {name: Wanted(units.get(name, unit_of(name)), form) for name in names}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def entry_of(entry: Any) -> Entry:
    """Take an entry as it stands; what is not one has no unit, which `ParameterFile.values` refuses."""
    if not isinstance(entry, dict) or "value" not in entry or not set(entry) <= set(PARTS):
        return Entry(value=entry, unit=None)
    return Entry(**{"unit": None, **entry})


def fits(value: Any, form: str) -> bool:
    """Return whether a value is of a form."""
    if form == "numbers":
        rows = value if isinstance(value, list) else [None]
        return all(fits(row, "numbers" if isinstance(row, list) else "number") for row in rows)
    if form == "texts":
        return isinstance(value, list) and all(isinstance(item, str) for item in value)
    if form in ("number", "integer"):
        types: tuple[type, ...] = (int, float) if form == "number" else (int,)
        return isinstance(value, types) and not isinstance(value, bool)
    return isinstance(value, bool if form == "flag" else str)


def key_line(key: str, value: Any) -> str:
    """Write ``key = value`` on one line; lists of lists get a line per row."""
    import tomli_w

    # Strings escape their line breaks, so those left belong to lists.
    text = re.sub(r",\n\s*\]", "]", tomli_w.dumps({key: value}).rstrip("\n"))
    text = re.sub(r"\[\n\s*", "[", text)
    text = re.sub(r",\n\s*", ", ", text)
    rows = isinstance(value, list) and any(isinstance(row, list) for row in value)
    return text.replace("], [", "],\n  [") if rows else text


def quoted(name: str) -> str:
    """Quote a key where TOML needs it."""
    return key_line(name, 0).removesuffix(" = 0")
