"""Sweeps: the numbers of single cycles in a labelled grid or list, whatever the order, chunks and executor."""

from __future__ import annotations

import itertools
import logging
import math
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import parallel_work as work
from mgdd import _core
from mgdd.engine import Cylinder, NoxProxy, OperatingPoint, simulate, timing_sweep
from mgdd.errors import ParameterError, ShapeError, WorkerLostError
from mgdd.results.labels import check_labels
from mgdd.sweep import sweep
from mgdd.sweep.cases import case_of, input_labels
from mgdd.sweep.cycles import simulate_cases

CYLINDER = Cylinder(burn_shape="wiebe", wall_heat_scale=0.7, bore_mm=83.0)
POINT = OperatingPoint(speed_rpm=1750.0, fuel_mg=17.0)
GRID = {
    "soc_cad": [-11.0, 4.0, -6.5],
    "fuel_mg": [9.0, 21.5],
    "bore_mm": [80.0, 91.0, 85.0, 88.0],
    "burn_duration_cad": [28.0, 41.0],
    "trapped_mass_g": [0.55, 0.9],
}  # asymmetric, unordered, of every kind: timing, point, cylinder, optional inputs


@pytest.fixture(scope="module")
def table() -> xr.Dataset:
    return sweep(CYLINDER, POINT, GRID)


def single(values: dict[str, float], **scheme: Any) -> xr.Dataset:
    cylinder, point, soc = case_of(CYLINDER, POINT, -6.0, values)
    return simulate(cylinder, point, soc_cad=soc, **scheme)


def assert_is_single(row: xr.Dataset, values: dict[str, float], **scheme: Any) -> None:
    cycle = single(values, **scheme)
    for name in row.data_vars:
        if str(name).startswith("nox"):
            proxy = getattr(NoxProxy(), str(name)[4:])
            assert float(row[name]) == pytest.approx(float(proxy(float(cycle["t_max_k"]))), rel=1e-8)
        else:
            np.testing.assert_allclose(row[name], cycle[name], rtol=1e-9, atol=1e-9, err_msg=str(name))


def test_a_grid_holds_single_cycles(table: xr.Dataset) -> None:
    assert dict(table.sizes) == {name: len(values) for name, values in GRID.items()}
    check_labels(table)
    for places in ((0, 0, 0, 0, 0), (2, 1, 3, 1, 0), (1, 0, 2, 0, 1), (1, 1, 1, 1, 1), (2, 0, 0, 1, 1)):
        at = dict(zip(GRID, places, strict=True))
        row = table.isel(at)
        values = {name: float(row[name]) for name in GRID}
        assert values == {name: GRID[name][place] for name, place in at.items()}
        assert_is_single(row, values)


@pytest.mark.parametrize("name", sorted(input_labels()))
def test_every_input_can_be_swept(name: str) -> None:
    default = {**Cylinder(gamma_model="polynomial").to_dict(), **POINT.to_dict(), "soc_cad": -6.0}[name]
    base = {"burn_duration_cad": 30.0, "trapped_mass_g": 0.6, "ivc_temperature_k": 350.0}.get(name, default)
    values = [base, base + (0.01 if base == 0.0 else 0.01 * abs(base))]
    table = sweep(CYLINDER, POINT, {name: values}, step_cad=2.0, integrator="split")
    for place, value in enumerate(values):
        assert_is_single(table.isel({name: place}), {name: value}, step_cad=2.0, integrator="split")
    assert table[name].attrs["long_name"]


def test_cycles_that_share_an_operating_point_are_single_cycles_to_a_millionth() -> None:
    grid = {"soc_cad": np.linspace(-20.0, 8.0, 57), "speed_rpm": [2200.0, 1300.0], "fuel_mg": [9.0, 21.5, 15.0]}
    table = sweep(CYLINDER, POINT, grid)
    assert table["p_max_bar"].dims == tuple(grid)
    plain = {name: timing_sweep(CYLINDER, POINT.replace(speed_rpm=1300.0, fuel_mg=15.0), soc_cad=grid["soc_cad"])[name]
             for name in ("imep_gross_bar", "efficiency_gross", "t_max_k", "heat_loss_fraction")}  # fmt: skip
    for name, values in plain.items():
        found = table[name].sel(speed_rpm=1300.0, fuel_mg=15.0)
        np.testing.assert_allclose(found, values, rtol=1e-6, err_msg=name)
    turned = sweep(CYLINDER, POINT, dict(reversed(grid.items())), workers=5).transpose(*grid)
    assert all(np.array_equal(turned[name], table[name]) for name in table.data_vars)


def test_what_fits_alone_but_not_together_is_refused_with_its_case() -> None:
    grid = {"ivc_cad": [-150.0, -20.0], "soc_cad": [-30.0, -6.0]}
    with pytest.raises(ParameterError, match=r"soc_cad = -30 .*\(at ivc_cad = -20, soc_cad = -30\)"):
        sweep(CYLINDER, POINT, grid)


def test_points_are_rows_of_columns() -> None:
    columns = {"speed_rpm": [1000.0, 2600.0, 1000.0], "soc_cad": [-3.0, -14.0, -3.0], "stroke_mm": [80.0, 90.0, 80.0]}
    table = sweep(CYLINDER, POINT, columns, pointwise=True)
    assert dict(table.sizes) == {"point": 3}
    check_labels(table)
    for place in range(3):
        assert_is_single(table.isel(point=place), {name: values[place] for name, values in columns.items()})
    frame = sweep(CYLINDER, POINT, pd.DataFrame(columns), pointwise=True)
    assert frame.identical(table)
    design = xr.Dataset({name: ("point", values) for name, values in columns.items()}, {"point": [7, 3, 5]})
    designed = sweep(CYLINDER, POINT, design)
    assert designed["point"].values.tolist() == [7, 3, 5]
    assert designed.drop_vars("point").identical(table.drop_vars("point"))


def test_it_agrees_with_the_timing_sweep() -> None:
    timings = [-20.0, -6.0, 5.0]
    plain = timing_sweep(CYLINDER, POINT, soc_cad=timings)
    table = sweep(CYLINDER, POINT, {"soc_cad": timings})
    assert set(plain.variables) == set(table.variables)
    for name in plain.variables:
        np.testing.assert_allclose(table[name], plain[name], rtol=1e-9, atol=1e-9)
        assert table[name].attrs == plain[name].attrs


def test_only_what_is_wanted() -> None:
    nox = NoxProxy(reference_nox_ppm=800.0)
    table = sweep(CYLINDER, POINT, {"soc_cad": [-9.0, 1.0]}, outputs=["nox_arrhenius_ppm", "ca50_cad"], nox=nox)
    assert list(table.data_vars) == ["nox_arrhenius_ppm", "ca50_cad"]
    both = timing_sweep(CYLINDER, POINT, soc_cad=[-9.0, 1.0], nox=nox)
    np.testing.assert_allclose(table["nox_arrhenius_ppm"], both["nox_arrhenius_ppm"], rtol=1e-8)
    assert list(sweep(CYLINDER, POINT, {"soc_cad": [0.0]}, outputs="p_max_bar").data_vars) == ["p_max_bar"]
    motored = sweep(CYLINDER, POINT, {"fuel_mg": [0.0, 20.0]}, outputs="ca50_cad")
    assert np.isnan(motored["ca50_cad"]).values.tolist() == [True, False]
    assert motored.attrs["n_void"] == 0  # no burn angle is not a lost cycle


def test_traces_on_request() -> None:
    grid = {"soc_cad": [-9.0, 1.0], "fuel_mg": [10.0, 25.0, 15.0]}
    table = sweep(CYLINDER, POINT, grid, keep_traces=True, step_cad=2.0)
    check_labels(table)
    assert table["pressure_bar"].dims == ("soc_cad", "fuel_mg", "crank_angle_cad")
    cycle = single({"soc_cad": 1.0, "fuel_mg": 15.0}, step_cad=2.0)
    for name in ("pressure_bar", "temperature_k", "burned_fraction", "heat_loss_j_per_cad", "volume_l"):
        np.testing.assert_array_equal(table[name].sel(soc_cad=1.0, fuel_mg=15.0), cycle[name])
    few = sweep(CYLINDER, POINT, grid, keep_traces="pressure_bar", outputs=(), step_cad=2.0)
    assert list(few.data_vars) == ["pressure_bar"]
    assert few["pressure_bar"].identical(table["pressure_bar"])
    with pytest.raises(ParameterError, match="traces: not over evo_cad"):
        sweep(CYLINDER, POINT, {"evo_cad": [120.0, 130.0]}, keep_traces=True)


# --- executors ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "options",
    [{"workers": 1}, {"workers": 7}, {"executor": work.LateReversed(), "workers": 3}],
    ids=["one", "seven", "late and reversed"],
)
def test_the_executor_does_not_matter(options: dict[str, Any], table: xr.Dataset) -> None:
    assert sweep(CYLINDER, POINT, GRID, **options).identical(table)


def test_processes_give_the_same_bits(table: xr.Dataset) -> None:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert sweep(CYLINDER, POINT, GRID, executor=pool).identical(table)
        with pytest.raises(ParameterError, match=r"bore_mm = -1 mm: must be > 0"):
            sweep(CYLINDER, POINT, {"bore_mm": [80.0, -1.0]}, executor=pool)


@given(cuts=st.sets(st.integers(1, 95), max_size=12))
def test_any_chunks_give_the_same_bits(cuts: set[int]) -> None:
    cases, request, whole = chunked()
    edges = [0, *sorted(cuts), 96]
    parts = [simulate_cases(request, cases.columns(a, b)) for a, b in itertools.pairwise(edges)]
    for name in request.outputs:
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), whole[name])


def chunked(kept: list[Any] = []) -> Any:  # noqa: B006 - the whole is computed once
    from mgdd.sweep.cases import cases_of
    from mgdd.sweep.cycles import NOX, Request

    if not kept:
        cases = cases_of(GRID, pointwise=False)
        request = Request(
            cylinder=CYLINDER, point=POINT, soc_cad=-6.0, names=tuple(GRID),
            outputs=(*_core.engine.indicator_units(), *NOX), traces=(), step_cad=1.0, integrator="trapezoid",
            nox=NoxProxy(),
        )  # fmt: skip
        kept += [cases, pickle.loads(pickle.dumps(request)), simulate_cases(request, cases.columns(0, cases.n))]
        assert cases.n == 96
    return kept


def test_progress_counts_cycles() -> None:
    seen: list[tuple[int, int]] = []
    sweep(CYLINDER, POINT, GRID, progress=lambda *counts: seen.append(counts), workers=1)
    assert seen[-1] == (96, 96)
    assert [done for done, _ in seen] == sorted({done for done, _ in seen})


def test_a_lost_worker_hands_over_what_is_done(table: xr.Dataset) -> None:
    with pytest.raises(WorkerLostError) as lost:
        sweep(CYLINDER, POINT, GRID, executor=work.Dropping("cancelled", after=6), workers=2)
    part = lost.value.partial
    done = part["finished"].values
    assert 0 < done.sum() < 96
    assert part.sizes == table.sizes
    np.testing.assert_array_equal(part["p_max_bar"].values[done], table["p_max_bar"].values[done])
    assert np.isnan(part["p_max_bar"].values[~done]).all()
    check_labels(part)


# --- outside the model's range ---------------------------------------------------------------------------------------
def test_cycles_out_of_range_are_counted_and_named(caplog: pytest.LogCaptureFixture) -> None:
    grid = {"speed_rpm": [1500.0, 100.0, 120.0], "wall_heat_scale": [1.0, 100.0]}
    with caplog.at_level(logging.WARNING):
        table = sweep(CYLINDER, POINT, grid, keep_traces="pressure_bar", step_cad=5.0)
    assert np.isnan(table["pressure_bar"].values).all(axis=-1).tolist() == np.isnan(table["p_max_bar"].values).tolist()
    assert np.isnan(table["p_max_bar"].values).tolist() == [[False, False], [False, True], [False, True]]
    assert all(np.isnan(table[name].values[1:, 1]).all() for name in table.data_vars)
    assert table.attrs["n_void"] == 2
    assert table.attrs["warnings"].startswith(
        "2 of 6 cycles leave the physical range of the pressure and are NaN, the first at speed_rpm = 100, "
        "wall_heat_scale = 100; take a smaller step_cad"
    )
    assert caplog.messages == [table.attrs["warnings"]]
    assert sweep(CYLINDER, POINT, {"speed_rpm": [100.0]}).attrs["warnings"] == ""


@pytest.mark.parametrize(
    ("over", "error", "message"),
    [
        ({}, ParameterError, "a mapping of at least one input"),
        ([1.0, 2.0], ParameterError, "a mapping of at least one input"),
        ({"soc_cad": []}, ParameterError, "soc_cad = .*: must be a sequence of at least one number"),
        ({"soc_cad": -6.0}, ParameterError, "a single value belongs into the cylinder, the point or soc_cad"),
        ({"soc_cad": ["early"]}, ParameterError, "soc_cad = .*: must be a sequence of numbers"),
        ({"soc_cad": [[-6.0, -5.0]]}, ParameterError, "soc_cad = .*: must be a sequence"),
        ({"soc_cad": [-6.0, -5.0, -6.0]}, ParameterError, "soc_cad = -6: must be on the axis once"),
        ({"soc_cad": [-6.0, math.nan]}, ParameterError, r"soc_cad\[1\] = nan: must be finite"),
        ({"soc_cad": [-6.0, 40.0]}, ParameterError, "soc_cad = 40 .*: must be"),
        ({"fuel": [3.0]}, ParameterError, r"over = 'fuel': must be a known input: .*soc_cad, burn_duration_cad,"),
        ({"speed": [3.0]}, ParameterError, "over = 'speed': .*did you mean 'speed_rpm'"),
        ({"burn_shape": [1.0]}, ParameterError, "sweep once per choice .*triangle"),
        ({"compression_ratio": [16.0, 0.5]}, ParameterError, "compression_ratio = 0.5: must be"),
        (xr.Dataset({"soc_cad": ("case", [1.0])}), ShapeError, "must be over 'point' alone"),
        (xr.Dataset({"feasible": ("point", [1.0])}), ParameterError, "over = 'feasible': must be a known input"),
    ],
)
def test_bad_grids(over: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        sweep(CYLINDER, POINT, over, executor=work.NoWork())


def test_bad_points_and_outputs() -> None:
    def refused(over: Any, message: str, error: type[Exception] = ParameterError, **options: Any) -> None:
        with pytest.raises(error, match=message):
            sweep(CYLINDER, POINT, over, executor=work.NoWork(), **options)

    columns = {"soc_cad": [-6.0, -5.0], "fuel_mg": [1.0, 2.0, 3.0]}
    refused(
        columns,
        r"one length, these have \{'soc_cad': 2, 'fuel_mg': 3\}; a grid is",
        ShapeError,
        pointwise=True,
    )
    refused({"soc_cad": [-6.0, -99.0, -7.0]}, "soc_cad = -99", pointwise=True)
    refused(
        {"soc_cad": [0.0]},
        "outputs = 'imep_gros_bar': must be a known name: did you mean 'imep_gross_bar'.*p_max_bar",
        outputs="imep_gros_bar",
    )
    refused({"soc_cad": [0.0]}, "names that differ", outputs=["p_max_bar", "p_max_bar"])
    refused({"soc_cad": [0.0]}, "keep_traces = 'pressure': must be a known name", keep_traces="pressure")
    refused({"soc_cad": [0.0]}, "step_cad", step_cad=0.0)
    refused({"soc_cad": [0.0]}, "integrator", integrator="rk4")


def test_an_absurd_size_is_refused_with_its_bytes() -> None:
    many = np.linspace(10.0, 1000.0, 10_000)
    grid = {"speed_rpm": 1000.0 + many, "fuel_mg": many / 100.0, "intake_pressure_kpa": many}
    with pytest.raises(
        ParameterError, match=r"10000 x 10000 x 10000 cycles of 152 bytes each are 152000000000000 bytes"
    ):
        sweep(CYLINDER, POINT, grid)
    with pytest.raises(ParameterError, match=r"bytes \(.* GiB\), more than the \d+ GiB of this machine"):
        sweep(CYLINDER, POINT, {"soc_cad": np.linspace(-20.0, 10.0, 10**7)}, keep_traces=True)
