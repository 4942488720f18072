"""What a file carries is bounded where it enters: every reader meets what no bench writes, and refuses it in short."""

import importlib
import inspect
import pkgutil
import re
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

import mgdd
from mgdd import presets
from mgdd.errors import DataError, Error, ParameterError, did_you_mean, shortened
from mgdd.io.files import decoded, parsed
from mgdd.results.units import attribute_units
from mgdd.rig import SafetyEnvelope, SignalMap
from mgdd.rig.can.dbc import DbcFile
from sample_files import SAMPLES, sample_file

LONG = 500_000
LETTERS, DIGITS = "n" * LONG, "7" * LONG
MESSAGE, MEMORY = 4200, 100e6
TEXTS = [name for name in SAMPLES if SAMPLES[name].ending in ("csv", "json", "toml", "dcm", "cdfx", "dbc")]
# What reaches `ParameterFile.read` before anything of its own.
ALIKE = [name for name in SAMPLES if re.search(r"^identify|^throttle|^surrogate|throttle$", name)]
# Words and numbers of a file that are swelled in the quick tests, spread over it.
FEW = 3


def refused(read: Callable[[Path], Any], path: Path) -> str:
    """Read a file: what mgdd refuses it with, or nothing; anything but a short error of mgdd fails."""
    said = ""
    try:
        read(path)
    except Error as error:
        said = str(error)
    assert len(said) <= 400
    return said


def swelled(text: str, pattern: str, larger: Sequence[str], most: int) -> Iterator[str]:
    """Give the text with one of its words replaced at a time, at most so many of them."""
    found = [*re.finditer(pattern, text)]
    for one in found[:: -(-len(found) // most)] if found else []:
        for instead in larger:
            yield text[: one.start()] + instead + text[one.end() :]


def swell(name: str, folder: Path, pattern: str, larger: Sequence[str], most: int) -> list[str]:
    """Read a good file again and again, each time with a word of it replaced: what was said."""
    path = sample_file(name, folder)
    said = []
    for hostile in swelled(path.read_text(encoding="utf-8"), pattern, larger, most):
        path.write_text(hostile, encoding="utf-8")
        said.append(refused(SAMPLES[name].read, path))
    return said


# --- the table is whole -------------------------------------------------------------------------------------
def public_readers() -> set[str]:
    """Find what reads a file: it takes a path, and is not called as a writer is."""
    found = set()
    for module in (m.name for m in pkgutil.iter_modules(mgdd.__path__) if not m.name.startswith("_")):
        room = importlib.import_module(f"mgdd.{module}")
        for name in room.__all__:
            made = getattr(room, name)
            parts = [k for k in vars(made) if not k.startswith("_")] if inspect.isclass(made) else []
            for label, call in [(name, made), *((f"{name}.{part}", getattr(made, part)) for part in parts)]:
                if not callable(call) or inspect.isclass(call):
                    continue
                try:
                    first = next(iter(inspect.signature(call).parameters.values()), None)
                except ValueError:
                    continue
                takes = first is not None and ("PathLike" in str(first.annotation) or label == "Reference.parse")
                if takes and not re.search(r"(^|\.)(write|save|to_)", label):
                    found.add(f"{module}.{label}")
            if inspect.isclass(made) and hasattr(made, "of_file") and not name.startswith("Param"):
                found.add(f"{module}.{name}")
    return found


def test_every_public_reader_is_in_the_table() -> None:
    listed = {name.split(" ")[0] for name in SAMPLES}
    by_other_names = {
        "presets.Preset",  # what presets.load returns
        "rig.SafetyEnvelope",  # the same as SafetyEnvelope.load
        "rig.watch",  # reads in another process; `test_rig_watch` has its bad files
    }
    missing = public_readers() - listed - by_other_names
    assert {name for name in missing if not name.endswith(("run_experiment",))} == set()
    assert len(listed) >= 25


@pytest.mark.parametrize("name", SAMPLES)
def test_the_good_file_is_read(name: str, tmp_path: Path) -> None:
    assert SAMPLES[name].read(sample_file(name, tmp_path)) is not None


# --- files that are none ------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", SAMPLES)
def test_paths_that_lead_to_no_file(name: str, tmp_path: Path) -> None:
    read, ending = SAMPLES[name].read, SAMPLES[name].ending
    folder = tmp_path / f"folder.{ending}"
    folder.mkdir()
    names = (f"{'n' * 300}.{ending}", f"n\0.{ending}", f"{'n/' * 3000}n.{ending}")
    for path in (folder, *(tmp_path / name for name in names)):
        assert re.search(r"folder|looked up|CSV file that exists", refused(read, path)), path.name[:20]
    with pytest.raises((FileNotFoundError, ParameterError), match=r"no such file|exists|no preset file"):
        read(tmp_path / f"none.{ending}")


@pytest.mark.parametrize("read", [presets.load, SafetyEnvelope.load, SignalMap.load])
@pytest.mark.parametrize("name", ["n" * 300, "n\0", LETTERS])
def test_shipped_names_of_any_length(read: Callable[[str], Any], name: str) -> None:
    with pytest.raises((Error, FileNotFoundError), match=r"shipped|looked up") as caught:
        read(name)
    assert len(str(caught.value)) < MESSAGE


HOSTILE = {
    "empty": b"",
    "NUL": b"a,b\0\n1,2\n",
    "no encoding": b"a,b\n1,\x81\x9d\n",
    "UTF-16 without a mark": "a,b\n1,2\n".encode("utf-16-le"),
    "half of UTF-16": b"\xff\xfea\0,",
    "one letter": LETTERS.encode(),
    "one number": DIGITS.encode(),
    "one cell a line": b"1\n" * 20_000,
    "lists in JSON": b'{"kind": ' + b"[" * 100_000,
    "objects": b'{"a":' * 100_000,
    "tables in TOML": b"a = " + b"{a = " * 3000,
    "dotted keys": b"a." * 3000 + b"a = 1\n",
    "closed lists": b"a = " + b"[" * 400 + b"]" * 400,
}


@pytest.mark.parametrize("name", [name for name in SAMPLES if name not in ALIKE])
@pytest.mark.parametrize("form", HOSTILE)
def test_what_is_no_such_file_is_refused_in_short(name: str, form: str, tmp_path: Path) -> None:
    path = tmp_path / f"hostile.{SAMPLES[name].ending}"
    path.write_bytes(HOSTILE[form])
    tracemalloc.start()
    try:
        assert str(path) in refused(SAMPLES[name].read, path)
        assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()


# --- files that are nearly right ----------------------------------------------------------------------------
WORD, NUMBER = r"[A-Za-z_]{2,}", r"(?<![\w.])-?\d+(\.\d+)?"
FORMS = {
    "words": (WORD, (LETTERS, "two words " * 50_000)),
    "numbers": (
        NUMBER,
        ("1e999999", "1e999999999999", "-1e308", "7" * 4000, "7" * 10_000, "1." + DIGITS, "0x" + "f" * 5000, "nan"),
    ),
    "nested": (NUMBER, ("[" * 80 + "1" + "]" * 80, "[" * 3000 + "1" + "]" * 3000, "{a=" * 3000 + "1" + "}" * 3000)),
}


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("form", FORMS)
def test_a_word_of_any_length_and_a_number_of_any_size(name: str, form: str, tmp_path: Path) -> None:
    said = swell(name, tmp_path, *FORMS[form], most=FEW)
    assert any(said) or name == "points"  # whose columns may be called anything


# --- the parts that do it -----------------------------------------------------------------------------------
def test_nesting_is_counted_in_levels() -> None:
    assert parsed("[" * 64 + "]" * 64, "a", "JSON") is not None
    with pytest.raises(DataError, match="a: nests more than 64 levels"):
        parsed("[" * 66 + "]" * 66, "a", "JSON")
    with pytest.raises(DataError, match="the key 'b' occurs twice"):
        parsed('{"a": {"b": 1, "b": 2}}', "a", "JSON")
    with pytest.raises(DataError, match="a whole number of 4004 bits: at most 64"):
        parsed("x = 0x" + "f" * 1001, "a", "TOML")
    assert parsed("x = [inf, -nan, 18446744073709551615]", "a", "TOML")["x"][2] == 2**64 - 1


def test_messages_keep_their_beginning_and_their_remedy() -> None:
    assert shortened("a" * 120) == "a" * 120
    said = str(DataError(f"a.csv, column {LETTERS!r}: is not known: rename it"))
    assert len(said) <= 400
    assert said.startswith("a.csv, column 'nnn")
    assert said.endswith("nnn': is not known: rename it")
    assert re.search(r"\[\.\.\. \d+ letters \.\.\.\]", said)
    said = str(DataError("a.csv: " + "word " * LONG + ": rename it"))
    assert len(said) <= 400
    assert said.endswith(": rename it")
    said = str(DataError(f"a.csv: {'two words ' * LONG!r}: rename it"))
    assert len(said) <= 400
    assert len(str(ParameterError.of("name", LETTERS, "short"))) <= 400
    assert did_you_mean("m" + LETTERS, [LETTERS]) == ""
    whole = "a sentence of words that is not short, " * 10
    assert str(DataError(whole)) == whole


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_encodings_are_found(encoding: str) -> None:
    assert decoded("angle [°];größer – “x”".encode(encoding), "a") == "angle [°];größer – “x”"


def test_encodings_that_are_none() -> None:
    with pytest.raises(DataError, match="a, line 2: damaged UTF-8, invalid start byte: correct the letter"):
        decoded("°\n".encode() + b"\xff", "a")
    with pytest.raises(DataError, match="a, line 2: byte 0x81 is neither UTF-8 nor Windows-1252"):
        decoded(b"\n\x81", "a")
    with pytest.raises(DataError, match="not a UTF-8 text file"):
        decoded("°".encode("cp1252"), "a", only_utf8=True)


# --- the database of a bus ----------------------------------------------------------------------------------
DEGREES = [("°", "utf-8"), ("°", "cp1252"), ("°KW", "utf-8"), ("°CRK", "cp1252"), ("°CA", "utf-8"), ("deg", "ascii")]


@pytest.mark.parametrize(("unit", "encoding"), DEGREES)
@pytest.mark.parametrize("said", ["deg", "°"])
def test_an_angle_of_a_dbc_is_in_degrees_in_any_encoding(unit: str, encoding: str, said: str, tmp_path: Path) -> None:
    path = sample_file("rig.SignalMap.load", tmp_path)
    dbc = tmp_path / "foreign.dbc"
    text = dbc.read_text(encoding="utf-8").replace('"rad"', f'"{unit}"')
    dbc.write_bytes(text.encode(encoding))
    scaled = path.read_text(encoding="utf-8").replace('unit = "rad", scale = 57.29577951308232', f'unit = "{said}"')
    path.write_text(scaled, encoding="utf-8")
    assert DbcFile.read(dbc).messages["Answer"].signals["Angle"].unit == unit
    assert SignalMap.load(path).measurements["Answer"].signals["sensed_angle_deg"].signal.unit == unit


def test_units_with_a_degree_sign() -> None:
    found = [attribute_units(unit) for unit in ("°", "°KW", "°CRK", "°CA aTDC", "°/s", "bar/°CA", "%/°CA²")]
    assert found == ["degree"] * 4 + ["degree/second", "bar/degree", "percent/degree**2"]
    with pytest.raises(ValueError, match="not a product"):
        attribute_units("°C")  # a temperature


def test_messages_in_several_frames_and_long_texts_of_a_dbc_stand_in_nobodys_way(tmp_path: Path) -> None:
    """Databases of SAE J1939 hold some; who maps one is told."""
    dbc = sample_file("dbc", tmp_path)
    cmd, long = "BO_ 2566848766 Cmd", 'BO_ 2566850000 Faults: 200 PC\n SG_ Name : 0|1600@1+ (1,0) [0|0] "" PC\n\n'
    dbc.write_text(dbc.read_text(encoding="utf-8").replace(cmd, long + cmd), encoding="utf-8")
    read = DbcFile.read(dbc)
    assert set(read.messages) == {"Cmd", "Answer", "Done", "Faults"}
    assert read.messages["Cmd"].signals
    assert not read.messages["Faults"].signals
    with pytest.raises(DataError, match="Faults has 200 bytes: a frame has at most 64"):
        read.message("Faults")
