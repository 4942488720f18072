"""What the header and the units row of a table say of a column: its unit, its quantity, and which series it is of."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import lru_cache
from typing import NamedTuple

from mgdd.errors import DataError

TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6}
# Spellings of a unit, in small letters, comma between them; "other" are those of quantities that are not used.
_SPELLINGS = {
    "bar": "bar, dan/cm2",
    "kPa": "kpa, kn/m2, kn/m²",
    "mbar": "mbar, hpa",
    "Pa": "pa, n/m2, n/m²",
    "MPa": "mpa, n/mm2, n/mm²",
    "psi": "psi, lbf/in2, lbf/in²",
    "kgf/cm2": "kgf/cm2, kgf/cm², kp/cm2, kp/cm², kg/cm2, kg/cm²",
    "atm": "atm",
    "torr": "torr, mmhg",
    "V": "v, volt, volts",
    "mV": "mv",
    "s": "s, sec, seconds",
    "ms": "ms",
    "us": "us, µs, μs",
    "deg": "deg, degree, degrees, °",
    "°CA": "°ca, °kw, cad, ca, degca, deg ca, °crk, degcrk, kw, °caatdc, °atdc, °ca atdc, deg atdc, atdc, cadatdc, "
    "degatdc",
    "rad": "rad, radian, radians",
    "%": "%, percent",
    "A": "a, amp, ampere",
    "-": "-, 1",
    "other": "nm, n m, n·m, rpm, 1/min, min-1, k, °c, degc, ma, l, m3, m³, cm3, cm³, j, kj, j/deg, j/cad, j/°ca, mm, "
    "ppm, g, mg, kg, hz",
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split(", ")}
# What these are in a table of pressures; the plate of a throttle is not measured in crank angles.
_AMONG_PRESSURES = {"°CA": "deg", "%": "other", "A": "other", "-": None}
_QUANTITIES = dict.fromkeys((*list(_SPELLINGS)[:9], "V", "mV"), "pressure")
_QUANTITIES |= {"s": "time", "ms": "time", "us": "time", "deg": "angle", "rad": "angle", "other": "other"}
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
_KINDS = {kind: frozenset(words.split()) for kind, words in _WORDS.items()}
_SQUARE = re.compile(r"\[([^\[\]]*)\]")
_BRACKETS = re.compile(r"[\[({]([^\[\](){}]*)[\])}]")
# Round brackets hold a unit or a remark: these, numbers and the words above are remarks.
_REMARKS = frozenset().union(*_KINDS.values()) | set(
    "abs absolute rel relative gauge mean avg average median min max raw filt filtered smoothed corrected pegged "
    "cyl cylinder zyl zylinder cycle firing fired motored measured model sim plate wanted actual soll ist".split()
)
# What stands behind a unit of pressure: absolute, or above the atmosphere.
_PRESSURE_UNIT = r"(?<![a-zA-Z])(m?bar|psi|[kmh]?pa)"
_ABSOLUTE = re.compile(rf"{_PRESSURE_UNIT}[ _]?(?:\((?:a|abs|absolute?)\)|abs|absolute?|a)(?![a-zA-Z])", re.IGNORECASE)
_GAUGE = re.compile(
    rf"{_PRESSURE_UNIT}[ _]?(?:\((?:g|gauge|rel|relative?|ü)\)|gauge|rel|relative?|g|ü)(?![a-zA-Z])", re.IGNORECASE
)
_SAYS_GAUGE = re.compile(r"(?<![a-zA-Z])gauge(?![a-zA-Z])", re.IGNORECASE)
# Words that a letter numbers.
_PLACES = frozenset("p ch chan channel kanal input analog sensor probe cyl cylinder zyl zylinder port bank".split())
_CYLINDER = re.compile(r"(?:(?:cyl\w*?|zyl\w*?)[\s_.\-#]*|^pressure_(?=\d+_bar))(\d+)")  # the last is our own


class Heading(NamedTuple):
    """What is known of a column, None where nothing is given.

    `other` is a unit of another quantity, `strange` one that no list here knows, `unclear` a text that may be one: only
    who reads the file can tell.
    """

    name: str
    unit: str | None
    quantity: str | None
    series: str
    cylinder: str | None
    other: str | None
    strange: str | None
    unclear: str | None
    gauge: bool


def heading(name: str, units_row: str | None = None, *, where: str = "column") -> Heading:
    """Read one column's name and its cell in the units row; two units that differ are refused."""
    try:
        return _heading(name, units_row)
    except DataError as error:
        raise error.reworded(f"{where}: {error}") from error


@lru_cache(maxsize=1024)  # the files of a folder have the same names
def _heading(name: str, units_row: str | None) -> Heading:
    written, gauge = name, bool(_SAYS_GAUGE.search(f"{name} {units_row}"))
    name, name_gauge = _without_reference(name)
    units_row, row_gauge = _without_reference(units_row or "")
    in_name, in_row = _unit_of(_unit_word(name, lone=not units_row) or ""), _unit_of(units_row)
    if in_name and in_row and in_name != in_row:
        raise DataError(f"the header says {in_name} and the units row {units_row!r}: correct the one that is wrong")
    unit = in_row or in_name
    words = _words(_BRACKETS.sub(" ", name))
    quantity = _QUANTITIES.get(unit or "")
    quantity_found = next((kind for kind, known in _KINDS.items() if words & known), None)
    if quantity is None or (quantity == "pressure" and quantity_found == "other"):
        quantity = quantity_found or quantity
    cylinder = _CYLINDER.search(name.lower())
    units = [units_row, *_SQUARE.findall(name)]
    letter = in_name == "other" and not in_row and len(_unit_word(name) or "") == 1 and not _BRACKETS.search(name)
    return Heading(
        name=written,
        unit=None if unit == "other" else unit,
        quantity=quantity,
        series=" ".join(re.findall(r"[^\W\d_]+", name.lower())),
        cylinder=cylinder[1] if cylinder else None,
        gauge=gauge or name_gauge or row_gauge,
        other=next((text.strip() for text in units if _unit_of(text) == "other"), None),
        strange=_first_strange(units),
        unclear=_first_strange(_maybe_units(name)) or (_unit_word(name) if letter else None),
    )


def bare_unit(cell: str) -> str:
    """Return a cell of a units row without the brackets around it; those of bar(a) belong to it."""
    text = cell.strip()
    while len(text) > 1 and text[0] + text[-1] in ("[]", "()", "{}"):
        text = text[1:-1].strip()
    return text


def _without_reference(text: str) -> tuple[str, bool]:
    """Leave out what says what a pressure is above, as in bar(a), and return whether that is the atmosphere."""
    text, gauges = _GAUGE.subn(r"\1", text)
    return _ABSOLUTE.sub(r"\1", text), gauges > 0


def unit_text(name: str, units_row: str | None = None) -> tuple[str | None, bool]:
    """Return what stands where a unit stands, None for nothing, and whether it can be nothing else."""
    for texts, sure in (([units_row or "", *_SQUARE.findall(name)], True), (_maybe_units(name), False)):
        unit = next((text.strip() for text in texts if text.strip()), None)
        if unit is not None:
            return unit, sure
    return None, False


def _first_strange(texts: list[str]) -> str | None:
    return next((text for text in texts if text.strip(" -") and _unit_of(text) is None), None)


def _maybe_units(name: str) -> list[str]:
    """Return what round brackets hold, remarks left out, and a last word with a slash in it."""
    texts = [text for text in re.findall(r"[({]([^(){}]*)[)}]", name) if _unit_of(text) or _words(text) - _REMARKS]
    ratio = _ratio(name)
    return [*texts, ratio] if ratio else texts


def _ratio(name: str) -> str | None:
    """Return the last word where it has a slash in it: a unit of its own, or a quantity over its unit, t/s."""
    last = re.split(r"[\s_]+", name.strip())[-1]
    if "/" not in last.strip("/") or _BRACKETS.search(last):
        return None
    below = last.partition("/")[2]
    return below if _unit_of(last) is None and _unit_of(below) is not None else last


@lru_cache(maxsize=256)
def spelled_unit(text: str) -> str | None:
    """Return the unit that a text spells, None where it is none that is known."""
    return _UNITS.get(_without_reference(text)[0].strip().lower())


def _unit_of(text: str) -> str | None:
    unit = spelled_unit(text)
    return _AMONG_PRESSURES.get(unit or "", unit)


def check_choice(name: str, value: object, allowed: Collection[str]) -> None:
    """Refuse a keyword value outside its list, naming both."""
    DataError.unless(value in allowed, name, value, f"one of {', '.join(map(repr, allowed))}")


def stated_unit(name: str, units_row: str | None = None) -> str | None:
    """Return the unit of a column as the file writes it, known or not; None where it gives none."""
    unit = next((text.strip() for text in (units_row or "", *_SQUARE.findall(name)) if text.strip()), None)
    return unit or _unit_word(name)


def _unit_word(name: str, *, lone: bool = True) -> str | None:
    """Return the unit in brackets, or the last word where it is one; a running number may follow it.

    A lone letter is one where `lone`: with a row of units below, Channel A is a name.
    """
    for text in reversed(_BRACKETS.findall(name)):
        if _unit_of(text) is not None:
            return str(text)
    if (ratio := _ratio(name)) and _unit_of(ratio):
        return ratio
    own = [part for part in name.split(".") if not part.strip().isdecimal()]  # behind those of its structs and groups
    words = [word for word in re.split(r"[\s_/,;\-]+", own[-1].strip() if own else "") if word and not word.isdecimal()]
    if not words:
        return None
    if len(words[-1]) == 1 and (not lone or len(words) == 1 or (words[-1] != "V" and words[0].lower() in _PLACES)):
        return None  # a lone letter is a name, and p_a is a cylinder rather than an ampere
    return words[-1] if _unit_of(words[-1]) is not None else None


def stem(name: str) -> str:
    """Return a name without its unit in brackets and without its last number, which counts cycles or cylinders."""
    bare = without_brackets(name)
    number = last_number(name)
    return bare if number is None else "".join(bare.rsplit(number, 1)).rstrip(" _.-#")


def last_number(name: str) -> str | None:
    """Return the last number in a name, its unit in brackets left out."""
    numbers = re.findall(r"\d+", without_brackets(name))
    return numbers[-1] if numbers else None


def without_brackets(name: str) -> str:
    """Return a name without the brackets that hold a unit; remarks stay."""

    def cleaned(bracket: re.Match[str]) -> str:
        return " " if bracket[0].startswith("[") or _unit_of(bracket[1]) is not None else f" {bracket[1]} "

    return _BRACKETS.sub(cleaned, name).strip()


def _words(name: str) -> set[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[^\W\d_]+", spaced.lower()))
