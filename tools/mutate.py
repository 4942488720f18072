"""Change single lines of one module at random and count how many of the changes the tests notice.

Run `python tools/mutate.py throttle` for a C++ module, `python tools/mutate.py mgdd.throttle` for a Python one, or
`make mutants MODULE=...`. A sample of lines, one change each; nothing outside build/mutants is written. A run that was
ended goes on where it stood; after a change of the tests only the survivors are tried again. What cannot be noticed
stands in tools/equivalent_mutants.toml, with the reason.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import math
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

from mutant_runs import Cpp, Outcome, Python, Runner, fingerprint
from mutants import Mutant, sample

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "mutants"
LISTED = Path(__file__).with_name("equivalent_mutants.toml")


def interval(share: float, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of n (Wilson 1927)."""
    z = 1.959964
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def listed() -> tuple[list[re.Pattern[str]], set[tuple[str, str, str]]]:
    """Return the lines that are left alone, and the changes that no test can notice."""
    told = tomllib.loads(LISTED.read_text(encoding="utf-8"))
    skip = [re.compile(row["pattern"]) for row in told.get("skip", [])]
    return skip, {(row["path"], row["before"], row["after"]) for row in told.get("equivalent", [])}


class Ledger:
    """Results by mutant, saved after each; a result holds while its source stands, a survival while the tests stand."""

    def __init__(self, path: Path, tests: str) -> None:
        self._path, self._tests = path, tests
        self._sources: dict[str, str] = {}
        rows = json.loads(path.read_text(encoding="utf-8"))["mutants"] if path.exists() else []
        self._rows = {
            (row["path"], row["line"], row["after"]): row for row in rows if row["source"] == self._source(row["path"])
        }

    def _source(self, name: str) -> str:
        if name not in self._sources:
            self._sources[name] = fingerprint([ROOT / name]) if (ROOT / name).exists() else ""
        return self._sources[name]

    def find(self, mutant: Mutant) -> dict[str, Any] | None:
        """Return a result that still holds."""
        row = self._rows.get((mutant.path, mutant.line, mutant.after))
        return None if row is None or (row["status"] == "survived" and row["tests"] != self._tests) else row

    def add(self, mutant: Mutant, outcome: Outcome) -> dict[str, Any]:
        """Keep a result."""
        row = {**vars(mutant), **vars(outcome), "source": self._source(mutant.path), "tests": self._tests}
        self._rows[mutant.path, mutant.line, mutant.after] = row
        return row

    def save(self, head: dict[str, Any], rows: Sequence[dict[str, Any]]) -> None:
        """Write the sample, and behind it what other samples have found."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        others = [row for row in self._rows.values() if row not in rows]
        text = json.dumps({**head, "mutants": [*rows, *others]}, indent=1, ensure_ascii=False)
        fresh = self._path.with_suffix(".new")
        fresh.write_text(text + "\n", encoding="utf-8")
        fresh.replace(self._path)


def summary(module: str, seed: int, rows: Sequence[dict[str, Any]], equivalent: int) -> dict[str, Any]:
    """Return the counts of a sample."""
    count = Counter(row["status"] for row in rows)
    n = count["killed"] + count["timeout"] + count["survived"]
    share = (n - count["survived"]) / n if n else math.nan
    return {
        "module": module,
        "seed": seed,
        "n": n,
        **{status.replace(" ", "_"): count[status] for status in ("killed", "timeout", "survived", "not compiled")},
        "equivalent": equivalent,
        "share": round(share, 4) if n else None,
        "interval_95": [round(edge, 3) for edge in interval(share, n)] if n else [0.0, 1.0],
    }


def show(row: dict[str, Any]) -> str:
    """Return a row in three lines."""
    return f"{row['path']}:{row['line']}  {row['kind']}\n  - {row['before'].strip()}\n  + {row['after'].strip()}"


def table(head: dict[str, Any], rows: Sequence[dict[str, Any]]) -> str:
    """Return the result for people."""
    lines = [show(row) for row in rows if row["status"] == "survived"]
    names = ("module", "n", "killed", "timeout", "survived", "not_compiled", "equivalent")
    low, high = head["interval_95"]
    values = [
        *(str(head[name]) for name in names),
        f"{100 * (head['share'] or 0):.0f} %",
        f"{100 * low:.0f} to {100 * high:.0f} %",
    ]
    heads = [*(name.replace("_", " ") for name in names), "share", "95 % interval"]
    widths = [max(len(a), len(b)) for a, b in zip(heads, values, strict=True)]
    out = ["  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) for cells in (heads, values)]
    return "\n".join([*(["survivors:", *lines, ""] if lines else []), *out])


def _alone(scratch: Path) -> IO[str]:
    """Keep other runs out of the copy as long as the file stays open."""
    scratch.mkdir(parents=True, exist_ok=True)
    lock = (scratch / ".lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        raise RuntimeError(f"another run uses {scratch}: wait for its end") from None
    return lock


def main() -> int:
    """Run a sample; the exit code tells whether it could run, not how many survive."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("module", help="throttle, engine, ... (C++) or mgdd.throttle, ... (Python)")
    parser.add_argument("-n", type=int, default=40, help="mutants that compile (default 40)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="compilers at once")
    parser.add_argument("--file", default="", help="only sources whose path holds this")
    parser.add_argument("--also", action="append", default=[], help="further module whose tests try the survivors")
    parser.add_argument("--list", action="store_true", help="show the sample and stop")
    args = parser.parse_args()
    python = args.module.startswith("mgdd.")
    scratch = FOLDER / ("python" if python else "cpp")
    runner: Runner = (
        Python(ROOT, scratch, args.module, args.also)
        if python
        else Cpp(ROOT, scratch, args.module, jobs=args.jobs, also=args.also)
    )
    sources = [path for path in runner.sources() if args.file in path.relative_to(ROOT).as_posix()]
    if not sources:
        parser.error(f"no sources of {args.module}" + (f" with {args.file!r}" if args.file else ""))
    skip, known = listed()
    pool = sample(ROOT, sources, f"{args.module}:{args.seed}", skip)
    tried = [mutant for mutant in pool if (mutant.path, mutant.before.strip(), mutant.after.strip()) not in known]
    if args.list:
        print("\n".join(show(vars(mutant)) for mutant in tried[: args.n]))
        return 0
    ledger = Ledger(FOLDER / f"{args.module}.json", fingerprint(runner.tests()))
    rows: list[dict[str, Any]] = []
    head = summary(args.module, args.seed, rows, 0)
    lock: IO[str] | None = None
    while tried and head["n"] < args.n:
        batch, tried = tried[: args.n - head["n"]], tried[args.n - head["n"] :]
        for mutant in sorted(batch, key=lambda m: (m.path, m.line)):  # neighbours share what is built
            row = ledger.find(mutant)
            if row is None:
                if lock is None:
                    lock = _alone(scratch)
                    print(
                        f"{args.module}: {len(pool)} lines can change; preparing {scratch.relative_to(ROOT)}",
                        flush=True,
                    )
                    runner.prepare()
                row = ledger.add(mutant, runner.run(mutant))
                told = f"{row['status']:12s} {row['seconds']:5.0f} s  {mutant.path}:{mutant.line}  {mutant.kind}"
                print(f"[{len(rows) + 1:3d}] {told}" + (f"  ({row['by']})" if row["by"] else ""), flush=True)
            rows.append(row)
            head = summary(args.module, args.seed, rows, 0)
            ledger.save(head, rows)
        head["equivalent"] = pool.index(batch[-1]) + 1 - len(rows)
    ledger.save(head, rows)
    if lock is not None:
        lock.close()
    print(table(head, rows))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RuntimeError as error:
        sys.exit(f"mutate: {error}")
