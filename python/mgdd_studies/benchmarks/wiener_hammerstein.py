"""Wiener-Hammerstein models: a linear filter, a static curve, a linear filter."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd._core import systems
from mgdd.errors import DataError, ParameterError
from mgdd.io.parameters import FIT_NOTES, ParameterFile, Parameters, entries, wanted
from mgdd.optimize.least_squares import CoreReport, FitOptions, LeastSquaresOptions, fit_of, fit_options, fit_run
from mgdd.parallel.finished import hand_over, keep_finished
from mgdd.results import Fit
from mgdd.results.describe import described
from mgdd.results.fit_report import FitReport
from mgdd.results.labels import Label
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import RunInputs, SampledModel

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    Vector = NDArray[np.float64]

__all__ = [
    "LinearApproximation", "WienerHammersteinFit", "WienerHammersteinModel", "fit_linear", "fit_wiener_hammerstein",
]  # fmt: skip

_LABELS = MappingProxyType({"input_v": Label("V", "input voltage"), "output_v": Label("V", "output voltage")})
_SKIP = 100  # samples in which a filter that starts at rest forgets it
_SCAN_DEGREE = 6  # of the polynomial that stands for the curve while partitions are compared
_UNITS = dict.fromkeys(("input_mean", "output_mean", "rmse", "lower", "upper"), "unit of the record")
_MARGIN = 0.05  # of the range of the signal, on either side of the curve's grid


@described
@dataclass(frozen=True, kw_only=True)
class LinearApproximation(SampledModel, Parameters):
    """A linear filter B/A about the mean of a record.

    Parameters
    ----------
    numerator, denominator : ndarray
        Coefficients of q^-1, the first of the denominator is 1.
    input_mean, output_mean : float
        Taken off the input, added to the output, in the units of the record.
    rmse : float
        Of the response over the record, first 100 samples left out [unit of the output].

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import LinearApproximation
    >>> lag = LinearApproximation(
    ...     numerator=np.array([0.5]), denominator=np.array([1.0, -0.5]), input_mean=0.0, output_mean=1.0, rmse=0.0)
    >>> lag.simulate({"time_s": [0.0, 1.0, 2.0], "input_v": [1.0, 1.0, 1.0]})["output_v"].values.tolist()
    [1.5, 1.75, 1.875]
    """

    kind = "linear_filter"
    input_names = ("input_v",)
    output_name = "output_v"
    labels = _LABELS

    numerator: Vector
    denominator: Vector
    input_mean: float
    output_mean: float
    rmse: float

    @property
    def parameters(self) -> dict[str, float]:
        """Coefficients by name."""
        both = {"numerator": self.numerator, "denominator": self.denominator}
        return {f"{name}_{i}": float(value) for name, values in both.items() for i, value in enumerate(values)}

    def _rest(self) -> list[float]:
        return []

    def _run(self, run: RunInputs) -> Vector:
        deviation = run.columns[0] - self.input_mean
        return np.asarray(systems.filter_series(self.numerator, self.denominator, deviation)) + self.output_mean

    def to_parameters(self) -> ParameterFile:
        """Give filter and means, as `to_toml` writes them."""
        return _saved(self, ("numerator", "denominator", "input_mean", "output_mean", "rmse"))

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> LinearApproximation:
        """Make the filter of a file that `to_toml` or a fit wrote."""
        numbers, vectors = ("input_mean", "output_mean", "rmse"), ("numerator", "denominator")
        return cls(**_read(cls.kind, file, numbers=numbers, vectors=vectors))


@described
@dataclass(frozen=True, kw_only=True)
class WienerHammersteinModel(SampledModel, Parameters):
    """Filter, static curve, filter; both filters have gain 1 at rest.

    Parameters
    ----------
    first_order, last_order, n_curve : int
        Orders of the filters and number of spline coefficients.
    lower, upper : float
        Grid of the curve, in the unit of the input.
    values : ndarray
        Coefficients in the order of the report's names.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import WienerHammersteinModel
    >>> circuit = WienerHammersteinModel(
    ...     first_order=1, last_order=1, n_curve=4, lower=-1.0, upper=1.0,
    ...     values=np.r_[-0.5, 0.5, -0.5, 0.5, -3.0, -1.0, 1.0, 3.0])  # two lags, and a curve that is the identity
    >>> run = circuit.simulate({"time_s": [0.0, 1.0, 2.0], "input_v": [1.0, 1.0, 1.0]})
    >>> run["output_v"].values.round(4).tolist()
    [0.25, 0.5, 0.6875]
    """

    kind = "wiener_hammerstein"
    input_names = ("input_v",)
    output_name = "output_v"
    labels = _LABELS

    first_order: int
    last_order: int
    n_curve: int
    lower: float
    upper: float
    values: Vector

    @property
    def parameters(self) -> dict[str, float]:
        """Coefficients by name."""
        return dict(zip(_core_model(self).names, self.values.tolist(), strict=True))

    def _rest(self) -> list[float]:
        return []

    def _run(self, run: RunInputs) -> Vector:
        return np.asarray(_core_model(self).simulate(self.values, run.columns[0]))

    def to_parameters(self) -> ParameterFile:
        """Give orders, grid and coefficients, as `to_toml` writes them."""
        return _saved(self, ("first_order", "last_order", "n_curve", "lower", "upper", "values"))

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> WienerHammersteinModel:
        """Make the model of a file that `to_toml` or a fit wrote."""
        orders = ("first_order", "last_order", "n_curve")
        return cls(**_read(cls.kind, file, numbers=("lower", "upper"), vectors=("values",), integers=orders))

    def curve(self, signal: ArrayLike) -> Vector:
        """Evaluate the static curve.

        Parameters
        ----------
        signal : array_like, shape (n,)
            What leaves the first filter.

        Returns
        -------
        ndarray, shape (n,)
            What enters the last.
        """
        return np.asarray(_core_model(self).curve(self.values, np.asarray(signal, dtype=np.float64)))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WienerHammersteinFit(Fit):
    """A fit of a Wiener-Hammerstein model; `start_rmse` has the error of every partition that was followed.

    Parameters
    ----------
    linear : LinearApproximation
        The linear filter it started from.

    Examples
    --------
    >>> from mgdd_studies.benchmarks import records
    >>> from mgdd.optimize import FitOptions
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import fit_wiener_hammerstein
    >>> if "wh2009" in records.names():
    ...     some = records.read("wh2009")[0].isel(time_s=slice(0, 5000))
    ...     options = FitOptions(max_iterations=10)
    ...     fit = fit_wiener_hammerstein(some, scan_samples=5000, follow=3, options=options)
    ...     assert fit.train.rmse <= fit.linear.rmse
    """

    linear: LinearApproximation


def fit_linear(record: xr.Dataset, *, order: int = 6, iterations: int = 15) -> LinearApproximation:
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
    LinearApproximation
        The filter.

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
    ...     assert fit_linear(records.read("wh2009")[0], order=2, iterations=3).rmse > 0.04
    """
    if not 1 <= order <= 10:
        raise ParameterError.of("order", order, "in [1, 10]")
    u, y = _signals(record)
    mean_u, mean_y = float(u.mean()), float(y.mean())
    u, y = u - mean_u, y - mean_y
    a = np.r_[1.0, np.zeros(order)]
    best: tuple[float, Vector, Vector] = (np.inf, np.ones(1), np.ones(1))
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
    return LinearApproximation(
        numerator=best[1], denominator=best[2], input_mean=mean_u, output_mean=mean_y, rmse=best[0]
    )


def fit_wiener_hammerstein(
    record: xr.Dataset,
    *,
    linear_order: int = 6,
    first_order: int = 3,
    last_order: int = 4,
    n_curve: int = 20,
    follow: int = 8,
    scan_samples: int = 15_000,
    options: FitOptions | None = None,
) -> WienerHammersteinFit:
    """Fit filter, curve and filter to the response of a circuit.

    A linear approximation comes first. Its poles and zeros are shared out between the two filters in every possible
    way; each partition is judged with a polynomial curve on the first `scan_samples`, the best few are fitted there
    completely, and the winner on the whole record. All parameters move together then, with exact derivatives.

    Parameters
    ----------
    record : xarray.Dataset
        ``input_v`` [V] and ``output_v`` [V], evenly spaced.
    linear_order : int
        Of the linear approximation.
    first_order, last_order : int
        Of the two filters; a partition with more poles on one side swaps or is left out.
    n_curve : int
        Coefficients of the cubic spline.
    follow : int
        Partitions that get a complete short fit.
    scan_samples : int
        Samples used until one partition has won.
    options : FitOptions, optional
        30 trial steps and a tolerance of 1e-7 of the last fit by default; the other options have no
        effect here and are refused.

    Returns
    -------
    mgdd.results.Fit
        Report and model in the unit of the output, first 100 samples left out, and the linear start, ``linear``.

    Raises
    ------
    mgdd.errors.ParameterError
        An order or a number outside its range.
    mgdd.errors.DataError
        Fewer than 1000 samples, or no partition that fits the orders.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the best fit so far, to the first `scan_samples` until one partition has won.

    References
    ----------
    Schoukens, Pintelon and Rolain (2014), Identification of Wiener-Hammerstein systems by a nonparametric separation
    of the best linear approximation.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.optimize import FitOptions
    >>> from mgdd_studies.benchmarks.wiener_hammerstein import fit_wiener_hammerstein
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
    >>> fit.train.rmse < 0.1 * fit.linear.rmse
    True
    """
    if not 1 <= follow <= 1000:
        raise ParameterError.of("follow", follow, "in [1, 1000]")
    chosen = fit_options(options, max_iterations=30, tolerance=1e-7)
    u, y = _signals(record)
    linear = fit_linear(record, order=linear_order)
    some_u, some_y = u[:scan_samples], y[:scan_samples]
    candidates = _partitions(linear, some_u, some_y, first_order, last_order)[:follow]
    if not candidates:
        raise DataError(
            f"no partition of {linear_order} poles fits first_order = {first_order} and last_order = {last_order}: "
            "raise the orders"
        )
    models: list[systems.WienerHammerstein] = []
    reports: list[CoreReport] = []

    def short(candidate: Candidate) -> CoreReport:
        model, start = _start(candidate, first_order, last_order, n_curve, some_u)
        models.append(model)
        return _fit(model, start, some_u, some_y, 40)

    stop = keep_finished(short, candidates, reports)
    ranked = sorted(zip(reports, models, strict=False), key=lambda pair: float(pair[0].rmse))
    best, model = ranked[0]
    last = [best]
    if stop is None:
        stop = keep_finished(
            lambda start: _fit(model, start, u, y, chosen.max_iterations, chosen.tolerance), [best.values], last
        )
    report, seen = last[-1], y if len(last) > 1 else some_y
    wrapped = FitReport.from_core(report, seen[_SKIP:])
    fitted = WienerHammersteinModel(
        first_order=first_order, last_order=last_order, n_curve=n_curve, lower=model.lower, upper=model.upper,
        values=np.asarray(report.values),
    )  # fmt: skip
    modelled = fitted.simulate(record)["output_v"].to_numpy()
    run = fit_run(record["time_s"].to_numpy()[_SKIP:], y[_SKIP:], modelled[_SKIP:], _LABELS["output_v"])
    fit = fit_of(wrapped, fitted, run, (float(one.rmse) for one in reports))
    return hand_over(WienerHammersteinFit(**vars(fit), linear=linear), stop)


def _saved(model: LinearApproximation | WienerHammersteinModel, names: tuple[str, ...]) -> ParameterFile:
    return ParameterFile(kind=model.kind, tables={"parameters": entries({n: getattr(model, n) for n in names}, _UNITS)})


def _read(
    kind: str,
    file: ParameterFile,
    *,
    numbers: tuple[str, ...],
    vectors: tuple[str, ...],
    integers: tuple[str, ...] = (),
) -> dict[str, Any]:
    file.expect(kinds=(kind,), tables=("parameters", "fit?"), notes=FIT_NOTES)
    expected = {**wanted(numbers, _UNITS), **wanted(vectors, form="numbers"), **wanted(integers, form="integer")}
    values = file.values("parameters", expected)
    return values | {name: np.array(values[name], dtype=np.float64) for name in vectors}


def _filtered(b: Vector, a: Vector, signal: Vector) -> Vector:
    from scipy.signal import lfilter

    return np.asarray(lfilter(b, a, signal), dtype=np.float64)


def _signals(record: xr.Dataset) -> tuple[Vector, Vector]:
    u, y = record["input_v"].to_numpy(), record["output_v"].to_numpy()
    if u.size < 1000:
        raise DataError(f"the record has {u.size} samples: at least 1000 are needed")
    even_step(record["time_s"])
    return u, y


def _core_model(model: WienerHammersteinModel) -> systems.WienerHammerstein:
    return systems.WienerHammerstein(
        first_order=model.first_order, last_order=model.last_order, n_curve=model.n_curve, lower=model.lower,
        upper=model.upper,
    )  # fmt: skip


def _fit(
    model: systems.WienerHammerstein,
    start: Vector,
    u: Vector,
    y: Vector,
    iterations: int,
    tolerance: float = 1e-7,
) -> CoreReport:
    options = LeastSquaresOptions(max_iterations=iterations, cost_tolerance=tolerance)
    return model.fit(start=start, input=u, output=y, skip=_SKIP, options=options)


def _groups(roots: NDArray[Any]) -> list[list[complex]]:
    pairs = [[complex(z), complex(z.conjugate())] for z in roots if z.imag > 1e-9]
    return pairs + [[complex(z.real)] for z in roots if abs(z.imag) <= 1e-9]


def _polynomial(groups: list[list[complex]]) -> Vector:
    return np.atleast_1d(np.real(np.poly([z for group in groups for z in group]))).astype(np.float64)


Candidate = tuple[float, "Vector", "Vector", "Vector", "Vector", "Vector", float]


def _partitions(linear: LinearApproximation, u: Vector, y: Vector, first: int, last: int) -> list[Candidate]:
    """Every way to share out poles and zeros, with the error that a polynomial curve leaves; best first."""
    poles, zeros = _groups(np.roots(linear.denominator)), _groups(np.roots(linear.numerator))
    found: list[Candidate] = []
    for pole_side in itertools.product((0, 1), repeat=len(poles)):
        for zero_side in itertools.product((0, 1), repeat=len(zeros)):
            filters = []
            for side in (0, 1):
                a = _polynomial([g for g, at in zip(poles, pole_side, strict=True) if at == side])
                b = _polynomial([g for g, at in zip(zeros, zero_side, strict=True) if at == side])
                filters.append((b * a.sum() / b.sum(), a))
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


def _start(
    candidate: Candidate, first: int, last: int, n_curve: int, u: Vector
) -> tuple[systems.WienerHammerstein, Vector]:
    _, b1, a1, b2, a2, curve, scale = candidate
    (b1, a1), (b2, a2) = _padded(b1, a1, first), _padded(b2, a2, last)
    between = np.asarray(_filtered(b1, a1, u))
    margin = _MARGIN * float(np.ptp(between))
    lower, upper = float(between.min()) - margin, float(between.max()) + margin
    model = systems.WienerHammerstein(first_order=first, last_order=last, n_curve=n_curve, lower=lower, upper=upper)
    grid = np.linspace(lower, upper, 20 * n_curve)
    filters = np.r_[a1[1:], b1[:-1], a2[1:], b2[:-1]]
    unit = np.eye(n_curve)
    basis = np.column_stack([model.curve(np.r_[filters, unit[k]], grid) for k in range(n_curve)])
    wanted = sum(c * (grid / scale) ** k for k, c in enumerate(curve))
    coefficients = np.linalg.lstsq(basis, wanted, rcond=None)[0]
    return model, np.r_[filters, coefficients]
