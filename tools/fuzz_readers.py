#!/usr/bin/env python3
"""Random files of a format, whole and damaged, through the readers: no crash, no hang, no other value.

    python tools/fuzz_readers.py csv --seconds 600 --seed 1

Each case is a file that the library of its format writes (`fuzz_*.py` among the support of the tests). It is read,
whole and in parts, and every value compared with what was written; then damaged copies are read. A whole file must give
its values or an `mgdd.errors.Error`, a damaged one a result or such an error. Anything else is a finding, and its file
is kept below build/fuzz: another value or exception, the end of the process, more than ten seconds or 2 GB, a file that
reading changed. ``--cases 17 18`` runs these again, in this process. Ends with 1 where something was found.
"""

from __future__ import annotations

import argparse
import io
import logging
import multiprocessing
import os
import re
import resource
import struct
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests/python/support"))

from file_mutants import mutant_of_bytes, mutant_of_text  # noqa: E402
from fuzz_binary import BINARY  # noqa: E402
from fuzz_files import TEXT, Case  # noqa: E402
from fuzz_others import OTHERS  # noqa: E402
from mgdd.errors import Error  # noqa: E402

PATIENCE_S, MEMORY_BYTES, MUTANTS, AT_ONCE = 10.0, 2 << 30, 25, 2000
FORMATS = {**TEXT, **BINARY, **OTHERS}
_WORDS = (0, 1, 2, 7, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)


class Step(NamedTuple):
    """What the reading process is about to do, or has done: case, copy (0 is the whole file), what, how it ended."""

    case: int
    copy: int
    what: str
    outcome: str = ""


def damaged(case: Case, rng: np.random.Generator) -> tuple[str, bytes]:
    """Damage a file: as the tests of mgdd do, in large blocks, in its sizes and offsets, or inside of a ZIP member."""
    which = rng.random()
    if case.encoding and which < 0.5:
        kind, raw = mutant_of_text(case.raw.decode(case.encoding), rng)
        return kind, raw if rng.random() < 0.5 else raw.decode(errors="replace").encode(case.encoding, "replace")
    if case.raw.startswith(b"PK") and which < 0.7:
        return _in_member(case.raw, rng)
    return mutant_of_bytes(case.raw, rng) if which < 0.75 else _blocks(case.raw, rng)


def _blocks(raw: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    kinds, data = [], bytearray(raw)
    for _ in range(int(rng.integers(1, 4))):
        size = int(min(2 ** rng.integers(0, 13), len(data)))
        a, b = (int(rng.integers(0, len(data) - size + 1)) for _ in range(2))
        kind = ["zeros", "ones", "doubled", "swapped", "copied", "lost", "word"][int(rng.integers(7))]
        part = bytes(data[a : a + size])
        if kind == "word":  # a size or an offset that cannot be
            form = "<>"[int(rng.integers(2))] + "BHIQ"[int(rng.integers(4))]
            word = int(rng.choice(_WORDS)) if rng.random() < 0.7 else len(data) + int(rng.integers(-9, 9))
            put = struct.pack(form, max(word, 0) & (1 << 8 * struct.calcsize(form)) - 1)
            data[a : a + len(put)] = put
        elif kind == "swapped":
            data[a : a + size], data[b : b + size] = data[b : b + size], data[a : a + size]
        elif kind in ("doubled", "lost"):
            data[a : a + size] = part * 2 if kind == "doubled" else b""
        elif kind == "copied":
            data[b : b + size] = part
        else:
            data[a : a + size] = (b"\0" if kind == "zeros" else b"\xff") * size
        kinds.append(kind)
        if not data:
            break
    return ", ".join(kinds), bytes(data)


def _in_member(raw: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """Damage one member of a ZIP file, with a checksum that fits."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(raw)) as old, zipfile.ZipFile(out, "w") as new:
        chosen = int(rng.integers(len(old.namelist())))
        for at, name in enumerate(old.namelist()):
            content = old.read(name)
            if at == chosen and content:
                inner = Case(content, "", None, None, "utf-8" if content.startswith(b"<") else "")
                kind, content = damaged(inner, rng)
            new.writestr(name, content)
    return f"{kind} in a member", out.getvalue()


def judged(case: Case, path: Path, *, whole: bool) -> str:
    """Read a file; "read", the refusal, or how it failed behind "FOUND"."""
    before = path.read_bytes()
    try:
        (case.check if whole else case.read)(path)
        said = "read"
    except Error as error:
        said = f"refused: {error}"
        if "MemoryError" in said or "Unable to allocate" in said:
            last = traceback.extract_tb((error.__cause__ or error).__traceback__)[-1]
            said = f"memory: at {Path(last.filename).name}:{last.lineno}: {error}"
    except FileNotFoundError as error:
        said = f"refused: {error}"
    except BaseException as error:  # noqa: BLE001
        last = traceback.extract_tb(error.__traceback__)[-1]
        lines = "".join(traceback.format_exception(error)[-6:])
        said = f"FOUND {type(error).__name__} at {Path(last.filename).name}:{last.lineno}: {str(error)[:400]}\n{lines}"
    return said if path.read_bytes() == before else f"FOUND the file was changed; {said}"


def run(form: str, seed: int, number: int, folder: Path, say: Connection | None, most: int = MUTANTS) -> list[Step]:
    """Read one case and its damaged copies."""
    steps = []
    if say is not None:
        say.send(Step(number, 0, "made by its library"))
    rng = np.random.default_rng([seed, number])
    case = FORMATS[form](rng, folder)
    path = folder / case.name
    for copy in range(1 + most):
        kind, raw = ("whole", case.raw) if copy == 0 else damaged(case, np.random.default_rng([seed, number, copy]))
        path.write_bytes(raw)
        step = Step(number, copy, f"{case.name}, {kind}")
        if say is not None:
            say.send(step)
        steps.append(step._replace(outcome=judged(case, path, whole=copy == 0)))
        if steps[-1].outcome.startswith("FOUND"):
            path.with_name(f"found {case.name}").write_bytes(raw)  # the next copy takes the place of this one
        if say is not None:
            say.send(steps[-1])
    return steps


def _child(form: str, seed: int, numbers: Sequence[int], folder: Path, say: Connection) -> None:
    warnings.simplefilter("ignore")
    logging.disable()
    sys.unraisablehook = lambda _: None  # asammdf closes twice what it could not open
    used = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[1]) * 1024  # type: ignore[index]
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for number in numbers:
        run(form, seed, number, folder, say)
    say.close()
    os._exit(0)


def _worked_s(process: int | None) -> float:
    """Return the processor time of a process, which a busy machine does not lengthen."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Fuzz:
    """One format, until the time is up; processes that end are replaced."""

    def __init__(self, form: str, seed: int, folder: Path, kept: Path) -> None:
        self.form, self.seed, self.folder, self.kept = form, seed, folder, kept
        self.count, self.found = Counter[str](), Counter[str]()

    def until(self, end: float) -> None:
        """Run cases."""
        number = 0
        while time.monotonic() < end:
            number = self._batch(number, end) + 1

    def _batch(self, first: int, end: float) -> int:
        ours, theirs = multiprocessing.Pipe(duplex=False)
        context = multiprocessing.get_context("fork")
        numbers = range(first, first + AT_ONCE)
        child = context.Process(target=_child, args=(self.form, self.seed, numbers, self.folder, theirs))
        child.start()
        theirs.close()
        step, since = Step(first, 0, "made"), 0.0
        try:
            while time.monotonic() < end:
                if not ours.poll(1.0):
                    if _worked_s(child.pid) - since > PATIENCE_S:
                        self._keep(step, f"FOUND more than {PATIENCE_S:g} s")
                        break
                    continue
                step = ours.recv()
                if step.outcome:
                    self._keep(step, step.outcome)
                else:
                    since = _worked_s(child.pid)
        except EOFError:
            child.join()
            if child.exitcode:
                self._keep(step, f"FOUND the process ended with {child.exitcode}")
        child.kill()
        child.join()
        return step.case

    def _keep(self, step: Step, outcome: str) -> None:
        kind = "whole" if step.copy == 0 else "damaged"
        word = outcome.split()[0].rstrip(":")
        self.count[f"{kind}, {word}"] += 1
        if word == "refused" and kind == "damaged":
            return
        if word == "FOUND" or (word != "read" and kind == "whole") or word == "memory":
            head = outcome.splitlines()[0]
            key = re.sub(r"/\S*|[-+]?\d[\d.e+-]*|'[^']*'", "*", head)[:150]
            self.found[key] += 1
            if self.found[key] <= 2:
                print(f"case {step.case}, copy {step.copy}, {step.what}: {outcome[:1500]}", flush=True)
                name = step.what.partition(",")[0]
                file = self.folder / f"found {name}"
                file = file if file.exists() else self.folder / name
                if word == "FOUND" and file.exists():
                    (self.kept / f"{self.form}_{self.seed}_{step.case}_{step.copy}_{name}").write_bytes(
                        file.read_bytes()
                    )
                    (self.folder / f"found {name}").unlink(missing_ok=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("format", choices=sorted(FORMATS))
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", type=int, nargs="*", help="run these in this process")
    asked = parser.parse_args()
    kept = ROOT / "build/fuzz"
    kept.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        if asked.cases is not None:
            warnings.simplefilter("ignore")
            steps = [
                step for number in asked.cases for step in run(asked.format, asked.seed, number, Path(folder), None)
            ]
            print(*(" ".join(map(str, step)) for step in steps), sep="\n")
            return int(any(step.outcome.startswith("FOUND") for step in steps))
        fuzz, start = Fuzz(asked.format, asked.seed, Path(folder), kept), time.monotonic()
        fuzz.until(start + asked.seconds)
    for key, count in fuzz.found.most_common():
        print(f"{count:6d} x {key}")
    print(f"{asked.format}, seed {asked.seed}, {time.monotonic() - start:.0f} s: {dict(sorted(fuzz.count.items()))}")
    return int(any(key.startswith("FOUND") for key in fuzz.found))


if __name__ == "__main__":
    sys.exit(main())
