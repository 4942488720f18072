"""Keywords of a class that hands them on to the core: signature and documentation from the core's table of fields.

And the way back from a pickle, which has such keywords and a state.

No public part of the package.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from textwrap import wrap
from typing import Any, TypeVar

_MARK = "**settings\n    As `fields` lists them.\n"
Class = TypeVar("Class", bound=type)


def takes_settings_of(core: Any, *, without: tuple[str, ...] = ()) -> Callable[[Class], Class]:
    """Show the settings of `core`, but for some, in place of the ``**settings`` of a class."""

    def decorate(cls: Class) -> Class:
        parameters = inspect.signature(cls.__init__).parameters  # type: ignore[misc]
        named = [each for each in parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
        fields = {name: each for name, each in core.fields().items() if name not in parameters and name not in without}
        given = inspect.signature(core).parameters
        own = {name: given.get(name) or _keyword(name, each["default"]) for name, each in fields.items()}
        cls.__init__.__signature__ = inspect.Signature([*named, *own.values()])  # type: ignore[misc]
        if cls.__doc__:
            entries = "".join(line for name, each in fields.items() for line in _entry(name, each, own[name].default))
            # From 3.13 on a docstring comes without its indentation.
            cls.__doc__ = inspect.cleandoc(cls.__doc__).replace(_MARK, entries)
        return cls

    return decorate


def _keyword(name: str, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default)


def _entry(name: str, field: dict[str, Any], default: Any) -> Iterator[str]:
    standard = field["default"]
    kind = "{" + ", ".join(f'"{each}"' for each in field["choices"]) + "}" if "choices" in field else ""
    optional = ", optional" if default is None else ""
    yield f"{name} : {kind or type(standard).__name__}{optional}\n"
    text = field["meaning"][:1].upper() + field["meaning"][1:]
    if field["unit"] != "-":
        text += f" [{field['unit']}]"
    if "lower" in field and field["lower"] > -1e300 and field["upper"] < 1e300:
        text += f", in {'(' if field['lower_open'] else '['}{field['lower']:g}, {field['upper']:g}]"
    if default is not None:
        text += f"; {standard!r} if left out"
    yield from (f"    {line}\n" for line in wrap(text + ".", 112))


def remade(cls: type[Any], given: Sequence[Any], settings: Mapping[str, Any], state: Mapping[str, Any]) -> Any:
    """Make an object of its arguments, then set by name what has changed since, as a ``__reduce__`` gives both."""
    made = cls(*given, **settings)
    for name, value in state.items():
        setattr(made, name, value)
    return made
