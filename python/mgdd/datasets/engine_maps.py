"""Measured maps of two engines at their stock calibration, as they stand in the vehicle simulator ADVISOR."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.datasets.files import ENGINE_MAPS, LICENCES
from mgdd.errors import DataError
from mgdd.io.table import read_table
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

_AXES = ("speed_rpm", "torque_Nm")
# Column of the file: name here, offset, unit, long name.
_COLUMNS: dict[str, tuple[str, float, str, str]] = {
    "fuel_g_s": ("fuel_g_per_s", 0.0, "g/s", "fuel flow"),
    "nox_g_s": ("nox_g_per_s", 0.0, "g/s", "NOx, engine out"),
    "pm_g_s": ("pm_g_per_s", 0.0, "g/s", "particulate matter, engine out"),
    "hc_g_s": ("hc_g_per_s", 0.0, "g/s", "unburnt hydrocarbons, engine out"),
    "co_g_s": ("co_g_per_s", 0.0, "g/s", "CO, engine out"),
    "exh_temp_C": ("exhaust_temperature_k", 273.15, "K", "exhaust temperature"),
    "exh_flow_g_s": ("exhaust_g_per_s", 0.0, "g/s", "exhaust flow"),
}
_TITLES = {"vw_1.9tdi_ornl_hot.csv": "Volkswagen 1.9 L TDI", "mercedes_1.7_ornl_hot.csv": "Mercedes 1.7 L diesel"}
_ATTRS = {
    "source": "data/fuel_converter of https://github.com/geraldo-reboucas/adv-vehicle-sim, commit b3777b3",
    "citation": "measured at Oak Ridge National Laboratory (S. Sluder), published with ADVISOR",
    "licence": LICENCES[ENGINE_MAPS],
    "changes": "matrices as a table, temperature in K; the rows above full load, which the source pads, are left out",
    "note": "warm engine, steady state, stock calibration: neither timing nor rail pressure nor EGR vary",
}
_G_PER_KWH = 3600.0 * 1000.0  # (g/s) / W


def engine_map(file: Path) -> xr.Dataset:
    """Read one engine; NaN above its full load, and where a share of zero power is asked for."""
    table = read_table(file)
    lacking = [name for name in (*_AXES, *_COLUMNS, "attainable") if name not in (table.header or ())]
    if lacking:
        raise DataError(f"{file}: no column {lacking[0]!r}: this is not an engine map of the set")
    speed, torque = (table.numbers(table.index(name)) for name in _AXES)
    speeds, torques = np.unique(speed), np.unique(torque)
    shape = speeds.size, torques.size
    place = np.ravel_multi_index((np.searchsorted(speeds, speed), np.searchsorted(torques, torque)), shape)
    if place.size != speeds.size * torques.size or np.unique(place).size != place.size:
        raise DataError(
            f"{file}: {place.size} rows: a map of {shape[0]} speeds and {shape[1]} torques has one for each"
        )

    def grid(column: NDArray[Any]) -> NDArray[Any]:
        out = np.empty(shape, column.dtype)
        out.ravel()[place] = column
        return out

    attainable = grid(table.numbers(table.index("attainable")) == 1.0)
    columns = {name: np.where(attainable, grid(table.numbers(table.index(name))), np.nan) for name in _COLUMNS}
    power_w = torques * speeds[:, None] * (np.pi / 30.0)
    with np.errstate(divide="ignore"):
        per_work = np.where(power_w > 0.0, _G_PER_KWH / power_w, np.nan)
    dims = ("speed_rpm", "torque_nm")
    variables: dict[str, tuple[object, ...]] = {
        "speed_rpm": ("speed_rpm", speeds, "rpm", "engine speed"),
        "torque_nm": ("torque_nm", torques, "N m", "torque"),
        "attainable": (dims, attainable, "-", "at or below full load"),
        "full_load_nm": (
            "speed_rpm", np.max(np.where(attainable, torques, -np.inf), axis=1), "N m", "highest attainable torque"
        ),
        "bsfc_g_per_kwh": (dims, columns["fuel_g_s"] * per_work, "g/kWh", "brake specific fuel consumption"),
        "nox_g_per_kwh": (dims, columns["nox_g_s"] * per_work, "g/kWh", "brake specific NOx"),
    }  # fmt: skip
    for column, (name, offset, units, long_name) in _COLUMNS.items():
        variables[name] = (dims, columns[column] + offset, units, long_name)
    return labelled_dataset(variables, attrs={"title": _TITLES.get(file.name, file.stem), "file": file.name, **_ATTRS})
