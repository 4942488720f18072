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
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from mgdd._arguments import shown
from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.io.read_limits import ReadLimits

# Letters of more than one byte as UTF-8 has them; in older encodings they would be pairs as "Ã¤" or "Â°".
_UTF8 = re.compile(rb"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}|[\xf0-\xf4][\x80-\xbf]{3}")
_SPECIAL = {stat.S_ISFIFO: "a pipe", stat.S_ISCHR: "a device", stat.S_ISBLK: "a device", stat.S_ISSOCK: "a socket"}
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_BLOCK = 1 << 20  # bytes that are looked at before a whole file is in memory
_WHOLE = 1 << 24  # bytes; less is read at once, whatever it holds
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
        status = file.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:  # ValueError: what cannot be handed to the system at all
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise ParameterError.of("path", str(file), f"one that can be looked up ({why}): give another") from error
    else:
        mode = status.st_mode
        if stat.S_ISDIR(mode):
            raise ParameterError.of("path", str(file), "a file, and this is a folder: name a file in it")
        if not stat.S_ISREG(mode):
            what = next((name for is_one, name in _SPECIAL.items() if is_one(mode)), "no plain file")
            raise ParameterError.of("path", str(file), f"a plain file, and this is {what}: write its content to one")
        if not status.st_size and _gives_bytes(file):
            what = "a plain file, and this one of the running system has no size: copy it to one"
            raise ParameterError.of("path", str(file), what)
        return file
    near = ""
    with contextlib.suppress(OSError):  # no such folder either, or one that must not be listed
        near = did_you_mean(file.name, (other.name for other in file.parent.iterdir()))
    raise FileNotFoundError(errno.ENOENT, f"no such file: {near or 'check the path'}", str(file))


def _gives_bytes(file: Path) -> bool:
    """Whether a file gives bytes beyond its size, or would do so later, as those of /proc do."""
    try:
        number = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return False  # who reads it says why
    try:
        return bool(os.read(number, 1))
    except OSError:
        return True
    finally:
        os.close(number)


@dataclass(frozen=True)
class Stamp:
    """Size and time of a file that is read in parts, which must not change meanwhile."""

    file: Path
    size: int
    written_ns: int

    @classmethod
    def of(cls, file: Path) -> Stamp:
        """Look at a file."""
        now = file.stat()
        return cls(file, now.st_size, now.st_mtime_ns)

    def require_same(self) -> None:
        """Raise a DataError where the file is another one by now."""
        try:
            now = Stamp.of(self.file)
        except OSError as error:
            raise DataError(f"{self.file}: gone while it was read ({error.strerror}): read it again") from error
        if now != self:
            sizes = f", from {self.size} to {now.size} bytes" if now.size != self.size else ""
            raise DataError(f"{self.file}: changed while it was read{sizes}: read it again once it is complete")


def read_plain_text(path: str | os.PathLike[str], *, only_utf8: bool = False) -> str:
    """Read a text file that `existing_file` finds and `decoded` takes."""
    file = existing_file(path)
    if file.stat().st_size > _WHOLE:
        with file.open("rb") as stream:
            # A file with holes, as any binary one, is none of text: seen before it is in memory.
            if not stream.read(2).startswith(_UTF16):
                while block := stream.read(_BLOCK):
                    if b"\0" in block:
                        raise _binary(str(file))
    return decoded(bytes_of(file), str(file), only_utf8=only_utf8)


def bytes_of(file: Path) -> bytes:
    """Read a file as far as its size says, in memory that this machine has."""
    limits = ReadLimits.of(file)
    limits.require_free(limits.size)
    with file.open("rb") as stream:
        content = stream.read(limits.size + 1)
    if len(content) > limits.size:
        raise DataError(f"{file}: gives more than the {limits.size} bytes of its size: read it once it is complete")
    return content


def decoded(raw: bytes, origin: str, *, only_utf8: bool = False, line: int = 1) -> str:
    """Decode a text: UTF-8, UTF-16 that begins with its mark, or Windows-1252 as older tools write it."""

    def refused(error: UnicodeDecodeError, said: str) -> DataError:
        at = raw.count(b"\n", 0, error.start) + line
        return DataError(f"{origin}, line {at}: {said}")

    if raw.startswith(_UTF16):
        if only_utf8:
            raise DataError(f"{origin}: not a UTF-8 text file but UTF-16: save it as UTF-8")
        try:
            return raw.decode("utf-16")
        except UnicodeDecodeError as error:
            raise DataError(f"{origin}: damaged UTF-16 at byte {error.start}: write it again, as UTF-8") from error
    if b"\0" in raw:
        raise _binary(origin)
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


def _binary(origin: str) -> DataError:
    return DataError(f"{origin}: this is a binary file: export it as text in UTF-8")


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
