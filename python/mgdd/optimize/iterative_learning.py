"""Iterative learning control: the input trajectory of a repeated task, better from trial to trial."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.optimize.inputs import bounds_pair
from mgdd.results.describe import as_html, rows_of
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import NumbersResult

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ConvergenceReport(NumbersResult):
    """What a learning law will do on the model, known before the first trial.

    For ``y = G u + d``, with G the lower-triangular Toeplitz matrix of the impulse response from its first
    non-zero value on, and the law ``u_{j+1} = Q (u_j + L e_j)``. Bounds, rate and guard are not part of it.

    Attributes
    ----------
    asymptotic : bool
        The trials converge: ``spectral_radius < 1``.
    monotone : bool
        The distance to the limit error shrinks in every trial: ``sigma_max < 1``.
    spectral_radius : float
        Of ``Q (I - L G)`` [-].
    radius_is_exact : bool
        The radius is read from a diagonal or a closed form. Otherwise it comes from computed eigenvalues, which
        mean little for a long trial with ``sigma_max`` far above 1.
    sigma_max : float
        Largest singular value of the map from one trial's distance to the limit error to the next one's [-].
    frequency_gain : float
        Largest ``|Q (1 - z^m L G)|`` on the unit circle [-]: the test for trials of any length. Below 1 it
        promises monotone trials for every length if Q = 1 and L looks only back.
    worst_frequency : float
        Where that is reached, as fraction of Nyquist, 0 to 1.
    limit_error_map : ndarray, shape (n, n), or None
        Maps ``r - d`` to the limit error; n is the number of samples that inputs reach. None if the trials
        diverge.
    limit_error_gain : float
        Its largest singular value [-]: 0 if no error remains, NaN if the trials diverge.
    sentence : str
        Human-readable summary.

    See Also
    --------
    IterativeLearning.convergence : makes one.

    References
    ----------
    Bristow, Tharayil and Alleyne (2006), A survey of iterative learning control.
    """

    asymptotic: bool
    monotone: bool
    spectral_radius: float
    radius_is_exact: bool
    sigma_max: float
    frequency_gain: float
    worst_frequency: float
    limit_error_map: NDArray[np.float64] | None
    limit_error_gain: float
    sentence: str

    def __repr__(self) -> str:
        return f"<ConvergenceReport {self.sentence}>"


class IterativeLearning(_core.optimize.IterativeLearning):
    """Learn the input trajectory of a task that is repeated trial by trial.

    Ask for the input of the trial, apply it, return the error ``e = r - y`` (`tell`); sample t of both belongs to the
    same instant. The input reaches the error after m samples (`relative_degree`). Only the last ``N - m`` errors
    count; the last m inputs, which act after the trial, repeat the last learned one.

    Parameters
    ----------
    initial : array_like, shape (N,)
        Input of trial 0; its unit is that of every input.
    law : {"p", "d", "pd", "q_filter", "norm_optimal"}
        ``p``: add ``k_p e(t+m)``. ``d``: add ``k_d [e(t+m) - e(t+m-1)]``. ``pd``: add ``k_p e(t+m) +
        k_d [e(t+m+1) - e(t+m)]``. ``q_filter``: add ``sum_i learning_function[i] e(t+m+lead-i)``, then low-pass
        the input. ``norm_optimal``: minimise ``error_weight |e|^2 + input_weight |u|^2 + change_weight
        |u - u_j|^2`` on the model. Errors before the window count as zero, behind it as its last one.
    impulse_response : array_like, optional
        Output h_0, h_1, ... after one input of 1 at sample 0, in output per input. Needed by
        `convergence`, ``norm_optimal`` and the default gains. Values below 1e-12 of the largest count as zero.
    relative_degree : int, optional
        Samples m until an input acts; that of `impulse_response`, or 0.
    k_p, k_d : float, optional
        Gains in input per error; ``0.5 / h_m`` where an impulse response is given. ``pd`` needs its `k_d`.
    learning_function : array_like, optional
        Taps of ``q_filter`` in input per error, instead of `k_p`.
    lead : int, optional
        Samples that its first tap looks ahead beyond m; 0.
    cutoff : float, optional
        Of the zero-phase filter Q (second-order Butterworth, forward and backward), as fraction of Nyquist in
        [0.01, 0.99]; 0.2 for ``q_filter``, no filter for ``p``, ``d`` and ``pd``.
    error_weight, input_weight, change_weight : float, optional
        Weights of ``norm_optimal``: 1, 0, and 0.1 times the square of the largest singular value of G.
    bounds : pair of float, optional
        Least and largest input of every sample.
    rate : float, optional
        Largest change of the input from sample to sample.
    guard : bool
        Stop learning when the error norm rises in two trials in a row, and return to the input of the best trial.

    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain, or one that the law would not use.
    mgdd.errors.ShapeError
        An input or response that is not one column.

    Warns
    -----
    UserWarning
        The trials will diverge on the model `impulse_response`.

    References
    ----------
    Bristow, Tharayil and Alleyne (2006), A survey of iterative learning control.
    Arimoto, Kawamura and Miyazaki (1984), Bettering operation of robots by learning.

    Examples
    --------
    An engine repeats a load step of 40 cycles. The commanded start of combustion passes a first-order lag; CA50
    shall stay at 9 °CA aTDC although the longer burn of the higher load delays it.

    >>> import numpy as np
    >>> from mgdd.engine import Cylinder, OperatingPoint, simulate
    >>> from mgdd.optimize import IterativeLearning
    >>> fuel_mg = np.where(np.arange(40) < 15, 12.0, 28.0)
    >>> lag = 0.6 * 0.4 ** np.arange(40)
    >>> def ca50_error(command_cad):
    ...     soc = -4.0 + np.convolve(lag, command_cad + 4.0)[:40]
    ...     ca50 = [
    ...         simulate(Cylinder(), OperatingPoint(fuel_mg=fuel), soc_cad=s)["ca50_cad"].item()
    ...         for fuel, s in zip(fuel_mg, soc)
    ...     ]
    ...     return 9.0 - np.array(ca50)
    >>> learner = IterativeLearning(np.full(40, -4.0), impulse_response=lag, law="norm_optimal", bounds=(-20.0, 5.0))
    >>> learner.convergence().monotone
    True
    >>> for _ in range(8):
    ...     learner.tell(ca50_error(learner.ask()))
    >>> norms = learner.history["error_norm"].values
    >>> bool(norms[-1] < 0.001 * norms[0])
    True
    """

    def __init__(
        self,
        initial: ArrayLike,
        *,
        law: str = "p",
        impulse_response: ArrayLike | None = None,
        relative_degree: int | None = None,
        k_p: float | None = None,
        k_d: float | None = None,
        learning_function: ArrayLike | None = None,
        lead: int | None = None,
        cutoff: float | None = None,
        error_weight: float | None = None,
        input_weight: float | None = None,
        change_weight: float | None = None,
        bounds: tuple[float | None, float | None] | None = None,
        rate: float | None = None,
        guard: bool = True,
    ) -> None:
        self._settings: dict[str, Any] = {
            "initial": _column(initial, "initial"),
            "law": law,
            "impulse_response": _column([] if impulse_response is None else impulse_response, "impulse_response"),
            "relative_degree": relative_degree,
            "k_p": k_p,
            "k_d": k_d,
            "learning_function": _column([] if learning_function is None else learning_function, "learning_function"),
            "lead": lead,
            "cutoff": cutoff,
            "error_weight": error_weight,
            "input_weight": input_weight,
            "change_weight": change_weight,
            **dict(zip(("lower", "upper"), bounds_pair(bounds), strict=True)),
            "rate": np.inf if rate is None else rate,
            "guard": guard,
        }
        super().__init__(**self._settings)
        self._report: ConvergenceReport | None = None
        if self._settings["impulse_response"].size and not self.convergence().asymptotic:
            warnings.warn(f"law {law!r} {self.convergence().sentence}", UserWarning, stacklevel=3)

    def ask(self) -> NDArray[np.float64]:
        """Return the input of this trial.

        Returns
        -------
        ndarray, shape (N,)
            A copy. Asking again before `tell` gives the same.
        """
        return super().ask()

    def tell(self, error: ArrayLike) -> None:
        """Learn from the error of this trial.

        Parameters
        ----------
        error : array_like, shape (N,)
            ``r - y`` of the trial whose input `ask` gave.

        Raises
        ------
        mgdd.errors.ParameterError
            The trial has not been asked for, or its error was given already.
        mgdd.errors.ShapeError
            Not one error per sample.
        mgdd.errors.DataError
            A value that is not finite or beyond 1e30 in magnitude, with trial and sample, or trials that diverge
            beyond the range of a float.
            As after every refusal, the learner is as it was.
        """
        super().tell(_column(error, "error"))

    def convergence(self) -> ConvergenceReport:  # type: ignore[override]
        """Judge the law on its model, before the first trial or after any.

        Returns
        -------
        ConvergenceReport
            Computed once; it depends on the settings alone.

        Raises
        ------
        mgdd.errors.ParameterError
            No `impulse_response` was given.

        Examples
        --------
        >>> print(IterativeLearning([0.0] * 9, impulse_response=[2.0]).convergence().sentence)
        converges: spectral radius 0.5 < 1; every trial is closer to the limit than the one before (sigma_max 0.5 < 1);
        no error remains
        """
        if self._report is None:
            report = super().convergence()
            if report["limit_error_map"] is not None:
                report["limit_error_map"].flags.writeable = False
            self._report = ConvergenceReport(**report)
        return self._report

    @property
    def best_trial(self) -> int | None:  # type: ignore[override]
        """Trial of the least error norm, None before the first."""
        return super().best_trial if self.trial else None

    @property
    def history(self) -> xr.Dataset:
        """Error norms ``error_norm`` over ``trial``, of the latest 1000 trials.

        The 2-norm is taken over the errors that inputs reach.
        """
        norms = self.error_norms
        return labelled_dataset(
            {
                "trial": ("trial", np.arange(self.trial - norms.size, self.trial), "-", "trial"),
                "error_norm": ("trial", norms, "unit of the error", "2-norm of the error"),
            },
            attrs={"law": self._settings["law"]},
        )

    @property  # type: ignore[override]
    def state(self) -> dict[str, list[float]]:
        """Numbers by name, fit for JSON; set them to go on bit for bit, in a learner of the same settings.

        Setting raises ParameterError or ShapeError for names, lengths or values that cannot be, and changes nothing
        then.
        """
        return super().state()

    @state.setter
    def state(self, state: Mapping[str, ArrayLike]) -> None:
        if not isinstance(state, Mapping):
            raise ParameterError(f"state is a {type(state).__name__}: must be a mapping of names to columns")
        self.restore({str(name): _column(column, f"state {name!r}").tolist() for name, column in state.items()})

    def __getstate__(self) -> dict[str, Any]:
        return {"settings": self._settings, "state": self.state}

    def __setstate__(self, pickled: dict[str, Any]) -> None:
        self._settings = pickled["settings"]
        super().__init__(**self._settings)
        self._report = None
        self.state = pickled["state"]

    def __repr__(self) -> str:
        frozen = ", frozen" if self.frozen else ""
        samples = self._settings["initial"].size
        return f"<IterativeLearning law={self._settings['law']!r}, {samples} samples, trial {self.trial}{frozen}>"

    def _repr_html_(self) -> str:
        return as_html("IterativeLearning", rows_of({"trial": self.trial, "frozen": self.frozen, **self._settings}))


def _column(value: ArrayLike, name: str) -> NDArray[np.float64]:
    try:
        column = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError.of(name, value, "one column of numbers") from error
    return column
