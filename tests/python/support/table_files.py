"""Files of columns in every format, each written by its own library."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest


def write_mat5(file: Path, names: dict[str, Any], _: dict[str, str]) -> None:
    from scipy.io import savemat

    savemat(file, names)


def write_mat73(file: Path, names: dict[str, Any], _: dict[str, str]) -> None:
    """Write what MATLAB writes: HDF5 behind 512 bytes of text, columns first."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(file, "w", userblock_size=512) as content:
        for name, values in names.items():
            item = content.create_dataset(
                name, data=np.atleast_2d(values) if np.ndim(values) == 1 else np.transpose(values)
            )
            item.attrs["MATLAB_class"] = np.bytes_("double")
    with file.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(file: Path, names: dict[str, Any], units: dict[str, str]) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(file, "w") as content:
        for name, values in names.items():
            content[name] = values
            content[name].attrs["units"] = units.get(name, "")


def write_netcdf3(file: Path, names: dict[str, Any], units: dict[str, str]) -> None:
    import xarray as xr

    dims = {1: ("row",), 2: ("row", "cycle")}
    data = {name: (dims[np.ndim(values)], values, {"units": units.get(name, "")}) for name, values in names.items()}
    xr.Dataset(data).to_netcdf(file, engine="scipy")


def write_npz(file: Path, names: dict[str, Any], _: dict[str, str]) -> None:
    with file.open("wb") as stream:
        np.savez(stream, **names)


def flat(names: dict[str, Any]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, values in names.items():
        out |= (
            {name: values} if np.ndim(values) == 1 else {f"{name} {k + 1}": column for k, column in enumerate(values.T)}
        )
    return out


def write_tdms(file: Path, names: dict[str, Any], units: dict[str, str]) -> None:
    nptdms = pytest.importorskip("nptdms")
    of = {name: units.get(name.split(" ")[0], "") for name in flat(names)}
    channels = [nptdms.ChannelObject("g", n, v, properties={"unit_string": of[n]}) for n, v in flat(names).items()]
    with nptdms.TdmsWriter(str(file)) as writer:
        writer.write_segment(channels)


def write_parquet(file: Path, names: dict[str, Any], units: dict[str, str]) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    columns = flat(names)
    fields = [
        arrow.field(name, arrow.float64(), metadata={"units": units.get(name.split(" ")[0], "")}) for name in columns
    ]
    parquet.write_table(
        arrow.Table.from_arrays(list(map(arrow.array, columns.values())), schema=arrow.schema(fields)), file
    )


def write_xlsx(file: Path, names: dict[str, Any], units: dict[str, str]) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book, columns = openpyxl.Workbook(), flat(names)
    book.active.append(["Bench 4, Tuesday", 17])  # a cover
    sheet = book.create_sheet("data")
    sheet.append([*columns])
    sheet.append([units.get(name.split(" ")[0], "") for name in columns])
    for row in zip(*columns.values(), strict=True):
        sheet.append(list(map(float, row)))
    book.save(file)


def write_mdf(file: Path, names: dict[str, Any], units: dict[str, str]) -> None:
    asammdf = pytest.importorskip("asammdf")
    columns = flat(names)
    time = columns.pop("time_s", np.arange(len(next(iter(columns.values())))) * 0.01)
    with asammdf.MDF(version="4.10") as content:
        content.append([
            asammdf.Signal(samples=values, timestamps=time, name=name, unit=units.get(name.split(" ")[0], ""))
            for name, values in columns.items()
        ])  # fmt: skip
        content.save(file.with_suffix(".mf4")).rename(file)


WRITERS: dict[str, Callable[[Path, dict[str, Any], dict[str, str]], None]] = {
    "mat5": write_mat5, "mat73": write_mat73, "hdf5": write_hdf5, "netcdf3": write_netcdf3, "npz": write_npz,
    "tdms": write_tdms, "parquet": write_parquet, "xlsx": write_xlsx, "mdf": write_mdf,
}  # fmt: skip
WITHOUT_UNITS = {"mat5", "mat73", "npz"}
