"""The preset record of an engine or a throttle, its TOML form and the place where shipped ones live."""

from __future__ import annotations

import difflib
import json
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from mgdd._core import Cylinder, OperatingPoint, Throttle
from mgdd.errors import DataError, ParameterError

__all__ = ["Preset", "available", "load"]

_TABLES: Mapping[str, Any] = MappingProxyType({"cylinder": Cylinder, "point": OperatingPoint, "throttle": Throttle})
_OF_KIND: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"engine": ("cylinder", "point"), "throttle": ("throttle",)},
)
# What a file of one's own must say, by kind, in the first table of the kind: nobody's parts have a default.
_REQUIRED: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "engine": ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad"),
        "throttle": (
            "inertia_kgm2",
            "torque_constant_nm_per_a",
            "resistance_ohm",
            "coulomb_nm",
            "limp_home_deg",
            "spring_above_nm_per_rad",
            "spring_below_nm_per_rad",
            "preload_above_nm",
            "preload_below_nm",
        ),
    }
)
_MISSING = MappingProxyType({"engine": "an engine's geometry has no default", "throttle": "a motor has no default"})


@dataclass(frozen=True, init=False)
class Preset:
    """A named engine (cylinder and nominal operating point) or a named throttle, with the origin of every value.

    Parameters
    ----------
    name : str
        Short name, as the command line takes it.
    title : str
        What it is and how far the values can be trusted.
    cylinder : mgdd.engine.Cylinder, optional
        Of an engine.
    point : mgdd.engine.OperatingPoint, optional
        Nominal operating point of an engine; the default one if left out.
    throttle : mgdd.throttle.Throttle, optional
        Of a throttle; without cylinder and point.
    sources : mapping of str to str
        Origin of each value, by ``table.field``, for example ``cylinder.bore_mm``.

    Raises
    ------
    ParameterError
        Neither engine nor throttle, or both.

    Examples
    --------
    >>> from mgdd import presets
    >>> preset = presets.load("puma_single")
    >>> preset.cylinder.bore_mm, preset.point.speed_rpm
    (86.0, 1500.0)
    >>> presets.load("P1").throttle.limp_home_deg
    8.0
    """

    name: str
    title: str
    records: Mapping[str, Cylinder | OperatingPoint | Throttle]
    sources: Mapping[str, str]

    def __init__(
        self,
        *,
        name: str,
        title: str,
        cylinder: Cylinder | None = None,
        point: OperatingPoint | None = None,
        throttle: Throttle | None = None,
        sources: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        engine = cylinder is not None or point is not None
        if engine == (throttle is not None) or (engine and cylinder is None):
            raise ParameterError(f"preset {name!r}: give a cylinder (and its point), or a throttle")
        records: dict[str, Cylinder | OperatingPoint | Throttle] = {}
        if cylinder is not None:
            records = {"cylinder": cylinder, "point": OperatingPoint() if point is None else point}
        if throttle is not None:
            records = {"throttle": throttle}
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "title", title)
        object.__setattr__(self, "records", MappingProxyType(records))
        object.__setattr__(self, "sources", MappingProxyType(dict(sources)))

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.name, self.title, dict(self.records), dict(self.sources))

    @property
    def kind(self) -> str:
        """``"engine"`` or ``"throttle"``."""
        return "throttle" if "throttle" in self.records else "engine"

    @property
    def cylinder(self) -> Cylinder:
        """The cylinder of an engine; ParameterError if this is a throttle."""
        return cast("Cylinder", self._record("cylinder"))

    @property
    def point(self) -> OperatingPoint:
        """The nominal operating point of an engine; ParameterError if this is a throttle."""
        return cast("OperatingPoint", self._record("point"))

    @property
    def throttle(self) -> Throttle:
        """The throttle; ParameterError if this is an engine."""
        return cast("Throttle", self._record("throttle"))

    def _record(self, table: str) -> Cylinder | OperatingPoint | Throttle:
        if table not in self.records:
            wanted = "throttle" if table == "throttle" else "engine"
            raise ParameterError(_wrong_kind(self.name, self.kind, wanted))
        return self.records[table]

    def to_toml(self) -> str:
        """Write the preset as TOML that `load` reads back equal.

        Returns
        -------
        str
            One line per value: ``bore_mm = { value = 86.0, unit = "mm", source = "..." }``.

        Examples
        --------
        >>> from mgdd import presets
        >>> "bore_mm" in presets.load("puma_single").to_toml()
        True
        """
        lines = [f"name = {_quote(self.name)}", f"title = {_quote(self.title)}"]
        for table, record in self.records.items():
            lines += ["", f"[{table}]"]
            units = type(record).fields()
            for key, value in record.to_dict().items():
                if value is None:
                    continue
                text = _quote(value) if isinstance(value, str) else repr(float(value))
                source = self.sources.get(f"{table}.{key}", "unstated")
                lines.append(
                    f"{key} = {{ value = {text}, unit = {_quote(units[key]['unit'])}, source = {_quote(source)} }}"
                )
        return "\n".join(lines) + "\n"


def _unpickled(name: str, title: str, records: Mapping[str, Any], sources: Mapping[str, str]) -> Preset:
    return Preset(name=name, title=title, sources=sources, **records)


def available(kind: str | None = None) -> tuple[str, ...]:
    """Name the shipped presets.

    Parameters
    ----------
    kind : {"engine", "throttle"}, optional
        Of one kind only.

    Returns
    -------
    tuple of str
        Names that `load` takes.

    Raises
    ------
    ParameterError
        No such kind.

    Examples
    --------
    >>> from mgdd import presets
    >>> presets.available("engine")
    ('hd_diesel_128x144', 'puma_single')
    >>> presets.available("throttle")
    ('P1', 'P2', 'P3')
    """
    _check_kind(kind)
    files = [entry for entry in resources.files("mgdd.presets").iterdir() if entry.name.endswith(".toml")]
    if kind is not None:
        head = f"[{_OF_KIND[kind][0]}]"
        files = [entry for entry in files if head in entry.read_text(encoding="utf-8").splitlines()]
    return tuple(sorted(entry.name[:-5] for entry in files))


def load(name: str | os.PathLike[str], *, kind: str | None = None) -> Preset:
    """Load a preset by name, or from a TOML file of your own.

    Parameters
    ----------
    name : str or path-like
        A shipped name, or a path that ends in ``.toml``. The file of an engine must give bore, stroke, rod, compression
        ratio, IVC and EVO, that of a throttle its inertia, motor, friction, springs and limp-home; other fields that
        it leaves out keep the default of `mgdd.engine.Cylinder`, `mgdd.engine.OperatingPoint` and
        `mgdd.throttle.Throttle`.
    kind : {"engine", "throttle"}, optional
        Refuse the other kind.

    Returns
    -------
    Preset
        The validated preset.

    Raises
    ------
    ParameterError
        An unknown name or field, a wrong unit, a value outside its domain, a preset of the other kind.
    DataError
        A file that is not TOML or lacks its tables.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> from mgdd import presets
    >>> presets.load("hd_diesel_128x144").cylinder.compression_ratio
    20.3
    """
    _check_kind(kind)
    text = os.fspath(name)
    preset = _load(text, kind)
    if kind is not None and preset.kind != kind:
        raise ParameterError(_wrong_kind(text, preset.kind, kind))
    return preset


def _load(text: str, kind: str | None) -> Preset:
    if text.endswith(".toml"):
        try:
            return _parse(Path(text).read_text(encoding="utf-8"), source=text)
        except FileNotFoundError as error:
            raise FileNotFoundError(
                error.errno, f"no preset file {text!r}; shipped are {', '.join(available(kind))}"
            ) from None
        except UnicodeDecodeError as error:
            raise DataError(f"{text}: not a UTF-8 text file: {error}") from error
    if text not in available():
        close = difflib.get_close_matches(text, available(kind), 1)
        hint = f"did you mean {close[0]!r}?" if close else "or pass a path that ends in .toml"
        raise ParameterError(f"no preset {text!r}: shipped are {', '.join(available(kind))}; {hint}")
    file = resources.files("mgdd.presets").joinpath(f"{text}.toml")
    return _parse(file.read_text(encoding="utf-8"), source=f"preset {text}")


def _check_kind(kind: str | None) -> None:
    if kind is not None and kind not in _OF_KIND:
        raise ParameterError(f"kind = {kind!r}: must be one of {', '.join(_OF_KIND)}")


def _wrong_kind(name: str, kind: str, wanted: str) -> str:
    article = {"engine": "an engine", "throttle": "a throttle"}
    return (
        f"preset {name!r} is {article[kind]}, not {article[wanted]}: shipped {wanted}s are "
        f"{', '.join(available(wanted))}"
    )


def _parse(text: str, *, source: str) -> Preset:
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{source}: not valid TOML: {error}") from error
    unknown = set(data) - {"name", "title", *_TABLES}
    if unknown:
        raise ParameterError(
            f"{source}: unknown key {min(unknown)!r}: a preset has name, title, and [cylinder] and [point], "
            "or [throttle]"
        )
    kind = "throttle" if "throttle" in data else "engine"
    tables, required = _OF_KIND[kind], _REQUIRED[kind]
    first = tables[0]
    foreign = [table for table in _TABLES if table in data and table not in tables]
    if foreign:
        raise ParameterError(
            f"{source}: [{foreign[0]}] beside [{first}]: a preset is an engine or a throttle, not both"
        )
    if first not in data:
        raise DataError(f"{source}: no table [{first}]: it needs at least {', '.join(required)}")
    sources: dict[str, str] = {}
    records = {table: _record(table, data.get(table, {}), source=source, sources=sources) for table in tables}
    missing = [name for name in required if name not in data[first]]
    if missing:
        raise DataError(f"{source}: [{first}] lacks {', '.join(missing)}: {_MISSING[kind]}")
    name = data.get("name", Path(source).stem)
    return Preset(name=str(name), title=str(data.get("title", name)), sources=MappingProxyType(sources), **records)


def _record(table: str, entries: Any, *, source: str, sources: dict[str, str]) -> Any:
    kind = _TABLES[table]
    fields = kind.fields()
    if not isinstance(entries, dict):
        raise DataError(f"{source}: [{table}] must be a table")
    values: dict[str, Any] = {}
    for key, entry in entries.items():
        where = f"{source}: [{table}] {key}"
        if key not in fields:
            close = difflib.get_close_matches(key, fields, 1)
            hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(fields)}"
            raise ParameterError(f"{where}: unknown key: {hint}")
        if not isinstance(entry, dict) or "value" not in entry or not set(entry) <= {"value", "unit", "source"}:
            raise ParameterError(f'{where}: write {{ value = ..., unit = "{fields[key]["unit"]}", source = "..." }}')
        unit = entry.get("unit")
        if unit != fields[key]["unit"]:
            raise ParameterError(
                f"{where}: unit = {unit!r}: must be {fields[key]['unit']!r}; convert the value, "
                "units stand in the names"
            )
        values[key] = entry["value"]
        if "source" in entry:
            sources[f"{table}.{key}"] = str(entry["source"])
    try:
        return kind().replace(**values)
    except ParameterError as error:
        raise ParameterError(f"{source}: [{table}] {error}") from error


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
