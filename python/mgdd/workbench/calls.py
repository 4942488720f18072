"""A piece of work as calls of the public interface: what a view runs is what it shows as Python and as a command."""

from __future__ import annotations

import importlib
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Named:
    """A result of an earlier line."""

    name: str


@dataclass(frozen=True)
class File:
    """A file of the session: work takes its path, what is shown takes its name."""

    path: Path


@dataclass(frozen=True)
class Call:
    """A call of a public function, as ``engine.analyze``, or of a method of what another line gives.

    Parameters
    ----------
    name : str
        Module and function below ``mgdd``, or names of attributes where `of` is given.
    args, options : tuple, mapping
        What it is called with; None of them stands for a default, and is left out.
    of : Named or Call, optional
        Whose method it is.
    watched : str
        Keyword that takes what listens to the progress; it is not shown.
    reads : bool
        An attribute is read, and nothing is called.
    """

    name: str
    args: tuple[Any, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    of: Any = None
    watched: str = ""
    reads: bool = False

    @property
    def given(self) -> dict[str, Any]:
        """Options that are not left out."""
        return {name: value for name, value in self.options.items() if value is not None}


@dataclass(frozen=True)
class Sum:
    """Two results, added."""

    left: Any
    right: Any


@dataclass(frozen=True)
class Script:
    """Lines of calls, each with the name of its result, and the command that does the same.

    Parameters
    ----------
    lines : tuple of (str, Call)
        In their order.
    command : tuple of str
        Words behind ``mgdd``.
    kept : tuple of str
        Names whose results are wanted.
    before : tuple of tuple of str
        Commands that make the files of `command`.
    """

    lines: tuple[tuple[str, Any], ...]
    command: tuple[str, ...]
    kept: tuple[str, ...]
    before: tuple[tuple[str, ...], ...] = ()

    @property
    def shell(self) -> str:
        """The commands as they are typed in the folder of the files, one a line."""
        return "\n".join(shlex.join(["mgdd", *words]) for words in (*self.before, self.command))

    @property
    def python(self) -> str:
        """The same as Python."""
        return "import mgdd\n\n" + "".join(f"{name} = {written(value)}\n" for name, value in self.lines)

    def run(
        self, watch: Callable[..., object] | None = None, wraps: Mapping[str, Callable[[Any], Any]] | None = None
    ) -> dict[str, Any]:
        """Run all lines, and give the results that are kept; `wraps` change the result of a line by its name."""
        names = dict[str, Any]()
        for name, value in self.lines:
            made = _evaluated(value, names, watch)
            names[name] = wraps[name](made) if wraps and name in wraps else made
        return {name: names[name] for name in self.kept}


def public(name: str) -> Any:
    """Give a public function or class by module and name below ``mgdd``; AttributeError for any other name."""
    room, _, function = name.rpartition(".")
    module = importlib.import_module(f"mgdd.{room}")
    if function not in module.__all__:
        raise AttributeError(f"mgdd.{name} is not public")
    return getattr(module, function)


def _evaluated(value: Any, names: Mapping[str, Any], watch: Callable[..., object] | None) -> Any:
    if isinstance(value, Named):
        return names[value.name]
    if isinstance(value, File):
        return value.path
    if isinstance(value, Sum):
        return _evaluated(value.left, names, watch) + _evaluated(value.right, names, watch)
    if isinstance(value, list | tuple):
        return type(value)(_evaluated(each, names, watch) for each in value)
    if isinstance(value, Mapping):
        return {key: _evaluated(each, names, watch) for key, each in value.items()}
    if not isinstance(value, Call):
        return value
    called = public(value.name) if value.of is None else _evaluated(value.of, names, watch)
    if value.of is not None:
        for attribute in value.name.split("."):
            called = getattr(called, attribute)
    if value.reads:
        return called
    options = {name: _evaluated(each, names, watch) for name, each in value.given.items()}
    if value.watched and watch is not None:
        options[value.watched] = watch
    return called(*(_evaluated(each, names, watch) for each in value.args), **options)


def written(value: Any) -> str:
    """Write a value, or a call of the public interface, as Python."""
    if isinstance(value, Named):
        return value.name
    if isinstance(value, File):
        return repr(value.path.name)
    if isinstance(value, Sum):
        return f"{written(value.left)} + {written(value.right)}"
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, tuple):
        return f"({', '.join(map(written, value))}{',' if len(value) == 1 else ''})"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {written(each)}" for key, each in value.items()) + "}"
    if not isinstance(value, Call):
        return repr(value)
    whose = f"mgdd.{value.name}" if value.of is None else f"{written(value.of)}.{value.name}"
    if value.reads:
        return whose
    words = [*map(written, value.args), *(f"{name}={written(each)}" for name, each in value.given.items())]
    return f"{whose}({', '.join(words)})"
