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
from mgdd.maps.cells import MapTask
from mgdd.results.units import attribute_units
from mgdd.throttle import PseudoWiener
from sample_files import CONDITIONS, SAMPLES, SLOW, sample_file

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


def map_in(raw: bytes) -> tuple[dict[str, list[list[str]]], dict[str, list[list[str]]]]:
    """Give the heads by their first word, and the tables by their names, cell by cell."""
    text = text_of(raw)
    first = next(line for line in text.splitlines() if line.strip())
    mark = next((mark for mark in ";\t," if mark in first), ",")
    heads: dict[str, list[list[str]]] = {}
    tables: dict[str, list[list[str]]] = {}
    for row in csv.reader(io.StringIO(text), delimiter=mark):
        cells = [cell.strip() for cell in row]
        if not any(cells) or cells[0].startswith("#"):
            continue
        if cells[0] == "table":
            tables[cells[1]] = []
        elif tables and cells[0] != "end":
            tables[[*tables][-1]].append(cells)
        else:
            heads.setdefault(cells[0], []).append(cells[1:])
    return heads, tables


def require_map(path: Path, raw: bytes) -> None:
    table = read_map(path)
    heads, tables = map_in(raw)
    assert not {"mgdd_map", "end"} - heads.keys() or "mgdd_map" not in heads
    (value,) = heads["value"]
    axes = [heads[name][0] for name in ("rows", "columns") if name in heads]
    assert all(len(heads[name]) == 1 for name in ("rows", "columns", "objective") if name in heads)
    assert table.name == value[0]
    assert [*table.axes] == [axis[0] for axis in axes]
    for name, unit, *rest in (value, *axes):
        said = [cell for cell in rest if cell]
        assert attribute_units(table.labels[name].units) == attribute_units(unit)
        assert said in ([], [table.labels[name].long_name])
    said = [tuple(pair[:2]) for pair in heads.get("provenance", [])]
    assert sorted(said) == sorted(table.provenance.items())
    limits = {name: number(upper) for name, upper, *_ in heads.get("limit", [])}
    assert len(limits) == len(heads.get("limit", []))
    task = None if table.task is None else (table.task.objective, table.task.maximize, dict(table.task.limits))
    own = heads.get("objective", [[]])[0]
    assert task == ((own[0], own[1] == "highest", limits) if own else None)
    for name, rows in tables.items():
        body = rows
        if len(axes) == 2:
            head, *body = rows
            assert not head[0]
            assert [number(cell) for cell in head[1:] if cell] == table.axes[axes[1][0]].tolist()
        width = table.values.shape[1] if len(axes) == 2 else 1
        assert [number(row[0]) for row in body] == table.axes[axes[0][0]].tolist()
        column = table.values if name == "value" else table.cells[name]
        for row, cells in zip(body, column.reshape(-1, width).tolist(), strict=True):
            assert not any(row[1 + width :])
            said = row[1 : 1 + width] if any(row[1:]) else [""] * width
            for cell, got in zip(said, cells, strict=True):  # as many cells as there are columns
                if isinstance(got, str):
                    assert got == cell
                else:
                    assert (got == number(cell)) if cell else np.isnan(got)


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


def with_task() -> CalibrationMap:
    return CalibrationMap(
        {"fuel_mg": [6, 10.5, 20]},
        [0.25, -1.125, -4],
        name="soc_cad",
        cells={"sd": [0.1, 0.2, 0.35], "support": [3, 4, 5]},
        task=MapTask(objective="efficiency_gross", maximize=True, limits={"p_max_bar": 110.0, "nox_ppm": 500.5}),
        provenance={"from": "bench 7"},
    )


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
    "map of one axis": ("csv", lambda folder: map_text(folder, with_task()), require_map),
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
@pytest.mark.parametrize("name", [name for name in SAMPLES if name not in SLOW])
def test_a_mutant_of_any_file_is_refused_with_an_error_of_mgdd(name: str, tmp_path: Path) -> None:
    assert survey_any(name, tmp_path, 40, 0)["refused"] > 0
