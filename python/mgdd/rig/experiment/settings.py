"""What an experiment file may hold: one record per table, with the form, the default and the range of every key."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, TypeVar

from mgdd.errors import ParameterError, hinted
from mgdd.identify.throttle.excitation import EXCITATIONS
from mgdd.identify.throttle.fits import CHOICES
from mgdd.io.parameters import fits
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.engine_guide import KINDS
from mgdd.loop.seek_choice import SEEKERS
from mgdd.rig.can.toml_table import TomlTable

PACES = ("step", "real_time")
LOOPS = ("auto", "core", "python")
TASKS = ("identify", "track", "seek", "map")
SAMPLE_S = 1e-3  # between samples of a throttle that is simulated
_BOUNDS_CAD = {"soc_cad": (-30.0, 10.0)}  # of a search, by default; as of `mgdd engine seek`
_T = TypeVar("_T")


def _key(
    form: str, default: Any = None, *, among: tuple[str, ...] | None = None, low: float | None = None,
    high: float | None = None,
) -> Any:  # fmt: skip
    """Make a field that knows the form of its key; None: the key may be missing."""
    facts = {"form": form, "among": among, "low": low, "high": high}
    if isinstance(default, dict):
        return field(default_factory=dict, metadata=facts)
    return field(default=default, metadata=facts)


class Settings:
    """Base of the records: reading from a table, and back."""

    @classmethod
    def read(cls, table: TomlTable) -> Self:
        """Take all keys of a table; an unknown key, a wrong form or range is a ParameterError that names the file."""
        table.only([own.name for own in dataclasses.fields(cls)])  # type: ignore[arg-type]
        values: dict[str, Any] = {}
        for own in dataclasses.fields(cls):  # type: ignore[arg-type]
            facts = own.metadata
            if facts["form"] in _TABLES:
                values[own.name] = _TABLES[facts["form"]](table.table(own.name))
                continue
            value = table.take(own.name, facts["form"], own.default)
            if value is not None:
                _require(table, own.name, value, facts)
            values[own.name] = value
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Give the keys that are set."""
        every = {own.name: getattr(self, own.name) for own in dataclasses.fields(self)}  # type: ignore[arg-type]
        return {name: value for name, value in every.items() if value is not None and value != {}}


def _bounds(table: TomlTable) -> dict[str, tuple[float, ...]]:
    """Take bounds of inputs, and behind them the step in which one is set."""
    items = table.items()
    for name, value in items.items():
        stepped = isinstance(value, list) and len(value) == 3
        form = "[lower, upper] or [lower, upper, step], numbers"
        low, high = _pair(table, name, value[:2] if stepped else value, form)
        if stepped and not (fits(value[2], "number") and 0.0 < value[2] <= high - low):
            raise table.error(name, value, f"{form}, with a step > 0 that is at most upper - lower")
        if not -math.inf < low < high < math.inf:
            raise table.error(name, value, "lower < upper, both finite")
        if name.endswith("_cad") and not -60.0 <= low < high <= 60.0:
            raise table.error(name, value, "lower < upper, in [-60, 60]")
    return {name: tuple(map(float, value)) for name, value in items.items()} or dict(_BOUNDS_CAD)


def _limits(table: TomlTable) -> dict[str, Any]:
    """Take upper values, and pairs of a lower and an upper one, of which one may be infinite."""
    items, form = table.items(), "a finite number, or [lower, upper], one of which may be -inf or inf"
    for name, value in items.items():
        if fits(value, "number"):
            if not math.isfinite(value):
                raise table.error(name, value, form)
            continue
        low, high = _pair(table, name, value, form)
        if not low < high or (math.isinf(low) and math.isinf(high)):
            raise table.error(name, value, f"lower < upper: {form}")
    return {name: [float(one) for one in value] if isinstance(value, list) else value for name, value in items.items()}


def _pair(table: TomlTable, name: str, value: Any, form: str) -> tuple[float, float]:
    if not (isinstance(value, list) and len(value) == 2 and all(fits(one, "number") for one in value)):
        raise table.error(name, value, form)
    return float(value[0]), float(value[1])


def _numbers(table: TomlTable) -> dict[str, float]:
    items = table.items()
    for name, value in items.items():
        if not (fits(value, "number") and math.isfinite(value)):
            raise table.error(name, value, "a finite number")
    return {name: float(value) for name, value in items.items()}


def _axes(table: TomlTable) -> dict[str, list[float]]:
    """Take entries of the axes of a map; how many and their order is asked where the search is made."""
    items = table.items()
    for name, value in items.items():
        if not (fits(value, "numbers") and value):
            raise table.error(name, value, "a list of numbers, for example [1000, 1500, 2000]")
    return {name: [float(one) for one in value] for name, value in items.items()}


_TABLES = {"axes": _axes, "scales": _numbers, "bounds": _bounds, "limits": _limits, "any": TomlTable.items}


def _require(table: TomlTable, name: str, value: Any, facts: Mapping[str, Any]) -> None:
    among, low, high = facts["among"], facts["low"], facts["high"]
    if among is not None and value not in among:
        raise table.error(name, value, hinted(f"one of {', '.join(among)}", str(value), among))
    if facts["form"] in ("number", "integer"):
        bounds = f"in [{-math.inf if low is None else low:g}, {math.inf if high is None else high:g}]"
        if not math.isfinite(value) or (low is not None and value < low) or (high is not None and value > high):
            raise table.error(name, value, "finite" if low is None and high is None else bounds)


@dataclass(frozen=True, kw_only=True)
class ThrottlePlant(Settings):
    """The throttle of ``simulate``, and of the node that ``hil`` starts."""

    preset: str = _key("text", "P1")
    scale: Mapping[str, float] = _key("scales", {})
    noise_deg: float = _key("number", 0.03, low=0.0, high=10.0)
    sample_s: float | None = _key("number", low=1e-4, high=0.02)


@dataclass(frozen=True, kw_only=True)
class EnginePlant(Settings):
    """The engine of ``simulate``, and of the node that ``hil`` starts."""

    preset: str = _key("text", "puma_single")
    scale: Mapping[str, float] = _key("scales", {})
    soc_scatter_cad: float = _key("number", 0.3, low=0.0, high=10.0)
    efficiency_noise_percent: float = _key("number", 0.25, low=0.0, high=10.0)


@dataclass(frozen=True, kw_only=True)
class BusSettings(Settings):
    """The bus of ``hil``, ``dry_run`` and ``bench``; without `connection`, ``hil`` starts a hub and a node itself."""

    map: str | None = _key("text")
    connection: str | None = _key("text")
    pace: str = _key("text", "step", among=PACES)
    timeout_ms: float | None = _key("number", low=1.0, high=60_000.0)


@dataclass(frozen=True, kw_only=True)
class SafetySettings(Settings):
    """What stands between controller or seeker and the plant."""

    envelope: str = _key("text", "etb")
    rate_cad: float = _key("number", 5.0, low=1e-3)
    rates: Mapping[str, float] = _key("scales", {})
    limits: Mapping[str, float] = _key("scales", {})


@dataclass(frozen=True, kw_only=True)
class ReplaySettings(Settings):
    """What ``replay`` reads."""

    record: str | None = _key("text")


@dataclass(frozen=True, kw_only=True)
class IdentifyTask(Settings):
    """Excite a throttle, record it, fit a model."""

    excitation: str = _key("text", "chirp", among=EXCITATIONS)
    side: str = _key("text", "above", among=("above", "below", "both"))
    duration_s: float | None = _key("number", low=0.5, high=600.0)
    prior: str = _key("text", "P1")
    model: str = _key("text", "auto", among=CHOICES)


@dataclass(frozen=True, kw_only=True)
class TrackTask(Settings):
    """Run a controller along a reference."""

    reference: str = _key("text", "step:40:42")
    controller: str = _key("text", "guided", among=tuple(FAMILIES))
    model: str = _key("text", "P1")
    delay_samples: int | None = _key("integer", low=0, high=20)
    loop: str = _key("text", "auto", among=LOOPS)


@dataclass(frozen=True, kw_only=True)
class SeekTask(Settings):
    """Let `mgdd.loop.seek` find the best start of combustion."""

    seeker: str = _key("text", "auto", among=("auto", *SEEKERS))
    guide: str = _key("text", "none", among=("none", *KINDS))
    model: str = _key("text", "puma_single")
    scale: Mapping[str, float] = _key("scales", {})
    inputs: Mapping[str, tuple[float, ...]] = field(
        default_factory=lambda: dict(_BOUNDS_CAD), metadata={"form": "bounds"}
    )
    start: Mapping[str, float] = _key("scales", {})
    cycles: int | None = _key("integer", low=1, high=2_000_000)
    tolerance: Mapping[str, float] = _key("scales", {})
    noise_sd: float | None = _key("number", low=0.0)
    delay_cycles: float | None = _key("number", low=0.0)
    lag_cycles: float | None = _key("number", low=0.0)
    limits: Mapping[str, Any] = _key("limits", {})
    settings: Mapping[str, Any] = _key("any", {})
    known: str | None = _key("text")


@dataclass(frozen=True, kw_only=True)
class MapTask(Settings):
    """Let `mgdd.loop.seek_map` seek a map."""

    guide: str = _key("text", "none", among=("none", "model"))
    model: str = _key("text", "puma_single")
    scale: Mapping[str, float] = _key("scales", {})
    axes: Mapping[str, list[float]] = _key("axes", {})
    inputs: Mapping[str, tuple[float, ...]] = field(
        default_factory=lambda: dict(_BOUNDS_CAD), metadata={"form": "bounds"}
    )
    start: Mapping[str, float] = _key("scales", {})
    limits: Mapping[str, Any] = _key("limits", {})
    visits: int = _key("integer", 32, low=1, high=10_000)
    tolerance: float | None = _key("number", low=0.0)
    averaged: int | None = _key("integer", low=1, high=10_000)
    settling: int | None = _key("integer", low=0, high=10_000)
    smoothness: float = _key("number", 0.0, low=0.0)
    settings: Mapping[str, Any] = _key("any", {})


def beside(folder: Path, name: str) -> Path | str:
    """Return the file of that name beside an experiment; where there is none, the name."""
    path = folder / name
    return path if path.is_file() else name


def scaled(record: _T, scale: Mapping[str, float], what: str) -> _T:
    """Multiply fields of a record; friction takes stiction along, as `mgdd throttle track --plant-scale` does."""
    fields = type(record).fields()  # type: ignore[attr-defined]
    factors = dict(scale)
    for name in factors:
        if name not in fields or not isinstance(getattr(record, name), float):
            raise ParameterError.of(f"{what}.scale", name, f"a number of {type(record).__name__}: {', '.join(fields)}")
    if "coulomb_nm" in factors:
        factors.setdefault("stiction_nm", factors["coulomb_nm"])
    changed = {name: getattr(record, name) * factor for name, factor in factors.items()}
    try:
        return record.replace(**changed)  # type: ignore[attr-defined,no-any-return]
    except ParameterError as error:
        raise error.reworded(f"{what}.scale: {error}") from error
