"""A map of injection timing over the load steps of the measured engine: best IMEP under a limit of NOx."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.loop import seek_map
from mgdd.surrogate import fit_response
from mgdd_studies.measured_engine import SurrogatePlant, fit_surrogate
from mgdd_studies.statistics import mean_interval

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd.loop.map_result import MapSearch
    from mgdd_studies.measured_engine import EngineSurrogate

    Array = NDArray[np.float64]

__all__ = ["AXES", "NOX_PPM", "TIMING", "MapJudge", "guide_of", "held_steps", "map_rows", "sought"]

AXES = {"doi_main_ms": (0.28, 0.34, 0.40, 0.46), "doi_h2_ms": (2.7, 3.1, 3.5)}
TIMING = {"soi_cad": (-5.0, 9.5)}  # inside the records in every cell
NOX_PPM = 600.0
_TOLERANCE_PPM = 6.0
_SAFE_CAD = 8.0  # where the limit holds in the middle of the map
_HELD_CYCLES, _LAST_CYCLES = 25, 10  # NOx has settled in the last ones
_GUIDES = ("none", "25 held steps", "1500 cycles")


def held_steps(records: xr.Dataset) -> dict[str, Array]:
    """Give load and timing of every step held for 25 cycles, and means of IMEP and NOx over its last ten."""
    names = [*AXES, "soi_cad"]
    commands = np.column_stack([records[name].to_numpy() for name in names])
    starts = np.r_[0, np.flatnonzero((np.diff(commands, axis=0) != 0.0).any(axis=1)) + 1]
    ends = np.r_[starts[1:], len(commands)]
    held = ends - starts >= _HELD_CYCLES
    last = ends[held, None] - np.arange(1, _LAST_CYCLES + 1)
    means = {name: records[name].to_numpy()[last].mean(axis=1) for name in ("imep_bar", "nox_ppm")}
    return {**dict(zip(names, commands[starts[held]].T, strict=True)), **means}


def guide_of(records: xr.Dataset, name: str) -> dict[str, xr.DataArray]:
    """Give IMEP and NOx over load and timing by the first 25 held steps, polynomials, or by the first 1500 cycles."""
    import xarray as xr

    nodes = {name: np.array(column) for name, column in AXES.items()}
    nodes["soi_cad"] = np.linspace(*TIMING["soi_cad"], 59)
    grid: Sequence[Array] = np.meshgrid(*nodes.values(), indexing="ij")
    columns = {key: column.ravel() for key, column in zip(nodes, grid, strict=True)}
    names = ("imep_bar", "nox_ppm")
    if name == "25 held steps":
        steps = {key: column[:25] for key, column in held_steps(records).items()}
        fits = [fit_response(steps, one, factors=list(nodes)).model for one in names]
        values = [fit.predict(columns)["mean"].to_numpy() for fit in fits]
    else:
        rough = fit_surrogate(records[{"cycle": slice(1500)}])
        own = [np.broadcast_to(columns.get(one, rough.medians[one]), columns["soi_cad"].shape) for one in rough.inputs]
        table = rough.evaluate(np.column_stack(own))[0]
        values = [table[:, list(rough.signals).index(one)] for one in names]
    tables = [xr.DataArray(column.reshape(grid[0].shape), nodes, list(nodes)) for column in values]
    return dict(zip(names, tables, strict=True))


def sought(
    surrogate: EngineSurrogate, guide: Mapping[str, Any], seed: int, *, stops: Sequence[int], block_cycles: int = 100
) -> Iterator[MapSearch]:
    """Seek one map on the surrogate with recorded residuals, which refuses what lies outside the records."""
    plant = SurrogatePlant(
        surrogate, limits=["nox_ppm"], inputs=["soi_cad", *AXES], start_soi_cad=_SAFE_CAD, seed=seed,
        block_cycles=block_cycles, outside="raise",
    )  # fmt: skip
    how: dict[str, Any] = {"limits": {"nox_ppm": NOX_PPM}, "start": {"soi_cad": _SAFE_CAD}, "seed": seed}
    if guide:
        how |= {"guide": guide["imep_bar"], "limit_guides": {"nox_ppm": guide["nox_ppm"]}}
    for visits in stops:
        found = seek_map(plant, TIMING, AXES, visits=visits, **how)
        how = {"seeker": found}
        yield found


class MapJudge:
    """What timings are worth by the surfaces without scatter; `best_cad` and `best_bar` are the optima of the cells."""

    def __init__(self, surrogate: EngineSurrogate) -> None:
        self._surrogate = surrogate
        self._cells = [dict(zip(AXES, load, strict=True)) for load in itertools.product(*AXES.values())]
        optima = [surrogate.find_optimum("imep_bar", {"nox_ppm": NOX_PPM}, cell) for cell in self._cells]
        self.best_cad = np.array([one["soi_cad"] for one in optima])
        self.best_bar = np.array([one.values["imep_bar"] for one in optima])

    def steady(self, name: str, timing: Array, loads: Sequence[Mapping[str, float]] | None = None) -> Array:
        """Give a signal at timings of the cells, or of other loads."""
        at = zip(timing.tolist(), self._cells if loads is None else loads, strict=True)
        return np.array([float(self._surrogate.predict(soi, load)[name][0]) for soi, load in at])

    def __call__(self, timing: Array) -> tuple[float, float, NDArray[np.bool_]]:
        """Give mean and worst IMEP lost, 0 in a cell above the limit, and which are above it by more than 1 %."""
        nox = self.steady("nox_ppm", timing)
        lost = np.where(nox <= NOX_PPM, np.maximum(self.best_bar - self.steady("imep_bar", timing), 0.0), 0.0)
        return float(lost.mean()), float(lost.max()), nox > NOX_PPM + _TOLERANCE_PPM

    def of_search(self, found: MapSearch) -> list[float]:
        """Give both losses, cells above the limit, those that the search did not name, and visits above it."""
        mean, worst, over = self(found.map.values.ravel())
        unnamed = over & (found.cells["excess"].to_numpy().ravel() <= 0.0)
        asked = np.array([visit.inputs["soi_cad"] for visit in found.visits])
        above = self.steady("nox_ppm", asked, [visit.at for visit in found.visits]) > NOX_PPM + _TOLERANCE_PPM
        return [mean, worst, float(over.sum()), float(unnamed.sum()), float(above.sum())]

    def of_guide(self, guide: Mapping[str, xr.DataArray], margin_ppm: float) -> tuple[float, float, NDArray[np.bool_]]:
        """Judge the map that a guide alone makes, that far below the limit; the least NOx where nothing is."""
        nox = guide["nox_ppm"]
        kept = guide["imep_bar"].where(nox <= NOX_PPM - margin_ppm, -nox)
        return self(kept["soi_cad"].to_numpy()[kept.argmax("soi_cad").to_numpy().ravel()])


def map_rows(records: xr.Dataset, seeds: int = 10, stops: Sequence[int] = (8, 16, 32)) -> Iterator[dict[str, Any]]:
    """Seek the map by every guide, with residuals as recorded (stretches of 100 cycles) and without memory (1).

    Figures are means of the seeds; the mean loss has its 95 % interval. `mgdd.datasets.read("h2df_502")` has the
    records.
    """
    surrogate = fit_surrogate(records)
    judge = MapJudge(surrogate)
    for name in _GUIDES:
        guide = {} if name == "none" else guide_of(records, name)
        for block in (100, 1):
            paths = [sought(surrogate, guide, seed, stops=stops, block_cycles=block) for seed in range(seeds)]
            table = np.array([[judge.of_search(found) for found in path] for path in paths])
            for visits, each in zip(stops, table.swapaxes(0, 1), strict=True):
                keys = ("worst_bar", "over", "unnamed", "visits_over")
                means = dict(zip(keys, each[:, 1:].mean(axis=0).tolist(), strict=True))
                known = {"guide": name, "block_cycles": block, "visits": visits}
                yield {**known, "lost_bar": mean_interval(each[:, 0]), **means}
