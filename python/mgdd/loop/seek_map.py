"""One search for a whole map: visits of operating points and inputs, each where it teaches the map most."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd.engine import Cylinder
from mgdd.errors import Interrupted, ParameterError, argument, hinted
from mgdd.loop.engine_guide import EngineGuide
from mgdd.loop.lower_limits import both_sides, measured_names, middle_of, plain_name, safe_side, with_lower_sides
from mgdd.loop.map_result import MapSearch, Visit
from mgdd.loop.map_visits import Dwell, VisitFile, dwell_of, tell, visited
from mgdd.loop.plant import Plant
from mgdd.loop.seek import plant_of, seek_inputs, started
from mgdd.loop.virtual_engine import VirtualEngine
from mgdd.loop.virtual_test_bed import VirtualTestBed
from mgdd.optimize import Input
from mgdd.optimize.map_seeking import MapSeeking, entries_of, input_nodes
from mgdd.presets.meant import cylinder_of
from mgdd.presets.preset import Preset

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mgdd.optimize import Limit

_SETTINGS = (
    "noise_sd", "averaged", "moving_cost", "memory_readings", "horizon", "kept", "reach", "limit_probability",
)  # fmt: skip
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
    search : MapSearch
        The map so far: ``search.plot()`` draws it.
    """

    visit: int
    last: Visit
    regret: float
    settled: int
    search: MapSearch


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
    smoothness: float = 0.0,
    maximize: bool = True,
    seeker: MapSearch | MapSeeking | None = None,
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
        The same of the limits, where `guide` is not a cylinder.
    start : mapping of str to float, optional
        First inputs, where the limits hold in the middle of the map, without a guide. Left out, the middle of the
        bounds, and of a timing the bound where limits like those hold best.
    visits : int
        How many at most, those of a `seeker` or a record included.
    tolerance : float, optional
        Stop once the true best of no cell is expected to be above the map by more [unit of J].
    averaged : int or (int, int), optional
        Cycles of a visit that are averaged; of two numbers the least and the most: between them a visit ends where its
        mean is surer than half of what was not known there. 50 on a plant, 1 of a function.
    settling : int, optional
        Cycles of a visit before them that do not count: 20 on a plant, 0 of a function.
    smoothness : float
        J that one squared bend of the map may cost, 0 for none: a second difference along an axis, in ranges of the
        input per squared mean step of the axis. The search visits what the smooth map needs.
    maximize : bool
        False to minimise J.
    seeker : MapSearch or MapSeeking, optional
        Go on with an earlier result, whose visits stay in the new one and whose seeker changes, or with a seeker alone;
        `inputs` and `axes` must be its own, its limits, guide, start, smoothness, sense and seed count.
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
    before = list(seeker.visits) if isinstance(seeker, MapSearch) else []
    seeker = seeker.seeker if isinstance(seeker, MapSearch) else seeker
    own = {"limits": limits or None, "guide": guide, "limit_guides": limit_guides, "start": start, "settings": settings}
    if seeker is not None:
        _require_same(seeker, inputs, axes, own)
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
        begin = started(start, sought)
        if begin is None and guide is None:
            begin = middle_of(sought) | safe_side(sought, sides)
        seeker = map_seeker(
            inputs, entries, dwell, settings or {}, limits=sides, guide=guide, limit_guides=limit_guides, start=begin,
            smoothness=smoothness, maximize=maximize, seed=seed,
        )  # fmt: skip
    return _searched(with_lower_sides(driven, sides), seeker, dwell, before, visits, tolerance, record, on_visit)


def _require_same(seeker: Any, inputs: Any, axes: Any, own: Mapping[str, Any]) -> None:
    """Refuse what a search that goes on would not heed."""
    if not isinstance(seeker, MapSeeking):
        raise ParameterError.of("seeker", seeker, "a MapSearch, or its seeker: what seek_map has returned")
    for name, given in own.items():
        if given is not None:
            raise ParameterError.of(name, given, "left out beside seeker, whose search has its own")
    given = [(one.name, one.lower, one.upper) for one in seek_inputs(inputs)]
    if given != [(one.name, one.lower, one.upper) for one in seeker.settings["inputs"]]:
        raise ParameterError.of("inputs", inputs, f"those of the seeker: {', '.join(seeker.input_names)} in its bounds")
    entries = entries_of(axes, seeker.input_names)
    if list(entries) != list(seeker.axes) or any(
        not np.array_equal(entries[name], column) for name, column in seeker.axes.items()
    ):
        raise ParameterError.of("axes", axes, f"those of the seeker: {', '.join(seeker.axes)} with the same entries")


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
    return [Input(name, float(np.min(entries)), float(np.max(entries))) for name, entries in axes.items()]


def bed_of(engine: VirtualEngine, axes: Sequence[str], limits: Sequence[str]) -> VirtualTestBed:
    """Give the test bed of a virtual engine: its settings, with the operating point steered."""
    own = engine.settings
    own.pop("schedule")
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
    nodes |= input_nodes(inputs)
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
    made: list[Visit],
    visits: int,
    tolerance: float | None,
    record: Any,
    on_visit: Callable[[Progress], object] | None,
) -> MapSearch:
    file = None if record is None else VisitFile(Path(record), seeker)
    if file is not None:
        made.extend(file.replayed(seeker))
    fewest = _SURE_FROM * (len(seeker.axes) + len(seeker.input_names))
    try:
        while seeker.readings < visits:
            suggestion = seeker.suggest()
            if hasattr(plant, "begin"):
                plant.begin(seeker.readings)
            visit = visited(plant, seeker, dwell, suggestion.at, suggestion.inputs, suggestion.sd)
            tell(seeker, visit)
            made.append(visit)
            if file is not None:
                file.write(visit)
            if tolerance is not None or on_visit is not None:
                so_far = MapSearch.of(seeker, made, tolerance=tolerance, interrupted=False)
                cells = so_far.cells["regret"].to_numpy()
                regret = float(cells.max()) if np.isfinite(cells).all() else math.inf
                if on_visit is not None:
                    settled = 0 if tolerance is None else int((cells <= tolerance).sum())
                    on_visit(Progress(seeker.readings, visit, so_far.regret, settled, so_far))
                if tolerance is not None and seeker.readings >= fewest and regret <= tolerance:
                    following = seeker.suggest()
                    if (following.at, following.inputs) != (visit.at, visit.inputs):  # an odd visit is made again
                        break
    except KeyboardInterrupt:
        part = MapSearch.of(seeker, made, tolerance=tolerance, interrupted=True)
        raise Interrupted(
            f"interrupted after {len(made)} visits; the map so far is in .partial, whose seeker goes on from here", part
        ) from None
    except Exception as stop:
        stop.partial = MapSearch.of(seeker, made, tolerance=tolerance, interrupted=True)  # type: ignore[attr-defined]
        raise
    return MapSearch.of(seeker, made, tolerance=tolerance, interrupted=False)
