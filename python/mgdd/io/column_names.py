"""What the header and the units row of a table say of a column: its unit, its quantity, and which series it is of."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

from mgdd.errors import DataError

if TYPE_CHECKING:
    from mgdd.io.table import TextTable

__all__ = ["Heading", "heading", "headings", "unit_text"]

_UNITS = {
    "bar": "bar", "bara": "bar", "bar abs": "bar", "kpaa": "kPa", "kpa abs": "kPa", "barg": "bar",
    "mbar": "mbar", "hpa": "mbar", "kpa": "kPa", "pa": "Pa", "mpa": "MPa",
    "psi": "psi", "psia": "psi", "psig": "psi", "lbf/in2": "psi", "lbf/in²": "psi",
    "kgf/cm2": "kgf/cm2", "kgf/cm²": "kgf/cm2", "kp/cm2": "kgf/cm2", "kp/cm²": "kgf/cm2", "kg/cm2": "kgf/cm2",
    "kg/cm²": "kgf/cm2", "atm": "atm", "torr": "torr", "mmhg": "torr",
    "n/mm2": "MPa", "n/mm²": "MPa", "kn/m2": "kPa", "kn/m²": "kPa", "n/m2": "Pa", "n/m²": "Pa", "dan/cm2": "bar",
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
_QUANTITIES = dict.fromkeys(("bar", "mbar", "kPa", "Pa", "MPa", "psi", "kgf/cm2", "atm", "torr"), "pressure")
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
# Round brackets hold a unit or a remark: these, numbers and the words above are remarks.
_REMARKS = set(
    "abs absolute rel relative gauge mean avg average median min max raw filt filtered smoothed corrected pegged "
    "cyl cylinder zyl zylinder cycle firing fired motored measured model sim plate wanted actual soll ist".split()
)
_GAUGE = re.compile(r"(?<![a-z])(barg|psig|gauge)(?![a-z])", re.IGNORECASE)
_CYLINDER = re.compile(r"(?:cyl\w*?|zyl\w*?)[\s_.\-#]*(\d+)")


class Heading(NamedTuple):
    """What is known of a column, None where nothing is said.

    `strange` is a unit that no list here knows, `unclear` a text that may be one: only who reads the file can tell.
    """

    name: str
    unit: str | None
    quantity: str | None
    series: str
    cylinder: str | None
    strange: str | None
    unclear: str | None
    gauge: bool


def heading(name: str, units_row: str | None = None, *, where: str = "column") -> Heading:
    """Read one column's name and its cell in the units row; two units that differ are refused."""
    in_name, in_row = _unit_of(name), _known(units_row or "")
    if in_name and in_row and in_name != in_row:
        raise DataError(
            f"{where}: the header says {in_name} and the units row {units_row!r}: correct the one that is wrong"
        )
    unit = in_row or in_name
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
        strange=_first_strange([units_row or "", *re.findall(r"\[([^\[\]]*)\]", name)]),
        unclear=_first_strange(_maybe_units(name)),
    )


def unit_text(name: str, units_row: str | None = None) -> tuple[str | None, bool]:
    """Return what stands where a unit stands, None for nothing, and whether it can be nothing else."""
    for texts, sure in (([units_row or "", *re.findall(r"\[([^\[\]]*)\]", name)], True), (_maybe_units(name), False)):
        said = next((text.strip() for text in texts if text.strip()), None)
        if said is not None:
            return said, sure
    return None, False


def _first_strange(texts: list[str]) -> str | None:
    return next((text for text in texts if text.strip(" -") and _known(text) is None), None)


def _maybe_units(name: str) -> list[str]:
    """Return what round brackets hold, remarks left out, and a last word with a slash in it."""
    remarks = _REMARKS | {word for known in _WORDS.values() for word in known.split()}
    texts = [text for text in re.findall(r"[({]([^(){}]*)[)}]", name) if _known(text) or _words(text) - remarks]
    ratio = _ratio(name)
    return [*texts, ratio] if ratio else texts


def _ratio(name: str) -> str | None:
    """Return the last word where it has a slash in it: a unit of its own, or a quantity over its unit, t/s."""
    last = re.split(r"[\s_]+", name.strip())[-1]
    if "/" not in last.strip("/") or _BRACKETS.search(last):
        return None
    below = last.partition("/")[2]
    return below if _known(last) is None and _known(below) is not None else last


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
    if (ratio := _ratio(name)) and _known(ratio):
        return _known(ratio)
    words = [word for word in re.split(r"[\s_/,;.\-]+", name.strip()) if word and not word.isdecimal()]
    if not words or (len(words[-1]) == 1 and (len(words) == 1 or (words[-1] != "V" and words[0].lower() == "p"))):
        return None  # a lone letter is a name, and p_a is a cylinder rather than an ampere
    return _known(words[-1])


def _words(name: str) -> set[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[^\W\d_]+", spaced.lower()))
