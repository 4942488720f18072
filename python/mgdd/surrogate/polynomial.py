"""Polynomial of a response: its terms, where it was fitted, which terms it needs, and its prediction at new points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from mgdd.results.describe import described

MODELS = ("linear", "interactions", "quadratic", "cubic")


@dataclass(frozen=True, kw_only=True, eq=False)
class PolynomialBasis:
    """Products of the inputs z = (x - centre)/scale; a row of `monomials` has the inputs of one term, 0 for none."""

    centre: NDArray[np.float64]
    scale: NDArray[np.float64]
    monomials: NDArray[np.intp]

    @classmethod
    def of(cls, model: str | int, *, centre: NDArray[np.float64], scale: NDArray[np.float64]) -> PolynomialBasis:
        """Return all terms of a model of `MODELS`, or of a degree: first 1, then the inputs, then the products."""
        return cls(centre=centre, scale=scale, monomials=_monomials(model, centre.size))

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the terms, shape (n, p), of points of shape (n, m)."""
        z = np.column_stack([np.ones(len(points)), (points - self.centre) / self.scale])
        terms = z[:, self.monomials[:, 0]]
        for column in self.monomials.T[1:]:
            terms = terms * z[:, column]
        return np.asarray(terms, dtype=np.float64)

    def only(self, columns: Sequence[int] | NDArray[np.intp]) -> PolynomialBasis:
        """Return some of the terms."""
        return PolynomialBasis(centre=self.centre, scale=self.scale, monomials=self.monomials[columns])

    def names(self, inputs: Sequence[str]) -> tuple[str, ...]:
        """Name the terms, for example ``1``, ``soi_cad``, ``soi_cad^2`` and ``soi_cad*fuel_mg``."""
        terms = []
        for monomial in self.monomials.tolist():
            powers = Counter(inputs[place - 1] for place in monomial if place > 0)
            terms.append("*".join(name if power == 1 else f"{name}^{power}" for name, power in powers.items()) or "1")
        return tuple(terms)


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """Where a surrogate is valid: a box of quantiles, and leverage no higher than records in it have.

    Parameters
    ----------
    inputs : tuple of str
        Names, in the order of the points.
    lower, upper : ndarray, shape (m,)
        The box, in the units of the inputs.
    leverage_limit : float
        Leverage that the same share of the records in the box does not exceed [-]; corners of the box do.
    basis : PolynomialBasis
        Turns points into terms.
    root : ndarray, shape (p, p)
        W, whose product with the terms has the leverage as its sum of squares; over the n records in the box its
        mean is p/n.
    """

    inputs: tuple[str, ...]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    leverage_limit: float
    basis: PolynomialBasis
    root: NDArray[np.float64]

    def __post_init__(self) -> None:
        # One layout in memory, so that a product has the same last bits after a round trip through a file.
        object.__setattr__(self, "root", np.ascontiguousarray(self.root))

    def leverage(self, points: Sequence[Sequence[float]] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far points are from the middle of the records, in the metric of the fit."""
        return self._leverage_of(self.basis(np.asarray(points, dtype=np.float64)))

    def contains(self, points: Sequence[Sequence[float]] | NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points lie in the box and do not exceed the leverage limit."""
        at = np.asarray(points, dtype=np.float64)
        return self.contains_terms(at, self.basis(at))

    def contains_terms(self, at: NDArray[np.float64], terms: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return the same of points whose terms are known."""
        inside = np.all((at >= self.lower) & (at <= self.upper), axis=1)
        return np.asarray(inside & (self._leverage_of(terms) <= self.leverage_limit * (1.0 + 1e-9)), dtype=np.bool_)

    def _leverage_of(self, terms: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.sum((terms @ self.root.T) ** 2, axis=1), dtype=np.float64)


@lru_cache
def _monomials(model: str | int, inputs: int) -> NDArray[np.intp]:
    """Return the rows of `PolynomialBasis`: every way to pick `degree` of 1, z_1, ... z_m, in their order."""
    degree = model if isinstance(model, int) else {"linear": 1, "cubic": 3}.get(model, 2)
    rows = list(combinations_with_replacement(range(inputs + 1), degree))
    if model == "interactions":
        rows = [row for row in rows if row[0] != row[1] or row[0] == 0]
    out = np.array(rows, dtype=np.intp)
    out.flags.writeable = False
    return out


def support_of(
    points: NDArray[np.float64], basis: PolynomialBasis, *, inputs: tuple[str, ...], share: float
) -> Support:
    """Find the support of the points that a surface was fitted to."""
    tail = 0.5 * (1.0 - share)
    lower, upper = np.quantile(points, [tail, 1.0 - tail], axis=0)
    inside = points[np.all((points >= lower) & (points <= upper), axis=1)]
    # W = R^-T of T = QR: |R^-T t|² = t' (T'T)^-1 t
    triangle = np.linalg.qr(basis(inside), mode="r")
    root = np.linalg.inv(triangle).T
    bare = Support(inputs=inputs, lower=lower, upper=upper, leverage_limit=np.inf, basis=basis, root=root)
    limit = float(np.quantile(bare.leverage(inside), share))
    return Support(inputs=inputs, lower=lower, upper=upper, leverage_limit=limit, basis=basis, root=root)


_LEAST_GAIN = 1e-6  # of a criterion: below it rounding decides
_LEAST_FREEDOM = 3
_DEPENDENT = 1e-9  # of the triangle of a QR factorisation: a term that the others make up

Monomial = tuple[int, ...]


def leverage_of(terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the diagonal of the hat matrix of rows of terms."""
    orthogonal, _ = np.linalg.qr(terms)
    return np.asarray(np.minimum(np.sum(orthogonal**2, axis=1), 1.0), dtype=np.float64)


def choose_terms(
    terms: NDArray[np.float64], values: NDArray[np.float64], monomials: NDArray[np.intp], criterion: str
) -> NDArray[np.intp]:
    """Choose columns of the terms by the least criterion, searching from the constant and from all terms.

    A step adds a term with all its factors (the square and the product need their inputs), or drops one that no other
    term needs; the best step is taken until none helps. The terms, shape (n, p), are those of the full polynomial, the
    constant first; the criterion is Schwarz's ("bic") or the squared errors of left-out points ("press").

    References
    ----------
    Schwarz (1978), Estimating the Dimension of a Model.
    Allen (1974), The relationship between variable selection and data augmentation and a method for prediction.
    """
    rows: list[Monomial] = [tuple(row) for row in monomials.tolist()]
    place = {row: index for index, row in enumerate(rows)}
    # The factors of a term: the monomials of one degree less that it contains.
    above = [[tuple(sorted((*row[:k], 0, *row[k + 1 :]))) for k, power in enumerate(row) if power > 0] for row in rows]
    needs = [frozenset(place[factor] for factor in factors if factor in place) for factors in above]

    @cache
    def with_factors(term: int) -> frozenset[int]:
        return frozenset({term}).union(*map(with_factors, needs[term]))

    criteria: dict[frozenset[int], float] = {}

    def worth(chosen: frozenset[int]) -> float:
        if chosen not in criteria:
            criteria[chosen] = _criterion(terms[:, sorted(chosen)], values, criterion)
        return criteria[chosen]

    def searched(some: frozenset[int]) -> frozenset[int]:
        while True:
            needed: frozenset[int] = frozenset().union(*(needs[term] for term in some))
            trials: list[frozenset[int]] = [some | with_factors(term) for term in range(len(rows)) if term not in some]
            trials += [some - {term} for term in some - needed if term != 0]
            best = min([some, *trials], key=worth)
            if not worth(best) < worth(some) - _LEAST_GAIN:
                return some
            some = best

    searches = [searched(frozenset({0}))]
    if np.isfinite(worth(frozenset(range(len(rows))))):
        searches.append(searched(frozenset(range(len(rows)))))
    least = min(searches, key=worth)
    return np.array(sorted(least), dtype=np.intp)


def _criterion(terms: NDArray[np.float64], values: NDArray[np.float64], criterion: str) -> float:
    n, p = terms.shape
    if n - p < _LEAST_FREEDOM:
        return np.inf
    orthogonal, triangle = np.linalg.qr(terms)
    diagonal = np.abs(np.diag(triangle))
    if diagonal.min() < _DEPENDENT * diagonal.max():
        return np.inf
    residual = values - orthogonal @ (orthogonal.T @ values)
    floor = (np.finfo(np.float64).eps * np.abs(values).max()) ** 2  # of an exact fit, whose residual is rounding
    if criterion == "press":
        room = np.maximum(1.0 - np.sum(orthogonal**2, axis=1), 1e-12)
        return float(n * np.log(max(np.mean((residual / room) ** 2), floor)))
    return float(n * np.log(max(np.mean(residual**2), floor)) + p * np.log(n))


@dataclass(frozen=True, kw_only=True, eq=False)
class PolynomialSurface:
    """Coefficients of the terms of a support, in the unit of the response, and the noise about them.

    References
    ----------
    Cook and Weisberg (1982), Residuals and Influence in Regression, section 2.2.
    """

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    support: Support
    coefficients: NDArray[np.float64]
    noise_sd: float

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the noise: points less terms."""
        return float(self.values.size - self.coefficients.size)

    def predict(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean and its standard deviation, noise not included, at points of shape (n, m)."""
        terms = self.support.basis(points)
        return terms @ self.coefficients, self.noise_sd * np.sqrt(self.support.leverage(points))

    def supports(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points lie in the ranges of the fitted ones, with no higher leverage than these."""
        return self.support.contains(points)

    def fitted(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the mean at the points, and the weight of each point in its own (the leverage)."""
        terms = self.support.basis(self.points)
        return terms @ self.coefficients, leverage_of(terms)

    def left_out(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the prediction of each point from the others, and the externally studentised residual.

        NaN where the others do not determine it.
        """
        mean, leverage = self.fitted()
        residual, room = self.values - mean, 1.0 - leverage
        alone = room < 1e-9  # the polynomial passes through this point whatever is measured
        error = np.where(alone, np.nan, residual / np.where(alone, 1.0, room))
        others = self.freedom - 1.0
        if others < 1.0:
            return self.values - error, np.full(error.size, np.nan)
        without = np.maximum(np.sum(residual**2) - residual * error, 0.0) / others
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.values - error, error * np.sqrt(room) / np.sqrt(without)
