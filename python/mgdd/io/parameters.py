"""Parameter files: TOML that says its kind and format version, and every value with its unit.

The one reader and writer of such files. It knows mappings only; presets, models and settings turn themselves into a
`ParameterFile` and back.
"""

from __future__ import annotations

import difflib
import errno
import re
import tomllib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.results.units import unit_of

if TYPE_CHECKING:
    import os

__all__ = ["Entry", "ParameterFile", "Parameters", "Wanted", "entries", "wanted"]

Form = Literal["number", "integer", "flag", "text", "numbers", "texts"]
FORMAT = 1
FIT_NOTES = ("source", "unidentifiable")  # what a fit says beside its model, in a table [fit] too
_HEAD = ("kind", "format")
_PARTS = ("value", "unit", "stderr", "source")


class Wanted(NamedTuple):
    """What a reader expects of one key.

    Parameters
    ----------
    unit : str
        The unit that must stand there.
    form : {"number", "integer", "flag", "text", "numbers", "texts"}
        Type of the value; ``numbers`` is a list of numbers, or a list of such lists.
    required : bool
        Whether the key must be there.
    """

    unit: str = "-"
    form: Form = "number"
    required: bool = True


_FORMS = {
    "number": "a number",
    "integer": "a whole number",
    "flag": "true or false",
    "text": "text in quotes",
    "numbers": "a list of numbers",
    "texts": "a list of texts in quotes",
}


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One value of a parameter file.

    Parameters
    ----------
    value : float, int, bool, str or list
        The value; lists hold numbers, or lists of numbers.
    unit : str or None
        Its unit, ``"-"`` if dimensionless; None where the file does not say it.
    stderr : float, optional
        Standard error, in the same unit.
    source : str, optional
        Where the value comes from.
    """

    value: Any
    unit: str | None = "-"
    stderr: float | None = None
    source: str | None = None


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
        What is said about them: ``name``, ``title``, ``source``, ...
    origin : str
        The file, for messages; not compared.

    Examples
    --------
    >>> from mgdd.io.parameters import Entry, ParameterFile
    >>> file = ParameterFile(kind="lag", tables={"parameters": {"tau_s": Entry(value=0.02, unit="s")}})
    >>> print(file.to_toml(), end="")
    kind = "lag"
    format = 1
    <BLANKLINE>
    [parameters]
    tau_s = { value = 0.02, unit = "s" }
    >>> ParameterFile.from_toml(file.to_toml()) == file
    True
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
        """Give the same parameters with what a fit says of them.

        Parameters
        ----------
        stderr : mapping of str to float
            Standard errors by name; both sides of a throttle may share one, without the side.
        figures : mapping of str to (float, str)
            Quality of the fit by name, each with its unit.
        source : str
            Where the numbers come from.
        unidentifiable : collection of str
            Names that the record did not determine.

        Returns
        -------
        ParameterFile
            With a table ``fit``.
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
        out = [_line("kind", self.kind), _line("format", FORMAT)]
        out += [_line(name, value) for name, value in self.notes.items()]
        for table, values in self.tables.items():
            out += ["", f"[{_key(table)}]"]
            for key, entry in values.items():
                said = {part: getattr(entry, part) for part in _PARTS}
                parts = ", ".join(_line(part, value) for part, value in said.items() if value is not None)
                out.append(f"{_key(key)} = {{ {parts} }}")
        return "\n".join(out) + "\n"

    @classmethod
    def from_toml(cls, text: str, *, origin: str = "text") -> ParameterFile:
        """Read what `to_toml` wrote, or what a person wrote in its form.

        Raises
        ------
        DataError
            Not TOML, no kind, or another format version.
        ParameterError
            A value that does not stand as ``{ value = ..., unit = "..." }``.
        """
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise DataError(f"{origin}: not valid TOML: {error}") from error
        kind, version = data.get("kind"), data.get("format")
        if not isinstance(kind, str):
            raise DataError(f'{origin}: kind = {kind!r}: say what the file holds, for example kind = "engine"')
        if version != FORMAT or isinstance(version, bool):
            raise DataError(
                f"{origin}: format = {version!r}: this version of mgdd reads format = {FORMAT}; write that line if "
                "the file follows the page Formats, or update mgdd"
            )
        tables = {
            name: {key: _entry(entry) for key, entry in table.items()}
            for name, table in data.items()
            if isinstance(table, dict)
        }
        notes = {name: value for name, value in data.items() if name not in tables and name not in _HEAD}
        return cls(kind=kind, tables=tables, notes=notes, origin=origin)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ParameterFile:
        """Read a file; FileNotFoundError or DataError name it."""
        file = Path(path)
        if not file.exists():
            raise FileNotFoundError(errno.ENOENT, "no such file: check the path", str(file))
        try:
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise DataError(f"{file}: not a UTF-8 text file: {error}") from error
        return cls.from_toml(text, origin=str(file))

    def expect(self, *, kinds: Collection[str], tables: Collection[str], notes: Collection[str] = ("source",)) -> None:
        """Refuse another kind, a missing table, and a table or note that the kind does not have.

        Parameters
        ----------
        kinds : collection of str
            Kinds that the caller reads.
        tables : collection of str
            Its tables; one that ends in ``?`` may be missing.
        notes : collection of str
            Its notes; all of them may be missing.

        Raises
        ------
        DataError
            Another kind, or a table that is missing.
        ParameterError
            An unknown table or note.
        """
        if self.kind not in kinds:
            raise DataError(f"{self.origin}: kind = {self.kind!r}: must be {' or '.join(map(repr, kinds))}")
        known = [table.removesuffix("?") for table in tables]
        odd = [name for name in self.tables if name not in known] + [name for name in self.notes if name not in notes]
        if odd:
            hint = _near(odd[0], [*(f"[{table}]" for table in known), *notes])
            raise ParameterError(f"{self.origin}: unknown key {odd[0]!r}: {hint}")
        for table in tables:
            if table == table.removesuffix("?") and table not in self.tables:
                raise DataError(f"{self.origin}: no table [{table}]: a file of kind {self.kind!r} has one")

    def values(self, table: str, wanted: Mapping[str, Wanted]) -> dict[str, Any]:
        """Take the values of a table: numbers as float, lists as they stand.

        Parameters
        ----------
        table : str
            Its name; nothing is required of a table that is missing and may be.
        wanted : mapping of str to Wanted
            What its keys must be.

        Raises
        ------
        DataError
            A missing key.
        ParameterError
            An unknown key, another unit, a value of the wrong type.
        """
        found = self.tables.get(table, {})
        out = {}
        for key, entry in found.items():
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
                if not (_fits(value, need) or (part != "value" and value is None)):
                    raise ParameterError(f"{where}: {part} = {_short(value)}: must be {_FORMS[need]}")
            out[key] = float(entry.value) if form == "number" else entry.value
        missing = [key for key, want in wanted.items() if want.required and key not in found]
        if missing:
            example = _example(missing[0], wanted[missing[0]].unit)
            raise DataError(f"{self.origin}: [{table}] lacks {', '.join(missing)}: write {example}")
        return out

    def with_notes(self, **notes: Any) -> ParameterFile:
        """Give a copy with further notes."""
        return replace(self, notes={**self.notes, **notes})


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
        return cls.from_parameters(ParameterFile.from_toml(text, origin=origin))


def entries(
    values: Mapping[str, Any], units: Mapping[str, str] = MappingProxyType({}), **common: Any
) -> dict[str, Entry]:
    """Make the entries of a table: units as given, else as the names end; `common` goes into each."""
    return {
        name: Entry(value=_plain(value), unit=units.get(name, unit_of(name)), **common)
        for name, value in values.items()
    }


def wanted(
    names: Iterable[str], units: Mapping[str, str] = MappingProxyType({}), form: Form = "number"
) -> dict[str, Wanted]:
    """Ask for keys of one form, all required: units as given, else as the names end."""
    return {name: Wanted(units.get(name, unit_of(name)), form) for name in names}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _entry(entry: Any) -> Entry:
    """Take an entry as it stands; what is not one has no unit, which `ParameterFile.values` refuses."""
    if not isinstance(entry, dict) or "value" not in entry or not set(entry) <= set(_PARTS):
        return Entry(value=entry, unit=None)
    return Entry(**{"unit": None, **entry})


def _fits(value: Any, form: str) -> bool:
    if form == "numbers":
        rows = value if isinstance(value, list) else [None]
        return all(_fits(row, "numbers" if isinstance(row, list) else "number") for row in rows)
    if form == "texts":
        return isinstance(value, list) and all(isinstance(item, str) for item in value)
    if form in ("number", "integer"):
        types: tuple[type, ...] = (int, float) if form == "number" else (int,)
        return isinstance(value, types) and not isinstance(value, bool)
    return isinstance(value, bool if form == "flag" else str)


def _line(key: str, value: Any) -> str:
    """Write ``key = value`` on one line; lists of lists get a line per row."""
    import tomli_w

    # Strings escape their line breaks, so those left belong to lists.
    text = re.sub(r",\n\s*\]", "]", tomli_w.dumps({key: value}).rstrip("\n"))
    text = re.sub(r"\[\n\s*", "[", text)
    text = re.sub(r",\n\s*", ", ", text)
    rows = isinstance(value, list) and any(isinstance(row, list) for row in value)
    return text.replace("], [", "],\n  [") if rows else text


def _key(name: str) -> str:
    """Quote a key where TOML needs it."""
    return _line(name, 0).removesuffix(" = 0")


def _example(key: str, unit: str) -> str:
    return f'{_key(key)} = {{ value = ..., unit = "{unit}", source = "..." }}'


def _near(name: str, known: Iterable[str]) -> str:
    names = list(known)
    close = difflib.get_close_matches(name, names, 1)
    return f"did you mean {close[0]!r}?" if close else f"known are {', '.join(names)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
