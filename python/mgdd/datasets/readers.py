"""Public data by name: each set as labelled Datasets, and the two measured engine maps."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from mgdd.datasets.files import ENGINE_MAPS, FILES, HD, LICENCES, path
from mgdd.errors import DataError, ParameterError
from mgdd.io import read_pressure
from mgdd.io.point_table import read_conditions
from mgdd.io.table import read_table
from mgdd.results.labels import labelled_dataset
from mgdd.signals.even_grid import check_count

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

_H2DF_SHA256 = "482b1cd0ce7e6389d8872f547d6fb05f7f63df9715eb6de1e76d7c066dada39c"
_CAD = "°CA aTDC"
_SIGN = "given in degrees before TDC (positive = early), sign turned here"
# Column of the file: name here, factor, unit, long name, note on the origin.
_H2DF_COLUMNS: dict[str, tuple[str, float, str, str, str]] = {
    "control_mode": ("control_mode", 1.0, "-", "control mode: 2 = random steps, 1 = stock control", ""),
    "soi_main_degbtdc": ("soi_cad", -1.0, _CAD, "start of injection", f"main injection; {_SIGN}"),
    "soi_pre_degbtdc": ("soi_pilot_cad", -1.0, _CAD, "start of pilot injection", _SIGN),
    "doi_main_ms": ("doi_main_ms", 1.0, "ms", "duration of main injection", ""),
    "doi_pre_ms": ("doi_pilot_ms", 1.0, "ms", "duration of pilot injection", ""),
    "p2m_us": ("p2m_us", 1.0, "µs", "pilot-to-main gap", ""),
    "doi_h2_ms": ("doi_h2_ms", 1.0, "ms", "duration of hydrogen injection", ""),
    "imep_bar": ("imep_bar", 1.0, "bar", "IMEP", "gross or net: not documented"),
    "mprr_new": (
        "mprr",
        1.0,
        "bar/°CA (not documented)",
        "maximum pressure rise rate",
        "unit not documented, most likely bar/deg",
    ),
    "mfb10_deg": ("mfb10_cad", 1.0, _CAD, "MFB10, angle of 10 % burned", ""),
    "mfb50_deg": ("mfb50_cad", 1.0, _CAD, "MFB50, angle of 50 % burned", ""),
    "mfb90_deg": ("mfb90_cad", 1.0, _CAD, "MFB90, angle of 90 % burned", ""),
    "nox_ppm": ("nox_ppm", 1.0, "ppm", "NOx at the sensor", "CAN sensor, delayed and slow; no gas analyser"),
    "soot_mg_m3": ("soot_mg_per_m3", 1.0, "mg/m³", "soot", ""),
    "o2_noxsensor_pct": ("o2_percent", 1.0, "%", "O2 at the NOx sensor", ""),
    "exh_T_cyl1_C": ("exhaust_temperature_k", 1.0, "K", "exhaust temperature of cylinder 1", "given in °C"),
    "rail_bar": ("rail_bar", 1.0, "bar", "rail pressure", ""),
    "speed_rpm": ("speed_rpm", 1.0, "rpm", "engine speed", ""),
    "e_diesel_kJ": ("diesel_energy_kj", 1.0, "kJ", "energy of the diesel injections", ""),
    "e_h2_kJ": ("h2_energy_kj", 1.0, "kJ", "energy of the hydrogen injection", ""),
}
_H2DF_ATTRS = {
    "title": "hydrogen-diesel engine under random steps, test 502",
    "source": "https://github.com/alexwin9478/H2dfDnnTrainExpData, commit f10b298, data/Test_502_NoPress.mat",
    "citation": "A. Winkler, V. Sharma, D. Gordon, A. Norouzi, Zenodo, doi 10.5281/zenodo.16902579",
    "licence": LICENCES["h2df_502"],
    "changes": "21 of 153 fields, units converted, angles turned to °CA aTDC",
    "angle_convention": "°CA aTDC: firing TDC = 0, compression negative; soi_cad = -(degrees before TDC)",
}
_BURN_ANGLES = ("mfb10_cad", "mfb50_cad", "mfb90_cad")


@overload
def read(name: Literal["hd_diesel_128x144"]) -> list[xr.Dataset]: ...
@overload
def read(name: Literal["h2df_502"], *, checked: bool = ..., mask_held: bool = ...) -> xr.Dataset: ...
@overload
def read(name: Literal["advisor_engine_maps"]) -> tuple[xr.Dataset, xr.Dataset]: ...
def read(
    name: str, *, checked: bool = True, mask_held: bool = True
) -> xr.Dataset | list[xr.Dataset] | tuple[xr.Dataset, xr.Dataset]:
    """Read a data set by its name.

    Parameters
    ----------
    name : {"hd_diesel_128x144", "h2df_502", "advisor_engine_maps"}
        The first is in the package; the others belong into ``$MGDD_DATA_DIR/NAME``.
    checked : bool
        Of ``h2df_502``: refuse a file whose SHA-256 is not that of the export described on the page "A measured
        engine"; False reads an export of your own with the same columns.
    mask_held : bool
        Of ``h2df_502``: set the burn angles to NaN in the cycles where the log repeats all three of the cycle before:
        such a repeat is not a measurement.

    Returns
    -------
    list of xarray.Dataset
        ``hd_diesel_128x144``: four measured traces of a heavy-duty diesel (25, 50, 75 and 100 % load, valves closed),
        ``pressure_bar(crank_angle_cad)`` each, in order of load, with the attributes ``file``, ``load_percent`` [%],
        ``speed_rpm`` [rpm], ``trapped_mass_g`` [g/cycle] and ``soi_cad`` [°CA aTDC].
    xarray.Dataset
        ``h2df_502``: 24 998 measured cycles (80 ms each, 1500 rpm) of a 4.5 L engine with diesel pilot and main
        injection and hydrogen in the intake, under random steps of its injection. Over ``cycle``: commands, indicators
        and slow signals, angles in °CA aTDC; ``excited`` marks the cycles under random steps, ``burn_angles_held``
        the repeats.
    tuple of xarray.Dataset
        ``advisor_engine_maps``: the maps of a Volkswagen 1.9 L and a Mercedes 1.7 L diesel at their stock calibration,
        over ``speed_rpm`` and ``torque_nm``: ``bsfc_g_per_kwh`` (not at zero torque), ``nox_g_per_kwh``, flows,
        exhaust and ``attainable``. Above the full-load curve, ``full_load_nm`` as the highest attainable torque of the
        grid, everything is NaN.

    Raises
    ------
    FileNotFoundError
        The set is in none of these places; the message states where its files belong.
    mgdd.errors.ParameterError
        An unknown name, or an option of another set.
    mgdd.errors.DataError
        A changed file, missing columns or samples.

    References
    ----------
    F. Ramognino, LibICE-post, https://github.com/RamogninoF/LibICE-post, MIT licence;
    ``hd_diesel_128x144_SOURCE.txt`` gives commit, files and columns.

    A. Winkler, V. Sharma, D. Gordon, A. Norouzi, H2dfDnnTrainExpData,
    https://github.com/alexwin9478/H2dfDnnTrainExpData, Zenodo doi 10.5281/zenodo.16902579, Apache-2.0 licence.

    Markel et al. (2002), ADVISOR: a systems analysis tool for advanced vehicle modeling.

    Examples
    --------
    >>> from mgdd import datasets
    >>> traces = datasets.read("hd_diesel_128x144")
    >>> [round(float(trace["pressure_bar"].max()), 1) for trace in traces]
    [126.5, 183.5, 230.4, 233.2]
    >>> traces[0].attrs["soi_cad"]
    -5.06
    """
    if name == "h2df_502":
        return _h2df_cycles(checked=checked, mask_held=mask_held)
    if name not in FILES:
        raise ParameterError(f"data set {name!r}: must be one of {', '.join(FILES)}")
    if not (checked and mask_held):
        raise ParameterError("checked, mask_held: only 'h2df_502' has them")
    if name == HD:
        conditions = read_conditions(path(HD, f"{HD}_conditions.csv"))
        file = path(HD, f"{HD}_traces.csv")
        traces = []
        for column, values in conditions.items():
            trace = read_pressure(file, angle_column="crank_angle_cad", pressure_column=column)
            traces.append(trace.assign_attrs(file=column, **values))
        return traces
    one, other = (engine_map(path(name, file)) for file in FILES[name])
    return one, other


def _h2df_cycles(*, checked: bool, mask_held: bool) -> xr.Dataset:
    file = path("h2df_502", *FILES["h2df_502"])
    if checked and (digest := hashlib.sha256(file.read_bytes()).hexdigest()) != _H2DF_SHA256:
        raise DataError(
            f"{file}: SHA-256 is {digest}, known is {_H2DF_SHA256}: the file is another export; pass checked=False "
            "to read it all the same"
        )
    table = read_table(file)
    cycle = table.numbers(table.index("cycle"))
    check_count(cycle, f"{file}: cycle")
    columns = {column: table.numbers(table.index(column)) for column in _H2DF_COLUMNS}
    arrays = {entry[0]: entry[1] * columns[column] for column, entry in _H2DF_COLUMNS.items()}
    arrays["exhaust_temperature_k"] += 273.15
    burn = np.column_stack([arrays[name] for name in _BURN_ANGLES])
    held = np.r_[False, np.all(burn[1:] == burn[:-1], axis=1)]
    for name in _BURN_ANGLES if mask_held else ():
        arrays[name][held] = np.nan
    variables: dict[str, tuple[object, ...]] = {
        "cycle": ("cycle", cycle.astype(np.int64), "-", "engine cycle"),
        "excited": ("cycle", arrays["control_mode"] == 2.0, "-", "cycle under random steps"),
        "burn_angles_held": ("cycle", held, "-", "burn angles repeat the cycle before"),
    }
    for name, _, units, long_name, _ in _H2DF_COLUMNS.values():
        variables[name] = ("cycle", arrays[name], units, long_name)
    records = labelled_dataset(variables, attrs=_H2DF_ATTRS)
    for name, _, _, _, note in _H2DF_COLUMNS.values():
        if note:
            records[name].attrs["note"] = note
    return records


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
