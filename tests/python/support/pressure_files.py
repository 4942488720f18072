"""A measured pressure, five whole cycles made of it, and a writer of columns as text."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mgdd import datasets
from mgdd.results.labels import ANGLE

Write = Callable[..., Path]
_MEASURED = datasets.read("hd_diesel_128x144")[1]
CLOSED, BAR = _MEASURED[ANGLE].to_numpy(), _MEASURED["pressure_bar"].to_numpy()
# The measured closed part of one load, each cycle 1 % higher than the last, gas exchange at 2 bar and, later, 2.2 bar,
# so that neither cycles nor halves of them look alike.
FULL = np.arange(-360.0, 360.0, 0.5)
ONE = np.where(CLOSED[0] > FULL, 2.0, np.where(CLOSED[-1] < FULL, 2.2, np.interp(FULL, CLOSED, BAR)))
CYCLES = ONE * (1.0 + 0.01 * np.arange(5))[:, None]
RUN = np.arange(0.0, 3600.0, 0.5)


def writer_in(folder: Path) -> Write:
    """Return what writes columns as text into a folder."""

    def to_file(columns: Sequence[Any], header: str = "", name: str = "bench.csv") -> Path:
        rows = [",".join(map(repr, row)) for row in np.column_stack(columns).tolist()]
        path = folder / name
        path.write_text("\n".join([header, *rows] if header else rows) + "\n", encoding="utf-8")
        return path

    return to_file
