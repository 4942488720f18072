"""What a record gained since the last look: it may still be written, be cut, be replaced, or be no record at all."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mgdd._core import rig as core
from mgdd.errors import Error

_HEAD = struct.Struct("<IIBBHIq")  # length, crc32, kind, flags, two numbers, stamp: see docs/rig_record.md
_FRAME, _NAMES, _SAMPLE, _EVENT = 1, 2, 3, 4
_NO_PAYLOAD, _LAST_ID = 2 | 32, 0x1FFF_FFFF  # news of a bus error, request of a frame
_SMALLEST, _LARGEST = 16, 1 << 20
_AT_ONCE = 1 << 23  # bytes of one look: the page of a long record stays awake


class News(NamedTuple):
    """What came: rows by table with their stamps [ns], events as (stamp, category, text), frames of a bus."""

    rows: dict[str, tuple[list[str], NDArray[np.int64], NDArray[np.float64]]]
    events: list[tuple[int, str, str]]
    frames: list[core.Frame]
    restarted: bool = False  # what was read before belongs to another file


class RecordTail:
    """Follows a record file; ``trouble`` says what stands against reading on, ``behind`` how many bytes wait."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.trouble = ""
        self.behind = self.size = 0
        self.start_ns = 0
        self._forget()

    def _forget(self) -> None:
        self._file: tuple[int, int] | None = None
        self._at = 0
        self._names: dict[tuple[int, int], tuple[str, list[str]]] = {}

    def look(self) -> News:
        """Read on; nothing of it raises."""
        news = News({}, [], [])
        try:
            with self.path.open("rb") as file:
                status = self.path.stat()
                same, self.size = (status.st_dev, status.st_ino), status.st_size
                if self._file is not None and (same != self._file or status.st_size < self._at):
                    self._forget()
                    news = news._replace(restarted=True)
                if self._file is None:
                    self.start_ns = int(core.RecordReader(str(self.path)).header["monotonic_ns"])
                    self._at = 52 + int.from_bytes(file.read(16)[12:16], "little")
                    self._file = same
                file.seek(self._at)
                data = file.read(_AT_ONCE)
                self.behind = max(0, status.st_size - self._at - len(data))
        except Error as error:  # no record, or of another version
            self.trouble = str(error)
            return news
        except OSError as error:
            self.trouble = f"{self.path}: {error.strerror or error}"
            return news
        return news._replace(rows=self._read(data, news))

    def _read(self, data: bytes, news: News) -> dict[str, tuple[list[str], NDArray[np.int64], NDArray[np.float64]]]:
        at, view, raw = 0, memoryview(data), dict[tuple[int, int], tuple[list[int], list[memoryview]]]()
        self.trouble = ""
        while len(data) - at >= _HEAD.size:
            length, crc, kind, flags, first, second, stamp = _HEAD.unpack_from(data, at)
            end = at + 8 + length
            if _SMALLEST <= length <= _LARGEST and end > len(data):
                break  # it is being written
            if not _SMALLEST <= length <= _LARGEST or zlib.crc32(view[at + 8 : end]) != crc:
                self.trouble = (
                    f"{self.path}: damaged at byte {self._at + at}: what follows is not shown; "
                    "mgdd.rig.repair_record keeps it"
                )
                break
            body = view[at + _HEAD.size : end]
            if kind == _SAMPLE and len(body) == 8 * second:
                stamps, bodies = raw.setdefault((first, second), ([], []))
                stamps.append(stamp)
                bodies.append(body)
            elif kind == _NAMES:
                table, *columns = _texts(body, second + 1)
                self._names[first, second] = table, columns
            elif kind == _EVENT:
                news.events.append((stamp, _text(body[:first]), _text(body[first : first + second])))
            elif kind == _FRAME and not flags & _NO_PAYLOAD and second <= _LAST_ID and len(body) <= 8 + 64:
                payload = bytes(body[8:])
                news.frames.append(core.Frame(id=second, data=payload, extended=bool(flags & 1), monotonic_ns=stamp))
            at = end
        self._at += at
        return {
            table: (columns, np.array(stamps, np.int64), np.frombuffer(b"".join(bodies), "<f8").reshape(-1, width))
            for (number, width), (stamps, bodies) in raw.items()
            if width
            for table, columns in [self._named(number, width)]
        }

    def _named(self, number: int, width: int) -> tuple[str, list[str]]:
        return self._names.get((number, width), (f"table_{number}", [f"value_{place}" for place in range(width)]))


def _texts(body: memoryview, count: int) -> list[str]:
    out, at = [], 0
    for _ in range(count):
        size = int.from_bytes(body[at : at + 2], "little")
        out.append(_text(body[at + 2 : at + 2 + size]))
        at += 2 + size
    return out


def _text(raw: memoryview) -> str:
    return bytes(raw).decode("utf-8", "backslashreplace")
