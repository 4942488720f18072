"""The one-way stairs: a file includes or imports only what stands on a lower stair than its own room."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

CPP = "common > optimize > control > engine throttle > identify > guide > loop"
PYTHON = (
    "errors > _arguments > _core > results presets > io plot > optimize > control > engine throttle > identify > guide"
    " > loop sweep design datasets > maps > rig > studies > report > cli > __main__"
)


def levels(stairs: str) -> dict[str, int]:
    return {room: level for level, stair in enumerate(stairs.split(" > ")) for room in stair.split()}


def cpp_arrows(root: Path) -> list[tuple[str, str, str]]:
    """(file, own room, included room) of the core; bindings, tests and benchmarks stand above all rooms."""
    include, arrows = re.compile(r'^\s*#\s*include\s*[<"](.+\.hpp)[>"]', re.MULTILINE), []
    for base in (root / "cpp" / "include" / "mgdd", root / "cpp" / "src"):
        for path in sorted(base.rglob("*.?pp")):
            for target in include.findall(path.read_text(encoding="utf-8")):
                parts = [part for part in target.split("/") if part not in {".", "..", "mgdd"}]
                if len(parts) > 1:
                    arrows.append((str(path.relative_to(root)), path.relative_to(base).parts[0], parts[0]))
    return arrows


def python_arrows(root: Path) -> list[tuple[str, str, str]]:
    """(file, own room, imported room), imports inside functions and type-checking blocks included."""
    package, arrows = root / "python" / "mgdd", []
    for path in sorted(package.rglob("*.py")):
        relative = path.relative_to(package)
        room = relative.parts[0].removesuffix(".py")
        if room == "__init__":  # the front door may open every room
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{relative}: relative import"
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            ours = [name.split(".") for name in names if name.split(".")[0] == "mgdd"]
            arrows += [(str(path.relative_to(root)), room, parts[1] if parts[1:] else "mgdd") for parts in ours]
    return arrows


def faults(arrows: list[tuple[str, str, str]], stairs: str) -> list[str]:
    level, found = levels(stairs), []
    for file, own, other in arrows:
        unknown = [room for room in (own, other) if room not in level]
        if unknown:
            found.append(f"{file}: unknown room {unknown[0]!r}: give it a stair here and in the architecture")
        elif own != other and level[other] >= level[own]:
            found.append(f"{file}: {own} must not use {other}")
    return found


def test_includes_go_down_the_stairs(root: Path) -> None:
    arrows = cpp_arrows(root)
    assert arrows, "no includes found: the test looks in the wrong place"
    assert faults(arrows, CPP) == []


def test_imports_go_down_the_stairs(root: Path) -> None:
    arrows = python_arrows(root)
    assert arrows, "no imports found: the test looks in the wrong place"
    assert faults(arrows, PYTHON) == []


def test_pybind11_stays_in_the_bindings(root: Path) -> None:
    include = re.compile(r'^\s*#\s*include\s*[<"]pybind11/', re.MULTILINE)
    sources = {path: path.read_text(encoding="utf-8") for path in (root / "cpp").rglob("*.?pp")}
    files = [path for path, text in sources.items() if include.search(text)]
    assert files, "no binding found"
    assert [str(path) for path in files if path.relative_to(root).parts[1] != "bindings"] == []


def write(root: Path, file: str, text: str) -> None:
    (root / file).parent.mkdir(parents=True, exist_ok=True)
    (root / file).write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "text", "fault"),
    [
        ("cpp/src/engine/a.cpp", '#include "mgdd/common/units.hpp"\n#include <cmath>\n', None),
        ("cpp/src/engine/a.cpp", '#include "mgdd/engine/b.hpp"\n', None),
        ("cpp/src/common/a.cpp", '#include "mgdd/engine/b.hpp"\n', "common must not use engine"),
        ("cpp/include/mgdd/engine/a.hpp", "#include <mgdd/throttle/b.hpp>\n", "engine must not use throttle"),
        ("cpp/src/engine/a.cpp", '#include "../loop/b.hpp"\n', "engine must not use loop"),
        ("cpp/include/mgdd/cellar/a.hpp", '#include "mgdd/common/b.hpp"\n', "unknown room 'cellar'"),
        ("python/mgdd/engine.py", "from mgdd import _core, results\nimport numpy\n", None),
        ("python/mgdd/studies/a.py", "from mgdd.studies.b import run\n", None),
        ("python/mgdd/plot/a.py", "def f():\n    from mgdd import engine\n", "plot must not use engine"),
        ("python/mgdd/io/a.py", "import mgdd.plot.cycle\n", "io must not use plot"),
        ("python/mgdd/engine.py", "import mgdd\n", "unknown room 'mgdd'"),
        ("python/mgdd/attic.py", "from mgdd import errors\n", "unknown room 'attic'"),
    ],
)
def test_the_test_sees_what_it_should(tmp_path: Path, file: str, text: str, fault: str | None) -> None:
    write(tmp_path, file, text)
    found = faults(cpp_arrows(tmp_path), CPP) + faults(python_arrows(tmp_path), PYTHON)
    if fault is None:
        assert found == []
    else:
        assert len(found) == 1
        assert fault in found[0]
