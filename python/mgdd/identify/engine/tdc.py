"""Top dead centre from pressure: by the strokes of motored traces, by the residual of a calibration of fired ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import analyze
from mgdd.engine.dead_centre import DegreeCost, MotoredTdc, degree_cost, motored_tdc
from mgdd.engine.trace import conditions
from mgdd.errors import ConvergenceError, DataError, ParameterError, argument
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.family import of_law
from mgdd.identify.engine.records import CylinderFit, rmse_of, starts_of
from mgdd.identify.engine.request import GAMMA_PARAMETER, Bounds, Request, closed
from mgdd.presets.meant import CylinderLike, PointLike, cylinder_of
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import Result
from mgdd.results.units import unit_attributes

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_RISE = 1.25  # an offset counts as possible while the RMSE stays within a quarter of the least
# Gamma of charge and burned gas, at 300 K and its slope; at 3500 K it stays above 1.
_GAS = {"gamma_linear_300k": (1.36, 1.45), "gamma_linear_slope_per_k": (-1.1e-4, -2.0e-5)}
_MODEL_CAD = (
    0.5  # what another burn law, gas and wall move the least RMSE on engines that share no code with the package
)
_ENDS = (("low_cad", "lowest"), ("high_cad", "highest"))
_STEP_CAD = 0.25


@dataclass(frozen=True, kw_only=True, repr=False)
class TdcEstimate(Result):
    """Where top dead centre lies in the angles of a trace.

    Parameters
    ----------
    tdc_offset_cad : float
        What the angles are too large by: where they have firing TDC [°CA]. ``tdc_offset_cad=`` of
        `mgdd.io.read_pressure` takes it off.
    low_cad, high_cad : float
        Range of offsets that the traces do not separate [°CA].
    method : {"motored strokes", "residual of the calibration"}
        How it was found.
    imep_closed_bar, imep_error_bar : float
        Closed IMEP of the traces as they stand, and by how much more it reads with angles that are 1 °CA too large
        [bar]: the means.
    loss_angle_cad : float
        Motored: by what the peak comes before TDC [°CA]; NaN if fired.
    wall_heat_scale : float
        Motored: the wall heat that the strokes need, over that of Hohenberg (1979) [-]; NaN if fired.
    findings : tuple of str
        Motored: what no sound engine has, a wall heat outside 0.1 to 2.5 or a peak more than 1.3 °CA before TDC.
    others_cad : tuple of float
        Fired: further minima of the residual that are as possible [°CA].
    dataset : xarray.Dataset
        ``low_cad`` and ``high_cad``; fired also ``rmse_percent`` over ``tdc_offset_cad``.
    """

    tdc_offset_cad: float
    low_cad: float
    high_cad: float
    method: str
    imep_closed_bar: float
    imep_error_bar: float
    loss_angle_cad: float = math.nan
    wall_heat_scale: float = math.nan
    findings: tuple[str, ...] = ()
    others_cad: tuple[float, ...] = ()
    dataset: xr.Dataset = field(repr=False)

    def __post_init__(self) -> None:
        labels = {name: unit_attributes("°CA", f"{end} possible offset") for name, end in _ENDS}
        ends = {name: ((), getattr(self, name), label) for name, label in labels.items()}
        object.__setattr__(self, "dataset", self.dataset.assign(ends))

    @property
    def figures(self) -> dict[str, Any]:
        """The estimate as plain values; what the method does not give is None."""
        names = ("method", "tdc_offset_cad", "low_cad", "high_cad", "suspect", "imep_closed_bar", "imep_error_bar")
        motored = {name: getattr(self, name) for name in ("loss_angle_cad", "wall_heat_scale")}
        return {
            **{name: getattr(self, name) for name in names},
            **{name: None if math.isnan(value) else value for name, value in motored.items()},
            "findings": list(self.findings),
            "others_cad": list(self.others_cad),
        }

    @property
    def cost(self) -> str:
        """What a degree costs, in words."""
        return str(DegreeCost(self.imep_closed_bar, self.imep_error_bar))

    @property
    def suspect(self) -> bool:
        """Whether the angles as they stand are outside the range."""
        return not self.low_cad <= 0.0 <= self.high_cad

    def doubts(self) -> list[str]:
        """Report that the angles are outside the range, and what no sound engine has."""
        if not self.suspect:
            return list(self.findings)
        edge = "tdc_offset_cad" in self.dataset and abs(self.tdc_offset_cad) >= abs(
            float(self.dataset["tdc_offset_cad"][0])
        )
        how = (
            "at the end of the search: it may be more"
            if edge
            else f"{self.low_cad:+.2f} to {self.high_cad:+.2f} possible"
        )
        shown = f"{self.tdc_offset_cad:+.2f} °CA too large ({how}; {self.cost})"
        text = f"the {self.method} has the angles {shown}: suspect TDC"
        return [f"{text}; {argument('tdc_offset_cad', f'{self.tdc_offset_cad:.2f}')} takes it off", *self.findings]

    def _draw(self, ax: Axes | None) -> Axes:
        from mgdd.plot.calibration import tdc_scan

        if "rmse_percent" not in self.dataset:
            raise DataError("a motored estimate has no scan to draw: use its offset and loss angle")
        return tdc_scan(self, ax=ax)


def estimate_tdc(
    traces: Sequence[Any],
    cylinder: CylinderLike,
    *,
    point: PointLike | None = None,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    bounds: Bounds | None = None,
    span_cad: float = 3.0,
    progress: Callable[[str], None] | None = None,
) -> TdcEstimate:
    """Estimate where firing TDC lies in the angles of traces from one encoder.

    Parameters
    ----------
    traces, point, fuel_heat_j, bounds
        As in `mgdd.identify.fit_cylinder`; absolute pressure, all motored or all fired.
    cylinder : Cylinder, Preset, str or path-like
        As in `mgdd.engine.simulate`: geometry; of a fired trace also the gamma law, linear in place of a constant
        one, whose parameter is fitted.
    span_cad : float
        Offsets up to this size are tried on fired traces, 0.5 to 10 [°CA].
    progress : callable, optional
        Called with a short text before each offset.

    Returns
    -------
    TdcEstimate
        Offset, its range, and how it was found.

    Raises
    ------
    mgdd.errors.DataError
        Motored and fired traces together, or a trace without its peak or its strokes.
    mgdd.errors.ParameterError
        A span outside its range.
    mgdd.errors.ConvergenceError
        No offset could be fitted.

    Notes
    -----
    Motored: from d degrees before to d after TDC, d from 5 to 60, ln p + ∫ gamma d ln V falls by what walls, ring gap
    and crevice take, and rises by 2 gamma d ln V/d phi for each degree that the angles are too large. The heat follows
    from the measured pressure by the laws of Woschni, Hohenberg, Eichelberg and Annand, each with a scale that is
    fitted; the range holds their spread, noise, and what temperatures, gap and crevice, which nobody states, move.
    Fired: the double Wiebe law with wall heat, gamma and its slope over temperature fitted at each offset; offsets
    whose RMSE stays within a quarter of the least are possible, and 0.5 CAD to each side, by which another gas and wall
    move it. ``docs/validation.md`` has both on engines that share no code with the package.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import estimate_tdc
    >>> traces, cylinder = datasets.read("hd_diesel_128x144")[1:2], presets.load("hd_diesel_128x144").cylinder
    >>> found = estimate_tdc(traces, cylinder, span_cad=1.0)
    >>> found.low_cad < 0.0 < found.high_cad
    True
    """
    ParameterError.unless(0.5 <= span_cad <= 10.0, "span_cad", span_cad, "0.5 to 10 °CA")
    cylinder = cylinder_of(cylinder)
    request = Request.of(
        traces, cylinder.replace(burn_shape="double_wiebe"), free=None, fuel_heat_j=fuel_heat_j, bounds=bounds,
        point=point, start_values=None, step_cad=0.5, integrator="trapezoid", options=None,
    )  # fmt: skip
    kinds = [bool(analyze(t, cylinder, point=point, quiet=True).attrs["motored"]) for t in request.traces]
    cost = DegreeCost.of_many([degree_cost(*closed(trace, cylinder), cylinder) for trace in request.traces])
    if all(kinds):
        return _of_motored(request, cost)
    if any(kinds):
        names = ", ".join(label for label, motored in zip(request.labels, kinds, strict=True) if motored)
        raise DataError(f"motored and fired traces together ({names} motored): estimate TDC from one kind")
    return _of_fired(request, cost, span_cad, progress)


def _of_motored(request: Request, cost: DegreeCost) -> TdcEstimate:
    strokes = []
    for trace, label in zip(request.traces, request.labels, strict=True):
        try:
            strokes.append(
                motored_tdc(*closed(trace, request.cylinder), request.cylinder, conditions(trace, request.point))
            )
        except DataError as error:
            raise error.reworded(f"{label}: {error}") from None
    motored = MotoredTdc.of_many(strokes)
    return TdcEstimate(
        tdc_offset_cad=motored.offset_cad,
        low_cad=motored.offset_cad - motored.offset_half_cad,
        high_cad=motored.offset_cad + motored.offset_half_cad,
        method="motored strokes",
        imep_closed_bar=cost.imep_bar,
        imep_error_bar=cost.error_bar,
        loss_angle_cad=motored.loss_angle_cad,
        wall_heat_scale=motored.wall_heat_scale,
        findings=motored.findings,
        dataset=labelled_dataset({}),
    )


def _of_fired(
    request: Request, cost: DegreeCost, span_cad: float, progress: Callable[[str], None] | None
) -> TdcEstimate:
    request = _with_gas(request)
    fits: dict[float, CylinderFit] = {}
    count = round(span_cad / _STEP_CAD)
    for step in sorted(range(-count, count + 1), key=abs):
        offset = step * _STEP_CAD
        if progress is not None:
            progress(f"calibrate with {offset:+.2f} CAD taken off")
        fits[offset] = _best_at(request, offset, fits)
    _smooth(request, fits)
    offsets = np.array(sorted(fits))
    rmse = np.array([100.0 * fits[offset].report.rmse for offset in offsets])
    if not np.isfinite(rmse).any():
        raise ConvergenceError("no calibration at any TDC offset: check geometry, pegging, speed and trapped mass")
    rmse = np.where(np.isfinite(rmse), rmse, np.inf)
    best = int(np.argmin(rmse))
    level = _RISE * rmse[best]
    fine = np.linspace(offsets[0], offsets[-1], 20 * (offsets.size - 1) + 1)
    inside = fine[np.interp(fine, offsets, rmse) <= level]
    inner = np.arange(1, offsets.size - 1)
    minima = inner[(rmse[inner] <= rmse[inner - 1]) & (rmse[inner] <= rmse[inner + 1]) & (rmse[inner] <= level)]
    return TdcEstimate(
        tdc_offset_cad=_vertex(offsets, rmse, best),
        low_cad=float(inside.min()) - _MODEL_CAD,
        high_cad=float(inside.max()) + _MODEL_CAD,
        method="residual of the calibration",
        imep_closed_bar=cost.imep_bar,
        imep_error_bar=cost.error_bar,
        others_cad=tuple(float(offsets[k]) for k in minima if k != best),
        dataset=labelled_dataset(
            {
                "tdc_offset_cad": ("tdc_offset_cad", offsets, "°CA", "angle taken off the trace"),
                "rmse_percent": ("tdc_offset_cad", rmse, "% of p_max", "pressure RMSE of the calibration"),
            }
        ),
    )


def _with_gas(request: Request) -> Request:
    """Free what moves TDC by as much as 1 CAD: wall heat, and gamma with its fall over temperature.

    A constant gamma is made linear: that of a real charge falls as it is heated and burns.
    """
    cylinder = request.cylinder
    if cylinder.gamma_model == "polynomial":
        return of_law(request, cylinder, (GAMMA_PARAMETER["polynomial"], "wall_heat_scale"))
    start = {name: min(max(float(getattr(cylinder, name)), low), high) for name, (low, high) in _GAS.items()}
    made = of_law(request, cylinder.replace(gamma_model="linear", **start), (*_GAS, "wall_heat_scale"))
    return replace(made, bounds={**_GAS, **made.bounds})


def _best_at(request: Request, offset: float, neighbours: dict[float, CylinderFit]) -> CylinderFit:
    """Fit at one offset, from the heat release and from the neighbour that is fitted: the better of both."""
    moved = request.shifted(angle_cad=-offset)
    fits = []
    try:
        fits.append(fit_request(moved))
    except DataError:  # a wrong angle may leave no heat release to start from; the neighbour has a burn
        if not neighbours:
            raise
    if neighbours:
        fits.append(_from(neighbours[min(neighbours, key=lambda other: abs(other - offset))], moved))
    return min(fits, key=rmse_of)


def _from(near: CylinderFit, moved: Request) -> CylinderFit:
    return fit_request(replace(moved, cylinder=near.model, start_values=starts_of(near)))


def _smooth(request: Request, fits: dict[float, CylinderFit]) -> None:
    """Fit again, outwards from the best, from the inner neighbour: the first fits may stay in another minimum."""
    offsets = sorted(fits)
    best = min(range(len(offsets)), key=lambda k: rmse_of(fits[offsets[k]]))
    for way in (range(best - 1, -1, -1), range(best + 1, len(offsets))):
        for k in way:
            near, offset = fits[offsets[k - way.step]], offsets[k]
            fits[offset] = min(fits[offset], _from(near, request.shifted(angle_cad=-offset)), key=rmse_of)


def _vertex(x: np.ndarray, y: np.ndarray, at: int) -> float:
    if at in (0, y.size - 1) or not np.isfinite(y[at - 1 : at + 2]).all():
        return float(x[at])
    bend = y[at - 1] - 2.0 * y[at] + y[at + 1]
    return float(x[at] + (0.5 * (y[at - 1] - y[at + 1]) / bend * (x[at + 1] - x[at]) if bend > 0.0 else 0.0))
