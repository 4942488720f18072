"""A cycle model as the guide of a search: what `seek` makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mgdd._core.engine import NoxModel, OperatingPoint, Performance
from mgdd.errors import ParameterError, argument
from mgdd.guide import Curve, ModelOptimum, OnlineCalibration
from mgdd.presets.meant import CylinderLike, cylinder_of
from mgdd.results.describe import described

KINDS = ("curve", "calibrated", "feed_forward")
_PARABOLA_BEND = -0.05  # of ten cycle models, wall heat 0 to 1 and 25 to 60 °CA of burn: -0.037 to -0.054
_REACH_CAD = 60.0
_CALIBRATED = ("wall_heat_scale",)  # no other setting is better on both engines of the study calibrated-guide
_START_MARGIN = 0.1  # of a limit, by the model


@described
@dataclass(frozen=True, kw_only=True)
class EngineGuide:
    """A cycle model, too rough to design with, as the guide of `seek` for the start of combustion.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        The model.
    kind : {"curve", "calibrated", "feed_forward"}
        ``curve``: the model's whole curve, placed by the measurements; ``calibrated``: the same while the model learns
        from the measured pressure; ``feed_forward``: the model's best timing, a seeker learns the rest.
    shape : {"model", "parabola"}
        Of the curve: the model's, or a plain parabola about the model's best timing.
    performance : Performance, optional
        J of the model; gross efficiency in percent if left out.
    nox : NoxModel, optional
        NOx of the model, where J has any.
    point : OperatingPoint, optional
        Where; that of the plant if left out.

    Raises
    ------
    mgdd.errors.ParameterError
        Another kind or shape, or a parabola that is to be calibrated or takes one timing.

    Examples
    --------
    >>> from mgdd.engine import Cylinder
    >>> from mgdd.loop import VirtualEngine, EngineGuide, seek
    >>> rough = EngineGuide(cylinder=Cylinder(wall_heat_scale=1.0))
    >>> found = seek(VirtualEngine(seed=1), {"soc_cad": (-20.0, 5.0)}, guide=rough, cycles=80)
    >>> abs(found.inputs["soc_cad"] + 5.63) < 1.0
    True
    """

    cylinder: CylinderLike = "puma_single"
    kind: str = "curve"
    shape: str = "model"
    performance: Performance | None = None
    nox: NoxModel | None = None
    point: OperatingPoint | None = None

    def __post_init__(self) -> None:
        for name, among in (("kind", KINDS), ("shape", ("model", "parabola"))):
            ParameterError.unless(getattr(self, name) in among, name, getattr(self, name), f"one of {', '.join(among)}")
        if self.shape == "parabola" and self.kind != "curve":
            why = "cannot be calibrated" if self.kind == "calibrated" else "is not one timing"
            raise ParameterError(
                f"{argument('shape', repr('parabola'))}: a parabola {why}; use {argument('kind', repr('curve'))}, or "
                f"leave {argument('shape')} out"
            )

    def model(self, bounds_cad: tuple[float, float]) -> ModelOptimum:
        """Make the model, whose best timing is sought between these bounds."""
        return ModelOptimum(
            cylinder_of(self.cylinder), performance=self.performance, nox=self.nox, bounds_cad=bounds_cad
        )

    def best_of(self, model: ModelOptimum, point: OperatingPoint) -> float:
        """Give the model's best timing; ParameterError where it has none between the bounds."""
        best = model(point)
        if best is None or not best.curvature < 0.0:
            low, high = model.settings["bounds_cad"]
            raise ParameterError(
                f"{argument('guide', self.kind)}: the model has no best timing between {low:g} and {high:g} °CA aTDC: "
                "move the bounds or change its cylinder"
            )
        return float(best["soc_cad"])

    def curve(self, model: ModelOptimum, point: OperatingPoint) -> Curve:
        """Give J of the model over the timing; ParameterError where its best lies outside of the bounds."""
        best, (low, high) = self.best_of(model, point), model.settings["bounds_cad"]
        drawn = model.curve(point)
        if self.shape == "parabola" or drawn is None:
            drawn = Curve.parabola(curvature=_PARABOLA_BEND, best=best, reach=_REACH_CAD)
        if not low <= drawn.best <= high:
            raise ParameterError(
                f"{argument('guide', self.kind)}: the best timing of the model, {drawn.best:.3g} °CA aTDC, lies "
                f"outside of {low:g} to {high:g}: move the bounds, change its cylinder, or use "
                f"{argument('guide', 'feed_forward')}"
            )
        return drawn

    def component_guides(self, bounds_cad: tuple[float, float], point: OperatingPoint) -> list[Any]:
        """Give what the model says of each component of J, over the inputs by name."""
        guides = list[Any]()
        for term in (self.performance or Performance()).terms:
            own = ModelOptimum(
                cylinder_of(self.cylinder), performance=Performance([term]), nox=self.nox, bounds_cad=bounds_cad
            ).curve(point)
            if own is None:
                raise ParameterError(f"{argument('guide', self.kind)}: the model has no cycle there")
            guides.append(lambda x, own=own: own(x["soc_cad"]))
        return guides

    def calibration(self) -> OnlineCalibration:
        """Make what lets the model learn."""
        return OnlineCalibration(cylinder_of(self.cylinder), parameters=_CALIBRATED, steady_cycles=0, window_cycles=5)

    def start(self, model: ModelOptimum, point: OperatingPoint, limits: Sequence[Any], best: float) -> float:
        """Give the timing nearest to its best one at which the model keeps clear of the limits."""
        drawn = model.limit_curves(point, [limit.name for limit in limits]) if limits else None
        if drawn is None:
            return best
        low, high = model.settings["bounds_cad"]
        tried = sorted((low + (high - low) * k / 400 for k in range(401)), key=lambda x: abs(x - best))
        kept = (
            x
            for x in (best, *tried)
            if all(c(x) <= lim.upper - _START_MARGIN * abs(lim.upper) for c, lim in zip(drawn, limits, strict=True))
        )
        return float(next(kept, best))
