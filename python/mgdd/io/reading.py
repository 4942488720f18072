"""How a file of measured pressure is to be read: the options that the readers of one cylinder and of a file share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from mgdd.errors import DataError, argument
from mgdd.io.column_names import TIME_UNITS, check_choice
from mgdd.io.cycle_period import CYCLE_DEG
from mgdd.io.encoder import Encoder
from mgdd.io.pressure_checks import PRESSURE_UNITS

ANGLE_UNITS = ("deg", "rad", *TIME_UNITS)


@dataclass(frozen=True)
class Reading:
    """How a table is to be read; the fields are the arguments of `mgdd.io.read_pressure`."""

    angle_column: int | str | None
    pressure_column: int | str | Sequence[int | str] | None
    angle_unit: str | None
    pressure_unit: str | None
    firing_tdc_deg: float | None
    before_tdc: bool
    tdc_offset_cad: float
    angle_step_deg: float | None
    angle_start_deg: float | None
    speed_rpm: float | None
    gain_bar_per_v: float | None
    offset_bar: float | None
    encoder: Encoder | None = None

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """Take the fields out of the arguments of a reader."""
        return cls(**{each.name: given[each.name] for each in fields(cls)})

    def __post_init__(self) -> None:
        if self.pressure_unit is not None:
            check_choice("pressure_unit", self.pressure_unit, PRESSURE_UNITS)
        if self.angle_unit is not None:
            check_choice("angle_unit", self.angle_unit, ANGLE_UNITS)
        _check_range("angle_step_deg", self.angle_step_deg, 0.0, 10.0)
        _check_range("speed_rpm", self.speed_rpm, 0.0, 30000.0)
        if self.gain_bar_per_v is not None and not (np.isfinite(self.gain_bar_per_v) and self.gain_bar_per_v):
            raise DataError.of("gain_bar_per_v", self.gain_bar_per_v, "a finite number, not 0")
        if self.offset_bar is not None and self.gain_bar_per_v is None:
            raise DataError(
                f"{argument('offset_bar')} acts on volts only: give {argument('gain_bar_per_v', '')} too; an offset in "
                "bar is what the pegging of the analysis finds"
            )
        for other, value in (("angle_column", self.angle_column), ("angle_unit", self.angle_unit)):
            if self.encoder is None and self.angle_step_deg is not None and value is not None:
                raise DataError(
                    f"{argument('angle_step_deg')} is for samples without an angle column, {argument(other)} for a "
                    "column: give one of them"
                )
        if self.encoder is not None:
            self._check_encoder()

    def _check_encoder(self) -> None:
        given = {"angle_unit": self.angle_unit, "angle_start_deg": self.angle_start_deg, "speed_rpm": self.speed_rpm}
        idle = next((name for name, value in given.items() if value is not None), "before_tdc")
        if idle != "before_tdc" or self.before_tdc:
            raise DataError(f"{argument(idle)} and {argument('encoder')} are two ways to an angle: leave one out")
        if self.firing_tdc_deg is None:
            raise DataError(
                f"{argument('encoder')} gives no TDC: pass {argument('firing_tdc_deg', '')} with the angle of "
                "TDC behind the mark of the turn, 0 to 360"
            )
        DataError.unless(0.0 <= self.firing_tdc_deg <= CYCLE_DEG, "firing_tdc_deg", self.firing_tdc_deg, "in [0, 720]")


def _check_range(name: str, value: float | None, low: float, high: float) -> None:
    DataError.unless(value is None or low < value <= high, name, value, f"> {low:g} and <= {high:g}")
