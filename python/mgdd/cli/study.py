"""`mgdd study`, which the package of the studies brings: looked up and loaded when it is used, not before."""

from __future__ import annotations

from importlib import metadata
from typing import Any

_GROUP = "mgdd.studies"
# What pyproject.toml enters, for the tree of developers: links on PYTHONPATH have no metadata in which to look.
_OURS = metadata.EntryPoint("command", "mgdd_studies.command", _GROUP)


def studies() -> Any:
    """Load what the package of the studies offers: ``fill`` and ``run`` of the command, and ``run_study``.

    Raises
    ------
    ImportError
        It is not installed.
    """
    entry = next(iter(metadata.entry_points(group=_GROUP)), _OURS)
    try:
        return entry.load()
    except ModuleNotFoundError as error:
        package = entry.module.partition(".")[0]
        if error.name not in (package, entry.module):
            raise
        raise ImportError(
            f"{package} is not installed, the package of the studies: it comes with mgdd, install that again"
        ) from None


COMMANDS = {"study": (lambda parser: studies().fill(parser), lambda args: studies().run(args))}
