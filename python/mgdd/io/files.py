"""Files of text: found, decoded, parsed where they nest values, and written whole or not at all."""

from __future__ import annotations

import codecs
import contextlib
import errno
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from mgdd._arguments import shown
from mgdd.errors import DataError, ParameterError, did_you_mean

# Letters of more than one byte as UTF-8 has them; in older encodings they would be pairs as "Ã¤" or "Â°".
_UTF8 = re.compile(rb"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}|[\xf0-\xf4][\x80-\xbf]{3}")
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_MB = 1 << 20
_DEEPEST = 64  # levels
_WIDEST = 64  # bits of a whole number, with or without a sign


def existing_file(path: str | os.PathLike[str]) -> Path:
    """Return the path of a file that is there."""
    given: object = path
    if not isinstance(given, str | os.PathLike):
        bound = (
            "the path of a file; data in memory go as they are to what uses them, as mgdd.engine.analyze(frame, "
            "cylinder) or mgdd.identify.identify_throttle(frame)"
        )
        raise ParameterError(f"path = {shown(path)}: must be {bound}", field="path", value=path, bound=bound)
    file = Path(path)
    try:
        mode = file.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:  # ValueError: what cannot be handed to the system at all
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise ParameterError.of("path", str(file), f"one that can be looked up ({why}): give another") from error
    else:
        if stat.S_ISDIR(mode):
            raise ParameterError.of("path", str(file), "a file, and this is a folder: name a file in it")
        if not stat.S_ISREG(mode):
            raise ParameterError.of("path", str(file), "a plain file, no pipe or device: write its content to one")
        return file
    near = ""
    with contextlib.suppress(OSError):  # no such folder either, or one that must not be listed
        near = did_you_mean(file.name, (other.name for other in file.parent.iterdir()))
    raise FileNotFoundError(errno.ENOENT, f"no such file: {near or 'check the path'}", str(file))


def read_plain_text(path: str | os.PathLike[str], *, only_utf8: bool = False) -> str:
    """Read a text file that `existing_file` finds and `decoded` takes."""
    file = existing_file(path)
    return decoded(bytes_of(file), str(file), only_utf8=only_utf8)


def bytes_of(file: Path) -> bytes:
    """Read a file, in memory that this machine has."""
    require_free(file, file.stat().st_size)
    return file.read_bytes()


def require_free(file: Path, needed: int) -> None:
    """Refuse so many bytes, where they would fill the memory of the machine."""
    try:
        most = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # no such question on Windows
        return
    if needed > most // 2:
        raise DataError(
            f"{file}: {-(-needed // _MB)} MB of numbers, and this machine has {most // _MB} MB: read fewer columns, or "
            "a record of pressure in parts by mgdd.io.pressure_chunks"
        )


def decoded(raw: bytes, origin: str, *, only_utf8: bool = False, line: int = 1) -> str:
    """Decode a text: UTF-8, UTF-16 that begins with its mark, or Windows-1252 as older tools write it."""

    def refused(error: UnicodeDecodeError, reason: str) -> DataError:
        at = raw.count(b"\n", 0, error.start) + line
        return DataError(f"{origin}, line {at}: {reason}")

    if raw.startswith(_UTF16):
        if only_utf8:
            raise DataError(f"{origin}: not a UTF-8 text file but UTF-16: save it as UTF-8")
        try:
            return raw.decode("utf-16")
        except UnicodeDecodeError as error:
            raise DataError(f"{origin}: damaged UTF-16 at byte {error.start}: write it again, as UTF-8") from error
    if b"\0" in raw:
        raise DataError(f"{origin}: this is a binary file: export it as text in UTF-8")
    if raw.isascii():
        return raw.decode("ascii")  # a plain copy, which the next one is not
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if only_utf8:
            raise refused(error, f"not a UTF-8 text file, {error.reason}: save it as UTF-8") from error
        if _UTF8.search(raw):
            raise refused(error, f"damaged UTF-8, {error.reason}: correct the letter there") from error
    try:
        return raw.decode("cp1252")
    except UnicodeDecodeError as error:
        byte = f"{raw[error.start]:#x}"
        raise refused(error, f"byte {byte} is neither UTF-8 nor Windows-1252: save it as UTF-8") from error


def parsed(
    text: str, origin: str, form: Literal["TOML", "JSON"], decode: Callable[[dict[str, Any]], Any] | None = None
) -> Any:
    """Parse a text that nests values: bounded in depth and in its numbers, and nothing stands in it twice."""
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
        reason = "a whole number has too many digits" if type(error) is ValueError else error
        raise DataError(f"{origin}: not valid {form}: {reason}: correct the file, or write it again") from error
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
        raise DataError(f"the key {next(name for name in made if names.count(name) > 1)!r} occurs twice")
    return made if decode is None else decode(made)


def _number(text: str) -> float:
    """Read a decimal number; one beyond all floats is refused where its digits do not say that it is infinite."""
    number = float(text)
    if math.isinf(number) and "inf" not in text:
        raise DataError(f"{text} is beyond the range of numbers")
    return number


def write_whole(path: str | os.PathLike[str], write: Callable[[Path], object]) -> None:
    """Let ``write(other)`` make a file beside `path`, and give it its name in one step once it is on the disk.

    What `write` raises is passed on, and nothing remains of it: a file that was there is as before.
    """
    whole = Path(path).resolve()  # a link stays one
    if whole.exists() and not whole.is_file():  # a terminal or a pipe has no other name
        write(whole)
        return
    half = whole.with_name(f".{whole.name}.part")
    try:
        write(half)
        with half.open("rb") as written:
            os.fsync(written.fileno())
        half.replace(whole)
    finally:
        half.unlink(missing_ok=True)


def write_whole_text(path: str | os.PathLike[str], text: str, *, encoding: str = "utf-8") -> None:
    r"""Write a text with ``\n`` at the end of its lines, as `write_whole` does."""
    write_whole(path, lambda half: half.write_text(text, encoding=encoding, newline="\n"))
