"""Smoothing: ranges and slopes hold in every cell, the answer is that of another solver, contradictions are named."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from map_cases import FUEL, SPEED, efficiency, sweep
from mgdd.errors import ConvergenceError, DataError, ParameterError
from mgdd.maps import CalibrationMap, apply_map, optimize_map, read_map, smooth_map, write_map

pytest.importorskip("clarabel", reason="clarabel is not installed: pip install 'mgdd[maps]'")

N, M = SPEED[:, None], FUEL[None, :]
AXES = {"speed_rpm": SPEED, "fuel_mg": FUEL}


def rough(half: float = 2.0) -> CalibrationMap:
    """Nothing is symmetric: uneven axes, uneven ranges, noise of 1 °CA on a slope."""
    rng = np.random.default_rng(5)
    values = -3.0 - 1e-3 * N - 0.15 * M + rng.normal(0.0, 1.0, (3, 5))
    low, high = (values + sign * half * rng.uniform(0.6, 1.5, (3, 5)) for sign in (-1.0, 1.0))
    return CalibrationMap(AXES, values, name="soc_cad", cells={"low": low, "high": high, "source": "optimised"})


def slopes(table: CalibrationMap) -> tuple[np.ndarray, np.ndarray]:
    return tuple(
        np.diff(table.values, axis=axis) / np.diff(entries).reshape([-1 if k == axis else 1 for k in range(2)])
        for axis, entries in enumerate(table.axes.values())
    )


def parts_of(table: CalibrationMap, values: np.ndarray, weight: float) -> float:
    """What smoothing minimises, written down a second time, cell by cell."""
    width = np.maximum(table.cells["high"] - table.values, table.values - table.cells["low"])
    middle = np.median(width)
    width = np.maximum(width, 0.05 * middle)
    total = float(np.sum(((values - table.values) / width) ** 2))
    for axis, entries in enumerate(table.axes.values()):
        mean = (entries[-1] - entries[0]) / (entries.size - 1)
        rows = np.moveaxis(values, axis, 0)
        for k in range(1, entries.size - 1):
            before, after = (entries[k] - entries[k - 1]) / mean, (entries[k + 1] - entries[k]) / mean
            bent = ((rows[k + 1] - rows[k]) / after - (rows[k] - rows[k - 1]) / before) / (0.5 * (before + after))
            total += weight * float(np.sum((bent / middle) ** 2))
    return total


@pytest.mark.parametrize("limits", [{}, {"fuel_mg": 0.1}, {"speed_rpm": 6e-4, "fuel_mg": 0.1}])
def test_it_is_the_answer_of_an_independent_solver(limits: dict[str, float]) -> None:
    from scipy.optimize import LinearConstraint, minimize

    table, weight = rough(), 3.0
    found = smooth_map(table, weight=weight, slope_limits=limits)
    rules, most = [], []
    index = np.arange(15).reshape(3, 5)
    for axis, (name, entries) in enumerate(AXES.items()):
        rows = np.moveaxis(index, axis, 0)
        for k in range(entries.size - 1) if name in limits else ():
            for one, two in zip(rows[k], rows[k + 1], strict=True):
                row = np.zeros(15)
                row[[one, two]] = -1.0, 1.0
                rules.append(row)
                most.append(limits[name] * (entries[k + 1] - entries[k]))
    other = minimize(
        lambda x: parts_of(table, x.reshape(3, 5), weight),
        0.5 * (table.cells["low"] + table.cells["high"]).ravel(),
        method="SLSQP",
        bounds=list(zip(table.cells["low"].ravel(), table.cells["high"].ravel(), strict=True)),
        constraints=[LinearConstraint(np.array(rules), -np.array(most), np.array(most))] if rules else [],
        options={"maxiter": 500, "ftol": 1e-13},
    )
    assert other.success
    assert parts_of(table, found.values, weight) == pytest.approx(other.fun, rel=1e-5)
    np.testing.assert_allclose(found.values, other.x.reshape(3, 5), atol=2e-3)


def test_slopes_and_ranges_hold_in_every_cell_and_what_holds_is_named() -> None:
    table = rough()
    free, held = smooth_map(table), smooth_map(table, slope_limits={"speed_rpm": 6e-4, "fuel_mg": 0.1})
    for found in (free, held):
        assert (found.values >= table.cells["low"]).all()
        assert (found.values <= table.cells["high"]).all()
        assert set(found.cells["source"].ravel()) == {"smoothed"}
    steep = [np.abs(slope).max() for slope in slopes(held)]
    assert steep[0] <= 6e-4 * (1.0 + 1e-9)
    assert steep[1] <= 0.1 * (1.0 + 1e-9)
    assert np.abs(slopes(free)[1]).max() > 0.15
    assert {"slope_speed_rpm", "slope_fuel_mg"} & set(held.cells["active_limit"].ravel())
    at_end = np.isclose(held.values, table.cells["low"], atol=1e-5) | np.isclose(
        held.values, table.cells["high"], atol=1e-5
    )
    assert set(held.cells["active_limit"][at_end].ravel()) <= {"range_low", "range_high"}
    assert "weight 1, slope over speed_rpm at most 0.0006 per unit" in held.provenance["smoothed"]


def test_the_weight_goes_from_the_cells_to_a_plane() -> None:
    table = rough(half=30.0)
    np.testing.assert_allclose(smooth_map(table, weight=0.0).values, table.values, atol=1e-5)
    plane = smooth_map(table, weight=1e6).values
    for axis, entries in ((0, SPEED), (1, FUEL)):
        slope = np.diff(plane, axis=axis) / np.diff(entries).reshape((-1, 1) if axis == 0 else (1, -1))
        np.testing.assert_allclose(np.diff(slope, axis=axis), 0.0, atol=2e-5)


def test_a_map_over_one_axis() -> None:
    values = np.array([-2.0, -6.0, -3.0, -9.0, -8.0])
    line = CalibrationMap({"fuel_mg": FUEL}, values, name="soc_cad", cells={"low": values - 3.0, "high": values + 3.0})
    found = smooth_map(line, slope_limits={"fuel_mg": 0.5})
    assert (np.abs(np.diff(found.values) / np.diff(FUEL)) <= 0.5 + 1e-9).all()
    assert np.abs(found.values - values).max() <= 3.0
    two = CalibrationMap({"fuel_mg": [1.0, 2.0]}, [0.0, 1.0], name="soc_cad", cells={"low": -1.0, "high": 2.0})
    np.testing.assert_allclose(smooth_map(two).values, [0.0, 1.0], atol=1e-6)  # too short to bend


def test_the_smoothed_map_loses_less_than_it_may_everywhere() -> None:
    """0.2 points of the efficiency, with a limit on the pressure and slope limits, against the closed form."""
    best = optimize_map(sweep(), "efficiency_gross", limits={"p_max_bar": 125.0}, max_loss=0.002)
    found = smooth_map(best, weight=5.0, slope_limits={"speed_rpm": 2e-3, "fuel_mg": 0.65})
    loss = best.cells["objective"] - efficiency(N, M, found.values)
    assert loss.max() <= 0.002
    assert loss.max() > 1e-4  # it did something
    assert float(apply_map(found, sweep())["loss"].max()) <= 0.002 + 1e-9
    assert float(apply_map(found, sweep())["p_max_bar"].max()) <= 125.0 + 1e-9
    assert np.abs(slopes(found)[1]).max() <= 0.65 * (1.0 + 1e-9)


def test_cells_without_a_value_stay_empty_or_are_filled() -> None:
    best = optimize_map(sweep(), "efficiency_gross", limits={"p_max_bar": 110.0}, max_loss=0.002, infeasible="keep")
    limits = {"speed_rpm": 2e-3, "fuel_mg": 0.65}
    kept = smooth_map(best, slope_limits=limits)
    with pytest.warns(
        UserWarning, match=r"soc_cad: extrapolated 3 cells: speed_rpm = 900, fuel_mg = 40; .*: check them"
    ):
        filled = smooth_map(best, slope_limits=limits, fill=True)
    assert kept.cells["source"][:, 4].tolist() == ["infeasible"] * 3
    np.testing.assert_array_equal(kept.values[:, :4], filled.values[:, :4])
    assert filled.cells["source"][:, 4].tolist() == ["extrapolated"] * 3  # beyond the last fuel that has a value
    assert "3 cells" in filled.provenance["filled"]
    assert np.isfinite(filled.values).all()
    assert np.abs(slopes(filled)[1]).max() <= 0.65 * (1.0 + 1e-9)
    assert np.abs(slopes(filled)[0]).max() <= 2e-3 * (1.0 + 1e-9)


def test_a_contradiction_names_cells_slope_and_remedy() -> None:
    table = rough(half=0.5)
    with pytest.raises(ConvergenceError) as raised:
        smooth_map(table, slope_limits={"fuel_mg": 0.05})
    said = str(raised.value)
    assert "slope limits (fuel_mg 0.05 per unit) allow" in said
    assert "speed_rpm = " in said
    assert "is needed; raise the slope limits by a factor of" in said
    # What the message asks for is enough, and a little less is not.
    factor = float(said.partition("factor of ")[2].partition(",")[0])
    assert smooth_map(table, slope_limits={"fuel_mg": 0.05 * factor * 1.01}).values.shape == (3, 5)
    with pytest.raises(ConvergenceError):
        smooth_map(table, slope_limits={"fuel_mg": 0.05 * factor * 0.98})


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"weight": -1.0}, "weight = -1"),
        ({"weight": np.nan}, "weight = nan"),
        ({"slope_limits": {"fuel_mgs": 1.0}}, "did you mean 'fuel_mg'"),
        ({"slope_limits": {"fuel_mg": 0.0}}, "slope_limits: fuel_mg = 0: must be > 0"),
    ],
)
def test_options_out_of_their_domain(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        smooth_map(rough(), **options)


def test_a_value_without_a_range_is_refused() -> None:
    with pytest.raises(DataError, match=r"speed_rpm = 900, fuel_mg = 6: .* an optimum with max_loss has one"):
        smooth_map(CalibrationMap(AXES, -5.0, name="soc_cad"))
    with pytest.raises(DataError, match="no cell has a value"):
        smooth_map(CalibrationMap(AXES, np.nan, name="soc_cad", cells={"source": "infeasible"}))


def test_a_missing_solver_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "clarabel", None)
    with pytest.raises(ImportError, match=r'smoothing a map needs clarabel: pip install "mgdd\[maps\]"'):
        smooth_map(rough())


@pytest.mark.filterwarnings("ignore:.*extrapolated")
@settings(max_examples=60, deadline=None)
@given(st.data())
def test_any_map_is_smoothed_within_its_rules_or_they_contradict_each_other(data: st.DataObject) -> None:
    sizes = data.draw(st.sampled_from([(2,), (4,), (2, 3), (4, 3), (3, 5)]))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**31)))
    axes = {name: np.cumsum(rng.uniform(0.1, 100.0, size)) for name, size in zip(("x", "y"), sizes, strict=False)}
    values = rng.normal(0.0, 10.0, sizes)
    low, high = values - rng.uniform(0.0, 5.0, sizes), values + rng.uniform(0.0, 5.0, sizes)
    missing = rng.random(sizes) < data.draw(st.sampled_from([0.0, 0.3]))
    missing.ravel()[0] = False
    gaps = {"source": np.where(missing, "infeasible", "optimised")}
    for column in (values, low, high):
        column[missing] = np.nan
    table = CalibrationMap(axes, values, name="z", cells={"low": low, "high": high, **gaps})
    limits = {"x": data.draw(st.floats(1e-3, 10.0))}
    try:
        found = smooth_map(table, weight=data.draw(st.floats(0.0, 1e3)), slope_limits=limits, fill=True).values
    except ConvergenceError as error:
        assert "slope limits (x" in str(error)  # noqa: PT017
        return
    assert np.isfinite(found).all()
    assert (found[~missing] >= low[~missing]).all()
    assert (found[~missing] <= high[~missing]).all()
    most = limits["x"] * np.diff(axes["x"])
    steps = np.abs(np.diff(found, axis=0)) - most.reshape([-1] + [1] * (found.ndim - 1))
    assert steps.max() <= 1e-8 * max(1.0, most.max())


@pytest.mark.parametrize("shape", [(4, 5), (6,)])
def test_a_map_with_empty_cells_reaches_a_dcm_file_by_the_remedy_of_the_message(shape, tmp_path):
    axes = dict(
        zip(("speed_rpm", "fuel_mg"), (np.linspace(900.0, 2400.0, shape[0]), np.linspace(5.0, 40.0, 5)), strict=True)
    )
    axes = dict(list(axes.items())[: len(shape)])
    grid = np.meshgrid(*axes.values(), indexing="ij")
    values = -2.0 - 3e-3 * (grid[0] - 900.0) - (0.1 * grid[1] if len(shape) > 1 else 0.0)
    gaps = [(1,) * len(shape), (2,) * len(shape)]
    holed = values.copy()
    for gap in gaps:
        holed[gap] = np.nan
    table = CalibrationMap(
        axes, holed, name="soc_cad", cells={"source": np.where(np.isnan(holed), "unattainable", "given")}
    )
    with pytest.raises(DataError, match="fill=True"):
        write_map(table, tmp_path / "map.dcm")
    with pytest.raises(DataError, match=r"range nan to nan.*with fill=True cells that have no range keep their values"):
        smooth_map(table)
    filled = smooth_map(table, fill=True)
    known = np.isfinite(holed)
    np.testing.assert_array_equal(filled.values[known], values[known])
    np.testing.assert_allclose(filled.values[~known], values[~known], atol=1e-3)  # a plane is smooth
    assert set(filled.cells["source"][known]) == {"given"}
    assert set(filled.cells["source"][~known]) == {"interpolated"}
    write_map(filled, tmp_path / "map.dcm")
    np.testing.assert_array_equal(read_map(tmp_path / "map.dcm").values, filled.values)


def test_cells_with_and_without_a_range_are_smoothed_and_kept():
    values, low, high = [-4.0, -9.0, np.nan, -5.0], [-6.0, np.nan, np.nan, -7.0], [-2.0, np.nan, np.nan, -3.0]
    source = ["given", "given", "unattainable", "given"]
    table = CalibrationMap(
        {"fuel_mg": [10.0, 20.0, 30.0, 40.0]},
        values,
        name="soc_cad",
        cells={"low": low, "high": high, "source": source},
    )
    with pytest.raises(DataError, match="at fuel_mg = 20: -9 has the range nan to nan"):
        smooth_map(table)
    filled = smooth_map(table, fill=True, slope_limits={"fuel_mg": 0.4})
    assert filled.values[1] == -9.0
    assert list(filled.cells["source"]) == ["smoothed", "given", "interpolated", "smoothed"]
    assert np.abs(np.diff(filled.values)).max() <= 4.0 * (1.0 + 1e-6)
    assert np.all(filled.values[[0, 3]] >= [-6.0, -7.0])


# --- measured maps ------------------------------------------------------------------------------------------
def measured(values: np.ndarray, axes: dict[str, np.ndarray] = AXES) -> CalibrationMap:
    """A map without ranges, as a bench gives it; NaN where nothing was measured."""
    source = np.where(np.isnan(values), "unattainable", "measured")
    return CalibrationMap(axes, values, name="torque_nm", cells={"source": source})


@st.composite
def planes(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """A plane over the uneven axes, and which of its cells are missing: three on no line are left."""
    slope = draw(st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2))
    plane = 50.0 + slope[0] * 1e-2 * N + slope[1] * M
    missing = np.array(draw(st.lists(st.booleans(), min_size=15, max_size=15))).reshape(3, 5)
    missing[[0, 0, 2], [0, 4, 1]] = False
    return plane, missing


@pytest.mark.filterwarnings("ignore:.*extrapolated")
@settings(max_examples=60, deadline=None)
@given(planes(), st.sampled_from([None, 0.0, 0.5]), st.sampled_from([0.0, 1.0, 50.0]))
def test_filling_a_plane_gives_the_plane(case: Any, tolerance: float | None, weight: float) -> None:
    plane, missing = case
    holed = np.where(missing, np.nan, plane)
    filled = smooth_map(measured(holed), fill=True, tolerance=tolerance, weight=weight)
    np.testing.assert_allclose(filled.values, plane, atol=2e-3 * max(1.0, np.ptp(plane)))
    assert (set(filled.cells["source"][missing].tolist()) | {"interpolated"}) <= {"interpolated", "extrapolated"}


@pytest.mark.filterwarnings("ignore:.*extrapolated")
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.0, 20.0), st.sampled_from([(7,), (3, 5), (2, 4)]))
def test_no_measured_cell_moves_by_more_than_the_tolerance(seed: int, tolerance: float, shape: Any) -> None:
    rng = np.random.default_rng(seed)
    axes = {name: np.cumsum(rng.uniform(0.1, 100.0, size)) for name, size in zip(("x", "y"), shape, strict=False)}
    values = rng.normal(1e3, 10.0, shape)
    values[rng.random(shape) < 0.2] = np.nan
    values.ravel()[0] = 1e3
    table = measured(values, axes)
    found = smooth_map(table, fill=True, tolerance=tolerance, weight=float(rng.uniform(0.0, 100.0)))
    known = np.isfinite(values)
    moves = np.abs(found.values - values)[known]
    assert moves.max() <= tolerance  # to the last bit
    assert np.isfinite(found.values).all()
    assert f"tolerance {tolerance:g} N m, largest move {moves.max():.4g} N m at x = " in found.provenance["smoothed"]


def test_a_tolerance_takes_noise_away_and_stays_inside_of_a_range() -> None:
    plane = 50.0 + 1e-2 * N - 0.4 * M
    rng = np.random.default_rng(3)
    noisy = plane + rng.uniform(-1.0, 1.0, (3, 5))
    found = smooth_map(measured(noisy), tolerance=1.0, weight=1e4)
    assert np.abs(found.values - plane).max() < np.abs(noisy - plane).max()
    assert np.sqrt(np.mean((found.values - plane) ** 2)) < 0.7 * np.sqrt(np.mean((noisy - plane) ** 2))
    table = rough()
    tight = smooth_map(table, tolerance=0.5)
    assert np.abs(tight.values - table.values).max() <= 0.5
    assert (tight.values >= table.cells["low"]).all()
    assert (tight.values <= table.cells["high"]).all()
    same = smooth_map(table, tolerance=1e6)
    np.testing.assert_allclose(same.values, smooth_map(table).values, atol=1e-6)


def test_cells_outside_of_the_hull_are_doubted_aloud() -> None:
    plane = 50.0 + 1e-2 * N - 0.4 * M
    missing = np.zeros((3, 5), dtype=bool)
    missing[1, 2] = missing[0, 4] = missing[0, 3] = True
    with pytest.warns(UserWarning, match=r"torque_nm: extrapolated 2 cells: speed_rpm = 900, fuel_mg = 25; speed_rpm"):
        found = smooth_map(measured(np.where(missing, np.nan, plane)), fill=True, tolerance=0)
    assert found.cells["source"][1, 2] == "interpolated"
    assert found.cells["source"][0, 3:].tolist() == ["extrapolated", "extrapolated"]
    assert (found.cells["source"][~missing] == "measured").all()
    np.testing.assert_array_equal(found.values[~missing], plane[~missing])
    assert found.provenance["filled"].startswith("3 cells: speed_rpm = 900, fuel_mg = 25; ")
    assert found.provenance["extrapolated"].startswith("2 cells: ")


def test_a_single_row_has_its_hull_along_itself() -> None:
    values = np.full((3, 5), np.nan)
    values[1, [0, 3]] = 10.0, 13.0
    with pytest.warns(UserWarning, match="extrapolated 11 cells"):
        found = smooth_map(measured(values), fill=True, tolerance=0)
    assert found.cells["source"][1].tolist() == ["measured", "interpolated", "interpolated", "measured", "extrapolated"]
    slanted = np.full((3, 5), np.nan)
    slanted[0, 0], slanted[2, 4] = 1.0, 2.0
    with pytest.warns(UserWarning, match="extrapolated 13 cells"):
        smooth_map(measured(slanted), fill=True, tolerance=0)


@pytest.mark.parametrize("tolerance", [-1.0, np.nan, np.inf, True])
def test_a_tolerance_out_of_its_domain(tolerance: Any) -> None:
    with pytest.raises(ParameterError, match="tolerance = "):
        smooth_map(measured(50.0 + 0.0 * N * M), tolerance=tolerance)
