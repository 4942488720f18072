"""One search for a whole map: visits of operating points and inputs, each where it teaches the map most."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.engine import Cylinder
from mgdd.errors import DataError, Interrupted, ParameterError, argument, hinted
from mgdd.loop.engine_guide import EngineGuide
from mgdd.loop.lower_limits import both_sides, measured_names, plain_name, with_lower_sides
from mgdd.loop.map_result import MapSearch, Visit
from mgdd.loop.plant import Plant
from mgdd.loop.seek import plant_of, seek_inputs, started
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.loop.virtual_test_bed import VirtualTestBed
from mgdd.optimize.map_seeking import MapSeeking, entries_of
from mgdd.presets.meant import cylinder_of
from mgdd.presets.preset import Preset

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mgdd.optimize import Input, Limit

_SETTLING, _AVERAGED = 20, 50  # cycles of a visit on an engine
_FEWEST = 10  # cycles that tell what a mean is worth
_KNOWN = 0.5  # of what is not known at a visit: a mean that is surer teaches little more
_FAILED = 0.5  # share of the cycles of a visit
# Of an axis, and of the bounds of an input: a cycle that ran farther from its operating point, or from the inputs of
# the cycle before, as where a guard steps back and tries again, is none of the visit.
_ELSEWHERE, _MOVED = 0.01, 0.05
_SETTINGS = (
    "noise_sd", "averaged", "moving_cost", "memory_readings", "horizon", "kept", "reach", "limit_probability",
)  # fmt: skip
_NODES = {1: 41, 2: 17, 3: 11}
_SURE_FROM = 3  # visits per axis and input: what fewer promise of the regret is too much


class Progress(NamedTuple):
    """What a search for a map has come to, visit by visit.

    Parameters
    ----------
    visit : int
        Visits so far.
    last : Visit
        The last one.
    regret : float
        By how much J of the true best is expected to be above that of the map, mean of the cells [unit of J].
    settled : int
        Cells where it is within the tolerance; 0 without one.
    """

    visit: int
    last: Visit
    regret: float
    settled: int


def seek_map(
    plant: Plant | Callable[[Any], Any],
    inputs: Mapping[str, tuple[float, ...]] | Sequence[Input],
    axes: Mapping[str, ArrayLike],
    *,
    limits: Mapping[str, float | tuple[float | None, float | None]] | Sequence[Limit] = (),
    guide: Any = None,
    limit_guides: Mapping[str, Any] | None = None,
    start: Mapping[str, float] | None = None,
    visits: int = 32,
    tolerance: float | None = None,
    averaged: int | tuple[int, int] | None = None,
    settling: int | None = None,
    maximize: bool = True,
    seeker: MapSeeking | None = None,
    record: str | os.PathLike[str] | None = None,
    on_visit: Callable[[Progress], object] | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> MapSearch:
    """Seek the best inputs over operating points, with as few visits as possible.

    Each visit goes to the operating point and inputs whose reading is expected to raise J of the whole map most, by one
    process over points and inputs (`mgdd.optimize.MapSeeking`). With a model as `guide` some ten visits make a map
    that a design of experiments needs 64 for; without it the search runs on, with more visits.

    Parameters
    ----------
    plant : Plant or callable
        Takes the axes beside the inputs, by name: a function ``f(x) -> J``, ``(J, {limit: value})`` or None where the
        engine failed; a rig that sets speed and load; or a `VirtualEngine`, whose operating point is then steered.
    inputs : mapping of str to (float, float) or (float, float, float), or sequence of Input
        Bounds of every input, and the step in which it is set.
    axes : mapping of str to array_like
        One or two, or more where no map is made: numbers of the operating point with the entries of the map.
    limits : mapping of str to float or (float, float), or sequence of Limit
        Upper values of measured quantities, or lower and upper ones.
    guide : Cylinder, preset, callable, fitted response or DataArray, optional
        A model of J over axes and inputs. Of a `VirtualEngine` or `VirtualTestBed` a cylinder is enough: the model of J
        and of the limits is then the same test bed with that cylinder, without noise.
    limit_guides : mapping of str to guides, optional
        The same of the limits, where `guide` is no cylinder.
    start : mapping of str to float, optional
        First inputs, where the limits hold in the middle of the map, without a guide.
    visits : int
        How many at most, those of a `seeker` or a record included.
    tolerance : float, optional
        Stop once the true best of no cell is expected to be above the map by more [unit of J].
    averaged : int or (int, int), optional
        Cycles of a visit that are averaged; of two numbers the least and the most: between them a visit ends where its
        mean is surer than half of what was not known there. 50 on a plant, 1 of a function.
    settling : int, optional
        Cycles of a visit before them that do not count: 20 on a plant, 0 of a function.
    maximize : bool
        False to minimise J.
    seeker : MapSeeking, optional
        Go on with that of an earlier result, which changes; it has inputs, axes, limits and guide of its own.
    record : path-like, optional
        A CSV file with a row per visit. Where it holds some, the search goes on behind them as if it had never stopped;
        a record of another search is refused.
    on_visit : callable, optional
        Called after every visit with its `Progress`.
    settings : mapping of str to any, optional
        Further settings of `MapSeeking`.
    seed : int
        Of the search.

    Returns
    -------
    MapSearch
        A map of every input, what is known of each cell, every visit, and reasons to doubt the map.

    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError
        Inputs, axes or limits that make no search, or that the plant does not have; nothing was visited.
    mgdd.errors.DataError
        A reading that is not finite, or a record of another search. ``partial`` is the MapSearch so far.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` as above.

    See Also
    --------
    mgdd.maps.optimize_map, mgdd.maps.smooth_map : the way by a design, response models and smoothing.

    Examples
    --------
    >>> from mgdd.engine import Cylinder
    >>> from mgdd.loop import VirtualEngine, seek_map
    >>> engine = VirtualEngine("puma_single", seed=1)
    >>> axes = {"speed_rpm": [1000, 1500, 2000], "fuel_mg": [12, 18, 24]}
    >>> found = seek_map(engine, {"soc_cad": (-20.0, 8.0)}, axes, guide=Cylinder(wall_heat_scale=1.0), visits=6)
    >>> found.map
    <CalibrationMap soc_cad [°CA aTDC], 3 speed_rpm x 3 fuel_mg, 9 optimised>
    >>> found.findings
    ()
    """
    require_end(visits, tolerance)
    sides = both_sides(limits) if seeker is None else tuple(seeker.settings["limits"])
    sought = seek_inputs(inputs) if seeker is None else tuple(seeker.settings["inputs"])
    entries = entries_of(axes, [one.name for one in sought]) if seeker is None else seeker.axes
    if isinstance(plant, VirtualEngine):
        plant = bed_of(plant, list(entries), measured_names(sides))
    whole = [*_as_inputs(entries), *sought]
    driven = plant_of(plant, whole, sides)
    dwell = dwell_of(averaged, settling, on_plant=isinstance(plant, Plant))
    if isinstance(driven, VirtualTestBed):
        driven.require_cells(entries)
    if seeker is None:
        if isinstance(driven, VirtualTestBed) and _is_engine(guide):
            cylinder = cylinder_of(getattr(guide, "cylinder", guide))
            guide, limit_guides = model_of(driven, cylinder, entries, sought, [limit.name for limit in sides])
        seeker = map_seeker(
            inputs, entries, dwell, settings or {}, limits=sides, guide=guide, limit_guides=limit_guides,
            start=started(start, sought), maximize=maximize, seed=seed,
        )  # fmt: skip
    return _searched(with_lower_sides(driven, sides), seeker, dwell, visits, tolerance, record, on_visit)


def _is_engine(guide: Any) -> bool:
    """Whether a guide is a cylinder in one of its forms, or an EngineGuide."""
    return isinstance(guide, str | os.PathLike | Preset | EngineGuide) or isinstance(
        getattr(guide, "model", guide), Cylinder
    )


def require_end(visits: int, tolerance: float | None) -> None:
    """ParameterError for what ends no search."""
    if isinstance(visits, bool) or not isinstance(visits, int | np.integer) or visits < 1:
        raise ParameterError.of("visits", visits, "a whole number >= 1")
    if tolerance is not None and not tolerance > 0.0:
        raise ParameterError.of("tolerance", tolerance, "> 0, in the unit of J")


class Dwell(NamedTuple):
    """Cycles of a visit: those before the others, and how many are averaged at least and at most."""

    settling: int
    least: int
    most: int


def dwell_of(averaged: Any, settling: int | None, *, on_plant: bool) -> Dwell:
    """Read how long a visit takes; ParameterError for no cycles."""
    given = (_AVERAGED if on_plant else 1) if averaged is None else averaged
    least, most = given if isinstance(given, tuple) else (given, given)
    before = (_SETTLING if on_plant else 0) if settling is None else settling
    for name, value, low in (("averaged", least, 1), ("averaged", most, least), ("settling", before, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < low:
            raise ParameterError.of(name, given if name == "averaged" else value, f"a whole number of cycles >= {low}")
    return Dwell(int(before), int(least), int(most))


def map_seeker(
    inputs: Any, axes: Mapping[str, ArrayLike], dwell: Dwell, settings: Mapping[str, Any], **given: Any
) -> MapSeeking:
    """Make the seeker of visits of that length, with further settings; ParameterError that names one as such."""
    for name in settings:
        if name not in _SETTINGS:
            raise ParameterError(
                hinted(f"{argument('settings')}: {name!r}: must be one of {', '.join(_SETTINGS)}", name, _SETTINGS)
            )
    own = {"averaged": float(dwell.most), "moving_cost": dwell.settling / dwell.most}
    try:
        return MapSeeking(inputs, axes, **given, **{**own, **settings})
    except ParameterError as error:
        if error.field not in settings:
            raise
        raise error.reworded(f"{argument('settings')}: {error}") from error


def _as_inputs(axes: Mapping[str, ArrayLike]) -> list[Input]:
    from mgdd.optimize import Input

    return [Input(name, float(np.min(entries)), float(np.max(entries))) for name, entries in axes.items()]


def bed_of(engine: VirtualEngine, axes: Sequence[str], limits: Sequence[str]) -> VirtualTestBed:
    """Give the test bed of a virtual engine: its settings, with the operating point steered."""
    own = engine.settings
    for name in ("schedule",):
        own.pop(name)
    measured = dict.fromkeys([*own.pop("limits"), *limits])
    return VirtualTestBed(
        own.pop("cylinder"), axes, point=engine.point_at(0), limits=list(measured), seed=own.pop("seed"), **own
    )


def model_of(
    bed: VirtualTestBed, cylinder: Any, axes: Mapping[str, ArrayLike], inputs: Sequence[Input], limits: Sequence[str]
) -> tuple[Any, dict[str, Any]]:
    """Give J and limits of a model over axes and inputs, from the same test bed with that cylinder."""
    import xarray as xr

    if "cov_imep_percent" in [plain_name(name)[0] for name in limits]:
        raise ParameterError(f"{argument('limits')}: cov_imep_percent has no steady value for the guide: leave it out")
    nodes = {name: np.asarray(entries, np.float64) for name, entries in axes.items()}
    nodes |= {one.name: np.linspace(one.lower, one.upper, _NODES.get(len(inputs), 7)) for one in inputs}
    grid = dict(zip(nodes, np.meshgrid(*nodes.values(), indexing="ij"), strict=True))
    found = bed.with_cylinder(cylinder).steady(grid)
    shape = tuple(column.size for column in nodes.values())

    def over_all(name: str) -> xr.DataArray:
        sign, plain = (-1.0, name[1:]) if name.startswith("-") else (1.0, name)
        table = sign * found[plain].reshape(shape)
        if not np.isfinite(table).all():
            where = np.argwhere(~np.isfinite(table))[0]
            at = ", ".join(f"{each} = {column[k]:g}" for (each, column), k in zip(nodes.items(), where, strict=True))
            raise ParameterError(f"{argument('guide')}: the model has no cycle at {at}: narrow the bounds or the axes")
        return xr.DataArray(table, coords=nodes, dims=tuple(nodes))

    return over_all("j"), {name: over_all(name) for name in limits}


def _searched(
    plant: Plant,
    seeker: MapSeeking,
    dwell: Dwell,
    visits: int,
    tolerance: float | None,
    record: Any,
    on_visit: Callable[[Progress], object] | None,
) -> MapSearch:
    made = list[Visit]()
    file = None if record is None else VisitFile(Path(record), seeker)
    interrupted = False
    if file is not None:
        for row in file.replayed(seeker):
            made.append(row)
    fewest = _SURE_FROM * (len(seeker.axes) + len(seeker.input_names))
    try:
        while seeker.readings < visits:
            suggestion = seeker.suggest()
            if hasattr(plant, "begin"):
                plant.begin(seeker.readings)
            visit = _visited(plant, seeker, dwell, suggestion.at, suggestion.inputs, suggestion.sd)
            _tell(seeker, visit)
            made.append(visit)
            if file is not None:
                file.write(visit)
            if tolerance is not None or on_visit is not None:
                cells = seeker.cells()["regret"].to_numpy()
                regret = float(cells.max()) if np.isfinite(cells).all() else math.inf
                if on_visit is not None:
                    settled = 0 if tolerance is None else int((cells <= tolerance).sum())
                    on_visit(Progress(len(made), visit, float(cells.mean()), settled))
                if tolerance is not None and len(made) >= fewest and regret <= tolerance:
                    break
    except KeyboardInterrupt:
        interrupted = True
        part = MapSearch.of(seeker, made, tolerance=tolerance, interrupted=True)
        raise Interrupted(
            f"interrupted after {len(made)} visits; the map so far is in .partial, whose seeker goes on from here", part
        ) from None
    except Exception as stop:
        stop.partial = MapSearch.of(seeker, made, tolerance=tolerance, interrupted=True)  # type: ignore[attr-defined]
        raise
    return MapSearch.of(seeker, made, tolerance=tolerance, interrupted=interrupted)


def _visited(
    plant: Plant, seeker: MapSeeking, dwell: Dwell, at: dict[str, float], inputs: dict[str, float], sd: float
) -> Visit:
    """Drive to a point, wait, and average; a visit at which half of the cycles fail has failed."""
    names = seeker.limit_names
    near = {name: _ELSEWHERE * float(np.ptp(entries)) for name, entries in seeker.axes.items()}
    near |= {one.name: _MOVED * (one.upper - one.lower) for one in seeker.settings["inputs"]}
    ran = dict(inputs)
    rows, failed = list[list[float]](), 0
    applied = {name: list[float]() for name in inputs}
    for cycle in range(dwell.settling + dwell.most):
        plant.apply({**at, **inputs})  # in every cycle: a guard moves by steps, a bus waits for the next command
        measured = plant.measure()
        before, ran = {**ran, **at}, {**at, **inputs, **measured.applied}
        if cycle < dwell.settling:
            continue
        if measured.misfire or any(abs(ran[name] - before[name]) > width for name, width in near.items()):
            failed += 1
        else:
            row = [measured.performance, *(float(measured.limits[name]) for name in names)]
            if not np.isfinite(row).all():
                where = ", ".join(f"{name} = {value:g}" for name, value in {**at, **inputs}.items())
                listed = dict(zip(("J", *names), row, strict=True))
                raise DataError(f"the plant read {listed} at {where}: must be finite, or a misfire")
            rows.append(row)
            for name in inputs:
                applied[name].append(float(ran[name]))
        counted = len(rows) + failed
        if len(rows) >= _FEWEST and dwell.least <= counted < dwell.most:
            mean_sd = float(np.std([row[0] for row in rows], ddof=1)) / math.sqrt(len(rows))
            if 0.0 < mean_sd < _KNOWN * sd:
                break
    if failed >= _FAILED * (len(rows) + failed):
        return Visit(at, inputs, math.nan, dict.fromkeys(names, math.nan), float(len(rows) + failed), failed=True)
    means = np.mean(rows, axis=0).tolist()
    really = {name: float(np.mean(column)) for name, column in applied.items()}
    return Visit(at, really, means[0], dict(zip(names, means[1:], strict=True)), float(len(rows)), failed=False)


def _tell(seeker: MapSeeking, visit: Visit) -> None:
    if visit.failed:
        seeker.tell(visit.at, visit.inputs, misfire=True)
    else:
        seeker.tell(visit.at, visit.inputs, visit.j, visit.limits, readings=visit.readings)


class VisitFile:
    """Rows of visits as they are made; numbers are written in full, so that a search goes on bit for bit."""

    def __init__(self, path: Path, seeker: MapSeeking) -> None:
        self._path = path
        self._names = [*seeker.axes, *seeker.input_names, "j", *seeker.limit_names, "readings", "failed"]
        self._count = (len(seeker.axes), len(seeker.input_names), len(seeker.limit_names))

    def replayed(self, seeker: MapSeeking) -> Iterator[Visit]:
        """Tell a seeker what the file holds; DataError where it is of another search."""
        if not self._path.exists() or not self._path.read_text(encoding="utf-8").strip():
            self._path.write_text(",".join(self._names) + "\n", encoding="utf-8")
            return
        text = self._path.read_text(encoding="utf-8")
        lines = text.splitlines()
        if lines[0].split(",") != self._names:
            raise DataError(
                f"{self._path}: has columns {lines[0]}: this search has {','.join(self._names)}; give another file"
            )
        if not text.endswith("\n"):  # the last row was cut off as it was written
            lines = lines[:-1]
            self._path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        axes, inputs, limits = self._count
        for number, line in enumerate(lines[1:], 1):
            try:
                row = [float(entry) for entry in line.split(",")]
                if len(row) != len(self._names):
                    raise ValueError
            except ValueError:
                raise DataError(f"{self._path}: row {number} is {line!r}: must be {len(self._names)} numbers") from None
            held = row[axes + inputs + 1 : axes + inputs + 1 + limits]
            visit = Visit(
                dict(zip(seeker.axes, row, strict=False)),
                dict(zip(seeker.input_names, row[axes:], strict=False)),
                row[axes + inputs], dict(zip(seeker.limit_names, held, strict=True)), row[-2], failed=row[-1] == 1.0,
            )  # fmt: skip
            asked = seeker.suggest()
            if asked.at != visit.at:
                at = ", ".join(f"{name} = {value:g}" for name, value in asked.at.items())
                raise DataError(
                    f"{self._path}: row {number} is at another point than this search would go to, {at}: it belongs to "
                    "another search; give another file"
                )
            _tell(seeker, visit)
            yield visit

    def write(self, visit: Visit) -> None:
        """Add a row."""
        row = [*visit.at.values(), *visit.inputs.values(), visit.j, *visit.limits.values(), visit.readings,
               float(visit.failed)]  # fmt: skip
        with self._path.open("a", encoding="utf-8") as out:
            out.write(",".join(map(repr, row)) + "\n")
