"""The one-way stairs: a file includes or imports only what stands on a lower stair than its own room; no circles."""

from __future__ import annotations

import ast
import re
import tomllib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

CPP = "common > math > dynamics > optimize > control > engine throttle > identify > guide > loop > rig"
# parallel knows errors alone: whatever is long enough to leave the machine may use it.
PYTHON = (
    "_guesses > errors > _arguments _settings > _core > _rooms > parallel results > signals > io plot > presets"
    " > optimize > control > engine throttle > identify > surrogate > maps > guide"
    " > loop sweep design datasets > rig > report > workbench > cli > __main__ > mgdd_studies"
)

STRANGERS = [("identify/engine", "identify/throttle")]  # parts of one room that do not know each other


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
    arrows = []
    for module, path in modules(root).items():
        if module != "mgdd":  # the front door may open every room
            names = [f"{source}.{name}" if name else source for source, name in imported(path)]
            ours = [name for name in names if name.partition(".")[0] in ("mgdd", "mgdd_studies")]
            arrows += [(str(path.relative_to(root)), room_of(module), room_of(name)) for name in ours]
    return arrows


def modules(root: Path) -> dict[str, Path]:
    """Every module of both packages and its file, by its full name."""
    return {
        ".".join(path.relative_to(root / "python").with_suffix("").parts).removesuffix(".__init__"): path
        for package in ("mgdd", "mgdd_studies")
        for path in sorted((root / "python" / package).rglob("*.py"))
    }


def imported(path: Path) -> list[tuple[str, str]]:
    """(module, name) of every import of a file; without a name where the module itself is imported."""
    found: list[tuple[str, str]] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found += [(str(node.module), alias.name) for alias in node.names]
    return found


def room_of(module: str) -> str:
    """Name the room of a module: a folder or file of mgdd, and the studies are one."""
    package, _, rest = module.partition(".")
    return package if package != "mgdd" else rest.partition(".")[0] or "mgdd"


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


def include_graph(root: Path) -> dict[str, set[str]]:
    """Which header includes which, by path below the include folder."""
    include, base = re.compile(r'^\s*#\s*include\s*[<"]mgdd/(.+\.hpp)[>"]', re.MULTILINE), root / "cpp/include/mgdd"
    return {
        str(path.relative_to(base)): set(include.findall(path.read_text(encoding="utf-8")))
        for path in sorted(base.rglob("*.hpp"))
    }


def import_graph(root: Path) -> dict[str, set[str]]:
    """Which module imports which, inside functions and for type checkers too."""
    ours = modules(root)
    graph = {
        module: {f"{source}.{name}" if f"{source}.{name}" in ours else source for source, name in imported(path)}
        for module, path in ours.items()
        if module != "mgdd"
    }
    return {module: (found & ours.keys()) - {"mgdd"} for module, found in graph.items()}


def circle(graph: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_header_includes_itself_by_a_detour(root: Path) -> None:
    graph = include_graph(root)
    assert sum(map(len, graph.values())) > 100
    assert circle(graph) == []


def test_no_module_imports_itself_by_a_detour(root: Path) -> None:
    graph = import_graph(root)
    assert sum(map(len, graph.values())) > 200
    assert circle(graph) == []


@pytest.mark.parametrize(("one", "other"), STRANGERS)
def test_parts_of_a_room_that_do_not_know_each_other(root: Path, one: str, other: str) -> None:
    for own, foreign in ((one, other), (other, one)):
        cpp = [p for base in ("cpp/include/mgdd", "cpp/src") for p in sorted((root / base / own).rglob("*.?pp"))]
        python = sorted((root / "python/mgdd" / own).rglob("*.py"))
        assert cpp
        assert python
        word = re.compile(f"mgdd/{foreign}/|mgdd\\.{foreign.replace('/', '[.]')}\\b")
        assert [str(path) for path in cpp + python if word.search(path.read_text(encoding="utf-8"))] == []


def test_a_circle_is_found(tmp_path: Path) -> None:
    write(tmp_path, "cpp/include/mgdd/engine/a.hpp", '#include "mgdd/engine/b.hpp"\n')
    write(tmp_path, "cpp/include/mgdd/engine/b.hpp", "#include <mgdd/engine/c.hpp>\n")
    write(tmp_path, "cpp/include/mgdd/engine/c.hpp", '#include "mgdd/engine/a.hpp"\n')
    assert set(circle(include_graph(tmp_path))) == {"engine/a.hpp", "engine/b.hpp", "engine/c.hpp"}
    write(tmp_path, "python/mgdd/__init__.py", "")
    write(tmp_path, "python/mgdd/io/__init__.py", "from mgdd.io.a import x\n")
    write(tmp_path, "python/mgdd/io/a.py", "def x():\n    from mgdd.io import b\n")
    write(tmp_path, "python/mgdd/io/b.py", "import numpy\n")
    assert circle(import_graph(tmp_path)) == []
    for back in (
        "import mgdd.io.a",
        "if TYPE_CHECKING:\n    from mgdd.io.a import x",
        "def y():\n    from mgdd.io import a",
    ):
        write(tmp_path, "python/mgdd/io/b.py", back)
        assert set(circle(import_graph(tmp_path))) == {"mgdd.io.a", "mgdd.io.b"}


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
        ("python/mgdd_studies/a.py", "from mgdd_studies.b import run\nfrom mgdd.cli import main\n", None),
        ("python/mgdd/cli/a.py", "from mgdd_studies import run_study\n", "cli must not use mgdd_studies"),
        ("python/mgdd/cli/a.py", "import mgdd_studies.base\n", "cli must not use mgdd_studies"),
        ("python/mgdd/plot/a.py", "def f():\n    from mgdd import engine\n", "plot must not use engine"),
        ("python/mgdd/io/a.py", "import mgdd.plot.cycles\n", "io must not use plot"),
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


# --- the studies and mgdd -----------------------------------------------------------------------------------
def private_uses(root: Path, folder: str = "mgdd_studies") -> list[str]:
    """What the studies, or another folder, take of mgdd that is not public.

    Public is a module, and a name that a module lists or, without a list, defines, where no part of the path begins
    with an underscore.
    """
    ours = {module: path for module, path in modules(root).items() if module.partition(".")[0] == "mgdd"}
    lists = {module: {"__version__", *listed_names(path)} for module, path in ours.items()}
    found = []
    for path in sorted((root / "python" / folder).rglob("*.py")):
        uses = {(module, name) for module, name in imported(path) if module in ours or module.startswith("mgdd._")}
        uses |= {(module, "") for module, name in imported(path) if not name and module in ours}
        tree = ast.parse(path.read_text(encoding="utf-8"))
        bound = dict[str, str]()  # what stands for a module of mgdd
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                bound |= {alias.asname or "mgdd": alias.name if alias.asname else "mgdd" for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                bound |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute):
                head, dot, rest = ast.unparse(node.value).partition(".")
                if (module := f"{bound.get(head, '')}{dot}{rest}") in ours:
                    uses.add((module, node.attr))
                elif head not in ("self", "cls", "os") and re.match(r"_[a-z]", node.attr):
                    found.append(f"{path.name}: {ast.unparse(node)}")
        for module, name in uses:
            whole = f"{module}.{name}" if name else module
            hidden = any(re.match(r"_[a-z]", part) for part in whole.split("."))
            if hidden or not (whole in ours or name in lists[module]):
                found.append(f"{path.name}: {whole}")
    return sorted(found)


def listed_names(path: Path) -> set[str]:
    """Read the list of public names of a module, or what it defines where it has none."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["__all__"]:
            return set(ast.literal_eval(node.value))
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            stored = (each for each in ast.walk(node) if isinstance(each, ast.Name))
            found |= {each.id for each in stored if isinstance(each.ctx, ast.Store)}
    return found


@pytest.mark.parametrize("folder", ["mgdd_studies", "mgdd/workbench"])
def test_studies_and_views_take_nothing_private(root: Path, folder: str) -> None:
    found = private_uses(root, folder)
    assert [each for each in found if each != "__init__.py: mgdd._rooms.furnish"] == []  # which every module ends in


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("from mgdd.io import load\nfrom mgdd import io, __version__\nio.load()", []),
        ("from mgdd.io.deep import load\nimport mgdd.io\nmgdd.io.load()", []),
        ("from mgdd._core import systems", ["a.py: mgdd._core.systems"]),
        ("from mgdd import _core", ["a.py: mgdd._core"]),
        ("from mgdd._core.engine import Cylinder", ["a.py: mgdd._core.engine.Cylinder"]),
        ("from mgdd.io import helper", ["a.py: mgdd.io.helper"]),
        ("from mgdd.io.plain import load, LARGEST", []),
        ("from mgdd.io.plain import os", ["a.py: mgdd.io.plain.os"]),
        ("def f():\n    from mgdd.io import _load", ["a.py: mgdd.io._load"]),
        ("from mgdd import io as files\nfiles.helper()", ["a.py: mgdd.io.helper"]),
        ("import mgdd.io\nmgdd.io.helper()", ["a.py: mgdd.io.helper"]),
        ("from mgdd.io import load\nload()._state = 1", ["a.py: load()._state"]),
        ("class A:\n    def f(self):\n        return self._x", []),
    ],
)
def test_what_is_private_is_seen(tmp_path: Path, text: str, found: list[str]) -> None:
    write(tmp_path, "python/mgdd/__init__.py", "")
    write(tmp_path, "python/mgdd/io/__init__.py", '__all__ = ["load"]\n')
    write(tmp_path, "python/mgdd/io/deep.py", '__all__ = ["load"]\n')
    write(tmp_path, "python/mgdd/io/plain.py", "import os\nLARGEST: int = 1\ndef load(): pass\n")
    write(tmp_path, "python/mgdd_studies/a.py", text)
    assert private_uses(tmp_path) == found


def test_mgdd_names_the_studies_at_their_entry_alone(root: Path) -> None:
    package = root / "python" / "mgdd"
    named = [path for path in package.rglob("*.*") if path.suffix != ".pyc" and b"mgdd_studies" in path.read_bytes()]
    assert [str(path.relative_to(package)) for path in named] == ["cli/study.py"]
    entered = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    assert entered == {"mgdd.studies": {"command": "mgdd_studies.command"}}
