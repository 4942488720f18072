"""Public data by name: first in the folder MGDD_DATA_DIR, then (hash-checked) in the package."""

from __future__ import annotations

import errno
import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from mgdd.errors import DataError
from mgdd.io import read_conditions, read_pressure

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["available", "load_hd_traces", "path"]

_VARIABLE = "MGDD_DATA_DIR"
_PACKAGE = Path(__file__).parent / "data"
_HD = "hd_diesel_128x144"

# SHA-256 of every file that the package carries.
_PACKAGED = {
    _HD: {
        f"{_HD}_traces.csv": "549fbf964e04f38ebd90bdd6fced50d4e8ba8082dcbddd270a0414b2a04afe5a",
        f"{_HD}_conditions.csv": "b2c35f1c6b1f200f6e7f3985e994451050137ff408f6f77e31b5a7bc1ac48b95",
        f"{_HD}_LICENSE.txt": "ec423cc5506eea1ffbfc9955c3ec8f86139996963d84ff306a5ee41eda8a4ff1",
    }
}


def available() -> tuple[str, ...]:
    """Name the data sets that can be read now.

    Returns
    -------
    tuple of str
        The sets in the package and the folders in ``MGDD_DATA_DIR``, sorted.

    Examples
    --------
    >>> from mgdd import datasets
    >>> "hd_diesel_128x144" in datasets.available()
    True
    """
    folder = _data_dir()
    own = [entry.name for entry in folder.iterdir() if entry.is_dir()] if folder and folder.is_dir() else []
    return tuple(sorted({*_PACKAGED, *own}))


def path(name: str, file: str) -> Path:
    """Find a file of a data set: ``$MGDD_DATA_DIR/name/file`` first, then the package.

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
        It is in neither place; the message names both.
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
    packaged = _PACKAGE / file
    digest = _PACKAGED.get(name, {}).get(file)
    if digest is None or not packaged.is_file():
        first = f"looked for {folder / name / file}" if folder else f"{_VARIABLE} is not set"
        raise FileNotFoundError(
            errno.ENOENT,
            f"no file {file!r} of data set {name!r}: {first}, and the package ({_PACKAGE}) lacks it; "
            f"set {_VARIABLE} to a folder that holds {name}/{file}; "
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
    F. Ramognino, LibICE-post, https://github.com/RamogninoF/LibICE-post, MIT licence; the CSV header gives
    commit and files.

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


def _data_dir() -> Path | None:
    value = os.environ.get(_VARIABLE)
    return Path(value) if value else None
