"""Parameter files: TOML that says its kind and format version, and every value with its unit.

The one reader and writer of such files. It knows mappings only; presets, models and settings turn themselves into a
`ParameterFile` and back.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd.errors import DataError, Error, ParameterError, did_you_mean
from mgdd.io.parameter_entries import (
    FORMS,
    PARTS,
    Entry,
    Wanted,
    entries,
    entry_of,
    fits,
    key_line,
    quoted,
    wanted,
    written,
)
from mgdd.io.toml_text import text_of, toml_of

if TYPE_CHECKING:
    import os

__all__ = ["Entry", "ParameterFile", "Parameters", "Wanted", "entries", "wanted", "written"]

FORMAT = 1
FIT_NOTES = ("source", "unidentifiable")  # what a fit says beside its model, in a table [fit] too
_HEAD = ("kind", "format")


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
        out = [key_line("kind", self.kind), key_line("format", FORMAT)]
        out += [key_line(name, value) for name, value in self.notes.items()]
        for table, values in self.tables.items():
            out += ["", f"[{quoted(table)}]"]
            for key, entry in values.items():
                said = {part: getattr(entry, part) for part in PARTS}
                parts = ", ".join(key_line(part, value) for part, value in said.items() if value is not None)
                out.append(f"{quoted(key)} = {{ {parts} }}")
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
        data = toml_of(text, origin)
        kind, version = data.get("kind"), data.get("format")
        if not isinstance(kind, str):
            raise DataError(f'{origin}: kind = {kind!r}: say what the file holds, for example kind = "engine"')
        if version != FORMAT or isinstance(version, bool):
            raise DataError(
                f"{origin}: format = {version!r}: this version of mgdd reads format = {FORMAT}; write that line if "
                "the file follows the page Formats, or update mgdd"
            )
        tables = {
            name: {key: entry_of(entry) for key, entry in table.items()}
            for name, table in data.items()
            if isinstance(table, dict)
        }
        notes = {name: value for name, value in data.items() if name not in tables and name not in _HEAD}
        return cls(kind=kind, tables=tables, notes=notes, origin=origin)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ParameterFile:
        """Read a file; FileNotFoundError or DataError name it."""
        text, origin = text_of(path)
        return cls.from_toml(text, origin=origin)

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
                if not (fits(value, need) or (part != "value" and value is None)):
                    raise ParameterError(f"{where}: {part} = {_short(value)}: must be {FORMS[need]}")
            out[key] = float(entry.value) if form == "number" else entry.value
        missing = [key for key, want in wanted.items() if want.required and key not in found]
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
    return f'{quoted(key)} = {{ value = ..., unit = "{unit}", source = "..." }}'


def _near(name: str, known: Iterable[str]) -> str:
    names = list(known)
    return did_you_mean(name, names) or f"known are {', '.join(names)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
