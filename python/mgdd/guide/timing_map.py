"""A calibration map of the best timing as a guide, which learns from confirmed optima."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError, ParameterError, argument
from mgdd.maps.calibration_map import CalibrationMap, map_of
from mgdd.presets.meant import numbers_of
from mgdd.results.describe import described

if TYPE_CHECKING:
    import xarray as xr

_TIMING = "°CA aTDC"
_LEAST_SHARE = 1e-3  # of the spread: standard deviation of an estimate that does not move at all


@described
@dataclass
class TimingMap:
    """A `mgdd.maps.CalibrationMap` of the best timing as a guide, whose cells learn.

    As a guide of `FeedForward` it answers inside of its axes only. A confirmed optimum is shared by the cells around it
    with their bilinear weights, against what they knew, as a Kalman filter with a diagonal covariance does; such cells
    have the source ``learned``, their standard deviation and their support, the confirmed optima behind them, forgotten
    ones taken off.

    Parameters
    ----------
    table : CalibrationMap
        The map as it is now: learning puts another one in its place.
    prior_sd_cad : float
        Standard deviation of a cell that has none, and the largest that forgetting leads to [°CA].
    forgetting : float
        What a cell keeps of its knowledge per confirmed optimum, in (0, 1]; 1 for a plant that never changes.

    Raises
    ------
    mgdd.errors.ParameterError
        A number outside its domain.
    mgdd.errors.DataError
        The values are not timings, or a cell has none.

    Examples
    --------
    >>> from mgdd.guide import TimingMap
    >>> from mgdd.maps import CalibrationMap
    >>> axes = {"speed_rpm": [900, 1500, 3000], "fuel_mg": [6, 20, 40]}
    >>> timing = TimingMap(CalibrationMap(axes, -5.0, name="soc_cad"))
    >>> timing.learn({"speed_rpm": 1500, "fuel_mg": 20}, -6.4, sd_cad=0.3)
    >>> round(timing({"speed_rpm": 1500, "fuel_mg": 20}), 2), timing({"speed_rpm": 4000, "fuel_mg": 20})
    (-6.39, None)
    >>> timing.table
    <CalibrationMap soc_cad [°CA aTDC], 3 speed_rpm x 3 fuel_mg, 8 given, 1 learned>
    """

    table: CalibrationMap
    _: KW_ONLY
    prior_sd_cad: float = 3.0
    forgetting: float = 0.95

    def __post_init__(self) -> None:
        self.table = map_of(self.table)
        ParameterError.unless(0.0 < self.prior_sd_cad < math.inf, "prior_sd_cad", self.prior_sd_cad, "> 0 and finite")
        ParameterError.unless(0.0 < self.forgetting <= 1.0, "forgetting", self.forgetting, "in (0, 1]")
        if self.table.unit != _TIMING:
            raise DataError(f"{self.table.name} has unit {self.table.unit!r}: a timing map needs {_TIMING!r}")
        empty = np.count_nonzero(np.isnan(self.table.values))
        if empty:
            message = f"{empty} cells have no value: smooth the map with {argument('fill', 'True')}"
            raise DataError(f"{self.table.name}: {message}")

    def __call__(self, point: Any) -> float | None:
        """Give the best timing as a guide does.

        Parameters
        ----------
        point : OperatingPoint or mapping of str to float
            It names the axes.

        Returns
        -------
        float or None
            [°CA aTDC]; None outside of the axes.

        Raises
        ------
        mgdd.errors.ParameterError
            The point lacks an axis.
        """
        at = self.table.lookup(numbers_of(point))
        return None if at.held_outside else float(at.values)

    def learn(self, point: Any, timing_cad: float, *, sd_cad: float) -> None:
        """Write a confirmed optimum back.

        Parameters
        ----------
        point : OperatingPoint or mapping of str to float
            Where it was found.
        timing_cad : float
            The optimum [°CA aTDC].
        sd_cad : float
            Its standard deviation [°CA], > 0.

        Raises
        ------
        mgdd.errors.ParameterError
            A point outside of the axes, or numbers that are not an optimum; nothing has changed then.
        """
        at = self.table.place(numbers_of(point))
        if at.held_outside or not math.isfinite(timing_cad) or not 0.0 < sd_cad < math.inf:
            raise ParameterError(
                f"learn: timing_cad = {timing_cad:g} with sd_cad = {sd_cad:g} at {numbers_of(point)}: must be finite, "
                "sd_cad > 0, and the point inside of the axes"
            )
        near = np.unravel_index(at.cells[at.weights > 0.0], self.table.values.shape)
        weight, old = at.weights[at.weights > 0.0], self.table.cells
        values, source = self.table.values.copy(), old["source"].astype("U16")
        sd, support, objective = (old[name].copy() for name in ("sd", "support", "objective"))
        kept = self.forgetting**weight
        faded = np.where(sd[near] > 0.0, sd[near], self.prior_sd_cad) ** 2 / kept
        variance = np.minimum(self.prior_sd_cad**2, faded)
        gain = weight * variance / (weight**2 @ variance + sd_cad**2)
        values[near] += gain * (timing_cad - weight @ values[near])
        sd[near] = np.sqrt(variance * (1.0 - gain * weight))
        support[near] = kept * np.where(source[near] == "learned", support[near], 0.0) + weight
        objective[near], source[near] = np.nan, "learned"
        cells = {"sd": sd, "support": support, "objective": objective, "source": source}
        self.table = self.table.replaced(values, cells=cells)

    def learn_from(self, seeker: Any, point: Any, *, cycles: int = 100, spread_cad: float = 1.0) -> bool:
        """Write the estimate of a finished or running seeker back if it has settled.

        Parameters
        ----------
        seeker : Seeker, FeedForward
            With one input and a history.
        point : OperatingPoint or mapping of str to float
            The operating point of its last cycles.
        cycles : int
            How many of the last cycles must agree, >= 2; all at one operating point, as a `FeedForward` knows.
        spread_cad : float
            Their mean absolute deviation from their mean, and the distance between the means of their halves, must lie
            below this [°CA].

        Returns
        -------
        bool
            Whether the estimate counted as confirmed and was learnt. Its standard deviation is taken from the scatter
            of the estimates and the distance of the halves.

        Raises
        ------
        mgdd.errors.ParameterError
            As by `learn`, or fewer than two cycles.
        """
        settled = _settled_estimate(seeker.history, cycles, spread_cad)
        if settled is None:
            return False
        self.learn(point, settled[0], sd_cad=settled[1])
        return True


def _settled_estimate(history: xr.Dataset, cycles: int, spread: float) -> tuple[float, float] | None:
    """Give mean and standard deviation of the last cycles of a seeker with one input; None where they do not agree."""
    ParameterError.unless(cycles >= 2, "cycles", cycles, ">= 2")
    last = history.isel(cycle=slice(-cycles, None))
    if last.sizes["cycle"] < cycles:
        return None
    if "point" in last and (np.ptp(last["point"].to_numpy()) > 0 or bool(last["testing"].to_numpy().any())):
        return None
    estimate = last["estimate"].to_numpy()[:, 0]
    early, late = estimate[: cycles // 2], estimate[cycles // 2 :]
    drift = abs(float(np.mean(late) - np.mean(early)))
    scatter = float(np.mean(np.abs(estimate - np.mean(estimate))))
    if not (scatter < spread and drift < spread):
        return None
    return float(np.mean(estimate)), max(math.hypot(scatter, drift), _LEAST_SHARE * spread)
