"""What a calibrated model may claim: one definition for the findings of a fit and for the members of a family."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mgdd.errors import ParameterError
from mgdd.identify.engine.request import GAMMA_PARAMETER
from mgdd.results.finding import Finding

if TYPE_CHECKING:
    from mgdd._core.engine import Cylinder
    from mgdd.identify.engine.records import Load


@dataclass(frozen=True, kw_only=True)
class Plausibility:
    """Limits of what a model that was fitted to pressure can be.

    Parameters
    ----------
    wall_heat_range, gamma_range : tuple of float
        Scales of the textbook wall heat, and leading parameters of the gamma law [-].
    efficiency_limit : float
        Highest work of the closed cycle over the heat of the fuel [-]: the best truck engines stay below 0.5 of brake
        efficiency, 0.55 of the closed cycle.
    fuel_balance : tuple of float
        Heat that the model releases over that of the stated fuel [-]: up to 7 % does not burn, as much leaves with
        crevice and blow-by, and a flow meter and a heating value are good to 4 %.
    imep_percent : float
        Largest error of the closed IMEP [%].
    """

    wall_heat_range: tuple[float, float] = (0.3, 1.5)
    gamma_range: tuple[float, float] = (1.25, 1.42)
    efficiency_limit: float = 0.55
    fuel_balance: tuple[float, float] = (0.86, 1.04)
    imep_percent: float = 2.0

    def __post_init__(self) -> None:
        for name in ("wall_heat_range", "gamma_range", "fuel_balance"):
            if not getattr(self, name)[0] < getattr(self, name)[1]:
                raise ParameterError.of(name, getattr(self, name), "a pair that rises")
        for name in ("efficiency_limit", "imep_percent"):
            if not getattr(self, name) > 0.0:
                raise ParameterError.of(name, getattr(self, name), "> 0")

    def of_model(self, model: Cylinder) -> Iterator[Finding]:
        """Give what is not plausible of the parameters that all traces share."""
        name = GAMMA_PARAMETER[model.gamma_model]
        for code, field, what, (low, high) in (
            ("implausible_wall_heat", "wall_heat_scale", "wall heat", self.wall_heat_range),
            ("implausible_gamma", name, "gamma", self.gamma_range),
        ):
            value = float(getattr(model, field))
            if not low <= value <= high:
                digits = 2 if field == "wall_heat_scale" else 3
                yield Finding(code, (field,), f"{what} {value:.{digits}f} outside {low:g} to {high:g}")

    def of_load(self, load: Load, known_heat_j: float | None) -> Iterator[Finding]:
        """Give what is not plausible of one trace, whose fuel brings `known_heat_j`."""
        efficiency = load.imep_closed_bar * load.cylinder.swept_volume_l * 100.0 / load.fuel_heat_j  # bar l are 100 J
        if not efficiency <= self.efficiency_limit:
            yield Finding(
                "implausible_efficiency",
                (load.file,),
                f"closed efficiency {efficiency:.3f} above {self.efficiency_limit:g}",
            )
        low, high = self.fuel_balance
        if known_heat_j is not None and not low <= load.fuel_heat_j / known_heat_j <= high:
            balance = load.fuel_heat_j / known_heat_j
            yield Finding(
                "fuel_balance", (load.file,), f"heat {balance:.2f} of the stated fuel, outside {low:g} to {high:g}"
            )
        if not abs(load.imep_closed_error_percent) <= self.imep_percent:
            yield Finding(
                "imep_error",
                (load.file,),
                f"closed IMEP {load.imep_closed_error_percent:+.1f} %, beyond {self.imep_percent:g} %",
            )
