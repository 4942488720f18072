"""What the figures were taken on: one pinned core, processor, load, versions."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import numpy as np

import mgdd
from mgdd import _core


def processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor()


def pin() -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def load() -> str:
    return f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores" if hasattr(os, "getloadavg") else "unknown"


def versions() -> dict[str, str]:
    """Name to words, for the head of a report."""
    return {
        "processor": processor(),
        "mgdd": f"{mgdd.__version__}, {_core.compiler()}, {_core.compiled_simd_level()}",
        "Python": f"{platform.python_version()}, NumPy {np.__version__}",
        "load at the start": load(),
    }
