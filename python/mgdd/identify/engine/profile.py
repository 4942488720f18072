"""The profile of the wall-heat scale: how well the rest of the model can make up for a wrong one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.findings import WIDTHS
from mgdd.identify.engine.records import CylinderFit, rmse_of, starts_of
from mgdd.identify.engine.request import GAMMA_PARAMETER, Request
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result

if TYPE_CHECKING:
    import xarray as xr

NAME = "wall_heat_scale"
UPPER = float(_core.identify.wall_heat_scale_upper)
_RISE = 1.10  # a scale counts as possible while the refitted RMSE stays within 10 % of the best
_WIDTH = 0.20  # and as identified when that range stays within 20 % of the best scale
_NAMES = {"gamma": "gamma", "pegging_bar": "pegging", "tdc_cad": "TDC"}
_UNITS = {"gamma": "", "pegging_bar": " bar", "tdc_cad": " CAD"}
_CORRELATION = float(_core.identify.correlation_limit)


@dataclass(frozen=True, kw_only=True, repr=False)
class WallHeatProfile(Result):
    """What the traces show of the wall-heat scale.

    Parameters
    ----------
    value, stderr : float
        Estimate and standard error [-]; the latter is NaN at a bound.
    correlation : float
        Strongest correlation with another parameter [-]; at a bound, of the linearised problem there.
    correlated_with : str
        That parameter.
    range_low, range_high : float
        Scales whose refitted RMSE is within 10 % of the best [-], inside [0, 2.5].
    moved : dict of str to pair
        Per uncertain quantity (``gamma``, ``pegging_bar``, ``tdc_cad``): the estimates with it lower and higher by its
        width [-].
    possible_low, possible_high : float
        The range with those moves added in squares [-], inside [0, 2.5].
    identifiable : bool
        Not at a bound, correlation at most 0.98, and the possible range within ±20 % of the value.
    reasons : tuple of str
        Why not, in words.
    dataset : xarray.Dataset
        ``rmse_percent`` of all traces together, and per trace, over ``wall_heat_scale``.
    """

    value: float
    stderr: float
    correlation: float
    correlated_with: str
    range_low: float
    range_high: float
    moved: Mapping[str, tuple[float, float]]
    possible_low: float
    possible_high: float
    identifiable: bool
    reasons: tuple[str, ...]
    dataset: xr.Dataset

    def _draw(self, ax: Any) -> Any:
        from mgdd.plot.calibration import wall_heat_profile as draw

        return draw(self.dataset, ax=ax)

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the Dataset as a dict."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "dataset"}


def wall_heat_profile(
    fit: CylinderFit,
    *,
    scales: Sequence[float] = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5),
    widths: Mapping[str, float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> WallHeatProfile:
    """Refit everything else at fixed wall-heat scales, and judge whether the traces determine the scale.

    Gamma, pegging and TDC are held in a fit as if they were known. Here the scale is estimated again with each of them
    lower and higher by its width, and the verdict counts how far it moves.

    Parameters
    ----------
    fit : mgdd.results.Fit
        A fit of `fit_cylinder` in which ``wall_heat_scale`` was free.
    scales : sequence of float
        Scales to refit at, in [0, 2.5]; the fitted one and both ends are added.
    widths : mapping, optional
        How far ``gamma`` [-], ``pegging_bar`` [bar] and ``tdc_cad`` [°CA] may be off, each >= 0: 0.03, 0.1 and 0.3
        by default, 0 for one that is known. A gamma that was free in the fit is not moved.
    progress : callable, optional
        Called with a short text before each refit.

    Returns
    -------
    WallHeatProfile
        Estimate, uncertainty, range and verdict.

    Raises
    ------
    mgdd.errors.ParameterError
        ``wall_heat_scale`` was not free or free alone, a scale outside [0, 2.5], an unknown or negative width.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import fit_cylinder, wall_heat_profile
    >>> traces, cylinder = datasets.read("hd_diesel_128x144"), presets.load("hd_diesel_128x144").cylinder
    >>> profile = wall_heat_profile(fit_cylinder(traces, cylinder), scales=[0.5, 1.0])
    >>> profile.dataset["rmse_percent"].dims
    ('wall_heat_scale',)
    """
    if NAME not in fit.report.names:
        raise ParameterError(f"{NAME} was not free in this fit: free it, then take its profile")
    bad = [scale for scale in scales if not 0.0 <= scale <= UPPER]
    if bad:
        raise ParameterError(f"scales: {bad[0]:g} must be in [0, {UPPER:g}]")
    free = tuple(name for name in fit.request.free if name != NAME)
    if not free:
        raise ParameterError(f"{NAME} was the only free parameter: a profile refits the others")
    used = _widths(widths)
    value = float(fit.model.wall_heat_scale)
    fits = {value: fit}

    def refit(scale: float) -> CylinderFit:
        if scale not in fits:
            if progress is not None:
                progress(f"{fit.kind}: refit at wall-heat scale {scale:.3g}")
            near = fits[min(fits, key=lambda other: abs(other - scale))]
            held = near.model.replace(wall_heat_scale=scale)
            fits[scale] = fit_request(replace(fit.request, cylinder=held, free=free, start_values=starts_of(near)))
        return fits[scale]

    if math.isfinite(fit.report.rmse):
        for scale in sorted({*scales, 0.0, UPPER}, key=lambda s: abs(s - value)):
            refit(float(scale))
    best = min(fits, key=lambda scale: rmse_of(fits[scale]))
    level = _RISE * rmse_of(fits[best])
    low = _crossing(refit, fits, best, level, -1)
    high = _crossing(refit, fits, best, level, +1)
    moved = _moved(fit, used, progress) if math.isfinite(fit.report.rmse) else {}
    possible = (
        max(0.0, best - math.hypot(best - low, *(max(0.0, value - min(pair)) for pair in moved.values()))),
        min(UPPER, best + math.hypot(high - best, *(max(0.0, max(pair) - value) for pair in moved.values()))),
    )
    correlation, partner = _correlation(fit)
    reasons = (
        *_reasons(fit, best, rmse_of(fits[best]), correlation, partner, low, high),
        *_reasons_of_moves(moved, used, best, value, possible),
    )
    return WallHeatProfile(
        value=value,
        stderr=float(fit.report.stderr[fit.report.names.index(NAME)]),
        correlation=correlation,
        correlated_with=partner,
        range_low=low,
        range_high=high,
        moved=moved,
        possible_low=possible[0],
        possible_high=possible[1],
        identifiable=not reasons,
        reasons=reasons,
        dataset=_dataset(fits),
    )


def _widths(given: Mapping[str, float] | None) -> dict[str, float]:
    used = {**WIDTHS, **(given or {})}
    unknown = [name for name in used if name not in WIDTHS]
    if unknown:
        raise ParameterError(f"widths: {unknown[0]!r} is none of {', '.join(WIDTHS)}")
    for name, width in used.items():
        if not (math.isfinite(width) and width >= 0.0):
            raise ParameterError(f"widths: {name} = {width:g}: must be >= 0")
    return {name: float(width) for name, width in used.items() if width > 0.0}


def _moved(
    fit: CylinderFit, widths: Mapping[str, float], progress: Callable[[str], None] | None
) -> dict[str, tuple[float, float]]:
    """Estimate the scale again with one assumption lower and higher by its width."""
    start = replace(fit.request, cylinder=fit.model, start_values=starts_of(fit))
    gamma = GAMMA_PARAMETER[fit.model.gamma_model]
    errors = {}
    for name, width in widths.items():
        if name == "gamma" and gamma in fit.request.free:
            continue
        pair = []
        for side in (-width, width):
            if progress is not None:
                progress(f"{fit.kind}: refit with {_NAMES[name]} {side:+g}{_UNITS[name]}")
            pair.append(float(fit_request(_with_offset(start, name, side, gamma)).model.wall_heat_scale))
        errors[name] = (pair[0], pair[1])
    return errors


def _with_offset(request: Request, name: str, offset: float, gamma: str) -> Request:
    if name == "gamma":
        value = float(getattr(request.cylinder, gamma)) + offset
        return replace(request, cylinder=request.cylinder.replace(**{gamma: value}))
    return request.shifted(pressure_bar=offset) if name == "pegging_bar" else request.shifted(angle_cad=offset)


def _crossing(
    refit: Callable[[float], CylinderFit], fits: dict[float, CylinderFit], best: float, level: float, side: int
) -> float:
    """Where the profile leaves the level on one side of its best; the bound if it does not, NaN without any fit."""
    from scipy.optimize import brentq

    if not math.isfinite(level):
        return math.nan
    inside = best
    for scale in sorted((s for s in fits if (s - best) * side > 0.0), key=lambda s: abs(s - best)):
        if rmse_of(fits[scale]) > level:
            return float(brentq(lambda s: min(rmse_of(refit(float(s))), 1e6) - level, inside, scale, xtol=2e-3))
        inside = scale
    return inside  # the outermost scale is the bound: both ends of [0, 2.5] are always refitted


def _correlation(fit: CylinderFit) -> tuple[float, str]:
    """Return the strongest correlation of the scale, where it is at a bound that of the linearised problem there."""
    row = fit.correlation_if_free[fit.report.names.index(NAME)]
    pairs = [(n, float(c)) for n, c in zip(fit.report.names, row, strict=True) if n != NAME and math.isfinite(c)]
    name, strongest = min(pairs, key=lambda pair: -abs(pair[1]), default=("none", math.nan))
    return strongest, name


def _reasons(
    fit: CylinderFit, best: float, rmse: float, correlation: float, partner: str, low: float, high: float
) -> tuple[str, ...]:
    value = float(fit.model.wall_heat_scale)
    if not fit.report.success:
        return (f"the fit itself did not converge: {fit.report.message}",)
    out = []
    if fit.report.bounds_active[fit.report.names.index(NAME)] != 0:
        out.append(f"the estimate {value:.3g} lies at a bound of [0, {UPPER:g}]")
    if rmse < fit.report.rmse * (1.0 - 1e-3):
        out.append(f"a refit at {best:.2f} fits better than the estimate {value:.2f}: the search met a local minimum")
    if abs(correlation) > _CORRELATION:
        out.append(f"its correlation with {partner} is {correlation:.3f}, beyond {_CORRELATION:g}")
    if best <= 0.0 or low < (1.0 - _WIDTH) * best or high > (1.0 + _WIDTH) * best:
        out.append(
            f"any scale from {low:.2f} to {high:.2f} fits within 10 % of the best RMSE once the rest is refitted"
        )
    return tuple(out)


def _reasons_of_moves(
    moved: Mapping[str, tuple[float, float]],
    widths: Mapping[str, float],
    best: float,
    value: float,
    possible: tuple[float, float],
) -> tuple[str, ...]:
    if not any(pair != (value, value) for pair in moved.values()) or (
        (1.0 - _WIDTH) * best <= possible[0] and possible[1] <= (1.0 + _WIDTH) * best
    ):
        return ()
    parts = [
        f"{min(*pair, value):.2f} to {max(*pair, value):.2f} if {_NAMES[name]} is {widths[name]:g}{_UNITS[name]} off"
        for name, pair in moved.items()
    ]
    return (f"the estimate {value:.2f} becomes {', '.join(parts)}: {possible[0]:.2f} to {possible[1]:.2f} in all",)


def _dataset(fits: dict[float, CylinderFit]) -> xr.Dataset:
    scales = np.array(sorted(fits))
    ordered = [fits[scale] for scale in scales]
    files = [load.file for load in ordered[0].loads]
    trace_rmse = np.array([[load.rmse_percent for load in f.loads] for f in ordered])
    error = np.array([[load.imep_closed_error_percent for load in f.loads] for f in ordered])
    return labelled_dataset(
        {
            NAME: (NAME, scales),
            "file": ("file", files, "-", "trace"),
            "rmse_percent": (NAME, [100.0 * f.report.rmse for f in ordered]),
            "rmse_percent_per_trace": ((NAME, "file"), trace_rmse, "% of p_max", "pressure RMSE of each trace"),
            "imep_closed_error_percent": ((NAME, "file"), error),
        }
    )
