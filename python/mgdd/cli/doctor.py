"""`mgdd doctor`: what is installed and what this machine offers."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import platform

from mgdd import _core, datasets, presets
from mgdd.cli.output import emit


def run(args: argparse.Namespace) -> None:
    """Collect and print."""
    report = {
        "mgdd": _core.__version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "compiler": _core.compiler(),
        "simd_compiled": _core.compiled_simd_level(),
        "simd_processor": ", ".join(_core.processor_simd_levels()),
        "simd_used": _core.instruction_set(),
        "cores": os.cpu_count(),
        "presets": ", ".join(presets.available()),
        "data_sets": ", ".join(datasets.names()),
    }
    required, extras = _requirements()
    report["installed"] = bool(required)
    packages = {name: _version(name) for name in required}
    optional = {extra: {name: _version(name) for name in names} for extra, names in extras.items()}
    rows = [f"{name:16} {value}" for name, value in report.items()]
    rows += [f"{name:16} {version or 'MISSING'}" for name, version in packages.items()]
    for extra, versions in optional.items():
        state = ", ".join(f"{name} {version or 'not installed'}" for name, version in versions.items())
        rows.append(f"extra {extra:10} {state}  (pip install 'mgdd[{extra}]')")
    emit(args, {**report, "packages": packages, "extras": optional}, text="\n".join(rows))


def _requirements() -> tuple[list[str], dict[str, list[str]]]:
    from packaging.requirements import Requirement

    required: list[str] = []
    extras: dict[str, list[str]] = {}
    try:
        metadata = importlib.metadata.metadata("mgdd")
    except importlib.metadata.PackageNotFoundError:
        return required, extras  # run from a source tree that was never installed
    for line in importlib.metadata.requires("mgdd") or []:
        requirement = Requirement(line)
        if requirement.marker is None:
            required.append(requirement.name)
            continue
        if requirement.name == "mgdd":  # the extra that names all others
            continue
        for extra in metadata.get_all("Provides-Extra") or []:
            if requirement.marker.evaluate({"extra": extra}):
                extras.setdefault(extra, []).append(requirement.name)
    return required, extras


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


COMMANDS = {"doctor": (None, run)}
