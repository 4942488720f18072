"""From measured pressure traces to a calibrated cycle model and its best injection timing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mgdd import datasets, presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine import analyze
from mgdd.errors import Interrupted, hand_over
from mgdd.identify import best_timing, estimate_tdc, wall_heat_profile
from mgdd.identify.engine.best_timing import doubts_of, headline_of
from mgdd.identify.engine.burn_laws import compare_laws
from mgdd.identify.engine.cylinder import fit_request
from mgdd.identify.engine.family import Member
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import starts_of
from mgdd.identify.engine.request import GAMMA_PARAMETER
from mgdd.results.labels import to_jsonable
from mgdd.results.result import Figures
from mgdd.studies.base import StudyResult
from mgdd.studies.measured_figures import draw
from mgdd.studies.measured_sections import measured_sections
from mgdd.studies.measured_summary import law_table, summarize

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.engine.tdc import TdcEstimate
    from mgdd.identify.engine.timing_records import BestTiming

__all__ = ["run_measured_traces"]

_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
_TDC_SPAN_CAD = 2.0
Progress = Callable[[str], None]


def _silent(_: str) -> None:
    """Take no notice of progress."""


def run_measured_traces(
    traces: Sequence[xr.Dataset] | None = None,
    cylinder: Cylinder | None = None,
    *,
    point: OperatingPoint | None = None,
    quick: bool = False,
    figures: bool = True,
    progress: Progress = _silent,
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
    >>> from mgdd.studies import run_study
    >>> result = run_study("measured-traces", quick=True, figures=False)
    >>> [round(row["analysis"]["ca50_cad"], 1) for row in result.summary["traces"]]
    [5.0, 6.9, 9.4, 14.9]
    """
    preset = presets.load("hd_diesel_128x144")
    own = traces is None
    traces = datasets.load("hd_diesel_128x144") if traces is None else list(traces)
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
                tdc = estimate_tdc(traces, cylinder, point=point, span_cad=_TDC_SPAN_CAD, progress=progress)
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
