"""Damaged files: refused with a reason, or read as they stand; a small reader of each form says what stands there."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from file_mutants import judged, mutant_of_bytes, mutant_of_text
from map_cases import timing_table
from mgdd.identify import load_throttle_model
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.io.point_table import read_conditions
from mgdd.maps import CalibrationMap, read_map, write_map
from mgdd.throttle import PseudoWiener
from sample_files import CONDITIONS, SAMPLES, sample_file

FEW = 250


# --- what stands in a file, by readers of their own ---------------------------------------------------------
def number(cell: str, decimal: str = ".") -> float:
    assert re.fullmatch(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?", cell), cell
    assert decimal == "," or "," not in cell, cell
    return float(cell.replace(",", "."))


def text_of(raw: bytes) -> str:
    """UTF-8, or what a single byte of an older encoding makes of it."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("cp1252")


def conditions_in(raw: bytes) -> dict[str, dict[str, float]]:
    lines = [line.strip() for line in text_of(raw).splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    mark = next((mark for mark in ";\t," if mark in lines[0]), None)
    head, *rows = [[cell.strip().strip('"') for cell in line.split(mark)] for line in lines]
    found = {}
    for row in rows:
        assert len(row) == len(head)
        named = dict(zip(head, row, strict=True))
        assert named["file"] not in found
        found[named["file"]] = {name: number(cell) for name, cell in named.items() if cell and name != "file"}
    return found


def require_conditions(path: Path, raw: bytes) -> None:
    assert read_conditions(path) == conditions_in(raw)


def require_map(path: Path, raw: bytes) -> None:
    """Hold axes and cells of a map against the numbers of a grid, or of a table of points, in the order of the file."""
    table = read_map(path)
    text = text_of(raw)
    mark = next((mark for mark in ";\t," if mark in text.splitlines()[-1]), ",")
    rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text), delimiter=mark)]
    rows = [row for row in rows if any(row) and not row[0].startswith("#")]
    first = next(place for place, row in enumerate(rows) if re.match(r"[+-]?[.,]?\d", row[0]))
    body, axes = rows[first:], [*table.axes.values()]
    if len(axes) == 2:
        head = rows[first - 1]
        assert [number(cell) for cell in head[1:] if cell] == axes[1].tolist()
    else:
        body = sorted({tuple(row) for row in body}, key=lambda row: number(row[0]))  # in any order, equal ones too
    assert [number(row[0]) for row in body] == axes[0].tolist()
    for row, cells in zip(body, table.values.reshape(axes[0].size, -1).tolist(), strict=True):
        assert not any(row[1 + len(cells) :])
        for cell, value in zip(row[1:] or [""] * len(cells), cells, strict=False):
            assert np.isnan(value) if cell in ("", "-", "--") else value == number(cell)


def entries_in(raw: bytes) -> dict[str, dict[str, tuple[str, str]]]:
    """Give value and unit of every key by table, of lines as mgdd writes them."""
    tables: dict[str, dict[str, tuple[str, str]]] = {"": {}}
    for line in text_of(raw).splitlines():
        if found := re.fullmatch(r"\s*\[\s*(\w+)\s*\]\s*(#.*)?", line):
            tables[found[1]] = {}
        elif found := re.match(r'\s*"?(\w+)"?\s*=\s*(.*)', line):
            inner = dict(re.findall(r'(\w+)\s*=\s*("[^"]*"|[^,}]*[^,}\s])', found[2]))
            [*tables.values()][-1][found[1]] = (inner.get("value", found[2].strip()), inner.get("unit", ""))
    return tables


def require_model(written: dict[str, dict[str, tuple[str, str]]]) -> Callable[[Path, bytes], None]:
    def require(path: Path, raw: bytes) -> None:
        model = load_throttle_model(path)
        found = entries_in(raw)
        settings = model._options if isinstance(model, PseudoWiener) else vars(model)
        assert found[""]["kind"][0].strip("\"'") == model.kind
        for table, own in (("parameters", model.parameters), ("settings", settings)):
            assert found[table].keys() == written[table].keys()  # none is missing without a word
            for name, (value, unit) in found[table].items():
                assert unit == written[table][name][1], name
                got = own[name]
                assert got == (value.strip("\"'") if isinstance(got, str) else float(value.replace("_", ""))), name

    return require


# --- the good files -----------------------------------------------------------------------------------------
def map_text(folder: Path, table: CalibrationMap) -> bytes:
    write_map(table, folder / "good.csv")
    return (folder / "good.csv").read_bytes()


def curve() -> CalibrationMap:
    return CalibrationMap({"fuel_mg": [6, 10.5, 20]}, [0.25, -1.125, -4], name="soc_cad")


def model_text(model: Any) -> bytes:
    fitted = model.to_parameters().with_fit(
        stderr=dict.fromkeys(model.parameters, 0.0125), figures={"fit_percent": (97.5, "%")}, source="chirp.csv",
        unidentifiable=["delay_samples"],
    )  # fmt: skip
    return fitted.to_toml().encode()


GROUPS = FirstPrincipleModel(
    parameters={**FirstPrincipleModel().parameters, "delay_samples": 2.5, "stribeck_drop": 0.02, "half_gap_deg": 0.1},
    sample_s=2e-3,
)
GOOD: dict[str, tuple[str, Callable[[Path], bytes], Callable[[Path, bytes], None]]] = {
    "conditions": ("csv", lambda _: CONDITIONS.encode(), require_conditions),
    "map": ("csv", lambda folder: map_text(folder, timing_table()), require_map),
    "map of one axis": ("csv", lambda folder: map_text(folder, curve()), require_map),
    "groups": ("toml", lambda _: model_text(GROUPS), require_model(entries_in(model_text(GROUPS)))),
    "pseudo-Wiener": (
        "toml", lambda _: model_text(PseudoWiener("pw_r")), require_model(entries_in(model_text(PseudoWiener("pw_r")))),
    ),
}  # fmt: skip


def survey(form: str, folder: Path, count: int, first_seed: int) -> Counter[str]:
    """Read mutants of a file and count what became of them; a wrong value, or another error, ends it."""
    ending, make, require = GOOD[form]
    good, path, seen = make(folder), folder / f"mutant.{ending}", Counter[str]()
    for seed in range(first_seed, first_seed + count):
        kind, raw = mutant_of_text(good.decode(), np.random.default_rng(seed))
        path.write_bytes(raw)
        seen[judged(partial(require, path, raw), path, f"{form}, seed {seed}, {kind}")] += raw != good
    return seen


@pytest.mark.parametrize("form", GOOD)
def test_the_good_file_is_read_as_it_stands(form: str, tmp_path: Path) -> None:
    ending, make, require = GOOD[form]
    good, path = make(tmp_path), tmp_path / f"mutant.{ending}"
    path.write_bytes(good)
    require(path, good)


@pytest.mark.parametrize("form", GOOD)
def test_a_mutant_is_refused_or_read_as_it_stands(form: str, tmp_path: Path) -> None:
    seen = survey(form, tmp_path, FEW, 0)
    assert seen["refused"] > FEW / 4
    assert seen["read"] > FEW / 50


# --- every reader -------------------------------------------------------------------------------------------
def survey_any(name: str, folder: Path, count: int, first_seed: int) -> Counter[str]:
    path, seen = sample_file(name, folder), Counter[str]()
    good, binary = path.read_bytes(), SAMPLES[name].ending in ("rec", "nc")
    for seed in range(first_seed, first_seed + count):
        rng = np.random.default_rng(seed)
        kind, raw = mutant_of_bytes(good, rng) if binary else mutant_of_text(good.decode(), rng)
        path.write_bytes(raw)
        seen[judged(partial(SAMPLES[name].read, path), folder, f"{name}, seed {seed}, {kind}")] += 1
    return seen


@pytest.mark.filterwarnings("ignore:.*not readable and left out")
@pytest.mark.filterwarnings("ignore:.*does not name the axis")
@pytest.mark.parametrize("name", SAMPLES)
def test_a_mutant_of_any_file_is_refused_with_an_error_of_mgdd(name: str, tmp_path: Path) -> None:
    assert survey_any(name, tmp_path, 40, 0)["refused"] > 0
