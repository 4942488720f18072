"""What stands behind a name: `--set NAME=VALUE`, `--over NAME=LOW:HIGH:N` of a grid, `--input NAME=LOW:HIGH`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError

_Number = TypeVar("_Number", int, float)

_FORM = "write NAME=LOW:HIGH:N, for example soc_cad=-20:5:51, or NAME=VALUE,VALUE"
_FACTOR_FORM = "write NAME=LOW:HIGH, for example fuel_mg=6:36, NAME=LOW:HIGH:N or NAME=VALUE,VALUE"
_LIMIT_FORM = "write NAME=X, or NAME=LOW:HIGH, LOW < HIGH, of which one may be left out, as imep_gross_bar=9:"
_INPUT_FORM = "write NAME=LOW:HIGH, for example soc_cad=-20:5, or NAME=LOW:HIGH:STEP"


def grid_of(given: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Read the axes of a grid."""
    grid: dict[str, NDArray[np.float64]] = {}
    for item in given:
        name, span = _split(item, grid, _FORM)
        listed = _listed(item, span)
        if listed is not None:
            grid[name] = listed
            continue
        low, high, count = _range(item, span, _FORM)
        if count is None:
            raise ParameterError(f"--over {item}: {_FORM}")
        if count < 1 or not math.isfinite(low) or not math.isfinite(high) or (count == 1) != (low == high):
            raise ParameterError(f"--over {item}: LOW and HIGH must be finite and differ, N >= 2; or LOW = HIGH, N = 1")
        grid[name] = np.linspace(low, high, count)
    return grid


def factors_of(given: Sequence[str]) -> dict[str, Any]:
    """Read factors as `mgdd.design.design_points` takes them: a range, or levels."""
    factors: dict[str, Any] = {}
    for item in given:
        name, span = _split(item, factors, _FACTOR_FORM)
        listed = _listed(item, span)
        if listed is not None:
            factors[name] = set(listed.tolist()) if len(set(listed.tolist())) == listed.size else listed
            continue
        low, high, count = _range(item, span, _FACTOR_FORM)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ParameterError(f"--over {item}: LOW and HIGH must be finite and LOW < HIGH")
        if count is not None and count < 2:
            raise ParameterError(f"--over {item}: N = {count}: must be >= 2 levels; leave a constant out")
        factors[name] = (low, high) if count is None else set(np.linspace(low, high, count).tolist())
    return factors


def bounds_of(given: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Read the bounds of inputs, and behind them the step in which one is set, repeated ``--input``."""
    bounds: dict[str, tuple[float, ...]] = {}
    for item in given:
        name, span = _split(item, bounds, _INPUT_FORM, "--input")
        low, high, step = _range(item, span, _INPUT_FORM, "--input", third=float)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ParameterError(f"--input {item}: LOW and HIGH must be finite and LOW < HIGH; {_INPUT_FORM}")
        if step is not None and not 0.0 < step <= high - low:
            raise ParameterError(f"--input {item}: STEP must be > 0 and at most HIGH - LOW; {_INPUT_FORM}")
        bounds[name] = (low, high) if step is None else (low, high, step)
    return bounds


def limits_given(given: Sequence[str]) -> dict[str, float | tuple[float, float]]:
    """Read limits, repeated ``--limit``: an upper value, or a lower and an upper one, infinite where it is left out."""
    limits: dict[str, float | tuple[float, float]] = {}
    for item in given:
        name, span = _split(item, limits, _LIMIT_FORM, "--limit")
        low, colon, high = (part.strip() for part in span.partition(":"))
        try:
            sides = (float(low or -math.inf), float(high or math.inf)) if colon else float(low)
            if isinstance(sides, tuple) and (not sides[0] < sides[1] or sides == (-math.inf, math.inf)):
                raise ValueError
        except ValueError:
            raise ParameterError(f"--limit {item}: {_LIMIT_FORM}") from None
        limits[name] = sides
    return limits


def number_pairs(given: Sequence[str], option: str) -> dict[str, float]:
    """Read repeated NAME=NUMBER options."""
    out = assignments(given, {}, option, "NAME=NUMBER")
    for name, value in out.items():
        if isinstance(value, str):
            raise ParameterError(f"{option} {name}={value}: {value!r} is not a number")
    return out


def assignments(
    given: Sequence[str], fields: Mapping[str, Mapping[str, Any]], option: str = "--set", form: str = "FIELD=VALUE"
) -> dict[str, Any]:
    """Read repeated FIELD=VALUE of an option; the caller judges a name that is not a field."""
    out: dict[str, Any] = {}
    for item in given:
        name, value = _split(item, out, f"write {form}", option)
        out[name] = value.strip()
        if "choices" in fields.get(name, {}):
            continue
        try:
            out[name] = float(value)
        except ValueError:
            if name in fields:
                raise ParameterError.of(name, value.strip(), f"a number [{fields[name]['unit']}]") from None
    return out


def _split(item: str, known: Any, form: str, option: str = "--over") -> tuple[str, str]:
    name, sign, span = item.partition("=")
    name = name.strip().replace("-", "_")
    if not (sign and name and span.strip()):
        raise ParameterError(f"{option} {item}: {form}")
    if name in known:
        raise ParameterError(f"{option} {name} is given twice: give it once")
    return name, span


def _listed(item: str, span: str) -> NDArray[np.float64] | None:
    """Read values with commas between them; None for a range."""
    if "," not in span:
        return None
    try:
        return np.array([float(part) for part in span.split(",")])
    except ValueError:
        raise ParameterError(f"--over {item}: the values must be numbers with commas between them") from None


def _range(
    item: str, span: str, form: str, option: str = "--over", *, third: type[_Number] = int
) -> tuple[float, float, _Number | None]:
    parts = span.split(":")
    try:
        low, high = float(parts[0]), float(parts[1])
        count = third(parts[2]) if len(parts) == 3 else None
    except (ValueError, IndexError):
        parts = []
    if len(parts) not in (2, 3):
        raise ParameterError(f"{option} {item}: {form}")
    return low, high, count
