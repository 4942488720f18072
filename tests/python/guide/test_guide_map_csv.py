"""The map of the best timing as a table: what is written comes back, a person's is read, what is wrong is named."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mgdd.engine import OperatingPoint
from mgdd.errors import DataError, Error, ParameterError, ShapeError
from mgdd.guide import TimingMap
from mgdd.guide.map_table import read_map_table

AXES = {"speed_rpm": [900.0, 1500.0, 3000.0], "fuel_mg": [6.0, 12.0, 20.0, 40.0]}
VALUES = [[-2.0, -3.1, -4.3, -9.0], [-2.5, -4.0, -5.6, -11.0], [-4.0, -6.0, -8.0, -14.0]]


def learnt() -> TimingMap:
    timing = TimingMap(AXES, VALUES, prior_sd_cad=2.0, forgetting=0.9)
    timing.learn({"speed_rpm": 1310.0, "fuel_mg": 17.0}, -6.2, sd_cad=0.3)
    timing.learn(OperatingPoint(speed_rpm=2000.0, fuel_mg=30.0), -9.0, sd_cad=0.7)
    return timing


def same(one: TimingMap, other: TimingMap) -> None:
    assert {name: axis.tolist() for name, axis in one.axes.items()} == {n: a.tolist() for n, a in other.axes.items()}
    np.testing.assert_array_equal(one.timing_cad, other.timing_cad)
    np.testing.assert_array_equal(one.support, other.support)
    np.testing.assert_allclose(one.sd_cad, other.sd_cad, rtol=1e-15)
    assert one.to_dataset().attrs == other.to_dataset().attrs


def read(folder: Path, text: str) -> TimingMap:
    file = folder / "map.csv"
    file.write_text(text, encoding="utf-8")
    return TimingMap.read_csv(file)


def test_a_written_map_comes_back_and_learns_alike(tmp_path: Path) -> None:
    timing = learnt()
    timing.write_csv(tmp_path / "one.csv", source="cycle model puma_single")
    back = TimingMap.read_csv(tmp_path / "one.csv")
    same(back, timing)
    back.write_csv(tmp_path / "two.csv", source="cycle model puma_single")
    assert (tmp_path / "two.csv").read_bytes() == (tmp_path / "one.csv").read_bytes()
    for one in (back, timing):
        one.learn((1500.0, 20.0), -7.0, sd_cad=0.2)
    assert back((1400.0, 21.0)) == pytest.approx(timing((1400.0, 21.0)), rel=1e-14)


def test_a_map_of_one_axis_comes_back(tmp_path: Path) -> None:
    timing = TimingMap({"fuel_mg": [6.0, 20.0, 40.0]}, [-1.0, -5.0, -9.5], prior_sd_cad=1.25)
    timing.write_csv(tmp_path / "map.csv")
    back = TimingMap.read_csv(tmp_path / "map.csv")
    same(back, timing)
    assert back((13.0,)) == -3.0  # half way between two breakpoints


def test_the_file_is_plain_and_says_units_and_origin(tmp_path: Path) -> None:
    learnt().write_csv(tmp_path / "map.csv", source="bench run of 3 May")
    table = pd.read_csv(tmp_path / "map.csv")
    names = ["speed_rpm", "fuel_mg", "timing_cad", "sd_cad", "support", "prior_sd_cad", "forgetting", "source"]
    assert list(table.columns) == names
    assert set(table["source"]) == {"bench run of 3 May"}
    assert len(table) == 12
    row = table[(table["speed_rpm"] == 3000.0) & (table["fuel_mg"] == 6.0)].iloc[0]
    assert (row["timing_cad"], row["support"], row["prior_sd_cad"], row["forgetting"]) == (-4.0, 0.0, 2.0, 0.9)
    learnt().write_csv(tmp_path / "bare.csv")
    assert "source" not in pd.read_csv(tmp_path / "bare.csv").columns


def test_what_a_person_writes_is_read_in_any_order_and_with_another_mark(tmp_path: Path) -> None:
    text = """# from the calibration of May, by hand
fuel_mg;speed_rpm;timing_cad
mg;rpm;°CA aTDC
40;900;-9
6;1500;-2.5
40;1500;-11
6;900;-2
"""
    timing = read(tmp_path, text)
    assert list(timing.axes) == ["fuel_mg", "speed_rpm"]
    assert timing(OperatingPoint(speed_rpm=1500.0, fuel_mg=6.0)) == -2.5
    assert timing({"speed_rpm": 900.0, "fuel_mg": 40.0}) == -9.0
    assert timing.sd_cad == pytest.approx(np.full((2, 2), 3.0))  # of a map that was never learnt
    assert timing.support.sum() == 0.0
    german = tmp_path / "german.csv"
    german.write_text(text.replace("-2.5", "-2,5"), encoding="utf-8")
    assert TimingMap.read_csv(german, decimal=",")({"speed_rpm": 1500.0, "fuel_mg": 6.0}) == -2.5


def test_a_prior_of_the_file_holds_for_cells_without_a_deviation(tmp_path: Path) -> None:
    timing = read(tmp_path, "fuel_mg,timing_cad,prior_sd_cad\n6,-2,1.5\n20,-6,1.5\n")
    assert timing.sd_cad.tolist() == [1.5, 1.5]


GOOD = "speed_rpm,fuel_mg,timing_cad,sd_cad\n900,6,-2,1\n900,20,-4,1\n1500,6,-3,1\n1500,20,-6,1\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD.replace("timing_cad", "timing"), "no column 'timing_cad'.*did you mean 'timing'"),
        (
            GOOD.replace("900,20,-4", "900,6,-4"),
            "line 3: speed_rpm = 900, fuel_mg = 6 stands in line 2 already: remove",
        ),
        (GOOD.replace("900,20,-4,1\n", ""), "no row with speed_rpm = 900, fuel_mg = 20: .*add it"),
        (GOOD.replace("-3,1", "-3,0"), "line 4, column 'sd_cad': 0: must be > 0"),
        (GOOD.replace("-3,1", "late,1"), "line 4, column 'timing_cad': 'late' is not a number"),
        (GOOD.replace("-3,1", "-300,1"), "line 4, column 'timing_cad': -300: must be in \\[-180, 180\\].*°CA aTDC"),
        ("timing_cad,sd_cad\n-2,1\n", "no axis: .*speed_rpm"),
        ("a,b,c,timing_cad\n1,1,1,1\n", "3 axes, 'a', 'b', 'c': a map has one or two"),
        ("fuel_mg,timing_cad\n6,-2\n", "column 'fuel_mg': one value, 6: an axis needs two at least"),
        ("fuel_mg,timing_cad,forgetting\n6,-2,.9\n20,-4,.8\n", "line 3, column 'forgetting': 0.8 where line 2 has 0.9"),
        ("fuel_mg,timing_cad,forgetting\n6,-2,1.9\n20,-4,1.9\n", "forgetting = 1.9: must be in"),
        ("fuel_mg,timing_cad,support\n6,-2,1\n20,-4,-1\n", "line 3, column 'support': -1: must be >= 0"),
        ("fuel_mg,timing_cad\nkg,rad\n6,-2\n20,-3\n", "column 'fuel_mg': unit 'kg': must be 'mg'.*convert"),
        ("6,-2\n20,-3\n", "no header"),
        ("fuel_mg,fuel_mg,timing_cad\n6,7,-2\n20,8,-3\n", "column 'fuel_mg' occurs twice"),
    ],
)
def test_what_is_wrong_is_named_with_its_place_and_the_remedy(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(Error, match=said) as refusal:
        read(tmp_path, text)
    assert "map.csv" in str(refusal.value)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(FileNotFoundError, match=re.escape("no such file")):
        TimingMap.read_csv("nowhere.csv")


def test_each_cell_may_say_where_it_comes_from(tmp_path: Path) -> None:
    texts = [[f"{speed:g} rpm {fuel:g} mg" for fuel in AXES["fuel_mg"]] for speed in AXES["speed_rpm"]]
    learnt().write_csv(tmp_path / "map.csv", source=texts)
    table = pd.read_csv(tmp_path / "map.csv").sample(frac=1.0, random_state=3)
    for _, row in table.iterrows():
        assert row["source"] == f"{row['speed_rpm']:g} rpm {row['fuel_mg']:g} mg"
    table.to_csv(tmp_path / "mixed.csv", index=False)
    same(TimingMap.read_csv(tmp_path / "mixed.csv"), learnt())
    assert read_map_table(tmp_path / "mixed.csv", ".")[1].tolist() == texts
    with pytest.raises(ShapeError, match="source has shape"):
        learnt().write_csv(tmp_path / "map.csv", source=texts[0])


def test_an_origin_that_would_break_the_table_is_refused(tmp_path: Path) -> None:
    for source in ("a, b", 'say "map"', "two\nlines"):
        with pytest.raises(ParameterError, match="source"):
            learnt().write_csv(tmp_path / "map.csv", source=source)
    assert not (tmp_path / "map.csv").exists()


def test_a_dataset_in_another_unit_is_refused_as_before() -> None:
    dataset = learnt().to_dataset()
    dataset["timing_cad"].attrs["units"] = "rad"
    with pytest.raises(DataError, match="timing_cad"):
        TimingMap.from_dataset(dataset)
