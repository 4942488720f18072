"""The measured traces: where they are looked for, that they are what was shipped, what is known of them."""

from __future__ import annotations

import hashlib
import subprocess
import sys

import numpy as np
import pytest

from mgdd import datasets
from mgdd.datasets.files import path
from mgdd.errors import DataError, ParameterError
from mgdd.io import read_pressure
from mgdd.results.labels import ANGLE, check_labels

NAME = "hd_diesel_128x144"
FILES = (f"{NAME}_traces.csv", f"{NAME}_conditions.csv", f"{NAME}_SOURCE.txt", f"{NAME}_LICENSE.txt")


@pytest.fixture
def alone(monkeypatch):
    monkeypatch.delenv("MGDD_DATA_DIR", raising=False)


@pytest.fixture
def source():
    try:
        return path("libice_hd_diesel", "pExpA25").parent
    except FileNotFoundError as reason:
        pytest.skip(str(reason))


@pytest.mark.usefixtures("alone")
def test_the_four_traces():
    traces = datasets.read("hd_diesel_128x144")
    assert [trace.attrs["load_percent"] for trace in traces] == [25, 50, 75, 100]
    assert [trace.attrs["trapped_mass_g"] for trace in traces] == [3.0858, 4.13863, 5.39428, 6.193]
    assert [trace.attrs["soi_cad"] for trace in traces] == [-5.06, -4.73, -4.75, -2.00]
    assert {trace.attrs["speed_rpm"] for trace in traces} == {1200}
    assert traces[0].attrs["file"] == "pressure_a25_bar"
    peaks = [(round(float(t["pressure_bar"].max()), 1), float(t["pressure_bar"].idxmax())) for t in traces]
    assert peaks == [(126.5, 6.0), (183.5, 8.0), (230.4, 10.0), (233.2, 10.0)]
    for trace in traces:
        check_labels(trace)
        np.testing.assert_array_equal(trace[ANGLE], np.arange(-143.0, 124.0))


@pytest.mark.usefixtures("alone")
def test_indicated_work_of_the_traces():
    """Closed-valve work over the geometry of the engine, against 1331.6, 2540.1, 3737.3 and 4857.5 J."""
    rod, crank, bore, ratio = 241.5e-3, 72e-3, 128e-3, 20.3
    phi = np.deg2rad(np.arange(-143.0, 124.0))
    swept = np.pi / 4.0 * bore**2 * 2.0 * crank
    lift = rod + crank - crank * np.cos(phi) - np.sqrt(rod**2 - (crank * np.sin(phi)) ** 2)
    volume = swept / (ratio - 1.0) + np.pi / 4.0 * bore**2 * lift
    pascal = [1e5 * trace["pressure_bar"].to_numpy() for trace in datasets.read("hd_diesel_128x144")]
    work = [float(np.sum(0.5 * (p[1:] + p[:-1]) * np.diff(volume))) for p in pascal]
    np.testing.assert_allclose(work, [1331.6, 2540.1, 3737.3, 4857.5], atol=0.05)


def test_the_source_gives_the_same_bytes(root, source, tmp_path):
    tool = root / "tools" / "convert_hd_traces.py"
    command = [sys.executable, str(tool), "--source", str(source), "--out", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)
    for file in FILES:
        assert (tmp_path / file).read_bytes() == (root / "python" / "mgdd" / "data" / file).read_bytes(), file


@pytest.mark.parametrize("load", [25, 50, 75, 100])
def test_the_conversion_is_exact(source, load):
    original = read_pressure(source / f"pExpA{load}", pressure_unit="Pa")
    packaged = next(t for t in datasets.read("hd_diesel_128x144") if t.attrs["load_percent"] == load)
    np.testing.assert_array_equal(original["pressure_bar"], packaged["pressure_bar"])


def test_the_converter_refuses_and_writes_nothing(root, tmp_path):
    (tmp_path / "pExpA25").write_text("0 101325\n" * 267)
    tool, out = root / "tools" / "convert_hd_traces.py", tmp_path / "out"
    command = [sys.executable, str(tool), "--source", str(tmp_path), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "101325 Pa: must be a multiple of 10 Pa" in done.stderr
    assert not out.exists()


@pytest.mark.usefixtures("alone")
def test_licence_and_citation_travel_with_the_data():
    licence = path(NAME, f"{NAME}_LICENSE.txt").read_text(encoding="ascii")
    assert licence.startswith("Copyright (c) 2018 The Python Packaging Authority")
    assert "Permission is hereby granted, free of charge" in licence
    source = path(NAME, f"{NAME}_SOURCE.txt").read_text(encoding="ascii")
    assert "https://github.com/RamogninoF/LibICE-post" in source
    assert "Licence: MIT" in source


def test_the_data_folder_comes_first(monkeypatch, tmp_path):
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    own = tmp_path / NAME / FILES[0]
    assert path(NAME, FILES[0]) != own
    own.parent.mkdir()
    own.write_text("mine")
    assert path(NAME, FILES[0]) == own


def test_only_what_a_reader_reads_is_available(monkeypatch, tmp_path):
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    (tmp_path / "bench_7").mkdir()
    (tmp_path / "advisor_engine_maps").mkdir()
    (tmp_path / "advisor_engine_maps" / "vw_1.9tdi_ornl_hot.csv").write_text("one of its two files")
    assert datasets.names() == (NAME,)
    (tmp_path / "advisor_engine_maps" / "mercedes_1.7_ornl_hot.csv").write_text("the other")
    assert datasets.names() == ("advisor_engine_maps", NAME)


def test_another_export_of_the_hydrogen_engine_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    (tmp_path / "h2df_502").mkdir()
    (tmp_path / "h2df_502" / datasets.files.FILES["h2df_502"][0]).write_text("cycle\n1\n2\n")
    with pytest.raises(DataError, match="the file is another export; pass checked=False"):
        datasets.read("h2df_502")
    with pytest.raises(DataError, match="no column"):
        datasets.read("h2df_502", checked=False)


def test_a_data_folder_that_is_not_there_is_no_obstacle(monkeypatch, tmp_path):
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path / "nowhere"))
    assert datasets.names() == (NAME,)
    assert path(NAME, FILES[0]).is_file()


def test_both_places_are_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MGDD_DATA_DIR", str(tmp_path))
    with pytest.raises(FileNotFoundError, match=r"no file 'x\.csv' of data set 'moon'") as caught:
        path("moon", "x.csv")
    message = str(caught.value)
    assert str(tmp_path / "moon" / "x.csv") in message
    assert "and the package (" in message
    assert "set MGDD_DATA_DIR to a folder that holds moon/x.csv" in message
    monkeypatch.delenv("MGDD_DATA_DIR")
    with pytest.raises(FileNotFoundError, match=r"MGDD_DATA_DIR is not set, and the package \(.*\) lacks it"):
        path("moon", "x.csv")


@pytest.mark.usefixtures("alone")
def test_a_changed_packaged_file_is_refused(monkeypatch, tmp_path):
    (tmp_path / FILES[0]).write_text("tampered")
    monkeypatch.setattr(sys.modules["mgdd.datasets.files"], "_PACKAGE", tmp_path)
    found = hashlib.sha256(b"tampered").hexdigest()
    with pytest.raises(DataError, match=f"SHA-256 is {found}, shipped was .*: the file was changed; reinstall"):
        path(NAME, FILES[0])


def test_an_unknown_set_and_an_option_of_another_are_refused():
    with pytest.raises(ParameterError, match="data set 'moon': must be one of advisor_engine_maps, h2df_502"):
        datasets.read("moon")
    with pytest.raises(ParameterError, match="only 'h2df_502' has them"):
        datasets.read(NAME, mask_held=False)
