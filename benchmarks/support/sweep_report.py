"""Tables and bars of `sweep_speed.py`: pure functions of measured times."""

from __future__ import annotations

import statistics
from dataclasses import asdict, dataclass
from typing import Any

Rows = dict[str, dict[str, float]]
# Cycles/s on one core with AVX2, then how many times faster than each contender's fastest form.
BARS: dict[str, dict[str, float]] = {
    "timing sweep": {"rate": 4e6, "literal": 40.0, "jax": 12.0, "numba": 25.0},
    "arbitrary points": {"rate": 0.8e6, "literal": 12.0, "jax": 3.0, "numba": 6.0},
}
BARS["many arbitrary points"] = BARS["arbitrary points"]


@dataclass(frozen=True)
class Bar:
    """One bar: what was wanted, what was measured at the smallest times and at the medians; None if not measured."""

    task: str
    what: str
    wanted: float
    at_min: float | None
    at_median: float | None

    @property
    def verdict(self) -> str:
        """Met or not, by the smallest times."""
        if self.at_min is None:
            return "not measured"
        return "met" if self.at_min >= self.wanted else "NOT MET"


def rows_of(times_us: dict[str, list[float]], worst: dict[str, float], first_s: dict[str, float]) -> Rows:
    """Return the figures of each contender."""
    return {
        name: {
            "min_us": min(values),
            "median_us": statistics.median(values),
            "worst_difference": worst[name],
            "first_call_s": first_s[name],
        }
        for name, values in times_us.items()
    }


def fastest(rows: Rows, prefix: str) -> str | None:
    """Name of the fastest row that begins so."""
    names = [name for name in rows if name.startswith(prefix)]
    return min(names, key=lambda name: rows[name]["min_us"], default=None)


def bars(tables: dict[str, Rows], *, ours: str, literal: str, jax: str, numba: str) -> list[dict[str, Any]]:
    """Return every bar of the tables, with its verdict."""
    found = []
    for task, rows in tables.items():
        mine = rows[ours]
        wanted = BARS[task]
        found.append(Bar(task, "cycles/s", wanted["rate"], 1e6 / mine["min_us"], 1e6 / mine["median_us"]))
        for key, prefix in (("literal", literal), ("jax", jax), ("numba", numba)):
            name = fastest(rows, prefix)
            times = None if name is None else rows[name]
            ratios = [None if times is None else times[at] / mine[at] for at in ("min_us", "median_us")]
            found.append(Bar(task, f"times faster than {name or prefix}", wanted[key], *ratios))
    return [{**asdict(bar), "verdict": bar.verdict} for bar in found]


def print_table(title: str, rows: Rows, ours: str = "mgdd, batch", literal: str = "C++ literal") -> None:
    mine, printed = rows[ours]["min_us"], rows.get(literal, {}).get("min_us", float("nan"))
    print(f"\n{title}")
    head = ("min us", "median us", "cycles/s", "x literal C++", "ours is x", "differs", "first call s")
    print(f"{'contender':26s}" + "".join(f"{word:>14s}" for word in head))
    for name, row in rows.items():
        best = row["min_us"]
        numbers = (f"{best:.3f}", f"{row['median_us']:.3f}", f"{1e6 / best:,.0f}", f"{printed / best:.2f}")
        numbers += (f"{best / mine:.1f}", f"{row['worst_difference']:.0e}", f"{row['first_call_s']:.2f}")
        print(f"{name:26s}" + "".join(f"{word:>14s}" for word in numbers))


def print_bars(found: list[dict[str, Any]], instruction_set: str) -> None:
    print(f"\nbars, stated for one core with AVX2; this run: {instruction_set}")
    for bar in found:
        seen = "" if bar["at_min"] is None else f"{bar['at_min']:,.4g} (medians {bar['at_median']:,.4g})"
        print(f"{bar['task']:22s} {bar['what']:44s} wanted {bar['wanted']:>11,.4g}  {bar['verdict']:13s} {seen}")
