"""What the header and the units row of a table say of a column: its unit, its quantity, and which series it is of."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from mgdd.errors import DataError

if TYPE_CHECKING:
    from mgdd.io.table import TextTable

__all__ = ["Heading", "heading", "headings"]

_UNITS = {
    "bar": "bar", "bara": "bar", "bar abs": "bar", "kpaa": "kPa", "kpa abs": "kPa", "barg": "bar",
    "mbar": "mbar", "hpa": "mbar", "kpa": "kPa", "pa": "Pa", "mpa": "MPa",
    "psi": "psi", "psia": "psi", "psig": "psi",
    "v": "V", "volt": "V", "volts": "V", "mv": "mV",
    "s": "s", "sec": "s", "seconds": "s", "ms": "ms", "us": "us", "µs": "us", "μs": "us",
    "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "°ca": "deg", "°kw": "deg", "cad": "deg", "ca": "deg",
    "degca": "deg", "deg ca": "deg", "°crk": "deg", "degcrk": "deg", "kw": "deg", "°caatdc": "deg", "°atdc": "deg",
    "°ca atdc": "deg", "deg atdc": "deg", "atdc": "deg", "cadatdc": "deg", "degatdc": "deg",
    "rad": "rad", "radian": "rad", "radians": "rad",
    "nm": "other", "n m": "other", "n·m": "other", "rpm": "other", "1/min": "other", "min-1": "other", "k": "other",
    "°c": "other", "degc": "other", "a": "other", "ma": "other", "l": "other", "m3": "other", "m³": "other",
    "cm3": "other", "cm³": "other", "j": "other", "kj": "other", "j/deg": "other", "j/cad": "other", "j/°ca": "other",
    "mm": "other", "%": "other", "ppm": "other", "g": "other", "mg": "other", "kg": "other", "hz": "other",
}  # fmt: skip
_QUANTITIES = dict.fromkeys(("bar", "mbar", "kPa", "Pa", "MPa", "psi"), "pressure")
_QUANTITIES |= {"V": "pressure", "mV": "pressure", "s": "time", "ms": "time", "us": "time"}
_QUANTITIES |= {"deg": "angle", "rad": "angle", "other": "other"}
# Words of a name, in English and German; places other than the cylinder count as another quantity.
_WORDS = {
    "other": "torque drehmoment speed rpm drehzahl temp temperature temperatur volume vol volumen heat rohr hrr lift "
    "hub current strom lambda nox needle nadel injection inj spark knock intake inlet manifold map exhaust exh rail "
    "boost ambient oil fuel egr imep work gamma burned fraction",
    "pressure": "p pressure druck pcyl zylinderdruck",
    "time": "time t zeit temps timestamp",
    "angle": "angle crank crankangle cad ca phi theta winkel kurbelwinkel",
    "counter": "sample samples index idx row nr count counter",
}
_BRACKETS = re.compile(r"[\[({]([^\[\](){}]*)[\])}]")
_GAUGE = re.compile(r"(?<![a-z])(barg|psig|gauge)(?![a-z])", re.IGNORECASE)
_CYLINDER = re.compile(r"(?:cyl\w*?|zyl\w*?)[\s_.\-#]*(\d+)")


class Heading(NamedTuple):
    """What is known of a column, None where nothing is said; `strange` is a unit that no list here knows."""

    name: str
    unit: str | None
    quantity: str | None
    series: str
    cylinder: str | None
    strange: str | None
    gauge: bool


def heading(name: str, units_row: str | None = None, *, where: str = "column") -> Heading:
    """Read one column's name and its cell in the units row; two units that differ are refused."""
    in_name, in_row = _unit_of(name), _known(units_row or "")
    if in_name and in_row and in_name != in_row:
        raise DataError(
            f"{where}: the header says {in_name} and the units row {units_row!r}: correct the one that is wrong"
        )
    unit = in_row or in_name
    said = [units_row or "", *re.findall(r"\[([^\[\]]*)\]", name)]
    words = _words(_BRACKETS.sub(" ", name))
    quantity = _QUANTITIES.get(unit or "")
    found = next((kind for kind, known in _WORDS.items() if words & set(known.split())), None)
    if quantity is None or (quantity == "pressure" and found == "other"):
        quantity = found or quantity
    cylinder = _CYLINDER.search(name.lower())
    return Heading(
        name=name,
        unit=None if unit == "other" else unit,
        quantity=quantity,
        series=" ".join(re.findall(r"[^\W\d_]+", name.lower())),
        cylinder=cylinder[1] if cylinder else None,
        gauge=bool(_GAUGE.search(f"{name} {units_row}")),
        strange=next((text for text in said if text.strip(" -") and _known(text) is None), None),
    )


def headings(table: TextTable) -> list[Heading]:
    """Read header and units row of a table, column by column."""
    names = table.header or ("",) * table.width
    return [
        heading(name, table.unit(index), where=f"{table.source}, {table.called(index)}")
        for index, name in enumerate(names)
    ]


def _known(text: str) -> str | None:
    return _UNITS.get(text.strip().lower())


def _unit_of(name: str) -> str | None:
    """Return the unit in brackets, or the last word where it is one; a running number may follow it."""
    for text in reversed(_BRACKETS.findall(name)):
        unit = _known(text)
        if unit is not None:
            return unit
    words = [word for word in re.split(r"[\s_/,;.\-]+", name.strip()) if word and not word.isdecimal()]
    if not words or (len(words[-1]) == 1 and (len(words) == 1 or (words[-1] != "V" and words[0].lower() == "p"))):
        return None  # a lone letter is a name, and p_a is a cylinder rather than an ampere
    return _known(words[-1])


def _words(name: str) -> set[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[^\W\d_]+", spaced.lower()))
