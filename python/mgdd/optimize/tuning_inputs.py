"""What the tuner is given: the curvature of one input or several, and numbers per input in order or by name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize.inputs import named_values
from mgdd.optimize.tuning_several import coupling_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["check_several", "hessian_of", "numbered", "per_input", "single"]

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
    if not found.ndim:
        return float(found), names
    for value in np.ravel(found if found.ndim == 1 else np.diag(found)):
        if not (math.isfinite(value) and value != 0.0):
            raise ParameterError.of("|curvature|", abs(value), "> 0; measure J at three points per input or more")
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


def numbered(count: int) -> tuple[str, ...]:
    """Name inputs that have no names."""
    return tuple(f"input {place}" for place in range(count))


def single(name: str, value: Any) -> float | None:
    """Read a number of the specification for one input."""
    if value is None:
        return None
    if np.size(value) != 1:
        raise ShapeError(f"{name} has {np.size(value)} entries: must be one number, as curvature")
    return float(np.ravel(value)[0])


def per_input(name: str, value: Any, count: int, names: Sequence[str]) -> NDArray[np.float64] | None:
    """Read numbers of the specification for several inputs."""
    if value is None:
        return None
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.shape != (count,):
        raise ShapeError(f"{name} has shape {numbers.shape}: must be ({count},), one number per input in its unit")
    for own, number in zip(names or numbered(count), numbers, strict=True):
        if not (number > 0.0 and math.isfinite(number)):
            raise ParameterError.of(f"{name} of {own}", number, "> 0")
    return numbers


def check_several(noise_sd: float, method: str, delay_uncertainty: float | None, cycles: float | None) -> None:
    """Refuse what the core refuses for one input."""
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
