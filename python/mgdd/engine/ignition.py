"""Ignition delay: from start of injection to start of combustion and back."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mgdd import _core
from mgdd.errors import ConvergenceError, ParameterError
from mgdd.presets.meant import CylinderLike, PointLike, engine_of
from mgdd.results.result import NumbersResult


@dataclass(frozen=True, kw_only=True, repr=False)
class Timing(NumbersResult):
    """An injection and its combustion.

    Parameters
    ----------
    soi_cad, soc_cad : float
        Start of injection and of combustion [°CA aTDC]; ``soc_cad`` is NaN without ignition.
    delay_cad : float
        Ignition delay, SOC minus SOI [°CA].
    ignites : bool
        Whether the charge ignites before the exhaust valve opens.
    clipped : bool
        The wanted SOC cannot be reached; this is the edge of what can.
    """

    soi_cad: float
    soc_cad: float
    delay_cad: float
    ignites: bool
    clipped: bool


def ignition_delay(
    cylinder: CylinderLike,
    point: PointLike | None = None,
    *,
    soi_cad: float | None = None,
    soc_cad: float | None = None,
) -> Timing:
    """Find the start of combustion of an injection, or the injection that ignites at a wanted start of combustion.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        As in `simulate`. ``ignition_model`` chooses the correlation: ``watson`` and ``wolfer`` by the integral over
        the motored cycle, ``hardenberg_hase`` at the state of SOI, or ``polynomial`` in SOI.
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        As in `simulate`; its fuel does not matter.
    soi_cad, soc_cad : float
        Start of injection or wanted start of combustion [°CA aTDC], in [-60, 20]; exactly one of them.

    Returns
    -------
    Timing
        Both, and the delay. ``ignites`` is False where the charge stays below ignition until EVO; ``clipped`` is True
        for a wanted SOC beyond the reachable range, SOI in [-60, 20], and the timing then its edge.

    Raises
    ------
    mgdd.errors.ParameterError
        A timing outside its window, or not exactly one.

    References
    ----------
    Livengood and Wu (1955); Watson, Pilley and Marzouk (1980); Wolfer (1938); Hardenberg and Hase (1979).

    Examples
    --------
    >>> from mgdd.engine import Cylinder, OperatingPoint, ignition_delay
    >>> round(ignition_delay(Cylinder(), OperatingPoint(), soi_cad=-20.0).delay_cad, 1)
    8.1
    >>> timing = ignition_delay(Cylinder(), OperatingPoint(), soc_cad=-6.0)
    >>> round(timing.soi_cad, 1), timing.clipped
    (-10.8, False)
    """
    cylinder, point = engine_of(cylinder, point)
    if soi_cad is not None and soc_cad is None:
        return Timing(**_core.engine.start_of_combustion(cylinder, point, soi_cad))
    if soc_cad is not None and soi_cad is None:
        return Timing(**_core.engine.start_of_injection(cylinder, point, soc_cad))
    raise ParameterError("soi_cad, soc_cad: give exactly one of them")


def ignited_soc_cad(cylinder: CylinderLike, point: PointLike | None = None, *, soi_cad: float) -> float:
    """Give the start of combustion of an injection [°CA aTDC], where there is one that `simulate` takes."""
    timing = ignition_delay(cylinder, point, soi_cad=soi_cad)
    if not timing.ignites:
        raise ConvergenceError(f"soi_cad = {soi_cad:g} does not ignite before EVO: inject earlier")
    latest = _core.engine.timing_window_cad[1]
    if timing.soc_cad > latest:
        raise ParameterError(
            f"soi_cad = {soi_cad:g} ignites at {timing.soc_cad:.1f} °CA aTDC, later than {latest:g}, the latest start "
            "of combustion that is simulated: inject earlier"
        )
    return timing.soc_cad


def reached_soi_cad(cylinder: CylinderLike, point: PointLike | None = None, *, soc_cad: float) -> float:
    """Give the injection that ignites at a start of combustion [°CA aTDC]; NaN where none does."""
    timing = ignition_delay(cylinder, point, soc_cad=soc_cad)
    return math.nan if timing.clipped else timing.soi_cad
