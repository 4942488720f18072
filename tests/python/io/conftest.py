"""Of the tests of files."""

from __future__ import annotations

from pathlib import Path

import pytest

from pressure_files import Write, writer_in


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return what writes columns as text into the folder of the test."""
    return writer_in(tmp_path)
