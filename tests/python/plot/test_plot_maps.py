"""Figures of maps: the Dataset's own numbers, gaps left white, marks of the cells, what is refused."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import Rectangle

from map_cases import FUEL, SPEED, sweep, timing_table
from mgdd.errors import DataError, ParameterError
from mgdd.maps import CalibrationMap, apply_map, compare_maps, optimize_map
from mgdd.plot import map_cells, map_contour, trade_off
from mgdd.results.labels import labelled_dataset


def consumption() -> xr.Dataset:
    torque = np.array([20.0, 60.0, 100.0, 150.0])
    values = 215.0 + 2e-5 * (SPEED[:, None] - 1500.0) ** 2 + 3e-3 * (torque - 90.0) ** 2
    values[2, 3] = np.nan  # above full load
    return labelled_dataset({
        "speed_rpm": ("speed_rpm", SPEED, "rpm", "engine speed"), "torque_nm": ("torque_nm", torque, "N m", "torque"),
        "bsfc_g_per_kwh": (("speed_rpm", "torque_nm"), values, "g/kWh", "fuel consumption"),
        "full_load_nm": ("speed_rpm", [150.0, 150.0, 100.0], "N m", "full load"),
    })  # fmt: skip


def one_line() -> xr.Dataset:
    cells = {"sd": 0.2, "low": np.full(5, -12.0), "high": np.full(5, -1.0)}
    return CalibrationMap({"fuel_mg": FUEL}, -0.2 * FUEL - 1.0, name="soc_cad", cells=cells).to_dataset()


PLOTS: dict[str, Any] = {
    "contour": lambda ax=None: map_contour(consumption(), "bsfc_g_per_kwh", ax=ax),
    "cells": lambda ax=None: map_cells(timing_table().to_dataset(), ax=ax),
    "line": lambda ax=None: map_cells(one_line(), ax=ax),
    "trade-off": lambda ax=None: trade_off(sweep().isel(speed_rpm=1), "p_max_bar", "efficiency_gross", ax=ax),
}


@pytest.mark.parametrize("name", PLOTS)
def test_units_on_every_axis_and_given_axes_are_used(name: str) -> None:
    figure, (left, right) = plt.subplots(1, 2)
    before = plt.get_fignums()
    assert PLOTS[name](ax=right) is right
    assert plt.get_fignums() == before
    assert not left.has_data()
    figure.canvas.draw()
    for text in (right.get_xlabel(), right.get_ylabel()):
        assert text.endswith("]")
    PLOTS[name]().figure.canvas.draw()


def test_contours_leave_the_unattainable_white_and_show_points_and_full_load() -> None:
    ax = map_contour(consumption(), "bsfc_g_per_kwh", levels=[215.0, 220.0, 230.0, 250.0])
    assert ax.figure.axes[-1].get_ylabel() == "fuel consumption [g/kWh]"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("engine speed [rpm]", "torque [N m]")
    points, line = ax.get_lines()
    assert points.get_label() == "11 points"
    assert (3000.0, 150.0) not in set(zip(*points.get_data(), strict=True))
    np.testing.assert_array_equal(line.get_ydata(), [150.0, 150.0, 100.0])
    assert len(map_contour(consumption(), "bsfc_g_per_kwh", full_load=None).get_lines()) == 1


def test_cells_show_value_source_support_and_limit() -> None:
    table = timing_table()
    ax = map_cells(table.to_dataset())
    written = {item.get_position(): item.get_text() for item in ax.texts}
    assert written[(0, 1)].endswith(" l")  # learned
    assert written[(2, 4)].strip() == "×"  # infeasible
    assert written[(1, 2)] == f"{table.values[1, 2]:.3g}".replace("-", "−")
    frames = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    assert [(frame.get_x() + 0.46, frame.get_y() + 0.46) for frame in frames] == [pytest.approx((1.0, 3.0))]
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["900", "1400", "3000"]
    assert [tick.get_text() for tick in ax.get_yticklabels()] == ["6", "10", "14", "25", "40"]
    said = [text.get_text() for text in ax.get_legend().get_texts()]
    assert said == [f"support, at most {table.cells['support'].max():g}", "held by p_max_bar", "infeasible", "learned"]


def test_levels_of_a_figure_that_grows_without_bound_are_those_of_most_values() -> None:
    data = consumption()
    data["bsfc_g_per_kwh"][:, 0] = [400.0, 3000.0, 9000.0]
    low, high = map_contour(data, "bsfc_g_per_kwh").figure.axes[-1].get_ylim()
    assert low < 220.0
    assert 400.0 < high < 5000.0


def test_support_that_is_the_same_everywhere_is_said_once() -> None:
    ax = map_cells(timing_table().replaced(cells={"support": 7.0}).to_dataset())
    assert "support 7 everywhere" in [text.get_text() for text in ax.get_legend().get_texts()]
    assert [item for item in ax.get_lines() if item.get_marker() == "o"] == []
    varied = map_cells(timing_table().to_dataset())
    sizes = {round(item.get_markersize(), 3) for item in varied.get_lines() if item.get_marker() == "o"}
    assert len(sizes) > 5


def test_a_difference_has_zero_in_the_middle_and_frames_beyond_the_tolerance() -> None:
    one = CalibrationMap({"speed_rpm": SPEED, "fuel_mg": FUEL}, -5.0, name="soc_cad")
    two = one.replaced(one.values + np.linspace(-0.1, 0.4, 15).reshape(3, 5))
    found = compare_maps(one, two, tolerance=0.25)
    ax = map_cells(found)
    (image,) = ax.get_images()
    assert image.get_clim() == pytest.approx((-0.4, 0.4))
    assert len(ax.patches) == int(found["n_beyond"]) > 0
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["beyond the tolerance"]


def test_a_trade_off_has_a_line_per_operating_point_and_stars_where_the_map_is() -> None:
    data = sweep().isel(speed_rpm=1, drop=True)
    best = optimize_map(data, "efficiency_gross")
    ax = trade_off(data, "p_max_bar", "efficiency_gross", every=5, marked=apply_map(best, data))
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert len(lines) == FUEL.size + 1
    own = lines["fuel 14 mg"]
    np.testing.assert_array_equal(own.get_xdata(), data["p_max_bar"].sel(fuel_mg=14.0))
    stars = lines["chosen"]
    np.testing.assert_allclose(stars.get_ydata(), best.cells["objective"], atol=5e-5)
    labels = [item.get_text() for item in ax.texts]
    assert labels[0] == f"−{abs(float(data['soc_cad'][0])):g}"


def test_what_cannot_be_drawn_is_named() -> None:
    with pytest.raises(DataError, match="no variable 'bsfc' over two axes: the Dataset has bsfc_g_per_kwh"):
        map_contour(consumption(), "bsfc")
    with pytest.raises(DataError, match="no variable 'full_load_nm' over two axes"):
        map_contour(consumption(), "full_load_nm")
    with pytest.raises(ParameterError, match="every = 0"):
        trade_off(sweep().isel(speed_rpm=1), "p_max_bar", "efficiency_gross", every=0)
    with pytest.raises(DataError, match="must stand over soc_cad and at most one more axis"):
        trade_off(sweep(), "p_max_bar", "efficiency_gross")
