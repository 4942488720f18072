"""The best timing of a model: an indicator over SOC, with limits on other indicators."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from mgdd import _core
from mgdd._arguments import require_plain
from mgdd._core.engine import Cylinder
from mgdd._core.optimize import Limit
from mgdd.errors import ConvergenceError, ParameterError, hinted
from mgdd.optimize.optimum import Optimum, idle_limits, limits_of
from mgdd.presets.meant import CylinderLike, PointLike, engine_of
from mgdd.results.units import unit_of

OBJECTIVES = ("efficiency_gross", "imep_gross_bar", "imep_closed_bar")
_SCAN_CAD = 0.5
_SECANT_CAD = 3.0
_PLACE = unit_of("soc_cad")  # where something lies is not a load on the engine
_WINDOW_CAD: tuple[float, float] = _core.engine.timing_window_cad
DEFAULT_CAD = (-30.0, 10.0)


def find_optimum(
    cylinder: CylinderLike,
    point: PointLike | None = None,
    objective: str = "efficiency_gross",
    *,
    speed_rpm: float | None = None,
    fuel_mg: float | None = None,
    limits: Mapping[str, float] | Sequence[Limit] | None = None,
    bounds_cad: tuple[float, float] | None = None,
    step_cad: float = 1.0,
    integrator: str = "trapezoid",
) -> Optimum:
    """Find the start of combustion that maximises an indicator under limits on others.

    A scan in steps of 0.5 CAD finds the basin; the root of the exact derivative, or the crossing of a limit,
    refines it.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        The model, as in `simulate`.
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        As in `simulate`; must carry fuel.
    objective : {"efficiency_gross", "imep_gross_bar", "imep_closed_bar"}
        What to maximise.
    limits : mapping of str to float, or sequence of Limit, optional
        Upper limits on indicators, for example ``{"p_max_bar": 95.0}``; the margin of a `Limit` is kept.
    speed_rpm, fuel_mg : float, optional
        Of the point, in place of its own.
    bounds_cad : tuple of float, optional
        Searched range of SOC [°CA aTDC]; -30 to 10, as far as the valves are closed, if left out.
    step_cad, integrator
        As in `simulate`.

    Returns
    -------
    Optimum
        Input ``soc_cad``; further every indicator, for example ``ca50_cad`` and ``efficiency_gross``. The curvature is
        taken over ±3 CAD.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown objective or limit, a motored point, bounds outside [-60, 20].
    mgdd.errors.ConvergenceError
        No timing in the range meets the limits; the message states how near it comes.

    Examples
    --------
    >>> from mgdd.engine import Cylinder, OperatingPoint, find_optimum
    >>> best = find_optimum(Cylinder(), OperatingPoint(), limits={"p_max_bar": 95.0})
    >>> round(best["soc_cad"], 2), best.active_limits
    (-3.08, ('p_max_bar',))
    """
    require_plain("bounds_cad", bounds_cad)
    cylinder, point = engine_of(cylinder, point, speed_rpm=speed_rpm, fuel_mg=fuel_mg)
    checked = limits_of(limits)
    caps = {limit.name: limit.upper - limit.margin for limit in checked}
    low, high = bounds_cad or (max(DEFAULT_CAD[0], cylinder.ivc_cad), min(DEFAULT_CAD[1], cylinder.evo_cad - 1.0))
    check_request(objective, caps)
    if not point.fuel_mg > 0.0:
        raise ParameterError(f"fuel_mg = {point.fuel_mg:g}: an optimum needs fuel > 0")
    if not _WINDOW_CAD[0] <= low < high <= _WINDOW_CAD[1]:
        raise ParameterError(
            f"bounds_cad = ({low:g}, {high:g}): must increase and lie in "
            f"[{_WINDOW_CAD[0]:g}, {_WINDOW_CAD[1]:g}] °CA aTDC"
        )

    def indicators(soc: float | np.ndarray) -> dict[str, np.ndarray]:
        return _core.engine.scan(cylinder, point, np.atleast_1d(np.asarray(soc, float)), step_cad, integrator)

    def slope(soc: float) -> float:
        raw = _core.engine.sensitivities(cylinder, point, soc, ["soc_cad"], step_cad, integrator)
        return float(raw["indicators"][objective][0])

    def excess(soc: float, names: Iterable[str]) -> float:
        """How far the worst of these limits is exceeded, relative to its size; negative when all are kept."""
        now = indicators(soc)
        return max(float(now[name][0] - caps[name]) / max(1.0, abs(caps[name])) for name in names)

    grid = np.linspace(low, high, max(3, round((high - low) / _SCAN_CAD) + 1))
    columns = indicators(grid)
    if caps and not _feasible(columns, caps).any():
        grid = np.sort(np.append(grid, _least_excess(grid, columns, caps, excess)))
        columns = indicators(grid)
    feasible = _feasible(columns, caps)
    if not feasible.any():
        near = ", ".join(f"{name} >= {columns[name].min():.4g} (limit {limit:g})" for name, limit in caps.items())
        raise ConvergenceError(
            f"no soc_cad in [{low:g}, {high:g}] meets the limits together; each alone: {near}; raise a limit or widen "
            "bounds_cad"
        )
    best = int(np.argmax(np.where(feasible, columns[objective], -np.inf)))
    soc = _refine(grid, best, feasible, slope, lambda at, end: excess(at, _broken(indicators(end), caps)))
    now = indicators(soc)
    active = tuple(name for name, limit in caps.items() if now[name][0] > limit - 1e-6 * max(1.0, abs(limit)))
    return Optimum(
        inputs={"soc_cad": soc},
        objective=objective,
        value=float(now[objective][0]),
        values={name: float(column[0]) for name, column in now.items() if name != "soc_cad"},
        limits=checked,
        active_limits=active,
        at_bound=soc in (low, high),
        bounds={"soc_cad": (low, high)},
        curvature=_curvature(indicators, objective, soc, cylinder),
        findings=idle_limits(
            caps, {name: float(columns[name].max()) for name in caps}, f"for soc_cad in [{low:g}, {high:g}]"
        ),
        scan={"soc_cad": grid, **{name: columns[name] for name in (objective, *caps)}},
    )


def _feasible(columns: dict[str, np.ndarray], limits: Mapping[str, float]) -> np.ndarray:
    inside = np.ones(columns["p_max_bar"].size, bool)
    for name, limit in limits.items():
        inside &= columns[name] <= limit
    return inside


def _broken(columns: dict[str, np.ndarray], limits: Mapping[str, float]) -> list[str]:
    return [name for name, limit in limits.items() if columns[name][0] > limit]


def _least_excess(
    grid: np.ndarray,
    columns: dict[str, np.ndarray],
    limits: Mapping[str, float],
    excess: Callable[[float, Iterable[str]], float],
) -> float:
    """Find the timing that breaks the limits least: a feasible window may be narrower than the scan."""
    from scipy.optimize import minimize_scalar

    worst = np.max([(columns[n] - limit) / max(1.0, abs(limit)) for n, limit in limits.items()], axis=0)
    at = int(np.argmin(worst))
    window = (grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)])
    nearest = minimize_scalar(excess, bounds=window, args=(list(limits),), method="bounded", options={"xatol": 1e-6})
    return float(nearest.x)


def _refine(
    grid: np.ndarray,
    best: int,
    feasible: np.ndarray,
    slope: Callable[[float], float],
    excess: Callable[[float, float], float],
) -> float:
    from scipy.optimize import brentq

    start = float(grid[best])
    climb = slope(start)
    if climb == 0.0:
        return start
    step = 1 if climb > 0.0 else -1  # towards the better side
    if not 0 <= best + step < grid.size:
        return start
    end = float(grid[best + step])
    if not feasible[best + step]:  # the last kept angle before a limit that breaks there, from the feasible side
        outside = end
        crossing = float(brentq(excess, start, outside, args=(outside,), xtol=1e-10))
        end = crossing if excess(crossing, outside) <= 0.0 else crossing - step * 1e-9
    if slope(end) * climb >= 0.0:
        return end
    return float(brentq(slope, start, end, xtol=1e-8))


def _curvature(
    indicators: Callable[[np.ndarray], dict[str, np.ndarray]], objective: str, soc: float, cylinder: Cylinder
) -> float:
    around = np.array([soc - _SECANT_CAD, soc, soc + _SECANT_CAD])
    if around[0] < max(_WINDOW_CAD[0], cylinder.ivc_cad) or around[-1] > min(_WINDOW_CAD[1], cylinder.evo_cad - 1e-9):
        return math.nan
    before, at, after = indicators(around)[objective]
    return float((before - 2.0 * at + after) / _SECANT_CAD**2)


def check_request(objective: str, limits: Iterable[str], also: Iterable[str] = ()) -> None:
    """Refuse an unknown objective or limit before any work; `also` are limits besides indicators."""
    ParameterError.unless(objective in OBJECTIVES, "objective", objective, f"one of {', '.join(OBJECTIVES)}")
    names = [*_core.engine.indicator_units(), *also]
    for name in limits:
        if name not in names:
            refused = f"limits: {name!r} is not an indicator: must be one of {', '.join(names)}"
            raise ParameterError(hinted(refused, name, [other for other in names if unit_of(other) != _PLACE]))
