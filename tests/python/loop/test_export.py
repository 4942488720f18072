"""A controller as C++: every number arrives, a host gives the same bits, a Cortex-M but for exp and tanh."""

import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mgdd
from cpp_tools import configure, run, tool
from mgdd.control import GuidedPredictive, Mgdd1, Pid, SlidingMode, SupervisedController
from mgdd.errors import ParameterError
from mgdd.loop import Reference, export_controller, track, tuned_controller
from mgdd.throttle import Throttle

CPP = Path(mgdd.cmake_dir()).parent
CORTEX_M = Path(__file__).parents[2] / "data" / "cortex_m"
KINDS = ("guided", "pid", "sliding_mode", "linear_mpc", "nmpc")
HEAVY = Throttle().replace(coulomb_nm=0.35, stiction_nm=0.35)
# As firmware is compiled, with every warning that a project may have switched on.
FLAGS = "-std=c++20 -O2 -fno-exceptions -fno-rtti -ffunction-sections -ffp-contract=off -Wall -Wextra -Wpedantic"
FLAGS += " -Wconversion -Wshadow -Wdouble-promotion -Werror"
TARGETS = {
    "host": ("g++", "", ""),
    "clang": ("clang++", "", ""),
    "Cortex-M4 with floats of 32 bits, mps2-an386": (
        "arm-none-eabi-g++", "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -Wno-psabi", "mps2-an386",
    ),
    "Cortex-M7, mps2-an500": (
        "arm-none-eabi-g++", "-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -Wno-psabi", "mps2-an500",
    ),
}  # fmt: skip


def export(kind: str, folder: Path, **options: Any) -> Any:
    return export_controller(tuned_controller(kind), folder, throttle=HEAVY, seed=3, **options)


@pytest.fixture(scope="module")
def target(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """What compiles and runs an exported folder on the target that is asked for; skipped where a tool is missing."""
    compiler, flags, board = TARGETS[request.param]
    for needed in (compiler, *(["qemu-system-arm"] if board else [])):
        if shutil.which(needed) is None:
            pytest.skip(f"{needed} is not installed")
    objects = tmp_path_factory.mktemp("control")
    command = [compiler, *FLAGS.split(), *flags.split(), "-I", CPP / "include"]
    for source in sorted((CPP / "src" / "control").glob("*.cpp")):
        run(*command, "-c", source, "-o", objects / f"{source.stem}.o")

    def compiled(folder: Path, *, code: int = 0, program: str = "main", options: Sequence[str] = ()) -> str:
        made = folder / program
        main = CORTEX_M / "cost.cpp" if program == "cost" else folder / "main.cpp"
        sources = [main, *objects.glob("*.o"), *([CORTEX_M / "start.cpp"] if board else [])]
        linking = ["-T", CORTEX_M / "sections.ld", "--specs=rdimon.specs"] if board else []
        run(*command, "-I", folder, *sources, "-Wl,--gc-sections", *linking, "-o", made)
        if not board:
            return run(made, code=code)
        files = "enable=on,target=native"
        qemu = ("qemu-system-arm", "-M", board, "-nographic", "-semihosting-config", files, *options, "-kernel", made)
        return run(*qemu, code=code)

    return compiled


def numbers_of(said: str) -> tuple[int, int, float, float]:
    """Samples, how many are equal, the largest difference and the allowed one, as the program prints them."""
    found = re.fullmatch(
        r"\w+: (\d+) samples, (\d+) equal, \d+ wrong, largest difference (\S+), allowed (\S+), \d+ .*\n", said
    )
    assert found, said
    return int(found[1]), int(found[2]), float(found[3]), float(found[4])


@pytest.mark.parametrize("target", ["host", "clang"], indirect=True)
def test_the_host_gives_every_duty_bit_by_bit(target: Callable[..., str], tmp_path: Path) -> None:
    for kind in KINDS:
        for single in (False, True):
            folder = tmp_path / f"{kind}_{single}"
            tracked = export(kind, folder, single_precision=single)
            samples, equal, largest, allowed = numbers_of(target(folder))
            assert (samples, equal, largest) == (tracked.sizes["time_s"], samples, 0.0), kind
            assert 0.0 < allowed < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("target", [name for name in TARGETS if "Cortex" in name], indirect=True)
def test_a_cortex_m_differs_by_its_exp_and_tanh_alone(target: Callable[..., str], tmp_path: Path) -> None:
    for kind in KINDS:
        for single in (False, True):
            folder = tmp_path / f"{kind}_{single}"
            export(kind, folder, single_precision=single)
            samples, equal, largest, allowed = numbers_of(target(folder))
            assert largest <= allowed
            if single and kind != "nmpc":  # coefficients are computed in 64 bits: another exp no longer shows
                assert equal == samples


@pytest.mark.parametrize("target", ["host"], indirect=True)
@pytest.mark.parametrize("kind", [GuidedPredictive, Pid, SlidingMode])
def test_every_setting_arrives_to_the_last_bit(kind: Any, target: Callable[..., str], tmp_path: Path) -> None:
    settings = {}
    for i, (name, value) in enumerate(kind().settings.items()):
        field = kind.fields()[name]
        if "choices" in field:
            settings[name] = field["choices"][-1]
        elif isinstance(value, bool):
            settings[name] = not value
        elif isinstance(value, list):
            settings[name] = [entry + 1 for entry in value]
        elif isinstance(value, int):
            settings[name] = value + (1 if value < field["upper"] else -1)
        elif name != "sample_s":  # another number for each, with all of its digits
            settings[name] = float(np.clip((value or 0.1) * (1.0 - 0.001 * (i + 1) / 3.0), field["lower"], 1e9))
    controller = kind(**settings)
    assert [name for name, value in kind().settings.items() if value == controller.settings[name]] == ["sample_s"]
    export_controller(controller, tmp_path)
    (tmp_path / "main.cpp").write_text(
        '#include <cstdio>\n#include <type_traits>\n#include "controller_settings.hpp"\n'
        "template <class V> void show(const V& v) {\n"
        '  if constexpr (std::is_enum_v<V>) std::printf(" %.17g", static_cast<double>(static_cast<int>(v)));\n'
        '  else if constexpr (std::is_arithmetic_v<V>) std::printf(" %.17g", static_cast<double>(v));\n'
        "  else for (const auto& each : v) show(each);\n}\n"
        "int main() {\n  const auto show_field = [](const auto& field) {\n"
        '    std::printf("%.*s", static_cast<int>(field.info.name.size()), field.info.name.data());\n'
        '    show(field.in(throttle_controller::settings));\n    std::printf("\\n");\n  };\n'
        "  mgdd::for_each_field(fields_of(throttle_controller::settings), show_field);\n}\n"
    )
    arrived = {name: numbers for name, *numbers in map(str.split, target(tmp_path).splitlines())}
    assert arrived.keys() == controller.settings.keys()
    for name, value in controller.settings.items():
        expected = kind.fields()[name]["choices"].index(value) if isinstance(value, str) else value
        assert [float(number) for number in arrived[name]] == np.ravel(expected).tolist(), name


@pytest.mark.parametrize("target", ["host"], indirect=True)
def test_a_setting_that_is_off_by_a_millionth_fails(target: Callable[..., str], tmp_path: Path) -> None:
    export("pid", tmp_path)
    header = tmp_path / "controller_settings.hpp"
    line = re.search(r"s\.above\.proportional_per_deg = (\S+);", header.read_text())
    assert line
    header.write_text(header.read_text().replace(line[1], repr(float(line[1]) * (1.0 + 1e-6))))
    assert target(tmp_path, code=1).startswith("FAILED: 1500 samples, ")


@pytest.mark.slow
def test_cmake_builds_it_with_find_package(tmp_path: Path) -> None:
    """As the first lines of its CMakeLists.txt say."""
    export("guided", tmp_path)
    build = tmp_path / "build"
    configure(tmp_path, build, mgdd_DIR=mgdd.cmake_dir())
    run(tool("cmake"), "--build", build)
    assert "100% tests passed" in run(tool("ctest"), "--test-dir", build)


def test_what_a_package_does_not_have_is_said(tmp_path: Path) -> None:
    lists = (
        "cmake_minimum_required(VERSION 3.25)\nproject(p LANGUAGES CXX)\nfind_package(mgdd REQUIRED COMPONENTS core)"
    )
    (tmp_path / "CMakeLists.txt").write_text(lists)
    with pytest.raises(AssertionError, match=r"A Python wheel has the component control\s+only"):
        configure(tmp_path, tmp_path / "build", mgdd_DIR=mgdd.cmake_dir())


@pytest.mark.slow
@pytest.mark.parametrize("target", [name for name in TARGETS if "Cortex" in name], indirect=True)
def test_a_float_step_takes_a_tenth_without_wider_hardware(target: Callable[..., str], tmp_path: Path) -> None:
    """Instructions, counted; the table of the page has them."""
    counted = {}
    for kind in ("guided", "pid", "sliding_mode"):
        for single in (False, True):
            folder = tmp_path / f"{kind}_{single}"
            export(kind, folder, single_precision=single)
            mean, most = map(int, target(folder, program="cost", options=("-icount", "shift=0")).split())
            assert mean <= most
            counted[kind, single] = most
    in_hardware = counted["pid", False] < 2 * counted["pid", True]
    assert counted["guided", True] < 30_000, counted
    assert in_hardware or counted["guided", False] > 5 * counted["guided", True], counted


@pytest.mark.parametrize("kind", ["guided", "pid"])
def test_the_run_is_that_of_track(kind: str, tmp_path: Path) -> None:
    controller = tuned_controller(kind)
    controller.step(20.0, 18.0)  # its state is its own business
    before = controller.state
    tracked = export_controller(controller, tmp_path, reference="step:20:40", throttle=HEAVY, seed=3)
    assert controller.state == before
    own = track(tuned_controller(kind), "step:20:40", throttle=HEAVY, seed=3)
    for name in own.data_vars:
        np.testing.assert_array_equal(tracked[name], own[name])
    measured = tracked["measured_deg"].to_numpy()
    np.testing.assert_array_equal(measured[1:], own["sensed_angle_deg"].to_numpy()[:-1])


def test_single_precision_is_what_the_target_computes(tmp_path: Path) -> None:
    double, single = (export("guided", tmp_path, single_precision=each) for each in (False, True))
    duty = single["duty"].to_numpy()
    np.testing.assert_array_equal(duty, duty.astype(np.float32))
    assert (double["duty"] != double["duty"].astype(np.float32)).any()
    assert single.attrs["allowed_difference"] > 1e3 * double.attrs["allowed_difference"]
    assert abs(float(single["settling_ms"]) - float(double["settling_ms"])) <= 5.0
    assert "using Number = float;" in (tmp_path / "controller_settings.hpp").read_text()


def test_a_main_of_ones_own_stays_and_the_headers_are_new(tmp_path: Path) -> None:
    export("pid", tmp_path)
    (tmp_path / "main.cpp").write_text("// mine\n")
    export("sliding_mode", tmp_path)
    assert (tmp_path / "main.cpp").read_text() == "// mine\n"
    assert "BasicSlidingMode<Number>" in (tmp_path / "controller_settings.hpp").read_text()


class Own:
    def step(self, reference_deg: float, measured_deg: float) -> float:
        return 0.01 * (reference_deg - measured_deg)


@pytest.mark.parametrize(
    ("controller", "options", "said"),
    [
        (Own(), {}, "controller = .* must be a GuidedPredictive, Pid or SlidingMode$"),
        (Mgdd1(), {}, "tuned_controller\\('guided', ...\\)"),
        (SupervisedController(Pid()), {}, "give its .controller"),
        (Pid(), {"reference": Reference.step(20.0, 40.0, sample_s=2e-3)}, "reference = .*samples of 0.002 s.*0.001 s"),
        (Pid(), {"delay_samples": 21}, "delay_samples = 21"),
    ],
)
def test_what_cannot_be_exported(controller: Any, options: dict[str, Any], said: str, tmp_path: Path) -> None:
    folder = tmp_path / "target"
    with pytest.raises(ParameterError, match=said):
        export_controller(controller, folder, **options)
    assert not folder.exists()


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("mine")
    with pytest.raises(ParameterError, match="target': must be a folder, and this is a file: name another"):
        export_controller(Pid(), tmp_path / "target")
    assert (tmp_path / "target").read_text() == "mine"
