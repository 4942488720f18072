"""Small faults of a file: what a disk, an editor, a spreadsheet or a person does to it."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mgdd.errors import Error

__all__ = ["judged", "mutant_of_bytes", "mutant_of_text"]

_UNITS = ("bar", "kPa", "deg", "rad", "°CA", "mg", "g", "s", "ms", "1/s", "%", "-", "N m/rad", "rpm", "kg")
_LETTERS = '0123456789-+.eE,;\t"# =[]{}abnif\n'


def _place(rng: np.random.Generator, count: int) -> int:
    return int(rng.integers(count)) if count else 0


def _line(change: Callable[[list[str], int], None]) -> Callable[[str, np.random.Generator], str]:
    def mutate(text: str, rng: np.random.Generator) -> str:
        lines = text.split("\n")
        change(lines, _place(rng, len(lines)))
        return "\n".join(lines)

    return mutate


def _word(pattern: str, change: Callable[[str, np.random.Generator], str]) -> Callable[[str, np.random.Generator], str]:
    def mutate(text: str, rng: np.random.Generator) -> str:
        found = [*re.finditer(pattern, text)]
        if not found:
            return text
        one = found[_place(rng, len(found))]
        return text[: one.start()] + change(one[0], rng) + text[one.end() :]

    return mutate


def _letter(text: str, rng: np.random.Generator) -> str:
    at = _place(rng, len(text))
    return text[:at] + _LETTERS[_place(rng, len(_LETTERS))] + text[at + int(rng.integers(2)) :]


def _lost(text: str, rng: np.random.Generator) -> str:
    at = _place(rng, len(text))
    return text[:at] + text[at + int(rng.integers(1, 4)) :]


def _cut(text: str, rng: np.random.Generator) -> str:
    return text[: _place(rng, len(text))]


def _cells(text: str, rng: np.random.Generator) -> str:
    """Exchange two cells of a line, or lose or double one."""
    lines = text.split("\n")
    at = _place(rng, len(lines))
    cells = lines[at].split(",")
    a, b = _place(rng, len(cells)), _place(rng, len(cells))
    what = rng.integers(3)
    if what == 0:
        cells[a], cells[b] = cells[b], cells[a]
    elif what == 1:
        cells[a : a + 1] = [cells[a]] * 2
    else:
        del cells[a]
    lines[at] = ",".join(cells)
    return "\n".join(lines)


def _exchange(lines: list[str], at: int) -> None:
    lines[at], lines[at - 1] = lines[at - 1], lines[at]


def _renamed(word: str, rng: np.random.Generator) -> str:
    at = _place(rng, len(word))
    return [word[:at] + word[at + 1 :], word + "_2", word.upper(), word[:at] + "x" + word[at:]][_place(rng, 4)]


_TEXT: dict[str, Callable[[str, np.random.Generator], str]] = {
    "letter": _letter,
    "lost letters": _lost,
    "cut off": _cut,
    "line dropped": _line(lambda lines, at: lines.pop(at) and None),
    "line doubled": _line(lambda lines, at: lines.insert(at, lines[at])),
    "lines exchanged": _line(_exchange),
    "cells": _cells,
    "decimal comma": _word(r"\d\.\d", lambda word, _: word.replace(".", ",")),
    "decimal commas": lambda text, _: re.sub(r"(?<=\d)\.(?=\d)", ",", text),
    "spreadsheet": lambda text, _: re.sub(r"(?<=\d)\.(?=\d)", ",", text.replace(",", ";")),
    "point lost": _word(r"\d\.\d", lambda word, _: word.replace(".", "")),
    "name": _word(r"[A-Za-z_]{2,}", _renamed),
    "unit": _word(
        r'(?<=unit = ")[^"]*|°CA aTDC|(?<=,)(?:mg|rpm)(?=,)', lambda _, rng: _UNITS[_place(rng, len(_UNITS))]
    ),
}


def mutant_of_text(text: str, rng: np.random.Generator) -> tuple[str, bytes]:
    """Give one to three faults, and the file with them: bytes, as damage need not leave a text."""
    kinds = []
    for _ in range(1 + int(rng.integers(3)) * int(rng.integers(2))):
        kind = [*_TEXT][_place(rng, len(_TEXT))]
        text = _TEXT[kind](text, rng)
        kinds.append(kind)
    raw = bytearray(text.encode())
    if rng.random() < 0.15 and raw:
        raw[_place(rng, len(raw))] ^= 1 << int(rng.integers(8))
        kinds.append("bit")
    return ", ".join(kinds), bytes(raw)


def mutant_of_bytes(raw: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """Give one to three faults of a file of bytes, and the file with them."""
    kinds = []
    for _ in range(1 + int(rng.integers(3)) * int(rng.integers(2))):
        a, b = sorted((_place(rng, len(raw) + 1), _place(rng, len(raw) + 1)))
        b = min(b, a + int(rng.integers(1, 200)))
        kind = ["bit", "byte", "cut off", "lost", "zeros", "doubled", "moved", "noise"][_place(rng, 8)]
        part = raw[a:b]
        if kind == "bit":
            part = bytes([part[0] ^ 1 << int(rng.integers(8)), *part[1:]]) if part else b""
        elif kind == "byte":
            part = bytes([int(rng.integers(256)), *part[1:]])
        elif kind == "zeros":
            part = bytes(len(part))
        elif kind == "noise":
            part = rng.bytes(len(part))
        elif kind == "doubled":
            part = part * 2
        else:
            part = b""
        moved = raw[a:b] if kind == "moved" else b""
        raw = raw[:a] + part + (b"" if kind == "cut off" else raw[b:])
        at = _place(rng, len(raw) + 1)
        raw = raw[:at] + moved + raw[at:]
        kinds.append(kind)
    return ", ".join(kinds), raw


def judged(require: Callable[[], object], path: Path, what: str) -> str:
    """Say whether a file was read, as it stands, or refused by its name; anything else fails."""
    try:
        require()
    except (Error, FileNotFoundError) as error:  # not found: what a mutant names
        said: Exception = error
    except Exception as error:
        raise AssertionError(f"{what}: {error!r}") from error
    else:
        return "read"
    assert str(path) in str(said), (what, said)
    return "refused"
