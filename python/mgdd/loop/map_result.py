"""Result of a search for a map: the maps, what is known of each cell, every visit, and reasons to doubt it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from mgdd.errors import ParameterError, argument
from mgdd.loop.lower_limits import plain_name
from mgdd.maps import CalibrationMap
from mgdd.maps.cells import MapTask
from mgdd.optimize.inputs import unit_of_input
from mgdd.optimize.map_driver import nearest_cell
from mgdd.results.describe import Row
from mgdd.results.finding import Finding, findings_html
from mgdd.results.labels import labelled_dataset, named_label
from mgdd.results.result import Result, merged

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from mgdd.optimize.map_driver import MapDriver
    from mgdd.optimize.map_seeking import MapSeeking

_NOTHING = 0.3  # share of the guide below which it explains as good as nothing
_HELD = 0.02  # shares of a limit: nearer than that it holds the cell back


class Visit(NamedTuple):
    """One visit: where, and what was read there.

    Parameters
    ----------
    at, inputs : dict of str to float
        Operating point, and inputs as they were really applied.
    j : float
        Mean of J; NaN where the visit failed.
    limits : dict of str to float
        Means of the limited quantities.
    readings : float
        Cycles behind them.
    failed : bool
        Half of the cycles or more failed.
    sd : dict of str to float
        Standard deviations of a cycle within the visit, of ``"j"`` and the limits; 0 where it has one cycle.
    """

    at: dict[str, float]
    inputs: dict[str, float]
    j: float
    limits: dict[str, float]
    readings: float
    failed: bool
    sd: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapSearch(Result):
    """What `seek_map` has found.

    Attributes
    ----------
    maps : mapping of str to CalibrationMap
        The best of every input; cells hold ``sd``, ``objective``, ``support`` (visits), ``regret``, the limit that
        holds them, and ``NAME_holds``, the probability of each limit.
    cells : xarray.Dataset
        All of it over the axes, as `MapSeeking.cells`.
    visits : tuple of Visit
        In their order.
    findings : tuple of Finding
        Reasons to doubt the map.
    seeker : MapSeeking
        Goes on where the search ended: ``seek_map(plant, ..., seeker=found)``, or ``seeker.ask(point)`` as the
        engine is driven; `driven` then gives the map.
    """

    cells: xr.Dataset
    visits: tuple[Visit, ...]
    maps: Mapping[str, CalibrationMap]
    findings: tuple[Finding, ...]
    seeker: MapSeeking

    @classmethod
    def of(cls, seeker: MapSeeking, visits: Sequence[Visit], *, tolerance: float | None, interrupted: bool) -> Self:
        """Read the map of a seeker."""
        cells = seeker.cells()
        findings = tuple(_doubts(seeker, cells, visits, tolerance, interrupted=interrupted))
        return cls(
            cells=cells, visits=tuple(visits), maps=_maps(seeker, cells, visits), findings=findings, seeker=seeker
        )

    @property
    def map(self) -> CalibrationMap:
        """The map of the only input; ParameterError where there are several, or more than two axes."""
        if len(self.maps) != 1:
            have = ", ".join(self.maps) or "none: a CalibrationMap has one or two axes"
            raise ParameterError(f"map: there are several, {have}: take one from .maps")
        return next(iter(self.maps.values()))

    def driven(self, driver: MapDriver) -> Self:
        """Give the map as it is known after the engine was driven.

        Parameters
        ----------
        driver : MapDriver
            Of this search, ``found.seeker.driver()``.

        Returns
        -------
        MapSearch
            Cells near which it was driven have the source ``learned`` and its readings beside their visits as
            ``support``; the provenance says how many cycles there were.
        """
        made = type(self).of(driver.search, self.visits, tolerance=None, interrupted=False)
        there = driver.readings > 0.0
        maps = {}
        for name, table in made.maps.items():
            learnt = there & (table.cells["source"] == "optimised")
            cells = {
                "source": np.where(learnt, "learned", table.cells["source"]),
                "support": table.cells["support"] + driver.readings,
            }
            maps[name] = table.replaced(cells=cells, provenance={"driven": f"{driver.readings.sum():g} cycles"})
        return dataclasses.replace(made, maps=maps)

    @property
    def regret(self) -> float:
        """By how much J of the true best is expected to be above that of the map, mean of the cells [unit of J]."""
        return float(self.cells["regret"].mean())

    @property
    def dataset(self) -> xr.Dataset:
        """The cells over the axes, and the visits over ``visit``."""
        own = self.seeker.settings
        columns: dict[str, Any] = {"visit": ("visit", np.arange(1, len(self.visits) + 1), "-", "visit")}
        for name in self.seeker.axes:
            columns[f"visit_{name}"] = ("visit", [one.at[name] for one in self.visits], *named_label(name))
        for one in own["inputs"]:
            values = [each.inputs[one.name] for each in self.visits]
            columns[f"visit_{one.name}"] = ("visit", values, unit_of_input(one), named_label(one.name).long_name)
        columns["visit_j"] = ("visit", [one.j for one in self.visits], "unit of J", "objective as read")
        for name in self.seeker.limit_names:
            label = named_label(plain_name(name)[0])
            columns[f"visit_{name}"] = ("visit", [one.limits[name] for one in self.visits], *label)
            columns[f"visit_{name}_sd"] = (
                "visit", [one.sd[name] for one in self.visits], label.units, f"{label.long_name}, of a cycle in a visit"
            )  # fmt: skip
        scatter = [one.sd["j"] for one in self.visits]
        columns["visit_j_sd"] = ("visit", scatter, "unit of J", "objective, standard deviation of a cycle in a visit")
        columns["visit_readings"] = ("visit", [one.readings for one in self.visits], "-", "cycles averaged")
        columns["visit_failed"] = ("visit", [float(one.failed) for one in self.visits], "-", "whether it failed")
        return merged(self.cells, labelled_dataset(columns))

    def to_dict(self) -> dict[str, Any]:
        """Give what matters as plain values."""
        return {
            "visits": len(self.visits),
            "regret": self.regret,
            "axes": {name: column.tolist() for name, column in self.seeker.axes.items()},
            "inputs": {name: self.cells[name].values.tolist() for name in self.seeker.input_names},
            "expected_j": self.cells["j"].values.tolist(),
            "trust": self.seeker.trust,
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def _title(self) -> str:
        size = " x ".join(f"{column.size} {name}" for name, column in self.seeker.axes.items())
        return f"Map of {', '.join(self.seeker.input_names)} over {size}, {len(self.visits)} visits"

    def _rows(self) -> list[Row]:
        cells = self.cells["regret"]
        mean, most = float(cells.mean()), float(cells.max())
        rows = [Row("expected regret", f"mean {mean:.3g}, largest {most:.3g}", "unit of J")]
        if self.seeker.settings["guide"]:
            rows.append(Row("share of the guide", f"{self.seeker.trust:.2f}", "-"))
        return [*rows, *(Row("finding", str(finding), "-") for finding in self.findings)]

    def _repr_html_(self) -> str:
        return super()._repr_html_() + findings_html("Findings", self.findings)

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot import map_cells

        if not self.maps:
            return super()._draw(ax)
        return map_cells(next(iter(self.maps.values())), ax=ax)


def _maps(seeker: MapSeeking, cells: xr.Dataset, visits: Sequence[Visit]) -> dict[str, CalibrationMap]:
    axes = seeker.axes
    if len(axes) > 2:
        return {}
    own = seeker.settings
    counts = _counts(axes, visits)
    excess = cells["excess"].to_numpy()
    known: dict[str, Any] = {
        "objective": cells["j"].to_numpy(), "support": counts, "regret": cells["regret"].to_numpy(),
        "active_limit": _active(cells), "source": np.where(excess <= 0.0, "optimised", "extrapolated"),
    }  # fmt: skip
    labels = {"regret": ("unit of J", "expected regret")}
    for k, name in enumerate(seeker.limit_names):
        column = f"{name.lstrip('-')}_holds"
        known[column] = cells["holds"].to_numpy()[..., k]
        labels[column] = ("-", f"probability that the limit of {name.lstrip('-')} holds")
    task = MapTask(
        objective="j", limits={limit.name: limit.upper - limit.margin for limit in own["limits"]},
        maximize=own["maximize"],
    )  # fmt: skip
    return {
        one.name: CalibrationMap(
            axes, cells[one.name].to_numpy(), name=one.name, labels={one.name: _label(one), **labels}, task=task,
            cells={**known, "sd": cells[f"{one.name}_sd"].to_numpy()},
            provenance={"from": f"search with {len(visits)} visits"},
        )
        for one in own["inputs"]
    }  # fmt: skip


def _label(one: Any) -> tuple[str, str]:
    return unit_of_input(one), named_label(one.name).long_name


def _counts(axes: Mapping[str, Any], visits: Sequence[Visit]) -> Any:
    """Count the visits whose nearest cell each is."""
    counts = np.zeros(tuple(column.size for column in axes.values()))
    for one in visits:
        counts[nearest_cell(axes, one.at)] += 1.0
    return counts


def _active(cells: xr.Dataset) -> Any:
    """Name the limit that holds each cell back, empty where none does."""
    shape = cells["excess"].shape
    if "holds" not in cells:
        return np.full(shape, "")
    least = np.argmin(cells["holds"].to_numpy(), axis=-1)
    names = np.array([str(name) for name in cells["limit"].to_numpy()])
    return np.where(cells["excess"].to_numpy() > -_HELD, names[least], "")


def _doubts(
    seeker: MapSeeking, cells: xr.Dataset, visits: Sequence[Visit], tolerance: float | None, *, interrupted: bool
) -> list[Finding]:
    out = list[Finding]()
    axes = seeker.axes
    if interrupted:
        out.append(Finding("interrupted", (), f"ended after {len(visits)} visits", "give its seeker to go on"))
    if not any(not one.failed for one in visits):
        return [*out, Finding("no_reading", (), "no visit gave a reading", "look at the plant")]
    excess = cells["excess"].to_numpy()
    unsafe = [_where(axes, place) for place in np.argwhere(excess > 0.0)]
    if len(unsafe) == excess.size:
        text, remedy = "no cell has inputs that are known to keep the limits", "take more visits, or widen the bounds"
        out.append(Finding("no_safe_input", (), text, remedy))
    elif unsafe:
        text = f"{len(unsafe)} cells have no inputs that are known to keep the limits: {'; '.join(unsafe[:4])}"
        out.append(Finding("no_safe_input", tuple(unsafe), text, "take more visits, or widen the bounds there"))
    held = _active(cells)
    for name in seeker.limit_names:
        if excess.size > 1 and (held == name).all():
            text = f"{plain_name(name)[0]} holds every cell back"
            out.append(Finding("limit_everywhere", (plain_name(name)[0],), text, "see whether its value is meant"))
    regret = float(cells["regret"].max())
    if tolerance is not None and not regret <= tolerance:
        text = f"a cell may be short of its best by {regret:.3g}, more than {tolerance:g}"
        out.append(Finding("not_converged", (), text, "take more visits"))
    if seeker.settings["guide"] and seeker.trust < _NOTHING:
        text = f"the guide explains {seeker.trust:.0%} of what was read"
        out.append(Finding("guide_explains_nothing", (), text, "leave it out, or look at its sign and its units"))
    if failed := sum(one.failed for one in visits):
        text = f"{failed} of {len(visits)} visits failed"
        out.append(Finding("failed_visits", (), text, "look at the engine there, or narrow the bounds"))
    if seeker.doubts:
        text = f"readings were not explained by earlier ones, {seeker.doubts} times"
        out.append(Finding("unexplained", (), text, "look at what else changes; the newest readings count"))
    return [*out, *_start_above(seeker, visits[0])]


def _start_above(seeker: MapSeeking, first: Visit) -> Iterator[Finding]:
    own = seeker.settings
    low = "the guide says too little of it there: narrow the bounds, or set a limit that leaves room"
    remedy = low if own["guide"] else f"give {argument('start')} where it holds"
    for limit in own["limits"]:
        (name, side), value = plain_name(limit.name), first.limits[limit.name]
        if value > limit.upper:
            what = "above its" if side > 0.0 else "below its lower"
            text = f"the first reading of {name}, {side * value:.6g}, is {what} limit, {side * limit.upper:.6g}"
            yield Finding("start_above_limit", (name,), text, remedy)


def _where(axes: Mapping[str, Any], place: Any) -> str:
    return ", ".join(f"{name} = {column[k]:g}" for (name, column), k in zip(axes.items(), place, strict=True))
