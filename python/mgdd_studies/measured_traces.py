"""From measured pressure traces to a calibrated cycle model and its best injection timing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mgdd import __version__, datasets, presets
from mgdd.engine import Cylinder, OperatingPoint, analyze
from mgdd.errors import Interrupted
from mgdd.identify import best_timing, estimate_tdc, wall_heat_profile
from mgdd.identify.engine.best_timing import doubts_of, headline_of
from mgdd.identify.engine.burn_laws import compare_laws, law_row
from mgdd.identify.engine.calibration import TDC_SPAN_CAD
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.family import Member
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import CylinderFit, Load, figures_of, starts_of
from mgdd.identify.engine.request import GAMMA_PARAMETER
from mgdd.parallel.finished import hand_over
from mgdd.results.labels import labelled_dataset, to_jsonable
from mgdd.results.result import Figures
from mgdd_studies.base import Progress, StudyResult, silent
from mgdd_studies.measured_page import draw, measured_sections

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.engine.family import Member
    from mgdd.identify.engine.tdc import TdcEstimate
    from mgdd.identify.engine.timing_records import BestTiming

__all__ = ["run_measured_traces"]

_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")


def run_measured_traces(
    traces: Sequence[xr.Dataset] | None = None,
    cylinder: Cylinder | None = None,
    *,
    point: OperatingPoint | None = None,
    quick: bool = False,
    figures: bool = True,
    progress: Progress = silent,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> StudyResult:
    """Run the main job: check, analyse, calibrate, and find the best timing of measured traces.

    Parameters
    ----------
    traces : sequence of xarray.Dataset, optional
        Measured traces; the four heavy-duty diesel traces of the package if left out.
    cylinder : Cylinder, optional
        The preset ``hd_diesel_128x144`` if left out.
    point : OperatingPoint, optional
        Conditions that a trace does not carry; the preset's if left out.
    quick : bool
        Leave out the profiles of the wall-heat scale.
    figures : bool
        Draw figures.
    progress : callable
        Called with a short text before each step.
    step_cad, integrator
        As in `mgdd.identify.fit_cylinder`.

    Returns
    -------
    StudyResult
        Its summary holds ``traces``, ``laws``, ``common``, ``unidentifiable``, ``warnings`` and ``best_timing``.

    Raises
    ------
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the study over the models that were finished, or None.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> result = run_study("measured-traces", quick=True, figures=False)
    >>> [round(row["analysis"]["ca50_cad"], 1) for row in result.summary["traces"]]
    [5.0, 6.9, 9.4, 14.9]
    """
    preset = presets.load("hd_diesel_128x144")
    own = traces is None
    traces = datasets.read("hd_diesel_128x144") if traces is None else list(traces)
    cylinder = cylinder or preset.cylinder
    point = point or preset.point
    progress("analyse the traces")
    analyses = [analyze(trace, cylinder, point=point, quiet=True) for trace in traces]
    scheme: dict[str, Any] = {"step_cad": step_cad, "integrator": integrator}
    timing, stop = _timing(traces, cylinder, point=point, progress=progress, **scheme)
    main = headline_of(timing)
    fits, profiles = [main.fit], dict[str, WallHeatProfile]()
    tdc: TdcEstimate | None = None
    if stop is None:
        try:
            fits = compare_laws(traces, cylinder, point=point, progress=progress, **scheme)
            if not quick:
                tdc = estimate_tdc(traces, cylinder, point=point, span_cad=TDC_SPAN_CAD, progress=progress)
                profiles = _profiles(main, progress)
        except KeyboardInterrupt:
            stop = Interrupted("interrupted: the models and their best timing are in .partial, not all checks of them")
    summary = summarize(analyses, fits, main, profiles, timing)
    summary["interrupted"] = stop is not None
    summary["warnings"] = doubts_of(timing, tdc)
    if stop is not None:
        done = len(timing[0].members)
        summary["warnings"].insert(
            0, f"interrupted: ranges over {done} finished model(s), and not every check was made"
        )
    summary["engine"] = {name: getattr(cylinder, name) for name in _GEOMETRY}
    summary["data"] = _PROVENANCE if own else "Files of the user."
    plain = to_jsonable(summary)
    drawn = draw(analyses, main, profiles, timing) if figures else {}
    result = StudyResult(
        name="measured-traces",
        title="Measured pressure, calibrated cycle model, best timing",
        dataset=law_table(fits),
        figures=drawn,
        summary=Figures(plain),
        sections=measured_sections(plain, drawn),
    )
    return hand_over(result, stop)


def _timing(*traces: Any, **options: Any) -> tuple[list[BestTiming], Interrupted | None]:
    """Find the best timing by all models, or by those that were finished before Ctrl-C."""
    try:
        return best_timing(*traces, **options), None
    except Interrupted as stop:
        if stop.partial is None:
            raise
        return stop.partial, stop


def _profiles(main: Member, progress: Progress) -> dict[str, WallHeatProfile]:
    """Profile the wall heat with the law of the headline: gamma held at its value, and gamma refitted."""
    request = replace(main.fit.request, cylinder=main.fit.model, start_values=starts_of(main.fit))
    gamma = GAMMA_PARAMETER[main.gamma_model]
    burn = tuple(name for name in request.free if name not in (gamma, "wall_heat_scale"))
    out = {}
    for text, common in (("held", ()), ("refitted", (gamma,))):
        fit = fit_request(replace(request, free=("wall_heat_scale", *common, *burn)))
        value = f" at {main.gamma:.4g}" if text == "held" else ""
        out[f"{main.law}, {main.gamma_model} gamma {text}{value}"] = wall_heat_profile(fit, progress=progress)
    return out


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
        "study": "measured-traces",
        "seeds": 0,
        "rows": [_trace_row(load, best) for load, best in zip(main.fit.loads, timing, strict=True)],
        "mgdd": __version__,
        "law": main.name,
        "headline": main_row(main),
        "traces": rows,
        "laws": [law_row(fit) for fit in fits],
        "common": {"wall_heat_scale": {law: profile.to_dict() for law, profile in profiles.items()}},
        "unidentifiable": sorted({*main.fit.report.unidentifiable, *unknown}),
        "best_timing": [row.to_dict() for row in timing],
    }


def main_row(main: Member) -> dict[str, Any]:
    """Give the headline member as plain values."""
    return {
        "law": main.law,
        "gamma_model": main.gamma_model,
        "gamma": main.gamma,
        "wall_heat_scale": main.wall_heat_scale,
        "fitted": main.fitted,
        "plausible": [not why for why in main.why_not],
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
