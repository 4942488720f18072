"""Random files of every format that mgdd reads, each by the library of its format, with a check of what is read."""

from __future__ import annotations

import contextlib
import itertools
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mgdd.errors import DataError
from mgdd.io import chunks, pressure_chunks, read, read_pressure, text_rows
from mgdd.io.any_table import open_parts, read_any_table
from mgdd.io.pressure_checks import PRESSURE_UNITS, to_bar

__all__ = [
    "TEXT", "Case", "Column", "Content", "Random", "bench", "case_of", "chance", "in_a_folder", "pick", "read_text",
    "table",
]  # fmt: skip

Random = np.random.Generator
TYPES = ("f8", "f8", "f8", "f4", "i2", "i4", "u1", "u2", ">f8", ">i2", "i8", "?")
WORDS = (
    "torque", "T_oil", "lambda", "p intake", "Drehmoment", "note 7", "Öl", "x", "v_1", "Ne", "k/f", "a.b", "µ", "q"
)  # fmt: skip
UNITS = ("Nm", "1/min", "°C", "kPa", "A", "", "-", "m/s", "g/kWh", "%", "V")


class Case(NamedTuple):
    """A file: its bytes and name, the check of its values, how it is read when damaged; the encoding of a text."""

    raw: bytes
    name: str
    check: Any
    read: Any
    encoding: str = ""


class Column(NamedTuple):
    """A column as it is written; a matrix stands for one column per cycle."""

    name: str
    values: Any
    unit: str = ""


@dataclass
class Content:
    """Columns, and for a record of pressure how it is read, its angle [°CA aTDC] and its cycles [bar]."""

    columns: list[Column]
    how: dict[str, Any] = field(default_factory=dict)
    text: dict[str, Any] = field(default_factory=dict)
    tolerance: float = 1e-12
    angle: Any = None
    beside: dict[str, Any] = field(default_factory=dict)
    has_units: bool = True

    def rename(self, new: Callable[[str], str]) -> None:
        """Call the columns otherwise."""
        self.columns = [each._replace(name=new(each.name)) for each in self.columns]
        for key, value in self.how.items():
            if key.endswith("_column"):
                self.how[key] = new(value) if isinstance(value, str) else [new(each) for each in value]


def pick(rng: Random, options: Any) -> Any:
    return options[int(rng.integers(len(options)))]


def chance(rng: Random, share: float) -> bool:
    return bool(rng.random() < share)


def numbers(rng: Random, size: Any, kind: str) -> Any:
    """Draw numbers of a type, some of them as large and as small as there are."""
    made = rng.normal(0.0, 10.0 ** rng.integers(-3, 6), size)
    if np.dtype(kind).kind in "iub":
        limits = (0, 1) if kind == "?" else (np.iinfo(kind).min, np.iinfo(kind).max)
        made = np.clip(np.round(made), *limits)
        if kind in ("i8", "?"):
            made = np.clip(made, -(2**52), 2**52)
    elif chance(rng, 0.2) and np.size(made):
        made.flat[int(rng.integers(made.size))] = pick(rng, [0.0, -0.0, 1e300 if kind.endswith("f8") else 1e30, 1e-30])
    return made.astype(kind)


def unlike(rng: Random, count: int) -> list[str]:
    """Draw names, none twice."""
    names = [f"{pick(rng, WORDS)}{pick(rng, ['', '', ' 1', '_2', '.3', ' (raw)'])}" for _ in range(3 * count)]
    return [*dict.fromkeys(name for name in names if name != "pressure")][:count]


def table(rng: Random, kinds: tuple[str, ...] = TYPES) -> Content:
    """Draw columns of any numbers, in one raster."""
    rows = int(rng.integers(2, 200))
    names = unlike(rng, int(rng.integers(1, 8)))
    return Content([Column(name, numbers(rng, rows, pick(rng, kinds)), pick(rng, UNITS)) for name in names])


def cylinder_bar(rng: Random, cad: Any, cycles: int) -> Any:
    """Draw the pressure of cycles: compression by a polytrope, and a burn."""
    ratio, low = rng.uniform(8.0, 18.0), rng.uniform(0.6, 2.5)
    volume = 1.0 + 0.5 * (ratio - 1.0) * (1.0 - np.cos(np.deg2rad(cad)))
    motored = low * (np.where(np.abs(cad) > 180.0, 1.0, ratio / volume)) ** 1.33
    since = np.clip(cad - rng.uniform(-8.0, 0.0), 0.0, None) / rng.uniform(8.0, 20.0)
    burn = rng.uniform(0.2, 1.2) * motored.max() * since**2 * np.exp(1.0 - since**2 / 1.5) / 1.5
    return motored + rng.normal(1.0, 0.03, (cycles, 1)) * burn + rng.normal(0.0, 0.002, (cycles, cad.size))


def bench(rng: Random, *, written: Callable[[Any], Any] = np.asarray, matrix: bool = True) -> Content:
    """Draw a record of pressure over angle: cycles in columns, below each other or running on; `written` rounds."""
    step, form = pick(rng, [0.5, 1.0, 2.0, 0.75]), pick(rng, ["short", "whole", "720", "below", "on"])
    cad = np.arange(-180.0, 180.0, step) if form == "short" else np.arange(-360.0, 360.0, step)
    cycles = pick(rng, [2, 3, 7]) if form in ("below", "on") else int(rng.integers(1, 5)) if matrix else 1
    unit = pick(rng, PRESSURE_UNITS)
    one = 1.0 / float(to_bar(np.float64(1.0), unit))
    raw = written(cylinder_bar(rng, cad, cycles) * one)
    angle = cad + 360.0 if form in ("720", "on") else cad
    how: dict[str, Any] = {"firing_tdc_deg": 360.0} if form in ("720", "on") else {}
    if form == "below":
        angle = np.tile(angle, cycles)
    elif form == "on":
        angle = (angle + 720.0 * np.arange(cycles)[:, None]).ravel()
    angle_unit = pick(rng, ["deg", "°CA", "rad"])
    columns = [Column("angle", written(np.deg2rad(angle) if angle_unit == "rad" else angle), angle_unit)]
    values = raw.ravel() if form in ("below", "on") or cycles == 1 else raw.T
    columns.append(Column("pressure", values, unit))
    more = unlike(rng, int(rng.integers(0, 3)))
    columns += [Column(name, written(rng.normal(50.0, 9.0, angle.size)), pick(rng, UNITS)) for name in more]
    if chance(rng, 0.3):
        columns = [columns[k] for k in rng.permutation(len(columns))]
    names = ["pressure"] if values.ndim == 1 else [f"pressure {k + 1}" for k in range(cycles)]
    if chance(rng, 0.7):
        how |= {"angle_column": "angle", "pressure_column": names}
    return Content(columns, how, angle=cad, beside={"raw": raw, "unit": unit, "angle": angle_unit})


def require_table(content: Content, path: Path) -> None:
    """Compare every column with what was written."""
    found, place = read_any_table(path, **content.text), 0
    for each in content.columns:
        values = np.asarray(each.values)
        parts = [(each.name, values)] if values.ndim == 1 else [
            (f"{each.name} {k + 1}", part) for k, part in enumerate(values.T)]  # fmt: skip
        for name, part in parts:
            at, place = place if found.header is None else found.index(name), place + 1
            got, wanted = found.numbers(at), part.astype(np.float64)
            assert got.shape == wanted.shape, (name, got.shape, wanted.shape)
            near = np.allclose(got, wanted, rtol=content.tolerance, atol=0.0, equal_nan=True)
            assert near, (name, got[:5], wanted[:5])
            require_parts(content, path, at, got)
            if content.has_units:
                said, unit = ((text or "").strip("[]() -") for text in (found.unit(at), each.unit))
                assert said == unit, (name, said, unit)


@contextlib.contextmanager
def short_parts() -> Iterator[None]:
    """Read short files in parts too."""
    kept = chunks._ROWS, chunks._CYCLES, text_rows._BLOCK
    chunks._ROWS, chunks._CYCLES, text_rows._BLOCK = 500, 2, 4000
    try:
        yield
    finally:
        chunks._ROWS, chunks._CYCLES, text_rows._BLOCK = kept


def require_parts(content: Content, path: Path, at: int, whole: Any) -> None:
    """Compare a column that is read in parts with the whole one."""
    edges = [0, whole.size // 3, whole.size // 3 + 1, whole.size]
    with short_parts(), open_parts(path, **content.text) as part:
        found = [part(*each).numbers(at) for each in itertools.pairwise(edges)]
    assert np.array_equal(np.concatenate(found), whole, equal_nan=True), ("parts", at)


def require_chunks(path: Path, whole: Any, **how: Any) -> None:
    """Compare a record that is read in chunks of cycles with the whole one."""
    bar = np.atleast_2d(whole["pressure_bar"])
    try:
        with short_parts():
            found = [each["pressure_bar"] for each in pressure_chunks(path, cycles=2, **how)]
    except DataError as error:
        if "is read whole" in str(error):  # its angles are not quite the same from cycle to cycle
            return
        raise AssertionError(("chunks", str(error))) from error
    assert np.array_equal(np.concatenate(found), bar), ("chunks", [each.shape for each in found], bar.shape)


def require_bench(content: Content, path: Path) -> None:
    """Compare the cut record with what was written."""
    require_table(content, path)
    raw, unit = content.beside["raw"], content.beside["unit"]
    how = dict(content.how)
    if not content.has_units and "in names" not in content.beside:
        how |= {"pressure_unit": unit, "angle_unit": "rad" if content.beside["angle"] == "rad" else "deg"}
    reader = read if sum(path.read_bytes()[-9:]) % 2 else read_pressure
    made = reader(path, **how, **content.text)
    if reader is read_pressure:
        require_chunks(path, made, **how, **content.text)
    wanted = to_bar(np.asarray(raw, np.float64), unit)
    if "pressure_bar" not in made and "pressure_column" not in how:
        return  # of several columns that may be cylinders
    got = np.atleast_2d(made["pressure_bar"].to_numpy())
    if got.shape == wanted.shape and "interpolated" in made.attrs["warnings"]:
        return  # angles of few digits
    assert got.shape == wanted.shape, (got.shape, wanted.shape)
    assert np.allclose(got, wanted, rtol=max(content.tolerance, 1e-12)), np.abs(got - wanted).max()
    assert np.allclose(made["crank_angle_cad"], content.angle, atol=0.03)
    for each in content.columns if reader is read else []:
        if re.search(r"angle|pressure|time|^\d+$", each.name):
            continue
        called = (f"column {each.name!r}", f"column {[one.name for one in content.columns].index(each.name)}")
        (own,) = (v for v in made.data_vars.values() if v.attrs["source"] in called)
        values = np.asarray(each.values, np.float64).reshape(own.shape)
        assert np.allclose(own, values, rtol=content.tolerance), each.name


def read_all(content: Content, path: Path) -> None:
    """Read a damaged file by all readers; the first refusal ends it."""
    found = read_any_table(path, **content.text)
    for at in range(found.width):
        require_parts(content, path, at, found.numbers(at))
    if content.angle is not None:
        read(path, **content.how, **content.text)


def case_of(
    content: Content, raw: bytes, name: str, encoding: str = "", read_it: Callable[..., Any] = read_all
) -> Case:
    require = require_table if content.angle is None else require_bench
    return Case(raw, name, lambda path: require(content, path), lambda path: read_it(content, path), encoding)


def in_a_folder(make: Callable[[Random, Path], Case], rng: Random, folder: Path) -> Case:
    """Make a case with a path to write to, in a folder without other files."""
    made = folder / "made"
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir()
    return make(rng, made / "file")


# --- text ---------------------------------------------------------------------------------------------------
PREAMBLES = (
    "Bench 4", "Operator;Smith", "Date;2018-01-01;3", "Run\t17", "speed = 1500", "; remark", "# comment, 1, 2", "",
    "***End_of_Header***", "load = 40 %", "[Data]", "Channels\t2\t", "Prüfstand: 7", "a,b,c,d,e,f,g,h,i,j", "-----",
)  # fmt: skip
FORMS = ("{!r}", "{:.6e}", "{:.3f}", "{:+.4f}", "{:.8G}", "{:12.5f}", "{:.0f}.", "{:.17g}", "{:.2E}")


def text(rng: Random, _: Path) -> Case:
    """Write columns as text, with what programs and people put around them."""
    mark, form = pick(rng, [",", ";", "\t", " ", "  ", ", ", "; "]), pick(rng, FORMS)
    decimal = "," if mark.strip() != "," and chance(rng, 0.4) else "."

    def written(values: Any) -> Any:
        return np.vectorize(lambda value: float(form.format(float(value))))(values)

    coarse = form in ("{:.0f}.", "{:.2E}")
    content = table(rng) if coarse or chance(rng, 0.5) else bench(rng, written=written)
    content.columns = [each._replace(values=written(np.asarray(each.values))) for each in content.columns]
    content.text["decimal"] = decimal
    if chance(rng, 0.2) and mark.strip() == mark:
        content.text["delimiter"] = mark
    heads: list[list[str]] = [[], []]
    cells: list[Any] = []
    for each in content.columns:
        values = np.atleast_2d(each.values.T)
        names = [each.name] if len(values) == 1 else [f"{each.name} {k + 1}" for k in range(len(values))]
        heads[0] += names
        heads[1] += [each.unit] * len(names)
        cells += [[form.format(float(value)).replace(".", decimal) for value in row] for row in values]
    if mark.isspace() or len(cells) == 1:
        heads = [[cell.replace(" ", "_") or "-" for cell in row] for row in heads]
    if decimal == "," or chance(rng, 0.2):
        heads = [[cell.replace(",", "") for cell in row] for row in heads]
    content.columns = [
        Column(name, np.array([float(cell.replace(decimal, ".")) for cell in column]), unit if unit != "-" else each)
        for name, unit, column, each in zip(*heads, cells, ["-"] * len(cells), strict=True)
    ]
    if content.angle is not None:
        names = [name for name in heads[0] if name.startswith("pressure")]
        content.how |= {"pressure_column": names} if "pressure_column" in content.how else {}
    lines = [pick(rng, PREAMBLES) for _ in range(int(rng.integers(0, 6)))] if chance(rng, 0.5) else []
    style = pick(rng, ["none", "names", "units", "bracketed", "in names"])
    if style == "bracketed":
        heads[1] = [f"[{cell}]" for cell in heads[1]]
    if style == "in names":
        gap = "_" if mark.isspace() or len(cells) == 1 else " "
        renamed = {name: f"{name}{gap}[{unit}]" if unit else name for name, unit in zip(*heads, strict=True)}
        content.rename(renamed.__getitem__)
        content.beside["in names"] = True
        heads[0] = [*renamed.values()]
    if style == "none":
        lines = [line for line in lines if line.startswith("#")]
        content.how = {
            key: value if not key.endswith("_column") else heads[0].index(value) if isinstance(value, str) else
            [heads[0].index(each) for each in value] for key, value in content.how.items()
        }  # fmt: skip
    content.has_units = style in ("units", "bracketed")
    rows = [[*row] for row in zip(*cells, strict=True)]
    table_lines = [*heads[: {"none": 0, "names": 1, "in names": 1}.get(style, 2)], *rows]
    if chance(rng, 0.15):
        table_lines = [[f'"{cell}"' for cell in row] for row in table_lines]
    lines += [mark.join(row) for row in table_lines]
    end = pick(rng, ["\n", "\n", "\r\n", "\r"])
    encoding = pick(rng, ["utf-8", "utf-8", "utf-8-sig", "utf-16", "cp1252"])
    whole = end.join(lines) + end * int(rng.integers(0, 3))
    name = pick(rng, ["a.csv", "a.txt", "a.asc", "a", "a.dat", "a b.CSV"])
    # "0, 1," told with a point is a table of commas.
    if decimal == "," and len(cells) > 1 and form != "{:.0f}." and chance(rng, 0.1):
        content.text["decimal"] = "."  # told wrong
    return case_of(content, whole.encode(encoding), name, encoding, read_text)


def read_text(content: Content, path: Path) -> None:
    """Read a damaged text; each number that is read must stand in it."""
    raw, decimal = path.read_bytes(), content.text.get("decimal", ".")
    encoding = "utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        whole = raw.decode(encoding)
    except UnicodeDecodeError:
        whole = raw.decode("cp1252", "replace")
    there = set()
    for cell in re.split(r'[\s;"|]+' if decimal == "," else r'[\s;,"|]+', whole):
        if re.fullmatch(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?", cell):
            there.add(float(cell.replace(",", ".")))
    found = read_any_table(path, **content.text)
    for at in found.numeric(range(found.width)):
        strange = set(found.numbers(at).tolist()) - there
        assert not strange, f"numbers that do not stand in the file: {[*strange][:5]}"
    if content.angle is not None:
        read(path, **content.how, **content.text)


TEXT: dict[str, Callable[[Random, Path], Case]] = {"csv": text}
