"""Iterative learning on a load step that an engine repeats: CA50 held although the actuator lags and the burn grows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import OperatingPoint
from mgdd.loop import EngineBench
from mgdd.optimize import IterativeLearning
from mgdd.studies.statistics import rms

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["CYCLES", "LAWS", "Learned", "learn"]

CYCLES, STEP_AT, LOW_MG, HIGH_MG = 40, 15, 12.0, 28.0
TARGET_CA50_CAD, FIRST_SOC_CAD = 9.0, -4.0
_LAG = 0.6 * 0.4 ** np.arange(CYCLES)  # impulse response of the timing actuator, first order
LAWS: dict[str, dict[str, Any]] = {
    "p": {"law": "p"},
    "q_filter": {"law": "q_filter", "cutoff": 0.5},
    "norm_optimal": {"law": "norm_optimal"},
}


@dataclass(frozen=True, kw_only=True)
class Learned:
    """Error of CA50 by seed and trial [°CA], as rms over the cycles of a trial, and what the law promises."""

    law: str
    rms_cad: NDArray[np.float64]
    sigma_max: float

    def row(self) -> dict[str, Any]:
        """Give the row of this law."""
        over_seeds = [rms(column) for column in self.rms_cad.T]
        first = next((n for n, value in enumerate(over_seeds) if value <= 0.1 * over_seeds[0]), None)
        return {
            "law": self.law,
            "trials": len(over_seeds),
            "sigma_max": self.sigma_max,
            "first_rms_cad": over_seeds[0],
            "third_rms_cad": over_seeds[min(3, len(over_seeds) - 1)],
            "last_rms_cad": over_seeds[-1],
            "trials_to_a_tenth": first,
        }


def learn(law: str, seeds: int, *, trials: int = 12, scatter_cad: float = 0.3) -> Learned:
    """Learn the commanded timing of the load step trial by trial; the scatter of combustion differs in every trial."""
    points = [(0, OperatingPoint(fuel_mg=LOW_MG)), (STEP_AT, OperatingPoint(fuel_mg=HIGH_MG))]
    bench = EngineBench(schedule=points, soc_scatter_cad=scatter_cad, efficiency_noise_percent=0.0)
    errors = np.empty((seeds, trials))
    sigma_max = math.nan
    for seed in range(seeds):
        learner = IterativeLearning(
            np.full(CYCLES, FIRST_SOC_CAD), impulse_response=_LAG, lower=-25.0, upper=8.0, **LAWS[law]
        )
        sigma_max = learner.convergence().sigma_max
        for trial in range(trials):
            bench.reset(seed * trials + trial)
            soc = FIRST_SOC_CAD + np.convolve(_LAG, learner.ask() - FIRST_SOC_CAD)[:CYCLES]
            error = TARGET_CA50_CAD - bench.run(soc)["ca50_cad"].to_numpy()
            errors[seed, trial] = rms(error)
            learner.tell(error)
    return Learned(law=law, rms_cad=errors, sigma_max=sigma_max)
