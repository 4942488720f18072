"""From measured pressure traces to a calibrated cycle model and its best injection timing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import datasets, presets
from mgdd._core.engine import Cylinder, OperatingPoint
from mgdd.engine import analyze
from mgdd.identify import best_timing, fit_cylinder, wall_heat_profile
from mgdd.identify.engine.best_timing import WALL_HEAT_RANGE
from mgdd.identify.engine.burn_laws import LAWS, compare_laws
from mgdd.identify.engine.cylinder import BURN_FIELDS
from mgdd.results.labels import to_jsonable
from mgdd.studies.base import StudyResult
from mgdd.studies.measured_figures import draw
from mgdd.studies.measured_sections import measured_sections
from mgdd.studies.measured_summary import law_table, summarize

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["run_measured_traces"]

_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
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
    fits = compare_laws(traces, cylinder, point=point, progress=progress, **scheme)
    by_law = dict(zip(LAWS, fits, strict=True))
    main, best = by_law["wiebe", "linear"], by_law["double_wiebe", "constant"]
    profiles = {}
    if not quick:
        for fit in (main, best):
            profiles[fit.kind] = wall_heat_profile(traces, fit, point=point, progress=progress, **scheme)
    timing_law = cylinder.replace(burn_shape="wiebe", gamma_model="linear")
    timing = best_timing(traces, timing_law, point=point, progress=progress, **scheme)
    held = timing_law.replace(wall_heat_scale=WALL_HEAT_RANGE[0])
    reference = fit_cylinder(traces, held, free=BURN_FIELDS, point=point, **scheme)
    summary = summarize(analyses, fits, main, profiles, timing)
    summary["engine"] = {name: getattr(cylinder, name) for name in _GEOMETRY}
    summary["data"] = _PROVENANCE if own else "Files of the user."
    plain = to_jsonable(summary)
    drawn = draw(analyses, main, best, reference, profiles, timing) if figures else {}
    return StudyResult(
        name="measured-traces",
        title="Measured pressure, calibrated cycle model, best timing",
        dataset=law_table(fits),
        figures=drawn,
        summary=plain,
        sections=measured_sections(plain, drawn),
    )


_PROVENANCE = (
    "Four cycle-averaged closed-valve pressure traces of a heavy-duty diesel at 25, 50, 75 and 100 % load, from "
    "LibICE-post (F. Ramognino), MIT licence."
)
