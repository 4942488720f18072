"""Thermal NO of a measured or simulated cycle, and its calibration to readings."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ShapeError
from mgdd.presets.meant import engine_of
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd._core.engine import Cylinder, OperatingPoint
    from mgdd.presets.meant import CylinderLike, PointLike

# Where the mixture of burned gas is sought; half of it leaves the NO of any engine.
_LAMBDA, _STEPS = (0.85, 1.6), 11
_FEWEST_FOR_LAMBDA = 4
_PLAUSIBLE = 0.05, 5.0  # factors that rates and mixing explain


@dataclass(frozen=True, kw_only=True)
class ThermalNo:
    """Thermal NO of a cycle: extended Zeldovich mechanism in two zones.

    What burns in a step is a packet at its adiabatic flame temperature, in equilibrium but for NO; it follows the
    pressure and mixes with the bulk. Ranks cycles without any fit; the level is uncertain by a factor of two through
    the first rate alone, and by the mixing: fit ``calibration``, and ``lambda_burned`` where points suffice.

    Parameters
    ----------
    lambda_burned : float
        Air over what the fuel needs, where it burns [-]; 1.0 to 1.2 as a rule (Egnell 1998).
    mixing_time_ms : float
        In which burned gas takes on the bulk temperature [ms]; 1 to 3 as a rule.
    intake_o2_fraction : float
        Oxygen in the charge by volume [-]; below 0.209 it is air with burned gas of the same fuel.
    hydrogen_to_carbon : float
        Atoms of the fuel [-].
    rates : {"hanson_salimian", "heywood"}
        Rate coefficients: Hanson and Salimian (1984), or Heywood (1988), table 11.1, of half the NO.
    calibration : float
        Factor on the NO [-].

    Examples
    --------
    >>> from mgdd.engine import ThermalNo, simulate
    >>> early, late = (simulate("puma_single", soc_cad=soc) for soc in (-10.0, 0.0))
    >>> no = ThermalNo(calibration=0.4)
    >>> [round(float(no.cycle(c, "puma_single")["nox_ppm"]), -1) for c in (early, late)]
    [830.0, 440.0]
    """

    lambda_burned: float = 1.1
    mixing_time_ms: float = 2.0
    intake_o2_fraction: float = 0.209
    hydrogen_to_carbon: float = 1.86
    rates: str = "hanson_salimian"
    calibration: float = 1.0

    def cycle(self, cycle: xr.Dataset, cylinder: CylinderLike, *, point: PointLike | None = None) -> xr.Dataset:
        """Compute the NO of one cycle.

        Parameters
        ----------
        cycle : xarray.Dataset
            Of `simulate`, or of `analyze` for one measured cycle or the mean of several.
        cylinder : Cylinder, Preset, str or path-like
            The cylinder; or a preset, its name or its file.
        point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
            Speed and fuel of the cycle, as in `simulate`.

        Returns
        -------
        xarray.Dataset
            ``nox_ppm`` [ppm of all gas, wet] and ``nox_g_per_kwh`` [g NO2 over the closed-cycle work],
            ``lambda_global`` and ``flame_max_k``; over ``crank_angle_cad``: ``no_ppm``, ``flame_k`` of what burns and
            ``unburned_k``.

        Raises
        ------
        mgdd.errors.ParameterError
            A value outside its domain; a mixture that needs more air than the cycle has; no fuel.
        mgdd.errors.DataError
            Several cycles, a trace without temperature, nothing that burns.
        """
        raw = _raw(self, cycle, *engine_of(cylinder, point))
        return labelled_dataset(
            {
                ANGLE: (ANGLE, raw["angle"]),
                **{name: (ANGLE, raw[name]) for name in ("no_ppm", "flame_k", "unburned_k")},
                **{name: ((), raw[name]) for name in ("nox_ppm", "nox_g_per_kwh", "lambda_global", "flame_max_k")},
            },
            attrs=asdict(self),
        )

    def fit(
        self,
        cycles: Sequence[xr.Dataset],
        nox_ppm: ArrayLike,
        cylinder: CylinderLike,
        *,
        point: Sequence[PointLike] | PointLike | None = None,
    ) -> ThermalNoFit:
        """Fit the factor, and from four cycles on the mixture, to measured NOx by least squares of ln NOx.

        Parameters
        ----------
        cycles : sequence of Dataset
            Cycles as `cycle` takes them.
        nox_ppm : array_like
            Measured NOx of each [ppm], wet.
        cylinder : Cylinder, Preset, str or path-like
            The cylinder; or a preset, its name or its file.
        point : sequence of points, or one
            Speed and fuel of each cycle, or of all.

        Returns
        -------
        ThermalNoFit
            The fitted model, the deviation that is left, the interval of the mixture, and what is doubtful.

        Raises
        ------
        mgdd.errors.DataError
            No cycle, or NOx that is not positive and finite.
        mgdd.errors.ShapeError
            Numbers of cycles, points and NOx that differ.
        """
        measured = np.atleast_1d(np.asarray(nox_ppm, dtype=np.float64))
        each = list(point) if isinstance(point, Sequence) and not isinstance(point, str) else [point] * len(cycles)
        if not len(cycles) == measured.size == len(each):
            raise ShapeError(f"{len(cycles)} cycles, {measured.size} values of nox_ppm, {len(each)} points: give alike")
        if not measured.size:
            raise DataError("no cycle: give at least one with its NOx")
        if not np.all(good := np.isfinite(measured) & (measured > 0.0)):
            at = int(np.flatnonzero(~good)[0])
            raise DataError.of(f"nox_ppm[{at}]", float(measured[at]), "> 0 and finite: leave such cycles out")
        made = [(cycle, *engine_of(cylinder, point)) for cycle, point in zip(cycles, each, strict=True)]

        def ratios(mixtures: NDArray[np.float64]) -> NDArray[np.float64]:
            models = [replace(self, lambda_burned=float(mixture), calibration=1.0) for mixture in mixtures]
            return np.log(measured) - np.log([[_raw(model, *case)["nox_ppm"] for case in made] for model in models])

        if measured.size < _FEWEST_FOR_LAMBDA:
            alone = np.array([self.lambda_burned])
            return _fitted(self, alone, ratios(alone))
        leanest = min(float(_raw(self, *one)["lambda_global"]) for one in made)
        coarse = np.linspace(_LAMBDA[0], min(_LAMBDA[1], leanest), _STEPS)
        left = ratios(coarse)
        best, step = float(coarse[left.var(axis=1).argmin()]), coarse[1] - coarse[0]
        fine = np.linspace(max(best - step, coarse[0]), min(best + step, coarse[-1]), _STEPS)
        order = np.argsort(both := np.concatenate([coarse, fine]), kind="stable")
        return _fitted(self, both[order], np.concatenate([left, ratios(fine)])[order])


class ThermalNoFit(NamedTuple):
    """A fitted `ThermalNo`.

    Attributes
    ----------
    model : ThermalNo
        With the fitted factor and mixture.
    points : int
        Cycles.
    residual_ln : float
        Standard deviation of ln NOx about the fit [-]; NaN without a remaining degree of freedom.
    lambda_low, lambda_high : float
        Interval of the mixture at 95 % [-]; NaN where it was not fitted.
    doubts : tuple of str
        What is doubtful.
    """

    model: ThermalNo
    points: int
    residual_ln: float
    lambda_low: float
    lambda_high: float
    doubts: tuple[str, ...]


def _raw(model: ThermalNo, cycle: xr.Dataset, cylinder: Cylinder, point: OperatingPoint) -> dict[str, Any]:
    angle, pressure, volume, temperature, burned = _columns(cycle, cylinder.ivc_cad, cylinder.evo_cad)
    core = _core.engine.ThermalNoModel(**asdict(model))
    raw = _core.engine.thermal_no(angle, pressure, volume, temperature, burned, cylinder, point, core)
    return {"angle": angle, **raw}


def _fitted(model: ThermalNo, mixtures: NDArray[np.float64], ratios: NDArray[np.float64]) -> ThermalNoFit:
    """Take the best of the mixtures (rows of `ratios`, ln measured over computed) with its factor and interval."""
    n_tried, n = ratios.shape
    errors = ((ratios - ratios.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    best = int(errors.argmin())
    made = replace(model, lambda_burned=float(mixtures[best]), calibration=float(np.exp(ratios[best].mean())))
    freedom = n - (2 if mixtures.size > 1 else 1)
    residual = math.sqrt(errors[best] / freedom) if freedom > 0 else math.nan
    low = high = math.nan
    doubts = []
    if mixtures.size > 1:
        from scipy.stats import f

        limit = errors[best] * (1.0 + float(f.ppf(0.95, 1, freedom)) / freedom)
        low, high = (_edge(mixtures, errors - limit, range(best, end, step)) for end, step in ((-1, -1), (n_tried, 1)))
        if low == mixtures[0] or high == mixtures[-1]:
            doubts.append(
                f"the cycles leave the mixture open: 95 % between {low:.2f} and {high:.2f}, of {mixtures[0]:.2f} to "
                f"{mixtures[-1]:.2f} that were tried: vary timing and fuel more"
            )
    else:
        doubts.append(
            f"{n} cycle(s): the mixture stays {made.lambda_burned:g}; it takes {_FEWEST_FOR_LAMBDA} to estimate it"
        )
    if not _PLAUSIBLE[0] <= made.calibration <= _PLAUSIBLE[1]:
        doubts.append(f"a calibration of {made.calibration:.3g}: unit of nox_ppm, fuel or exhaust gas may be wrong")
    return ThermalNoFit(made, n, residual, low, high, tuple(doubts))


def _edge(mixtures: NDArray[np.float64], above: NDArray[np.float64], path: range) -> float:
    """Return where the errors first rise above their limit on a way from the best one, or its end."""
    for here, there in itertools.pairwise(path):
        if above[there] > 0.0:
            return float(np.interp(0.0, above[[here, there]], mixtures[[here, there]]))
    return float(mixtures[path[-1]])


def _columns(cycle: xr.Dataset, ivc: float, evo: float) -> list[NDArray[np.float64]]:
    """Give angle, pressure, volume, temperature and burned fraction of a closed cycle."""
    variables = getattr(cycle, "variables", ())
    missing = [name for name in ("pressure_bar", "volume_l", "temperature_k") if name not in variables]
    if missing:
        raise DataError(f"the cycle has no {missing[0]}: give one of simulate, or of analyze")
    if cycle["pressure_bar"].dims != (ANGLE,):
        raise DataError(f"pressure_bar is over {cycle['pressure_bar'].dims}: give one cycle, or analyze their mean")
    angle = cycle[ANGLE].to_numpy()
    closed = (angle >= ivc - 1e-9) & (angle <= evo + 1e-9)
    if "burned_fraction" in cycle:
        burned = cycle["burned_fraction"].to_numpy()[closed]
    elif "heat_gross_cumulative_j" in cycle:
        heat = cycle["heat_gross_cumulative_j"].to_numpy()[closed]
        start = angle[closed] >= float(cycle.get("heat_from_cad", -60.0))
        heat = np.where(start, heat - heat[start][0], 0.0)
        burned = np.maximum.accumulate(heat.clip(0.0)) / max(float(heat.max()), 1e-12)
    else:
        raise DataError("the cycle has no burned_fraction or heat_gross_cumulative_j: give one of simulate or analyze")
    columns = (cycle[name].to_numpy()[closed] for name in ("pressure_bar", "volume_l", "temperature_k"))
    return [angle[closed], *columns, burned]
