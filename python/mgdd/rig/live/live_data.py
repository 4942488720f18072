"""What the live page shows: traces by unit, the state of the gate, the estimate of a seeker, histograms of times."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mgdd import _core
from mgdd._core.rig import Frame
from mgdd.results.labels import named_label
from mgdd.rig.can.link import Inbox
from mgdd.rig.can.signal_map import SignalMap
from mgdd.rig.live.record_tail import News

EDGES_US = np.logspace(-1, 7, 65)  # eight bins per decade, as the loop of the core counts
_MOST_ROWS = 1 << 19
_MOST_PANELS, _MOST_LINES = 8, 6
_STATES, _REASONS = tuple(_core.rig.safety_states), tuple(_core.rig.safety_reasons)
_OF_PARTS = {"input": "asked", "applied": "applied", "limit": "limited", "estimate": "estimate"}
_HIDDEN = frozenset(
    "cycle missed mode cause send_result bus_state request good_frames bad_frames fresh bridge_open lateness_us "
    "compute_us age_us misfire".split()
)
_DUTIES = {"duty": "duty", "asked_duty": "duty of the controller", "applied_duty": "duty of the node"}
_QUANTITIES = {
    "deg": "plate angle",
    "V": "voltage",
    "°CA aTDC": "crank angle",
    "bar": "pressure",
    "unit of J": "objective J",
}


class Line(NamedTuple):
    """A column that is drawn."""

    table: str
    column: int
    label: str
    sd_column: int | None = None  # of its standard deviation: an interval is drawn


class Table:
    """Rows over time; beyond half a million the older half is dropped."""

    def __init__(self, columns: list[str]) -> None:
        self.columns = columns
        self.rows = 0
        self.time_s = np.empty(1024)
        self.values = np.empty((1024, len(columns)))
        self.given = np.zeros(len(columns), bool)  # whether a column ever had a number other than those of a flag

    def add(self, time_s: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Append rows."""
        need = self.rows + len(time_s)
        if need > len(self.time_s):
            keep = slice(self.rows // 2 if need > _MOST_ROWS else 0, self.rows)
            kept_s, kept = self.time_s[keep], self.values[keep]
            self.rows = len(kept_s)
            need = self.rows + len(time_s)
            self.time_s, self.values = np.empty(2 * need), np.empty((2 * need, len(self.columns)))
            self.time_s[: self.rows], self.values[: self.rows] = kept_s, kept
        self.time_s[self.rows : need], self.values[self.rows : need] = time_s, values
        self.given |= (np.isfinite(values) & (values != 0.0) & (values != 1.0)).any(axis=0)
        self.rows = need

    def since(self, from_s: float, column: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give time and values of a column from a time on."""
        first = int(np.searchsorted(self.time_s[: self.rows], from_s))
        return self.time_s[first : self.rows], self.values[first : self.rows, column]


@dataclass
class LiveData:
    """Takes what a record gained, or frames of a bus, and gives it ready to be drawn."""

    signal_map: SignalMap | None = None
    tables: dict[str, Table] = field(default_factory=dict)
    counts: dict[str, NDArray[np.int64]] = field(default_factory=dict)  # by name of a time, over EDGES_US
    largest_us: dict[str, float] = field(default_factory=dict)
    missed: int = 0  # deadlines
    gate: str = ""  # mode
    reason: str = ""
    cause: str = ""  # what is wrong now
    events: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=6))
    frames: int = 0
    last_commands: dict[str, bytes] = field(default_factory=dict)  # payloads by message, of a bus
    version: int = 0

    def __post_init__(self) -> None:
        self._inbox = None if self.signal_map is None else Inbox(self.signal_map)
        self._before_ns: dict[str, int] = {}

    @property
    def end_s(self) -> float:
        """Time of the last row."""
        return max((float(table.time_s[table.rows - 1]) for table in self.tables.values()), default=0.0)

    def take(self, news: News, start_ns: int) -> None:
        """Take what is new; times count from the start of the record."""
        if news.restarted:
            self.__init__(self.signal_map)  # type: ignore[misc]
        for name, (columns, stamps, values) in news.rows.items():
            self._add(name, columns, stamps, values, start_ns)
        for stamp, category, text in news.events:
            self.events.append(((stamp - start_ns) * 1e-9, f"{category}: {text}"))
            if category == "safety gate":
                self.gate, _, self.reason = text.rpartition(" -> ")[2].partition(": ")
            elif category == "guard":  # of an engine: it reports what it held back
                self.gate, self.reason = category, text
        self.frames += len(news.frames)
        if self._inbox is not None and not {"loop", "rig"} & self.tables.keys():
            self._receive(self._inbox, news.frames, start_ns)
        self.version += bool(news.rows or news.events or news.frames or news.restarted)

    def _receive(self, inbox: Inbox, frames: list[Frame], start_ns: int) -> None:
        """Read frames by the map: a row per cycle."""
        signal_map = inbox.map
        commands = {m.key: m for m in signal_map.commands.values()}
        rows: list[tuple[int, dict[str, float]]] = []
        for frame in frames:
            inbox.take(frame)
            command = commands.get((frame.id, frame.extended))
            if command is not None and len(frame.data) == command.message.size:
                self.last_commands[command.name] = frame.data
            while inbox.ready:
                stamp, measured = inbox.read()
                asked = {n: v for m in commands.values() if m.name in self.last_commands
                         for n, v in m.read(self.last_commands[m.name]).items()}  # fmt: skip
                row = {f"input.{name}": value for name, value in asked.items()}
                row |= {f"value.{name}": value for name, value in measured.values.items()}
                rows.append((stamp, row | {f"applied.{name}": value for name, value in measured.applied.items()}))
        self.gate = inbox.state or self.gate
        if rows:
            names = [f"{part}.{name}" for name in signal_map.input_names for part in ("input", "applied")]
            names += [f"value.{name}" for name in signal_map.value_names]
            values = np.array([[row.get(name, math.nan) for name in names] for _, row in rows])
            self._add("bus", names, np.array([stamp for stamp, _ in rows]), values, start_ns)
            troubles = [name for name in signal_map.value_names if name.startswith(("wrong_", "command_"))]
            last = rows[-1][1]
            self.cause = ", ".join(name for name in troubles if last.get(f"value.{name}") == 1.0) or "none"

    def _add(
        self, name: str, columns: list[str], stamps: NDArray[np.int64], values: NDArray[np.float64], start_ns: int
    ) -> None:
        table = self.tables.get(name)
        if table is None or table.columns != columns:
            table = self.tables[name] = Table(columns)
        table.add(np.asarray((stamps - start_ns) * 1e-9, np.float64), values)
        if name == "loop":
            of = dict(zip(columns, values.T, strict=True))
            for what, label in (("lateness_us", "lateness"), ("compute_us", "computing")):
                if what in of:
                    self._count(label, of[what])
            self.missed += int(np.nansum(of.get("missed", 0.0)))
            self.gate = _named(_STATES, of.get("mode"), self.gate)
            self.cause = _named(_REASONS, of.get("cause"), self.cause)
        elif name in ("rig", "bus"):
            before = self._before_ns.get(name, int(stamps[0]))
            gaps = np.diff(np.r_[before, stamps])[0 if name in self._before_ns else 1 :]
            self._count("time between cycles", gaps * 1e-3)
            self._before_ns[name] = int(stamps[-1])

    def _count(self, name: str, times_us: NDArray[np.float64]) -> None:
        times_us = times_us[np.isfinite(times_us)]
        if times_us.size:
            inside = np.clip(times_us, EDGES_US[0], EDGES_US[-1])
            counted = np.histogram(inside, EDGES_US)[0].astype(np.int64)
            self.counts[name] = self.counts.get(name, 0) + counted
            self.largest_us[name] = max(self.largest_us.get(name, 0.0), float(times_us.max()))

    def quantile_us(self, name: str, share: float) -> float:
        """Give the upper edge of the bin in which a share of the times ends."""
        total = np.cumsum(self.counts[name])
        return float(min(EDGES_US[1 + int(np.searchsorted(total, share * total[-1]))], self.largest_us[name]))

    def panels(self) -> dict[str, list[Line]]:
        """Give the lines by the label of their axis; a rig whose loop reports itself is not shown twice."""
        names: list[str] = [n for n in ("seeker", "loop", "rig", "bus") if n in self.tables]
        names += [n for n in self.tables if n not in names]
        if "loop" in names and "rig" in names:
            names.remove("rig")
        panels: dict[str, list[Line]] = {}
        for name in names:
            columns, given = self.tables[name].columns, self.tables[name].given
            limited = {c.partition(".")[2] for c in columns if c.startswith("limit.")}
            for place, column in enumerate(columns):
                part, dot, own = column.partition(".")
                base = own if dot and part in {*_OF_PARTS, "value", "component"} else column
                double = part == "value" and own in limited
                if not given[place] or base in _HIDDEN or part in ("noise_free", "estimate_sd") or double:
                    continue
                axis, label = _axis(part, base)
                sd = columns.index(f"estimate_sd.{own}") if part == "estimate" else None
                lines = panels.get(axis)
                if lines is None and len(panels) < _MOST_PANELS:
                    lines = panels[axis] = []
                if lines is not None and len(lines) < _MOST_LINES:
                    how = _OF_PARTS.get(part, "")
                    lines.append(Line(name, place, f"{label}, {how}" if how else label, sd))
        return panels


def _axis(part: str, base: str) -> tuple[str, str]:
    """Give the label of the axis that a column belongs to, and its own."""
    if part == "component":
        return "objective J [unit of J]", f"component {base}"
    label = named_label(base)
    long = label.long_name.strip() or base
    if base in _DUTIES:
        return "duty [-]", _DUTIES[base]
    if label.units in ("-", ""):
        return f"{base} [-]", long
    if label.units == "°CA aTDC" and part in _OF_PARTS:
        return "timing [°CA aTDC]", long
    if base.startswith("imep_"):
        return "IMEP [bar]", long
    what = _QUANTITIES.get(label.units) or long.partition(",")[0]
    return f"{what} [{label.units}]", long


def _named(names: tuple[str, ...], codes: NDArray[np.float64] | None, before: str) -> str:
    if codes is None or not math.isfinite(codes[-1]) or not 0 <= codes[-1] < len(names):
        return before
    return names[int(codes[-1])]


def thinned(
    time_s: NDArray[np.float64], values: NDArray[np.float64], buckets: int = 300
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep the smallest and the largest value of each bucket: no peak is lost. Inputs of any length, shape (n,)."""
    each = len(values) // buckets
    if each <= 2:
        return time_s, values
    first = len(values) - each * buckets
    blocks = values[first:].reshape(buckets, each)
    gaps = np.isnan(blocks)
    low = np.where(gaps, np.inf, blocks).argmin(axis=1)
    high = np.where(gaps, -np.inf, blocks).argmax(axis=1)
    place = np.sort(np.stack([low, high], axis=1), axis=1) + np.arange(buckets)[:, None] * each + first
    return time_s[place.ravel()], values[place.ravel()]
