"""Damaged records: read up to the damage, repaired behind it, and both say what is missing."""

from __future__ import annotations

import re
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from file_mutants import judged, mutant_of_bytes
from mgdd.rig import read_record, repair_record
from recorded_rig import independent, write


def samples_in(bodies: list[tuple[Any, ...]]) -> list[tuple[int, str, tuple[str, ...], bytes]]:
    """Give stamp, table, names and numbers of every sample, each with the names that stand before it."""
    names: dict[tuple[int, int], list[str]] = {}
    found = []
    for body in bodies:
        if body[0] == "columns":
            names[body[1], len(body[3]) - 1] = body[3]
        elif body[0] == "sample":
            size = len(body[3])
            unnamed = [f"table_{body[1]}", *(f"value_{k}" for k in range(size))]
            table, *columns = names.get((body[1], size), unnamed)
            found.append((body[2], table, tuple(columns), np.array(body[3]).tobytes()))
    return found


def require_record(path: Path) -> None:
    """Compare what `read_record` gives with what stands in the file up to its first damage."""
    run = read_record(path)
    header, *bodies, (_, ignored) = independent(path)
    assert run.run_id == header[1].hex()
    assert run.ignored_bytes == ignored
    assert (ignored == 0) == ("not readable" not in run.summary())
    found = []
    for name, table in run.samples.items():
        columns = tuple(str(column) for column in table.data_vars)
        stamps = np.rint(table["time_s"].values * 1e9).astype(int) + header[3]
        rows = np.column_stack([*(table[column].values for column in columns)])
        plain = re.sub(r"_\d+$", "", name) if name not in ("table_0", "table_1") else name
        found += [(s, plain, columns, row.tobytes()) for s, row in zip(stamps.tolist(), rows, strict=True)]
    known = samples_in(bodies)
    assert Counter(row[1:] for row in found) == Counter(row[1:] for row in known)
    assert max([abs(a[0] - b[0]) for a, b in zip(sorted(found), sorted(known), strict=True)], default=0) < 1e4
    events = [(body[2], body[3]) for body in bodies if body[0] == "event"]
    assert [*zip(run.events["category"].values.tolist(), run.events["text"].values.tolist(), strict=True)] == events
    frames = [(body[4], body[7]) for body in bodies if body[0] == "frame"]
    sizes, remote = run.frames["size"].values, run.frames["remote"].values
    payloads = [
        b"" if only else row.tobytes()[:size]
        for row, size, only in zip(run.frames["data"].values, sizes, remote, strict=True)
    ]
    assert [*zip(run.frames["id"].values.tolist(), payloads, strict=True)] == frames


def pieces(raw: bytes) -> tuple[bytes, list[bytes]]:
    """Split a good record into its header and its records."""
    at = 52 + int.from_bytes(raw[12:16], "little")
    header, parts = raw[:at], []
    while at < len(raw):
        end = at + 8 + int.from_bytes(raw[at : at + 4], "little")
        parts.append(raw[at:end])
        at = end
    return header, parts


def require_repair(path: Path, raw: bytes, good: bytes, whole: list[tuple[int, str, tuple[str, ...], bytes]]) -> bool:
    """Repair a copy: nothing intact is lost, nothing is named wrongly, and what was damaged is said."""
    told = repair_record(path, path.with_name("repaired.rec"))
    mended = path.with_name("repaired.rec").read_bytes()
    header, parts = pieces(good)
    assert told["header_lost"] == (not raw.startswith(header))
    for part in set(parts):
        assert mended.count(part) >= raw.count(part)
    run = read_record(path.with_name("repaired.rec"))
    assert (run.ignored_bytes, run.damaged_bytes) == (0, told["damaged_bytes"])
    assert (told["damaged_bytes"] > 0) == (told["places"] > 0)
    require_record(path.with_name("repaired.rec"))
    by_bytes = {row[::3]: row for row in whole}
    for stamp, table, columns, values in samples_in([*independent(path.with_name("repaired.rec"))][1:-1]):
        _, known, names, _ = by_bytes[stamp, values]
        assert (table, columns) == (known, names) or table.startswith("table_")
    return bool(told["damaged_bytes"] or told["header_lost"])


def survey_records(folder: Path, count: int, first_seed: int) -> Counter[str]:
    write(folder / "good.rec")
    good, path, seen = (folder / "good.rec").read_bytes(), folder / "mutant.rec", Counter[str]()
    whole = samples_in([*independent(folder / "good.rec")][1:-1])
    for seed in range(first_seed, first_seed + count):
        kind, raw = mutant_of_bytes(good, np.random.default_rng(seed))
        path.write_bytes(raw)
        seen[judged(partial(require_record, path), path, f"seed {seed}, {kind}")] += 1
        seen[judged(partial(require_repair, path, raw, good, whole), path, f"repair, seed {seed}, {kind}")] += 1
    return seen


def test_a_damaged_record_is_read_up_to_its_damage_and_repaired_behind_it(tmp_path: Path) -> None:
    seen = survey_records(tmp_path, 25, 0)
    assert min(seen["read"], seen["refused"]) > 5
