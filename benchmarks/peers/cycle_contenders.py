"""Who takes part in `sweep_speed.py`: names, calls from cases to figures, and what is not installed."""

from __future__ import annotations

import ctypes
import importlib.metadata
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from peers import numpy_cycle, python_cycle
from peers.cycle_cases import FIGURES, INPUTS, Array, Engine

from mgdd import _core

OURS, SCALAR, LITERAL, NUMBA, JAX = "mgdd, batch", "mgdd, scalar core", "C++ literal", "Numba, cut", "JAX, cut"
LIBRARY = Path(__file__).parents[2] / "build" / "bench" / "bench" / "libliteral_sweep.so"
JAX_BATCHES = (64, 1024, 4096, 65536)
EXACT, INTERPOLATED = 1e-9, 1e-6
Cycles = Callable[[Array], Array]


@dataclass(frozen=True)
class Contender:
    """Cases to figures, as its users have them at hand: `ready` turns cases into a call, `rows` its answer into rows.

    Neither is timed. `most` cases at most, and `tolerance` bounds how far the figures may be from the scalar core.
    """

    ready: Callable[[Array], Callable[[], Any]]
    rows: Callable[[Any], Array] = np.asarray
    most: int = 1 << 30
    tolerance: float = EXACT

    def of(self, cases: Array) -> Array:
        """Return the cases that this contender is given."""
        return cases[: self.most]


def takes_cases(call: Cycles, most: int = 1 << 30) -> Contender:
    """Return a contender whose users have rows of `INPUTS` and want rows of `FIGURES`."""
    return Contender(lambda cases: partial(call, cases), most=most)


def stacked(columns: dict[str, Array]) -> Array:
    return np.column_stack([columns[name] for name in FIGURES])


def batch(*, threads: int, form: str = "automatic", tolerance: float) -> Contender:
    """Return our batch kernel as a user reaches it: only what varies is handed over, columns come back."""

    def ready(cases: Array) -> Callable[[], dict[str, Array]]:
        varied = [i for i in range(len(INPUTS)) if INPUTS[i] == "soc_cad" or np.ptp(cases[:, i])]
        names, values = [INPUTS[i] for i in varied], np.ascontiguousarray(cases[:, varied])
        cylinder, point, soc = _core.engine.Cylinder(), point_of(cases[0]), float(cases[0, 4])
        chosen = (list(FIGURES), 1.0, "trapezoid", threads, form)
        return lambda: _core.engine.batch(cylinder, point, soc, names, values, *chosen)

    return Contender(ready, stacked, tolerance=tolerance)


def scalar(most: int) -> Contender:
    """Return the scalar core, reference of the agreement: timings of one point in one call, other points one by one."""

    def ready(cases: Array) -> Callable[[], list[dict[str, Array]]]:
        cylinder = _core.engine.Cylinder()
        changes = np.flatnonzero(np.any(np.diff(cases[:, :4], axis=0) != 0, axis=1)) + 1
        groups = [(point_of(group[0]), group[:, 4].copy()) for group in np.split(cases, changes)]
        return lambda: [_core.engine.scan(cylinder, point, soc, 1.0, "trapezoid") for point, soc in groups]

    return Contender(ready, lambda answers: np.concatenate([stacked(answer) for answer in answers]), most)


def reference(cases: Array) -> Array:
    """Return the figures of the scalar core."""
    contender = scalar(len(cases))
    return contender.rows(contender.ready(cases)())


def point_of(case: Array) -> _core.engine.OperatingPoint:
    return _core.engine.OperatingPoint(**dict(zip(INPUTS[:4], case[:4].tolist(), strict=True)))


def literal_cycles(library: Path) -> tuple[Cycles, str]:
    """Return the literal cycle in C++, compiled with the benchmarks, and the compiler's version."""
    loaded = ctypes.CDLL(str(library))
    numbers = np.ctypeslib.ndpointer(np.float64, ndim=2, flags="C")
    loaded.mgdd_literal_cycles.argtypes = [numbers, ctypes.c_size_t, numbers]
    loaded.mgdd_literal_cycles.restype = None
    loaded.mgdd_literal_compiler.restype = ctypes.c_char_p

    def run(cases: Array) -> Array:
        out = np.empty((len(cases), len(FIGURES)))
        loaded.mgdd_literal_cycles(np.ascontiguousarray(cases), len(cases), out)
        return out

    return run, loaded.mgdd_literal_compiler().decode()


def halved(call: Cycles, pool: ThreadPoolExecutor) -> Cycles:
    """Return the call on two threads, half of the cases each; it must release the interpreter's lock."""
    return lambda cases: np.concatenate(list(pool.map(call, np.array_split(cases, 2))))


def installed(package: str) -> bool:
    try:
        importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def contenders(e: Engine, *, one_point: bool, n: int, library: Path | None) -> tuple[dict[str, Contender], list[str]]:
    """Return the contenders on one core, and a line for each that is left out.

    `one_point` promises timings of one operating point; Numba and JAX then share its compression as well.
    """
    found, missing = {SCALAR: scalar(4096 if one_point else 512)}, []
    found[OURS] = batch(threads=1, tolerance=INTERPOLATED if one_point else EXACT)
    if one_point:
        found[f"{OURS}, exact lanes"] = batch(threads=1, form="lanes", tolerance=EXACT)
    if library is None:
        missing.append(f"{LITERAL}: build it by cmake --preset bench && cmake --build --preset bench")
    else:
        found[LITERAL] = takes_cases(literal_cycles(library)[0], 16384)
    found["Python, literal"] = takes_cases(partial(python_cycle.python_cycles, e), 64)
    found["NumPy, literal"] = takes_cases(partial(numpy_cycle.numpy_cycles, e, block=1024), 4096)
    if installed("numba"):
        from peers import numba_sweep

        found["Numba, literal"] = takes_cases(numba_sweep.compile_sweep("literal", e), 16384)
        found[NUMBA] = takes_cases(numba_sweep.compile_sweep("cut", e))
        if one_point:
            found[f"{NUMBA}, shared"] = takes_cases(numba_sweep.compile_sweep("shared", e))
    else:
        missing.append("Numba: pip install numba")
    if installed("jax"):
        from peers import jax_cycle

        for size in (size for size in JAX_BATCHES if size <= n):
            sweep = jax_cycle.compile_sweep(e, shared=one_point, batch=size)
            found[f"{JAX}, {size} at once"] = takes_cases(sweep)
    else:
        missing.append("JAX: pip install jax==0.10.2")
    return found, missing


def contenders_on_two(e: Engine, *, one_point: bool, n: int, library: Path | None) -> dict[str, Contender]:
    """Return the faster contenders on two threads, each in the way that its users take."""
    pool = ThreadPoolExecutor(2)
    tolerance = INTERPOLATED if one_point else EXACT
    found = {OURS: batch(threads=2, tolerance=tolerance)}
    if library is not None:
        found[LITERAL] = takes_cases(halved(literal_cycles(library)[0], pool), 16384)
    if installed("numba"):
        from peers import numba_sweep

        found[NUMBA] = takes_cases(numba_sweep.compile_sweep("cut", e, parallel=True))
    if installed("jax"):
        from peers import jax_cycle

        size = min(1024, n // 2)
        found[f"{JAX}, {size} at once"] = takes_cases(
            halved(jax_cycle.compile_sweep(e, shared=one_point, batch=size), pool)
        )
    return found
