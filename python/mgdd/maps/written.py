"""Names and units as other tools write them, in the corner of a grid too, and as a map calls them."""

from __future__ import annotations

import re
import unicodedata
import warnings
from typing import NamedTuple

from mgdd.errors import DataError, argument, printable
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


_BRACKETED = re.compile(r"[\[({][^\[\](){}]*[\])}]")
_X_AND_Y = re.compile(r"([xy])\s*[:=]\s*(.+?)[\s,;/|\\]+([xy])\s*[:=]\s*(.+)", re.IGNORECASE)
# By rank; a blank on both sides of a slash sets it apart from those of units.
_SEPARATORS = (r"\\+", r"\n+", r"\|", r"\s+/\s+", r";", r"/", r",")
_DOWN, _ACROSS = r"↓|⇩|(?<![^\s])[vV]|down|rows|zeilen", r"→|⇨|-*>|across|columns|spalten"
_MARKED = re.compile(
    rf"(?:(?P<before>{_DOWN}|{_ACROSS})\s*[:=]?\s+)?(?P<text>.*?)(?:\s*(?P<after>{_DOWN}|{_ACROSS}))?", re.IGNORECASE
)
_BOTH = re.compile(rf"(.+?\s*(?:{_DOWN}|{_ACROSS}))[\s/\\|,;]+(.+?\s*(?:{_DOWN}|{_ACROSS}))", re.IGNORECASE)


def axes_of(
    corner: str, *, rows: str | None, columns: str | None, above: str = "", taken: tuple[str, ...] = (), where: str
) -> tuple[Heading, Heading]:
    """Give the axis that runs down and the one across, from a corner's label, names for them, or the label above."""
    down, across, is_open = _parts(corner)
    if above and not across:
        across, is_open = _side(above)[0], False
    if is_open:
        down, across = _chosen(down, across, rows, columns, where)
    else:
        turned = (rows is not None and _fits(across, rows) and not _fits(down, rows)) or (
            columns is not None and _fits(down, columns) and not _fits(across, columns)
        )
        if turned:
            raise DataError(
                f"{where}: the corner {corner!r} states that {down} runs down and {across} across: correct it, or "
                f"leave {argument('rows')} and {argument('columns')} out"
            )
    headings = []
    for text, name, fallback in ((down, rows, "y"), (across, columns, "x")):
        made = heading_of(text, fallback=fallback, taken=taken)
        if name is not None and name.casefold() not in (text.casefold(), without_brackets(text)[0].casefold()):
            named = heading_of(name, unit=without_brackets(text)[1], fallback=name)
            made = named._replace(long_name=without_brackets(text)[0] or named.long_name)
        if not text and name is None:
            side, example = ("rows", "speed_rpm") if fallback == "y" else ("columns", "fuel_mg")
            warnings.warn(
                f"{printable(where)}: the corner {corner!r} does not name the axis of the {side}: it is called "
                f"{fallback}, without a unit; name it with {argument(side, repr(example))}",
                UserWarning,
                stacklevel=2,
            )
        headings.append(made)
        taken = (*taken, made.name)
    if headings[0].name == headings[1].name:
        raise DataError(f"{where}: both axes are called {headings[0].name}: name them with {_choice('…', '…')}")
    return headings[0], headings[1]


def _choice(down: str, across: str) -> str:
    return f"{argument('rows', repr(down))} and {argument('columns', repr(across))}"


def _parts(corner: str) -> tuple[str, str, bool]:
    """Give the label of the rows, that of the columns, and whether it is open which is which."""
    text = corner.strip()
    marked = _X_AND_Y.fullmatch(text)
    if marked and marked[1].lower() != marked[3].lower():
        named = {marked[1].lower(): marked[2].strip(), marked[3].lower(): marked[4].strip()}
        return named["y"], named["x"], False
    arrows = _BOTH.fullmatch(text)
    parts, separator = ([arrows[1], arrows[2]], "") if arrows else _split(text)
    sides = [_side(part) for part in parts]
    texts = [each for each, _ in sides]
    if len(parts) == 2 and {side for _, side in sides} not in ({""}, {"down"}, {"across"}):
        first_down = sides[0][1] == "down" or sides[1][1] == "across"
        return (texts[0], texts[1], False) if first_down else (texts[1], texts[0], False)
    if len(parts) == 1:
        side = sides[0][1]
        if side == "across":
            return "", texts[0], False
        return texts[0], "", bool(text) and not side
    return texts[0], texts[1], separator != _SEPARATORS[0]


def _split(text: str) -> tuple[list[str], str]:
    masked = _BRACKETED.sub(lambda marks: "\0" * len(marks[0]), text)
    if without_brackets(text)[0] == "":
        return [text], ""  # a unit alone, as 1/min
    for separator in _SEPARATORS:
        marks = [*re.finditer(separator, masked)]
        if len(marks) == 1:
            parts = [text[: marks[0].start()].strip(), text[marks[0].end() :].strip()]
            if all(parts):
                return parts, separator
    return [text], ""


def _side(part: str) -> tuple[str, str]:
    """Give a label without its arrow, and where that points."""
    match = _MARKED.fullmatch(part)
    mark = (match["before"] or match["after"]) if match else None
    if match is None or not mark or not match["text"].strip():
        return part, ""
    side = "down" if re.fullmatch(_DOWN.replace(r"(?<![^\s])", ""), mark, re.IGNORECASE) else "across"
    return match["text"].strip(), side


def _chosen(down: str, across: str, rows: str | None, columns: str | None, where: str) -> tuple[str, str]:
    """Let the arguments decide which of two labels runs down."""
    first_down = set()
    for name, is_down in ((rows, True), (columns, False)):
        fits = (name is not None and _fits(down, name), name is not None and _fits(across, name))
        if fits[0] != fits[1]:
            first_down.add(fits[0] == is_down)
    if len(first_down) == 1:
        return (down, across) if first_down.pop() else (across, down)
    plain = not without_brackets(down)[1] and not without_brackets(across)[1]
    if rows is not None and columns is not None and plain:
        return "", ""  # both are named anew
    if not across:
        raise DataError(
            f"{where}: the corner {down!r} names one axis, and not whether it runs down or across: pass "
            f"{argument('rows', repr(down))} if it runs down, or name both with {_choice('speed_rpm', 'fuel_mg')}"
        )
    raise DataError(
        f"{where}: the corner names {down!r} and {across!r} and not which axis runs down: pass "
        f"{argument('rows', repr(down))} if {down} runs down, or {argument('columns', repr(down))} if it runs across"
    )


def _fits(text: str, name: str) -> bool:
    """Whether a label and an argument mean the same axis: the same words, or units that are the same."""
    made, other = heading_of(text, fallback=""), heading_of(name, fallback="")
    if not text or name.casefold() in (text.casefold(), without_brackets(text)[0].casefold(), made.name.casefold()):
        return bool(text)
    units = (made.unit, other.unit)
    if any(unit == "-" or unit.startswith(NOT_GIVEN) for unit in units):
        return False
    return attribute_units(units[0]) == attribute_units(units[1])
