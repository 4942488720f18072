"""How hard a fit searches: the same record for every fit."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from mgdd.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """How hard a fit searches; what is None keeps the default of the fit.

    Parameters
    ----------
    n_starts : int, optional
        Searches from different start values, >= 1; the best is kept.
    seed : int, optional
        Seed of the further start values, >= 0.
    max_iterations : int, optional
        Trial steps of a search, >= 1.
    tolerance : float, optional
        Relative decrease of the cost that ends a search, > 0 [-].

    Raises
    ------
    ParameterError
        A value outside its domain.

    Examples
    --------
    >>> from mgdd.optimize import FitOptions
    >>> FitOptions(n_starts=1).n_starts
    1
    """

    n_starts: int | None = None
    seed: int | None = None
    max_iterations: int | None = None
    tolerance: float | None = None

    def __post_init__(self) -> None:
        for name, least in (("n_starts", 1), ("seed", 0), ("max_iterations", 1)):
            value = getattr(self, name)
            if value is not None and not value >= least:
                raise ParameterError.of(name, value, f">= {least}")
        if self.tolerance is not None and not self.tolerance > 0.0:
            raise ParameterError.of("tolerance", self.tolerance, "> 0")


@dataclass(frozen=True, kw_only=True)
class Resolved:
    """Options in which nothing is left open; a fit reads those that it has."""

    n_starts: int = 1
    seed: int = 0
    max_iterations: int = 1
    tolerance: float = 1.0


def fit_options(options: FitOptions | None, **defaults: float | None) -> Resolved:
    """Fill in the defaults of a fit; an option that the fit does not have is refused."""
    given = {} if options is None else {f.name: getattr(options, f.name) for f in fields(options)}
    given = {name: value for name, value in given.items() if value is not None}
    for name in given:
        if name not in defaults:
            raise ParameterError(f"options: {name} has no effect on this fit, which has {', '.join(defaults)}")
    return replace(Resolved(), **{**defaults, **given})
