"""Names and units as other tools write them, and as a map calls them."""

from __future__ import annotations

import re
import unicodedata
from typing import NamedTuple

from mgdd.io.column_names import spelled_unit
from mgdd.maps.cells import can_be_name, spoken_name
from mgdd.results.labels import VARIABLES, name_unit
from mgdd.results.units import attribute_units

NOT_GIVEN = "not given"
# Units as calibration tools write them; everything else stands as it is. Where an angle counts from they do not state.
_UNITS = {
    "°KW": "°CA", "°CRK": "°CA", "deg CA": "°CA", "degCA": "°CA", "1/min": "rpm", "U/min": "rpm", "min-1": "rpm",
    "RPM": "rpm", "Nm": "N m", "N·m": "N m", "N*m": "N m", "°C": "degC", "grad C": "degC", "°": "deg",
}  # fmt: skip
_UMLAUTS = {"Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ä": "ae", "ö": "oe", "ü": "ue"}
_BRACKETS = re.compile(r"[\[({]([^\[\](){}]*)[\])}]\s*$")


class Heading(NamedTuple):
    """What a file gives of an axis or a value: how a map calls it, its unit, and its name in words."""

    name: str
    unit: str
    long_name: str


def unit_from(written: str, name: str) -> str:
    """Give a unit of a file as mgdd prints it; a name with the same unit settles how."""
    if not written.strip():
        return name_unit(name) if name_unit(name) != "-" else NOT_GIVEN
    unit = _UNITS.get(written.strip(), written.strip())
    try:
        same = attribute_units(unit) == attribute_units(name_unit(name))
    except ValueError:
        return f"{NOT_GIVEN} ({unit})"
    return name_unit(name) if same else unit


def unit_to(unit: str) -> str:
    """Give a unit as a file has it: what `unit_from` could not take for a unit stands as it was read."""
    return unit.removeprefix(NOT_GIVEN).strip(" ()") if unit.startswith(NOT_GIVEN) else unit


def without_brackets(text: str) -> tuple[str, str]:
    """Split a label into its words and the unit: in brackets at its end, or all of it."""
    match = _BRACKETS.search(text)
    words = (text[: match.start()] if match else text).strip(" \t:,;=-")
    if match:
        return words, match[1].strip()
    alone = text.strip()
    is_unit = alone in _UNITS or alone == "%" or (len(alone) > 1 and spelled_unit(alone) is not None)
    return ("", alone) if is_unit else (words, "")


def heading_of(text: str, *, unit: str = "", fallback: str, taken: tuple[str, ...] = ()) -> Heading:
    """Read a label such as ``speed [rpm]``, ``rpm`` or ``speed_rpm``; `fallback` is the name where it has none."""
    words, bracket = without_brackets(text)
    written = unit or bracket
    plain = unicodedata.normalize("NFKC", words).strip()
    plain = _UMLAUTS.get(plain[:1], plain[:1]) + plain[1:]
    candidates = (plain, re.sub(r"[^\w.\[\]%]+", "_", plain).strip("_"), _name_of_unit(written) if not words else "")
    name = next((each for each in candidates if each not in taken and _can_name(each, written)), fallback)
    usual = VARIABLES[name].long_name if name in VARIABLES else spoken_name(name)
    return Heading(name, unit_from(written, name), words if words not in ("", name) else usual)


def _can_name(name: str, written: str) -> bool:
    """Whether a word can be a name: one such as ``nm`` would mean a torque."""
    if not can_be_name(name) or "_" in name or name_unit(name) == "-":
        return can_be_name(name)
    return bool(written) and unit_from(written, name) == name_unit(name)


def _name_of_unit(written: str) -> str:
    """Give the name that is nothing but its unit, ``nm`` for Nm."""
    unit = _UNITS.get(written, written)
    name = re.sub(r"\W+", "", unit).lower()
    try:
        says_it = name_unit(name) != "-" and attribute_units(name_unit(name)) == attribute_units(unit)
    except ValueError:
        return ""
    return name if says_it else ""
