"""The one way into TOML and JSON: what a text nests and counts is bounded, and nothing stands in it twice."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable
from typing import Any, Literal

from mgdd.errors import DataError

__all__ = ["parsed"]

_DEEPEST = 64  # levels
_WIDEST = 64  # bits of a whole number, with or without a sign


def parsed(
    text: str, origin: str, form: Literal["TOML", "JSON"], decode: Callable[[dict[str, Any]], Any] | None = None
) -> Any:
    """Parse a text that nests values.

    Parameters
    ----------
    text : str
        The text.
    origin : str
        The file, for messages.
    form : {"TOML", "JSON"}
        How it is written.
    decode : callable, optional
        What becomes of each object of a JSON text, the innermost first.

    Returns
    -------
    object
        Dicts, lists, texts and numbers.

    Raises
    ------
    mgdd.errors.DataError
        Another form, a key that stands twice in an object, more than 64 levels, a number beyond all floats or 64 bits.

    Examples
    --------
    >>> from mgdd.errors import DataError
    >>> from mgdd.io.nesting import parsed
    >>> parsed("[[1]]", "a.json", "JSON")
    [[1]]
    >>> try:
    ...     parsed("[" * 5000 + "]" * 5000, "a.json", "JSON")
    ... except DataError as error:
    ...     print(error)
    a.json: nests more than 64 levels deep: correct the brackets
    """
    too_deep = f"{origin}: nests more than {_DEEPEST} levels deep: correct the brackets"
    try:
        if form == "TOML":
            content: Any = tomllib.loads(text, parse_float=_number)
        else:
            content = json.loads(text, parse_float=_number, object_pairs_hook=lambda pairs: _object(pairs, decode))
    except RecursionError:
        raise DataError(too_deep) from None
    except ValueError as error:
        # A plain one comes from `int`, which reads no more than some thousand digits.
        said = "a whole number has too many digits" if type(error) is ValueError else error
        raise DataError(f"{origin}: not valid {form}: {said}: correct the file, or write it again") from error
    level = [content]
    for _ in range(_DEEPEST + 1):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                inner.extend(value.values())
            elif isinstance(value, list):
                inner.extend(value)
            elif isinstance(value, int) and value.bit_length() > _WIDEST:
                raise DataError(f"{origin}: a whole number of {value.bit_length()} bits: at most {_WIDEST} are read")
        if not inner:
            return content
        level = inner
    raise DataError(too_deep)


def _object(pairs: list[tuple[str, Any]], decode: Callable[[dict[str, Any]], Any] | None) -> Any:
    made = dict(pairs)
    if len(made) < len(pairs):
        names = [name for name, _ in pairs]
        raise DataError(f"the key {next(name for name in made if names.count(name) > 1)!r} stands twice")
    return made if decode is None else decode(made)


def _number(text: str) -> float:
    """Read a decimal number; one beyond all floats is refused where its digits do not say that it is infinite."""
    number = float(text)
    if math.isinf(number) and "inf" not in text:
        raise DataError(f"{text} is beyond the range of numbers")
    return number
