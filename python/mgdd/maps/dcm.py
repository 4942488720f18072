"""DCM files (data conservation format 2.0): curves, maps and single values as calibration tools exchange them.

The text format, as files of several tools have it: a line ``KONSERVIERUNG_FORMAT 2.0``, then blocks from a keyword with
the name and its sizes to ``END``. Inside of a block stand ``LANGNAME`` and ``EINHEIT_X``, ``_Y``, ``_W`` (quoted
texts), ``ST/X`` and ``ST/Y`` (breakpoints) and ``WERT`` (values), these over as many lines as they need; in a map each
``ST/Y`` is followed by the values of its row. Lines that begin with ``*``, ``!`` or ``.`` are comments; ``*SSTX`` and
``*SSTY`` name the axes, and the ``STUETZSTELLENVERTEILUNG`` that holds the breakpoints of a group map.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mgdd.errors import DataError, did_you_mean

_HEAD = "KONSERVIERUNG_FORMAT"
_VERSION = "2.0"
_PER_LINE = 6  # some readers take no longer lines
_POINTS = "STUETZSTELLENVERTEILUNG"
# Keyword: number of axes. Fixed and group forms keep their breakpoints elsewhere in the control unit.
_AXES = {
    "FESTWERT": 0, "KENNLINIE": 1, "FESTKENNLINIE": 1, "GRUPPENKENNLINIE": 1, _POINTS: 1,
    "KENNFELD": 2, "FESTKENNFELD": 2, "GRUPPENKENNFELD": 2,
}  # fmt: skip
_OTHER = ("FESTWERTEBLOCK", "TEXTSTRING", "FUNKTIONEN", "VARIANTENKODIERUNG", "GRUPPENPARAMETER")
_TEXTS = {"LANGNAME": "long_name", "EINHEIT_X": "unit_x", "EINHEIT_Y": "unit_y", "EINHEIT_W": "unit"}
_IGNORED = ("FUNKTION", "DISPLAYNAME", "VAR", "TEXT")
_COMMENTS = {"*SSTX": "axis_x", "*SSTY": "axis_y", "*SST": "axis_x"}


@dataclass(kw_only=True)
class DcmBlock:
    """A value, curve or map of a file: one row of values per entry of y; axes and texts that it lacks are empty.

    `sizes` are the entries of the axes as the head gives them; `is_axis` marks one with breakpoints alone, in x.
    """

    name: str
    x: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)
    long_name: str = ""
    unit: str = ""
    unit_x: str = ""
    unit_y: str = ""
    axis_x: str = ""
    axis_y: str = ""
    sizes: list[int] = field(default_factory=list)
    line: int = 0
    is_axis: bool = False


class _Line(NamedTuple):
    number: int
    word: str
    rest: str


def dcm_text(blocks: Sequence[DcmBlock], comments: Sequence[str]) -> str:
    """Give the text of a file; numbers come back bit for bit."""
    lines = [*(f"* {comment}" for comment in comments), "", f"{_HEAD} {_VERSION}", ""]
    for block in blocks:
        keyword = "KENNFELD" if block.y else "KENNLINIE" if block.x else "FESTWERT"
        sizes = "".join(f" {len(entries)}" for entries in (block.x, block.y) if entries)
        lines.append(f"{keyword} {block.name}{sizes}")
        lines.append(_line("LANGNAME", block.long_name))
        units = {"EINHEIT_X": block.unit_x, "EINHEIT_Y": block.unit_y, "EINHEIT_W": block.unit}
        used = ("EINHEIT_W",) if not block.x else ("EINHEIT_X", "EINHEIT_W") if not block.y else tuple(units)
        lines += [_line(word, units[word]) for word in used]
        lines += [f"*{word}   {axis}" for word, axis in (("SSTX", block.axis_x), ("SSTY", block.axis_y)) if axis]
        lines += _numbers("ST/X", block.x)
        for place, row in enumerate(block.values):
            lines += _numbers("ST/Y", block.y[place : place + 1])
            lines += _numbers("WERT", row)
        lines += ["END", ""]
    return "\n".join(lines)


def dcm_blocks(text: str, origin: str) -> tuple[list[DcmBlock], list[str]]:
    """Read values, curves, maps and breakpoints, and name what is skipped: other blocks, unknown keywords."""
    lines = _lines(text)
    first = lines.pop(0) if lines else None
    if first is None or first.word != _HEAD:
        place = "the file is empty" if first is None else f"line {first.number}: {first.word[:60]!r}"
        raise DataError(f"{origin}: {place}: a DCM file begins with {_HEAD} {_VERSION}")
    if first.rest.split()[:1] != [_VERSION]:
        raise DataError(f"{origin}, line {first.number}: {_HEAD} {first.rest}: only {_VERSION} is read; export that")
    blocks: dict[str, DcmBlock] = {}
    skipped: list[str] = []
    lines.reverse()  # the next one stands last
    while lines:
        line = lines.pop()
        if line.word in _AXES:
            block, unknown = _block(line, lines, origin)
            skipped += unknown
            if block is None:
                continue
            if block.name in blocks:
                raise DataError(f"{origin}, line {line.number}: {block.name} stands in the file twice: keep one")
            blocks[block.name] = block
        elif line.word in _OTHER:
            skipped.append(f"{line.word} {line.rest}".strip())
            if _skip(lines) != "END":
                raise DataError(f"{origin}, line {line.number}: {line.word} has no END: the file was cut off")
        elif line.word not in ("MODULKOPF", *_COMMENTS):
            near = did_you_mean(line.word, (*_AXES, *_OTHER))
            if near or line.word == "END":
                remedy = near or "it ends no block; remove it"
                raise DataError(f"{origin}, line {line.number}: unknown keyword {line.word!r}: {remedy}")
            skipped.append(f"line {line.number}: {line.word[:60]}: unknown keyword")
            if not _skip(lines):
                raise DataError(
                    f"{origin}, line {line.number}: unknown keyword {line.word[:60]!r} without an END: the file was "
                    "cut off; write it again, or make the line a comment with *"
                )
    share_breakpoints(blocks)
    for block in blocks.values():
        _check_counts(block, f"{origin}, line {block.line}")
    return list(blocks.values()), skipped


def _skip(lines: list[_Line]) -> str:
    """Leave out the rest of a block; without an END what stands before the next block. Gives the word of the end."""
    for place in range(len(lines) - 1, -1, -1):
        word = lines[place].word
        if word == "END" or word in (*_AXES, *_OTHER):
            del lines[place + (word != "END") :]
            return word
    lines.clear()
    return ""


def _lines(text: str) -> list[_Line]:
    """Give word and rest of every line that is not empty; of the comments only those that name an axis."""
    words = []
    for number, raw in enumerate(text.splitlines(), start=1):
        word, *rest = raw.split(None, 1) or [""]
        if word and (word[0] not in "*!." or word in _COMMENTS):
            words.append(_Line(number, word, rest[0].strip() if rest else ""))
    return words


def _block(head: _Line, lines: list[_Line], origin: str) -> tuple[DcmBlock | None, list[str]]:
    """Read a block up to its END, or None for one whose values or breakpoints are texts; and what was skipped in it."""
    where = f"{origin}, line {head.number}"
    name, *sizes = head.rest.split()[: 1 + _AXES[head.word]] or [""]
    if not name or len(sizes) != _AXES[head.word] or not all(re.fullmatch(r"\d{1,9}", size) for size in sizes):
        raise DataError(f"{where}: {head.word} {head.rest}: a name and {_AXES[head.word]} sizes are needed")
    block = DcmBlock(name=name, line=head.number, sizes=[int(size) for size in sizes], is_axis=head.word == _POINTS)
    rows, unknown, has_text = block.values, [], False
    while lines:
        line = lines.pop()
        at = f"{origin}, line {line.number}"
        if line.word == "END":
            break
        if line.word in _TEXTS:
            setattr(block, _TEXTS[line.word], _unquoted(line.rest, at))
        elif line.word in _COMMENTS:
            setattr(block, _COMMENTS[line.word], line.rest)
        elif line.word == "ST/X":
            block.x += _floats(line.rest, at)
        elif line.word == "ST/Y":
            breakpoints = _floats(line.rest, at)
            block.y += breakpoints
            rows += [[] for _ in breakpoints]
        elif line.word == "WERT":
            if not rows:
                rows.append([])
            rows[-1] += _floats(line.rest, at)
        elif line.word in (*_AXES, *_OTHER):
            raise DataError(f"{at}: {line.word!r} inside of {head.word} {name}: this has no END: the file was cut off")
        else:
            has_text = has_text or line.word in ("TEXT", "ST_TX/X", "ST_TX/Y")
            if line.word not in (*_IGNORED, "ST_TX/X", "ST_TX/Y"):
                unknown.append(line)
    else:
        raise DataError(f"{where}: {head.word} {name} has no END: the file was cut off")
    if has_text and not (rows and len(block.x) == ([*block.sizes, 0])[0]):
        return None, [f"{head.word} {head.rest}"]
    if unknown and not rows and not block.is_axis:
        line = unknown[0]
        raise DataError(f"{origin}, line {line.number}: {line.word!r} inside of {head.word} {name}: correct it")
    return block, [f"line {line.number}: {line.word} in {head.word} {name}: unknown keyword" for line in unknown]


def share_breakpoints(blocks: Mapping[str, DcmBlock]) -> None:
    """Give group maps the breakpoints that stand in a block of their own."""
    for block in blocks.values():
        shared = blocks.get(block.axis_x) if block.sizes and not block.x and not block.is_axis else None
        if shared is not None and shared.is_axis:
            block.x, block.unit_x = list(shared.x), block.unit_x or shared.unit_x
        shared = blocks.get(block.axis_y) if len(block.sizes) > 1 and not block.y else None
        if shared is not None and shared.is_axis:
            block.y, block.unit_y = list(shared.x), block.unit_y or shared.unit_x
            wide, deep = block.sizes
            if len(block.values) == 1 != deep and wide:
                (row,) = block.values
                block.values = [row[start : start + wide] for start in range(0, len(row), wide)]


def _check_counts(block: DcmBlock, where: str) -> None:
    wide, deep = [*block.sizes, 1, 1][:2]
    counts: Mapping[str, tuple[int, int]] = {
        "ST/X": (len(block.x), wide if block.sizes else 0),
        "ST/Y": (len(block.y), deep if len(block.sizes) > 1 else 0),
        "rows of WERT": (len(block.values), 0 if block.is_axis else deep),
    }
    for word, (count, needed) in counts.items():
        if count != needed:
            raise DataError(f"{where}: {block.name} has {count} {word}: its head states {needed}; add what is missing")
    for row, values in enumerate(block.values):
        if len(values) != wide:
            at = f" at ST/Y {block.y[row]:g}" if block.y else ""
            raise DataError(
                f"{where}: {block.name} has {len(values)} values{at}: its head states {wide}; add what is missing"
            )


def _line(word: str, text: str) -> str:
    return f'   {word:<13} "{text}"'


def _numbers(word: str, numbers: Sequence[float]) -> list[str]:
    parts = [numbers[start : start + _PER_LINE] for start in range(0, len(numbers), _PER_LINE)]
    return [f"   {word:<13} {'   '.join(repr(float(number)) for number in part)}" for part in parts]


def _unquoted(text: str, where: str) -> str:
    if len(text) < 2 or text[0] != '"' or text[-1] != '"':
        raise DataError(f"{where}: {text!r}: a text stands in quotes")
    return text[1:-1]


def _floats(text: str, where: str) -> list[float]:
    return [finite_number(word, where) for word in text.split()]


def finite_number(word: str, where: str) -> float:
    """Read one number of a file."""
    try:
        number = float(word)
    except ValueError:
        raise DataError(f"{where}: {word[:60]!r} is not a number: correct it") from None
    if not np.isfinite(number) or "_" in word:
        raise DataError(f"{where}: {word[:60]!r} is not a finite number: correct it")
    return number
