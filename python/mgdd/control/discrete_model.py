"""Discrete models for receding-horizon control: matrices, or a function of state and input."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mgdd.errors import ParameterError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DiscreteModel"]

MOST_STATES = 32
_WAYS = ("differences", "complex_step")


class DiscreteModel:
    """A sampled system of one input and one output, ``x[k+1] = f(x[k], u[k])``, ``y[k] = h(x[k])``.

    A delay of the input is part of the state. `DiscreteModel.linear` makes one of matrices, which the core runs by
    itself; functions of Python are called by it: with 2 states, 20 samples and slopes by differences about 230 calls,
    a few tenths of a millisecond, per step of a controller. They must not remember anything between calls.

    Parameters
    ----------
    step : callable
        ``step(x, u) -> x_next``: the state, shape (n,), after a sample with the input `u`, a number.
    output : array_like, shape (n,), or callable
        ``h``: weights of the states, or ``output(x) -> y``, a number.
    n_states : int
        Length n of the state, 1 to 32.
    sample_s : float
        Time between samples [s].
    slopes : callable or {"differences", "complex_step"}
        Derivatives of `step`: ``slopes(x, u) -> (A, b)`` with shapes (n, n) and (n,); central differences; or complex
        steps, exact to rounding where `step` and `output` are analytic and take complex numbers.
    difference : float
        Size of a central difference, relative to 1 + the size of the number.

    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError
        An argument out of range, or of the wrong shape.

    References
    ----------
    Squire and Trapp (1998), Using complex variables to estimate derivatives of real functions.

    Examples
    --------
    >>> import math
    >>> from mgdd.control import DiscreteModel
    >>> def swing(x, u, h=0.02):
    ...     speed = x[1] + h * (u - 9.81 * math.sin(x[0]) - 0.3 * x[1])
    ...     return [x[0] + h * speed, speed]
    >>> pendulum = DiscreteModel(swing, output=[1.0, 0.0], n_states=2, sample_s=0.02)
    >>> pendulum.slopes([0.0, 0.0], 0.0)[1].round(6).tolist()
    [0.0004, 0.02]
    """

    def __init__(
        self,
        step: Callable[[Any, Any], ArrayLike],
        *,
        output: ArrayLike | Callable[[Any], Any],
        n_states: int,
        sample_s: float,
        slopes: str | Callable[[Any, float], tuple[ArrayLike, ArrayLike]] = "differences",
        difference: float = 1e-6,
    ) -> None:
        if not callable(step):
            raise ParameterError.of("step", step, "a function of state and input")
        if isinstance(n_states, bool) or not isinstance(n_states, int) or not 1 <= n_states <= MOST_STATES:
            raise ParameterError.of("n_states", n_states, f"a whole number in [1, {MOST_STATES}]")
        if not (math.isfinite(sample_s) and sample_s > 0.0):
            raise ParameterError.of("sample_s", sample_s, "> 0 s")
        if not callable(slopes) and slopes not in _WAYS:
            raise ParameterError.of("slopes", slopes, "a function, 'differences' or 'complex_step'")
        if not 1e-12 <= difference <= 0.1:
            raise ParameterError.of("difference", difference, "in [1e-12, 0.1]")
        self._step, self._slopes, self._difference = step, slopes, float(difference)
        self.n_states, self.sample_s = n_states, float(sample_s)
        self._output: Callable[[Any], Any] | None = output if callable(output) else None
        self._weights = np.zeros(0) if callable(output) else _numbers("output", output, n_states)
        self._matrix: NDArray[np.float64] | None = None
        self._input_column = np.zeros(0)

    @classmethod
    def linear(cls, a: ArrayLike, b: ArrayLike, c: ArrayLike, *, sample_s: float) -> Self:
        """Make one of matrices, ``x[k+1] = A x[k] + b u[k]``, ``y[k] = c x[k]``.

        Parameters
        ----------
        a : array_like, shape (n, n)
            Of the state.
        b, c : array_like, shape (n,), (n, 1) or (1, n)
            Of the one input and the one output.
        sample_s : float
            Time between samples [s].

        Returns
        -------
        DiscreteModel
            It runs in the core, without Python.

        Raises
        ------
        mgdd.errors.ParameterError, mgdd.errors.ShapeError
            A number that is not finite, shapes that do not fit, more than 32 states.

        Examples
        --------
        >>> from mgdd.control import DiscreteModel
        >>> DiscreteModel.linear([[1.0, 0.1], [0.0, 1.0]], [0.005, 0.1], [1.0, 0.0], sample_s=0.1).step([1.0, 2.0], 0.0)
        array([1.2, 2. ])
        """
        matrix = np.array(a, float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not 1 <= len(matrix) <= MOST_STATES:
            raise ShapeError(f"a has shape {matrix.shape}: must be square, with 1 to {MOST_STATES} states")
        if not np.isfinite(matrix).all():
            raise ParameterError("a: must be finite")
        column = _numbers("b", b, len(matrix))
        model = cls(
            lambda x, u: matrix @ x + column * u,
            output=_numbers("c", c, len(matrix)),
            n_states=len(matrix),
            sample_s=sample_s,
            slopes=lambda _x, _u: (matrix, column),
        )
        model._matrix, model._input_column = matrix, column
        return model

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle: a linear model always, another one where its functions can be."""
        if self._matrix is not None:
            return _linear, (self._matrix, self._input_column, self._weights, self.sample_s)
        output = self._weights if self._output is None else self._output
        return _general, (self._step, output, self.n_states, self.sample_s, self._slopes, self._difference)

    def step(self, x: ArrayLike, u: float) -> NDArray[np.float64]:
        """Give the state after one sample.

        Parameters
        ----------
        x : array_like, shape (n,)
            State.
        u : float
            Input, held over the sample.

        Returns
        -------
        numpy.ndarray, shape (n,)
            The next state; whatever the function gives, finite or not.
        """
        return _numbers("step", self._step(np.asarray(x, float), u), self.n_states, finite=False)

    def output(self, x: ArrayLike) -> float:
        """Give the output of a state.

        Parameters
        ----------
        x : array_like, shape (n,)
            State.

        Returns
        -------
        float
            Output.
        """
        if self._output is None:
            return float(self._weights @ np.asarray(x, float))
        return float(_numbers("output", self._output(np.asarray(x, float)), 1, finite=False)[0])

    def slopes(self, x: ArrayLike, u: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the derivatives of a step.

        Parameters
        ----------
        x : array_like, shape (n,)
            State.
        u : float
            Input.

        Returns
        -------
        a : numpy.ndarray, shape (n, n)
            To the state.
        b : numpy.ndarray, shape (n,)
            To the input.
        """
        n = self.n_states
        if callable(self._slopes):
            a, b = self._slopes(np.asarray(x, float), u)
            matrix = np.asarray(a, float)
            if matrix.shape != (n, n):
                raise ShapeError(f"slopes gave A of shape {matrix.shape}: must be ({n}, {n})")
            return matrix, _numbers("slopes", b, n, finite=False)
        at = np.append(np.asarray(x, float), u)
        rows = self._derivatives(lambda z: self._step(z[:n], z[n]), at, n)
        return rows[:, :n], rows[:, n]

    def output_slope(self, x: ArrayLike) -> NDArray[np.float64]:
        """Give the derivatives of the output to the state.

        Parameters
        ----------
        x : array_like, shape (n,)
            State.

        Returns
        -------
        numpy.ndarray, shape (n,)
            Those of weights, or as for `step`; by differences where the slopes of `step` are a function.
        """
        if self._output is None:
            return self._weights
        row: NDArray[np.float64] = self._derivatives(self._output, np.asarray(x, float), 1)[0]
        return row

    def _derivatives(self, function: Callable[[Any], Any], at: NDArray[np.float64], n: int) -> NDArray[np.float64]:
        out = np.empty((n, len(at)))
        for i, value in enumerate(at):
            if self._slopes == "complex_step":
                moved = at.astype(complex)
                moved[i] += 1e-30j
                out[:, i] = np.asarray(function(moved)).imag.reshape(n) / 1e-30
                continue
            h = self._difference * (1.0 + abs(value))
            ends = []
            for sign in (1.0, -1.0):
                moved = at.copy()
                moved[i] += sign * h
                ends.append(_numbers("step" if n > 1 else "output", function(moved), n, finite=False))
            out[:, i] = (ends[0] - ends[1]) / (2.0 * h)
        return out


def _numbers(name: str, given: Any, n: int, *, finite: bool = True) -> NDArray[np.float64]:
    column = np.array(given, float)
    if column.size != n:
        raise ShapeError(f"{name} has shape {column.shape}: must hold {n} numbers")
    if finite and not np.isfinite(column).all():
        raise ParameterError(f"{name}: must be finite")
    return column.reshape(n)


def _linear(a: Any, b: Any, c: Any, sample_s: float) -> DiscreteModel:
    return DiscreteModel.linear(a, b, c, sample_s=sample_s)


def _general(step: Any, output: Any, n_states: int, sample_s: float, slopes: Any, difference: float) -> DiscreteModel:
    return DiscreteModel(
        step, output=output, n_states=n_states, sample_s=sample_s, slopes=slopes, difference=difference
    )
