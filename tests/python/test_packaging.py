"""What is installed: light to import, one version everywhere, typed, stubs that agree with the module."""

from __future__ import annotations

import importlib.metadata
import importlib.resources
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mgdd

PACKAGE_FILES = re.compile(
    r"mgdd/(.*\.pyi?|_core\..*\.so|py\.typed|presets/[^/]+\.toml|report/templates/[^/]+\.(html|css)|data/([^/]+/)*[^/]+\.(csv|txt)|.*\.pyc)"
    r"|mgdd-[^/]+\.dist-info/.*|(\.\./)*bin/mgdd"
)


def test_import_is_light() -> None:
    code = "import mgdd, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = set(run.stdout.split())
    assert "mgdd" in loaded
    heavy = {"matplotlib", "xarray", "pandas", "scipy", "rich", "jinja2", "pooch", "can", "dask", "numba"}
    assert loaded & heavy == set()


def test_one_version(root: Path) -> None:
    text = (root / "CMakeLists.txt").read_text(encoding="utf-8")
    match = re.search(r"^project\([^)]*?\bVERSION\s+([0-9.]+)", text, re.MULTILINE)
    assert match is not None
    assert mgdd.__version__ == match[1]
    assert importlib.metadata.version("mgdd") == match[1]
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [match[1]]


def test_package_is_typed() -> None:
    assert importlib.resources.files("mgdd").joinpath("py.typed").is_file()


def test_nothing_else_is_installed() -> None:
    files = importlib.metadata.files("mgdd")
    assert files, "the package is not installed: run `make install`"
    assert [str(file) for file in files if not PACKAGE_FILES.fullmatch(str(file))] == []


@pytest.mark.stubs
def test_stubs_agree_with_the_module(root: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pybind11_stubgen", "mgdd._core", "-o", str(tmp_path)]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr

    def stubs(folder: Path) -> dict[str, str]:
        files = [*folder.glob("_core.pyi"), *folder.glob("_core/**/*.pyi")]
        return {str(file.relative_to(folder)): file.read_text(encoding="utf-8") for file in files}

    fresh, kept = stubs(tmp_path / "mgdd"), stubs(root / "python" / "mgdd")
    assert fresh, run.stderr
    stale = [name for name in fresh if name in kept and fresh[name] != kept[name]]
    stale += sorted(fresh.keys() ^ kept.keys())
    assert stale == [], "the stubs of _core are stale: run `make stubs`"
