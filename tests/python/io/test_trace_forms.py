"""A pressure trace may come as a Dataset, a table, a column over crank angle, a pair of arrays or a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from mgdd import datasets, presets
from mgdd.engine import analyze
from mgdd.errors import DataError, ShapeError
from mgdd.identify import fit_cylinder
from mgdd.io import write_csv
from mgdd.io.pressure import as_trace, pressure_trace

CYLINDER = presets.load("hd_diesel_128x144").cylinder
TRACE = datasets.read("hd_diesel_128x144")[0]
ANGLE, BAR = TRACE["crank_angle_cad"].to_numpy(), TRACE["pressure_bar"].to_numpy()
TABLE = pd.DataFrame({"crank_angle_cad": ANGLE, "pressure_bar": BAR})


def written(folder: Path) -> Path:
    write_csv(TRACE, folder / "trace.csv")
    return folder / "trace.csv"


FORMS: dict[str, Callable[[Path], Any]] = {
    "dataset": lambda _: TRACE,
    "dataset over samples": lambda _: xr.Dataset.from_dataframe(TABLE),
    "frame": lambda _: TABLE,
    "frame over angle": lambda _: TABLE.set_index("crank_angle_cad"),
    "frame with more": lambda _: TABLE.assign(note="text")[["note", "pressure_bar", "crank_angle_cad"]],
    "mapping": lambda _: {"pressure_bar": BAR.tolist(), "crank_angle_cad": ANGLE.tolist()},
    "array": lambda _: TRACE["pressure_bar"],
    "array of another name": lambda _: TRACE["pressure_bar"].rename("p_cyl"),
    "column": lambda _: TABLE.set_index("crank_angle_cad")["pressure_bar"],
    "column over unnamed index": lambda _: pd.Series(BAR, index=ANGLE),
    "pair": lambda _: (ANGLE, BAR),
    "list of lists": lambda _: [ANGLE.tolist(), BAR.tolist()],
    "path": written,
    "text": lambda folder: str(written(folder)),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_analysis(form: str, tmp_path: Path) -> None:
    wanted = analyze(TRACE.drop_attrs(), CYLINDER, quiet=True)
    given = FORMS[form](tmp_path)
    if form == "dataset":
        given = given.drop_attrs()
    found = analyze(given, CYLINDER, quiet=True)
    for name in wanted.variables:
        np.testing.assert_array_equal(found[name], wanted[name], err_msg=str(name))


TWO = np.stack([BAR, 1.02 * BAR])
CYCLES = pd.DataFrame(TWO.T, index=pd.Index(ANGLE, name="crank_angle_cad"), columns=["p_1", "p_2"])


def several_written(folder: Path) -> Path:
    write_csv(pressure_trace(ANGLE, TWO), folder / "cycles.csv")
    return folder / "cycles.csv"


SEVERAL: dict[str, Callable[[Path], Any]] = {
    "pair": lambda _: (ANGLE, TWO),
    "list of columns": lambda _: (ANGLE, [BAR.tolist(), (1.02 * BAR).tolist()]),
    "pair with a frame": lambda _: (ANGLE, CYCLES),
    "frame over angle": lambda _: CYCLES,
    "frame": lambda _: CYCLES.reset_index(),
    "frame of numbered columns": lambda _: CYCLES.set_axis([7, 8], axis="columns"),
    "dataset": lambda _: pressure_trace(ANGLE, TWO),
    "dataset, angle first": lambda _: pressure_trace(ANGLE, TWO).transpose(),
    "array": lambda _: pressure_trace(ANGLE, TWO)["pressure_bar"],
    "array, angle first": lambda _: pressure_trace(ANGLE, TWO)["pressure_bar"].transpose(),
    "path": several_written,
}


@pytest.mark.parametrize("form", SEVERAL)
def test_every_form_of_several_cycles(form: str, tmp_path: Path) -> None:
    found = as_trace(SEVERAL[form](tmp_path))
    assert found["pressure_bar"].dims == ("cycle", "crank_angle_cad")
    np.testing.assert_array_equal(found["cycle"], [1, 2])
    np.testing.assert_array_equal(found["crank_angle_cad"], ANGLE)
    np.testing.assert_array_equal(found["pressure_bar"], TWO)


def test_a_calibration_refuses_several_cycles_with_the_remedy() -> None:
    trace = pressure_trace(ANGLE, TWO, name="bench 7")
    with pytest.raises(DataError, match=r"bench 7: 2 cycles.* trace.mean\('cycle', keep_attrs=True.*isel\(cycle=0"):
        fit_cylinder([trace], CYLINDER)
    mean = trace.mean("cycle", keep_attrs=True)
    assert fit_cylinder([mean], CYLINDER, free=["soc_cad", "burn_duration_cad", "fuel_heat_j"]).report.success


def test_attributes_of_a_table_are_used() -> None:
    TABLE.attrs.clear()
    table = TABLE.copy()
    table.attrs.update(speed_rpm=1200.0, trapped_mass_g=TRACE.attrs["trapped_mass_g"], file="bench 7")
    found = analyze(table, CYLINDER, quiet=True)
    assert found.attrs["file"] == "bench 7"
    assert float(found["t_max_k"]) == float(analyze(TRACE, CYLINDER, quiet=True)["t_max_k"])


def test_a_calibration_takes_a_list_of_any_forms() -> None:
    free = ["soc_cad", "burn_duration_cad", "fuel_heat_j"]
    wanted = fit_cylinder([TRACE.drop_attrs()], CYLINDER, free=free)
    found = fit_cylinder([TABLE], CYLINDER, free=free)
    assert found.loads[0].soc_cad == wanted.loads[0].soc_cad
    for one in (TRACE, TABLE, TRACE["pressure_bar"], "trace.csv", Path("trace.csv"), {"pressure_bar": BAR}):
        with pytest.raises(ShapeError, match=r"pass a list of traces, \[trace\] for a single one"):
            fit_cylinder(one, CYLINDER)
    with pytest.raises(DataError, match="no traces"):
        fit_cylinder([], CYLINDER)


@pytest.mark.parametrize(
    ("trace", "said"),
    [
        (BAR, "trace is of type ndarray: give a Dataset, DataFrame or mapping with crank_angle_cad and pressure_bar"),
        (None, "trace is of type NoneType"),
        ([BAR], "trace is of type list"),
        (
            TABLE.rename(columns={"pressure_bar": "p"}),
            "the trace has no pressure_bar, it has crank_angle_cad",
        ),
        (pd.Series(BAR), "the trace has no crank_angle_cad, it has an index that counts samples, pressure_bar"),
        (xr.DataArray(BAR, dims="sample"), "the trace has no crank_angle_cad, it has pressure_bar"),
        (xr.Dataset(), "the trace has no crank_angle_cad, it has nothing"),
        (CYCLES.assign(torque_nm=200.0), "and torque_nm is not a cycle in bar of the cylinder of p_1"),
        (CYCLES.assign(p_2=np.roll(BAR, 90)), "and p_2 is not a cycle in bar"),
        ((ANGLE, 1e5 * BAR), r"this looks like Pa; pass pressure_bar \* 1e-05"),
        ((ANGLE[::-1], BAR), "°bTDC"),
    ],
)
def test_what_is_no_trace_is_refused_with_the_remedy(trace: Any, said: str) -> None:
    with pytest.raises(DataError, match=said):
        analyze(trace, CYLINDER)
    assert analyze(TRACE, CYLINDER, quiet=True).sizes == TRACE.sizes


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.csv"):
        analyze(tmp_path / "nowhere.csv", CYLINDER)
