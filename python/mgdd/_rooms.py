"""Public modules that answer a wrong guess with the right name: of a function, of an argument, of their order.

Each public module ends in ``furnish(__name__)``. A call that succeeds passes one more frame; all else is done where one
fails. No public part of the package.
"""

from __future__ import annotations

import functools
import re
import sys
from collections.abc import Mapping, Sequence
from types import FunctionType, ModuleType
from typing import Any

from mgdd._guesses import near_names
from mgdd.errors import Error, did_you_mean

# Settings that an argument of this name has, and how they are given.
_RECORDS = {
    "cylinder": (
        "engine",
        "Cylinder",
        "cylinder=preset.cylinder.replace({}=...), point=preset.point of preset = mgdd.presets.load('puma_single')",
    ),
    "point": ("engine", "OperatingPoint", "point={{'{}': ...}}"),
    "throttle": ("throttle", "Throttle", "throttle=mgdd.presets.load('P1').throttle.replace({}=...)"),
}


class _Room(ModuleType):
    def __getattr__(self, name: str) -> Any:
        raise missing(self, name)

    def __dir__(self) -> list[str]:
        return sorted(self.__all__)

    def __call__(self, *given: Any, **keywords: Any) -> Any:
        name = self.__name__.rpartition(".")[2]
        if name not in self.__all__:
            raise TypeError(f"{self.__name__} is a module, of {', '.join(self.__all__)}")
        return vars(self)[name](*given, **keywords)  # `mgdd.sweep(...)` is `mgdd.sweep.sweep(...)`


def furnish(name: str) -> None:
    """Let a public module, which has ``__all__``, its functions and its classes answer wrong guesses."""
    room = sys.modules[name]
    room.__class__ = _Room
    for each in room.__all__:
        thing = getattr(room, each)
        home = sys.modules.get(getattr(thing, "__module__", None) or "")
        if isinstance(thing, FunctionType):
            wrapped = _answering(thing, each, thing.__doc__)
            for place in (room, home):  # by its name in either it is pickled
                setattr(place, each, wrapped)
        elif isinstance(vars(thing).get("__init__"), FunctionType) and not getattr(thing, "_is_protocol", False):
            thing.__init__ = _answering(thing.__init__, each, thing.__doc__)


def missing(room: ModuleType, name: str) -> Exception:
    """Make the error of a name that a module lacks: with the near names here, else those of the other modules."""
    text = f"module {room.__name__!r} has no attribute {name!r}"
    if name.startswith("_") or _is_module(f"{room.__name__}.{name}"):
        return AttributeError(text, name=name, obj=room)
    hint = "" if room.__name__ == "mgdd" else did_you_mean(name, room.__all__)
    if not hint:
        places = {item: at for item, at in _places().items() if item[0].isupper() == name[0].isupper()}
        close = [place for near in near_names(name, places) for place in places[near]]
        hint = f"did you mean {' or '.join(close)}?" if close else f"it has {', '.join(room.__all__)}"
    # Of an AttributeError `from ... import` would drop the text.
    from opcode import opmap

    frame = sys._getframe(2)
    if frame.f_code.co_code[frame.f_lasti] == opmap["IMPORT_FROM"]:
        return ImportError(f"{text}: {hint}", name=room.__name__)
    return AttributeError(f"{text}: {hint}", name=name, obj=room)


def _is_module(name: str) -> bool:
    from importlib.util import find_spec

    return find_spec(name) is not None


def _places() -> dict[str, list[str]]:
    """Where each public name stands, here and in a package beside this one, read without importing."""
    from pathlib import Path

    places: dict[str, list[str]] = {}
    package = Path(__file__).parent
    for listed in (*package.glob("[a-z]*/__init__.py"), *package.parent.glob(f"{package.name}_*/__init__.py")):
        beside, folder = listed.parent.parent != package, listed.parent.name
        if beside:
            places[folder] = [f"the package {folder}"]
        match = re.search(r"__all__ = \[(.*?)\]", listed.read_text(encoding="utf-8"), re.DOTALL)
        for name in re.findall(r'"(\w+)"', match[1] if match else ""):
            places.setdefault(name, []).append(f"{folder}.{name}" if beside else f"{package.name}.{folder}.{name}")
    return places


def _answering(function: FunctionType, name: str, doc: str | None) -> Any:
    """Wrap a function so that a call that fails is looked at once more."""
    look = functools.partial(_look, function, name, doc or "")

    def call(*given: Any, **keywords: Any) -> Any:
        try:
            return function(*given, **keywords)
        except Exception as error:
            if (better := look(error, given, keywords)) is not None:
                raise better from None
            raise

    # With the globals of its module, by which doctest assigns examples to modules.
    answering = FunctionType(call.__code__, function.__globals__, function.__name__, None, call.__closure__)
    return functools.wraps(function)(answering)


def _look(
    function: FunctionType, name: str, doc: str, error: Exception, given: Sequence[Any], keywords: Mapping[str, Any]
) -> Exception | None:
    """Return a better error for arguments that do not fit the signature, or stand in another order."""
    import inspect

    from mgdd._arguments import unbound

    parameters = list(inspect.signature(function).parameters.values())
    if parameters and parameters[0].name == "self":
        parameters, given = parameters[1:], given[1:]
    if isinstance(error, TypeError) and error.__traceback__ is not None and error.__traceback__.tb_next is None:
        names = [each.name for each in parameters]
        unknown = next((each for each in keywords if each not in names), "")
        return _of_a_record(name, unknown, names) or unbound(name, parameters, given, keywords, _parameter_kinds(doc))
    if isinstance(error, Error):
        places = [each.name for each in parameters if each.kind is each.POSITIONAL_OR_KEYWORD][: len(given)]
        kinds = [f"{each.annotation} {_parameter_kinds(doc).get(each.name, '')}" for each in parameters[: len(places)]]
        if any(_belongs_elsewhere(value, place, kinds) for place, value in enumerate(given[: len(places)])):
            error.args = (f"{error}; did you mean {name}({', '.join(places)}) in this order?",)
    return None


def _of_a_record(name: str, unknown: str, names: Sequence[str]) -> TypeError | None:
    """Explain how a setting of an engine, a point or a throttle is given to a function that takes the whole record."""
    from mgdd import _core

    for argument, (room, record, form) in _RECORDS.items():
        if unknown and argument in names and unknown in (fields := getattr(getattr(_core, room), record).fields()):
            unit = "" if fields[unknown]["unit"] == "-" else f" [{fields[unknown]['unit']}]"
            how = form.format(unknown)
            return TypeError(
                f"{name}() has no argument {unknown!r}: it is a setting{unit} of the {argument}: give {how}"
            )
    return None


def _belongs_elsewhere(value: Any, place: int, kinds: Sequence[str]) -> bool:
    types = {base.__name__ for base in type(value).__mro__ if base.__module__ != "builtins"}
    fits = [bool(types & set(re.findall(r"\w+", kind))) for kind in kinds]
    return any(fits) and not fits[place]


def _parameter_kinds(doc: str) -> dict[str, str]:
    """Kind and first sentence of each parameter of a numpydoc text."""
    from inspect import cleandoc

    kinds: dict[str, str] = {}
    for names, kind, text in re.findall(r"^([\w, ]+?)( : .+)?\n((?: {4}.*\n)+)", cleandoc(doc), re.MULTILINE):
        first = " ".join(text.split()).partition(". ")[0].rstrip(".")
        kinds |= dict.fromkeys(names.split(", "), f"{kind.removeprefix(' : ')}: {first}".removeprefix(": "))
    return kinds
