"""Units: what a name gives by its ending, what a figure prints, and what stands in the attributes of a Dataset.

A physical name ends in its unit, as ``tau_s``, ``bore_mm`` or ``spring_above_nm_per_rad`` do. Figures and tables print
units as they are typeset; attributes hold them as an expression that a units library such as pint parses.
"""

from __future__ import annotations

import re

# Printed units that only name whose unit it is, and counts: without a dimension in an attribute.
_WHOSE = ("unit of ", "in the unit of ", "not given")
_COUNTS = frozenset({"-", "cycle", "cycles", "sample", "samples"})
_REMARK = re.compile(r" per unit of .*$| of .*$| \([^)]*\)$| per duty$")
_WRITTEN = (
    (re.compile(r"°CA aTDC|°(CA|KW|CRK)(?![A-Za-z])|°(?![A-Za-z])|\bdeg(?=\b|[²³])"), "degree"),
    (re.compile(r"^duty/"), "1/"),
    (re.compile(r"/duty$"), ""),
    (re.compile(r"%"), "percent"),
    (re.compile(r"²"), "**2"),
    (re.compile(r"³"), "**3"),
    (re.compile(r"\^"), "**"),
    (re.compile(r"/\((\w+) (\w+)\)"), r"/\1/\2"),
    (re.compile(r"[ ·]+"), "*"),
    (re.compile(r"(?<=degree/)s\b"), "second"),
)
_TYPESET = (("**2", "²"), ("**3", "³"), ("*", " "), ("degree", "deg"), ("second", "s"), ("percent", "%"))
_FACTOR = r"[A-Za-zµ]+(\*\*\d)?"
_EXPRESSION = re.compile(rf"(1|{_FACTOR})([*/]{_FACTOR})*")

_UNITS = {
    "deg": "deg", "deg2": "deg²", "rad": "rad", "cad": "°CA", "cad2": "°CA²", "rpm": "rpm", "s": "s", "ms": "ms",
    "us": "µs", "h": "h", "hz": "Hz", "khz": "kHz", "m": "m", "mm": "mm", "mm2": "mm²", "l": "L", "g": "g", "mg": "mg",
    "kg": "kg", "kgm2": "kg m²", "n": "N", "nm": "N m", "nms": "N m s", "ns": "N s", "bar": "bar", "bar2": "bar²",
    "kpa": "kPa", "pa": "Pa", "k": "K", "j": "J", "mj": "MJ", "kw": "kW", "kwh": "kWh", "v": "V", "vs": "V s", "a": "A",
    "ohm": "ohm", "mh": "mH", "ppm": "ppm", "percent": "%", "duty": "duty",
}  # fmt: skip
_ALONE = {"cad": "°CA aTDC", "duty": "-", "h": "H", "ns": "ns"}  # what these mean without a quotient
_WHOLE = {
    "_deg_per_s2_per_duty": "deg/s² per duty", "_bar2_cad": "bar² °CA", "_bar_cad": "bar °CA", "_duration_cad": "°CA",
    "_scatter_cad": "°CA", "_rms_cad": "°CA", "_mean_j": "unit of J", "_samples": "samples", "_cycles": "cycles",
}  # fmt: skip
_ENDING = re.compile(
    rf"(?:{'|'.join(_WHOLE)}|(?:(?:_(?P<over>{'|'.join(_UNITS)}))?(?P<per>_per))?_(?P<unit>{'|'.join(_UNITS)}))$"
)


def unit_of(name: str) -> str:
    """Read the unit off the end of a name, ``"-"`` if it has none; a single letter is a name."""
    ending = _ENDING.search(f"_{name}") if len(name) > 1 else None
    if ending is None:
        return "-"
    over, per, unit = ending["over"], ending["per"], ending["unit"]
    if per:
        return f"{_UNITS[over] if over else 1}/{_UNITS[unit]}"
    if unit == "cad" and name.startswith("rms_"):
        return "°CA"  # a distance, not an angle
    return (_ALONE.get(unit) or _UNITS[unit]) if unit else _WHOLE[ending[0]]


def without_unit(name: str) -> str:
    """Return a name in words, without the unit at its end; the whole name where the unit is all of it."""
    return (_ENDING.sub("", name) or name).replace("_", " ").strip()


def attribute_units(printed: str) -> str:
    """Return a printed unit as an expression that pint parses: ``"1"`` if dimensionless or a count."""
    text = printed.strip()
    if text.startswith(_WHOSE):
        return "1"
    text = _REMARK.sub("", text)
    if text in _COUNTS:
        return "1"
    for pattern, written in _WRITTEN:
        text = pattern.sub(written, text)
    if not _EXPRESSION.fullmatch(text):
        raise ValueError(f"{printed!r} is not a product or quotient of units, such as N*m or degree/second**2")
    return text


def unit_attributes(printed: str, long_name: str) -> dict[str, str]:
    """Return the attributes ``units`` and ``long_name``; what the expression loses, ends the long name."""
    units = attribute_units(printed)
    whole = printed in (units, _typeset(units))
    return {"units": units, "long_name": long_name if whole else f"{long_name}, {printed}"}


def printed_units(units: str, long_name: str) -> tuple[str, str]:
    """Turn the two attributes back into the unit that figures print, and the name."""
    name, _, remark = long_name.rpartition(", ")
    if name and remark not in (units, _typeset(units)):
        try:
            if attribute_units(remark) == units:
                return remark, name
        except ValueError:
            pass  # the last part of a name is not a unit
    return _typeset(units), long_name


def _typeset(units: str) -> str:
    for written, printed in _TYPESET:
        units = units.replace(written, printed)
    return "-" if units == "1" else units
