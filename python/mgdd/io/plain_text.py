"""The one reader of text files: which encoding they have, and what is not text."""

from __future__ import annotations

import codecs
import re
from typing import TYPE_CHECKING

from mgdd.errors import DataError
from mgdd.io.existing_file import existing_file

if TYPE_CHECKING:
    import os

__all__ = ["decoded", "read_plain_text"]

# Letters of more than one byte as UTF-8 has them; in older encodings they would be pairs as "Ã¤" or "Â°".
_UTF8 = re.compile(rb"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}|[\xf0-\xf4][\x80-\xbf]{3}")


def read_plain_text(path: str | os.PathLike[str], *, only_utf8: bool = False) -> str:
    """Read a text file.

    Parameters
    ----------
    path : path-like
        The file.
    only_utf8 : bool
        Whether its form allows no other encoding, as TOML and JSON do.

    Returns
    -------
    str
        What stands in it.

    Raises
    ------
    FileNotFoundError
        No such file.
    mgdd.errors.ParameterError
        A folder, or a path that cannot be looked up.
    mgdd.errors.DataError
        Not text, or of no known encoding.
    """
    file = existing_file(path)
    return decoded(file.read_bytes(), str(file), only_utf8=only_utf8)


def decoded(raw: bytes, origin: str, *, only_utf8: bool = False) -> str:
    """Decode a text: UTF-8, UTF-16 that begins with its mark, or Windows-1252 as older tools write it.

    Parameters
    ----------
    raw : bytes
        Content of a file.
    origin : str
        The file, for messages.
    only_utf8 : bool
        Whether its form allows no other encoding.

    Returns
    -------
    str
        The text, without the mark at its beginning.

    Raises
    ------
    mgdd.errors.DataError
        Not text, damaged UTF-8, or of no known encoding.

    Examples
    --------
    >>> from mgdd.io.plain_text import decoded
    >>> [decoded(text.encode(name), "a.csv") for name in ("utf-8", "cp1252", "utf-16") for text in ("20 °C",)]
    ['20 °C', '20 °C', '20 °C']
    """
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        if only_utf8:
            raise DataError(f"{origin}: not a UTF-8 text file but UTF-16: save it as UTF-8")
        try:
            return raw.decode("utf-16")
        except UnicodeDecodeError as error:
            raise DataError(f"{origin}: damaged UTF-16 at byte {error.start}: write it again, as UTF-8") from error
    if b"\0" in raw:
        raise DataError(f"{origin}: this is a binary file: export it as text in UTF-8")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if only_utf8:
            raise _refused(raw, origin, error, f"not a UTF-8 text file, {error.reason}: save it as UTF-8") from error
        if _UTF8.search(raw):
            raise _refused(raw, origin, error, f"damaged UTF-8, {error.reason}: correct the letter there") from error
    try:
        return raw.decode("cp1252")
    except UnicodeDecodeError as error:
        byte = f"{raw[error.start]:#x}"
        said = f"byte {byte} is neither UTF-8 nor Windows-1252: save it as UTF-8"
        raise _refused(raw, origin, error, said) from error


def _refused(raw: bytes, origin: str, error: UnicodeDecodeError, said: str) -> DataError:
    line = raw.count(b"\n", 0, error.start) + 1
    return DataError(f"{origin}, line {line}: {said}")
