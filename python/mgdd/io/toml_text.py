"""The one reader of TOML: text of a file, and its tables."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

from mgdd.errors import DataError
from mgdd.io.existing_file import existing_file

if TYPE_CHECKING:
    import os

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
    file = existing_file(path)
    try:
        return file.read_text(encoding="utf-8"), str(file)
    except UnicodeDecodeError as error:
        raise DataError(f"{file}: not a UTF-8 text file: {error}") from error


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
        Not TOML.

    Examples
    --------
    >>> from mgdd.io.toml_text import toml_of
    >>> toml_of("[plant]\nseed = 3", "experiment")
    {'plant': {'seed': 3}}
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{origin}: not valid TOML: {error}") from error
