"""Samples that a file marks as invalid or missing are no measurement in any format, whatever value is stored there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mgdd.errors import DataError
from mgdd.io import pressure_trace, read, read_pressure, read_throttle_log, throttle_log
from mgdd.io.any_table import read_any_table

ANGLE = np.arange(-180.0, 181.0)
BAR = 1.0 + 50.0 * np.exp(-((ANGLE / 30.0) ** 2))
BAD = np.isin(ANGLE, [-100.0, -40.0, 20.0])


def _mdf(file: Path, *, invalid: bool) -> None:
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(ANGLE.size) * 1e-4
    marks = {"invalidation_bits": BAD} if invalid else {}
    stored = np.where(BAD, 0.0, BAR) if invalid else BAR
    with asammdf.MDF(version="4.10") as content:
        content.append(
            [
                asammdf.Signal(ANGLE, time, name="angle", unit="deg"),
                asammdf.Signal(stored, time, name="pcyl", unit="bar", **marks),
                asammdf.Signal((100 * stored).astype("i2"), time, name="whole", unit="", **marks),
            ]
        )
        content.save(file.with_suffix(".mf4"))
    file.with_suffix(".mf4").rename(file)


def _hdf5(file: Path, *, invalid: bool) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(file, "w") as content:
        content["angle"] = ANGLE
        content["angle"].attrs["units"] = "deg"
        packed = np.round(1000.0 * BAR).astype("i4")
        content["pcyl"] = np.where(BAD, -99, packed) if invalid else packed
        content["pcyl"].attrs.update({"units": "bar", "_FillValue": np.int32(-99), "scale_factor": 1e-3})
        content["whole"] = np.where(BAD, 900.0, BAR) if invalid else BAR
        content["whole"].attrs["valid_range"] = [0.0, 500.0]


def _netcdf(file: Path, *, invalid: bool) -> None:
    from scipy.io import netcdf_file

    with netcdf_file(file, "w") as content:
        content.createDimension("sample", ANGLE.size)
        stored = np.where(BAD, -999.0, BAR) if invalid else BAR
        unwritten = np.where(BAD, -32767, (100.0 * BAR).astype("i2")) if invalid else (100.0 * BAR).astype("i2")
        for name, values, unit in (("angle", ANGLE, "deg"), ("pcyl", stored, "bar"), ("whole", unwritten, "1")):
            variable = content.createVariable(name, "h" if name == "whole" else "d", ("sample",))
            variable[:] = values
            variable.units = unit
        content.variables["pcyl"].missing_value = -999.0


def _parquet(file: Path, *, invalid: bool) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    mask = BAD if invalid else None
    columns = {"angle": arrow.array(ANGLE), "pcyl": arrow.array(BAR, mask=mask)}
    parquet.write_table(arrow.table({**columns, "whole": arrow.array((100 * BAR).astype("i4"), mask=mask)}), file)


FORMS: dict[str, Callable[..., None]] = {"mdf": _mdf, "hdf5": _hdf5, "netcdf": _netcdf, "parquet": _parquet}


@pytest.mark.parametrize("form", FORMS)
def test_an_invalid_sample_is_nan_and_no_pressure(form: str, tmp_path: Path) -> None:
    FORMS[form](tmp_path / "sound", invalid=False)
    np.testing.assert_allclose(read_pressure(tmp_path / "sound", **NAMES)["pressure_bar"], BAR, atol=1e-3)
    FORMS[form](tmp_path / "marked", invalid=True)
    table = read_any_table(tmp_path / "marked")
    for name in ("pcyl", "whole"):
        np.testing.assert_array_equal(np.isnan(table.numbers(table.index(name))), BAD, err_msg=name)
    for reader in (read_pressure, read):
        with pytest.raises(DataError, match="nan"):
            reader(tmp_path / "marked", **NAMES)


NAMES = {"angle_column": "angle", "pressure_column": "pcyl"}


def test_an_invalid_sample_of_a_throttle_log_is_refused_by_its_place(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(2000) * 1e-3
    duty, plate = 0.2 * np.sin(6.0 * time), 20.0 + 15.0 * np.sin(6.0 * time - 0.5)
    bad = np.isin(np.arange(2000), [40, 41])
    with asammdf.MDF(version="4.10") as content:
        signals = [
            asammdf.Signal(duty, time, name="duty"),
            asammdf.Signal(plate, time, name="plate", unit="deg", invalidation_bits=bad),
        ]
        content.append(signals)
        content.save(tmp_path / "log.mf4")
    columns = {"time": "time", "duty": "duty", "angle": "plate"}
    with pytest.raises(DataError, match=r"sample 40, column 'plate': nan is not finite \(2 such cells\)"):
        read_throttle_log(tmp_path / "log.mf4", **columns)
    assert read_throttle_log(tmp_path / "log.mf4", **columns, start_s=0.042).sizes["time_s"] == 1958


def test_what_stands_below_a_mask_is_not_read() -> None:
    with pytest.raises(DataError, match=r"pressure = nan"):
        pressure_trace(ANGLE, np.ma.masked_array(BAR, BAD))
    time = np.arange(2000) * 1e-3
    duty, plate = 0.2 * np.sin(6.0 * time), 20.0 + 15.0 * np.sin(6.0 * time - 0.5)
    with pytest.raises(DataError, match=r"sample 7, column 'angle_deg': nan is not finite"):
        throttle_log(time, duty, np.ma.masked_array(plate, np.arange(2000) == 7))


@pytest.mark.parametrize("step", [0, -1.0, float("nan"), "1 ms"])
def test_a_step_of_tdms_that_tells_no_time_is_none_for_every_door(step: float | str, tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    clock = {"wf_increment": step, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(tmp_path / "p.tdms") as content:
        columns = (("angle", ANGLE, "deg"), ("pcyl", BAR, "bar"))
        content.write_segment([nptdms.ChannelObject("g", n, v, clock | {"unit_string": u}) for n, v, u in columns])
    assert read_any_table(tmp_path / "p.tdms").header == ("angle", "pcyl")
    for reader in (read_pressure, read):
        np.testing.assert_array_equal(reader(tmp_path / "p.tdms")["pressure_bar"], BAR)
