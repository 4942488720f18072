"""Surrogate of a measured engine: quadratic surfaces of its signals over its injection, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from mgdd.errors import ConvergenceError, ParameterError
from mgdd.io.parameters import ParameterFile, Parameters
from mgdd.optimize import Limit
from mgdd.optimize.optimum import Optimum, limits_of
from mgdd.results.describe import described
from mgdd.results.labels import Label, labelled_dataset
from mgdd.surrogate.polynomial import PolynomialBasis, Support
from mgdd_studies.measured_engine.file import read_surrogate, surrogate_file
from mgdd_studies.measured_engine.signal_model import SignalModel

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_TINY = 1e-9  # relative slack of a limit at its own crossing


def best_along(
    support: Support,
    surfaces: Mapping[str, NDArray[np.float64]],
    at: NDArray[np.float64],
    *,
    weights: Mapping[str, float],
    upper_limits: tuple[Limit, ...],
    nonnegative: tuple[str, ...],
) -> Optimum:
    """Maximise the weighted sum of signals over SOI where supported and within the limits, the rest of a point held."""
    limits = {limit.name: limit.upper - limit.margin for limit in upper_limits}
    column = support.inputs.index("soi_cad")
    low, high = float(support.lower[column]), float(support.upper[column])
    nodes = np.linspace(low, high, 5)
    points = np.tile(at, (nodes.size, 1))
    points[:, column] = nodes
    terms = support.basis(points)

    def along(values: NDArray[np.float64], degree: int) -> Polynomial:
        return Polynomial.fit(nodes, values, degree)

    curves = {name: along(terms @ coefficients, 2) for name, coefficients in surfaces.items()}
    leverage = along(support.leverage(points), 4) - support.leverage_limit
    goal = Polynomial([0.0], (low, high), (-1.0, 1.0))
    for name, weight in weights.items():
        goal = goal + weight * curves[name]
    held = {name: curves[name] - limit for name, limit in limits.items()}
    rules = [leverage, *(-curves[name] for name in nonnegative)]
    others = np.delete(np.arange(len(support.inputs)), column)
    inside = np.all((points[0, others] >= support.lower[others]) & (points[0, others] <= support.upper[others]))
    # Of a nearly straight curve the bend is left out: it would spoil the digits of the companion matrix.
    roots = np.concatenate(
        [curve.trim(_TINY * np.abs(curve.coef).max()).roots() for curve in [*rules, *held.values(), goal.deriv()]]
    )
    real = roots.real[np.abs(roots.imag) < _TINY * (high - low)]
    candidates = np.unique(np.r_[low, high, real[(low < real) & (real < high)]])
    supported = inside & _within(rules, candidates)
    feasible = supported & _within(list(held.values()), candidates)
    if not feasible.any():
        if not supported.any():
            raise ConvergenceError(f"no soi_cad in [{low:.4g}, {high:.4g}] is supported: change the other inputs")
        near = ", ".join(
            f"{n} >= {curves[n](candidates[supported]).min():.4g} (limit {v:g})" for n, v in limits.items()
        )
        raise ConvergenceError(
            f"no supported soi_cad in [{low:.4g}, {high:.4g}] meets the limits together; each alone: {near}; "
            "raise a limit"
        )
    best = float(candidates[int(np.argmax(np.where(feasible, goal(candidates), -np.inf)))])
    before, behind = candidates[:-1], candidates[1:]
    out = ~(inside & _within(rules, 0.5 * (before + behind)))
    start, end = behind[out & (behind <= best)].max(initial=low), before[out & (before >= best)].min(initial=high)
    return Optimum(
        inputs={"soi_cad": best},
        objective=" + ".join(name if weight == 1.0 else f"{weight:g} {name}" for name, weight in weights.items()),
        value=float(goal(best)),
        values={name: float(curve(best)) for name, curve in curves.items()},
        limits=upper_limits,
        active_limits=tuple(n for n, curve in held.items() if abs(curve(best)) <= _TINY * max(1.0, abs(limits[n]))),
        at_bound=bool(min(best - start, end - best) <= _TINY * (high - low)),
        bounds={"soi_cad": (float(start), float(end))},
        curvature=float(goal.deriv(2)(best)),
    )


def _within(curves: list[Polynomial], at: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(np.all([curve(at) <= _TINY * (1.0 + np.abs(curve.coef).max()) for curve in curves], axis=0))


STEERED = "soi_cad"


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class EngineSurrogate(Parameters):
    """Quadratic surfaces of the signals of an engine over its commands, with their support and residuals.

    Parameters
    ----------
    signals : mapping of str to SignalModel
        By name.
    support : Support
        Where the surfaces are valid.
    medians : mapping of str to float
        Median of each input over the records: where a prediction stands unless given otherwise.
    input_labels : mapping of str to Label
        Unit and long name of each input.
    nonnegative : tuple of str
        Signals that cannot be negative; a surface below zero is out of its support.
    residuals : ndarray, shape (rows, signals)
        Record minus model by row of the log, one column per signal, NaN where a record was not used.
    source : mapping of str to object
        Attributes of the records.
    """

    signals: Mapping[str, SignalModel]
    support: Support
    medians: Mapping[str, float]
    input_labels: Mapping[str, Label]
    nonnegative: tuple[str, ...]
    residuals: NDArray[np.float64]
    source: Mapping[str, object]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the commands, in the order of `Support`."""
        return self.support.inputs

    @property
    def basis(self) -> PolynomialBasis:
        """The terms of the surfaces."""
        return self.support.basis

    def predict(
        self, soi_cad: ArrayLike, at: Mapping[str, float] | None = None, *, outside: str = "flag"
    ) -> xr.Dataset:
        """Predict the steady value of every signal.

        Parameters
        ----------
        soi_cad : array_like, shape () or (n,)
            Start of injection [°CA aTDC].
        at : mapping of str to float, optional
            The other inputs, in their units; their medians if left out.
        outside : {"flag", "raise"}
            What to do outside the support: mark it in ``supported``, or refuse.

        Returns
        -------
        xarray.Dataset
            Every signal over ``soi_cad``, with ``supported`` and ``leverage``. A signal that cannot be negative is
            not: the value is 0 and not supported where its surface is below.

        Raises
        ------
        mgdd.errors.ParameterError
            An unknown input, a value that is not finite, or a point outside the support with ``outside="raise"``.
        """
        ParameterError.unless(outside in ("flag", "raise"), "outside", outside, "'flag' or 'raise'")
        soi = np.atleast_1d(np.asarray(soi_cad, dtype=np.float64))
        points = self.points(soi, at)
        values, supported = self.evaluate(points)
        if outside == "raise" and not supported.all():
            low, high = self.support.lower, self.support.upper
            box = ", ".join(f"{n} [{a:.4g}, {b:.4g}]" for n, a, b in zip(self.inputs, low, high, strict=True))
            worst = float(soi[int(np.argmin(supported))])
            raise ParameterError(
                f"soi_cad = {worst:g}: the point is outside the support of the records ({box}), has a leverage above "
                f"{self.support.leverage_limit:.3g} or a negative {' or '.join(self.nonnegative)}; stay inside, or "
                "pass outside='flag'"
            )
        variables: dict[str, tuple[object, ...]] = {
            STEERED: (STEERED, soi, *self.input_labels[STEERED]),
            "supported": (STEERED, supported, "-", "within the support of the records"),
            "leverage": (STEERED, self.support.leverage(points), "-", "leverage"),
        }
        for column, (name, signal) in enumerate(self.signals.items()):
            variables[name] = (STEERED, values[:, column], *signal.label)
        held = {name: value for name, value in self.operating_point(at).items() if name != STEERED}
        return labelled_dataset(variables, attrs=held)

    def find_optimum(
        self,
        objective: str | Mapping[str, float] = "imep_bar",
        limits: Mapping[str, float] | Sequence[Limit] | None = None,
        at: Mapping[str, float] | None = None,
    ) -> Optimum:
        """Find the start of injection that maximises a signal, or a weighted sum, within the support.

        Surfaces are quadratic along SOI, so the optimum is exact.

        Parameters
        ----------
        objective : str or mapping of str to float
            A signal, or the weight of each signal, for example ``{"imep_bar": 1.0, "nox_ppm": -0.002}``.
        limits : mapping of str to float, or sequence of Limit, optional
            Upper limits on signals, in their units; the margin of a `Limit` is kept.
        at : mapping of str to float, optional
            The other inputs, in their units; their medians if left out.

        Returns
        -------
        Optimum
            Input ``soi_cad``; ``values`` holds every signal there, ``bounds`` the supported range around it, and
            ``at_bound`` marks that the records, not the engine, hold it.

        Raises
        ------
        mgdd.errors.ParameterError
            An unknown signal or input, a weight or limit that is not finite.
        mgdd.errors.ConvergenceError
            No supported SOI meets the limits.
        """
        weights = {objective: 1.0} if isinstance(objective, str) else dict(objective)
        upper_limits = limits_of(limits)
        if not weights:
            raise ParameterError("objective = {}: must name at least one signal")
        for what, numbers in (("objective", weights), ("limits", {limit.name: limit.upper for limit in upper_limits})):
            for name, value in numbers.items():
                if name not in self.signals:
                    raise ParameterError(f"{what}: {name!r} is not a signal: must be one of {', '.join(self.signals)}")
                if not np.isfinite(value):
                    raise ParameterError(f"{what}: {name} = {value:g}: must be finite")
        return best_along(
            self.support,
            {name: signal.coefficients for name, signal in self.signals.items()},
            self.points(np.zeros(1), at)[0],
            weights=weights,
            upper_limits=upper_limits,
            nonnegative=self.nonnegative,
        )

    def quality(self) -> xr.Dataset:
        """Tabulate how well each surface does."""
        models = list(self.signals.values())
        unit = "unit of the signal"
        return labelled_dataset(
            {
                "signal": ("signal", list(self.signals), "-", "signal"),
                "r2": ("signal", [m.r2 for m in models], "-", "R² of all records"),
                "r2_held_out": ("signal", [m.r2_held_out for m in models], "-", "R² of the held-out records"),
                "lag_cycles": ("signal", [m.lag_cycles for m in models], "cycles", "lag from command to log"),
                "residual_sd": ("signal", [m.residual_sd for m in models], unit, "residual standard deviation"),
                "cyclic_sd": ("signal", [m.cyclic_sd for m in models], unit, "cyclic standard deviation"),
            }
        )

    def to_parameters(self) -> ParameterFile:
        """Give everything, residuals included, as `to_toml` writes it."""
        return surrogate_file(vars(self))

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> EngineSurrogate:
        """Make the surrogate of a file that `to_toml` wrote."""
        return cls(**read_surrogate(file))

    def operating_point(self, at: Mapping[str, float] | None = None) -> dict[str, float]:
        """Complete a choice of inputs with the medians of the rest, and check it."""
        for name, value in (at or {}).items():
            if name not in self.inputs or name == STEERED:
                others = ", ".join(n for n in self.inputs if n != STEERED)
                raise ParameterError(f"at: {name!r} is not another input: must be one of {others}")
            if not np.isfinite(value):
                raise ParameterError(f"at: {name} = {value:g}: must be finite")
        return {**self.medians, **(at or {})}

    def points(self, soi_cad: NDArray[np.float64], at: Mapping[str, float] | None = None) -> NDArray[np.float64]:
        """Return the points, shape (n, m), of SOI values [°CA aTDC] with the other inputs held."""
        if soi_cad.ndim != 1 or not np.all(np.isfinite(soi_cad)):
            raise ParameterError("soi_cad: must be one finite number or a one-dimensional array of them")
        chosen = self.operating_point(at)
        columns = [soi_cad if name == STEERED else np.full(soi_cad.size, chosen[name]) for name in self.inputs]
        return np.column_stack(columns)

    def evaluate(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return steady values, shape (n, signals), and whether each point is supported."""
        terms = self.basis(points)
        values = terms @ self._coefficients
        columns = [list(self.signals).index(name) for name in self.nonnegative]
        supported = self.support.contains_terms(points, terms) & np.all(values[:, columns] >= 0.0, axis=1)
        values[:, columns] = np.maximum(values[:, columns], 0.0)
        return values, supported

    @cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        return np.column_stack([signal.coefficients for signal in self.signals.values()])
