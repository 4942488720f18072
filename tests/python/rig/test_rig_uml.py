"""Real SocketCAN: User-Mode Linux boots with vcan and runs tests/uml there, as an ordinary user on a read-only root."""

import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import mgdd

pytestmark = [pytest.mark.uml, pytest.mark.slow]
UML = Path(__file__).parents[2] / "uml"
LIMIT_S = 360
# Root becomes nobody, who may read everything (the interpreter may stand in a home) and write nothing.
_READ_ONLY = "-all,+dac_read_search"
AS_NOBODY = [
    "setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", f"--inh-caps={_READ_ONLY}",
    f"--ambient-caps={_READ_ONLY}", f"--bounding-set={_READ_ONLY}", "--securebits=+no_setuid_fixup",
]  # fmt: skip


def missing() -> str | None:
    """Give the reason why this machine cannot boot it."""
    if "libasan" in os.environ.get("LD_PRELOAD", ""):
        return "AddressSanitizer's shadow memory does not fit into the 512 GiB that this kernel gives a process"
    if shutil.which("linux.uml") is None:
        return "no linux.uml: install Debian's package user-mode-linux (tools/system_packages.sh test)"
    if not list(Path("/usr/lib/uml/modules").glob("*/kernel/net/can/can.ko*")):
        return f"the kernel of user-mode-linux brings no CAN modules on this {platform.machine()}"
    path = os.pathsep.join((os.environ.get("PATH", ""), "/usr/sbin", "/sbin"))
    for tool, package in (("insmod", "kmod"), ("ip", "iproute2"), *((("setpriv", "util-linux"),) * (os.getuid() == 0))):
        if shutil.which(tool, path=path) is None:
            return f"no {tool}: install Debian's package {package}"
    return None


@pytest.fixture(scope="module")
def console() -> Iterator[str]:
    """Boot, run tests/uml, halt; everything that was printed."""
    if (reason := missing()) is not None:
        pytest.skip(reason)
    with tempfile.TemporaryDirectory(prefix="mgdd-uml-") as folder:
        command, home = Path(folder) / "command.sh", Path(folder) / "home"
        home.mkdir()
        python_path = os.pathsep.join((str(Path(mgdd.__file__).parents[1]), str(UML.parent / "python" / "support")))
        run = [sys.executable, "-m", "pytest", "-v", "-c", "/dev/null", "--rootdir=/run", "-p", "no:cacheprovider"]
        # Its log records would keep sockets that python-can has forgotten.
        run += ["-p", "no:logging", "--import-mode=importlib", "-W", "error", "--color=no", str(UML)]
        command.write_text(
            f"#!/bin/sh\nexport PYTHONPATH={shlex.quote(python_path)} HOME=/run\ncd /run\nexec {shlex.join(run)}\n"
        )
        shutil.copy(UML / "init.sh", folder)
        if os.getuid() == 0:
            os.chown(folder, 65534, 65534)
            os.chown(home, 65534, 65534)
        command.chmod(0o755)
        boot = ["linux.uml", "mem=1G", "root=/dev/root", "rootfstype=hostfs", "rootflags=/", "ro", "quiet"]
        boot += [f"init={folder}/init.sh", f"UML_CMD={command}", "con0=fd:0,fd:1", "con=null"]
        boot = [*(AS_NOBODY if os.getuid() == 0 else []), *boot]
        process = subprocess.Popen(
            boot,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env={"PATH": os.environ["PATH"], "TMPDIR": str(home), "HOME": str(home)},
            cwd="/", start_new_session=True,
        )  # fmt: skip
        try:
            printed, _ = process.communicate(timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # the kernel and every process in it
            printed, _ = process.communicate()
            printed += b"\nUML-FAIL time limit"
        said = printed.decode(errors="replace").replace("\r\n", "\n")
        if "UML-UP" not in said:  # no ptrace, no shared memory to execute from: the machine, not what is tested
            pytest.skip(f"User-Mode Linux does not boot here: {' | '.join(said.strip().splitlines()[-3:])}")
        yield said


def test_the_bus_came_up(console: str) -> None:
    assert "UML-FAIL" not in console, console
    assert "UML-RC=" in console, console


def test_everything_passed_on_the_bus_of_a_kernel(console: str) -> None:
    wanted = [name for file in UML.glob("test_*.py") for name in re.findall(r"^def (test_\w+)", file.read_text(), re.M)]
    ended = dict(re.findall(r"::(test_\w+)\S* (PASSED|FAILED|ERROR|SKIPPED)", console))
    assert wanted, "tests/uml is empty"
    assert ended == dict.fromkeys(wanted, "PASSED"), console
    assert "UML-RC=0" in console, console
