"""The process that opens binary files for another one: it forks for each, and what a file does to it ends there."""

from __future__ import annotations

import contextlib
import importlib
import json
import math
import mmap
import os
import warnings
from pathlib import Path
from typing import IO, Any

import numpy as np

from mgdd.errors import DataError

# Imported before the fork, once for all files of a format.
_LIBRARIES = {
    "HDF5": ("h5py",), "MATLAB": ("scipy.io",), "TDMS": ("nptdms",), "MDF": ("asammdf",),
    "Parquet": ("pyarrow.parquet",), "XLSX or NPZ": ("openpyxl",),
}  # fmt: skip


def serve() -> None:
    """Answer requests on the standard input until it ends; libraries that print do so into nothing."""
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    _tell(answers, {})  # it has begun
    state = mmap.mmap(-1, 2)  # shared with what is forked: within an answer, behind its first file
    while line := asked.readline():
        request = json.loads(line)
        if request["do"] == "close":  # of what has ended already
            _tell(answers, {})
            continue
        _import_library(request)
        if not hasattr(os, "fork"):
            _serve_file(request, asked, answers, state)
            _tell(answers, {})
            continue
        state[0] = state[1] = 0
        pid = os.fork()
        if pid == 0:
            status = 1
            try:
                _serve_files(request, asked, answers, state)
                status = 0
            finally:
                os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        if status and state[0]:
            os._exit(1)  # with the pipes; nobody can tell where a next answer begins
        if status:
            _tell(answers, {"ended": status, "again": bool(state[1])})


def _import_library(request: dict[str, Any]) -> None:
    for module in _LIBRARIES.get(request["format"], ()):
        with contextlib.suppress(ImportError):  # the reader says what is missing
            importlib.import_module(module)


def _serve_files(request: dict[str, Any], asked: IO[bytes], answers: IO[bytes], state: mmap.mmap) -> None:
    """Serve one file after the other, until one is refused: what that has left behind ends with the process."""
    while True:
        _import_library(request)
        _limit(request["memory"], request["seconds"])
        sound = _serve_file(request, asked, answers, state)
        _tell(answers, {})
        line = asked.readline() if sound else b""
        if not line:
            return
        request = json.loads(line)
        state[1] = 1


def _limit(memory: int, seconds: float) -> None:
    """Bound this process: address space beyond what it has by now, where the system counts it, and computing."""
    import resource

    def lower(kind: int, most: int) -> None:
        hard = resource.getrlimit(kind)[1]
        with contextlib.suppress(OSError, ValueError):  # a system that knows it and does not take it
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

    lower(resource.RLIMIT_CORE, 0)
    used = resource.getrusage(resource.RUSAGE_SELF)
    lower(resource.RLIMIT_CPU, math.ceil(used.ru_utime + used.ru_stime + seconds))
    with contextlib.suppress(OSError):  # only Linux says what it holds
        held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        lower(resource.RLIMIT_AS, held + memory)


def _serve_file(request: dict[str, Any], asked: IO[bytes], answers: IO[bytes], state: mmap.mmap) -> bool:
    """Answer what is asked of one file until it is closed, and say whether nothing of it was refused."""
    sound = True
    with contextlib.ExitStack() as stack:
        arrays: list[Any] = []
        while request["do"] != "close":
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always", UserWarning)
                said, body = answer(request, stack, arrays)
            notes = [str(each.message) for each in told if each.category is UserWarning]
            sound = sound and "error" not in said
            state[0] = 1
            _tell(answers, said | {"warnings": notes}, body)
            state[0] = 0
            request = json.loads(asked.readline() or b'{"do": "close"}')
    return sound


def _tell(answers: IO[bytes], said: dict[str, Any], body: bytes | memoryview = b"") -> None:
    answers.write(json.dumps(said | {"bytes": len(body)}).encode() + b"\n")
    answers.write(body)
    answers.flush()


def answer(
    request: dict[str, Any], stack: contextlib.ExitStack, arrays: list[Any]
) -> tuple[dict[str, Any], bytes | memoryview]:
    """Do what is asked, or say what is wrong; `arrays` are those of the open file."""
    from mgdd.io.any_table import read_format

    try:
        if request["do"] == "read":
            index = tuple(slice(*each) if isinstance(each, list) else each for each in request["index"])
            found = np.ascontiguousarray(arrays[request["array"]][index])
            return {"shape": found.shape, "type": found.dtype.str}, found.reshape(-1).view(np.uint8).data
        os.chdir(request["folder"])
        read = read_format(request["format"], Path(request["file"]), stack, **request["how"])
        if isinstance(read, tuple):
            source, text = read
            return {"source": source}, text.encode("utf-8", "surrogatepass")
        places: dict[int, int] = {}
        for _, _, column in read:
            if id(column.values) not in places:
                places[id(column.values)] = len(arrays)
                arrays.append(column.values)
        columns = [
            (name, unit, places[id(each.values)], each.along, each.across, each.number) for name, unit, each in read
        ]
        return {"columns": columns, "arrays": [(each.shape, np.dtype(each.dtype).str) for each in arrays]}, b""
    except MemoryError:
        return {"error": "memory"}, b""
    except ImportError as error:
        return {"error": "import", "text": str(error), "name": error.name}, b""
    except DataError as error:
        return {"error": "data", "text": str(error)}, b""
    except Exception as error:  # noqa: BLE001 - of another library: any class
        return {"error": "other", "text": f"{type(error).__name__} {error}".strip()}, b""
