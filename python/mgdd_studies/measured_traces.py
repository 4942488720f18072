"""From measured pressure traces to a calibrated cycle model and its best injection timing: the four of the package."""

from __future__ import annotations

from mgdd.errors import Interrupted
from mgdd.report import Report
from mgdd.report.calibration import shipped_report
from mgdd.results.result import Figures
from mgdd_studies.base import Progress, StudyResult, silent

__all__ = ["run_measured_traces"]


def run_measured_traces(*, quick: bool = False, figures: bool = True, progress: Progress = silent) -> StudyResult:
    """Run the main job: check, analyse, calibrate, and find the best timing of the four measured traces.

    Parameters
    ----------
    quick : bool
        Leave out the profiles of the wall-heat scale.
    figures : bool
        Draw figures.
    progress : callable
        Called with a short text before each step.

    Returns
    -------
    StudyResult
        That of `mgdd.report.calibration_report`, which takes other traces.

    Raises
    ------
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the study over the models that were finished, or None.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> result = run_study("measured-traces")
    >>> [round(row["analysis"]["ca50_cad"], 1) for row in result.summary["traces"]]
    [5.0, 6.9, 9.4, 14.9]
    """
    try:
        return _study(shipped_report(profiles=not quick, figures=figures, progress=progress))
    except Interrupted as stop:
        if stop.partial is not None:
            stop.partial = _study(stop.partial)
        raise


def _study(report: Report) -> StudyResult:
    return StudyResult(
        name="measured-traces",
        title=report.title,
        dataset=report.dataset,
        figures=report.figures,
        summary=Figures({"study": "measured-traces", "seeds": 0, **report.summary}),
        sections=report.sections,
        verdict=report.verdict,
    )
