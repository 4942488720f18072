"""Public data by name: first in the folder MGDD_DATA_DIR, then (hash-checked) in the package, then what was fetched."""

from __future__ import annotations

import errno
import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mgdd.datasets.origins import ORIGINS, fetch, fetched, find_fetched
from mgdd.errors import DataError
from mgdd.io import read_conditions, read_pressure
from mgdd.io.table import read_table
from mgdd.results import labelled_dataset
from mgdd.signals.even_grid import check_count

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "available",
    "fetch",
    "load_cascaded_tanks",
    "load_emps",
    "load_h2df_cycles",
    "load_hd_traces",
    "load_wiener_hammerstein",
    "path",
]

_VARIABLE = "MGDD_DATA_DIR"
_PACKAGE = Path(__file__).parents[1] / "data"
_HD = "hd_diesel_128x144"

# SHA-256 of every file that the package carries.
_PACKAGED = {
    _HD: {
        f"{_HD}_traces.csv": "47e92d491a838de2aceeb7b84b62375613c465c5a109fae0122babf65024cadb",
        f"{_HD}_conditions.csv": "599f36c318f968fd3894d1d44f56995ed7cad5e18daf19ef320f92532c5cb9a4",
        f"{_HD}_SOURCE.txt": "23b966d613723032f57cb31ccafbfd6ebe920f3d95709b2e0901209f8c0f4e8a",
        f"{_HD}_LICENSE.txt": "ec423cc5506eea1ffbfc9955c3ec8f86139996963d84ff306a5ee41eda8a4ff1",
    }
}

_H2DF = "h2df_502"
_H2DF_FILE = "h2df_test502_cycles.csv"
_H2DF_SHA256 = "482b1cd0ce7e6389d8872f547d6fb05f7f63df9715eb6de1e76d7c066dada39c"
# The sets that a reader reads, and the files that each needs.
_FILES: dict[str, tuple[str, ...]] = {
    "cascaded_tanks": ("dataBenchmark.csv",),
    "emps": ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"),
    _H2DF: (_H2DF_FILE,),
    _HD: (f"{_HD}_conditions.csv", f"{_HD}_traces.csv"),
    "wh2009": ("WienerHammerBenchmark.csv",),
}
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
    "licence": "Apache-2.0",
    "changes": "21 of 153 fields, units converted, angles turned to °CA aTDC",
    "angle_convention": "°CA aTDC: firing TDC = 0, compression negative; soi_cad = -(degrees before TDC)",
}
_BURN_ANGLES = ("mfb10_cad", "mfb50_cad", "mfb90_cad")


def available() -> tuple[str, ...]:
    """Name the data sets that can be read now.

    Returns
    -------
    tuple of str
        The sets whose files are all in the package or in ``MGDD_DATA_DIR``, and those that were fetched, sorted.

    Examples
    --------
    >>> from mgdd import datasets
    >>> "hd_diesel_128x144" in datasets.available()
    True
    """
    folder = _data_dir()

    def there(name: str, file: str) -> bool:
        return file in _PACKAGED.get(name, {}) or (folder is not None and (folder / name / file).is_file())

    found = {name for name, files in _FILES.items() if all(there(name, file) for file in files)}
    return tuple(sorted({*found, *fetched()}))


def path(name: str, file: str) -> Path:
    """Find a file of a data set: ``$MGDD_DATA_DIR/name/file`` first, then the package, then what `fetch` has kept.

    Parameters
    ----------
    name : str
        The data set, see `available`.
    file : str
        The file in it.

    Returns
    -------
    pathlib.Path
        An existing file; one from the package has passed its SHA-256 check.

    Raises
    ------
    FileNotFoundError
        It is in none of these places; the message names them.
    DataError
        The packaged file differs from what was shipped.

    Examples
    --------
    >>> from mgdd import datasets
    >>> datasets.path("hd_diesel_128x144", "hd_diesel_128x144_traces.csv").suffix
    '.csv'
    """
    folder = _data_dir()
    if folder is not None and (folder / name / file).is_file():
        return folder / name / file
    if (kept := find_fetched(name, file)) is not None:
        return kept
    packaged = _PACKAGE / file
    digest = _PACKAGED.get(name, {}).get(file)
    if digest is None or not packaged.is_file():
        first = f"looked for {folder / name / file}" if folder else f"{_VARIABLE} is not set"
        fetching = f", or fetch it: mgdd.datasets.fetch({name!r})" if name in ORIGINS else ""
        raise FileNotFoundError(
            errno.ENOENT,
            f"no file {file!r} of data set {name!r}: {first}, and the package ({_PACKAGE}) lacks it; "
            f"set {_VARIABLE} to a folder that holds {name}/{file}{fetching}; "
            f"data sets at hand: {', '.join(available())}",
        )
    found = hashlib.sha256(packaged.read_bytes()).hexdigest()
    if found != digest:
        raise DataError(
            f"{packaged}: SHA-256 is {found}, shipped was {digest}: the file was changed; reinstall mgdd, or "
            f"put your own version under {_VARIABLE}/{name}"
        )
    return packaged


def load_hd_traces() -> list[xr.Dataset]:
    """Load the four measured heavy-duty diesel traces (25, 50, 75 and 100 % load, valves closed).

    Returns
    -------
    list of xarray.Dataset
        ``pressure_bar(crank_angle_cad)`` each, in order of load, with the attributes ``file``,
        ``load_percent`` [%], ``speed_rpm`` [rpm], ``trapped_mass_g`` [g/cycle] and ``soi_cad`` [°CA aTDC].

    Raises
    ------
    FileNotFoundError, DataError
        As in `path` and `mgdd.io.read_pressure`.

    References
    ----------
    F. Ramognino, LibICE-post, https://github.com/RamogninoF/LibICE-post, MIT licence;
    ``hd_diesel_128x144_SOURCE.txt`` gives commit, files and columns.

    Examples
    --------
    >>> from mgdd import datasets
    >>> traces = datasets.load_hd_traces()
    >>> [round(float(trace["pressure_bar"].max()), 1) for trace in traces]
    [126.5, 183.5, 230.4, 233.2]
    >>> traces[0].attrs["soi_cad"]
    -5.06
    """
    conditions = read_conditions(path(_HD, f"{_HD}_conditions.csv"))
    file = path(_HD, f"{_HD}_traces.csv")
    traces = []
    for column, values in conditions.items():
        trace = read_pressure(file, angle_column="crank_angle_cad", pressure_column=column)
        traces.append(trace.assign_attrs(file=column, **values))
    return traces


def load_h2df_cycles(*, checked: bool = True, mask_held: bool = True) -> xr.Dataset:
    """Load 24 998 measured cycles of a hydrogen-diesel engine under random steps of its injection.

    One row is one cycle (80 ms at 1500 rpm) of a 4.5 L engine with diesel pilot and main injection and hydrogen
    in the intake. The set is not in the package: put it in ``$MGDD_DATA_DIR/h2df_502``.

    Parameters
    ----------
    checked : bool
        Refuse a file whose SHA-256 is not that of the export described on the page "A measured engine"; False
        reads an export of your own with the same columns.
    mask_held : bool
        Set the burn angles to NaN in the cycles where the log repeats all three of the cycle before: such a
        repeat is not a measurement.

    Returns
    -------
    xarray.Dataset
        Over ``cycle``: commands, indicators and slow signals, angles in °CA aTDC; ``excited`` marks the cycles
        under random steps, ``burn_angles_held`` the repeats. Attributes say source, licence and changes.

    Raises
    ------
    FileNotFoundError
        As in `path`.
    DataError
        Another SHA-256, a missing column, or cycles that do not count up by one.

    References
    ----------
    A. Winkler, V. Sharma, D. Gordon, A. Norouzi, H2dfDnnTrainExpData,
    https://github.com/alexwin9478/H2dfDnnTrainExpData, Zenodo doi 10.5281/zenodo.16902579, Apache-2.0 licence.

    Examples
    --------
    >>> from mgdd import datasets
    >>> if "h2df_502" in datasets.available():
    ...     cycles = datasets.load_h2df_cycles()
    ...     assert cycles.sizes["cycle"] == 24998
    """
    file = path(_H2DF, _H2DF_FILE)
    if checked and (found := hashlib.sha256(file.read_bytes()).hexdigest()) != _H2DF_SHA256:
        raise DataError(
            f"{file}: SHA-256 is {found}, known is {_H2DF_SHA256}: the file is another export; pass checked=False "
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


def load_emps() -> tuple[xr.Dataset, xr.Dataset]:
    """Load the measured electro-mechanical positioning system: a motor-driven slide with friction, at 1 kHz.

    Both records are of the closed loop. The set is not in the package: put its two MAT files into
    ``$MGDD_DATA_DIR/emps``.

    Returns
    -------
    tuple of xarray.Dataset
        Estimation record and record with pulses, over ``time_s``: ``drive_v`` (controller output, pulses included),
        ``position_m``, ``reference_m``, and the scalar ``force_n_per_v`` of the drive.

    Raises
    ------
    FileNotFoundError
        As in `path`.
    DataError
        A file without the fields of the benchmark.

    References
    ----------
    Janot, Gautier and Brunot (2019), Data Set and Reference Models of EMPS.

    Examples
    --------
    >>> from mgdd import datasets
    >>> if "emps" in datasets.available():
    ...     train, test = datasets.load_emps()
    ...     assert train.sizes["time_s"] == 24841
    """
    first, second = (_emps_record(path("emps", file)) for file in _FILES["emps"])
    return first, second


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
            "licence": "Apache-2.0 of the redistributing repository forgi86/sysid-neural-continuous; the terms of "
            "the authors were not seen",
        },
    )


def load_cascaded_tanks() -> tuple[xr.Dataset, xr.Dataset]:
    """Load the measured cascaded tanks: pump voltage and lower level, every 4 s; the level sensor ends at 10 V.

    The set is not in the package: put ``dataBenchmark.csv`` into ``$MGDD_DATA_DIR/cascaded_tanks``.

    Returns
    -------
    tuple of xarray.Dataset
        Estimation and test record over ``time_s``: ``pump_v`` and ``level_v``.

    Raises
    ------
    FileNotFoundError
        As in `path`.
    DataError
        Missing columns.

    References
    ----------
    Schoukens and Noël (2017), Three benchmarks addressing open challenges in nonlinear system identification.

    Examples
    --------
    >>> from mgdd import datasets
    >>> if "cascaded_tanks" in datasets.available():
    ...     train, test = datasets.load_cascaded_tanks()
    ...     assert test.sizes["time_s"] == 1024
    """
    table = read_table(path("cascaded_tanks", *_FILES["cascaded_tanks"]))

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
                "licence": "Apache-2.0 of the redistributing repository forgi86/sysid-neural-continuous; the terms of "
                "the authors were not seen",
            },
        )

    return record("uEst", "yEst", "estimation"), record("uVal", "yVal", "test")


def load_wiener_hammerstein() -> tuple[xr.Dataset, xr.Dataset]:
    """Load the measured Wiener-Hammerstein circuit of the SYSID benchmark: filter, diode, filter, at 51.2 kHz.

    The set is not in the package: put ``WienerHammerBenchmark.csv`` into ``$MGDD_DATA_DIR/wh2009``.

    Returns
    -------
    tuple of xarray.Dataset
        Estimation (100 000 samples) and test record (78 800) of the official split, over ``time_s``: ``input_v`` and
        ``output_v``.

    Raises
    ------
    FileNotFoundError
        As in `path`.
    DataError
        Missing columns or samples.

    References
    ----------
    Schoukens, Suykens and Ljung (2009), Wiener-Hammerstein benchmark.

    Examples
    --------
    >>> from mgdd import datasets
    >>> if "wh2009" in datasets.available():
    ...     train, test = datasets.load_wiener_hammerstein()
    ...     assert test.sizes["time_s"] == 78_800
    """
    file = path("wh2009", *_FILES["wh2009"])
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
                "licence": "MIT of the redistributing repository forgi86/RNN-adaptation; the terms of the authors "
                "were not seen",
            },
        )

    return record(slice(0, 100_000), "estimation"), record(slice(100_000, None), "test")


def _data_dir() -> Path | None:
    value = os.environ.get(_VARIABLE)
    return Path(value) if value else None
