"""Noise, curvature and optimum of a measured map of one input or several: inputs of the tuning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mgdd.errors import DataError, ShapeError
from mgdd.optimize.inputs import SEVERAL_ONLY, InputNumbers
from mgdd.optimize.measured_surface import Surface, fewest, fit_surface, narrowed, span_of, twice_as_wide
from mgdd.results.finding import Finding

_SURE = 2.0  # standard errors


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class MeasuredMap(InputNumbers):
    """Noise, curvature and optimum of a measured map J(theta), each with its standard error.

    Attributes
    ----------
    noise_sd, noise_sd_stderr : float
        Standard deviation of J about the parabola; between repeats alone where the parabola does not fit [unit of J].
    curvature, curvature_stderr : float, or numpy.ndarray, shape (inputs, inputs)
        J'' [unit of J per squared unit of the input], for several inputs the matrix of second derivatives.
    optimum, optimum_stderr : float, or numpy.ndarray, shape (inputs,)
        Vertex of the parabola [unit of the input].
    points : int
        Measurements behind curvature and optimum.
    findings : tuple of Finding
        ``lack_of_fit`` where J over all inputs is not a parabola: curvature and optimum are those of the inputs nearest
        to the best one, and their standard errors hold the difference to twice that range. ``no_bend`` where a
        curvature lies within two standard errors of none, and ``beyond_range`` where the optimum lies outside of the
        measured inputs: then neither is known, nor what `tune` makes of them.
    inputs : tuple of str
        Names of the inputs, in their order; empty where `theta` had none.
    optimum_covariance : numpy.ndarray, shape (inputs, inputs)
        Of the optimum; None for one input, as the last two.
    bends : numpy.ndarray, shape (inputs,)
        Second derivatives of J along `directions`, the largest first [unit of J].
    directions : numpy.ndarray, shape (inputs, inputs)
        A row per direction in which J bends by itself: what half of the measured range in that direction changes every
        input by [unit of the input]. The flattest, the last row, is the one that is known worst.

    See Also
    --------
    measure_map : makes one.
    """

    noise_sd: float
    noise_sd_stderr: float
    curvature: Any
    curvature_stderr: Any
    optimum: Any
    optimum_stderr: Any
    points: int
    findings: tuple[Finding, ...] = ()
    inputs: tuple[str, ...] = field(default=(), metadata=SEVERAL_ONLY)
    optimum_covariance: NDArray[np.float64] | None = field(default=None, metadata=SEVERAL_ONLY)
    bends: NDArray[np.float64] | None = field(default=None, metadata=SEVERAL_ONLY)
    directions: NDArray[np.float64] | None = field(default=None, metadata=SEVERAL_ONLY)


def _columns(theta: Any) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Read inputs of shape (n,) or (n, inputs), or columns by name, as (n, inputs) and names."""
    names = theta if isinstance(theta, Mapping) else getattr(theta, "columns", None)  # a mapping gives its keys
    if names is None:
        x = np.asarray(theta, dtype=np.float64)
        return x[:, None] if x.ndim == 1 else x, ()
    columns = {str(name): np.asarray(theta[name], dtype=np.float64) for name in names}
    shapes = {name: column.shape for name, column in columns.items()}
    if not columns or len(set(shapes.values())) > 1 or len(next(iter(shapes.values()))) != 1:
        raise ShapeError(f"theta has columns of shape {shapes}: must be columns of one length")
    return np.column_stack(list(columns.values())), tuple(columns)


def _unknown(
    x: NDArray[np.float64],
    curvature: NDArray[np.float64],
    stderr: NDArray[np.float64],
    optimum: NDArray[np.float64],
    names: tuple[str, ...],
) -> tuple[Finding, ...]:
    """Say of which inputs J shows no curvature, or no optimum between those that were measured."""
    out = []
    bends, errors = np.diag(curvature), np.diag(stderr)
    for index, (low, high) in enumerate(zip(x.min(axis=0), x.max(axis=0), strict=True)):
        name = names[index] if names else "theta" if x.shape[1] == 1 else f"theta[{index}]"
        at = float(optimum[index])
        if abs(bends[index]) < _SURE * errors[index]:
            text = f"J has no curvature over {name} beyond its noise: {bends[index]:.3g} ± {errors[index]:.2g}"
            remedy = f"measure farther out, or more often; tune with amplitude_max of at most {(high - low) / 2:.3g}"
            out.append(Finding("no_bend", (name,), text, remedy))
        if not low <= at <= high:
            text = f"the optimum of {name}, {at:.4g}, lies outside of what was measured, {low:.4g} to {high:.4g}"
            out.append(Finding("beyond_range", (name,), text, "measure on that side"))
    return tuple(out)


def measure_map(
    theta: ArrayLike | Mapping[str, ArrayLike],
    J: ArrayLike,  # noqa: N803
    *,
    maximize: bool = True,
) -> MeasuredMap:
    """Read noise, curvature and optimum off measurements of J, by a least-squares parabola.

    For several inputs it is the quadratic surface with all products of two inputs. Where repeats (or, without them, a
    polynomial of fourth order, third for several inputs on few points) show at 1 % that J is not a parabola over all
    inputs, those farthest from the best, in columns scaled to [-1, 1], are left out until it is; `findings` says so.

    Parameters
    ----------
    theta : array_like, shape (n,) or (n, inputs), or mapping of str to array_like, shape (n,)
        Applied inputs, at least (inputs + 1)(inputs + 2)/2 distinct points, three for one input; repeat them. Columns
        by name may also be an xarray Dataset or a table of pandas.
    J : array_like, shape (n,)
        What was measured there, one cycle each, at least two more than distinct points are needed.
    maximize : bool
        Whether the optimum is a maximum.

    Returns
    -------
    MeasuredMap
        Standard errors from the scatter about the parabola, with findings also from the difference to twice the range.
        Floats for one input, arrays in the order of the inputs for several.

    Raises
    ------
    DataError
        Too few points or inputs, points on a line, values that are not finite, or a direction without a curvature
        towards an optimum.
    ShapeError
        Not one J per input.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> soi = np.repeat([-16.0, -10.0, -4.0, 2.0], 20)
    >>> found = measure_map(soi, 56.0 - 0.0255 * (soi + 5.6) ** 2 + rng.normal(0.0, 0.25, soi.size))
    >>> abs(found.optimum + 5.6) < 3.0 * found.optimum_stderr
    True
    >>> tried = {"soc_cad": rng.uniform(-15.0, 5.0, 60), "egr": rng.uniform(0.0, 0.3, 60)}
    >>> j = 56.0 - 0.03 * (tried["soc_cad"] + 4.0) ** 2 - 300.0 * (tried["egr"] - 0.15) ** 2
    >>> found = measure_map(tried, j + rng.normal(0.0, 0.25, 60))
    >>> found.inputs, (abs(found.optimum - [-4.0, 0.15]) < 3.0 * found.optimum_stderr).all()
    (('soc_cad', 'egr'), np.True_)
    """
    y = np.asarray(J, dtype=np.float64)
    x, names = _columns(theta)
    if x.ndim != 2 or not x.shape[1] or y.shape != x.shape[:1]:
        shape = x.shape if np.ndim(x) != 2 or x.shape[1] > 1 else x.shape[:1]
        raise ShapeError(f"theta has shape {shape}, J {y.shape}: must be one J for every theta, in one dimension")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise DataError("theta and J: must be finite; leave misfired cycles out")
    inputs = x.shape[1]
    distinct, points = len(np.unique(x, axis=0)), fewest(inputs)
    if y.size < points + 2 or distinct < points:
        kind = "inputs" if inputs == 1 else f"points of {inputs} inputs"
        raise DataError(f"{y.size} points at {distinct} distinct {kind}: must be at least {points + 2} at {points}")

    def fit(x: NDArray[np.float64], y: NDArray[np.float64], where: str = "") -> Surface:
        return fit_surface(x, y, maximize=maximize, names=names, where=where)

    wide = fit(x, y)
    narrow, kept, noise = narrowed(x, y, wide, fit, maximize=maximize)
    wider = wide
    findings: tuple[Finding, ...] = ()
    if noise[1] != wide.freedom:  # the parabola of all inputs does not fit
        # Halving the range takes half of the bias of an optimum away at least, so what it changes bounds what is left.
        around = twice_as_wide(x, kept)
        wider = fit(x[around], y[around])
        whole = span_of(x) if inputs == 1 else f"all {distinct} points"
        findings = (
            Finding(
                "lack_of_fit",
                ("J",),
                f"J over theta in {whole} is not a parabola (residual {wide.variance**0.5:.3g}, "
                f"noise {noise[0] ** 0.5:.3g}): curvature and optimum are those of theta in {span_of(x[kept])}",
                "measure more inputs nearer to the optimum",
            ),
        )
    moved = narrow.optimum - wider.optimum
    covariance = noise[0] * narrow.optimum_variance + np.outer(moved, moved)
    bend_sd = np.sqrt(noise[0] * narrow.curvature_variance)
    figures: dict[str, Any] = {
        "curvature": narrow.curvature,
        "curvature_stderr": np.hypot(bend_sd, narrow.curvature - wider.curvature),
        "optimum": narrow.optimum,
        "optimum_stderr": np.sqrt(np.diag(covariance)),
    }
    if inputs == 1:
        figures = {name: value.item() for name, value in figures.items()}
    else:
        figures |= {"optimum_covariance": covariance, "bends": narrow.bends, "directions": narrow.directions}
    findings += _unknown(x, narrow.curvature, bend_sd, narrow.optimum, names)
    return MeasuredMap(
        noise_sd=math.sqrt(noise[0]),
        noise_sd_stderr=math.sqrt(noise[0] / (2.0 * noise[1])),
        points=int(np.count_nonzero(kept)),
        findings=findings,
        inputs=names,
        **figures,
    )
