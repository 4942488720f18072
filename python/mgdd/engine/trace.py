"""Analysis of measured or simulated pressure traces, one cycle or many."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine.dead_centre import degree_cost
from mgdd.engine.doubts import sample_doubts
from mgdd.engine.trace_cycles import COLUMNS, expansion_of, is_of_cycles, of_cycles
from mgdd.errors import DataError, ParameterError, printable
from mgdd.io.pressure import as_trace
from mgdd.presets.meant import CylinderLike, PointLike, cylinder_of, point_of, stated
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.results.dataset import Dataset

_CONDITIONS = ("speed_rpm", "trapped_mass_g", "intake_temperature_k", "ivc_temperature_k")
_LOG = logging.getLogger(__name__)
# A point's intake pressure is often that of a preset at another load; what the caller states is judged closer.
_POINT_FACTOR, _STATED_FACTOR = 3.0, 1.5
_DP_MAX = "slope of the least-squares line over 2 °CA"


def analyze(
    trace: Any,
    cylinder: CylinderLike,
    *,
    point: PointLike | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    gamma: float | str | None = None,
    heat_window_cad: tuple[float, float] | None = None,
    fractions: str = "net",
    smoothing: str | None = None,
    smoothing_width_cad: float = 4.0,
    smoothing_cutoff_hz: float = 3000.0,
    knock_band_hz: tuple[float, float] = (4000.0, 20000.0),
    knock_window_cad: tuple[float, float] = (-10.0, 90.0),
    knock_threshold_bar: float | None = None,
    bmep_bar: float | None = None,
    brake_torque_nm: float | None = None,
    n_cylinders: int = 1,
    fuel_mg: float | None = None,
    keep_traces: bool = True,
    quiet: bool = False,
) -> Dataset:
    """Analyse pressure: pegging, heat release, burn angles, work, polytropic exponents, of one cycle or of many.

    Parameters
    ----------
    trace : Dataset, DataFrame, mapping, DataArray, Series, pair of array_like, path-like, or iterator of Dataset
        ``pressure_bar(crank_angle_cad)``, or ``pressure_bar(cycle, crank_angle_cad)`` for a record of cycles, from
        `mgdd.io.read_pressure`, `mgdd.io.pressure_trace` or `simulate`; a table with these columns [°CA aTDC, bar], a
        column over crank angle, angle and pressure as a pair, or a file that `mgdd.io.read_pressure` reads without
        options; or chunks of a record one after another, as of `mgdd.io.pressure_chunks`, with ``keep_traces=False``:
        the figures are those of the whole. The attributes ``speed_rpm trapped_mass_g ivc_temperature_k
        intake_pressure_kpa soi_cad spark_cad bmep_bar brake_torque_nm n_cylinders fuel_mg`` are used where present.
    cylinder : Cylinder, Preset, str or path-like
        As in `simulate`: geometry and wall-heat law. Samples outside IVC..EVO serve only pegging.
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        Speed, temperatures and trapped mass where the trace has none. Without a mass it is p V/(R T) at IVC, with
        ``ivc_temperature_k`` or the intake temperature + 40 K. Numbers by name are of this record: their ``fuel_mg``
        and ``intake_pressure_kpa`` judge the trace as the keywords do. A preset or an OperatingPoint may be of another
        load: its fuel judges nothing, its intake pressure a factor of 3.
    pegging : {"none", "inlet", "two_point", "least_squares"}
        ``none`` takes the trace as absolute. ``inlet`` sets the mean within ±5 CAD of intake bottom dead centre to
        ``inlet_pressure_kpa``; the other two fit compression with ``pegging_exponent``.
    pegging_exponent : float
        Polytropic exponent of compression [-].
    inlet_pressure_kpa : float, optional
        For ``inlet`` (there the point's intake pressure if only a point is given). With any pegging, p(IVC) beyond a
        factor of 1.5 of it is a warning.
    gamma : float or {"split", "cylinder"}, optional
        Of the heat release; 1.33 for a measured trace and ``cylinder`` for a simulated one if left out. A number is a
        constant [-]; ``split`` is 1.37 before the burn and 1.30 from its start on, and falls to first order in the
        crank step at the jump; ``cylinder`` is the cylinder's own law.
    heat_window_cad : tuple of float, optional
        Window of the cumulative heat [°CA aTDC]. Left out, it is found: from 5 CAD before the burn, searched from
        ``soi_cad`` or ``spark_cad`` on where the trace has it, to 20 CAD after its end; for a simulated trace it is the
        whole. The heat is the peak of the cumulative value for a measured trace, its end for a simulated one.
    fractions : {"net", "gross", "rassweiler_withrow"}
        What CA10, CA50 and CA90 are shares of: net heat, gross heat (net plus the modelled wall heat), or the pressure
        rise by combustion (Rassweiler and Withrow 1938), which needs no gamma and no mass.
    smoothing : {"none", "savitzky_golay", "low_pass", "angle_window"}, optional
        Of the pressure before it is differentiated for the heat, without shift of phase; peak, work and temperature
        keep the measured pressure. Left out: ``savitzky_golay`` where at least 9 samples fall into the width, else
        none; a simulated trace is not smoothed.
    smoothing_width_cad : float
        Whole width [°CA] of ``savitzky_golay`` (a local parabola) and ``angle_window`` (a mean).
    smoothing_cutoff_hz : float
        Of ``low_pass`` [Hz]: a second-order Butterworth forward and backward, gain 1/2 there.
    knock_band_hz : tuple of float
        Band of the pressure oscillation [Hz], as in `Indicating`.
    knock_window_cad : tuple of float
        Where it is looked for [°CA aTDC].
    knock_threshold_bar : float, optional
        Of MAPO [bar]: a cycle of a record above it knocks.
    bmep_bar : float, optional
        Measured brake mean effective pressure [bar]. A cycle whose gross IMEP cannot reach it is refused; one that is
        too near to it, or too far, is doubted.
    brake_torque_nm : float, optional
        Measured torque of the engine [N m], turned into ``bmep_bar`` by the swept volume (four-stroke).
    n_cylinders : int
        Cylinders behind ``brake_torque_nm``.
    fuel_mg : float, optional
        Measured fuel per cycle of this cylinder [mg]. A gross heat outside 0.83 to 1.18 of its heat is doubted, below a
        compression ratio of 14 outside 0.70 to 1.18.
    keep_traces : bool
        False for the figures of a long record without its traces, which take the memory; the figures are the same.
    quiet : bool
        Leave the warnings to the attribute instead of logging them too.

    Returns
    -------
    xarray.Dataset
        Traces over ``crank_angle_cad`` (rates belong to the step that ends at the sample) and scalars
        ``heat_from_cad heat_to_cad heat_gross_j work_closed_j t_max_k trapped_mass_g tdc_offset_cad
        compression_offset_bar`` and those of `Indicating`, NaN where the trace does not reach.
        Burn angles are NaN for a motored trace, ``tdc_offset_cad`` (what its angles are too
        large by, good to 1.4 CAD) for a fired one. Attributes ``method``, ``gamma``, ``fractions``, ``smoothing``,
        ``dp_max``, ``mass_source``, ``heat_window`` (``found``, ``given``, ``whole`` or ``no burn found``),
        ``motored`` (1: no burn in this trace, else 0) and ``warnings`` (what makes the figures doubtful, one per
        line), ``doubts`` (the kind of each) and ``open``: what a fired trace does not show, an error of TDC, with what
        1 °CA of it does to the closed IMEP.

        Of a record of cycles, traces and scalars have the dimension ``cycle``; beside each scalar stand mean,
        deviation, percentiles and COV, ``misfire`` and ``partial_burn`` as `Indicating.record` gives them,
        ``cycle_mean_NAME`` is the figure of the averaged pressure, and ``motored`` counts cycles. The spectrum
        ``pressure_psd_bar2_per_khz`` of each cycle in the knock window stands over ``frequency_khz``;
        ``ringing_frequency_khz`` is where the mean of the spectra has its highest peak in the knock band, NaN where
        none is four times as high as its surroundings (or more where few cycles leave much to noise). Beside it
        stand ``tangential_mode_khz``, 1.841 c/(pi bore) with the speed of sound c of air at ``t_max_k``, and with
        `knock_threshold_bar` ``knock_share_percent``.

    Raises
    ------
    mgdd.errors.DataError
        A trace with gaps, NaN, unsorted or repeated angles, a wrong unit, without the angles that pegging reads, or
        whose gross IMEP cannot reach the stated BMEP.
    mgdd.errors.ParameterError
        An unknown option, a value outside its domain, or a trapped mass that cannot be.

    References
    ----------
    Heywood (1988), chapter 9; Krieger and Borman (1966); Randolph (1990); Brunt and Pond (1997); Savitzky and Golay
    (1964); Draper (1938).

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.engine import analyze
    >>> cylinder = presets.load("hd_diesel_128x144").cylinder
    >>> for trace in datasets.read("hd_diesel_128x144"):
    ...     print(round(float(analyze(trace, cylinder)["ca50_cad"]), 1))
    5.0
    6.9
    9.4
    14.9
    """
    cylinder, stated_point = cylinder_of(cylinder), point
    point = point_of(point)
    named = stated("fuel_mg", fuel_mg, stated_point)
    fuel_mg = named if named or fuel_mg is not None else None  # a point without fuel is motored
    if isinstance(trace, Iterator):
        trace, chunks = _first_of(trace, keep_traces=keep_traces)
    else:
        trace = trace if is_of_cycles(trace) else as_trace(trace)
        chunks = iter([trace])
    doubted: list[str] = []  # by who read it, and logged there
    simulated = "motored_pressure_bar" in trace.variables
    whole = None if isinstance(stated_point, Mapping) else point  # what it leaves out is a default, not this record's
    if inlet_pressure_kpa is None:
        inlet_pressure_kpa = stated("intake_pressure_kpa", None, stated_point)
    if pegging == "inlet" and inlet_pressure_kpa is None and whole is None:
        raise ParameterError("pegging 'inlet' needs inlet_pressure_kpa, or a point with its intake_pressure_kpa")
    if fractions not in ("net", "gross", "rassweiler_withrow"):
        raise ParameterError.of("fractions", fractions, "net, gross or rassweiler_withrow")
    state = conditions(trace, point)
    source, number, text = _gamma(gamma if gamma is not None else ("cylinder" if simulated else 1.33))
    window = heat_window_cad or ((cylinder.ivc_cad, cylinder.evo_cad) if simulated else None)
    intake = _number(trace, "intake_pressure_kpa", inlet_pressure_kpa)
    options = {
        "pegging": pegging, "pegging_exponent": pegging_exponent,
        "inlet_pressure_kpa": state.intake_pressure_kpa if inlet_pressure_kpa is None else inlet_pressure_kpa,
        "gamma_source": source, "gamma": number,
        "heat_from_cad": window[0] if window else None, "heat_to_cad": window[1] if window else None,
        "earliest_burn_cad": _number(trace, "soi_cad", _number(trace, "spark_cad")),
        "burn_from_cad": float(trace["soc_cad"]) if simulated else None,
        "total_at_end": simulated, "fractions": fractions,
        "smoothing": _smoothing(smoothing, simulated), "smoothing_width_cad": smoothing_width_cad,
        "smoothing_cutoff_hz": smoothing_cutoff_hz,
        "intake_pressure_kpa": intake if intake is not None or whole is None else whole.intake_pressure_kpa,
        "intake_factor": _POINT_FACTOR if intake is None else _STATED_FACTOR,
        "bmep_bar": _bmep(trace, cylinder, bmep_bar, brake_torque_nm, n_cylinders),
        "fuel_heat_j": _fuel_heat(trace, cylinder, fuel_mg),
        "knock_low_hz": knock_band_hz[0], "knock_high_hz": knock_band_hz[1],
        "knock_from_cad": knock_window_cad[0], "knock_to_cad": knock_window_cad[1],
    }  # fmt: skip
    if knock_threshold_bar is not None and not knock_threshold_bar > 0.0:
        raise ParameterError.of("knock_threshold_bar", knock_threshold_bar, "> 0 bar")
    file = trace.attrs.get("file", "trace")
    attrs = {"file": file, "method": pegging, "gamma": text, "fractions": fractions, "dp_max": _DP_MAX}
    given = "given" if heat_window_cad else "whole" if simulated else None
    try:
        if is_of_cycles(trace):
            result = of_cycles(
                _noting(chunks, doubted), cylinder, state, options, attrs, given, knock_threshold_bar,
                traces=keep_traces,
            )  # fmt: skip
        elif knock_threshold_bar is not None:
            raise ParameterError("knock_threshold_bar is for a record of cycles, and this is one cycle: leave it out")
        elif keep_traces:
            result = _one(trace, cylinder, state, options, attrs, given)
        else:
            raise ParameterError("keep_traces = False is for a record of cycles, and this is one cycle: leave it out")
    except DataError as error:
        if error.field != "bmep_bar" or _number(trace, "brake_torque_nm", brake_torque_nm) is None:
            raise
        raise error.reworded(f"{error}; the torque was taken as that of its cylinders: see n_cylinders") from None
    for warning in () if quiet else result.attrs["warnings"].splitlines():
        _LOG.warning("%s", printable(f"{file}: {warning}"))
    if not is_of_cycles(trace):
        doubted = str(trace.attrs.get("warnings", "")).splitlines()
    return result.assign_attrs(
        warnings="\n".join([*doubted, *result.attrs["warnings"].splitlines()]),
        doubts="\n".join([*("reading" for _ in doubted), *result.attrs["doubts"].splitlines()]),
        open="" if simulated else result.attrs["open"],  # its angles were not measured
    )


def _first_of(chunks: Iterator[Any], *, keep_traces: bool) -> tuple[Any, Iterator[Any]]:
    """Give the first chunk, and all of them."""
    if keep_traces:
        raise ParameterError(
            "keep_traces = True: chunks of a record are analysed for their figures: pass keep_traces=False"
        )
    first = next(chunks, None)
    if first is None or not is_of_cycles(first):
        have = "no chunk" if first is None else f"a chunk of type {type(first).__name__}"
        raise DataError(f"{have}: each must be pressure_bar(cycle, {ANGLE}), as of mgdd.io.pressure_chunks")
    return first, itertools.chain([first], chunks)


def _noting(chunks: Iterator[Any], doubted: list[str]) -> Iterator[xr.Dataset]:
    """Pass chunks on, and keep what their reader doubted."""
    for chunk in chunks:
        lines = str(chunk.attrs.get("warnings", "")).splitlines()
        doubted += [line for line in lines if line not in doubted]
        yield chunk


def _one(
    trace: xr.Dataset,
    cylinder: Cylinder,
    point: OperatingPoint,
    options: dict[str, Any],
    attrs: dict[str, Any],
    given: str | None,
) -> Dataset:
    made = _core.engine.TraceOptions(**options)
    angle, bar = trace[ANGLE].values, trace["pressure_bar"].values
    raw = _core.engine.analyze(angle, bar, cylinder, point, made)
    doubts = list(zip(raw["doubts"], raw["warnings"], strict=True)) + expansion_of(raw, cylinder, point)
    doubts = sample_doubts(angle, bar) + doubts
    return labelled_dataset(
        {
            ANGLE: (ANGLE, raw[ANGLE]),
            "volume_l": (ANGLE, raw["volume_l"]),
            **{name: (ANGLE, raw[name]) for name in COLUMNS},
            **{name: ((), value) for name, value in raw["scalars"].items()},
        },
        attrs={
            **attrs,
            "smoothing": raw["smoothing"],
            "mass_source": raw["mass_source"],
            "heat_window": given or ("found" if raw["window_found"] else "no burn found"),
            "motored": int(raw["motored"]),
            "warnings": "\n".join(text for _, text in doubts),
            "doubts": "\n".join(kind for kind, _ in doubts),
            "open": "" if raw["motored"] else degree_cost(raw[ANGLE], raw["pressure_bar"], cylinder).of_fired(),
        },
    )


def _number(trace: xr.Dataset, name: str, given: float | None = None) -> float | None:
    """Return what the caller gives, else the trace's own attribute, where it is a number."""
    if given is not None:
        return float(given)
    value = trace.attrs.get(name)
    return None if value is None or math.isnan(float(value)) else float(value)


def conditions(trace: xr.Dataset, point: OperatingPoint | None) -> OperatingPoint:
    """Give the operating point of a trace: its own attributes over ``point``."""
    changes = {name: _number(trace, name) for name in _CONDITIONS}
    return (point or OperatingPoint()).replace(**{k: v for k, v in changes.items() if v is not None})


def _smoothing(smoothing: str | None, simulated: bool) -> str:
    if smoothing == "automatic":
        raise ParameterError.of("smoothing", smoothing, "none, savitzky_golay, low_pass or angle_window")
    return smoothing or ("none" if simulated else "automatic")


def _bmep(
    trace: xr.Dataset, cylinder: Cylinder, bmep: float | None, torque: float | None, cylinders: int
) -> float | None:
    """BMEP [bar] as given, or 4 pi torque over the displacement of a four-stroke engine."""
    if bmep is not None and torque is not None:
        raise ParameterError("bmep_bar and brake_torque_nm both state the brake work: give one")
    if torque is None and (bmep_bar := _number(trace, "bmep_bar", bmep)) is not None:
        return bmep_bar
    torque = _number(trace, "brake_torque_nm", torque)
    if torque is None:
        return None
    cylinders = int(trace.attrs.get("n_cylinders", cylinders)) if cylinders == 1 else cylinders
    ParameterError.unless(cylinders >= 1, "n_cylinders", cylinders, ">= 1")
    return 4.0 * math.pi * torque / (cylinder.swept_volume_l * 1e-3 * cylinders) / 1e5


def _fuel_heat(trace: xr.Dataset, cylinder: Cylinder, fuel_mg: float | None) -> float | None:
    """Heat [J] of the fuel that is stated for this trace; mg times MJ/kg are J."""
    fuel = _number(trace, "fuel_mg", fuel_mg)
    ParameterError.unless(fuel_mg is None or 0.0 < fuel_mg < math.inf, "fuel_mg", fuel_mg, "> 0 mg per cycle")
    return fuel * cylinder.lower_heating_value_mj_per_kg if fuel else None


def _gamma(gamma: float | str) -> tuple[str, float, float | str]:
    if isinstance(gamma, str):
        ParameterError.unless(gamma in ("split", "cylinder"), "gamma", gamma, "a number, split or cylinder")
        return gamma, 1.33, gamma
    return "constant", float(gamma), float(gamma)
