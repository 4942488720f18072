"""From measured pressure traces to a calibrated cycle model and its best injection timing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import _core, presets
from mgdd._core import Cylinder, OperatingPoint
from mgdd.datasets import load_hd_traces
from mgdd.engine import analyze, optimum, simulate
from mgdd.engine.optimum import check_request
from mgdd.errors import ConvergenceError
from mgdd.identify import CylinderFit, LoadFit, fit_cylinder, wall_heat_profile
from mgdd.identify.cylinder import BURN_FIELDS, SHAPE_FIELDS
from mgdd.results import to_jsonable
from mgdd.studies.base import StudyResult
from mgdd.studies.measured_figures import draw
from mgdd.studies.measured_sections import measured_sections
from mgdd.studies.measured_summary import law_table, summarize

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["best_timing", "compare_laws", "run_measured_traces"]

# Burn shape and gamma law of each row of the comparison; the last two are worth reading on.
LAWS = (
    ("triangle", "constant"),
    ("wiebe", "constant"),
    ("triangle", "linear"),
    ("wiebe", "linear"),
    ("double_wiebe", "constant"),
)
WALL_HEAT_RANGE = (0.5, 1.0)
_GEOMETRY = ("bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "ivc_cad", "evo_cad")
Progress = Callable[[str], None]


def _silent(_: str) -> None:
    """Take no notice of progress."""


def compare_laws(
    traces: Sequence[xr.Dataset],
    cylinder: Cylinder,
    *,
    point: OperatingPoint | None = None,
    laws: Sequence[tuple[str, str]] = LAWS,
    progress: Progress = _silent,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> list[CylinderFit]:
    """Fit every burn law to the same traces.

    Parameters
    ----------
    traces, cylinder, point, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`.
    laws : sequence of (burn_shape, gamma_model)
        Laws to compare.
    progress : callable
        Called with a short text before each fit.

    Returns
    -------
    list of CylinderFit
        In the order of ``laws``.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.studies import compare_laws
    >>> fits = compare_laws(datasets.load_hd_traces(), presets.load("hd_diesel_128x144").cylinder)
    >>> [fit.burn_law for fit in fits][:2]
    ['triangle, gamma 1.37', 'wiebe, gamma 1.37']
    """
    fits = []
    for shape, gamma in laws:
        start = min(cylinder.wall_heat_scale, _core.wall_heat_scale_upper)  # a held scale may lie beyond the search
        law = cylinder.replace(burn_shape=shape, gamma_model=gamma, wall_heat_scale=start)
        progress(f"calibrate {shape}, {gamma} gamma")
        fits.append(fit_cylinder(traces, law, point=point, step_cad=step_cad, integrator=integrator))
    return fits


def best_timing(
    traces: Sequence[xr.Dataset],
    cylinder: Cylinder,
    *,
    point: OperatingPoint | None = None,
    scales: Sequence[float] = WALL_HEAT_RANGE,
    objective: str = "imep_closed_bar",
    limits: dict[str, float] | None = None,
    bounds_cad: tuple[float, float] | None = None,
    progress: Progress = _silent,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> list[dict[str, Any]]:
    """Give each load's best timing and gain as a range over the wall-heat scale, the rest refitted at each.

    The traces do not determine the wall heat, so a single best timing would be false precision.

    Parameters
    ----------
    traces, cylinder, point, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`; the cylinder's burn shape and gamma law are used.
    scales : sequence of float
        Wall-heat scales to refit at [-].
    objective : str
        As in `mgdd.engine.optimum`. Closed-cycle work is the default because a closed-valve trace carries no more.
    limits : dict, optional
        Further limits, as in `mgdd.engine.optimum`; they hold beside the trace's own p_max.
    bounds_cad : tuple of float, optional
        Searched range of SOC, as in `mgdd.engine.optimum`.
    progress : callable
        Called with a short text before each fit.

    Returns
    -------
    list of dict
        Per trace: ``file``, ``p_max_limit_bar`` (the trace's own highest sample, or the model's where that is higher at
        the measured timing), ``points`` (one per scale) and the ranges ``soc_cad``, ``ca50_cad``, ``gain_percent``
        under that limit and ``free_soc_cad``, ``free_ca50_cad``, ``free_gain_percent`` without. A gain is the
        objective's relative rise over the fitted timing [%].

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.studies import best_timing
    >>> rows = best_timing(datasets.load_hd_traces()[:1], presets.load("hd_diesel_128x144").cylinder)
    >>> [round(soc) for soc in rows[0]["free_soc_cad"]]
    [-6, -4]
    """
    limits = limits or {}
    check_request(objective, limits)
    search: dict[str, Any] = {"bounds_cad": bounds_cad, "step_cad": step_cad, "integrator": integrator}
    names = BURN_FIELDS + (SHAPE_FIELDS if cylinder.burn_shape == "double_wiebe" else ())
    points: list[list[dict[str, float]]] = [[] for _ in traces]
    for scale in scales:
        progress(f"best timing at wall-heat scale {scale:g}")
        held = cylinder.replace(wall_heat_scale=scale)
        fit = fit_cylinder(traces, held, free=names, point=point, step_cad=step_cad, integrator=integrator)
        if not math.isfinite(fit.report.rmse):
            raise ConvergenceError(f"no calibration at wall-heat scale {scale:g}: {fit.report.message}")
        for own, load in zip(points, fit.loads, strict=True):
            own.append({**_timing(load, scale, objective, limits, search), "converged": fit.report.success})
    return [_as_range(load.file, own) for load, own in zip(fit.loads, points, strict=True)]


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
    >>> from mgdd.studies import run_measured_traces
    >>> result = run_measured_traces(quick=True, figures=False)
    >>> [round(row["analysis"]["ca50_cad"], 1) for row in result.summary["traces"]]
    [5.0, 6.9, 9.4, 14.9]
    """
    preset = presets.load("hd_diesel_128x144")
    own = traces is None
    traces = load_hd_traces() if traces is None else list(traces)
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
            profiles[fit.burn_law] = wall_heat_profile(traces, fit, point=point, progress=progress, **scheme)
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


def _timing(
    load: LoadFit, scale: float, objective: str, limits: dict[str, float], search: dict[str, Any]
) -> dict[str, float]:
    scheme = {"step_cad": search["step_cad"], "integrator": search["integrator"]}
    now = simulate(load.cylinder, load.point, soc_cad=load.soc_cad, **scheme)
    # The model's own error in p_max at the measured timing is no violation of the limit.
    ceiling = max(load.p_max_bar, float(now["p_max_bar"]) * (1.0 + 1e-9))
    own = {**limits, "p_max_bar": min(ceiling, limits.get("p_max_bar", math.inf))}
    free = optimum(load.cylinder, load.point, objective, limits=limits, **search)
    kept = optimum(load.cylinder, load.point, objective, limits=own, **search)
    base = float(now[objective])
    return {
        "wall_heat_scale": scale,
        "fitted_soc_cad": load.soc_cad,
        "p_max_limit_bar": ceiling,
        "soc_cad": kept.soc_cad,
        "ca50_cad": kept.ca50_cad,
        "gain_percent": 100.0 * (kept.value / base - 1.0),
        "free_soc_cad": free.soc_cad,
        "free_ca50_cad": free.ca50_cad,
        "free_gain_percent": 100.0 * (free.value / base - 1.0),
        "free_p_max_bar": float(simulate(load.cylinder, load.point, soc_cad=free.soc_cad, **scheme)["p_max_bar"]),
        "at_bound": free.at_bound or kept.at_bound,
        "p_max_model_error_bar": float(now["p_max_bar"]) - load.p_max_bar,
        "efficiency_gross": float(now["efficiency_gross"]),
        "curvature_per_cad2": free.curvature_per_cad2,
    }


def _as_range(file: str, points: list[dict[str, float]]) -> dict[str, Any]:
    def span(name: str) -> list[float]:
        values = [p[name] for p in points]
        return [min(values), max(values)]

    ranged = "soc_cad ca50_cad gain_percent free_soc_cad free_ca50_cad free_gain_percent fitted_soc_cad".split()
    return {
        "file": file,
        "wall_heat_scale": span("wall_heat_scale"),
        "p_max_limit_bar": max(p["p_max_limit_bar"] for p in points),
        **{name: span(name) for name in ranged},
        "points": points,
    }
