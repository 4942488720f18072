"""Compilers, CMake and what they make, as programs that must succeed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path


def run(*command: str | Path, code: int = 0) -> str:
    """Run a program, which must end so; gives what it printed, and shows it all when it fails."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == code, f"{command} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}"
    return done.stdout


def tool(name: str) -> str:
    """Find cmake or ninja: beside the interpreter first, as the build requirements put them there."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    found = shutil.which(name, path=path)
    assert found, f"{name} is missing"
    return found


def configure(source: Path, build: Path, **variables: str) -> None:
    defines = [f"-D{name}={value}" for name, value in variables.items()]
    run(tool("cmake"), "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}", "-S", source, "-B", build, *defines)
