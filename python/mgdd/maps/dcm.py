"""DCM files (data conservation format 2.0): curves, maps and single values as calibration tools exchange them.

The text format, as files of several tools have it: a line ``KONSERVIERUNG_FORMAT 2.0``, then blocks from a keyword with
the name and its sizes to ``END``. Inside of a block stand ``LANGNAME`` and ``EINHEIT_X``, ``_Y``, ``_W`` (quoted
texts), ``ST/X`` and ``ST/Y`` (breakpoints) and ``WERT`` (values), these over as many lines as they need; in a map each
``ST/Y`` is followed by the values of its row. Lines that begin with ``*``, ``!`` or ``.`` are comments; ``*SSTX`` and
``*SSTY`` name the axes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mgdd.errors import DataError, did_you_mean

__all__ = ["DcmBlock", "dcm_blocks", "dcm_text"]

_HEAD = "KONSERVIERUNG_FORMAT"
_VERSION = "2.0"
_PER_LINE = 6  # some readers take no longer lines
# Keyword: number of axes. Fixed and group forms keep their breakpoints elsewhere in the control unit, not in the file.
_AXES = {
    "FESTWERT": 0, "KENNLINIE": 1, "FESTKENNLINIE": 1, "GRUPPENKENNLINIE": 1,
    "KENNFELD": 2, "FESTKENNFELD": 2, "GRUPPENKENNFELD": 2,
}  # fmt: skip
_OTHER = (
    "FESTWERTEBLOCK", "STUETZSTELLENVERTEILUNG", "TEXTSTRING", "FUNKTIONEN", "VARIANTENKODIERUNG", "GRUPPENPARAMETER",
)  # fmt: skip
_TEXTS = {"LANGNAME": "long_name", "EINHEIT_X": "unit_x", "EINHEIT_Y": "unit_y", "EINHEIT_W": "unit"}
_IGNORED = ("FUNKTION", "DISPLAYNAME", "VAR", "TEXT")


@dataclass(kw_only=True)
class DcmBlock:
    """A value, curve or map of a file.

    Parameters
    ----------
    name : str
        Of the label.
    x, y : list of float
        Breakpoints; empty where there is no such axis.
    values : list of list of float
        One row per entry of y, one number per entry of x.
    long_name, unit, unit_x, unit_y, axis_x, axis_y : str
        Texts, empty where the file says nothing.
    line : int
        Where the block begins, for messages.
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
    line: int = 0


class _Line(NamedTuple):
    number: int
    word: str
    rest: str


def dcm_text(blocks: Sequence[DcmBlock], comments: Sequence[str]) -> str:
    """Give the text of a file; numbers come back bit for bit."""
    out = [*(f"* {comment}" for comment in comments), "", f"{_HEAD} {_VERSION}", ""]
    for block in blocks:
        keyword = "KENNFELD" if block.y else "KENNLINIE" if block.x else "FESTWERT"
        sizes = "".join(f" {len(entries)}" for entries in (block.x, block.y) if entries)
        out.append(f"{keyword} {block.name}{sizes}")
        out.append(_said("LANGNAME", block.long_name))
        units = {"EINHEIT_X": block.unit_x, "EINHEIT_Y": block.unit_y, "EINHEIT_W": block.unit}
        used = ("EINHEIT_W",) if not block.x else ("EINHEIT_X", "EINHEIT_W") if not block.y else tuple(units)
        out += [_said(word, units[word]) for word in used]
        out += [f"*{word}   {axis}" for word, axis in (("SSTX", block.axis_x), ("SSTY", block.axis_y)) if axis]
        out += _numbers("ST/X", block.x)
        for place, row in enumerate(block.values):
            out += _numbers("ST/Y", block.y[place : place + 1])
            out += _numbers("WERT", row)
        out += ["END", ""]
    return "\n".join(out)


def dcm_blocks(text: str, origin: str) -> tuple[list[DcmBlock], list[str]]:
    """Read values, curves and maps, and name the blocks of other kinds, which are skipped."""
    lines = _lines(text)
    first = next(lines, None)
    if first is None or first.word != _HEAD:
        said = "the file is empty" if first is None else f"line {first.number}: {first.word!r}"
        raise DataError(f"{origin}: {said}: a DCM file begins with {_HEAD} {_VERSION}")
    if first.rest.split()[:1] != [_VERSION]:
        raise DataError(f"{origin}, line {first.number}: {_HEAD} {first.rest}: only {_VERSION} is read; export that")
    blocks: list[DcmBlock] = []
    skipped: list[str] = []
    for line in lines:
        if line.word in _AXES:
            block = _block(line, lines, origin)
            if block is None:
                skipped.append(f"{line.word} {line.rest}")
                continue
            if block.name in {other.name for other in blocks}:
                raise DataError(f"{origin}, line {line.number}: {block.name} stands in the file twice: keep one")
            blocks.append(block)
        elif line.word in _OTHER:
            skipped.append(f"{line.word} {line.rest}".strip())
            if not any(inner.word == "END" for inner in lines):
                raise DataError(f"{origin}, line {line.number}: {line.word} has no END: the file was cut off")
        elif line.word not in ("MODULKOPF", *_COMMENTS):
            near = did_you_mean(line.word, (*_AXES, *_OTHER)) or "correct it or make it a comment with *"
            raise DataError(f"{origin}, line {line.number}: unknown keyword {line.word!r}: {near}")
    return blocks, skipped


_COMMENTS = ("*SSTX", "*SSTY")


def _lines(text: str) -> Iterator[_Line]:
    """Give word and rest of every line that is not empty; of the comments only those that name an axis."""
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        word, _, rest = line.partition(" ") if " " in line else line.partition("\t")
        if not line or (line[0] in "*!." and word not in _COMMENTS):
            continue
        yield _Line(number, word, rest.strip())


def _block(head: _Line, lines: Iterator[_Line], origin: str) -> DcmBlock | None:
    """Read a block up to its END, or None for a value that is a text."""
    where = f"{origin}, line {head.number}"
    name, *sizes = head.rest.split()[: 1 + _AXES[head.word]] or [""]
    if not name or len(sizes) != _AXES[head.word] or not all(re.fullmatch(r"\d{1,9}", size) for size in sizes):
        raise DataError(f"{where}: {head.word} {head.rest}: a name and {_AXES[head.word]} sizes are needed")
    block = DcmBlock(name=name, line=head.number)
    rows: list[list[float]] = []
    is_text = False
    for line in lines:
        at = f"{origin}, line {line.number}"
        if line.word == "END":
            break
        if line.word in _TEXTS:
            setattr(block, _TEXTS[line.word], _unquoted(line.rest, at))
        elif line.word in _COMMENTS:
            setattr(block, "axis_x" if line.word == "*SSTX" else "axis_y", line.rest)
        elif line.word == "ST/X":
            block.x += _floats(line.rest, at)
        elif line.word == "ST/Y":
            found = _floats(line.rest, at)
            block.y += found
            rows += [[] for _ in found]
        elif line.word == "WERT":
            if not rows:
                rows.append([])
            rows[-1] += _floats(line.rest, at)
        elif line.word in _IGNORED:
            is_text = is_text or line.word == "TEXT"
        else:
            ended = line.word in (*_AXES, *_OTHER)
            remedy = f"{head.word} {name} has no END: the file was cut off" if ended else "correct it"
            raise DataError(f"{at}: {line.word!r} inside of {head.word} {name}: {remedy}")
    else:
        raise DataError(f"{where}: {head.word} {name} has no END: the file was cut off")
    if is_text and not rows:
        return None
    block.values = rows
    _check_counts(block, [int(size) for size in sizes], where)
    return block


def _check_counts(block: DcmBlock, sizes: Sequence[int], where: str) -> None:
    wide, deep = [*sizes, 1, 1][:2]
    counts: Mapping[str, tuple[int, int]] = {
        "ST/X": (len(block.x), wide if sizes else 0),
        "ST/Y": (len(block.y), deep if len(sizes) > 1 else 0),
        "rows of WERT": (len(block.values), deep),
    }
    for word, (found, needed) in counts.items():
        if found != needed:
            raise DataError(f"{where}: {block.name} has {found} {word}: its head says {needed}; add what is missing")
    for row, values in enumerate(block.values):
        if len(values) != wide:
            at = f" at ST/Y {block.y[row]:g}" if block.y else ""
            raise DataError(
                f"{where}: {block.name} has {len(values)} values{at}: its head says {wide}; add what is missing"
            )


def _said(word: str, text: str) -> str:
    return f'   {word:<13} "{text}"'


def _numbers(word: str, numbers: Sequence[float]) -> list[str]:
    parts = [numbers[start : start + _PER_LINE] for start in range(0, len(numbers), _PER_LINE)]
    return [f"   {word:<13} {'   '.join(repr(float(number)) for number in part)}" for part in parts]


def _unquoted(text: str, where: str) -> str:
    if len(text) < 2 or text[0] != '"' or text[-1] != '"':
        raise DataError(f"{where}: {text!r}: a text stands in quotes")
    return text[1:-1]


def _floats(text: str, where: str) -> list[float]:
    numbers = []
    for word in re.split(r"\s+", text) if text else []:
        try:
            number = float(word)
        except ValueError:
            raise DataError(f"{where}: {word!r} is not a number: correct it") from None
        if not np.isfinite(number) or "_" in word:
            raise DataError(f"{where}: {word!r} is not a finite number: correct it")
        numbers.append(number)
    return numbers
