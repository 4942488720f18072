"""Top dead centre: what a degree of error costs, and where a motored trace has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mgdd import _core
from mgdd.engine.cycle import simulate
from mgdd.results.labels import ANGLE

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from mgdd._core.engine import Cylinder, OperatingPoint

__all__ = ["MODEL_CAD", "DegreeCost", "MotoredTdc", "degree_cost", "motored_tdc"]

# Distances from TDC that are compared: nearer ones hold the peak alone, farther ones the flows of the valves.
_FROM_CAD, _TO_CAD, _STEP_CAD = 5.0, 60.0, 0.5
_EXPONENT, _ROUNDS = 1.35, 3
# What is left of engines with another wall heat and another gas: see docs/validation.md.
MODEL_CAD = 0.1


class DegreeCost(NamedTuple):
    """Closed IMEP of a trace [bar], and by how much it grows with angles that are 1 °CA too large [bar]."""

    imep_bar: float
    change_bar: float

    def __str__(self) -> str:
        share = f" ({100.0 * self.change_bar / self.imep_bar:.2g} %)" if self.change_bar < self.imep_bar else ""
        return f"1 °CA moves the closed IMEP by {self.change_bar:.2g} bar{share}"


def degree_cost(trace: xr.Dataset, cylinder: Cylinder) -> DegreeCost:
    """Give what an error of TDC of one degree costs, of one cycle or of the mean of many: work is linear in pressure.

    The samples from IVC to EVO are put on the volumes half a degree earlier and later.
    """
    angle = trace[ANGLE].to_numpy()
    bar = np.atleast_2d(trace["pressure_bar"].transpose(..., ANGLE).to_numpy()).mean(axis=0)
    closed = (angle >= cylinder.ivc_cad) & (angle <= cylinder.evo_cad)
    angle, bar = angle[closed], bar[closed]

    def imep(error: float) -> float:
        return float(np.trapezoid(bar, _core.engine.volume_l(cylinder, angle + error)) / cylinder.swept_volume_l)

    return DegreeCost(imep(0.0), imep(0.5) - imep(-0.5))


class MotoredTdc(NamedTuple):
    """By how much the angles are too large [°CA], its error from noise, and the wall heat over the textbook's."""

    offset_cad: float
    stderr_cad: float
    wall_heat_scale: float


def motored_tdc(
    angle_cad: NDArray[np.float64], pressure_bar: NDArray[np.float64], cylinder: Cylinder, point: OperatingPoint
) -> MotoredTdc:
    """Fit both to the two strokes of one motored cycle, which reaches 65 degrees to each side.

    At the distance d from TDC, ln p(d)/p(-d) is scale times what the wall heat of the cycle model makes of it, and
    offset times 2 n d ln V/d phi: near TDC the one is flat and the other rises.
    """
    start = float(np.interp(max(float(angle_cad[0]), cylinder.ivc_cad), angle_cad, pressure_bar))
    point = point.replace(fuel_mg=0.0, intake_pressure_kpa=100.0 * max(start, 0.05))
    distance = np.arange(_FROM_CAD, _TO_CAD, _STEP_CAD)

    def ratio(angle: NDArray[np.float64], pressure: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.log(np.interp(distance, angle, pressure) / np.interp(-distance, angle, pressure)))

    cycles = [simulate(cylinder.replace(wall_heat_scale=scale), point, step_cad=0.5) for scale in (0.0, 1.0)]
    plain, heated = (ratio(c["crank_angle_cad"].to_numpy(), c["pressure_bar"].to_numpy()) for c in cycles)
    volume = np.interp(distance, cycles[0]["crank_angle_cad"].to_numpy(), cycles[0]["volume_l"].to_numpy())
    design = np.column_stack([heated - plain, 2.0 * _EXPONENT * np.gradient(np.log(volume), distance)])
    offset = 0.0
    for _ in range(_ROUNDS):  # the step is linear in a small offset only
        wanted = ratio(angle_cad - offset, pressure_bar) - plain
        found, *_ = np.linalg.lstsq(design, wanted)
        offset += float(found[1])
    left = wanted - design @ found
    variance = float(left @ left) / (distance.size - 2) * np.linalg.inv(design.T @ design)[1, 1]
    return MotoredTdc(offset, float(np.sqrt(variance)), float(found[0]))
