"""Work as calls: what runs is what is written, and nothing private can be reached."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from mgdd.errors import DataError
from mgdd.workbench.calls import Call, File, Named, Script, public, written
from mgdd.workbench.session import MOST_FILES, Loaded, Session, file_word, words
from workbench_views import run_python

MARKUP = "<img src=x onerror=alert(1)>.csv"


def script(path: Path) -> Script:
    lines = (
        ("preset", Call("presets.load", ("puma_single",))),
        ("point", Call("point.replace", of=Named("preset"), options={"speed_rpm": 1400.0, "fuel_mg": None})),
        ("cylinder", Call("cylinder", of=Named("preset"), reads=True)),
        ("trace", Call("io.read_pressure", (File(path),), {"pressure_unit": "kPa"})),
        ("check", Call("engine.check_pressure", (Named("trace"), Named("cylinder")), {"point": Named("point")})),
    )
    return Script(lines, ("engine", "check", path.name), ("check",))


def kilopascals(folder: Path, name: str = "it's a trace.csv") -> Path:
    rows = "".join(f"{angle},{100.0 * (60.0 - 0.004 * angle * angle):.2f}\n" for angle in range(-110, 111, 2))
    path = folder / name
    path.write_text(rows, encoding="utf-8")
    return path


def test_what_is_written_does_what_was_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = script(kilopascals(tmp_path))
    found = own.run()
    assert list(found) == ["check"]
    monkeypatch.chdir(tmp_path)
    again = run_python(own.python)
    assert again["check"].summary() == found["check"].summary()
    assert again["point"].speed_rpm == 1400.0
    assert str(tmp_path) not in own.python
    assert shlex.split(own.shell) == ["mgdd", "engine", "check", "it's a trace.csv"]


def test_the_listener_is_called_and_not_shown() -> None:
    heard: list[object] = []
    call = Call("parallel.map_items", (abs, [-1, 2]), watched="progress")
    assert "progress" not in written(call)
    assert Script((("out", call),), (), ("out",)).run(lambda *of: heard.append(of)) == {"out": [1, 2]}
    assert heard[-1] == (2, 2)


def test_a_line_can_be_wrapped() -> None:
    own = Script((("preset", Call("presets.load", ("P1",))),), (), ("preset",))
    assert own.run(wraps={"preset": lambda preset: preset.name}) == {"preset": "P1"}


@pytest.mark.parametrize("name", ["engine._core", "engine.no_such", "io.existing_file", "results.labelled"])
def test_only_what_is_public_can_be_called(name: str) -> None:
    with pytest.raises(AttributeError):
        public(name)


def test_options_are_words_that_no_shell_and_no_parser_takes_otherwise() -> None:
    assert words({"tdc_offset_cad": -1.5, "before_tdc": True, "sheet": "a b"}) == (
        "--tdc-offset-cad=-1.5", "--before-tdc", "--sheet=a b",
    )  # fmt: skip
    assert file_word("-o.csv") == "./-o.csv"


@pytest.mark.parametrize(
    ("name", "kept"),
    [("a.csv", "a.csv"), ("../../etc/passwd", "passwd"), ("C:\\data\\b.csv", "b.csv"), (MARKUP, MARKUP),
     ("bell\x07.csv", "bell_.csv")],
)  # fmt: skip
def test_a_dropped_file_stays_in_the_folder_of_its_session(name: str, kept: str) -> None:
    session = Session()
    path = session.take(name, b"1,2\n").path
    assert (path.parent, path.name) == (session.folder, kept)
    session.close()
    assert not path.exists()


@pytest.mark.parametrize("name", ["", ".", "..", "/", "x" * 200])
def test_a_file_without_a_usable_name_is_refused(name: str) -> None:
    session = Session()
    with pytest.raises(DataError, match="cannot be the name of a file here"):
        session.take(name, b"1")
    session.close()


def test_files_too_large_or_too_many_are_refused_with_a_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    from mgdd.workbench import session as module

    session = Session()
    monkeypatch.setattr(module, "MOST_FILE_MB", 1)
    with pytest.raises(DataError, match="chunk-cycles"):
        session.take("large.csv", b"1" * ((1 << 20) + 1))
    assert session.files == {}
    for k in range(MOST_FILES):
        session.take(f"{k}.csv", b"1")
    with pytest.raises(DataError, match="files are open"):
        session.take("more.csv", b"1")
    session.take("0.csv", b"2")  # the same again takes its place
    assert len(session.files) == MOST_FILES
    session.close()


def test_a_remedy_is_undone() -> None:
    one = Loaded(Path("a.csv"), {"pressure_unit": "kPa"})
    one.remedy({"pegging": "two_point", "tdc_offset_cad": None})
    one.remedy({"tdc_offset_cad": 0.5, "pressure_unit": None})
    assert (one.reading, one.pegging) == ({"tdc_offset_cad": 0.5}, {"pegging": "two_point"})
    one.undo()
    one.undo()
    one.undo()
    assert one.options == {"pressure_unit": "kPa"}
