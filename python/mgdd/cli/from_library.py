"""Options of a command from the function that it calls: name, kind, choices, default and help stand in the library."""

from __future__ import annotations

import argparse
import ast
import inspect
import re
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import cache
from typing import Any

from mgdd.errors import arguments_written

__all__ = ["Options", "as_option", "column_of", "default_of", "named_options", "shown"]

_SECTION = re.compile(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-{3,}$|\Z)", re.MULTILINE | re.DOTALL)
_LISTED = str.maketrans("{}", "[]")  # a set forgets its order


def as_option(name: str, text: str | None = None) -> str:
    """Write an argument of the library as the option that sets it."""
    option = f"--{name.replace('_', '-')}"
    if text in ("True", "False"):
        return option if text == "True" else f"{option} left out"
    return f"{option} {text}" if text else option


def column_of(text: str) -> int | str:
    """Read a column, by name or by number from 0."""
    return int(text) if text.isdigit() else text


def named_options(**options: str) -> AbstractContextManager[None]:
    """Let messages write arguments of the library as the options of a command that are called otherwise."""

    def write(name: str, text: str | None = None) -> str:
        return as_option(options.get(name, name), text)

    return arguments_written(write)


# By what an annotation holds first.
_KINDS: Mapping[str, dict[str, Any]] = {
    "int | str | Sequence": {"type": column_of, "action": "append", "metavar": "COLUMN"},
    "int | str": {"type": column_of, "metavar": "COLUMN"},
    "Sequence[str]": {"action": "append", "metavar": "NAME"},
    "tuple": {"type": float, "nargs": 2, "metavar": ("LOW", "HIGH")},
    "float": {"type": float, "metavar": "X"},
    "ArrayLike": {"type": float, "metavar": "X"},
    "int": {"type": int, "metavar": "N"},
    "bool": {"action": "store_true", "default": None},
    "str": {"metavar": "NAME"},
}
_KIND = re.compile("|".join(map(re.escape, _KINDS)))


class Options:
    """Options for parameters of one function or class; what is not given keeps the default of the library.

    Parameters
    ----------
    call : callable
        What the command calls, with numpydoc.
    *names : str
        Parameters whose option has their name.
    **renamed : str
        Option of a parameter that is called otherwise on the command line, ``over="along"`` for ``--along``.
    """

    def __init__(self, call: Callable[..., Any], *names: str, **renamed: str) -> None:
        self.call, self.options = call, {**{name: name for name in names}, **renamed}

    def add(self, parser: Any, title: str = "", **defaults: str) -> Any:
        """Add the options, with a title in a group of their own; `defaults` are written where one number is not all."""
        group = parser.add_argument_group(title) if title else parser
        for name, option in self.options.items():
            group.add_argument(as_option(option), **self._settings(name, defaults.get(name)))
        return group

    def given(self, args: argparse.Namespace) -> dict[str, Any]:
        """Give the keywords of the call that were written."""
        values = {name: getattr(args, option) for name, option in self.options.items()}
        return {name: tuple(v) if isinstance(v, list) else v for name, v in values.items() if v is not None}

    def of(self, args: argparse.Namespace) -> dict[str, Any]:
        """Give all keywords, with the defaults of the library where nothing was written."""
        return {name: default_of(self.call, name) for name in self.options} | self.given(args)

    def _settings(self, name: str, written: str | None) -> dict[str, Any]:
        described, text = _documented(self.call).get(name, ("", ""))
        parameter, default = inspect.signature(self.call).parameters[name], default_of(self.call, name)
        kind = type(default).__name__ if parameter.annotation is parameter.empty else str(parameter.annotation)
        choices = re.match(r"\{.*?\}", described) or re.search(r"(?<=Literal)\[.*?\]", kind)
        found = _KIND.search(kind)
        own = dict(_KINDS[found[0] if found else "str"])
        if choices is not None:
            own = {"choices": tuple(ast.literal_eval(choices[0].translate(_LISTED)))}
        if parameter.default is parameter.empty:
            own["required"] = True
        said = re.sub(r"`(\w+)`", lambda found: self._named(found[1]), _help(text, default is None))
        if written is not None or (default is not None and default is not False):
            said = f"{re.sub(r'; [^;]* if left out$', '', said)} (default: {written or shown(default)})"
        return own | {"help": said.replace("`", "").replace("%", "%%")}

    def _named(self, name: str) -> str:
        return as_option(self.options[name]) if name in self.options else name


def default_of(call: Callable[..., Any], name: str) -> Any:
    """Give the default of a parameter; None where it has none."""
    parameter = inspect.signature(call).parameters[name]
    return None if parameter.default is parameter.empty else parameter.default


def shown(default: Any) -> str:
    """Write a default as help shows it."""
    return f"{default:g}" if isinstance(default, float) else str(default)


@cache
def _documented(call: Callable[..., Any]) -> dict[str, tuple[str, str]]:
    """Give kind and text of every parameter in the numpydoc of a function."""
    section = _SECTION.search(inspect.getdoc(call) or "")
    entries: list[tuple[str, list[str]]] = []
    for line in section[1].splitlines() if section else ():
        if line and not line[0].isspace():
            entries.append((line, []))
        elif entries:
            entries[-1][1].append(line.strip())
    heads = ((*head.partition(" : "), " ".join(text)) for head, text in entries)
    return {name: (kind, text) for names, _, kind, text in heads for name in names.split(", ")}


def _help(text: str, open_ended: bool) -> str:
    """Give the first sentence, and what holds without an option that has no default; as help is written."""
    first, *rest = re.split(r"\.(?:\s+|$)", re.sub(r"``|\*", "", text))
    said = [first, *[each for each in rest if open_ended and re.match("None|Left out", each)][:1]]
    return "; ".join(_small(re.sub(r"\bNone(:| is)? ", "left out: ", each)) for each in said)


def _small(text: str) -> str:
    return text if text[1:2].isupper() or text[1:2] in " (^" else text[:1].lower() + text[1:]
