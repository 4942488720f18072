"""Builds and test runs of mutants in a copy of the sources below build/: only what a change touches is compiled."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import math
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mutants import Mutant

__all__ = ["Cpp", "Outcome", "Python", "Runner", "fingerprint"]

_PARTS = (
    "cmake", "cpp", "docs", "notebooks", "python", "tests", "tools",
    "CHANGELOG.md", "CITATION.cff", "CMakeLists.txt", "CMakePresets.json", "CONTRIBUTING.md", "LICENSE", "README.md",
    "THIRD_PARTY.md", "pyproject.toml", "references.bib",
)  # fmt: skip
# Processor time, so that a busy machine kills no mutant: what the tests need without one, times this, and this more.
_FACTOR = 8.0
_MORE_S = 20.0
_FAST = "not slow and not docs and not notebook and not stubs"  # at most what `make test` runs
_ASLEEP = 60.0  # a test that waits for ever ends after so many times its processor time


@dataclass(frozen=True)
class Outcome:
    """What became of one mutant."""

    status: str  # killed, survived, timeout, not compiled
    by: str  # the first test that failed
    seconds: float


class Runner(Protocol):
    """How the mutants of a module are built and tested."""

    def sources(self) -> list[Path]:
        """Return what may be changed."""

    def tests(self) -> list[Path]:
        """Return the tests that try the changes."""

    def prepare(self) -> None:
        """Bring the copy up to date, build it, and see its tests pass."""

    def run(self, mutant: Mutant) -> Outcome:
        """Build and test one change; it is taken back by the next one."""


def fingerprint(paths: Iterable[Path]) -> str:
    """Return a short hash of the content of files."""
    sums = [hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(paths)]
    return hashlib.sha256("".join(sums).encode()).hexdigest()[:16]


def _run(command: Sequence[str], folder: Path, cpu_s: float = 0.0, **extra: str) -> tuple[int | None, str]:
    """Return exit code, None where the processor time was up, and output; children end with it."""
    process = subprocess.Popen(
        command, cwd=folder, env={**os.environ, **extra}, text=True, errors="replace",
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
    )  # fmt: skip
    if cpu_s > 0.0:
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (math.ceil(cpu_s), math.ceil(cpu_s)))
    try:
        text, _ = process.communicate(timeout=_ASLEEP * cpu_s if cpu_s > 0.0 else None)
        return (None if process.returncode in (-signal.SIGKILL, -signal.SIGXCPU) else process.returncode), text
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        text, _ = process.communicate()
        return None, text
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        raise


def _timed(command: Sequence[str], folder: Path, **extra: str) -> float:
    """Return the processor seconds of a command that must succeed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _need(command, folder, **extra)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def _need(command: Sequence[str], folder: Path, **extra: str) -> str:
    code, text = _run(command, folder, 0.0, **extra)
    if code != 0:
        raise RuntimeError(f"{shlex.join(command)[:300]} ... failed in {folder}:\n{text[-3000:]}")
    return text


class _Copy:
    """The sources in a folder of their own; a mutant is written over its file and taken back by the next."""

    def __init__(self, root: Path, scratch: Path) -> None:
        self.root, self.scratch = root, scratch
        self._changed: Path | None = None

    def sync(self) -> None:
        """Make the copy equal; what is equal already keeps its time, so that nothing is built twice."""
        told = _need(["git", "ls-files", "-z", "-co", "--exclude-standard", "--", *_PARTS], self.root)
        wanted = {name for name in told.split("\0") if name and (self.root / name).is_file()}
        for part in _PARTS:
            for old in (self.scratch / part).rglob("*"):
                if old.is_file() and not old.is_symlink() and old.relative_to(self.scratch).as_posix() not in wanted:
                    old.unlink()
        for name in wanted:
            old, new = self.scratch / name, self.root / name
            if not (old.is_file() and old.read_bytes() == new.read_bytes()):
                old.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(new, old)

    def apply(self, mutant: Mutant) -> None:
        target = self.scratch / mutant.path
        if self._changed not in (None, target):
            self.restore()
        lines = (self.root / mutant.path).read_text(encoding="utf-8").split("\n")
        if lines[mutant.line - 1] != mutant.before:
            raise RuntimeError(f"{mutant.path}:{mutant.line} has changed meanwhile: start again")
        lines[mutant.line - 1] = mutant.after
        target.write_text("\n".join(lines), encoding="utf-8")
        self._changed = target

    def restore(self) -> None:
        if self._changed is not None:
            shutil.copyfile(self.root / self._changed.relative_to(self.scratch), self._changed)
            self._changed = None


# --- C++ ------------------------------------------------------------------------------------------------------------


@dataclass
class _Stage:
    """A test program of one file of tests and of those objects of the library that it needs."""

    test: str
    objects: list[str]
    program: str
    files: set[str] = field(default_factory=set)  # that its objects are made of
    seconds: float = 0.0
    kills: int = 0


class Cpp:
    """A C++ module: one small program per file of tests, and only objects that include a change are built."""

    def __init__(self, root: Path, scratch: Path, module: str, *, jobs: int, also: Sequence[str] = ()) -> None:
        self._copy = _Copy(root, scratch)
        self._root, self._build, self._module, self._jobs = root, scratch / "build", module, jobs
        self._folders = [module, *also]
        self._stages: list[_Stage] = []
        self._link: list[str] = []

    def sources(self) -> list[Path]:
        """Return headers and sources of the module."""
        folders = [self._root / "cpp" / part / self._module for part in ("include/mgdd", "src", "")]
        return [path for folder in folders for path in folder.rglob("*.[ch]pp")]

    def tests(self) -> list[Path]:
        """Return the tests of the folders, and what they share."""
        folders = [self._root / "tests/cpp" / name for name in (*self._folders, "support")]
        return [path for folder in folders for path in folder.rglob("*.[ch]pp")]

    def prepare(self) -> None:
        """Configure and build the test programs, and see them pass."""
        self._copy.sync()
        self._build.mkdir(parents=True, exist_ok=True)
        launcher = shutil.which("ccache")
        _need(
            [
                "cmake", "-S", "..", "-B", ".", "-G", "Ninja", "-DMGDD_BUILD_TESTS=ON", "-DMGDD_UNITY=OFF",
                "-DCMAKE_BUILD_TYPE=None", "-DCMAKE_CXX_FLAGS=-O1 -w -D_GLIBCXX_ASSERTIONS",
                "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON",
                f"-DPython_EXECUTABLE={sys.executable}", f"-DCMAKE_PREFIX_PATH={sysconfig.get_path('purelib')}",
                *([f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}"] if launcher else []),
            ],
            self._build,
        )  # fmt: skip
        entries = json.loads((self._build / "compile_commands.json").read_text(encoding="utf-8"))
        commands = _need(["ninja", "-t", "commands", "mgdd_tests"], self._build)
        outputs = {
            Path(entry["file"]): out
            for entry in entries
            if (out := os.path.relpath(entry["output"], self._build)) in commands  # other programs compile some again
        }
        tests = self._copy.scratch / "tests/cpp"
        own = {file: out for file, out in outputs.items() if any(file.is_relative_to(tests / f) for f in self._folders)}
        if not own:
            raise RuntimeError(f"no tests in {' or '.join(f'tests/cpp/{name}' for name in self._folders)}")
        shared = [out for file, out in outputs.items() if file.is_relative_to(tests / "support")]
        told = commands.splitlines()[-1]
        link = [word for word in shlex.split(told.removeprefix(": && ").removesuffix(" && :")) if word[-2:] != ".o"]
        archives = [word for word in link if word.endswith(".a") and not word.startswith("/")]
        self._link = [word for word in link if word not in archives]
        self._ninja([*own.values(), *shared, *archives])
        support = self._build / "libmutant_support.a"
        support.unlink(missing_ok=True)
        _need(["ar", "qc", support.name, *shared], self._build)
        library = [out for file, out in outputs.items() if not file.is_relative_to(tests)] + shared
        made_of = self._made_of()
        for file, out in own.items():
            stage = _Stage(file.relative_to(tests).as_posix(), [out], f"mutant_{Path(out).name}.exe")
            told = self._program(
                stage, [support.name, *archives, "-Wl,-t,-t"]
            )  # twice: names what it takes of archives
            needed = set(re.findall(r"\.a\)?\(?([\w.+-]+\.o)", told))
            stage.objects += [other for other in library if Path(other).name in needed]
            stage.files = set().union(*(made_of.get(other, set()) for other in stage.objects))
            self._program(stage)
            stage.seconds = _timed([str(self._build / stage.program), "--gtest_brief=1"], self._copy.scratch)
            self._stages.append(stage)

    def _made_of(self) -> dict[str, set[str]]:
        """Return the files below the copy that each object was made of."""
        out: dict[str, set[str]] = {}
        for block in _need(["ninja", "-t", "deps"], self._build).split("\n\n"):
            name, _, files = block.partition(":")
            paths = (os.path.normpath(self._build / line.strip()) for line in files.splitlines()[1:])
            start = f"{self._copy.scratch}/"
            out[name] = {path.removeprefix(start) for path in paths if path.startswith(start)}
        return out

    def _ninja(self, targets: Sequence[str]) -> None:
        _need(["ninja", f"-j{self._jobs}", *targets], self._build)

    def _program(self, stage: _Stage, more: Sequence[str] = ()) -> str:
        link = list(self._link)
        link[link.index("-o") + 1] = stage.program
        return _need([link[0], *stage.objects, *more, *link[1:]], self._build)

    def run(self, mutant: Mutant) -> Outcome:
        """Build what includes the changed file, link and test, the most deadly file of tests first."""
        began = time.monotonic()
        self._copy.apply(mutant)
        status, by = "survived", ""
        for stage in sorted(self._stages, key=lambda one: (-one.kills, one.seconds)):
            if mutant.path not in stage.files:
                continue
            try:
                self._ninja(stage.objects)
                self._program(stage)
            except RuntimeError:
                status = "not compiled"
                break
            code, text = _run(
                [str(self._build / stage.program), "--gtest_brief=1", "--gtest_fail_fast", "--gtest_color=no"],
                self._copy.scratch, _FACTOR * stage.seconds + _MORE_S,
            )  # fmt: skip
            if code != 0:
                stage.kills += 1
                failed = re.search(r"\[  FAILED  \] ([\w./]+)", text)
                status = "timeout" if code is None else "killed"
                by = failed[1] if failed else f"{stage.test}, exit code {code}"
                break
        return Outcome(status, by, round(time.monotonic() - began, 1))


# --- Python ---------------------------------------------------------------------------------------------------------


class Python:
    """A Python module, with the compiled core that stands there; tests are the files that name the module."""

    def __init__(self, root: Path, scratch: Path, module: str, also: Sequence[str] = ()) -> None:
        self._copy = _Copy(root, scratch)
        self._root, self._module, self._also = root, module.removeprefix("mgdd."), also
        self._files: list[str] = []
        self._seconds = 0.0

    def sources(self) -> list[Path]:
        """Return the files of the module."""
        place = self._root / "python/mgdd" / self._module.replace(".", "/")
        return list(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]

    def tests(self) -> list[Path]:
        """Return the test files that name the module."""
        names = "|".join(re.escape(name.removeprefix("mgdd.")) for name in (self._module, *self._also))
        mention = re.compile(rf"\bmgdd\.({names})\b|from mgdd import [^\n]*\b({names})\b")
        return [
            path
            for path in (self._root / "tests/python").rglob("test_*.py")
            if mention.search(path.read_text(encoding="utf-8"))
        ]

    def prepare(self) -> None:
        """See the tests pass, and sort the files by the time they take."""
        self._copy.sync()
        package = self._copy.scratch / "python/mgdd"
        for old in package.glob("_core.*.so"):
            old.unlink()
        (package / self._core().name).symlink_to(self._core())
        self._files = [path.relative_to(self._root).as_posix() for path in self.tests()]
        if not self._files:
            raise RuntimeError(f"no file in tests/python names mgdd.{self._module}")
        told = self._copy.scratch / "durations.xml"
        self._seconds = _timed(self._command(f"--junitxml={told}"), self._copy.scratch, **self._environment())
        took = dict.fromkeys(self._files, 0.0)
        for case in ET.parse(told).iter("testcase"):
            name = case.get("classname", "").replace(".", "/") + ".py"
            if name in took:
                took[name] += float(case.get("time", 0.0))
        self._files.sort(key=took.__getitem__)

    def _core(self) -> Path:
        fresh = sorted((self._root / "build/dev/python/mgdd").glob("_core.*.so"))
        if fresh:
            return fresh[0]
        found = importlib.util.find_spec("mgdd._core")
        if found is None or found.origin is None:
            raise RuntimeError("no compiled mgdd._core: build it with cmake --build --preset dev --target _core")
        return Path(found.origin)

    def _command(self, *options: str) -> list[str]:
        return [
            sys.executable, "-m", "pytest", "-x", "-q", "-m", _FAST,
            "-o", f"cache_dir={self._copy.scratch / 'pytest'}", *options, *self._files,
        ]  # fmt: skip

    def _environment(self) -> dict[str, str]:
        # A changed file of the same size and second would be taken for the compiled one.
        return {"PYTHONPATH": str(self._copy.scratch / "python"), "PYTHONDONTWRITEBYTECODE": "1"}

    def run(self, mutant: Mutant) -> Outcome:
        """Run the tests on the changed copy."""
        began = time.monotonic()
        self._copy.apply(mutant)
        try:
            compile((self._copy.scratch / mutant.path).read_text(encoding="utf-8"), mutant.path, "exec")
        except SyntaxError:
            return Outcome("not compiled", "", 0.0)
        limit = _FACTOR * self._seconds + _MORE_S
        code, text = _run(self._command(), self._copy.scratch, limit, **self._environment())
        failed = re.search(r"^(?:FAILED|ERROR) (?:tests/python/)?(\S+)", text, re.MULTILINE)
        status = {None: "timeout", 0: "survived"}.get(code, "killed")
        by = (failed[1] if failed else f"exit code {code}") if status == "killed" else ""
        return Outcome(status, by, round(time.monotonic() - began, 1))
