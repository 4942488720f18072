"""Units of the columns of a throttle log: what may be asked for, what the file says, and which of them holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.errors import DataError, argument
from mgdd.io.checks import check_choice
from mgdd.io.column_names import unit_text

if TYPE_CHECKING:
    from mgdd.io.table import TextTable

__all__ = ["asked_units", "unit_of_column", "usual_unit"]

# What a file may say, in small letters; the first unit of each is taken where nothing is said.
_SAID = {
    "time_s": {"s": "s", "sec": "s", "seconds": "s", "ms": "ms"},
    "duty": {"-": "-", "1": "-", "%": "%", "percent": "%"},
    "angle_deg": {"deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg", "rad": "rad", "%": "%", "percent": "%"},
    "current_a": {"a": "A", "amp": "A", "ampere": "A"},
    "supply_v": {"v": "V", "volt": "V", "volts": "V"},
}
_OPTIONS = {"time_s": "time_unit", "duty": "duty_unit", "angle_deg": "angle_unit"}


def _units(key: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(_SAID[key].values()))


def usual_unit(key: str) -> str:
    """Return the unit of a column of which nothing is said."""
    return _units(key)[0]


def asked_units(time: str | None, duty: str | None, angle: str | None) -> dict[str, str | None]:
    """Return the unit that is asked for by column, None where nothing is; one that is not known is refused."""
    asked = {**dict.fromkeys(_SAID), "time_s": time, "duty": duty, "angle_deg": angle}
    for key, option in _OPTIONS.items():
        unit = asked[key]
        if unit is not None:
            check_choice(option, unit, _units(key))
    return asked


def unit_of_column(key: str, asked: str | None, table: TextTable, index: int) -> str:
    """Return what the file says, else what is asked for, else the usual unit; the first two must agree."""
    said, sure = unit_text(table.header[index] if table.header else "", table.unit(index))
    if said is None or (said == "-" and "-" not in _SAID[key]):
        return asked or usual_unit(key)
    unit, where = _SAID[key].get(said.lower()), f"{table.source}: {table.called(index)} is in {said!r} as the file says"
    if unit is None and not sure and asked is not None:
        return asked  # a remark, as who reads the file knows
    if unit is None:
        other = "" if sure or key not in _OPTIONS else f", or pass {argument(_OPTIONS[key], '')} if that is a remark"
        raise DataError(f"{where}: convert it to {' or '.join(_units(key))}, or correct the file{other}")
    if asked not in (None, unit):
        raise DataError(f"{where}: leave {argument(_OPTIONS[key])} out, or correct the file")
    return unit
