"""What a bench would show noise-free and without waiting: steady maps of J and limits, and their optimum."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core.loop import VirtualEngine, bench_limits
from mgdd.engine.optimum import OBJECTIVES, check_request
from mgdd.errors import ConvergenceError, ParameterError, ShapeError, hinted
from mgdd.loop.lower_limits import both_sides, measured_names, plain_name
from mgdd.loop.plant_record import OWN_LABELS, objective_label, weights_of
from mgdd.optimize.optimum import Optimum
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd._core.optimize import Limit

    Point = tuple[float, ...] | NDArray[np.float64]

_SECANT_CAD = 3.0
_SCAN_POINTS = {1: 161, 2: 31, 3: 13, 4: 7, 5: 5}  # per input
_STARTS = 3
_EDGE = 1e-6  # of the searched range, or of a limit


def split_inputs(names: Sequence[str], inputs: Any, missing: Any) -> tuple[Any, list[Any]]:
    """Give the timing and the further inputs in their order; a plain value is the timing."""
    if not isinstance(inputs, Mapping):
        return inputs, []
    for name in inputs:
        if name not in names:
            raise ParameterError(hinted(f"inputs: {name!r}: the bench has {', '.join(names)}", str(name), names))
    first, *further = (inputs.get(name, missing) for name in names)
    return first, further


def steady_map(quiet: VirtualEngine, inputs: ArrayLike | Mapping[str, ArrayLike]) -> xr.Dataset:
    """Measure a bench that shows nothing random or slow, each sensor settled, over the grid of these values."""
    names = tuple(quiet.input_bounds)
    split_inputs(names, inputs, None)
    given = inputs if isinstance(inputs, Mapping) else {"soc_cad": inputs}
    axes = {name: np.atleast_1d(np.asarray(given[name], float)) for name in names if name in given}
    if "soc_cad" not in axes:
        raise ParameterError("inputs: soc_cad is missing: a steady map needs its timings")
    for name, values in axes.items():
        if values.ndim != 1:
            raise ShapeError(f"{name} has {values.ndim} dimensions: must be a column")
        low, high = quiet.input_bounds[name]
        for value in values:
            if not low <= value <= high:
                raise ParameterError(f"{name} = {value:g}: must lie in [{low:g}, {high:g}], the window of the bench")
    at = dict.fromkeys(names, math.nan)  # what is not given stays at the value of the operating point
    rows = [
        _settled(quiet, tuple((at | dict(zip(axes, point, strict=True))).values()))
        for point in itertools.product(*axes.values())
    ]
    shape = tuple(values.size for values in axes.values())
    dims = tuple(axes) if len(axes) > 1 else "soc_cad"
    shown = ("efficiency_gross", "imep_gross_bar", "p_max_bar", "dp_max_bar_per_cad", "t_max_k")
    variables: dict[str, tuple[Any, ...]] = {
        name: (name, values, *OWN_LABELS.get(name, ())) for name, values in axes.items()
    }
    for name in ("j", *shown, "nox_true_ppm", "nox_soft_ppm", *(("intake_o2_fraction",) if "egr" in names else ())):
        variables[name] = (dims, np.reshape([row[name] for row in rows], shape))
    variables["j"] = (*variables["j"], *objective_label(weights_of(quiet.settings["performance"])))
    return labelled_dataset(variables)


def limits_to_keep(limits: Any) -> tuple[Limit, ...]:
    """Read limits that have a steady value, lower ones as upper ones of the negated quantity."""
    upper_limits = both_sides(limits)
    check_request(OBJECTIVES[0], measured_names(upper_limits), bench_limits)
    return upper_limits


def find_optimum(
    quiet: VirtualEngine, upper_limits: tuple[Limit, ...], bounds: Mapping[str, tuple[float, float]], scatter_cad: float
) -> Optimum:
    """Find the best inputs of such a bench, whose limits are those to keep, and what this scatter of SOC would do."""
    windows = quiet.input_bounds
    for name, (low, high) in bounds.items():
        least, greatest = windows[name]
        if not least <= low < high <= greatest:
            raise ParameterError(
                f"bounds: {name} = ({low:g}, {high:g}): must increase and lie in [{least:g}, {greatest:g}]"
            )
    caps = {limit.name: limit.upper - limit.margin for limit in upper_limits}
    best, free = _best(quiet, caps, bounds)
    around = [_settled(quiet, (free[0] + away,))["j"] for away in (-_SECANT_CAD, 0.0, _SECANT_CAD) if len(bounds) == 1]
    at, limited = _settled(quiet, best), _limited(quiet, best)
    sides = _sides(limited, caps)
    early, late = (_limited(quiet, (best[0] + shift, *best[1:])) for shift in (-0.05, 0.05))
    numbers = {name: float(value) for name, value in at.items() if isinstance(value, float) and name not in bounds}
    spread = {f"scatter_{name}": abs(late[name] - early[name]) / 0.1 * scatter_cad for name in limited}
    edges = [min(x - low, high - x) / (1.0 if name == "soc_cad" else high - low)
             for x, (name, (low, high)) in zip(best, bounds.items(), strict=True)]  # fmt: skip
    return Optimum(
        inputs=dict(zip(bounds, map(float, best), strict=True)),
        objective="j",
        value=float(at["j"]),
        values={**numbers, **limited, **spread},
        limits=upper_limits,
        active_limits=tuple(name for name, cap in caps.items() if sides[name] > cap - 1e-3 * max(1.0, abs(cap))),
        at_bound=min(edges) < 1e-3,
        bounds=dict(bounds),
        curvature=(around[0] - 2.0 * around[1] + around[2]) / _SECANT_CAD**2 if around else math.nan,
        free_inputs=dict(zip(bounds, map(float, free), strict=True)),
    )


def _best(
    quiet: VirtualEngine, caps: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the best inputs and those without limits: a grid, then SLSQP from its best points."""
    low, span = np.array([b[0] for b in bounds.values()]), np.array([b[1] - b[0] for b in bounds.values()])
    uppers = np.array(list(caps.values()))

    def j(z: NDArray[np.float64]) -> float:
        return float(_settled(quiet, low + z * span)["j"])

    def room(z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Room below each limit, as a share of it."""
        now = np.array(list(_sides(_limited(quiet, low + z * span), caps).values()))
        return (uppers - now) / np.maximum(1.0, np.abs(uppers))  # type: ignore[no-any-return]

    grid = np.array(list(itertools.product(np.linspace(0.0, 1.0, _SCAN_POINTS[low.size]), repeat=low.size)))
    values, least = np.array([j(z) for z in grid]), np.array([room(z).min(initial=1.0) for z in grid])
    free = _climbed(j, None, grid[np.argsort(-values)[:_STARTS]]) if low.size > 1 else _peak(j, grid, values)
    if room(free).min(initial=1.0) >= 0.0:
        return low + free * span, low + free * span
    valid = np.flatnonzero(least >= 0.0)
    starts = grid[valid[np.argsort(-values[valid])[:_STARTS]]] if valid.size else grid[np.argsort(-least)[:_STARTS]]
    best = _climbed(j, room, starts)
    if room(best).min() < -_EDGE:
        asked = ", ".join(f"{name} in [{a:g}, {b:g}]" for name, (a, b) in bounds.items())
        raise ConvergenceError(f"no {asked} keeps {_listed(caps)}: move a limit")
    return low + best * span, low + free * span


def _peak(j: Any, grid: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the best of one input beside the best of its grid, without slopes: J may have small jumps, as NOx has."""
    from scipy.optimize import minimize_scalar

    top = int(values.argmax())
    ends = grid[max(top - 1, 0), 0], grid[min(top + 1, len(grid) - 1), 0]
    solution = minimize_scalar(lambda z: -j(np.array([z])), bounds=ends, method="bounded", options={"xatol": 2.5e-6})
    return np.array([solution.x])


def _climbed(j: Any, room: Any, starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Climb from each start, never ending lower or farther outside of the limits than there; give the best end."""
    from scipy.optimize import minimize

    rules = [{"type": "ineq", "fun": room}] if room else []

    def worth(z: NDArray[np.float64]) -> tuple[float, float]:
        return (min(float(room(z).min()) + _EDGE, 0.0) if room else 0.0, j(z))

    ends = list(starts)
    for start in starts:
        solution = minimize(
            lambda z: -j(z), start, method="SLSQP", bounds=[(0.0, 1.0)] * start.size, constraints=rules,
            options={"eps": 1e-5, "ftol": 1e-10, "maxiter": 200},
        )  # fmt: skip
        ends.append(np.clip(solution.x, 0.0, 1.0))
    return np.asarray(max(ends, key=worth))


def _settled(quiet: VirtualEngine, inputs: Point) -> dict[str, Any]:
    """Measure one cycle from rest: every sensor stands at its steady value."""
    quiet.reset()
    first, *further = map(float, inputs)
    return quiet.step(first, further)


def _listed(caps: Mapping[str, float]) -> str:
    """Write limits as they were given."""
    sides = [(*plain_name(name), cap) for name, cap in caps.items()]
    return ", ".join(f"{name} {'<=' if side > 0.0 else '>='} {side * cap:g}" for name, side, cap in sides)


def _sides(limited: Mapping[str, float], caps: Mapping[str, float]) -> dict[str, float]:
    """Give what each limit is of, as an upper one."""
    return {cap: side * limited[name] for cap in caps for name, side in [plain_name(cap)]}


def _limited(quiet: VirtualEngine, inputs: Point) -> dict[str, float]:
    """Give the limited quantities, the true NOx for every sensor."""
    quiet.reset()
    first, *further = map(float, inputs)
    row = quiet.noise_free_limits([first], [0], [[x] for x in further])[0]
    return dict(zip(quiet.settings["limits"], map(float, row), strict=True))
