"""The cycles of a feed-forward as data: what came from the guide and what from the trim."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TABLES", "history_dataset"]

TABLES = ("guide_optimum", "feed_forward", "trim", "estimate", "applied")  # one number per input
_LABELS = (
    "optimum by the guide",
    "feed-forward in force",
    "trim, estimate less feed-forward",
    "estimate of the optimum",
    "applied input",
)
_COLUMNS = ("cycle", "point", "trust", "testing", *TABLES, "objective", "misfire")


def history_dataset(rows: Sequence[tuple[Any, ...]], inputs: int, seeker: str) -> xr.Dataset:
    """Label the rows of a feed-forward.

    Parameters
    ----------
    rows : sequence of tuple
        Of each told cycle: cycle, point, trust, testing, the tables, objective, misfire.
    inputs : int
        Numbers in each entry of a table.
    seeker : str
        Kind of the seeker.

    Returns
    -------
    xarray.Dataset
        As `mgdd.guide.FeedForward.history`.
    """
    columns: dict[str, Any] = dict.fromkeys(_COLUMNS, ())
    if rows:
        columns = dict(zip(_COLUMNS, zip(*rows, strict=True), strict=True))
    tables = {
        name: (
            ("cycle", "input"),
            np.array(columns[name], np.float64).reshape(-1, inputs),
            "unit of the input",
            label,
        )
        for name, label in zip(TABLES, _LABELS, strict=True)
    }
    return labelled_dataset(
        {
            "cycle": ("cycle", np.array(columns["cycle"], np.int64)),
            "input": ("input", np.arange(inputs), "-", "index of the input"),
            **tables,
            "trust": ("cycle", np.array(columns["trust"], np.float64), "-", "trust in the guide"),
            "testing": ("cycle", np.array(columns["testing"], np.int8), "-", "test of the guide"),
            "point": ("cycle", np.array(columns["point"], np.int64), "-", "operating points so far"),
            "objective": ("cycle", np.array(columns["objective"], np.float64), "unit of J", "objective J"),
            "misfire": ("cycle", np.array(columns["misfire"], np.int8), "-", "misfired cycle"),
        },
        attrs={"seeker": seeker},
    )
