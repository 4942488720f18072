"""A table of a TOML file, read key by key: every refusal names file, key, value and remedy."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.io.files import parsed, read_plain_text
from mgdd.io.parameters import FORMS, Form, fits


class TomlTable:
    """Keys of a table that are taken one by one."""

    def __init__(self, values: Mapping[str, Any], *, origin: str, path: str = "") -> None:
        self._left = dict(values)
        self.origin, self.path = origin, path

    @classmethod
    def read(cls, file: Path) -> TomlTable:
        """Read a file; DataError where it is not TOML."""
        return cls(parsed(read_plain_text(file, only_utf8=True), str(file), "TOML"), origin=str(file))

    def key(self, name: str) -> str:
        """Give a key with its table in front."""
        return f"{self.path}.{name}" if self.path else name

    def error(self, name: str, value: Any, bound: str) -> ParameterError:
        """Make the refusal of a key: file, key, value, what it must be."""
        shown = f"{value:.12g}" if isinstance(value, float) else repr(value)
        return ParameterError(
            f"{self.origin}: {self.key(name)} = {shown}: must be {bound}",
            field=self.key(name),
            value=value,
            bound=bound,
        )

    def take(self, name: str, form: Form, default: Any = ...) -> Any:
        """Take a key of a form; without a default it must be there."""
        if name not in self._left:
            if default is ...:
                raise DataError(f"{self.origin}: {self.key(name)} is missing: it must be {FORMS[form]}")
            return default
        value = self._left.pop(name)
        if not fits(value, form):
            raise self.error(name, value, FORMS[form])
        return float(value) if form == "number" else value

    def anything(self, name: str, default: Any = None) -> Any:
        """Take a key of any form."""
        return self._left.pop(name, default)

    def table(self, name: str) -> TomlTable:
        """Take a table below this one; an empty one where there is none."""
        value = self._left.pop(name, {})
        if not isinstance(value, dict):
            raise self.error(name, value, f"a table [{self.key(name)}]")
        return TomlTable(value, origin=self.origin, path=self.key(name))

    def tables(self) -> list[tuple[str, TomlTable]]:
        """Take all that is left as tables: names and tables."""
        return [(name, self.table(name)) for name in list(self._left)]

    def rows(self, name: str) -> list[TomlTable]:
        """Take an array of tables."""
        value = self._left.pop(name, [])
        if not (isinstance(value, list) and all(isinstance(row, dict) for row in value)):
            raise self.error(name, value, f"tables [[{self.key(name)}]]")
        return [
            TomlTable(row, origin=self.origin, path=f"{self.key(name)}[{place}]") for place, row in enumerate(value)
        ]

    def items(self) -> dict[str, Any]:
        """Take all that is left."""
        left, self._left = self._left, {}
        return left

    def only(self, known: Collection[str]) -> None:
        """Refuse keys that are not known."""
        for name in [name for name in self._left if name not in known]:
            guess = did_you_mean(name, known)
            raise self.error(
                name, self._left[name], f"one of the keys {', '.join(known)}" + (f"; {guess}" if guess else "")
            )
