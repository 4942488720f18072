"""Public data by name: each set as labelled Datasets, and the two measured engine maps."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from mgdd.datasets import files
from mgdd.datasets.files import ENGINE_MAPS, FILES, HD, LICENCES, names, path
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
def read(name: Literal["hd_diesel_128x144"], *, fetch: bool = ...) -> list[xr.Dataset]: ...
@overload
def read(name: Literal["h2df_502"], *, fetch: bool = ..., checked: bool = ..., mask_held: bool = ...) -> xr.Dataset: ...
@overload
def read(
    name: Literal["advisor_engine_maps", "cascaded_tanks", "emps", "wh2009"], *, fetch: bool = ...
) -> tuple[xr.Dataset, xr.Dataset]: ...
def read(
    name: str, *, fetch: bool = False, checked: bool = True, mask_held: bool = True
) -> xr.Dataset | list[xr.Dataset] | tuple[xr.Dataset, xr.Dataset]:
    """Read a data set by its name.

    Parameters
    ----------
    name : {"hd_diesel_128x144", "h2df_502", "advisor_engine_maps", "emps", "cascaded_tanks", "wh2009"}
        The first is in the package; the others belong into ``$MGDD_DATA_DIR/NAME``, or `fetch` gets the last three.
    fetch : bool
        Download a set that is not at hand from its public address, check it and keep it, in ``MGDD_CACHE_DIR`` if that
        is set, else in the cache folder of the user; it needs the package pooch. Nothing is downloaded without it. The
        attributes of the records name the terms of the data.
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
        Estimation and test record over ``time_s``. ``emps``: a motor-driven slide with friction in closed loop at
        1 kHz, ``drive_v`` (controller output, pulses included), ``position_m``, ``reference_m`` and the scalar
        ``force_n_per_v``. ``cascaded_tanks``: ``pump_v`` and ``level_v`` every 4 s; the level sensor ends at 10 V.
        ``wh2009``: ``input_v`` and ``output_v`` of the Wiener-Hammerstein circuit of the SYSID benchmark at 51.2 kHz,
        100 000 and 78 800 samples.
        ``advisor_engine_maps``: the maps of a Volkswagen 1.9 L and a Mercedes 1.7 L diesel at their stock calibration,
        over ``speed_rpm`` and ``torque_nm``: ``bsfc_g_per_kwh`` (not at zero torque), ``nox_g_per_kwh``, flows,
        exhaust and ``attainable``. Above the full-load curve, ``full_load_nm`` as the highest attainable torque of the
        grid, everything is NaN.

    Raises
    ------
    FileNotFoundError
        The set is in none of these places; the message states where its files belong.
    mgdd.errors.ParameterError
        An unknown name, an option of another set, or a set without a public address to fetch.
    mgdd.errors.DataError
        A changed file, missing columns or samples; a file that cannot be fetched.

    References
    ----------
    F. Ramognino, LibICE-post, https://github.com/RamogninoF/LibICE-post, MIT licence;
    ``hd_diesel_128x144_SOURCE.txt`` gives commit, files and columns.

    A. Winkler, V. Sharma, D. Gordon, A. Norouzi, H2dfDnnTrainExpData,
    https://github.com/alexwin9478/H2dfDnnTrainExpData, Zenodo doi 10.5281/zenodo.16902579, Apache-2.0 licence.

    Markel et al. (2002), ADVISOR: a systems analysis tool for advanced vehicle modeling.

    Janot, Gautier and Brunot (2019), Data Set and Reference Models of EMPS.

    Schoukens and Noël (2017), Three benchmarks addressing open challenges in nonlinear system identification.

    Schoukens, Suykens and Ljung (2009), Wiener-Hammerstein benchmark.

    Examples
    --------
    >>> from mgdd import datasets
    >>> traces = datasets.read("hd_diesel_128x144")
    >>> [round(float(trace["pressure_bar"].max()), 1) for trace in traces]
    [126.5, 183.5, 230.4, 233.2]
    >>> traces[0].attrs["soi_cad"]
    -5.06
    """
    if fetch and name not in names():
        files.fetch(name)
    if name == "h2df_502":
        return _h2df_cycles(checked=checked, mask_held=mask_held)
    if name not in FILES:
        raise ParameterError(f"data set {name!r}: must be one of {', '.join(FILES)}")
    if not (checked and mask_held):
        raise ParameterError("checked, mask_held: only 'h2df_502' has them")
    if name == HD:
        return _hd_traces()
    if name == "emps":
        first, second = (_emps_record(path(name, file)) for file in FILES[name])
        return first, second
    if name == ENGINE_MAPS:
        one, other = (engine_map(path(name, file)) for file in FILES[name])
        return one, other
    return _cascaded_tanks() if name == "cascaded_tanks" else _wiener_hammerstein()


def _hd_traces() -> list[xr.Dataset]:
    conditions = read_conditions(path(HD, f"{HD}_conditions.csv"))
    file = path(HD, f"{HD}_traces.csv")
    traces = []
    for column, values in conditions.items():
        trace = read_pressure(file, angle_column="crank_angle_cad", pressure_column=column)
        traces.append(trace.assign_attrs(file=column, **values))
    return traces


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


def _emps_record(file: Path) -> xr.Dataset:
    from scipy.io import loadmat

    content = loadmat(file)
    missing = [name for name in ("t", "qg", "qm", "vir", "gtau") if name not in content]
    if missing:
        raise DataError(f"{file}: lacks {', '.join(missing)}: this is not a record of the EMPS benchmark")
    n = content["qm"].size
    return labelled_dataset(
        {
            "time_s": ("time_s", np.arange(n) * 1e-3, "s", "time"),  # the stamps differ from this by 20 ns
            "drive_v": ("time_s", content["vir"].ravel(), "V", "controller output"),
            "position_m": ("time_s", content["qm"].ravel(), "m", "measured position"),
            "reference_m": ("time_s", content["qg"].ravel(), "m", "reference position"),
            "force_n_per_v": ((), float(content["gtau"].item()), "N/V", "drive force per volt"),
        },
        attrs={
            "title": "electro-mechanical positioning system (EMPS)",
            "file": file.name,
            "citation": "A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop on "
            "Nonlinear System Identification Benchmarks (workshop of 2019)",
            "licence": LICENCES["emps"],
        },
    )


def _cascaded_tanks() -> tuple[xr.Dataset, xr.Dataset]:
    table = read_table(path("cascaded_tanks", *FILES["cascaded_tanks"]))

    def record(pump: str, level: str, title: str) -> xr.Dataset:
        values = table.numbers(table.index(pump)), table.numbers(table.index(level))
        return labelled_dataset(
            {
                "time_s": ("time_s", np.arange(values[0].size) * 4.0, "s", "time"),
                "pump_v": ("time_s", values[0], "V", "pump voltage"),
                "level_v": ("time_s", values[1], "V", "level of the lower tank"),
            },
            attrs={
                "title": f"cascaded tanks with overflow, {title}",
                "citation": "M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, Cascaded tanks benchmark",
                "licence": LICENCES["cascaded_tanks"],
            },
        )

    return record("uEst", "yEst", "estimation"), record("uVal", "yVal", "test")


def _wiener_hammerstein() -> tuple[xr.Dataset, xr.Dataset]:
    file = path("wh2009", *FILES["wh2009"])
    with file.open(encoding="utf-8") as lines:
        header = lines.readline().strip()
        if not header.replace('"', "").startswith("uBenchMark,yBenchMark"):
            raise DataError(f"{file}: begins with {header[:60]!r}: columns uBenchMark, yBenchMark were expected")
        columns = np.loadtxt(lines, delimiter=",", usecols=(0, 1)).T[:, 5200:184_000]
    if columns[0].size != 178_800:
        raise DataError(f"{file}: holds {columns[0].size + 5200} samples: the official split needs 184000")

    def record(rows: slice, title: str) -> xr.Dataset:
        return labelled_dataset(
            {
                "time_s": ("time_s", np.arange(178_800)[rows] / 51_200.0, "s", "time"),
                "input_v": ("time_s", columns[0][rows], "V", "input of the circuit"),
                "output_v": ("time_s", columns[1][rows], "V", "output of the circuit"),
            },
            attrs={
                "title": f"Wiener-Hammerstein circuit, {title}",
                "citation": "J. Schoukens, J. Suykens, L. Ljung, Wiener-Hammerstein benchmark (2009)",
                "licence": LICENCES["wh2009"],
            },
        )

    return record(slice(0, 100_000), "estimation"), record(slice(100_000, None), "test")


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
