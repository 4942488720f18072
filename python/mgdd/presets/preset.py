"""The preset record of an engine or a throttle, its TOML form and the place where shipped ones live."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd._core.throttle import Throttle
from mgdd._settings import remade
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.io.parameters import Entry, ParameterFile, Parameters, Wanted
from mgdd.results.describe import core_rows, described

_TABLES: Mapping[str, Any] = MappingProxyType({"cylinder": Cylinder, "point": OperatingPoint, "throttle": Throttle})
_OF_KIND: Mapping[str, tuple[str, ...]] = MappingProxyType({"engine": ("cylinder", "point"), "throttle": ("throttle",)})
# What a user's file must state, by kind, in the first table of the kind: nobody's parts have a default.
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
class Preset(Parameters):
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
        own = {"name": self.name, "title": self.title, "sources": dict(self.sources), **self.records}
        return remade, (Preset, (), own, {})

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
            kind = "throttle" if table == "throttle" else "engine"
            raise ParameterError(_wrong_kind(self.name, self.kind, kind))
        return self.records[table]

    def to_parameters(self) -> ParameterFile:
        """Give the values with units and sources, as `to_toml` writes them and `load` reads them back."""
        tables: dict[str, dict[str, Entry]] = {}
        for table, record in self.records.items():
            units = type(record).fields()
            tables[table] = {
                key: Entry(value=value, unit=units[key]["unit"], source=self.sources.get(f"{table}.{key}", "unstated"))
                for key, value in record.to_dict().items()
                if value is not None
            }
        return ParameterFile(kind=self.kind, tables=tables, notes={"name": self.name, "title": self.title})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> Preset:
        """Make the preset of a file; what is missing and has a default keeps it."""
        if file.kind not in _OF_KIND:
            kinds = " or ".join(map(repr, _OF_KIND))
            hint = "mgdd.identify.load_throttle_model reads a fit of a throttle"
            raise DataError(f"{file.origin}: kind = {file.kind!r}: must be {kinds}; {hint}")
        tables = _OF_KIND[file.kind]
        file.expect(
            kinds=tuple(_OF_KIND), tables=(*tables[:1], *(f"{t}?" for t in tables[1:])), notes=("name", "title")
        )
        sources: dict[str, str] = {}
        records = {table: _record(file, table, sources) for table in tables}
        required = _REQUIRED[file.kind]
        missing = [name for name in required if name not in file.tables[tables[0]]]
        if missing:
            raise DataError(f"{file.origin}: [{tables[0]}] lacks {', '.join(missing)}: {_MISSING[file.kind]}")
        name = str(file.notes.get("name", Path(file.origin).stem))
        return cls(name=name, title=str(file.notes.get("title", name)), sources=MappingProxyType(sources), **records)


described(
    Preset,
    title=lambda preset: f"Preset {preset.name}, {preset.kind}: {preset.title}",
    rows=lambda preset: [row for record in preset.records.values() for row in core_rows(record)],
)


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
        head = f'kind = "{kind}"'
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
        A file that is not TOML, or lacks its kind, its format version, its tables or a field without default.
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
            return Preset.of_file(ParameterFile.read(text))
        except FileNotFoundError as error:
            hint = str(error.strerror).removeprefix("no such file: ")
            raise FileNotFoundError(
                error.errno, f"no preset file {text!r}: {hint}; shipped are {', '.join(available(kind))}"
            ) from None
    if (shipped := _shipped(text)) is None:
        longer = next((f"did you mean {name!r}?" for name in available(kind) if text and text in name), "")
        hint = did_you_mean(text, available(kind)) or longer or "or pass a path that ends in .toml"
        raise ParameterError(f"no preset {text!r}: shipped are {', '.join(available(kind))}; {hint}")
    return shipped


@lru_cache(maxsize=64)  # a preset cannot be changed, so that all who ask share one
def _shipped(name: str) -> Preset | None:
    if name not in available():
        return None
    file = resources.files("mgdd.presets").joinpath(f"{name}.toml")
    return Preset.from_toml(file.read_text(encoding="utf-8"), origin=f"preset {name}")


def _check_kind(kind: str | None) -> None:
    ParameterError.unless(kind is None or kind in _OF_KIND, "kind", kind, f"one of {', '.join(_OF_KIND)}")


def _wrong_kind(name: str, kind: str, needed: str) -> str:
    article = {"engine": "an engine", "throttle": "a throttle"}
    return (
        f"preset {name!r} is {article[kind]}, not {article[needed]}: shipped {needed}s are "
        f"{', '.join(available(needed))}"
    )


def _record(file: ParameterFile, table: str, sources: dict[str, str]) -> Any:
    kind = _TABLES[table]
    fields = kind.fields()
    keys = {
        key: Wanted(info["unit"], "text" if "choices" in info else "number", required=False)
        for key, info in fields.items()
    }
    values = file.values(table, keys)
    entries = file.tables.get(table, {})
    sources.update({f"{table}.{key}": entry.source for key, entry in entries.items() if entry.source is not None})
    return kind().replace(**values)
