"""Which columns of a table hold the angle and the cycles of one cylinder, by header and by shape."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.pressure_units import PRESSURE_UNITS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.io.column_names import Heading
    from mgdd.io.table import TextTable

__all__ = [
    "ANGLE_UNITS",
    "TIME_UNITS",
    "check_alike",
    "choose_angle",
    "choose_pressure",
    "odd_shape",
    "unit_of_pressure",
]

TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6}
ANGLE_UNITS = ("deg", "rad", *TIME_UNITS)
# Cycles of one cylinder, fired or not, share their compression; another cylinder has its peak elsewhere.
_MIN_CORRELATION = 0.5
_PEAK_WITHIN_CAD = 40.0


def choose_angle(
    table: TextTable, heads: Sequence[Heading], column: int | str | None, unit: str | None
) -> tuple[int, str]:
    """Return the column of the angle, or of the time, and its unit."""
    index = table.index(0 if column is None else column)
    head, called = heads[index], f"{table.source}: {table.called(index)}"
    others = [heads[i].name for i in range(table.width) if i != index and heads[i].quantity == "angle"]
    hint = f"pass {argument('angle_column', repr(others[0]))}" if others else "name the column of the crank angle"
    if head.unit in ANGLE_UNITS:
        if unit is not None and unit != head.unit:
            raise DataError(
                f"{called} is in {head.unit} as the file says: leave {argument('angle_unit')} out or correct the file"
            )
        if head.quantity == "time" and others and column is None:
            raise DataError(f"{called} is a time, and {others[0]!r} an angle: {hint}")
        return index, head.unit
    if unit is not None:
        return index, unit
    step = argument("angle_step_deg", "")
    if head.strange is not None or head.unclear is not None:
        raise DataError(
            f"{called} is in {head.strange or head.unclear!r}, which is not known: convert it, or pass "
            f"{argument('angle_unit', '')} with one of {', '.join(ANGLE_UNITS)}"
        )
    if head.quantity == "time":
        raise DataError(
            f"{called} looks like a time: {hint}, or pass {argument('angle_unit', repr('s'))} or "
            f"{argument('angle_unit', repr('ms'))} and {argument('speed_rpm', '')} to turn it into an angle"
        )
    if head.quantity == "counter":
        raise DataError(f"{called} counts samples: {hint}, or pass {step} with the degrees between samples")
    if head.quantity is not None and head.quantity != "angle":
        raise DataError(f"{called} is not a crank angle: {hint}; for a file without one pass {step}")
    return index, "deg"


def choose_pressure(
    table: TextTable,
    heads: Sequence[Heading],
    column: int | str | Sequence[int | str] | None,
    angle: int | None,
) -> list[int]:
    """Return the columns of the cycles: those named, or all behind the angle that can be cycles by their header."""
    if column is not None:
        given = [column] if isinstance(column, int | str) else list(column)
        named = [table.index(one) for one in given]
        if not named or len(set(named)) != len(named) or angle in named:
            raise DataError(f"{table.source}: pressure_column = {given}: give one or several columns beside the angle")
        return named
    first = 0 if angle is None else angle + 1
    possible = [i for i in range(first, table.width) if heads[i].quantity in (None, "pressure")]
    possible = [i for i in table.numeric(possible) if angle is not None or not _counts(table.numbers(i))]
    if not possible and table.width == 1:
        raise DataError(
            f"{table.source}: one column only: give angle and pressure, or for a pressure without an angle column pass "
            f"{argument('angle_step_deg', '')} with the degrees between samples"
        )
    if not possible:
        names = [heads[i].name for i in range(table.width) if i != angle and heads[i].quantity == "pressure"]
        column = argument("pressure_column", repr(names[0]) if names else "")
        raise DataError(f"{table.source}: no pressure behind the angle column: name it, {column}")
    exact = [i for i in possible if heads[i].name == "pressure_bar"]
    if len(possible) == 1 or len(exact) == 1:
        return exact or possible
    cylinders = {heads[i].cylinder for i in possible}
    if table.header is not None and (len(cylinders) > 1 or len({heads[i].series for i in possible}) > 1):
        raise _doubtful(table, possible, "are of several cylinders" if len(cylinders) > 1 else "have unlike names")
    return possible


def check_alike(
    table: TextTable, columns: Sequence[int], degrees: NDArray[np.float64], rows: NDArray[np.float64]
) -> None:
    """Refuse columns of which one differs in shape from the first as no other cycle of the cylinder would."""
    odd = odd_shape(degrees, rows)
    if odd is not None:
        names = f"{table.called(columns[odd])} has another shape than {table.called(columns[0])}"
        raise _doubtful(table, columns, f"may not be cycles of one cylinder ({names})")


def odd_shape(degrees: NDArray[np.float64], rows: NDArray[np.float64]) -> int | None:
    """Return the first row that is not of the shape of row 0: another cylinder, or another quantity."""
    step = float(np.median(np.abs(np.diff(degrees))))
    spread = rows - rows.mean(axis=1, keepdims=True)
    norms = np.sqrt((spread**2).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = spread @ spread[0] / (norms * norms[0])
    away = np.abs(rows.argmax(axis=1) - rows[0].argmax()) * step
    away = np.minimum(away, np.abs(720.0 - away))
    odd = np.flatnonzero(~((alike >= _MIN_CORRELATION) & (away <= _PEAK_WITHIN_CAD)))
    return int(odd[0]) if odd.size else None


def unit_of_pressure(
    table: TextTable, heads: Sequence[Heading], columns: Sequence[int], unit: str | None, *, gain: bool
) -> tuple[str, bool]:
    """Return the unit of the pressure columns, and whether the file says it; volts need a gain."""
    said = {heads[i].unit for i in columns}
    strange = next((heads[i].strange for i in columns if heads[i].strange), None)
    if strange is not None:
        raise DataError(
            f"{table.source}: the file says {strange!r} for the pressure: convert it to one of "
            f"{', '.join(PRESSURE_UNITS)} first"
        )
    unclear = next((heads[i].unclear for i in columns if heads[i].unit is None and heads[i].unclear), None)
    if unclear is not None and unit is None and not gain:
        raise DataError(
            f"{table.source}: {unclear!r} in the header may be a unit, and none that is known: convert it to one of "
            f"{', '.join(PRESSURE_UNITS)}, or pass {argument('pressure_unit', '')} if the pressure is in one of them"
        )
    if len(said) > 1:
        raise DataError(
            f"{table.source}: pressures in {', '.join(map(str, sorted(said, key=str)))}: name columns of one unit"
        )
    (known,) = said
    volts = known in ("V", "mV")
    if volts and not gain:
        raise DataError(
            f"{table.source}: the file says {known} for the pressure: pass {argument('gain_bar_per_v', '')} and "
            f"{argument('offset_bar', '')} of the charge amplifier"
        )
    if gain and (unit is not None or (known is not None and not volts)):
        raise DataError(
            f"{table.source}: {argument('gain_bar_per_v')} is for volts, and the pressure is said to be in "
            f"{unit or known}: give one of them"
        )
    if unit is not None and known is not None and unit != known:
        raise DataError(
            f"{table.source}: the file says {known!r} for the pressure: pass "
            f"{argument('pressure_unit', repr(known))} instead of {unit!r}, or correct the file"
        )
    if known is not None and known not in PRESSURE_UNITS and not volts:
        raise DataError(
            f"{table.source}: {table.called(columns[0])} is in {known}, which is not a pressure: name another"
        )
    return (known or "V") if gain else (unit or known or "bar"), known is not None


def _counts(values: NDArray[np.float64]) -> bool:
    """Return whether a column only counts up: samples or a time."""
    steps = np.diff(values)
    return bool(steps.size and steps[0] > 0.0 and np.allclose(steps, steps[0], rtol=1e-3, atol=0.0))


def _doubtful(table: TextTable, columns: Sequence[int], what: str) -> DataError:
    names = [repr(table.header[i]) if table.header else str(i) for i in columns]
    shown = ", ".join(names if len(names) <= 8 else [*names[:6], "...", names[-1]])
    return DataError(
        f"{table.source}: columns {shown} {what}: name the pressure, for example "
        f"{argument('pressure_column', names[0])}; all cycles of one cylinder are given by all their names"
    )
