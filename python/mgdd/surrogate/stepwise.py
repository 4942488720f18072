"""Which terms of a polynomial a response needs: forward and backward, a product never without its factors."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["choose_terms", "leverage_of"]

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
    term needs; the best step is taken until none helps.

    Parameters
    ----------
    terms : ndarray, shape (n, p)
        Terms of the full polynomial, the constant first.
    values : ndarray, shape (n,)
        Response.
    monomials : ndarray of int, shape (p, degree)
        What the terms are, as in `PolynomialBasis`.
    criterion : {"bic", "press"}
        Schwarz's criterion, or the squared errors of left-out points.

    Returns
    -------
    ndarray of int
        Columns in order.

    References
    ----------
    Schwarz (1978), Estimating the Dimension of a Model.
    Allen (1974), The relationship between variable selection and data augmentation and a method for prediction.
    """
    rows: list[Monomial] = [tuple(row) for row in monomials.tolist()]
    place = {row: index for index, row in enumerate(rows)}
    needs = [frozenset(place[above] for above in _factors(row) if above in place) for row in rows]

    @cache
    def with_factors(term: int) -> frozenset[int]:
        return frozenset({term}).union(*(with_factors(above) for above in needs[term]))

    known: dict[frozenset[int], float] = {}

    def worth(kept: frozenset[int]) -> float:
        if kept not in known:
            known[kept] = _criterion(terms[:, sorted(kept)], values, criterion)
        return known[kept]

    def searched(kept: frozenset[int]) -> frozenset[int]:
        while True:
            needed: frozenset[int] = frozenset().union(*(needs[term] for term in kept))
            trials: list[frozenset[int]] = [kept | with_factors(term) for term in range(len(rows)) if term not in kept]
            trials += [kept - {term} for term in kept - needed if term != 0]
            best = min([kept, *trials], key=worth)
            if not worth(best) < worth(kept) - _LEAST_GAIN:
                return kept
            kept = best

    found = [searched(frozenset({0}))]
    if np.isfinite(worth(frozenset(range(len(rows))))):
        found.append(searched(frozenset(range(len(rows)))))
    least = min(found, key=worth)
    return np.array(sorted(least), dtype=np.intp)


def _factors(row: Monomial) -> set[Monomial]:
    """Return the monomials of one degree less that a monomial contains."""
    return {tuple(sorted((*row[:k], 0, *row[k + 1 :]))) for k, place in enumerate(row) if place > 0}


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
