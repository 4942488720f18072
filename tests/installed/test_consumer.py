"""A C++ project finds an installed mgdd, wherever its headers were put, and gets the same bits whatever its flags."""

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cpp_tools import configure, run, tool

ROOT = Path(__file__).resolve().parents[2]
# As the preset `dev`, so that a compiler cache knows the objects again.
AS_DEV = {
    "CMAKE_BUILD_TYPE": "Release",
    "MGDD_WERROR": "ON",
    "MGDD_BUILD_PYTHON": "ON",
    "Python_EXECUTABLE": sys.executable,
}
WARNINGS = "-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror"


@pytest.fixture(scope="session")
def install(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Install the library with its headers in a folder of that name; gives the prefix."""
    build = ROOT / "build" / "consumer"

    def install_into(include: str) -> Path:
        prefix = tmp_path_factory.mktemp("prefix")
        configure(ROOT, build, CMAKE_INSTALL_INCLUDEDIR=include, **AS_DEV)
        run(tool("cmake"), "--build", build, "--target", "mgdd_core")
        run(tool("cmake"), "--install", build, "--component", "dev", "--prefix", prefix)
        return prefix

    return install_into


@pytest.fixture(scope="session")
def eigen(install: Callable[[str], Path]) -> str:
    """Give the Eigen that the library was built with."""
    install("include")
    found = re.search(r"^Eigen3_DIR:\w+=(.*)$", (ROOT / "build/consumer/CMakeCache.txt").read_text(), re.MULTILINE)
    assert found
    return found[1]


@pytest.fixture(scope="session")
def build(install: Callable[[str], Path], eigen: str) -> Callable[..., Path]:
    """Build a project against a fresh prefix; gives the folder of its programs."""

    def build_project(source: Path, folder: Path, *, include: str = "include", flags: str = "") -> Path:
        prefix = install(include)
        variables = {"CMAKE_PREFIX_PATH": str(prefix), "Eigen3_DIR": eigen, "CMAKE_CXX_FLAGS": flags}
        configure(source, folder, CMAKE_BUILD_TYPE="Release", **variables)
        run(tool("cmake"), "--build", folder)
        return folder

    return build_project


@pytest.mark.parametrize("include", ["include", "include/elsewhere"])
def test_examples_build_and_run(build: Callable[..., Path], tmp_path: Path, include: str) -> None:
    programs = build(ROOT / "cpp" / "examples", tmp_path, include=include, flags=WARNINGS)

    timing = [line.split() for line in run(programs / "engine_timing").splitlines()]
    assert timing[0][:2] == ["soc_cad", "efficiency"]
    efficiency = {float(row[0]): float(row[1]) for row in timing[1:]}
    assert max(efficiency, key=efficiency.__getitem__) == -5.0

    step = [line.split(",") for line in run(programs / "throttle_plate", "0.3").splitlines()]
    assert step[0] == ["time_ms", "duty", "angle_deg", "pw_r_angle_deg"]
    angle, model = ([float(row[column]) for row in step[1:]] for column in (2, 3))
    assert angle[0] == 8.0
    assert max(angle) > 25.0 > angle[-1]
    assert all(abs(a - b) < 0.2 for a, b in zip(angle, model, strict=True))

    assert ", 0 allocations, " in run(programs / "throttle_step")  # fails by its exit code if the plate does not follow

    seek = [line.split() for line in run(programs / "seek_timing").splitlines()]
    assert -3.0 < float(seek[-1][1]) < -2.0, "as early as the limit allows"


def test_flags_of_the_consumer_do_not_change_a_bit(build: Callable[..., Path], tmp_path: Path) -> None:
    source = ROOT / "tests" / "installed" / "consumer"
    printed = {
        flags: run(build(source, tmp_path / f"flags{i}", flags=flags) / "bits")
        for i, flags in enumerate(("", "-march=native", "-march=native -O0"))
    }
    plain = printed[""].splitlines()
    assert len(plain) == 8
    for flags, text in printed.items():
        assert text.splitlines() == plain, f"with {flags!r}"


def test_the_controllers_alone_need_no_eigen(install: Callable[[str], Path], tmp_path: Path) -> None:
    source = ROOT / "cpp" / "examples" / "throttle_step.cpp"
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(step LANGUAGES CXX)\n"
        "find_package(mgdd REQUIRED COMPONENTS control)\n"
        f"add_executable(step {source})\ntarget_link_libraries(step PRIVATE mgdd::control)\n"
    )
    configure(tmp_path, tmp_path / "build", CMAKE_PREFIX_PATH=str(install("include")), CMAKE_CXX_FLAGS=WARNINGS)
    run(tool("cmake"), "--build", tmp_path / "build")
    assert ", 0 allocations, " in run(tmp_path / "build" / "step")
    assert "Eigen" not in (tmp_path / "build" / "CMakeCache.txt").read_text()
