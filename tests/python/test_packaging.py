"""The package: light to import, one version everywhere, typed, stubs that agree with the module."""

import importlib.metadata
import importlib.resources
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import mgdd
from mgdd import _core


def test_import_is_light() -> None:
    code = "import mgdd, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = set(run.stdout.split())
    assert "mgdd" in loaded
    heavy = {"matplotlib", "xarray", "pandas", "scipy", "rich", "jinja2", "pooch", "can", "dask", "numba", "sklearn"}
    assert loaded & heavy == set()


def test_one_version(root: Path) -> None:
    text = (root / "CMakeLists.txt").read_text(encoding="utf-8")
    match = re.search(r"^project\([^)]*?\bVERSION\s+([0-9.]+)", text, re.MULTILINE)
    assert match is not None
    assert mgdd.__version__ == match[1]
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [match[1]]


def test_licences_of_dependencies_are_named(root: Path) -> None:
    """Every package that an installation may fetch, and beside LGPL what says so of itself."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [wanted for name, group in project["optional-dependencies"].items() if name != "all" for wanted in group]
    wanted = {re.split(r"[^\w-]", line)[0] for line in [*project["dependencies"], *extras]}
    rows = [line for line in (root / "THIRD_PARTY.md").read_text(encoding="utf-8").splitlines() if line[0:1] == "|"]
    assert wanted <= set(re.findall(r"`([\w-]+)`", "".join(rows)))
    for name in wanted & {str(found.name) for found in importlib.metadata.distributions()}:
        about = importlib.metadata.metadata(name)
        licence = " ".join([*about.get_all("License-Expression", []), *about.get_all("Classifier", [])])
        copyleft = "LGPL" in licence or "General Public" in licence
        assert [("LGPL" in row) for row in rows if f"`{name}`" in row] == [copyleft], name


def test_package_is_typed() -> None:
    for package in ("mgdd", "mgdd_studies"):
        assert importlib.resources.files(package).joinpath("py.typed").is_file()


@pytest.mark.slow
def test_long_commands_are_never_silent(root: Path) -> None:
    """The wrapper that `make` puts around them keeps every character and the exit status."""
    script = "echo first; sleep 2.5; printf half; sleep 1.5; echo ' line'; printf end; exit 3"
    command = [str(root / "tools" / "aloud.sh"), "bash", "-c", script]
    run = subprocess.run(command, env={**os.environ, "ALOUD_SECONDS": "1"}, capture_output=True, text=True)
    assert run.returncode == 3
    lines = run.stdout.splitlines()
    said = [line for line in lines if line.startswith("... bash, ")]
    assert 1 <= len(said) <= 4
    assert "".join(line for line in lines if line not in said) == "firsthalf lineend"


@pytest.mark.parametrize("name", ["baseline", "avx2", "avx512f", "sse9", ""])
def test_instruction_set_of_the_environment(name: str) -> None:
    code = "from mgdd import _core; print(_core.instruction_set())"
    environment = {**os.environ, "MGDD_INSTRUCTION_SET": name}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    known = ["baseline", *(level for level in ("avx2", "avx512f") if level in _core.processor_simd_levels())]
    if name in ("", *known):
        assert run.stdout.strip() == (name or known[-1])
    elif name == "sse9":
        assert "MGDD_INSTRUCTION_SET = 'sse9': must be one of baseline, avx2, avx512f" in run.stderr
    else:
        assert f"MGDD_INSTRUCTION_SET = {name!r}: this processor has {known[-1]} at most" in run.stderr


@pytest.mark.skipif(shutil.which("readelf") is None, reason="no readelf")
@pytest.mark.skipif("libasan" in os.environ.get("LD_PRELOAD", ""), reason="a sanitizer guards instead")
def test_module_is_guarded() -> None:
    """Its table of functions is read-only once loaded, and its stack has guards."""
    command = ["readelf", "--wide", "--segments", "--dynamic", "--dyn-syms", str(_core.__file__)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert "GNU_RELRO" in said
    assert re.search(r"\(FLAGS\).*BIND_NOW|\(FLAGS_1\).*NOW", said)
    assert "__stack_chk_fail" in said
    assert not re.search(r"GNU_STACK.* RWE ", said)


@pytest.mark.stubs
def test_stubs_agree_with_the_module(root: Path, tmp_path: Path) -> None:
    """In an instruction set that is hardly the machine's own: what is written there must not depend on it."""
    command = [sys.executable, str(root / "tools" / "stubs.py"), "mgdd._core", "-o", str(tmp_path)]
    environment = {**os.environ, "MGDD_INSTRUCTION_SET": "baseline"}
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr

    def stubs(folder: Path) -> dict[str, str]:
        files = [*folder.glob("_core.pyi"), *folder.glob("_core/**/*.pyi")]
        return {str(file.relative_to(folder)): of_any_python(file.read_text(encoding="utf-8")) for file in files}

    def of_any_python(text: str) -> str:  # from 3.12 on the standard library has it
        return text.replace("import typing_extensions\n", "").replace(
            "typing_extensions.Buffer", "collections.abc.Buffer"
        )

    fresh, kept = stubs(tmp_path / "mgdd"), stubs(root / "python" / "mgdd")
    assert fresh, run.stderr
    stale = [name for name in fresh if name in kept and fresh[name] != kept[name]]
    stale += sorted(fresh.keys() ^ kept.keys())
    assert stale == [], "the stubs of _core are stale: run `make stubs`"
