"""Arguments that the core does not take, explained: which one, what was given, and what to give instead.

The core calls `refusal` where pybind11 would list its signatures. No public part of the package.
"""

from __future__ import annotations

import ast
import inspect
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mgdd.errors import Error, ParameterError, did_you_mean, shortened

_NUMBERS, _NUMBER, _WHOLE = "ArrayLike", "SupportsFloat", "SupportsInt"
_NAMED = {
    _NUMBER: "one number",
    _WHOLE: "a whole number",
    "str": "a name",
    "bool": "True or False",
    _NUMBERS: "numbers in one array or sequence",
    "None": "None",
    "dict": "a dict",
    "list": "a list",
    "tuple": "a tuple",
    "Callable": "a function",
    "Buffer": "bytes",
}
_MOST = 2**31 - 1  # of a count; seeds may be larger
_LONGEST_HOW = 240  # letters of what a missing argument is, and of the names that are known
_BOUND = "plain, without a unit"
_PLAIN = "give the magnitude in the unit of the name, as in soc.to('degree').magnitude"
_MAKE = {
    "Cylinder": "mgdd.presets.load(name).cylinder is one",
    "OperatingPoint": "mgdd.presets.load(name).point is one",
    "Throttle": "mgdd.presets.load(name).throttle is one",
}


@dataclass(frozen=True)
class _Argument:
    name: str
    kind: ast.expr
    required: bool
    keyword_only: bool
    how: str = ""  # kind and meaning, for one that is missing


def unbound(
    name: str,
    parameters: Sequence[inspect.Parameter],
    given: Sequence[Any],
    keywords: Mapping[str, Any],
    how: Mapping[str, str],
) -> TypeError | None:
    """Return why a call misfits the signature of a Python function; `how` has kind and meaning of its parameters."""
    places = [each for each in parameters if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)]
    arguments = [
        _Argument(
            each.name,
            ast.Constant(None),
            each.default is each.empty,
            each.kind is each.KEYWORD_ONLY,
            how.get(each.name, ""),
        )
        for each in places
    ]
    bound = _bound(name, arguments, given, keywords)
    return bound if isinstance(bound, TypeError) else None


def refusal(
    name: str, signatures: Sequence[str], given: Sequence[Any], keywords: Mapping[str, Any], method: bool = False
) -> TypeError | ParameterError:
    """Return why a call misfits its signatures, as pybind11 writes them: TypeError as of Python, or ParameterError.

    The latter names the argument that has the wrong kind; the first one of a `method` is ``self``.
    """
    culprits: list[tuple[int, _Argument, Any]] = []
    whole: list[tuple[_Argument, Any]] = []
    for signature in signatures:
        arguments = _arguments(signature, name)[method:]
        bound = _bound(name, arguments, given, keywords)
        if isinstance(bound, TypeError):
            return bound
        for place, argument in enumerate(arguments):
            if argument.name in bound and not _fits(argument.kind, bound[argument.name]):
                culprits.append((place, argument, bound[argument.name]))
                break
        else:
            for each in arguments:
                value: Any = bound.get(each.name)
                if _WHOLE in map(_name, _choices(each.kind)) and _is_number(value, whole=True):
                    whole.append((each, operator.index(value)))
    if not culprits and whole:  # of the right kind, all of them: one is beyond what the core counts with
        argument, value = min(whole, key=lambda each: (each[1] >= 0, -abs(each[1])))
        if value < 0 or value > _MOST:
            bound_text = "a whole number >= 0" if value < 0 else f"a whole number up to {_MOST}"
            return ParameterError.of(argument.name, value, bound_text)
    if not culprits:
        return TypeError(f"{name}() does not take these arguments: it is {name}{' or '.join(signatures)}")
    furthest = max(place for place, _, _ in culprits)
    last = [(argument, value) for place, argument, value in culprits if place == furthest]
    argument, value = last[0]
    bound_text = " or ".join(dict.fromkeys(_type_text(each.kind) for each, _ in last))
    if has_units(value):
        bound_text = _BOUND
    remedy = _remedy(argument, value)
    return ParameterError(
        f"{argument.name} = {shown(value)}: must be {bound_text}{remedy}",
        field=argument.name,
        value=value,
        bound=bound_text,
    )


def unit_refusal(
    name: str, signatures: Sequence[str], given: Sequence[Any], keywords: Mapping[str, Any], method: bool = False
) -> ParameterError | None:
    """Report which number has a unit where a plain one is needed; None where none does. Arguments as for `refusal`."""
    error = refusal(name, signatures, given, keywords, method)
    return error if isinstance(error, ParameterError) else None


def has_units(value: Any) -> bool:
    """Whether a value, or an entry of a list or tuple, carries a unit, as those of pint, astropy and unyt do."""
    if isinstance(value, list | tuple):
        return any(has_units(each) for each in value)
    kind = type(value)
    return hasattr(kind, "to") and any(hasattr(kind, each) for each in ("dimensionality", "unit", "units"))


def _arguments(signature: str, function: str) -> list[_Argument]:
    inside = signature[signature.index("(") + 1 : signature.rindex(") -> ")]
    arguments, keyword_only = [], False
    for part in _split(inside):
        if part in ("*", "/"):
            keyword_only = keyword_only or part == "*"
            continue
        text, equals, _ = part.partition(" = ")
        name, _, kind = text.partition(": ")
        name = function if name == "arg1" else name.lstrip("*")  # of a setter: the property
        arguments.append(_Argument(name, ast.parse(kind or "object", mode="eval").body, not equals, keyword_only))
    return arguments


def _split(text: str) -> list[str]:
    """Cut at the commas that stand outside of brackets and quotes."""
    parts, depth, quote, start = [], 0, "", 0
    for place, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        elif letter in "([{<":
            depth += 1
        elif letter in ")]}>":
            depth -= 1
        elif letter == "," and depth == 0:
            parts.append(text[start:place].strip())
            start = place + 1
    return [*parts, text[start:].strip()] if text[start:].strip() else parts


_OF_PRESETS = ("Cylinder", "OperatingPoint", "Throttle")  # what a preset holds


def _bound(
    name: str, arguments: list[_Argument], given: Sequence[Any], keywords: Mapping[str, Any]
) -> dict[str, Any] | TypeError:
    places = [argument.name for argument in arguments if not argument.keyword_only]
    if len(given) > len(places):
        named = [argument.name for argument in arguments if argument.keyword_only]
        rest = f"; give {', '.join(named[:3])}{', ...' if len(named) > 3 else ''} by name" if named else ""
        if name in _OF_PRESETS and isinstance(given[0], str):
            rest += ", or take a preset: mgdd.presets.available() lists them, mgdd.presets.load(NAME) gives one"
        return TypeError(f"{name}() takes {len(places)} positional arguments, {len(given)} were given{rest}")
    bound = dict(zip(places, given, strict=False))
    names = [argument.name for argument in arguments]
    for keyword, value in keywords.items():
        if keyword not in names:
            hint = did_you_mean(keyword, names) or f"known are {shortened(', '.join(names), _LONGEST_HOW)}"
            return TypeError(f"{name}() has no argument {keyword!r}: {hint}")
        if keyword in bound:
            return TypeError(f"{name}() got {keyword!r} twice, by place and by name")
        bound[keyword] = value
    missing = [argument.name for argument in arguments if argument.required and argument.name not in bound]
    if missing:
        how = shortened(next(argument.how for argument in arguments if argument.name == missing[0]), _LONGEST_HOW)
        return TypeError(f"{name}() lacks {', '.join(missing)}{how and f' ({how})'}")
    return bound


def _name(kind: ast.expr) -> str:
    if isinstance(kind, ast.Attribute):
        return kind.attr
    if isinstance(kind, ast.Constant):
        return str(kind.value)
    return kind.id if isinstance(kind, ast.Name) else ""


def _items(kind: ast.Subscript) -> list[ast.expr]:
    return kind.slice.elts if isinstance(kind.slice, ast.Tuple) else [kind.slice]


def _choices(kind: ast.expr) -> list[ast.expr]:
    if isinstance(kind, ast.BinOp):
        return [*_choices(kind.left), *_choices(kind.right)]
    return [kind]


def _fits(kind: ast.expr, value: Any) -> bool:
    if isinstance(kind, ast.BinOp):
        return any(_fits(choice, value) for choice in _choices(kind))
    if not isinstance(kind, ast.Subscript):
        return _fits_name(_name(kind), value)
    items, outer = _items(kind), _name(kind.value)
    if outer == "Annotated":
        size = items[1].value if isinstance(items[1], ast.Constant) else ""
        length = str(size)[10:-1] if str(size).startswith("FixedSize(") else ""
        return _fits(items[0], value) and (not length or len(value) == int(length))
    if outer == "tuple":
        alike = _is_sequence(value) and len(value) == len(items)
        return alike and all(_fits(item, each) for item, each in zip(items, value, strict=True))
    if outer == "Mapping":
        return isinstance(value, Mapping) and all(_fits(items[1], each) for each in value.values())
    return _is_sequence(value) and all(_fits(items[0], each) for each in value)


def _fits_name(name: str, value: Any) -> bool:
    if name in ("Any", "object", ""):
        return not has_units(value)
    if name in (_NUMBER, _WHOLE, "SupportsIndex"):
        return _is_number(value, whole=name != _NUMBER)
    if name == _NUMBERS:
        return _is_numbers(value)
    if name == "None":
        return value is None
    if name == "Callable":
        return callable(value)
    if name == "Buffer":
        return isinstance(value, bytes | bytearray | memoryview)
    if name == "bool":
        return type(value).__name__ in ("bool", "bool_")
    return any(base.__name__ == name for base in type(value).__mro__)


def _is_number(value: Any, *, whole: bool) -> bool:
    if isinstance(value, str | bytes) or getattr(value, "ndim", 0) != 0 or has_units(value):
        return False
    try:
        operator.index(value) if whole else float(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def _is_numbers(value: Any) -> bool:
    import numpy as np

    if has_units(value):
        return False
    try:
        np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def as_floats(values: Any) -> Any:
    """Return a new array of float64; what a masked array marks as missing is NaN, not what stands below the mask."""
    import numpy as np

    made = np.array(values, dtype=np.float64)
    if isinstance(values, np.ma.MaskedArray):
        made[np.ma.getmaskarray(values)] = np.nan
    return made


def _is_sequence(value: Any) -> bool:
    return not isinstance(value, str | bytes) and hasattr(value, "__len__") and hasattr(value, "__getitem__")


def _type_text(kind: ast.expr) -> str:
    if isinstance(kind, ast.BinOp):
        names = [choice for choice in _choices(kind) if _name(choice) != "SupportsIndex"]
        return " or ".join(_type_text(choice) for choice in names)
    if not isinstance(kind, ast.Subscript):
        name = _name(kind)
        return _NAMED.get(name, _article(name))
    items, outer = _items(kind), _name(kind.value)
    if outer == "Annotated":
        size = str(items[1].value) if isinstance(items[1], ast.Constant) else ""
        text = _type_text(items[0])
        return text.replace("a sequence of", f"a sequence of {size[10:-1]}") if size.startswith("FixedSize(") else text
    if outer == "tuple":
        return f"({', '.join(_type_text(item) for item in items)})"
    if outer == "Mapping":
        return f"a mapping of names to {_plural(items[1])}"
    return f"a sequence of {_plural(items[0])}"


def _plural(kind: ast.expr) -> str:
    plurals = {_NUMBER: "numbers", _WHOLE: "whole numbers", "str": "names"}
    first = _choices(kind)[0]
    if isinstance(first, ast.Subscript):
        return f"entries that are {_type_text(kind)}"
    return plurals.get(_name(first), f"{_name(first)}s")


def _remedy(argument: _Argument, value: Any) -> str:
    """Give the remedy, where the value shows it."""
    if has_units(value):
        return f"; {_PLAIN}"
    for name in dict.fromkeys((argument.name, *(_name(choice).lower() for choice in _choices(argument.kind)))):
        try:
            part = getattr(value, name, None)
        except Error:  # a property that refuses is not a remedy
            continue
        if part is not None and _fits(argument.kind, part) and not callable(part):
            return f"; give its .{name}"
    names = [_name(choice) for choice in _choices(argument.kind)]
    if _NUMBER in names or _WHOLE in names:
        return "; call once per value" if _is_sequence(value) or bool(getattr(value, "ndim", 0)) else ""
    return next((f"; {_MAKE[name]}" for name in names if name in _MAKE), "")


def require_plain(name: str, value: Any) -> None:
    """Refuse a number, or numbers, with a unit: numpy would drop it, and read degrees as radians."""
    if has_units(value):
        raise ParameterError(
            f"{name} = {shown(value)}: must be {_BOUND}; {_PLAIN}", field=name, value=value, bound=_BOUND
        )


def shown(value: Any) -> str:
    """Show what was given in a line: the value of plain things, and the kind of others."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # noqa: BLE001 - an error about an object whose own text fails must still come
        text = "<no repr>"
    kind = {"ndarray": "array"}.get(type(value).__name__, type(value).__name__)
    if len(text) > 60:
        text = f"{text[:40]}..."
    plain = kind in text or value is None or isinstance(value, str | int | float)
    return text if plain else f"{text}, {_article(kind)}"


def _article(noun: str) -> str:
    return f"{'an' if noun[:1].lower() in 'aeiou' else 'a'} {noun}"
