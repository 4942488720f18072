"""Wiener-Hammerstein circuit: a linear filter, a static curve, a linear filter, as a simulator of a few lines."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError
from mgdd.identify import SimulatorModel, fit_model
from mgdd.optimize import FitOptions
from mgdd.results import Fit
from mgdd.signals.even_grid import even_step

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Vector = NDArray[np.float64]

__all__ = ["Circuit", "LinearFilter", "fit_linear", "fit_wiener_hammerstein"]

_SKIP = 100  # samples in which a filter that starts at rest forgets it
_SCAN_DEGREE = 6  # of the polynomial that stands for the curve while partitions are compared
_SCAN_STEPS = 40  # trial steps of the short fit of a partition
_MARGIN = 0.05  # of the range of the signal, on either side of the curve's grid


@dataclass(frozen=True)
class LinearFilter:
    """A filter B/A about the mean of a record: ``a1`` to ``an``, ``b0`` to ``bn``, then the means of in- and output."""

    order: int

    def __call__(self, x: Vector, u: Vector, p: Vector) -> Vector:
        """Filter the deviation of the input."""
        del x
        a, b = np.r_[1.0, p[: self.order]], p[self.order : -2]
        return np.asarray(_filtered(b, a, u[:, 0] - p[-2]) + p[-1])

    def model(self, a: Vector, b: Vector, input_mean: float, output_mean: float) -> SimulatorModel:
        """Make a model with these coefficients."""
        values = {**_named("a", a[1:], 1), **_named("b", b, 0), "input_mean": input_mean, "output_mean": output_mean}
        return _model(self, values)


@dataclass(frozen=True)
class Circuit:
    """Filter, cubic spline, filter; both filters have gain 1 at rest, so the curve carries the unit and the gain.

    Parameters of each filter: ``a1`` to ``an``, ``b0`` to ``b(n - 1)``, the last one follows from the gain; then the
    coefficients of the spline, on equal steps from `lower` to `upper`.

    Parameters
    ----------
    first_order, last_order, n_curve : int
        Orders of the filters and number of spline coefficients.
    lower, upper : float
        Grid of the curve, in the unit of the input.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import Circuit
    >>> circuit = Circuit(first_order=1, last_order=1, n_curve=4, lower=-1.0, upper=1.0)
    >>> p = np.r_[-0.5, 0.5, -0.5, 0.5, -3.0, -1.0, 1.0, 3.0]  # two lags, and a curve that is the identity
    >>> circuit(np.empty(0), np.ones((3, 1)), p).round(4).tolist()
    [0.25, 0.5, 0.6875]
    """

    first_order: int
    last_order: int
    n_curve: int
    lower: float
    upper: float

    def __call__(self, x: Vector, u: Vector, p: Vector) -> Vector:
        """Simulate from rest."""
        del x
        first, last, curve = np.split(p, [2 * self.first_order, 2 * (self.first_order + self.last_order)])
        between = _filtered(*_gain_one(first), u[:, 0])
        return _filtered(*_gain_one(last), self.curve(between, curve))

    def curve(self, signal: Vector, coefficients: Vector) -> Vector:
        """Evaluate the static curve at what leaves the first filter; it goes on straight beyond its grid."""
        from scipy.interpolate import BSpline

        step = (self.upper - self.lower) / (self.n_curve - 3)
        spline = BSpline(self.lower + step * np.arange(-3, self.n_curve + 1), coefficients, 3)
        inside = np.clip(signal, self.lower, self.upper)
        value: Vector = spline(inside)
        out = np.flatnonzero(inside != signal)
        value[out] += spline(inside[out], nu=1) * (signal[out] - inside[out])
        return value

    def model(self, values: Vector) -> SimulatorModel:
        """Make a model with these coefficients."""
        named: dict[str, float] = {}
        for name, order, at in (("first", self.first_order, 0), ("last", self.last_order, 2 * self.first_order)):
            named |= _named(f"{name}_a", values[at : at + order], 1)
            named |= _named(f"{name}_b", values[at + order : at + 2 * order], 0)
        return _model(self, named | _named("curve", values[2 * (self.first_order + self.last_order) :], 0))


def fit_linear(record: xr.Dataset, *, order: int = 6, iterations: int = 15) -> SimulatorModel:
    """Fit a linear filter by repeated prefiltered least squares; the best iteration is kept.

    Parameters
    ----------
    record : xarray.Dataset
        ``input_v`` and ``output_v``.
    order : int
        Of numerator and denominator, 1 to 10.
    iterations : int
        Passes.

    Returns
    -------
    SimulatorModel
        A `LinearFilter`.

    Raises
    ------
    mgdd.errors.ParameterError
        An order outside its range.
    mgdd.errors.DataError
        Fewer than 1000 samples.

    References
    ----------
    Steiglitz and McBride (1965), A technique for the identification of linear systems.

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import fit_linear
    >>> if "wh2009" in records.names():
    ...     train = records.read("wh2009")[0]
    ...     error = fit_linear(train, order=2, iterations=3).simulate(train)["output_v"] - train["output_v"]
    ...     assert error.std() > 0.04
    """
    if not 1 <= order <= 10:
        raise ParameterError.of("order", order, "in [1, 10]")
    u, y = _signals(record)
    mean_u, mean_y = float(u.mean()), float(y.mean())
    u, y = u - mean_u, y - mean_y
    a = np.r_[1.0, np.zeros(order)]
    best: tuple[float, Vector, Vector] = (np.inf, a, a)
    n = u.size
    for _ in range(iterations):
        uf, yf = _filtered(np.ones(1), a, u), _filtered(np.ones(1), a, y)
        columns = [-yf[order - i : n - i] for i in range(1, order + 1)]
        columns += [uf[order - i : n - i] for i in range(order + 1)]
        regressors = np.column_stack(columns)
        estimate = np.linalg.solve(regressors.T @ regressors, regressors.T @ yf[order:])
        roots = np.roots(np.r_[1.0, estimate[:order]])
        a = np.asarray(np.real(np.poly(np.where(np.abs(roots) > 1.0, 1.0 / np.conj(roots), roots))), dtype=np.float64)
        b = np.asarray(estimate[order:], dtype=np.float64)
        error = float(np.sqrt(np.mean((y - _filtered(b, a, u))[_SKIP:] ** 2)))
        if error < best[0]:
            best = (error, b, a)
    return LinearFilter(order).model(best[2], best[1], mean_u, mean_y)


def fit_wiener_hammerstein(
    record: xr.Dataset,
    *,
    linear_order: int = 6,
    first_order: int = 3,
    last_order: int = 4,
    n_curve: int = 20,
    follow: int = 4,
    scan_samples: int = 8000,
    options: FitOptions | None = None,
) -> Fit:
    """Fit filter, curve and filter to the response of a circuit.

    A linear approximation comes first. Its poles and zeros are shared out between the two filters in every possible
    way; each partition is judged with a polynomial curve on the first `scan_samples`, the best few are fitted there
    completely, and the winner on the whole record. All parameters move together then.

    Parameters
    ----------
    record : xarray.Dataset
        ``input_v`` [V] and ``output_v`` [V], evenly spaced.
    linear_order : int
        Of the linear approximation.
    first_order, last_order : int
        Of the two filters; a partition with more poles on one side swaps or is left out.
    n_curve : int
        Coefficients of the cubic spline, at least 4.
    follow : int
        Partitions that get a complete short fit.
    scan_samples : int
        Samples used until one partition has won.
    options : FitOptions, optional
        15 trial steps and a tolerance of 1e-7 of the last fit by default, otherwise as of `mgdd.identify.fit_model`.

    Returns
    -------
    mgdd.results.Fit
        Report, first 100 samples left out, and model, whose simulator is a `Circuit`.

    Raises
    ------
    mgdd.errors.ParameterError
        An order or a number outside its range.
    mgdd.errors.DataError
        Fewer than 1000 samples, or no partition that fits the orders.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the search that was under way.

    References
    ----------
    Schoukens, Pintelon and Rolain (2014), Identification of Wiener-Hammerstein systems by a nonparametric separation
    of the best linear approximation.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.optimize import FitOptions
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import fit_linear, fit_wiener_hammerstein
    >>> from mgdd.results.labels import labelled_dataset
    >>> rng = np.random.default_rng(1)
    >>> u = np.convolve(rng.standard_normal(6003), np.ones(4) / 4.0, "valid")
    >>> x, w, y = np.zeros(6000), np.zeros(6000), np.zeros(6000)
    >>> for k in range(1, 6000):
    ...     x[k] = 0.9 * x[k - 1] + 0.1 * u[k]
    ...     w[k] = np.tanh(4.0 * x[k])
    ...     y[k] = 0.3 * y[k - 1] + 0.7 * w[k]
    >>> record = labelled_dataset({
    ...     "time_s": ("time_s", np.arange(6000) / 1000.0, "s", "time"),
    ...     "input_v": ("time_s", u, "V", "input"), "output_v": ("time_s", y, "V", "output")})
    >>> fit = fit_wiener_hammerstein(
    ...     record, linear_order=2, first_order=1, last_order=1, scan_samples=3000,
    ...     options=FitOptions(max_iterations=60))
    >>> linear = fit_linear(record, order=2).simulate(record)["output_v"] - record["output_v"]
    >>> fit.train.rmse < 0.1 * float(linear.std())
    True
    """
    if not 1 <= follow <= 1000:
        raise ParameterError.of("follow", follow, "in [1, 1000]")
    ParameterError.unless(n_curve >= 4, "n_curve", n_curve, ">= 4")
    given = options or FitOptions()
    last = FitOptions(
        n_starts=given.n_starts,
        seed=given.seed,
        max_iterations=given.max_iterations or 15,
        tolerance=given.tolerance or 1e-7,
    )
    u, y = _signals(record)
    linear = np.array(list(fit_linear(record, order=linear_order).parameters.values()))
    a, b = np.r_[1.0, linear[:linear_order]], linear[linear_order:-2]
    some = record.isel(time_s=slice(0, scan_samples))
    candidates = _partitions(a, b, u[:scan_samples], y[:scan_samples], first_order, last_order)[:follow]
    if not candidates:
        raise DataError(
            f"no partition of {linear_order} poles fits first_order = {first_order} and last_order = {last_order}: "
            "raise the orders"
        )
    short = FitOptions(max_iterations=_SCAN_STEPS, tolerance=1e-4)
    fits = [
        fit_model(
            _start(candidate, first_order, last_order, n_curve, u[:scan_samples]), some, skip=_SKIP, options=short
        )
        for candidate in candidates
    ]
    best = min(fits, key=lambda fit: fit.report.cost)
    return fit_model(best.model, record, skip=_SKIP, options=last)


def _model(simulator: LinearFilter | Circuit, values: dict[str, float]) -> SimulatorModel:
    return SimulatorModel(simulator=simulator, parameters=values, input_names=("input_v",), output_names=("output_v",))


def _named(name: str, values: Vector, first: int) -> dict[str, float]:
    return {f"{name}{i + first}": float(value) for i, value in enumerate(values)}


def _gain_one(p: Vector) -> tuple[Vector, Vector]:
    """Return numerator and denominator of a filter, the last numerator coefficient such that its gain is 1."""
    order = p.size // 2
    a = np.r_[1.0, p[:order]]
    return np.r_[p[order:], a.sum() - p[order:].sum()], a


def _filtered(b: Vector, a: Vector, signal: Vector) -> Vector:
    from scipy.signal import lfilter

    return np.asarray(lfilter(b, a, signal), dtype=np.float64)


def _signals(record: xr.Dataset) -> tuple[Vector, Vector]:
    u, y = record["input_v"].to_numpy(), record["output_v"].to_numpy()
    if u.size < 1000:
        raise DataError(f"the record has {u.size} samples: at least 1000 are needed")
    even_step(record["time_s"])
    return u, y


def _groups(roots: NDArray[Any]) -> list[list[complex]]:
    pairs = [[complex(z), complex(z.conjugate())] for z in roots if z.imag > 1e-9]
    return pairs + [[complex(z.real)] for z in roots if abs(z.imag) <= 1e-9]


def _polynomial(groups: list[list[complex]]) -> Vector:
    return np.atleast_1d(np.real(np.poly([z for group in groups for z in group]))).astype(np.float64)


Candidate = tuple[float, "Vector", "Vector", "Vector", "Vector", "Vector", float]


def _partitions(a: Vector, b: Vector, u: Vector, y: Vector, first: int, last: int) -> list[Candidate]:
    """Every way to share out poles and zeros, with the error that a polynomial curve leaves; best first."""
    poles, zeros = _groups(np.roots(a)), _groups(np.roots(b))
    found: list[Candidate] = []
    for pole_side in itertools.product((0, 1), repeat=len(poles)):
        for zero_side in itertools.product((0, 1), repeat=len(zeros)):
            filters = []
            for side in (0, 1):
                denominator = _polynomial([g for g, at in zip(poles, pole_side, strict=True) if at == side])
                numerator = _polynomial([g for g, at in zip(zeros, zero_side, strict=True) if at == side])
                filters.append((numerator * denominator.sum() / numerator.sum(), denominator))
            (b1, a1), (b2, a2) = filters
            proper = b1.size <= a1.size and b2.size <= a2.size
            if not (proper and 2 <= a1.size <= first + 1 and 2 <= a2.size <= last + 1):
                continue
            between = _filtered(b1, a1, u)
            scale = float(np.abs(between).max())
            columns = [_filtered(b2, a2, (between / scale) ** k) for k in range(_SCAN_DEGREE + 1)]
            regressors = np.column_stack(columns)[_SKIP:]
            curve = np.asarray(np.linalg.lstsq(regressors, y[_SKIP:], rcond=None)[0], dtype=np.float64)
            error = float(np.sqrt(np.mean((regressors @ curve - y[_SKIP:]) ** 2)))
            found.append((error, b1, a1, b2, a2, curve, scale))
    return sorted(found, key=lambda entry: entry[0])


def _padded(b: Vector, a: Vector, order: int) -> tuple[Vector, Vector]:
    """Raise a filter to an order by poles and zeros that cancel, on a circle of radius 0.3."""
    extra = order + 1 - a.size
    angles = np.pi * (2.0 * np.arange(extra) + 1.0) / max(extra, 1)
    cancel = np.atleast_1d(np.real(np.poly(0.3 * np.exp(1j * angles))))
    a, b = np.convolve(a, cancel), np.convolve(b, cancel)
    return np.r_[b, np.zeros(a.size - b.size)], a


def _start(candidate: Candidate, first: int, last: int, n_curve: int, u: Vector) -> SimulatorModel:
    _, b1, a1, b2, a2, curve, scale = candidate
    (b1, a1), (b2, a2) = _padded(b1, a1, first), _padded(b2, a2, last)
    between = _filtered(b1, a1, u)
    margin = _MARGIN * float(np.ptp(between))
    circuit = Circuit(first, last, n_curve, float(between.min()) - margin, float(between.max()) + margin)
    grid = np.linspace(circuit.lower, circuit.upper, 20 * n_curve)
    basis = np.column_stack([circuit.curve(grid, unit) for unit in np.eye(n_curve)])
    wanted = sum(c * (grid / scale) ** k for k, c in enumerate(curve))
    coefficients = np.linalg.lstsq(basis, wanted, rcond=None)[0]
    return circuit.model(np.r_[a1[1:], b1[:-1], a2[1:], b2[:-1], coefficients])
