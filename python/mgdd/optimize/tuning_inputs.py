"""What the tuner is given: the curvature of one input or several, and numbers per input in order or by name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize.inputs import named_values
from mgdd.optimize.tuning_forms import coupling_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

_METHODS = ("batch", "moving_average", "spsa")
_MOST_INPUTS = 8
_FLAT = 1e-6  # of the curvature along the inputs


def hessian_of(curvature: Any, inputs: Sequence[str]) -> tuple[Any, tuple[str, ...]]:
    """Read the curvature: a number for one input, a matrix for several, and the names of the inputs."""
    names = tuple(inputs)
    if isinstance(curvature, Mapping):
        names = names or tuple(map(str, curvature))
        curvature = named_values("curvature", curvature, names)
    found = np.asarray(curvature, dtype=np.float64)
    if found.size == 1:
        found = found.reshape(())
    count = len(found) if found.ndim else 1
    if found.ndim > 2 or found.shape not in ((), (count,), (count, count)) or count > _MOST_INPUTS:
        raise ShapeError(
            f"curvature has shape {found.shape}: must be a number, one per input, or the matrix of at most "
            f"{_MOST_INPUTS} inputs"
        )
    if names and len(names) != count:
        raise ShapeError(f"inputs has {len(names)} entries: must have {count}, one per input of curvature")
    for value in np.ravel(found if found.ndim < 2 else np.diag(found)):
        if not (math.isfinite(value) and value != 0.0):
            raise ParameterError.of("|curvature|", abs(value), "> 0; measure J at three points per input or more")
    if not found.ndim:
        return float(found), names
    if found.ndim == 1:
        return np.diag(-np.abs(found)), names
    if not np.isfinite(found).all() or not np.allclose(found, found.T, rtol=1e-6, atol=0.0):
        raise ParameterError("curvature: must be a symmetric matrix of finite numbers")
    sizes = coupling_of(found)[0]
    if (np.diag(found) > 0.0).any() != (np.diag(found) > 0.0).all() or not sizes[0] > _FLAT:
        raise ParameterError(
            "curvature: J must bend one way in every direction; its scaled matrix has the eigenvalues "
            f"{', '.join(f'{size:.3g}' for size in sizes)}: measure again, or give one number per input"
        )
    return found, names


def of_each(hessian: NDArray[np.float64], names: Sequence[str]) -> tuple[str, ...]:
    """Write of which input a number is; nothing where there is one without a name."""
    if len(hessian) == 1 and not names:
        return ("",)
    return tuple(f" of {name}" for name in names or (f"input {place}" for place in range(len(hessian))))


def per_input(name: str, value: Any, of: Sequence[str]) -> NDArray[np.float64] | None:
    """Read numbers of the specification, one per input."""
    if value is None:
        return None
    numbers, count = np.asarray(value, dtype=np.float64), len(of)
    if count == 1 and numbers.size != 1:
        raise ShapeError(f"{name} has {numbers.size} entries: must be one number, as curvature")
    if count > 1 and numbers.shape != (count,):
        raise ShapeError(f"{name} has shape {numbers.shape}: must be ({count},), one number per input in its unit")
    for which, number in zip(of, numbers.ravel(), strict=True):
        if not (number > 0.0 and math.isfinite(number)):
            raise ParameterError.of(f"{name}{which}", number, "> 0")
    return numbers.ravel()


def check_wish(noise_sd: float, method: str, delay_uncertainty: float | None, cycles: float | None) -> None:
    """Refuse what is not per input."""
    if method not in _METHODS:
        raise ParameterError.of("method", method, f"one of {', '.join(_METHODS)}")
    if not (noise_sd > 0.0 and math.isfinite(noise_sd)):
        raise ParameterError.of(
            "noise_sd", noise_sd,
            "> 0; repeat one set-point some twenty times and take the standard deviation of J",
        )  # fmt: skip
    if cycles is not None and not (cycles > 0.0 and math.isfinite(cycles)):
        raise ParameterError.of("cycles", cycles, "> 0")
    if delay_uncertainty is not None and not (delay_uncertainty >= 0.0 and math.isfinite(delay_uncertainty)):
        raise ParameterError.of("delay_uncertainty", delay_uncertainty, ">= 0 and finite; 0 for a delay known exactly")
