"""A calibration as a report: measured traces, cycle models, their best timing, and what the traces do not identify."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mgdd import _core, datasets, presets
from mgdd.engine import analyze
from mgdd.errors import Interrupted
from mgdd.identify import best_timing, estimate_tdc, wall_heat_profile
from mgdd.identify.engine.best_timing import doubts_of, headline_of
from mgdd.identify.engine.calibration import TDC_SPAN_CAD, compare_laws, law_row
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.family import Member
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import CylinderFit, Load, figures_of, starts_of
from mgdd.identify.engine.request import GAMMA_PARAMETER, listed, pegged
from mgdd.parallel.finished import hand_over, or_partial
from mgdd.presets.meant import cylinder_of, point_of
from mgdd.report.calibration_page import draw, move_of, sections_of
from mgdd.report.report import Report
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.results.result import Figures

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.engine.family import Member
    from mgdd.identify.engine.tdc import TdcEstimate
    from mgdd.identify.engine.timing_records import BestTiming
    from mgdd.presets.meant import CylinderLike, PointLike

_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")


def calibration_report(
    traces: Sequence[Any],
    cylinder: CylinderLike,
    *,
    point: PointLike | None = None,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    profiles: bool = True,
    figures: bool = True,
    name: str = "mgdd.report.calibration_report",
    data: str = "Files of the user.",
    progress: Callable[[str], None] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> Report:
    """Check, analyse and calibrate measured traces, find their best timing, and report all of it.

    Parameters
    ----------
    traces, cylinder, point, fuel_heat_j, pegging, pegging_exponent, inlet_pressure_kpa, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`.
    profiles : bool
        Also profile the wall heat and estimate TDC: a third of the time.
    figures : bool
        Draw the figures.
    name : str
        What the page names as its maker.
    data : str
        Where the traces come from, for the page.
    progress : callable, optional
        Called with a short text before each step.

    Returns
    -------
    Report
        For `write_report`. Its summary holds ``traces``, ``laws``, ``common``, ``unidentifiable``, ``warnings`` and
        ``best_timing``.

    Raises
    ------
    mgdd.errors.ConvergenceError, mgdd.errors.DataError, mgdd.errors.ParameterError
        As in `mgdd.identify.best_timing`.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the report over the models that were finished, or None.

    Examples
    --------
    >>> from mgdd import datasets
    >>> from mgdd.report import calibration_report
    >>> traces = datasets.read("hd_diesel_128x144")[2:3]
    >>> report = calibration_report(traces, "hd_diesel_128x144", profiles=False, figures=False)
    >>> print(report.verdict[0][:49])
    pressure_a75_bar: no direction is determined, ran
    """
    step = progress or (lambda _: None)
    cylinder = cylinder_of(cylinder)
    scheme: dict[str, Any] = {"step_cad": step_cad, "integrator": integrator}
    how: dict[str, Any] = {
        "pegging": pegging,
        "pegging_exponent": pegging_exponent,
        "inlet_pressure_kpa": inlet_pressure_kpa,
    }
    absolute = [pegged(trace, cylinder, point_of(point), **how) for trace in listed(traces)]
    inputs: dict[str, Any] = {"point": point, "fuel_heat_j": fuel_heat_j, "progress": step}
    step("analyse the traces")
    analyses = [analyze(trace, cylinder, point=point, quiet=True) for trace in absolute]
    timing, stop = or_partial(lambda: best_timing(absolute, cylinder, **inputs, **scheme))
    main = headline_of(timing)
    fits, scans = [main.fit], dict[str, WallHeatProfile]()
    tdc: TdcEstimate | None = None
    if stop is None:
        try:
            fits = compare_laws(absolute, cylinder, **inputs, **scheme)
            if profiles:
                tdc = estimate_tdc(absolute, cylinder, span_cad=TDC_SPAN_CAD, **inputs)
                scans = _profiles(main, step)
        except KeyboardInterrupt:
            stop = Interrupted("interrupted: the models and their best timing are in .partial, not all checks of them")
    summary = summarize(analyses, fits, main, scans, timing)
    summary["interrupted"] = stop is not None
    summary["warnings"] = doubts_of(timing, tdc)
    if stop is not None:
        done = len(timing[0].members)
        summary["warnings"].insert(
            0, f"interrupted: ranges over {done} finished model(s), and not every check was made"
        )
    summary["engine"] = {name: getattr(cylinder, name) for name in _GEOMETRY}
    summary["data"] = data
    plain = to_jsonable(summary)
    drawn = draw(analyses, main, scans, timing) if figures else {}
    report = Report(
        name=name,
        title="Measured pressure, calibrated cycle model, best timing",
        dataset=law_table(fits),
        figures=drawn,
        summary=Figures(plain),
        sections=sections_of(plain, drawn),
        verdict=tuple(move_of(row) for row in plain["best_timing"]),
    )
    return hand_over(report, stop)


def shipped_report(**options: Any) -> Report:
    """Make the report of the four traces that the package brings; options as of `calibration_report`."""
    preset = presets.load("hd_diesel_128x144")
    shipped = datasets.read("hd_diesel_128x144")
    return calibration_report(shipped, preset.cylinder, point=preset.point, data=_PROVENANCE, **options)


def _profiles(main: Member, progress: Callable[[str], None]) -> dict[str, WallHeatProfile]:
    """Profile the wall heat with the law of the headline: gamma held at its value, and gamma refitted."""
    request = replace(main.fit.request, cylinder=main.fit.model, start_values=starts_of(main.fit))
    gamma = GAMMA_PARAMETER[main.gamma_model]
    burn = tuple(name for name in request.free if name not in (gamma, "wall_heat_scale"))
    tables = {}
    for text, common in (("held", ()), ("refitted", (gamma,))):
        fit = fit_request(replace(request, free=("wall_heat_scale", *common, *burn)))
        value = f" at {main.gamma:.4g}" if text == "held" else ""
        tables[f"{main.law}, {main.gamma_model} gamma {text}{value}"] = wall_heat_profile(fit, progress=progress)
    return tables


_PROVENANCE = (
    "Four cycle-averaged closed-valve pressure traces of a heavy-duty diesel at 25, 50, 75 and 100 % load, from "
    "LibICE-post (F. Ramognino), MIT licence."
)
_ANALYSIS = (
    "n_compression n_expansion ca10_cad ca50_cad ca90_cad heat_net_j heat_gross_j imep_closed_bar p_max_bar p_max_cad"
).split()


def summarize(
    analyses: Sequence[xr.Dataset],
    fits: Sequence[CylinderFit],
    main: Member,
    profiles: Mapping[str, WallHeatProfile],
    timing: Sequence[BestTiming],
) -> dict[str, Any]:
    """Collect the numbers of a calibration as plain values."""
    rows = []
    for analysis, load, best in zip(analyses, main.fit.loads, timing, strict=True):
        rows.append(
            {
                "file": load.file,
                "analysis": {name: float(analysis[name]) for name in _ANALYSIS},
                "calibrated": figures_of(load),
                "best_timing": {name: value for name, value in best.to_dict().items() if name != "members"},
                "warnings": analysis.attrs["warnings"].splitlines(),
            }
        )
    unknown = [] if all(profile.identifiable for profile in profiles.values()) else ["wall_heat_scale"]
    return {
        "rows": [_trace_row(load, best) for load, best in zip(main.fit.loads, timing, strict=True)],
        "mgdd": _core.__version__,
        "law": main.name,
        "headline": {
            "law": main.law,
            "gamma_model": main.gamma_model,
            "gamma": main.gamma,
            "wall_heat_scale": main.wall_heat_scale,
            "fitted": main.fitted,
            "plausible": [not why for why in main.why_not],
        },
        "traces": rows,
        "laws": [law_row(fit) for fit in fits],
        "common": {"wall_heat_scale": {law: profile.to_dict() for law, profile in profiles.items()}},
        "unidentifiable": sorted({*main.fit.report.unidentifiable, *unknown}),
        "best_timing": [row.to_dict() for row in timing],
    }


def _trace_row(load: Load, best: BestTiming) -> dict[str, Any]:
    """Give one trace as a flat row; best timing and gain are ranges over the plausible models, its own p_max kept."""
    (early, late), (least, most) = best.soc_cad, best.gain_percent
    return {
        "trace": load.file,
        "p_max_bar": load.p_max_bar,
        "ca50_cad": load.ca50_cad,
        "rmse_percent": load.rmse_percent,
        "imep_closed_error_percent": load.imep_closed_error_percent,
        "best_soc_from_cad": early,
        "best_soc_to_cad": late,
        "gain_from_percent": least,
        "gain_to_percent": most,
    }


def law_table(fits: Sequence[CylinderFit]) -> xr.Dataset:
    """Tabulate the comparison of burn laws over law and trace."""
    files = [load.file for load in fits[0].loads]
    laws = [fit.kind for fit in fits]

    def grid(name: str) -> list[list[float]]:
        return [[float(getattr(load, name)) for load in fit.loads] for fit in fits]

    dims = ("law", "file")
    scales = [fit.model.wall_heat_scale for fit in fits]
    return labelled_dataset(
        {
            "law": ("law", laws, "-", "burn law and gamma"),
            "file": ("file", files, "-", "trace"),
            "rmse_percent": (dims, grid("rmse_percent")),
            "imep_closed_error_percent": (dims, grid("imep_closed_error_percent")),
            "soc_cad": (dims, grid("soc_cad")),
            "onset_against_soi_cad": (dims, grid("onset_against_soi_cad"), "°CA", "fitted burn start minus SOI"),
            "largest_error_bar": (dims, grid("largest_error_bar"), "bar", "largest local error, model minus measured"),
            "largest_error_cad": (dims, grid("largest_error_cad"), "°CA aTDC", "angle of the largest local error"),
            "wall_heat_scale": ("law", scales),
        }
    )
