"""The best timing of the cycle model at an operating point, as a guide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mgdd import _core
from mgdd._core.engine import Cylinder, NoxModel, OperatingPoint, Performance
from mgdd._core.guide import Curve
from mgdd._settings import remade
from mgdd.errors import ParameterError
from mgdd.optimize.optimum import Optimum
from mgdd.presets.meant import CylinderLike, cylinder_of
from mgdd.results.describe import as_html, core_rows

_MOST_POINTS = 4096  # of the cache


class ModelOptimum(_core.guide.ModelOptimum):
    """Says where the cycle model has its best start of combustion; a guide of `FeedForward`.

    A coarse scan every 5 CAD brackets the optimum; gradient ascent, theta <- theta + step_size (J(theta + c) -
    J(theta - c))/(2 c), finds it, and golden section where that does not converge, or from the outset. The work is
    bounded (below 151 cycles of the model, about 25 as a rule), and each operating point is searched once.
    `mgdd.engine.find_optimum` is the offline search, with limits.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        The model, as in `mgdd.engine.simulate`.
    performance : Performance, optional
        What is maximised, as the plant measures it; gross efficiency in percent if left out.
    nox : NoxModel, optional
        NOx of the model, where the performance uses it.
    method : {"gradient", "golden_section"}
        Of the search.
    bounds_cad : tuple of float
        Searched range of SOC [°CA aTDC].
    step_size : float
        lambda_c of the ascent [°CA**2 per unit of J]; it converges below 2/abs(J'').
    difference_cad : float
        c, half the distance of its differences [°CA]; at least 1 where J has kinks.
    tolerance_cad : float
        Step below which the ascent has converged [°CA].
    iterations : int
        Most steps of the ascent.
    step_cad, integrator
        As in `mgdd.engine.simulate`.

    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain; what is asked for a point that is not an operating point.

    References
    ----------
    Tan 2018, section 5.2 (lambda_c and c; their meaning is our reading).

    Examples
    --------
    >>> from mgdd.engine import Cylinder, OperatingPoint
    >>> from mgdd.guide import ModelOptimum
    >>> guide = ModelOptimum(Cylinder())
    >>> best = guide(OperatingPoint())
    >>> round(best["soc_cad"], 1), best.value > 55.0, best.curvature < 0.0
    (-5.6, True, True)
    """

    def __init__(
        self,
        cylinder: CylinderLike,
        *,
        performance: Performance | None = None,
        nox: NoxModel | None = None,
        method: str = "gradient",
        bounds_cad: tuple[float, float] = (-30.0, 10.0),
        step_size: float = 15.0,
        difference_cad: float = 1.0,
        tolerance_cad: float = 0.02,
        iterations: int = 60,
        step_cad: float = 1.0,
        integrator: str = "trapezoid",
    ) -> None:
        super().__init__(
            cylinder_of(cylinder),
            performance=performance or Performance(),
            nox=nox or NoxModel(),
            method=method,
            bounds_cad=bounds_cad,
            step_size=step_size,
            difference_cad=difference_cad,
            tolerance_cad=tolerance_cad,
            iterations=iterations,
            step_cad=step_cad,
            integrator=integrator,
        )
        self._optima: dict[OperatingPoint, Optimum] = {}

    def __call__(self, point: OperatingPoint) -> Optimum | None:
        """Find the best start of combustion.

        Parameters
        ----------
        point : OperatingPoint
            Where.

        Returns
        -------
        Optimum or None
            Input ``soc_cad``, value and curvature in the unit of the performance, in ``values`` the ``iterations`` of
            the ascent; None where the model has no optimum, as of a motored point.
        """
        _require_point(point)
        if point in self._optima:
            return self._optima[point]
        optimum = self._find(point)
        if not optimum["found"]:
            return None
        best = Optimum(
            inputs={"soc_cad": optimum["soc_cad"]},
            objective="performance",
            value=optimum["j"],
            values={"iterations": float(optimum["iterations"])},
            at_bound=optimum["at_bound"],
            bounds={"soc_cad": tuple(self.settings["bounds_cad"])},
            curvature=optimum["curvature"] or math.nan,
        )
        if len(self._optima) >= _MOST_POINTS:
            self._optima.pop(next(iter(self._optima)))
        self._optima[point] = best
        return best

    def curve(self, point: OperatingPoint) -> Curve | None:
        """Draw J over the start of combustion, for `CurveSeeking`.

        Parameters
        ----------
        point : OperatingPoint
            Where.

        Returns
        -------
        Curve or None
            J over SOC [°CA aTDC], from 15 °CA before the bounds to 10 °CA behind them as far as the bench goes; None
            where the model has no such cycle, as of a motored point.

        Examples
        --------
        >>> from mgdd.engine import Cylinder, OperatingPoint
        >>> from mgdd.guide import ModelOptimum
        >>> curve = ModelOptimum(Cylinder()).curve(OperatingPoint())
        >>> round(curve.best, 1), round(curve.top - curve(-20.0), 1)
        (-5.6, 5.7)
        """
        drawn = self._drawn(point, ())
        return None if drawn is None else drawn[0]

    def limit_curves(self, point: OperatingPoint, names: Sequence[str]) -> list[Curve] | None:
        """Draw limited indicators over the start of combustion, for the limits of `CurveSeeking`.

        Parameters
        ----------
        point : OperatingPoint
            Where.
        names : sequence of str
            Indicators, for example ``["p_max_bar"]``; at most eight.

        Returns
        -------
        list of Curve or None
            One per name, each in its unit over SOC [°CA aTDC]; None where the model has no such cycle, or no such
            indicator.
        """
        drawn = self._drawn(point, names)
        return None if drawn is None else drawn[1:]

    def _drawn(self, point: OperatingPoint, names: Sequence[str]) -> list[Curve] | None:
        _require_point(point)
        drawn: list[Curve] | None = self._curves(point, list(names))
        return drawn

    def calibrate(self, cylinder: Cylinder) -> None:
        """Go on with other parameters of the same cylinder, as a calibration finds them.

        Say so to a `FeedForward` that uses this guide: its ``recalibrated()``.

        Parameters
        ----------
        cylinder : Cylinder
            Of the same geometry.

        Raises
        ------
        mgdd.errors.ParameterError
            Another geometry; nothing has changed then.
        """
        self._set_cylinder(cylinder)
        self._optima.clear()

    def __reduce__(self) -> tuple[Any, ...]:
        return remade, (type(self), (self.cylinder,), self.settings, {})

    def __repr__(self) -> str:
        return f"<ModelOptimum by {self.settings['method']}, {len(self._optima)} points searched>"

    def _repr_html_(self) -> str:
        return as_html("ModelOptimum", core_rows(self.cylinder))


def _require_point(point: Any) -> None:
    ParameterError.unless(isinstance(point, OperatingPoint), "point", point, "an OperatingPoint")
