"""What a file may claim before it is believed: bytes of numbers, memory and time of its reader."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from mgdd.errors import DataError

_MEMORY, _SECONDS = "MGDD_READ_LIMIT_MB", "MGDD_READ_LIMIT_S"
_MB = 1 << 20
# Numbers that any file may hold: with the copies that are made of them a reader and its caller stay below 1 GB.
_BELIEVED_MB = 128
# Times its own size that a file may hold; measured records compress 2 to 10 times, Deflate goes to 1032.
_EXPANSION = 20
# Of a reader at work, beside what it reads: buffers of libraries, tables of names.
_WORKING_MB = 384
# Of computing. openpyxl takes 2 s per MB of a sheet; the others read 10 MB a second at least, or 2 column by column.
_START_S, _PER_MB_S, _PER_MB_OF_SHEET_S = 3.0, 0.5, 4.0


def _setting(name: str) -> float | None:
    text = os.environ.get(name)
    if not text:
        return None
    with contextlib.suppress(ValueError):
        value = float(text)
        if 0.0 < value < 1e9:
            return value
    raise DataError.of(name, text, "a number > 0; it stands in the environment of the process")


@dataclass(frozen=True)
class ReadLimits:
    """Limits of reading one file: bytes of numbers that are believed, bytes of its reader, seconds of computing.

    ``MGDD_READ_LIMIT_MB`` and ``MGDD_READ_LIMIT_S`` in the environment stand above what follows from its size.
    """

    file: Path
    size: int
    believed: int
    memory: int
    seconds: float

    @classmethod
    def of(cls, file: Path, form: str = "") -> ReadLimits:
        """Look at the size of a file of a format, and at the environment."""
        size, megabytes, seconds = file.stat().st_size, _setting(_MEMORY), _setting(_SECONDS)
        believed = max(_BELIEVED_MB * _MB, _EXPANSION * size) if megabytes is None else int(megabytes * _MB)
        if seconds is None:
            # What a larger setting lets in takes its time too, as fast as 10 MB a second.
            per_mb = _PER_MB_OF_SHEET_S if form.startswith("XLSX") else _PER_MB_S
            seconds = _START_S + max(per_mb * size / _MB, (megabytes or 0.0) / 10.0)
        return cls(file, size, believed, _WORKING_MB * _MB + 3 * max(believed, size), seconds)

    def require(self, claimed: int, what: str) -> None:
        """Refuse numbers of so many bytes in the file."""
        if claimed > self.believed:
            raise DataError(
                f"{self.file}: {what} claims {_megabytes(claimed)} MB, and the file has {self.size} bytes: not "
                f"read; if that is right, set {_MEMORY}={_megabytes(claimed)} in the environment"
            )

    def require_free(self, needed: int) -> None:
        """Refuse so many bytes in this process, where they would fill the memory of the machine."""
        most = _machine()
        if most is not None and needed > most // 2:
            raise DataError(
                f"{self.file}: {_megabytes(needed)} MB of numbers, and this machine has {_megabytes(most)} MB: read "
                "fewer columns, or a record of pressure in parts by mgdd.io.pressure_chunks"
            )

    def too_much_memory(self) -> DataError:
        """Make the error of a reader that asked for more than its memory."""
        return DataError(
            f"{self.file}: its reader needs more than {_megabytes(self.memory)} MB for {self.size} bytes: the file is "
            f"damaged, or claims more than it has; if it is right, set {_MEMORY} in the environment, now "
            f"{_megabytes(self.believed)}"
        )

    def too_much_time(self) -> DataError:
        """Make the error of a reader that came to no end."""
        return DataError(
            f"{self.file}: its reader came to no end in {self.seconds:.0f} s: the file is damaged, or claims more than "
            f"its {self.size} bytes; if it is right, set {_SECONDS} in the environment to more seconds"
        )


def _megabytes(count: int) -> int:
    return -(-count // _MB)


def _machine() -> int | None:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # no such question on Windows
        return None
