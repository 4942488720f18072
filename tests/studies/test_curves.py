"""Curves that studies share: what is drawn, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from mgdd.errors import DataError
from mgdd.results.labels import labelled_dataset
from mgdd_studies.curves import convergence

CYCLE = np.arange(300)


def tracks():
    cases, dims = ["slow", "fast"], ("case", "cycle")
    curves = np.stack([-6.0 - 9.0 * np.exp(-CYCLE / t) for t in (80.0, 20.0)])
    cad = "°CA aTDC"
    return labelled_dataset({
        "cycle": ("cycle", CYCLE), "case": ("case", cases, "-", "case"),
        "estimate_median_cad": (dims, curves, cad, "estimate"), "optimum_cad": ((), -6.0, cad, "optimum"),
        "estimate_low_cad": (dims, curves - 0.5, cad, "low"), "estimate_high_cad": (dims, curves + 0.7, cad, "high"),
    })  # fmt: skip


def test_convergence_bands_and_refusals():
    ax = convergence(tracks())
    np.testing.assert_array_equal(ax.get_lines()[1].get_ydata(), tracks()["estimate_median_cad"][1])
    assert len(ax.collections) == 2
    band = ax.collections[0].get_paths()[0].vertices[:, 1]
    low, high = tracks()["estimate_low_cad"][0], tracks()["estimate_high_cad"][0]
    assert (band.min(), band.max()) == pytest.approx((float(low.min()), float(high.max())))
    assert len(convergence(tracks().drop_vars("estimate_low_cad")).collections) == 0
    with pytest.raises(DataError, match="must be cycle and one more"):
        convergence(tracks().isel(case=0, drop=True))
    many = tracks().isel(case=[0, 1] * 6).assign_coords(case=("case", list("abcdefghijkl"), tracks()["case"].attrs))
    with pytest.raises(DataError, match="case has 12 entries: at most 9"):
        convergence(many)
