"""Least-squares quadratic of one input or several, whether it fits, and the readings near the best that it fits."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import DataError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_SIGNIFICANCE = 0.01  # of the test of lack of fit
_FEWEST_REPEATS = 3  # degrees of freedom of a noise that the test trusts
_ILL = 1e8  # condition of a design that shows nothing


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A quadratic J(theta), with arrays in the order of the inputs."""

    variance: float  # of one measurement about it
    freedom: int
    curvature: Array
    curvature_variance: Array  # per unit of `variance`
    optimum: Array
    optimum_variance: Array  # covariance
    bends: Array
    directions: Array


def fewest(inputs: int) -> int:
    """Return how many distinct points a quadratic of so many inputs needs; two more measurements show a scatter."""
    return (inputs + 1) * (inputs + 2) // 2


def _scaled(x: Array) -> tuple[Array, Array, Array]:
    """Return the columns scaled to [-1, 1], and their middles and half ranges."""
    middle, half = 0.5 * (x.min(axis=0) + x.max(axis=0)), 0.5 * (x.max(axis=0) - x.min(axis=0))
    return (x - middle) / half, middle, half


def fit_surface(x: Array, y: Array, *, maximize: bool, names: tuple[str, ...], where: str = "") -> Surface:
    """Fit J of inputs, x of shape (n, inputs), with all products."""
    count = x.shape[1]
    named = names or _numbered(x)
    if (unseen := _unseen(x, named)) is not None:
        raise DataError(f"theta: {unseen}")
    u, middle, half = _scaled(x)
    design, pairs = _terms(u)
    level = y.mean()
    c, *_ = np.linalg.lstsq(design, y - level, rcond=None)
    residual = y - level - design @ c
    freedom = y.size - design.shape[1]
    variance = float(residual @ residual) / max(freedom, 1)
    spread = np.linalg.inv(design.T @ design)

    slope, hessian = c[1 : count + 1], np.zeros((count, count))
    bend_variance = np.zeros((count, count))
    for place, (i, j) in enumerate(pairs, start=count + 1):
        hessian[i, j] = hessian[j, i] = c[place] * (2.0 if i == j else 1.0)
        bend_variance[i, j] = bend_variance[j, i] = spread[place, place] * (4.0 if i == j else 1.0)
    eigen = np.linalg.eigh(hessian)
    order = np.argsort(-np.abs(eigen.eigenvalues))
    bends, directions = eigen.eigenvalues[order], eigen.eigenvectors[:, order].T
    directions *= np.sign(directions[np.arange(count), np.abs(directions).argmax(axis=1)])[:, None]
    terms = np.array([[2.0 * d[i] * d[j] for i, j in pairs] for d in directions])
    own = spread[count + 1 :, count + 1 :]
    doubt = np.sqrt(np.maximum(variance * np.einsum("ij,jk,ik->i", terms, own, terms), 0.0))
    _check_bends(bends, doubt, directions, half, maximize=maximize, names=named, where=where)

    best = -np.linalg.solve(hessian, slope)
    lever = np.zeros((count, design.shape[1]))
    lever[:, 1 : count + 1] = np.eye(count)
    for place, (i, j) in enumerate(pairs, start=count + 1):
        lever[i, place] += best[j]
        lever[j, place] += best[i]
    lever = np.asarray(-np.linalg.solve(hessian, lever))
    area = np.outer(half, half)
    return Surface(
        variance=variance,
        freedom=freedom,
        curvature=hessian / area,
        curvature_variance=bend_variance / area**2,
        optimum=middle + half * best,
        optimum_variance=(lever @ spread @ lever.T) * area,
        bends=bends,
        directions=directions * half,
    )


def _numbered(x: Array) -> tuple[str, ...]:
    return ("theta",) if x.shape[1] == 1 else tuple(f"input {place}" for place in range(x.shape[1]))


def _along(direction: Array, half: Array, names: tuple[str, ...]) -> str:
    """Write a direction, in shares of half a range, in the units of the inputs; of one input its name."""
    if len(names) == 1:
        return names[0]
    steps = np.where(np.abs(direction) < 1e-6, 0.0, direction * half)  # not what rounding leaves
    return ", ".join(f"{name} {step:+.3g}" for name, step in zip(names, steps, strict=True))


def _terms(u: Array) -> tuple[Array, list[tuple[int, int]]]:
    """Return the columns 1, u and their products, and which product is which."""
    pairs = list(itertools.combinations_with_replacement(range(u.shape[1]), 2))
    return np.column_stack([np.ones(len(u)), u, *(u[:, i] * u[:, j] for i, j in pairs)]), pairs


def _unseen(x: Array, names: tuple[str, ...]) -> str | None:
    """Say what of a quadratic these points do not show, whatever J is; None where they show all of it."""
    for name, width in zip(names, np.ptp(x, axis=0), strict=True):
        if not width > 0.0:
            return f"{name} has one value only; vary it, or leave it out"
    u, _, half = _scaled(x)
    _, size, along = np.linalg.svd(u - u.mean(axis=0), full_matrices=False)
    if not size[-1] > size[0] / _ILL:
        return (
            f"its points lie on a line or plane, nothing varies along {_along(along[-1], half, names)}; vary the "
            "inputs apart from each other"
        )
    design, pairs = _terms(u)
    _, size, along = np.linalg.svd(design, full_matrices=False)
    if size[-1] > size[0] / _ILL:
        return None
    i, j = pairs[int(np.abs(along[-1][1 + len(names) :]).argmax())]
    what = f"the curvature of {names[i]}" if i == j else f"how {names[i]} and {names[j]} act together"
    return f"its points do not show {what}; spread them, or add some, as the corners of a grid of three values each"


def _check_bends(
    bends: Array, doubt: Array, along: Array, half: Array, *, maximize: bool, names: tuple[str, ...], where: str
) -> None:
    wrong = bends >= 0.0 if maximize else bends <= 0.0
    if not wrong.any():
        return
    worst = int(np.where(wrong, np.abs(bends), -1.0).argmax())
    side, end = ("up", "maximum") if maximize else ("down", "minimum")
    bent = "is flat" if abs(bends[worst]) <= 2.0 * doubt[worst] else f"bends {side}"
    way = f"{'over' if len(names) == 1 else 'along'} {_along(along[worst], half, names)}"
    raise DataError(
        f"J {bent} {way}{where} (curvature {bends[worst]:.3g}, standard error {doubt[worst]:.2g}): there is no {end}; "
        "widen the range of theta or repeat more often"
    )


def _richer(x: Array, y: Array) -> tuple[Array, int] | None:
    """Values of a model that bends more freely, and its degrees of freedom: means of repeats, else a polynomial."""
    _, group = np.unique(x, axis=0, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group)
    if y.size - count.size >= _FEWEST_REPEATS:
        centred = y - y.mean()
        return y.mean() + (np.bincount(group, centred) / count)[group], y.size - count.size
    for degree in (4, 3) if x.shape[1] > 1 else (4,):
        powers = [own for own in itertools.product(range(degree + 1), repeat=x.shape[1]) if sum(own) <= degree]
        if count.size < len(powers) or y.size - len(powers) < _FEWEST_REPEATS:
            continue
        u = _scaled(x)[0]
        single = [np.polynomial.chebyshev.chebvander(column, degree) for column in u.T]
        design = np.column_stack(
            [np.prod([one[:, power] for one, power in zip(single, own, strict=True)], axis=0) for own in powers]
        )
        if x.shape[1] > 1 and np.linalg.cond(design) > _ILL:
            continue
        return y.mean() + design @ np.linalg.lstsq(design, y - y.mean(), rcond=None)[0], y.size - len(powers)
    return None


def _fits(x: Array, y: Array, fit: Surface, noise: tuple[float, int]) -> bool:
    """F test of the quadratic against the richer model, with the variance of the noise and its degrees of freedom."""
    from scipy.special import fdtrc

    richer = _richer(x, y)
    if richer is None:
        return True
    more = fit.freedom - richer[1]
    # Rounding of exact readings is not noise.
    if more < 1 or fit.variance <= (1e-9 * float(np.abs(y).max())) ** 2:
        return True
    residual = y - richer[0]
    lack = max(fit.variance * fit.freedom - float(residual @ residual), 0.0) / more
    return bool(noise[0] > 0.0 and fdtrc(more, noise[1], lack / noise[0]) > _SIGNIFICANCE)


def narrowed(
    x: Array, y: Array, wide: Surface, fit: Callable[[Array, Array, str], Surface], *, maximize: bool
) -> tuple[Surface, NDArray[np.bool_], tuple[float, int]]:
    """Return the quadratic of the inputs nearest to the best that it fits, which those are, and the noise.

    x has the shape (n, inputs); the farthest distinct point, in scaled columns, is left out first.
    """
    used = np.ones(y.size, dtype=np.bool_)
    narrow, noise = wide, (wide.variance, wide.freedom)
    richer = _richer(x, y)
    if richer is None:
        return narrow, used, noise
    free = (float((y - richer[0]) @ (y - richer[0])) / richer[1], richer[1])
    scale = _scaled(x)[2]
    best = x[np.argmax(richer[0] if maximize else -richer[0])]
    while not _fits(x[used], y[used], narrow, free):
        noise = free
        at = np.unique(x[used], axis=0)
        away = np.linalg.norm((at - best) / scale, axis=1)
        farthest = at[away.size - 1 - away[::-1].argmax()]
        fewer = used & (x != farthest).any(axis=1)
        points = fewest(x.shape[1])
        if len(at) <= points or np.count_nonzero(fewer) < points + 2:
            break
        if _unseen(x[fewer], _numbered(x)) is not None:
            break
        used = fewer
        narrow = fit(x[used], y[used], f" in {span_of(x[used])}, over the whole of it J is not a parabola")
    return narrow, used, noise


def span_of(x: Array) -> str:
    """Write the range of one input, or of how many points several inputs are."""
    if x.shape[1] == 1:
        return f"[{x.min():.4g}, {x.max():.4g}]"
    return f"the {len(np.unique(x, axis=0))} points nearest to the best one"


def twice_as_wide(x: Array, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which points lie in a range twice as wide as that of the kept ones."""
    low, high = x[used].min(axis=0), x[used].max(axis=0)
    around: NDArray[np.bool_] = (np.abs(x - 0.5 * (low + high)) <= high - low).all(axis=1)
    return around
