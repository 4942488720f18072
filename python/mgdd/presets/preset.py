"""The preset record, its TOML form and the place where shipped ones live."""

from __future__ import annotations

import difflib
import json
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mgdd._core import Cylinder, OperatingPoint
from mgdd.errors import DataError, ParameterError

__all__ = ["Preset", "available", "load"]

_REQUIRED = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
_TABLES: Mapping[str, Any] = MappingProxyType({"cylinder": Cylinder, "point": OperatingPoint})


@dataclass(frozen=True, kw_only=True)
class Preset:
    """A named engine: cylinder and nominal operating point, with the origin of every value.

    Parameters
    ----------
    name : str
        Short name, as the command line takes it.
    title : str
        What the engine is and how far the values can be trusted.
    cylinder : mgdd.engine.Cylinder
        Its cylinder.
    point : mgdd.engine.OperatingPoint
        Its nominal operating point.
    sources : mapping of str to str
        Origin of each value, by ``table.field``, for example ``cylinder.bore_mm``.

    Examples
    --------
    >>> from mgdd import presets
    >>> preset = presets.load("puma_single")
    >>> preset.cylinder.bore_mm, preset.point.speed_rpm
    (86.0, 1500.0)
    """

    name: str
    title: str
    cylinder: Cylinder
    point: OperatingPoint
    sources: Mapping[str, str] = field(default_factory=dict)

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
        for table, record in (("cylinder", self.cylinder), ("point", self.point)):
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


def available() -> tuple[str, ...]:
    """Name the shipped presets.

    Returns
    -------
    tuple of str
        Names that `load` takes.

    Examples
    --------
    >>> from mgdd import presets
    >>> presets.available()
    ('hd_diesel_128x144', 'puma_single')
    """
    folder = resources.files("mgdd.presets")
    return tuple(sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml")))


def load(name: str | os.PathLike[str]) -> Preset:
    """Load a preset by name, or from a TOML file of your own.

    Parameters
    ----------
    name : str or path-like
        A shipped name, or a path that ends in ``.toml``. A file must give bore, stroke, rod, compression ratio, IVC
        and EVO; other fields that it leaves out keep the default of `mgdd.engine.Cylinder` and
        `mgdd.engine.OperatingPoint`.

    Returns
    -------
    Preset
        The validated preset.

    Raises
    ------
    ParameterError
        An unknown name or field, a wrong unit, a value outside its domain.
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
    text = os.fspath(name)
    if text.endswith(".toml"):
        try:
            return _parse(Path(text).read_text(encoding="utf-8"), source=text)
        except FileNotFoundError as error:
            raise FileNotFoundError(
                error.errno, f"no preset file {text!r}; shipped are {', '.join(available())}"
            ) from None
        except UnicodeDecodeError as error:
            raise DataError(f"{text}: not a UTF-8 text file: {error}") from error
    if text not in available():
        close = difflib.get_close_matches(text, available(), 1)
        hint = f"did you mean {close[0]!r}?" if close else "or pass a path that ends in .toml"
        raise ParameterError(f"no preset {text!r}: shipped are {', '.join(available())}; {hint}")
    file = resources.files("mgdd.presets").joinpath(f"{text}.toml")
    return _parse(file.read_text(encoding="utf-8"), source=f"preset {text}")


def _parse(text: str, *, source: str) -> Preset:
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{source}: not valid TOML: {error}") from error
    unknown = set(data) - {"name", "title", *_TABLES}
    if unknown:
        raise ParameterError(
            f"{source}: unknown key {min(unknown)!r}: a preset has name, title, [cylinder] and [point]"
        )
    if "cylinder" not in data:
        raise DataError(f"{source}: no table [cylinder]: it needs at least {', '.join(_REQUIRED)}")
    sources: dict[str, str] = {}
    records = {table: _record(table, data.get(table, {}), source=source, sources=sources) for table in _TABLES}
    missing = [name for name in _REQUIRED if name not in data["cylinder"]]
    if missing:
        raise DataError(f"{source}: [cylinder] lacks {', '.join(missing)}: an engine's geometry has no default")
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
