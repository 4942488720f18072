"""The one reader of TOML: text of a file, and its tables."""

from __future__ import annotations

import os
from typing import Any

from mgdd.io.nesting import parsed
from mgdd.io.plain_text import read_plain_text

__all__ = ["text_of", "toml_of"]


def text_of(path: str | os.PathLike[str]) -> tuple[str, str]:
    """Read a text file.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    text, origin : str
        What stands in it, and the file, for messages.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.DataError
        Not UTF-8.
    """
    return read_plain_text(path, only_utf8=True), os.fspath(path)


def toml_of(text: str, origin: str) -> dict[str, Any]:
    r"""Read TOML.

    Parameters
    ----------
    text : str
        The text.
    origin : str
        The file, for the message.

    Returns
    -------
    dict
        Its keys.

    Raises
    ------
    mgdd.errors.DataError
        Not TOML, nested more than 64 levels deep, or a number beyond all floats or 64 bits.

    Examples
    --------
    >>> from mgdd.io.toml_text import toml_of
    >>> toml_of("[plant]\nseed = 3", "experiment")
    {'plant': {'seed': 3}}
    """
    content: dict[str, Any] = parsed(text, origin, "TOML")
    return content
