"""`mgdd preset` and `mgdd completion`: shipped presets from the command line, and a shell that completes."""

import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from mgdd import presets
from mgdd.cli import main
from public_objects import ROOMS
from typed import Capsys
from typed import ran as out


def test_presets_are_listed_by_kind(capsys: Capsys) -> None:
    listed = out(capsys, "preset", "list")["presets"]
    assert tuple(row["name"] for row in listed) == presets.available()
    assert all(set(row) == {"name", "kind", "title"} for row in listed)
    throttles = out(capsys, "preset", "list", "--kind", "throttle")["presets"]
    assert tuple(row["name"] for row in throttles) == presets.available("throttle")
    assert main(["preset", "list"]) == 0
    assert capsys.readouterr().out.splitlines()[0].split() == ["name", "kind", "title"]


@pytest.mark.parametrize("name", presets.available())
def test_a_preset_is_shown_with_units_and_sources(name: str, capsys: Capsys) -> None:
    shown, preset = out(capsys, "preset", "show", name), presets.load(name)
    assert (shown["name"], shown["kind"], shown["title"]) == (preset.name, preset.kind, preset.title)
    for table, record in preset.records.items():
        known = {field: value for field, value in record.to_dict().items() if value is not None}
        assert {field: entry["value"] for field, entry in shown[table].items()} == known
        assert {field: entry["unit"] for field, entry in shown[table].items()} == {
            field: type(record).fields()[field]["unit"] for field in known
        }
    assert main(["preset", "show", name]) == 0
    assert "source" in capsys.readouterr().out


@pytest.mark.parametrize("name", presets.available())
def test_a_copy_is_read_back_and_never_replaces_a_file(name: str, capsys: Capsys, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    assert out(capsys, "preset", "copy", name, str(file)) == {"name": name, "file": str(file)}
    copied, shipped = presets.load(file), presets.load(name)
    assert (copied.records, copied.sources, copied.title) == (shipped.records, shipped.sources, shipped.title)
    assert (copied.name, shipped.name) == ("mine", name)
    changed = file.read_text(encoding="utf-8") + "# mine\n"
    file.write_text(changed, encoding="utf-8")
    assert main(["preset", "copy", name, str(file)]) == 2
    assert "exists already, and is not replaced: name another file" in capsys.readouterr().err
    assert file.read_text(encoding="utf-8") == changed
    assert out(capsys, "preset", "show", str(file))["name"] == "mine"


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ("copy P1 mine.txt", "the ending must be one of .toml"),
        ("copy P1 nowhere/mine.toml", "the folder nowhere does not exist"),
        ("copy P4 mine.toml", "no preset 'P4': shipped are"),
        ("show none.toml", "no preset file 'none.toml'"),
    ],
)
def test_what_is_no_preset_is_refused(
    argv: str, said: str, capsys: Capsys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["preset", *argv.split()]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_copy_of_an_engine_simulates(capsys: Capsys, tmp_path: Path) -> None:
    file = str(tmp_path / "mine.toml")
    assert main(["preset", "copy", "puma_single", file]) == 0
    capsys.readouterr()
    shipped, own = out(capsys, "engine", "simulate"), out(capsys, "engine", "simulate", "--preset", file)
    assert (shipped.pop("preset"), own.pop("preset")) == ("puma_single", "mine")
    assert own == shipped


# --- completion ---------------------------------------------------------------------------------------------
_WORDS = """
source script.sh
complete -p mgdd
offer() {{
  COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
  _shtab_mgdd; echo "${{COMPREPLY[@]}}"
}}
{calls}
"""


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("mgdd eng", {"engine"}),
        ("mgdd preset ''", {"list", "show", "copy"}),
        ("mgdd engine simulate --so", {"--soc-cad", "--soi-cad"}),
        ("mgdd engine simulate --integrator ''", {"trapezoid", "split", "tan2018_lagged", "euler"}),
        ("mgdd map fit t.nc --kind g", {"gaussian_process"}),
        ("mgdd engine simulate --preset scr", {"script.sh"}),
    ],
)
def test_bash_completes(words: str, offered: set[str], tmp_path: Path, capsys: Capsys) -> None:
    assert main(["completion", "bash"]) == 0
    (tmp_path / "script.sh").write_text(capsys.readouterr().out, encoding="utf-8")
    program = _WORDS.format(calls=f"offer {words}")
    done = subprocess.run(["bash", "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    registered, replies = done.stdout.splitlines()
    assert registered.endswith("-F _shtab_mgdd mgdd")
    assert offered <= set(replies.split())


def test_the_script_of_zsh_and_as_json(capsys: Capsys) -> None:
    assert main(["completion", "zsh"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("#compdef mgdd")
    found = out(capsys, "completion", "zsh")
    assert found == {"shell": "zsh", "script": text.removesuffix("\n")}


def test_without_the_extra_it_is_named() -> None:
    program = "import sys; sys.modules['shtab'] = None; from mgdd.cli import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", program, "completion", "bash"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert 'pip install "mgdd[completion]"' in done.stderr


@pytest.mark.parametrize("name", ROOMS)
def test_a_package_completes_to_its_own_names(name: str) -> None:
    own = importlib.import_module(name)
    assert dir(own) == sorted(own.__all__)
    assert all(hasattr(own, each) for each in dir(own))


@pytest.mark.parametrize("name", ROOMS)
def test_every_public_name_has_a_signature(name: str) -> None:
    own = importlib.import_module(name)
    for each in own.__all__:
        thing = getattr(own, each)
        if callable(thing) and not isinstance(thing, type(int | str)):
            assert isinstance(inspect.signature(thing), inspect.Signature), each


def test_public_names_are_few_and_none_stands_twice() -> None:
    names = [each for name in ROOMS for each in importlib.import_module(name).__all__]
    assert len(names) <= 175, "unexport or merge a name before one is added"
    assert {name for name in names if names.count(name) > 1} == {"read"}


def test_a_class_of_the_core_shows_names_and_defaults_and_describes_them() -> None:
    from mgdd.control import Pid
    from mgdd.loop import VirtualEngine

    shown = inspect.signature(Pid).parameters
    assert list(shown) == list(Pid.fields())
    assert {name: each.default for name, each in shown.items()} == {
        name: field["default"] for name, field in Pid.fields().items()
    }
    assert "kick_width_deg : error at which the kick is full [deg]" in str(Pid.__init__.__doc__)
    assert str(inspect.signature(Pid.step)) == "(self, reference_deg, measurement_deg)"

    bench = inspect.signature(VirtualEngine).parameters
    assert bench["pressure_noise_bar"].default == 0.0
    assert set(VirtualEngine.fields()) <= set(bench)
    assert "\npressure_noise_bar : float\n    Noise of each sample" in str(VirtualEngine.__doc__)
    assert "**settings" not in str(VirtualEngine.__doc__)
