"""Chunks of cycles: together they are the whole file bit for bit, in any format and form, within bounded memory."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd.errors import DataError, ParameterError
from mgdd.io import pressure_chunks, read_pressure
from mgdd.io.any_table import read_any_table
from mgdd.results.labels import ANGLE, check_labels
from table_files import WRITERS

# asammdf closes twice what it could not open.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
STEP, COUNT = 2.0, 31
CAD = np.arange(-360.0, 360.0, STEP)


@pytest.fixture(autouse=True)
def few_rows_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short file is read whole: let these be long ones."""
    monkeypatch.setattr("mgdd.io.chunks._ROWS", 1000)
    monkeypatch.setattr("mgdd.io.chunks._BLOCK", 5000)


def cycles_at(degrees: np.ndarray, tdc: float, count: int = COUNT) -> np.ndarray:
    """Cycles of unlike height and noise over angles as in a file, whose firing TDC is given."""
    rng = np.random.default_rng(7)
    cad = (degrees - tdc + 360.0) % 720.0 - 360.0
    height = 40.0 + 5.0 * rng.random((count, 1))
    return 1.2 + height * np.exp(-(((cad - 8.0) / 35.0) ** 2)) + 0.05 * rng.random((count, degrees.size))


def stacked(degrees: np.ndarray, tdc: float) -> dict[str, np.ndarray]:
    return {"angle": np.tile(degrees, COUNT), "pcyl": cycles_at(degrees, tdc).ravel()}


def require_whole(file: Path, cycles: int, **options: Any) -> list[xr.Dataset]:
    whole = read_pressure(file, **options)
    parts = list(pressure_chunks(file, cycles=cycles, **options))
    for part in parts:
        check_labels(part)
        assert part["pressure_bar"].dims == ("cycle", ANGLE)
        assert part.attrs["file"] == file.name
        assert part[ANGLE].identical(whole[ANGLE])
    assert [part.sizes["cycle"] for part in parts[:-1]] == [cycles] * (len(parts) - 1)
    together = np.concatenate([part["pressure_bar"] for part in parts])
    np.testing.assert_array_equal(together, whole["pressure_bar"])
    np.testing.assert_array_equal(np.concatenate([part["cycle"] for part in parts]), whole["cycle"])
    return parts


def write_text(file: Path, names: dict[str, np.ndarray], units: dict[str, str]) -> None:
    rows = [",".join(map(repr, row)) for row in np.column_stack(list(names.values())).tolist()]
    heads = [",".join(names), ",".join(units.get(name, "-") for name in names)]
    file.write_text("\n".join(["# bench 4", *heads, *rows]))


FORMS: dict[str, Callable[..., None]] = {**WRITERS, "text": write_text}


@pytest.mark.parametrize("form", ["text", "parquet"])
def test_chunks_of_a_text_and_of_another_format_are_the_whole_file(form: str, tmp_path: Path) -> None:
    file = tmp_path / "record"
    FORMS[form](file, stacked(CAD, 0.0), {"angle": "deg", "pcyl": "bar"})
    parts = require_whole(file, 7, angle_column="angle", pressure_column="pcyl")
    assert len(parts) == 5
    assert not any(part.attrs["warnings"] for part in parts)


ZERO = np.arange(0.0, 720.0, STEP)


@pytest.mark.parametrize("form", ["mat73", "text"])
@pytest.mark.parametrize("joined", [False, True])
def test_a_column_per_cycle(form: str, joined: bool, tmp_path: Path) -> None:
    """Joined ones begin at firing TDC: each column has the burn of the cycle that the column before compressed."""
    file, angle = tmp_path / "record", ZERO if joined else CAD
    names = {"angle": angle, **{f"p {k + 1}": row for k, row in enumerate(cycles_at(angle, 0.0))}}
    FORMS[form](file, {"angle": angle, "p": cycles_at(angle, 0.0).T} if form == "mat73" else names, {})
    parts = require_whole(file, 12, **({"firing_tdc_deg": 0} if joined else {}))
    assert sum(part.sizes["cycle"] for part in parts) == COUNT - joined


ON = STEP * np.arange(COUNT * CAD.size)
AT_CAD, AT_0, AT_300, AT_360 = (
    cycles_at(grid, tdc).ravel() for grid, tdc in ((CAD, 0.0), (ZERO, 0.0), (ZERO, 300.0), (ZERO, 360.0))
)
CASES: dict[str, tuple[np.ndarray, np.ndarray, dict[str, Any], int]] = {
    "incomplete ends": (np.tile(CAD, COUNT)[33:-77], AT_CAD[33:-77], {}, COUNT - 2),
    "0 to 720": (np.tile(ZERO, COUNT), AT_360, {"firing_tdc_deg": 360}, COUNT),
    "0 to 720, seam within": (np.tile(ZERO, COUNT), AT_300, {"firing_tdc_deg": 300}, COUNT),
    "joined": (np.tile(ZERO, COUNT), AT_0, {"firing_tdc_deg": 0}, COUNT - 1),
    "joined, cut": (np.tile(ZERO, COUNT)[30:-40], AT_0[30:-40], {"firing_tdc_deg": 0}, COUNT - 3),
    "runs on": (ON, AT_360, {"firing_tdc_deg": 360}, COUNT),
    "runs on, in mid burn": (ON, AT_0, {"firing_tdc_deg": 0}, COUNT - 1),
    "before TDC": (np.tile(-CAD, COUNT), AT_CAD, {"before_tdc": True}, COUNT),
    "offset": (np.tile(CAD, COUNT), AT_CAD, {"tdc_offset_cad": 0.3}, COUNT),
    "radians": (np.tile(np.deg2rad(CAD), COUNT), AT_CAD, {"angle_unit": "rad"}, COUNT),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("cycles", [1, 9, 400])
def test_chunks_of_every_form_are_the_whole_record(case: str, cycles: int, tmp_path: Path) -> None:
    degrees, pressure, options, count = CASES[case]
    write_text(tmp_path / "r.csv", {"angle": degrees, "p": pressure}, {})
    parts = require_whole(tmp_path / "r.csv", cycles, **options)
    assert sum(part.sizes["cycle"] for part in parts) == count
    said = [part.attrs["warnings"] for part in parts]
    assert not any(said[1:-1])
    lost = len(degrees) - count * CAD.size
    noted = [int(line.split()[0]) for line in "\n".join(said).splitlines() if "left out: incomplete" in line]
    assert sum(noted) == lost


def test_samples_by_their_step_and_volts(tmp_path: Path) -> None:
    write_text(tmp_path / "r.csv", {"U": cycles_at(ZERO, 360.0).ravel() / 20.0}, {"U": "V"})
    volts = {"angle_step_deg": STEP, "firing_tdc_deg": 360, "gain_bar_per_v": 20.0, "offset_bar": 0.25}
    assert len(require_whole(tmp_path / "r.csv", 10, **volts)) == 4


def test_steps_that_do_not_divide_a_cycle_are_read_whole(tmp_path: Path) -> None:
    degrees = 0.7 * np.arange(20 * 1030)
    write_text(tmp_path / "r.csv", {"angle": degrees, "p": cycles_at(degrees, 360.0, 1).ravel()}, {})
    assert "interpolated" in require_whole(tmp_path / "r.csv", 6, firing_tdc_deg=360)[0].attrs["warnings"]


def test_one_cycle_is_a_chunk_of_one(tmp_path: Path) -> None:
    write_text(tmp_path / "one.csv", {"angle": CAD, "p": cycles_at(CAD, 0.0, 1)[0]}, {})
    (part,) = pressure_chunks(tmp_path / "one.csv")
    check_labels(part)
    assert part["pressure_bar"].dims == ("cycle", ANGLE)
    np.testing.assert_array_equal(part["pressure_bar"][0], read_pressure(tmp_path / "one.csv")["pressure_bar"])


# --- only what is asked for ---------------------------------------------------------------------------------
@pytest.mark.parametrize("form", ["hdf5", "npz"])
def test_a_column_that_is_not_asked_for_is_not_read(form: str, tmp_path: Path) -> None:
    """Another column is damaged, and its format would notice."""
    file, names = tmp_path / "record", {**stacked(CAD, 0.0), "other": np.full(CAD.size * COUNT, 12345.678)}
    if form == "hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(file, "w") as content:
            for name, values in names.items():
                content.create_dataset(name, data=values, chunks=(1000,), fletcher32=True)
    else:
        FORMS[form](file, names, {})
    raw, mark = file.read_bytes(), np.float64(12345.678).tobytes()
    file.write_bytes(raw.replace(mark * 200, mark[::-1] * 200, 1))
    assert raw != file.read_bytes()
    named = {"angle_column": "angle", "pressure_column": "pcyl"}
    np.testing.assert_array_equal(read_pressure(file, **named)["pressure_bar"], cycles_at(CAD, 0.0))
    with pytest.raises(DataError, match="cannot be read"):
        read_pressure(file, angle_column="angle", pressure_column="other")


@pytest.mark.parametrize("form", WRITERS)
def test_a_table_in_memory_needs_its_file_no_more(form: str, tmp_path: Path) -> None:
    WRITERS[form](tmp_path / "r", stacked(CAD, 0.0), {})
    table = read_any_table(tmp_path / "r")
    (tmp_path / "r").unlink()
    np.testing.assert_allclose(table.numbers(table.index("pcyl")), cycles_at(CAD, 0.0).ravel(), rtol=1e-12)


# --- what is refused ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("cycles", [0, -3, 2.0, True, "all"])
def test_cycles_that_are_no_count(cycles: Any) -> None:
    with pytest.raises(ParameterError, match=r"cycles = .*: must be a whole number >= 1"):
        pressure_chunks("nothing.csv", cycles=cycles)


def test_an_option_that_is_not_known_is_refused_at_once() -> None:
    with pytest.raises(TypeError, match="pressure_colum'"):
        pressure_chunks("nothing.csv", pressure_colum="p")


def test_a_cycle_that_lost_samples_is_named_and_the_cycles_before_stay_good(tmp_path: Path) -> None:
    file, names, at = tmp_path / "r", stacked(CAD, 0.0), 22 * CAD.size + 100
    write_text(file, {name: np.delete(values, slice(at, at + 3)) for name, values in names.items()}, {})
    chunks = pressure_chunks(file, cycles=10)
    good = list(itertools.islice(chunks, 2))
    np.testing.assert_array_equal(np.concatenate([each["pressure_bar"] for each in good]), cycles_at(CAD, 0.0)[:20])
    with pytest.raises(
        DataError, match=f"{file} from cycle 20 on, line {at - 96}: the cycle that starts here has other crank angles"
    ):
        next(chunks)
    assert next(chunks, None) is None


def test_a_text_whose_last_row_is_cut(tmp_path: Path) -> None:
    file = tmp_path / "r.csv"
    write_text(file, stacked(CAD, 0.0), {})
    text = file.read_text()
    file.write_text(text[: text.rindex(",")])
    chunks = pressure_chunks(file, cycles=10)
    assert [each["cycle"].values[-1] for each in itertools.islice(chunks, 2)] == [10, 20]
    last = text.count("\n") + 1
    with pytest.raises(DataError, match=rf"line {last}: 1 cell\(s\) where line 4 has 2.*the file is cut off there"):
        next(chunks)


def test_a_letter_that_is_damaged_far_down(tmp_path: Path) -> None:
    file = tmp_path / "r.csv"
    write_text(file, stacked(CAD, 0.0), {})
    rows = file.read_bytes().split(b"\n")
    rows[5000] = "1 °".encode()[:-1] + b",2 \xc3\xa4"
    file.write_bytes(b"\n".join(rows))
    chunks = pressure_chunks(file, cycles=4)
    next(chunks)
    with pytest.raises(DataError, match="line 5001: damaged UTF-8"):
        list(chunks)


def test_an_angle_that_slips_from_chunk_to_chunk_is_doubted(tmp_path: Path) -> None:
    slip = np.repeat(np.linspace(0.0, 1.0, COUNT), CAD.size)
    degrees = np.tile(CAD, COUNT)
    pressure = 1.2 + 40.0 * np.exp(-(((degrees - slip) / 35.0) ** 2))
    write_text(tmp_path / "r.csv", {"angle": degrees, "p": pressure}, {})
    parts = list(pressure_chunks(tmp_path / "r.csv", cycles=4))
    assert not parts[0].attrs["warnings"]
    assert "from the first chunk to cycles 29 to 31" in parts[-1].attrs["warnings"]
