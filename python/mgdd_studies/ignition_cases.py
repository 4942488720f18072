"""Correlations of the ignition delay, the plant that follows one of them, and the guide that assumes another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mgdd.engine import Cylinder, OperatingPoint, ignition_delay
from mgdd.engine.ignition import Timing
from mgdd.guide import Curve, ModelOptimum
from mgdd.optimize.optimum import Optimum
from mgdd_studies.guide_cases import BOUNDS_CAD, PLANT

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["MEASURED_AT", "SOI_CAD", "TRUTHS", "DelayLaw", "InjectionGuide", "assumed_laws"]

SOI_CAD = np.linspace(-60.0, 20.0, 321)  # what `ignition_delay` takes
MEASURED_AT = OperatingPoint(speed_rpm=1500.0, fuel_mg=20.0)
MEASURED_SOI_CAD = np.arange(-25.0, 5.1, 5.0)


@dataclass(frozen=True)
class DelayLaw:
    """A correlation of the ignition delay on the motored cycle of the plant, and the plant with this correlation."""

    name: str
    cylinder: Cylinder

    def soc(self, point: OperatingPoint) -> NDArray[np.float64]:
        """Give SOC of the injections `SOI_CAD`; NaN where nothing ignites [°CA aTDC]."""
        return _soc(self.cylinder, point.replace(fuel_mg=MEASURED_AT.fuel_mg, burn_duration_cad=None))

    def soc_of(self, point: OperatingPoint, soi_cad: float) -> float:
        """Give SOC of one injection; NaN where nothing ignites [°CA aTDC]."""
        return float(np.interp(soi_cad, SOI_CAD, self.soc(point)))

    def injection(self, point: OperatingPoint, soc_cad: float) -> Timing:
        """Find the injection for a wanted SOC, or the edge of what can be reached."""
        return ignition_delay(self.cylinder, point, soc_cad=soc_cad)

    def slope(self, point: OperatingPoint, soi_cad: float) -> float:
        """Give dSOC/dSOI [-]."""
        return float(np.interp(soi_cad, SOI_CAD, np.gradient(self.soc(point), SOI_CAD)))


@lru_cache(maxsize=4096)
def _soc(cylinder: Cylinder, point: OperatingPoint) -> NDArray[np.float64]:
    found = np.array([ignition_delay(cylinder, point, soi_cad=soi).soc_cad for soi in SOI_CAD.tolist()])
    found.setflags(write=False)
    return found


TRUTHS = tuple(
    DelayLaw(name, PLANT.replace(ignition_model=model))
    for name, model in (("Watson", "watson"), ("Wolfer", "wolfer"), ("Hardenberg-Hase", "hardenberg_hase"))
)


def assumed_laws(truth: DelayLaw) -> tuple[DelayLaw, ...]:
    """List what a guide may assume: every correlation, and what measurements of this truth at one speed give."""
    delay = truth.soc(MEASURED_AT) - SOI_CAD
    c2, c1, c0 = np.polyfit(MEASURED_SOI_CAD, np.interp(MEASURED_SOI_CAD, SOI_CAD, delay), 2).tolist()
    best = truth.injection(MEASURED_AT, _best_soc(PLANT, MEASURED_AT)["soc_cad"])
    polynomial = PLANT.replace(ignition_model="polynomial", ignition_c0_cad=c0, ignition_c1=c1, ignition_c2_per_cad=c2)
    fixed = PLANT.replace(ignition_model="polynomial", ignition_c0_cad=best.delay_cad, ignition_c1=0.0)
    return (
        *TRUTHS,
        DelayLaw("polynomial of 1500 rpm", polynomial),
        DelayLaw("constant of 1500 rpm", fixed),
        DelayLaw("no delay", fixed.replace(ignition_c0_cad=0.0)),
    )


@lru_cache(maxsize=4096)
def _best_soc(cylinder: Cylinder, point: OperatingPoint) -> Optimum:
    best = ModelOptimum(cylinder, bounds_cad=BOUNDS_CAD)(point)
    if best is None:
        raise ArithmeticError(f"the model has no optimum at {point}")
    return best


@dataclass(frozen=True)
class InjectionGuide:
    """The plant's own cycle model, right in all but the ignition delay that it assumes: best SOC, turned into SOI."""

    assumed: DelayLaw

    @property
    def name(self) -> str:
        """Name of the correlation that it assumes."""
        return self.assumed.name

    def best_soc(self, point: OperatingPoint) -> Optimum:
        """Give the best SOC of the model, on which all guides agree."""
        return _best_soc(PLANT, point)

    def timing(self, point: OperatingPoint) -> Timing:
        """Give the best SOI, by the correlation that it assumes."""
        return self.assumed.injection(point, self.best_soc(point)["soc_cad"])

    def __call__(self, point: OperatingPoint) -> Optimum:
        """Give the best SOI as a `FeedForward` asks for it."""
        best, soi = self.best_soc(point), self.timing(point).soi_cad
        bend = best.curvature * self.assumed.slope(point, soi) ** 2
        return Optimum(inputs={"soi_cad": soi}, objective="performance", value=best.value, curvature=bend)

    def curve(self, point: OperatingPoint) -> Curve:
        """Give J of the model over SOI, as a `CurveSeeking` takes it."""
        over_soc = ModelOptimum(PLANT, bounds_cad=BOUNDS_CAD).curve(point)
        if over_soc is None:
            raise ArithmeticError(f"the model has no curve at {point}")
        soc = self.assumed.soc(point)
        known = np.isfinite(soc) & (soc >= over_soc.lower) & (soc <= over_soc.upper)
        return Curve(SOI_CAD[known], over_soc(soc[known]))
