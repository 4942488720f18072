"""Random binary files of columns, each by the library of its format: MATLAB, HDF5, netCDF, NumPy, TDMS and others."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fuzz_files import Case, Column, Content, Random, bench, case_of, chance, in_a_folder, pick, table
from table_files import write_mat73

__all__ = ["BINARY"]

FLOATS, WHOLE = ("f8", "f8", ">f8", "f4"), ("i2", "i4", "u1", "u2", ">i2", "i8")
Arrays = dict[str, Any]


def content_of(
    rng: Random,
    kinds: tuple[str, ...] = (*FLOATS, *WHOLE),
    *,
    units: bool = True,
    matrix: bool = True,
    slow: bool = True,
) -> Content:
    """Draw a record of pressure, perhaps with columns of another raster, or a table of any numbers."""
    kind = pick(rng, [each for each in kinds if each in FLOATS])
    if chance(rng, 0.5):
        made = bench(rng, written=lambda values: np.asarray(values).astype(kind), matrix=matrix)
    else:
        made = table(rng, kinds)
    rows = int(rng.integers(6, 40))
    if slow and chance(rng, 0.4) and all(len(each.values) != rows for each in made.columns):
        rise = np.cumsum(rng.uniform(0.1, 0.2, rows))
        made.columns += [Column("time", rise, "s"), Column("slow", rng.normal(80.0, 1.0, rows), "°C")]
    made.has_units = units
    return made


def arrays(content: Content) -> Arrays:
    return {each.name: each.values for each in content.columns}


def plain_names(content: Content) -> None:
    """Give names that MATLAB takes."""
    known = ("angle", "pressure", "time", "slow")
    names = [each.name for each in content.columns]
    content.rename(lambda name: name if name.split()[0] in known else f"v{chr(97 + names.index(name))}")


def mat5(rng: Random, path: Path) -> Case:
    from scipy.io import savemat

    content = content_of(rng, units=False)
    plain_names(content)
    held, old = arrays(content), chance(rng, 0.15)
    beside: Arrays = {
        "note": "warm", "empty": np.zeros((0, 0)), "cell": np.array([1.0, "b", np.arange(3)], dtype=object),
        "one": 1500.0, "z": np.arange(3) * 1j, "text": np.array(["ab", "cd"]),
    }  # fmt: skip
    if old:
        content.columns = [each._replace(values=np.asarray(each.values, np.float64)) for each in content.columns]
        held = arrays(content)
        content.beside["raw"] = np.asarray(content.beside.get("raw", 0.0), np.float64)
    else:
        held |= {name: value for name, value in beside.items() if chance(rng, 0.2)}
    if chance(rng, 0.3) and not old:
        held = {"rec": held}
        content.rename("rec.{}".format)
    packed = chance(rng, 0.4) and not old
    savemat(path, held, do_compression=packed, oned_as=pick(rng, ["row", "column"]), format="4" if old else "5")
    return case_of(content, path.read_bytes(), "a.mat" if old else pick(rng, ["a.mat", "a"]))


def mat73(rng: Random, path: Path) -> Case:
    content = content_of(rng, ("f8",), units=False)
    plain_names(content)
    write_mat73(path, arrays(content), {})
    return case_of(content, path.read_bytes(), pick(rng, ["a.mat", "a"]))


def hdf5(rng: Random, path: Path) -> Case:
    import h5py

    content = content_of(rng)
    content.rename(lambda name: name.replace("/", "_"))
    group = pick(rng, ["", "", "run", "run/1"])
    with h5py.File(path, "w", libver=pick(rng, ["earliest", "latest"])) as file:
        for each in content.columns:
            packed = {"compression": "gzip", "shuffle": True} if chance(rng, 0.3) else {}
            more = {"fletcher32": True} if chance(rng, 0.1) else {}
            item = file.create_dataset(f"{group}/{each.name}", data=each.values, **packed, **more)
            unit: Any = pick(rng, [each.unit, each.unit.encode()])
            item.attrs[pick(rng, ["units", "unit"])] = unit
        if chance(rng, 0.3):
            file["note"], file["one"], file["texts"] = "warm", 3.5, np.array([b"a", b"bc"])
    if group:
        content.rename(f"{group.replace('/', '.')}.{{}}".format)
    return case_of(content, path.read_bytes(), pick(rng, ["a.h5", "a"]))


def netcdf3(rng: Random, path: Path) -> Case:
    from scipy.io import netcdf_file

    content = content_of(rng, ("f8", "f4", "i2", "i4", ">f8", ">i2"))
    content.rename(lambda name: name.replace("/", "_"))
    with netcdf_file(path, "w", version=pick(rng, [1, 2])) as file:
        size = len(content.columns[0].values)
        file.createDimension("row", size)
        for at, each in enumerate(content.columns):
            dims = ["row" if len(each.values) == size else f"other_{len(each.values)}"]
            if dims[0] not in file.dimensions:
                file.createDimension(dims[0], len(each.values))
            if np.ndim(each.values) == 2:
                file.createDimension("cycle", each.values.shape[1])
                dims.append("cycle")
            values = np.asarray(each.values)
            item = file.createVariable(each.name, values.dtype.newbyteorder("="), tuple(dims))
            item[:] = values
            item.units = each.unit.encode()
            if values.dtype.kind == "i" and chance(rng, 0.3):
                item.scale_factor, item.add_offset = 0.25, 3.0
                content.columns[at] = each._replace(values=values * 0.25 + 3.0)
                content.tolerance = 1e-6
    return case_of(content, path.read_bytes(), pick(rng, ["a.nc", "a"]))


def npz(rng: Random, path: Path) -> Case:
    content = content_of(rng, (*FLOATS, *WHOLE, "?"), units=False)
    content.rename(lambda name: name.replace("/", "_"))
    with path.open("wb") as stream:
        pick(rng, [np.savez, np.savez_compressed])(stream, **arrays(content))
    return case_of(content, path.read_bytes(), pick(rng, ["a.npz", "a"]))


def npy(rng: Random, path: Path) -> Case:
    content = content_of(rng, (*FLOATS, *WHOLE), units=False, matrix=False, slow=False)
    columns = content.columns
    if chance(rng, 0.5):
        made: Any = np.rec.fromarrays([each.values for each in columns], names=[each.name for each in columns])
    else:
        made = np.column_stack([np.asarray(each.values, np.float64) for each in columns])
        made = np.asfortranarray(made) if chance(rng, 0.4) else made
        names = [each.name for each in columns]
        content.how = {
            key: value if not key.endswith("_column") else
            names.index(value if isinstance(value, str) else value[0]) for key, value in content.how.items()
        }  # fmt: skip
        if made.shape[1] >= made.shape[0] or made.shape[1] == 1:
            return npy(rng, path)  # which side is which does not stand in the file
        content.columns = [each._replace(name=str(1 + at)) for at, each in enumerate(columns)]
    np.save(path, made)
    return case_of(content, path.with_suffix(".npy").read_bytes(), pick(rng, ["a.npy", "a"]))


def tdms(rng: Random, path: Path) -> Case:
    import nptdms

    content = content_of(rng, (*FLOATS[:2], "f4", *WHOLE[:4]), matrix=False)
    waveform = chance(rng, 0.2)
    with nptdms.TdmsWriter(str(path), version=pick(rng, [4712, 4713])) as writer:
        parts = int(rng.integers(1, 4))
        for part in range(parts):
            objects: list[Any] = [nptdms.RootObject(properties={"author": "Öz"})] if chance(rng, 0.3) else []
            for each in content.columns:
                properties: Arrays = {pick(rng, ["unit_string", "NI_UnitDescription"]): each.unit}
                if waveform:
                    properties |= {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_samples": 1}
                values = np.array_split(np.asarray(each.values), parts)[part]
                objects.append(nptdms.ChannelObject("g", each.name, values, properties=properties if not part else {}))
            if chance(rng, 0.3):
                objects.append(nptdms.ChannelObject("texts", "note", ["a", "bcd"]))
            writer.write_segment(objects)
    return case_of(content, path.read_bytes(), pick(rng, ["a.tdms", "a"]))


def parquet(rng: Random, path: Path) -> Case:
    import pyarrow as pa
    from pyarrow import parquet as module

    content = content_of(rng, (*FLOATS[:2], "f4", *WHOLE[:4], "i8", "?"), matrix=False, slow=False)
    fields, made = [], []
    for each in content.columns:
        made.append(pa.array(np.asarray(each.values)))
        fields.append(pa.field(each.name, made[-1].type, metadata={pick(rng, ["units", "unit"]): each.unit}))
    if chance(rng, 0.3):
        made.append(pa.array(["a"] * len(made[0])))
        fields.append(pa.field("texts", made[-1].type))
    module.write_table(
        pa.Table.from_arrays(made, schema=pa.schema(fields)), path, row_group_size=int(rng.integers(5, 2000)),
        compression=pick(rng, ["none", "snappy", "gzip", "zstd", "lz4"]), use_dictionary=chance(rng, 0.5),
        data_page_version=pick(rng, ["1.0", "2.0"]), write_statistics=chance(rng, 0.5),
    )  # fmt: skip
    return case_of(content, path.read_bytes(), pick(rng, ["a.parquet", "a"]))


def xlsx(rng: Random, path: Path) -> Case:
    import openpyxl

    content = content_of(rng, (*FLOATS[:2], *WHOLE[:4]), matrix=False, slow=False)
    book = openpyxl.Workbook()
    sheet = book.active
    if chance(rng, 0.4):
        sheet.append(["Bench 4, Tuesday", 17, dt.date(2026, 11, 5)])
        sheet = book.create_sheet("data")
    day = dt.datetime(2026, 11, 5, 3, 4)  # noqa: DTZ001 - a sheet knows no zone
    left = [None] * int(rng.integers(0, 2))
    for _ in range(int(rng.integers(0, 3))):
        sheet.append(pick(rng, [["Operator", "Öz"], ["Run", 17], [], ["Date", day]]))
    sheet.append([*left, *(each.name for each in content.columns)])
    content.has_units = chance(rng, 0.7)
    if content.has_units:
        sheet.append([*left, *(each.unit for each in content.columns)])
        content.columns = [each._replace(unit=each.unit or "-") for each in content.columns]
    for row in zip(*(each.values for each in content.columns), strict=True):
        sheet.append([*left, *(value.item() for value in row)])
    book.save(path)
    return case_of(content, path.read_bytes(), pick(rng, ["a.xlsx", "a"]))


def mdf(rng: Random, path: Path) -> Case:
    import asammdf

    content = content_of(rng, (*FLOATS[:2], "f4", *WHOLE[:4]), matrix=False, slow=False)
    version = pick(rng, ["3.30", "4.10", "4.10", "4.11", "4.20"])
    with asammdf.MDF(version=version) as file:
        time = np.cumsum(rng.uniform(0.01, 0.02, len(content.columns[0].values)))
        signals = []
        for at, each in enumerate(content.columns):
            conversion = None
            values = np.asarray(each.values)
            if values.dtype.kind in "iu" and chance(rng, 0.4):
                conversion = {"a": 0.25, "b": -3.0}
                content.columns[at] = each._replace(values=0.25 * values - 3.0)
            signals.append(asammdf.Signal(values, time, name=each.name, unit=each.unit, conversion=conversion))
        if version[0] == "4" and chance(rng, 0.3):
            texts = np.array([f"text {k % 7}" * (1 + k % 3) for k in range(time.size)], "S")
            signals.append(asammdf.Signal(texts, time, name="text", encoding="utf-8"))
            signals.append(asammdf.Signal(rng.integers(0, 255, (time.size, 8), np.uint8), time, name="bytes"))
        file.append(signals, common_timebase=True)
        if chance(rng, 0.4):
            rows = len(time) + 7
            rise = np.arange(rows) * 0.5
            file.append([asammdf.Signal(rng.normal(80.0, 1.0, rows), rise, name="slow", unit="degC")])
        ending = ".mdf" if version[0] == "3" else ".mf4"
        made = file.save(path.with_suffix(ending), overwrite=True, compression=int(rng.integers(0, 3)))
    return case_of(content, Path(made).read_bytes(), pick(rng, ["a" + ending, "a"]))


BINARY: dict[str, Callable[[Random, Path], Case]] = {
    make.__name__: partial(in_a_folder, make)
    for make in (mat5, mat73, hdf5, netcdf3, npz, npy, tdms, parquet, xlsx, mdf)
}
