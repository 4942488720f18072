"""The best injection timing of a surrogate: exact, because along one input everything is a polynomial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from mgdd._core.optimize import Limit
from mgdd.errors import ConvergenceError
from mgdd.optimize.optimum import Optimum
from mgdd.surrogate.polynomial import Support

if TYPE_CHECKING:
    from numpy.typing import NDArray

_TINY = 1e-9  # relative slack of a limit at its own crossing


def best_along(
    support: Support,
    surfaces: Mapping[str, NDArray[np.float64]],
    at: NDArray[np.float64],
    *,
    weights: Mapping[str, float],
    kept: tuple[Limit, ...],
    nonnegative: tuple[str, ...],
) -> Optimum:
    """Maximise the weighted sum of signals over SOI where supported and within the limits, the rest of a point held."""
    limits = {limit.name: limit.upper - limit.margin for limit in kept}
    column = support.inputs.index("soi_cad")
    low, high = float(support.lower[column]), float(support.upper[column])
    nodes = np.linspace(low, high, 5)
    points = np.tile(at, (nodes.size, 1))
    points[:, column] = nodes
    terms = support.basis(points)

    def along(values: NDArray[np.float64], degree: int) -> Polynomial:
        return Polynomial.fit(nodes, values, degree)

    curves = {name: along(terms @ coefficients, 2) for name, coefficients in surfaces.items()}
    leverage = along(support.leverage(points), 4) - support.leverage_limit
    goal = Polynomial([0.0], (low, high), (-1.0, 1.0))
    for name, weight in weights.items():
        goal = goal + weight * curves[name]
    held = {name: curves[name] - limit for name, limit in limits.items()}
    rules = [leverage, *(-curves[name] for name in nonnegative)]
    edges = _inner_roots(rules, low, high)
    others = np.delete(np.arange(len(support.inputs)), column)
    inside = np.all((points[0, others] >= support.lower[others]) & (points[0, others] <= support.upper[others]))
    candidates = np.unique(np.r_[edges, _inner_roots([*held.values(), goal.deriv()], low, high)])
    supported = inside & _kept(rules, candidates)
    feasible = supported & _kept(list(held.values()), candidates)
    if not feasible.any():
        if not supported.any():
            raise ConvergenceError(f"no soi_cad in [{low:.4g}, {high:.4g}] is supported: change the other inputs")
        near = ", ".join(
            f"{n} >= {curves[n](candidates[supported]).min():.4g} (limit {v:g})" for n, v in limits.items()
        )
        raise ConvergenceError(
            f"no supported soi_cad in [{low:.4g}, {high:.4g}] meets the limits together; each alone: {near}; "
            "raise a limit"
        )
    best = float(candidates[int(np.argmax(np.where(feasible, goal(candidates), -np.inf)))])
    start, end = _range_around(best, edges, inside & _kept(rules, 0.5 * (edges[1:] + edges[:-1])))
    return Optimum(
        inputs={"soi_cad": best},
        objective=" + ".join(name if weight == 1.0 else f"{weight:g} {name}" for name, weight in weights.items()),
        value=float(goal(best)),
        values={name: float(curve(best)) for name, curve in curves.items()},
        limits=kept,
        active_limits=tuple(n for n, curve in held.items() if abs(curve(best)) <= _TINY * max(1.0, abs(limits[n]))),
        at_bound=min(best - start, end - best) <= _TINY * (high - low),
        bounds={"soi_cad": (start, end)},
        curvature=float(goal.deriv(2)(best)),
    )


def _inner_roots(curves: list[Polynomial], low: float, high: float) -> NDArray[np.float64]:
    """Return the ends of the range and the real roots between them, sorted."""
    found = [low, high]
    for curve in curves:
        slope = curve.deriv()
        for root in curve.trim(_TINY**2 * np.abs(curve.coef).max()).roots():
            at = float(np.real(root))
            for _ in range(3):  # Newton: a nearly straight curve spoils the digits of its companion matrix
                at = at - float(curve(at) / slope(at)) if slope(at) != 0.0 else at
            if abs(np.imag(root)) < _TINY * (high - low) and low < at < high:
                found.append(at)
    return np.unique(found)


def _range_around(best: float, edges: NDArray[np.float64], supported: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the supported interval that holds the best SOI, joined across roots where nothing changes."""
    first = int(np.searchsorted(edges, best, side="right")) - 1
    last = int(np.searchsorted(edges, best, side="left"))
    while first > 0 and supported[first - 1]:
        first -= 1
    while last < edges.size - 1 and supported[last]:
        last += 1
    return float(edges[first]), float(edges[last])


def _kept(curves: list[Polynomial], at: NDArray[np.float64]) -> NDArray[np.bool_]:
    out = np.ones(at.size, dtype=np.bool_)
    for curve in curves:
        out &= curve(at) <= _TINY * (1.0 + np.abs(curve.coef).max())
    return out
