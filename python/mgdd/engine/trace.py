"""Analysis of a measured or simulated pressure trace."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.errors import ParameterError
from mgdd.io.trace_forms import as_trace
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["analyze"]

_LOG = logging.getLogger(__name__)
_COLUMNS = (
    "pressure_bar",
    "volume_l",
    "temperature_k",
    "heat_release_net_j_per_cad",
    "heat_release_gross_j_per_cad",
    "heat_loss_j_per_cad",
    "heat_net_cumulative_j",
    "heat_gross_cumulative_j",
)


def analyze(
    trace: Any,
    cylinder: Cylinder,
    *,
    point: OperatingPoint | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    gamma: float | str | None = None,
    heat_window_cad: tuple[float, float] | None = None,
    fractions: str = "net",
    quiet: bool = False,
) -> xr.Dataset:
    """Analyse a pressure trace: pegging, heat release, burn angles, work, polytropic exponents.

    Parameters
    ----------
    trace : Dataset, DataFrame, mapping, DataArray, Series, pair of array_like, or path-like
        ``pressure_bar(crank_angle_cad)``, from `mgdd.io.read_pressure`, `mgdd.io.pressure_trace` or `simulate`; a table
        with these columns [°CA aTDC, bar], a column over crank angle, angle and pressure as a pair, or a file that
        `mgdd.io.read_pressure` reads without options. Attributes ``speed_rpm`` and ``trapped_mass_g`` are used where
        present.
    cylinder : Cylinder
        Geometry and wall-heat law. Samples outside IVC..EVO serve only pegging.
    point : OperatingPoint, optional
        Speed, intake temperature and trapped mass where the trace does not say. Without a mass the trapped amount is
        ``volumetric_efficiency p(first) V_s/(R T_in)``.
    pegging : {"none", "inlet", "two_point", "least_squares"}
        ``none`` takes the trace as absolute. ``inlet`` sets the mean within ±5 CAD of intake bottom dead centre to
        ``inlet_pressure_kpa``; the other two fit compression with ``pegging_exponent``.
    pegging_exponent : float
        Polytropic exponent of compression [-].
    inlet_pressure_kpa : float, optional
        For ``inlet``; the point's intake pressure if only a point is given.
    gamma : float or {"split", "cylinder"}, optional
        1.33 for a measured trace and ``cylinder`` for a simulated one if left out. A number is a constant [-];
        ``split`` is 1.37 before the heat window and 1.30 from there on; ``cylinder`` is the cylinder's own law.
    heat_window_cad : tuple of float, optional
        Window of the cumulative heat [°CA aTDC]; -10 to 90 for a measured trace, the whole for a simulated one. The
        heat is the peak of the cumulative value for a measured trace, its end for a simulated one.
    fractions : {"net", "gross"}
        Heat that CA10, CA50 and CA90 refer to. Gross is net plus the modelled wall heat.
    quiet : bool
        Leave the warnings to the attribute instead of logging them too.

    Returns
    -------
    xarray.Dataset
        Traces over ``crank_angle_cad`` (rates belong to the step that ends at the sample) and scalars
        ``pegging_bar n_compression n_expansion ca10_cad ca50_cad ca90_cad heat_net_j heat_gross_j imep_closed_bar
        p_max_bar p_max_cad dp_max_bar_per_cad t_max_k``. Attributes ``method``, ``gamma``, ``fractions``,
        ``motored`` (1: no burn in this trace, else 0) and ``warnings`` (what makes the figures doubtful, one per line).

    Raises
    ------
    mgdd.errors.DataError
        A trace with gaps, NaN, unsorted or repeated angles, a wrong unit, or without the angles that pegging reads.
    mgdd.errors.ParameterError
        An unknown option or a value outside its domain.

    References
    ----------
    Heywood (1988), chapter 9; Krieger and Borman (1966); Randolph (1990); Brunt and Pond (1997).

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.engine import analyze
    >>> cylinder = presets.load("hd_diesel_128x144").cylinder
    >>> for trace in datasets.load("hd_diesel_128x144"):
    ...     print(round(float(analyze(trace, cylinder)["ca50_cad"]), 1))
    5.0
    6.9
    9.4
    14.9
    """
    trace = as_trace(trace)
    simulated = "motored_pressure_bar" in trace.variables
    if pegging == "inlet" and inlet_pressure_kpa is None and point is None:
        raise ParameterError("pegging 'inlet' needs inlet_pressure_kpa, or a point with its intake pressure")
    point = _conditions(trace, point)
    window = heat_window_cad or ((cylinder.ivc_cad, cylinder.evo_cad) if simulated else (-10.0, 90.0))
    if fractions not in ("net", "gross"):
        raise ParameterError.of("fractions", fractions, "net or gross")
    source, number, text = _gamma(gamma if gamma is not None else ("cylinder" if simulated else 1.33))
    inlet = point.intake_pressure_kpa if inlet_pressure_kpa is None else inlet_pressure_kpa
    options = _core.engine.TraceOptions(
        pegging=pegging,
        pegging_exponent=pegging_exponent,
        inlet_pressure_kpa=inlet,
        gamma_source=source,
        gamma=number,
        heat_from_cad=window[0],
        heat_to_cad=window[1],
        burn_from_cad=float(trace["soc_cad"]) if simulated else window[0],
        total_at_end=simulated,
        fractions_of_gross=fractions == "gross",
    )
    raw = _core.engine.analyze(trace[ANGLE].values, trace["pressure_bar"].values, cylinder, point, options)
    for warning in () if quiet else raw["warnings"]:
        _LOG.warning("%s: %s", trace.attrs.get("file", "trace"), warning)
    return labelled_dataset(
        {
            ANGLE: (ANGLE, raw[ANGLE]),
            **{name: (ANGLE, raw[name]) for name in _COLUMNS},
            **{name: ((), value) for name, value in raw["scalars"].items()},
        },
        attrs={
            "file": trace.attrs.get("file", "trace"),
            "method": pegging,
            "gamma": text,
            "fractions": fractions,
            "motored": int(raw["motored"]),
            "warnings": "\n".join(raw["warnings"]),
        },
    )


def _conditions(trace: xr.Dataset, point: OperatingPoint | None) -> OperatingPoint:
    changes = {
        name: float(trace.attrs[name]) for name in ("speed_rpm", "trapped_mass_g") if trace.attrs.get(name) is not None
    }
    return (point or OperatingPoint()).replace(**changes)


def _gamma(gamma: float | str) -> tuple[str, float, float | str]:
    if isinstance(gamma, str):
        if gamma not in ("split", "cylinder"):
            raise ParameterError.of("gamma", gamma, "a number, split or cylinder")
        return gamma, 1.33, gamma
    return "constant", float(gamma), float(gamma)
