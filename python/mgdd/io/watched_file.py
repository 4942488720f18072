"""A file as libraries read it that believe what is damaged."""

from __future__ import annotations

import io
from typing import IO, Any

_CIRCLES = 10_000  # that a reader may go; what many channels share is read as often
_LONG = 1 << 16  # bytes, from which on what is left of the file is looked at


class WatchedFile(io.BufferedIOBase):
    """A file that gives what there is where a length is damaged, and notices who reads in a circle."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self.forget()

    def forget(self) -> None:
        """Begin to watch anew: who reads part after part is at one place as often as there are parts."""
        self._count, self._mark, self._met = 0, -1, 0

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Go to a byte."""
        return self._stream.seek(offset, whence)

    def tell(self) -> int:
        """Return where it stands."""
        return self._stream.tell()

    def fileno(self) -> int:
        """Return its number, for a map of it."""
        return self._stream.fileno()

    def readinto(self, buffer: Any, /) -> int:
        """Fill an array as far as there are bytes."""
        found: int = self._stream.readinto(buffer)  # type: ignore[attr-defined]
        return found

    def write(self, data: Any, /) -> int:
        """Write into a copy."""
        return self._stream.write(data)

    def read(self, size: int | None = -1, /) -> bytes:
        """Return so many bytes, or those that are left."""
        at, self._count = self.tell(), self._count + 1
        if at == self._mark:
            self._met += 1
            if self._met > _CIRCLES:
                raise ValueError(f"its blocks name each other in a circle, the one at byte {at} among them")
        if self._count.bit_count() == 1:  # a power of two: within the circle in the end, as Brent finds cycles
            self._mark, self._met = at, 0
        if size is None or size < 0:
            return self._stream.read()
        if size > _LONG:
            size = min(size, max(self.seek(0, io.SEEK_END) - at, 0))
            self.seek(at)
        return self._stream.read(size)
