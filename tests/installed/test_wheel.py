"""The package as a user installs it: `make wheel-check` puts it alone into an environment outside the repository."""

import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

from cpp_tools import configure, run, tool

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOUR = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")
PACKAGE_FILES = re.compile(
    r"mgdd/(.*\.pyi?|_core\..*\.so|py\.typed|presets/[^/]+\.toml|report/templates/[^/]+\.(html|css)"
    r"|cpp/(cmake/[^/]+\.cmake|include/mgdd/(common|control|dynamics|math)/[^/]+\.hpp|src/control/[^/]+\.cpp"
    r"|export/(main\.cpp|CMakeLists\.txt))|data/([^/]+/)*[^/]+\.(csv|txt|toml)|rig/(can/buses|envelopes)/[^/]+\.(dbc|toml)|.*\.pyc)"
    r"|mgdd_studies/(.*\.pyc?|py\.typed)|mgdd-[^/]+\.dist-info/.*|(\.\./)*bin/mgdd"
)
HEAVY = {"scipy", "xarray", "pandas", "matplotlib", "rich", "jinja2", "pooch", "packaging"}
# Commands of the tour that ask for no file of the reader's own; those of the rig are run as one block below.
COMMANDS = [
    line
    for block in re.findall(r"```console\n(.*?)```", TOUR, re.DOTALL)
    for line in block.splitlines()
    if line.startswith("mgdd ")
    and not line.startswith("mgdd rig ")
    and not re.search(r"\w+\.(csv|toml)\b(?<!output chirp\.csv)", line)
]


@pytest.fixture(scope="module")
def environment() -> Path:
    """Give the environment that holds the package."""
    folder = os.environ.get("MGDD_INSTALLED")
    assert folder, "no environment is named in MGDD_INSTALLED: run `make wheel-check`"
    return Path(folder)


def call(program: Path, *words: str, cwd: Path) -> str:
    """Run a program of the environment in an empty folder, away from the sources."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    clean |= {"MPLBACKEND": "Agg", "PYTHONWARNINGS": "error"}
    done = subprocess.run([str(program), *words], cwd=cwd, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, f"{words} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_package_is_the_installed_one(environment: Path, tmp_path: Path) -> None:
    code = (
        "import importlib.metadata as m, mgdd, mgdd._core as c;"
        "print(mgdd.__version__, m.version('mgdd'), mgdd.__file__, c.__file__, sep='\\n')"
    )
    version, recorded, package, module = call(environment / "bin" / "python", "-c", code, cwd=tmp_path).splitlines()
    assert version == recorded
    assert Path(package).is_relative_to(environment)
    assert Path(module).is_relative_to(environment)


def test_nothing_else_is_installed(environment: Path, tmp_path: Path) -> None:
    code = "import importlib.metadata as m; print(*m.files('mgdd'), sep='\\n')"
    files = call(environment / "bin" / "python", "-c", code, cwd=tmp_path).splitlines()
    assert any(file.startswith("mgdd/_core.") for file in files)
    assert {"mgdd/py.typed", "mgdd_studies/py.typed", "mgdd_studies/command.py"} <= set(files)
    assert [file for file in files if not PACKAGE_FILES.fullmatch(file)] == []


def test_import_is_light(environment: Path, tmp_path: Path) -> None:
    """NumPy and the core, nothing else."""
    code = (
        "import numpy, sys; n = set(sys.modules); import mgdd;"
        "print(*sorted({m.split('.')[0] for m in set(sys.modules) - n}))"
    )
    loaded = set(call(environment / "bin" / "python", "-c", code, cwd=tmp_path).split())
    assert "mgdd" in loaded
    assert loaded & HEAVY == set()


def test_python_of_readme_and_tour_runs(environment: Path, tmp_path: Path) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", README + TOUR, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 4
    call(environment / "bin" / "python", "-c", "\n".join(blocks), cwd=tmp_path)


def test_the_studies_are_found_by_their_entry_point(environment: Path, tmp_path: Path) -> None:
    code = "import importlib.metadata as m; print(*m.entry_points(group='mgdd.studies'), sep='\\n')"
    assert "mgdd_studies.command" in call(environment / "bin" / "python", "-c", code, cwd=tmp_path)
    assert "sensor-delay" in call(environment / "bin" / "mgdd", "study", "--list", cwd=tmp_path)


def test_a_cmake_project_finds_the_controllers(environment: Path, tmp_path: Path) -> None:
    """Exported, compiled against what was installed, equal bit by bit."""
    call(environment / "bin" / "mgdd", "throttle", "export", "guided", "-o", "target", cwd=tmp_path)
    found = call(environment / "bin" / "python", "-c", "import mgdd; print(mgdd.cmake_dir())", cwd=tmp_path).strip()
    assert Path(found).is_relative_to(environment)
    configure(tmp_path / "target", tmp_path / "build", mgdd_DIR=found)
    run(tool("cmake"), "--build", tmp_path / "build")
    printed = run(tmp_path / "build" / "throttle_controller")
    assert printed.startswith("passed: 1500 samples, 1500 equal, 0 wrong, largest difference 0, ")


@pytest.mark.parametrize("line", COMMANDS)
def test_command_of_the_tour_runs(environment: Path, tmp_path: Path, line: str) -> None:
    assert call(environment / "bin" / "mgdd", *shlex.split(line)[1:], cwd=tmp_path)


def test_rig_of_the_tour_runs(environment: Path, tmp_path: Path) -> None:
    """With what the extra `can` asks for; it comes last: everything above runs without."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    clean |= {"MPLBACKEND": "Agg", "PATH": f"{environment / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    code = "import importlib.metadata as m; print(*m.requires('mgdd'), sep='\\n')"
    asked = call(environment / "bin" / "python", "-c", code, cwd=tmp_path).splitlines()
    wanted = [line.partition(";")[0].strip() for line in asked if re.search(r"extra == .can\b", line)]
    block = next(text for text in re.findall(r"```console\n(.*?)```", TOUR, re.DOTALL) if "mgdd rig " in text)
    for words in (
        [str(environment / "bin" / "python"), "-m", "pip", "install", "-q", *wanted],
        ["sh", "-e", "-c", block],
    ):
        done = subprocess.run(words, cwd=tmp_path, env=clean, capture_output=True, text=True)
        assert done.returncode == 0, f"{words} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}"
    assert (tmp_path / "runs" / "bus" / "run.rec").stat().st_size > 0


def test_there_are_commands_to_run() -> None:
    assert len(COMMANDS) >= 6
