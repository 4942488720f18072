"""The fixtures of all tests, and the mark of those of the studies, which `make test` leaves out."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest

from fixtures import _figures_are_closed, _signals_are_left_as_found, no_thread_is_left, quick_study, root

__all__ = ["_figures_are_closed", "_signals_are_left_as_found", "no_thread_is_left", "quick_study", "root"]


@pytest.fixture
def study_tables(root: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Import the tool that prints the tables of the docs."""
    monkeypatch.syspath_prepend(root / "tools")
    return importlib.import_module("study_tables")


@pytest.hookimpl(tryfirst=True)  # before `-m` chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what stands in this folder."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker("study")
