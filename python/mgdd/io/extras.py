"""Optional packages, imported where they are used."""

from __future__ import annotations

import importlib
from typing import Any


def import_extra(module: str, extra: str, purpose: str) -> Any:
    """Import a module that only an extra of mgdd installs; the ImportError says what needs it and how to install it."""
    package = module.partition(".")[0]
    try:
        importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise ImportError(f'{purpose} needs {error.name}: pip install "mgdd[{extra}]"', name=error.name) from error
    return importlib.import_module(module)
