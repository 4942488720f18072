"""The cell-wise optimum of a sweep: closed forms, limits between points, ranges, scatter, empty cells, bad sweeps."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from map_cases import FUEL, SOC, SPEED, bend, centre, efficiency, least_soc, p_max, sweep
from mgdd.engine import Cylinder, OperatingPoint, find_optimum, timing_sweep
from mgdd.errors import ConvergenceError, DataError, Error, ParameterError
from mgdd.maps import apply_map, optimize_map
from mgdd.optimize import Limit
from mgdd.results.labels import check_labels, labelled_dataset

N, M = SPEED[:, None], FUEL[None, :]


def line(soc: Any, **columns: Any) -> xr.Dataset:
    """A sweep over one operating axis of two equal cells."""
    two = {name: (("fuel_mg", "soc_cad"), np.tile(np.asarray(values, float), (2, 1)), "-", name) for name, values in
           columns.items()}  # fmt: skip
    return labelled_dataset(
        {"fuel_mg": ("fuel_mg", [10.0, 20.0], "mg", "fuel"), "soc_cad": ("soc_cad", np.asarray(soc, float)), **two}
    )


def test_a_parabola_is_found_exactly_between_uneven_points() -> None:
    found = optimize_map(sweep(), "efficiency_gross", provenance={"from": "closed form"})
    np.testing.assert_allclose(found.values, centre(N, M), atol=1e-11)
    np.testing.assert_allclose(found.cells["objective"], 0.5, atol=1e-15)
    assert set(found.cells["active_limit"].ravel()) == {""}
    assert set(found.cells["source"].ravel()) == {"optimised"}
    assert set(found.cells["support"].ravel()) == {float(SOC.size)}
    assert found.provenance["from"] == "closed form"
    assert found.name == "soc_cad"
    assert list(found.axes) == ["speed_rpm", "fuel_mg"]
    np.testing.assert_array_equal(found.cells["low"], SOC[0])  # without a loss, all that keeps the limits
    np.testing.assert_array_equal(found.cells["high"], SOC[-1])


def test_the_order_of_the_axes_in_the_sweep_is_that_of_the_map() -> None:
    turned = sweep().transpose("soc_cad", "fuel_mg", "speed_rpm")
    found = optimize_map(turned, "efficiency_gross")
    assert list(found.axes) == ["fuel_mg", "speed_rpm"]
    np.testing.assert_allclose(found.values, centre(N, M).T, atol=1e-11)
    np.testing.assert_allclose(apply_map(found, sweep())["soc_cad"], found.values.T)


def test_a_limit_is_met_at_its_crossing_and_named() -> None:
    upper = 125.0
    found = optimize_map(sweep(), "efficiency_gross", limits=[Limit("p_max_bar", upper + 2.0, margin=2.0)])
    held = least_soc(N, M, upper) > centre(N, M)
    assert 0 < held.sum() < held.size
    np.testing.assert_allclose(found.values, np.maximum(centre(N, M), least_soc(N, M, upper)), atol=1e-11)
    np.testing.assert_array_equal(found.cells["active_limit"] == "p_max_bar", held)
    np.testing.assert_allclose(found.cells["low"], np.maximum(SOC[0], least_soc(N, M, upper)), atol=1e-11)
    np.testing.assert_allclose(found.cells["objective"], efficiency(N, M, found.values), atol=1e-12)
    assert (p_max(N, M, found.values) <= upper + 1e-9).all()
    assert found.task is not None
    assert dict(found.task.limits) == {"p_max_bar": upper}
    assert pickle.loads(pickle.dumps(found)) == found  # task and all


def test_the_lowest_of_a_consumption() -> None:
    data = sweep().assign(bsfc_g_per_kwh=80.0 / sweep()["efficiency_gross"])
    data["bsfc_g_per_kwh"].attrs = {"units": "g/kWh", "long_name": "consumption"}
    fine = optimize_map(data, "bsfc_g_per_kwh", maximize=False, limits={"p_max_bar": 125.0})
    best = optimize_map(data, "efficiency_gross", limits={"p_max_bar": 125.0})
    np.testing.assert_allclose(fine.values, best.values, atol=1e-3)
    np.testing.assert_allclose(fine.cells["objective"], 80.0 / best.cells["objective"], rtol=1e-6)


def test_the_range_of_a_given_loss() -> None:
    found = optimize_map(sweep(np.linspace(-30.0, 12.0, 421)), "efficiency_gross", max_loss=0.002)
    half = np.sqrt(0.002 / bend(N, M))
    np.testing.assert_allclose(found.cells["low"], centre(N, M) - half, atol=2e-3)
    np.testing.assert_allclose(found.cells["high"], centre(N, M) + half, atol=2e-3)
    for end in ("low", "high"):  # never more than allowed: straight lines lie below a concave objective
        loss = 0.5 - efficiency(N, M, found.cells[end])
        assert (loss <= 0.002 + 1e-12).all()


def test_a_range_ends_where_a_limit_is_broken_and_does_not_begin_again() -> None:
    soc = np.arange(-10.0, 11.0)
    bump = np.where((soc > 1.0) & (soc < 5.0), 12.0, 8.0)  # kept again beyond
    data = line(soc, eta=1.0 - 1e-3 * (soc + 2.0) ** 2, noise_db=bump)
    found = optimize_map(data, "eta", limits={"noise_db": 10.0})
    assert found.values.tolist() == [-2.0, -2.0]
    assert found.cells["low"].tolist() == [-10.0, -10.0]
    assert found.cells["high"].tolist() == [1.5, 1.5]
    data = line(soc, eta=1.0 - 1e-3 * (soc - 3.0) ** 2, noise_db=bump)
    found = optimize_map(data, "eta", limits={"noise_db": 10.0})
    assert found.values.tolist() == [4.5, 4.5]  # the crossing behind the bump is better than that before it
    assert found.cells["low"].tolist() == [4.5, 4.5]
    assert set(found.cells["active_limit"]) == {"noise_db"}


def test_a_gap_between_two_points_is_found() -> None:
    """No point keeps both limits; between 2 and 3 there is a stretch that does."""
    soc = np.arange(0.0, 6.0)
    data = line(soc, eta=soc, p=120.0 - 10.0 * soc, t=90.0 + 10.0 * soc)
    found = optimize_map(data, "eta", limits={"p": 96.0, "t": 116.0})
    assert found.values == pytest.approx([2.6, 2.6])
    assert found.cells["low"] == pytest.approx([2.4, 2.4])
    assert set(found.cells["active_limit"]) == {"t"}


def test_an_optimum_at_the_end_of_the_sweep_says_so() -> None:
    soc = np.arange(-4.0, 5.0)
    rising = optimize_map(line(soc, eta=0.4 + 0.01 * soc), "eta")
    assert rising.values.tolist() == [4.0, 4.0]
    assert set(rising.cells["active_limit"]) == {"end_of_sweep"}
    falling = optimize_map(line(soc, eta=0.4 - 0.01 * soc - 1e-4 * soc**2), "eta")
    assert falling.values.tolist() == [-4.0, -4.0]
    assert set(falling.cells["active_limit"]) == {"end_of_sweep"}


def test_points_that_are_not_known_are_left_out() -> None:
    data = sweep()
    data["efficiency_gross"][0, 1, 30:33] = np.nan  # misfires right at the optimum
    data["p_max_bar"][2, 4, :] = np.nan
    found = optimize_map(data, "efficiency_gross", limits={"p_max_bar": 1e3}, infeasible="keep")
    assert found.cells["support"][0, 1] == SOC.size - 3
    assert found.cells["support"][2, 4] == 0.0
    assert found.cells["source"][2, 4] == "infeasible"
    assert np.isnan(found.values[2, 4])
    assert found.cells["source"][0, 1] == "optimised"
    assert np.isfinite(data["efficiency_gross"].interp(soc_cad=found.values[0, 1])[0, 1])
    with pytest.raises(DataError, match="speed_rpm = 3000, fuel_mg = 40: no point of the sweep is known"):
        optimize_map(data, "efficiency_gross", limits={"p_max_bar": 1e3})


def test_the_standard_deviation_is_that_of_repeated_sweeps() -> None:
    """At a vertex and at a crossing, against 3000 sweeps with noise; one line of three points at the vertex."""
    soc = np.array([-8.0, -5.0, -3.0])
    eta = 0.5 - 1e-3 * (soc + 5.2) ** 2
    rng = np.random.default_rng(1)
    noisy = eta + rng.normal(0.0, 3e-5, (3000, 3))
    many = labelled_dataset({
        "fuel_mg": ("fuel_mg", np.arange(3000.0), "mg", "fuel"), "soc_cad": ("soc_cad", soc),
        "eta": (("fuel_mg", "soc_cad"), noisy, "-", "efficiency"),
    })  # fmt: skip
    found = optimize_map(many, "eta", sd={"eta": 3e-5})
    assert np.std(found.values) == pytest.approx(np.median(found.cells["sd"]), rel=0.05)
    pressure = 100.0 - 4.0 * soc + rng.normal(0.0, 0.2, (3000, 3))
    many["p"] = (("fuel_mg", "soc_cad"), pressure, {"units": "bar", "long_name": "pressure"})
    many["p_sd"] = (("fuel_mg", "soc_cad"), 0.2 + 0.0 * pressure, {"units": "bar", "long_name": "scatter"})
    held = optimize_map(many, "eta", limits={"p": 116.6}, sd={"p": "p_sd", "eta": 3e-5})
    assert set(held.cells["active_limit"]) == {"p"}
    assert np.std(held.values) == pytest.approx(np.median(held.cells["sd"]), rel=0.05)
    assert np.isnan(optimize_map(many, "eta").cells["sd"]).all()


def test_what_a_map_achieves() -> None:
    found = optimize_map(sweep(), "efficiency_gross", limits={"p_max_bar": 125.0})
    there = apply_map(found, sweep())
    check_labels(there)
    np.testing.assert_allclose(there["p_max_bar"], p_max(N, M, found.values), atol=1e-9)
    assert float(np.abs(there["loss"]).max()) < 2e-5
    later = apply_map(found.replaced(found.values + 2.0), sweep())
    np.testing.assert_allclose(
        later["loss"], found.cells["objective"] - efficiency(N, M, found.values + 2.0), atol=1e-4
    )
    with pytest.raises(DataError, match="the map leaves the sweep, -24 to 8"):
        apply_map(found.replaced(found.values + 30.0), sweep())
    with pytest.raises(DataError, match="other breakpoints"):
        apply_map(found, sweep().isel(fuel_mg=slice(1, None)))


def test_the_cycle_model_and_its_own_optimum_agree() -> None:
    """Against `find_optimum`, which follows the exact derivative, with a limit that holds in one of two cells."""
    points = [OperatingPoint(fuel_mg=fuel) for fuel in (12.0, 26.0)]
    soc = np.arange(-20.0, 10.1, 0.5)
    runs = [timing_sweep(Cylinder(), point, soc_cad=soc) for point in points]
    fuel = xr.DataArray([12.0, 26.0], dims="fuel_mg", attrs={"units": "mg", "long_name": "fuel"})
    data = xr.concat(runs, "fuel_mg").assign_coords(fuel_mg=fuel)
    limits = {"p_max_bar": 95.0}
    found = optimize_map(data, "efficiency_gross", limits=limits, max_loss=0.002)
    exact = [find_optimum(Cylinder(), point, limits=limits) for point in points]
    np.testing.assert_allclose(found.values, [best["soc_cad"] for best in exact], atol=0.02)
    assert found.cells["active_limit"].tolist() == ["".join(best.active_limits) for best in exact] == ["", "p_max_bar"]
    for end in ("low", "high"):
        ends = [timing_sweep(Cylinder(), p, soc_cad=[s]) for p, s in zip(points, found.cells[end], strict=True)]
        assert all(
            float(run["efficiency_gross"][0]) >= best.value - 0.0021 for run, best in zip(ends, exact, strict=True)
        )
        assert all(float(run["p_max_bar"][0]) <= 95.1 for run in ends)


@settings(max_examples=80, deadline=None)
@given(
    values=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=12),
    limited=st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
    upper=st.floats(-0.9, 1.1),
    loss=st.floats(1e-3, 1.0),
)
def test_no_point_that_keeps_the_limits_is_better(
    values: list[float], limited: list[float], upper: float, loss: float
) -> None:
    eta, other = np.array(values), np.array(limited[: len(values)])
    data = line(np.arange(eta.size), eta=eta, p=other)
    kept = other <= upper
    try:
        found = optimize_map(data, "eta", limits={"p": upper}, max_loss=loss)
    except ConvergenceError:
        assert not kept.any()
        return
    at, low, high = found.values[0], found.cells["low"][0], found.cells["high"][0]
    fine = np.linspace(0.0, eta.size - 1.0, 20 * (eta.size - 1) + 1)
    straight, there = np.interp(fine, np.arange(eta.size), eta), np.interp(fine, np.arange(eta.size), other)
    if kept.any():
        assert found.cells["objective"][0] >= eta[kept].max() - 1e-12
    assert np.interp(at, np.arange(eta.size), other) <= upper + 1e-9
    assert low <= at <= high
    inside = (fine >= low) & (fine <= high)
    assert (there[inside] <= upper + 1e-9).all()
    other_step = (fine < np.floor(at)) | (fine > np.ceil(at))  # in its own step the objective is the parabola
    assert (straight[inside & other_step] >= found.cells["objective"][0] - loss - 1e-9).all()


# --- refusals -----------------------------------------------------------------------------------------------
def test_cells_without_anything_feasible_are_named_or_kept() -> None:
    with pytest.raises(
        ConvergenceError, match=r"3 of 15 cells: speed_rpm = 900, fuel_mg = 40.*nearest at .*limit 110"
    ) as e:
        optimize_map(sweep(), "efficiency_gross", limits={"p_max_bar": 110.0})
    assert "infeasible='keep'" in str(e.value)
    kept = optimize_map(sweep(), "efficiency_gross", limits={"p_max_bar": 110.0}, infeasible="keep")
    assert kept.cells["source"][:, 4].tolist() == ["infeasible"] * 3
    assert np.isnan(kept.values[:, 4]).all()
    assert np.isfinite(kept.values[:, :4]).all()
    for mode in ("raise", "keep"):
        with pytest.raises(
            ConvergenceError, match=r"in any cell; nearest at speed_rpm = 3000, fuel_mg = 6, soc_cad = 8"
        ):
            optimize_map(sweep(), "efficiency_gross", limits={"p_max_bar": 10.0}, infeasible=mode)  # type: ignore[arg-type]


def repeated() -> xr.Dataset:
    return sweep().isel(fuel_mg=[0, 1, 1, 2, 3])


@pytest.mark.parametrize(
    ("data", "options", "error", "said"),
    [
        (sweep, {"objective": "eficiency_gross"}, ParameterError, "did you mean 'efficiency_gross'"),
        (sweep, {"limits": {"p_maks_bar": 1.0}}, ParameterError, "did you mean 'p_max_bar'"),
        (sweep, {"limits": {"efficiency_gross": 1.0}}, ParameterError, "is the objective"),
        (sweep, {"limits": {"p_max_bar": np.nan}}, ParameterError, "finite"),
        (sweep, {"over": "soi_cad"}, DataError, "name the swept input with over"),
        (sweep, {"max_loss": 0.0}, ParameterError, "max_loss = 0: must be > 0"),
        (sweep, {"infeasible": "drop"}, ParameterError, "infeasible = 'drop'"),
        (sweep, {"sd": {"imep": 1.0}}, ParameterError, "sd: 'imep'"),
        (sweep, {"sd": {"efficiency_gross": -1.0}}, ParameterError, "sd = -1: must be"),
        (repeated, {}, DataError, r"fuel_mg\[2\] = 10 after 10: breakpoints must increase"),
        (lambda: sweep().isel(soc_cad=[3, 2, 1]), {}, DataError, r"soc_cad\[1\] = -23 after -22.5"),
        (lambda: sweep().isel(soc_cad=[3, 4]), {}, DataError, "soc_cad has 2 points: an optimum needs 3"),
        (lambda: sweep().isel(fuel_mg=[0]), {}, Error, "fuel_mg has 1 entries"),
        (lambda: sweep().isel(fuel_mg=0, speed_rpm=0), {}, DataError, "one or two operating axes"),
        (lambda: sweep().drop_attrs(), {}, DataError, "has no units"),
    ],
)
def test_a_sweep_that_cannot_be_optimised_is_named(data: Any, options: dict[str, Any], error: Any, said: str) -> None:
    own = {"objective": "efficiency_gross", **options}
    with pytest.raises(error, match=said):
        optimize_map(data(), own.pop("objective"), **own)
