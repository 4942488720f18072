"""Parameter files: TOML that says its kind and format version, and every value with its unit.

The one reader and writer of such files. It knows mappings only; presets, models and settings turn themselves into a
`ParameterFile` and back.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from mgdd.errors import DataError, Error, ParameterError, did_you_mean
from mgdd.io.files import parsed, read_plain_text, write_whole_text
from mgdd.results.units import unit_of

FORMAT = 1
FIT_NOTES = ("source", "unidentifiable")  # what a fit says beside its model, in a table [fit] too
_HEAD = ("kind", "format")
_PARTS = ("value", "unit", "stderr", "source")
Form = Literal["number", "integer", "flag", "text", "numbers", "texts"]
FORMS = {
    "number": "a number",
    "integer": "a whole number",
    "flag": "true or false",
    "text": "text in quotes",
    "numbers": "a list of numbers",
    "texts": "a list of texts in quotes",
}


class Wanted(NamedTuple):
    """What a reader expects of one key; the form ``numbers`` is a list of numbers, or a list of such lists."""

    unit: str = "-"
    form: Form = "number"
    required: bool = True


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One value of a parameter file, with its unit: ``"-"`` if dimensionless, None where the file does not say it.

    Its standard error is in the same unit; the source says where it comes from.
    """

    value: Any
    unit: str | None = "-"
    stderr: float | None = None
    source: str | None = None


def entries(values: Mapping[str, Any], units: Mapping[str, str] = MappingProxyType({})) -> dict[str, Entry]:
    """Make the entries of a table: units as given, else as the names end."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray | np.generic):
            return value.tolist()
        return list(value) if isinstance(value, tuple) else value

    return {name: Entry(value=plain(value), unit=units.get(name, unit_of(name))) for name, value in values.items()}


def written(values: Mapping[str, Any], wanted: Mapping[str, Wanted]) -> dict[str, Entry]:
    """Make the entries of a table that `ParameterFile.values` takes with the same `wanted`."""
    cast: dict[str, Callable[[Any], Any]] = {"number": float, "integer": int, "flag": bool, "texts": list}
    cast["numbers"] = lambda rows: np.asarray(rows, dtype=np.float64).tolist()
    return {name: Entry(value=cast.get(form, str)(values[name]), unit=unit) for name, (unit, form, _) in wanted.items()}


def wanted(
    names: Iterable[str], units: Mapping[str, str] = MappingProxyType({}), form: Form = "number"
) -> dict[str, Wanted]:
    """Ask for keys of one form, all required: units as given, else as the names end."""
    return {name: Wanted(units.get(name, unit_of(name)), form) for name in names}


def _entry_of(entry: Any) -> Entry:
    """Take an entry as it stands; what is not one has no unit, which `ParameterFile.values` refuses."""
    if not isinstance(entry, dict) or "value" not in entry or not set(entry) <= set(_PARTS):
        return Entry(value=entry, unit=None)
    return Entry(**{"unit": None, **entry})


def fits(value: Any, form: str) -> bool:
    """Return whether a value is of a form."""
    if form == "numbers":
        rows = value if isinstance(value, list) else [None]
        return all(fits(row, "numbers" if isinstance(row, list) else "number") for row in rows)
    if form == "texts":
        return isinstance(value, list) and all(isinstance(item, str) for item in value)
    if form in ("number", "integer"):
        types: tuple[type, ...] = (int, float) if form == "number" else (int,)
        return isinstance(value, types) and not isinstance(value, bool)
    return isinstance(value, bool if form == "flag" else str)


def _key_line(key: str, value: Any) -> str:
    """Write ``key = value`` on one line; lists of lists get a line per row."""
    import tomli_w

    # Strings escape their line breaks, so those left belong to lists.
    text = re.sub(r",\n\s*\]", "]", tomli_w.dumps({key: value}).rstrip("\n"))
    text = re.sub(r"\[\n\s*", "[", text)
    text = re.sub(r",\n\s*", ", ", text)
    rows = isinstance(value, list) and any(isinstance(row, list) for row in value)
    return text.replace("], [", "],\n  [") if rows else text


def _quoted(name: str) -> str:
    """Quote a key where TOML needs it."""
    return _key_line(name, 0).removesuffix(" = 0")


@dataclass(frozen=True, kw_only=True)
class ParameterFile:
    """Content of a parameter file.

    Parameters
    ----------
    kind : str
        What the parameters belong to, for example ``engine``, ``pw_r`` or ``first_principle``.
    tables : mapping of str to mapping of str to Entry
        The values by table and key.
    notes : mapping of str to str, number or list
        Notes on them: ``name``, ``title``, ``source``, ...
    origin : str
        The file, for messages; not compared.
    """

    kind: str
    tables: Mapping[str, Mapping[str, Entry]]
    notes: Mapping[str, Any] = field(default_factory=dict)
    origin: str = field(default="text", compare=False)

    def with_fit(
        self,
        *,
        stderr: Mapping[str, float],
        figures: Mapping[str, tuple[float, str]],
        source: str,
        unidentifiable: Collection[str],
    ) -> Self:
        """Give the same parameters with what a fit says of them: standard errors, and figures in a table ``fit``.

        Both sides of a throttle may share a standard error, named without the side; each figure has its unit;
        `unidentifiable` are names that the record did not determine.
        """
        parameters = dict(self.tables["parameters"])
        for name, entry in parameters.items():
            own = name if name in stderr else name.removeprefix("above_").removeprefix("below_")
            if own in stderr and np.isfinite(stderr[own]):
                parameters[name] = replace(entry, stderr=float(stderr[own]))
        fit = {name: Entry(value=float(value), unit=unit) for name, (value, unit) in figures.items()}
        return replace(
            self,
            tables={**self.tables, "parameters": parameters, "fit": fit},
            notes={**self.notes, "source": source, "unidentifiable": list(unidentifiable)},
        )

    def to_toml(self) -> str:
        """Write TOML with one line per value; numbers come back bit for bit."""
        out = [_key_line("kind", self.kind), _key_line("format", FORMAT)]
        out += [_key_line(name, value) for name, value in self.notes.items()]
        for table, values in self.tables.items():
            out += ["", f"[{_quoted(table)}]"]
            for key, entry in values.items():
                fields = {part: getattr(entry, part) for part in _PARTS}
                parts = ", ".join(_key_line(part, value) for part, value in fields.items() if value is not None)
                out.append(f"{_quoted(key)} = {{ {parts} }}")
        return "\n".join(out) + "\n"

    @classmethod
    def from_toml(cls, text: str, *, origin: str = "text") -> ParameterFile:
        """Read what `to_toml` wrote, or what a person wrote in its form."""
        data = parsed(text, origin, "TOML")
        kind, version = data.get("kind"), data.get("format")
        if not isinstance(kind, str):
            raise DataError(f'{origin}: kind = {kind!r}: say what the file holds, for example kind = "engine"')
        if version != FORMAT or isinstance(version, bool):
            raise DataError(
                f"{origin}: format = {version!r}: this version of mgdd reads format = {FORMAT}; write that line if "
                "the file follows the page Formats, or update mgdd"
            )
        tables = {
            name: {key: _entry_of(entry) for key, entry in table.items()}
            for name, table in data.items()
            if isinstance(table, dict)
        }
        notes = {name: value for name, value in data.items() if name not in tables and name not in _HEAD}
        return cls(kind=kind, tables=tables, notes=notes, origin=origin)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ParameterFile:
        """Read a file; FileNotFoundError or DataError name it."""
        return cls.from_toml(read_plain_text(path, only_utf8=True), origin=str(path))

    def expect(self, *, kinds: Collection[str], tables: Collection[str], notes: Collection[str] = ("source",)) -> None:
        """Refuse another kind or a missing table (DataError), and an unknown table or note (ParameterError).

        A table that ends in ``?`` may be missing, and so may all notes.
        """
        if self.kind not in kinds:
            raise DataError(f"{self.origin}: kind = {self.kind!r}: must be {' or '.join(map(repr, kinds))}")
        names = [table.removesuffix("?") for table in tables]
        odd = [name for name in self.tables if name not in names] + [name for name in self.notes if name not in notes]
        if odd:
            hint = _near(odd[0], [*(f"[{table}]" for table in names), *notes])
            raise ParameterError(f"{self.origin}: unknown key {odd[0]!r}: {hint}")
        for table in tables:
            if table == table.removesuffix("?") and table not in self.tables:
                raise DataError(f"{self.origin}: no table [{table}]: a file of kind {self.kind!r} has one")

    def values(self, table: str, wanted: Mapping[str, Wanted]) -> dict[str, Any]:
        """Take the values of a table, none of one that may be missing: numbers as float, lists as they stand."""
        rows = self.tables.get(table, {})
        out = {}
        for key, entry in rows.items():
            where = f"{self.origin}: [{table}] {key}"
            if key not in wanted:
                raise ParameterError(f"{where}: unknown key: {_near(key, wanted)}")
            unit, form = wanted[key].unit, wanted[key].form
            if entry.unit is None:
                raise ParameterError(f"{where}: unit = None: must be {unit!r}; write {_example(key, unit)}")
            if entry.unit != unit:
                raise ParameterError(
                    f"{where}: unit = {entry.unit!r}: must be {unit!r}; convert the value, units stand in the names"
                )
            for part, value, need in (
                ("value", entry.value, form), ("stderr", entry.stderr, "number"), ("source", entry.source, "text"),
            ):  # fmt: skip
                if not (fits(value, need) or (part != "value" and value is None)):
                    raise ParameterError(f"{where}: {part} = {_short(value)}: must be {FORMS[need]}")
            out[key] = float(entry.value) if form == "number" else entry.value
        missing = [key for key, want in wanted.items() if want.required and key not in rows]
        if missing:
            example = _example(missing[0], wanted[missing[0]].unit)
            raise DataError(f"{self.origin}: [{table}] lacks {', '.join(missing)}: write {example}")
        return out


class Parameters:
    """Base of every class that a parameter file can hold: `to_toml` and `from_toml`, exact both ways."""

    def to_parameters(self) -> ParameterFile:
        """Give everything that changes a result."""
        raise NotImplementedError(f"{type(self).__name__}.to_parameters")

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> Self:
        """Make the object of a file of its kind."""
        raise NotImplementedError(f"{cls.__name__}.from_parameters")

    def to_toml(self) -> str:
        """Write TOML that `from_toml` reads back equal, each value with its unit.

        Returns
        -------
        str
            The text of a parameter file.
        """
        return self.to_parameters().to_toml()

    @classmethod
    def from_toml(cls, text: str, *, origin: str = "text") -> Self:
        """Read what `to_toml` wrote.

        Parameters
        ----------
        text : str
            The text of a parameter file.
        origin : str
            Name for the messages, for example the file.

        Returns
        -------
        object
            Equal to the one that was written.

        Raises
        ------
        DataError
            Not TOML, another kind or format version, a missing table or key.
        ParameterError
            An unknown key, another unit, a wrong type, a value outside its domain.
        """
        return cls.of_file(ParameterFile.from_toml(text, origin=origin))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `to_toml` to a file that `load` reads; it is replaced in one step."""
        write_whole_text(path, self.to_toml())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file that `save` wrote, or a fit; the errors of `from_toml` name the file."""
        return cls.of_file(ParameterFile.read(path))

    @classmethod
    def of_file(cls, file: ParameterFile) -> Self:
        """Make the object of a file that was read; every refusal names the file."""
        try:
            return cls.from_parameters(file)
        except Error as error:
            if str(error).startswith(f"{file.origin}: "):
                raise
            raise error.reworded(f"{file.origin}: {error}") from error


def _example(key: str, unit: str) -> str:
    return f'{_quoted(key)} = {{ value = ..., unit = "{unit}", source = "..." }}'


def _near(name: str, known: Iterable[str]) -> str:
    names = list(known)
    return did_you_mean(name, names) or f"known are {', '.join(names)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


class ModelParameters(Parameters):
    """Base of a model of ``parameters`` by name; what a fit wrote beside them is read over."""

    kind: str
    parameters: Mapping[str, float]
    parameter_names: ClassVar[tuple[str, ...]]
    settings: ClassVar[Mapping[str, Wanted]]

    def _written(self) -> Mapping[str, float]:
        return self.parameters

    def to_parameters(self) -> ParameterFile:
        """Give parameters and settings, as `to_toml` writes them."""
        settings = written({name: getattr(self, name) for name in self.settings}, self.settings)
        tables = {"parameters": entries(self._written()), "settings": settings}
        return ParameterFile(kind=self.kind, tables=tables)

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> Self:
        """Make the model of a file that `to_toml` or a fit wrote."""
        file.expect(kinds=(cls.kind,), tables=("parameters", "settings", "fit?"), notes=FIT_NOTES)
        make: Any = cls
        model: Self = make(
            parameters=file.values("parameters", wanted(cls.parameter_names)), **file.values("settings", cls.settings)
        )
        return model
