"""Units: what a name says by its ending, what a figure prints, and what stands in the attributes of a Dataset.

A physical name ends in its unit, as ``tau_s``, ``bore_mm`` or ``spring_above_nm_per_rad`` do. Figures and tables print
units as they are typeset; attributes hold them as an expression that a units library such as pint parses.
"""

from __future__ import annotations

import re

# Printed units that only say whose unit it is, and counts: without a dimension in an attribute.
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
    "_deg_per_s2_per_duty": "deg/s² per duty",
    "_duty_per_deg": "duty/deg",
    "_per_deg2": "1/deg²",
    "_per_deg": "1/deg",
    "_deg_per_duty": "deg/duty",
    "_nms_per_rad": "N m s/rad",
    "_nm_per_rad": "N m/rad",
    "_nm_per_rpm": "N m/rpm",
    "_nm_per_a": "N m/A",
    "_vs_per_rad": "V s/rad",
    "_deg_per_s": "deg/s",
    "_rad_per_s": "rad/s",
    "_ns_per_m": "N s/m",
    "_n_per_m": "N/m",
    "_n_per_v": "N/V",
    "_n_per_s": "N/s",
    "_m_per_s": "m/s",
    "_g_per_s": "g/s",
    "_bar_per_cad": "bar/°CA",
    "_bar2_cad": "bar² °CA",
    "_bar2_per_khz": "bar²/kHz",
    "_bar_cad": "bar °CA",
    "_percent_per_cad2": "%/°CA²",
    "_percent_per_cad": "%/°CA",
    "_percent_per_ppm": "%/ppm",
    "_mj_per_kg": "MJ/kg",
    "_g_per_kwh": "g/kWh",
    "_per_ppm": "1/ppm",
    "_per_cad2": "1/°CA²",
    "_per_cad": "1/°CA",
    "_per_s": "1/s",
    "_per_k": "1/K",
    "_kgm2": "kg m²",
    "_samples": "samples",
    "_cycles": "cycles",
    "_percent": "%",
    "_kw": "kW",
    "_duration_cad": "°CA",
    "_scatter_cad": "°CA",
    "_rms_cad": "°CA",
    "_cad": "°CA aTDC",
    "_mean_j": "unit of J",
    "_deg2": "deg²",
    "_deg": "deg",
    "_rad": "rad",
    "_duty": "-",
    "_ohm": "ohm",
    "_rpm": "rpm",
    "_bar": "bar",
    "_kpa": "kPa",
    "_pa": "Pa",
    "_ppm": "ppm",
    "_khz": "kHz",
    "_hz": "Hz",
    "_mm2": "mm²",
    "_mm": "mm",
    "_nm": "N m",
    "_mh": "mH",
    "_ms": "ms",
    "_mg": "mg",
    "_us": "µs",
    "_kg": "kg",
    "_m": "m",
    "_g": "g",
    "_l": "L",
    "_h": "H",
    "_n": "N",
    "_v": "V",
    "_a": "A",
    "_j": "J",
    "_k": "K",
    "_s": "s",
}
_LONGEST_FIRST = sorted(_UNITS, key=len, reverse=True)


def unit_of(name: str) -> str:
    """Read the unit off the end of a name, ``"-"`` if it has none; a single letter is a name."""
    whole = f"_{name}" if len(name) > 1 else name
    unit = next((_UNITS[ending] for ending in _LONGEST_FIRST if whole.endswith(ending)), "-")
    return "°CA" if unit == "°CA aTDC" and name.startswith("rms_") else unit  # a distance, not an angle


def without_unit(name: str) -> str:
    """Return a name in words, without the unit at its end; the whole name where the unit is all of it."""
    ending = next((ending for ending in _LONGEST_FIRST if name.endswith(ending)), "")
    return (name.removesuffix(ending) or name).replace("_", " ").strip()


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
