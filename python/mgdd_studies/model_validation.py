"""How near the cycle model comes to measured traces, and what that leaves open of the best timing and its curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mgdd import datasets, presets
from mgdd.identify import best_timing
from mgdd.identify.engine.records import CylinderFit
from mgdd.plot.style import BLACK, BLUE, GREEN, GREY, ORANGE, axis_label, new_figure
from mgdd.results.labels import ANGLE, labelled_dataset
from mgdd_studies.base import Parts, Progress, StudyResult, check_seeds
from mgdd_studies.figures import names_of
from mgdd_studies.statistics import sd_of, with_interval
from mgdd_studies.validation_fits import (
    LAWS,
    STAGES,
    Burn,
    Draw,
    Law,
    Meeting,
    best_slopes,
    burns_of,
    meet,
    redraw,
    stated_sd,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["run_model_validation", "stage_rows", "validate_law"]

BLOCK_CAD = 30.0  # the residuals of every law have lost their correlation over this angle
SHOWN = "Wiebe, linear gamma"  # of the figure of pressures
_QUICK_DRAWS, _Z = 8, 1.959964
_ENGINE: Final = "hd_diesel_128x144"


@dataclass(frozen=True, kw_only=True)
class Validated:
    """One law: its calibration, its models and how they meet the traces by stage, and draws by kind of error."""

    law: Law
    fit: CylinderFit
    burns: dict[str, list[Burn]]
    met: dict[str, list[Meeting]]
    white: list[Draw]
    block: list[Draw]

    @property
    def best(self) -> NDArray[np.float64]:
        """Best CA50 of the calibrated loads [°CA aTDC]."""
        return np.array([burn.best[0] for burn in self.burns["calibrated"]])

    @property
    def curvature(self) -> NDArray[np.float64]:
        """Curvature of J over J at the best timing of the calibrated loads [%/°CA²]."""
        return np.array([burn.best[1] for burn in self.burns["calibrated"]])


def run_model_validation(
    *, n_seeds: int = 200, quick: bool = False, figures: bool = True, progress: Progress | None = None
) -> StudyResult:
    """Set four burn laws beside four measured traces before and after calibration, and draw what the fits leave open.

    Stages, see `mgdd_studies.validation_fits.burns_of`: a load foretold from the other three, with nothing of its own
    but the net heat and the injection; the burn angles and the net heat of the trace itself; the calibration. The
    best timing of each is judged by what it loses on the first law's calibrated model, which meets the traces best.
    Then each calibration is repeated on its own model's pressure, disturbed by its residual times random factors that
    are correlated over 30 °CA, and by white noise: how far best timing and curvature scatter, and how often the stated
    95 % intervals hold the truth of the draw. The range over a family of plausible models stands beside it.

    Parameters
    ----------
    n_seeds : int
        Draws per law and kind of error.
    quick : bool
        At most eight draws, and no family.
    figures, progress
        As in `mgdd_studies.run_study`, and so are the errors.

    Returns
    -------
    StudyResult
        Rows per law, stage and trace: pressure RMSE [% of p_max], closed IMEP error [%], best CA50 [°CA aTDC],
        curvature over J [%/°CA²] and what the best timing loses [% of J]. ``summary["spread"]``: scatter of best
        timing and curvature. ``summary["coverage"]``: of the stated intervals.

    References
    ----------
    Shao (2010), the dependent wild bootstrap.

    Examples
    --------
    >>> from mgdd_studies import run_study
    >>> rows = run_study("model-validation", n_seeds=6, quick=True).summary["rows"]
    >>> own = [row for row in rows if row["law"] == "double Wiebe, linear gamma"]
    >>> [round(row["rmse_percent"], 1) for row in own if row["stage"] == "calibrated"]
    [0.1, 0.1, 0.1, 0.2]
    """
    draws = check_seeds(n_seeds, quick=quick, most=_QUICK_DRAWS)
    work = Parts(progress)
    traces, cylinder = datasets.read(_ENGINE), presets.load(_ENGINE).cylinder
    done = work((law.name, partial(validate_law, law, traces, cylinder, draws)) for law in LAWS)
    families = [] if quick else work([("family of models", partial(best_timing, traces, cylinder))])
    family = [row.free_ca50_cad for rows in families for row in rows]
    return work.finish(
        "model-validation", _dataset(done, family), _draw if figures else None,
        seeds=draws,
        rows=[row for own in done for row in stage_rows(own, done[0])],
        spread=[row for own in done for row in _spread(own, family)],
        coverage=[_coverage(own) for own in done],
    )  # fmt: skip


def validate_law(law: Law, traces: list[xr.Dataset], cylinder: Any, draws: int) -> Validated:
    """Calibrate a law, set its stages beside the traces, and redraw."""
    fit = law.fit(traces, cylinder)
    burns = burns_of(law, fit, traces, cylinder)
    slopes = best_slopes(fit)
    drawn = {
        block: [redraw(fit, np.random.default_rng([at, seed]), block_cad=block, slopes=slopes) for seed in range(draws)]
        for at, block in enumerate((None, BLOCK_CAD))
    }
    return Validated(
        law=law,
        fit=fit,
        burns=burns,
        met={
            stage: [meet(burn, load) for burn, load in zip(own, fit.loads, strict=True)] for stage, own in burns.items()
        },
        white=drawn[None],
        block=drawn[BLOCK_CAD],
    )


def stage_rows(own: Validated, reference: Validated) -> list[dict[str, Any]]:
    """Give a row per stage and trace; the reference says what a best timing loses."""
    return [
        {
            "law": own.law.name,
            "stage": stage,
            "file": load.file,
            "rmse_percent": met.rmse_percent,
            "imep_closed_error_percent": met.imep_closed_error_percent,
            "largest_error_bar": met.largest_error_bar,
            "best_ca50_cad": burn.best[0],
            "best_ca50_error_cad": burn.best[0] - truth.best[0],
            "lost_percent": truth.lost_percent(burn.best[0]),
            "curvature_percent_per_cad2": burn.best[1],
            "curvature_ratio": burn.best[1] / truth.best[1],
        }
        for stage in STAGES
        for burn, met, truth, load in zip(
            own.burns[stage], own.met[stage], reference.burns["calibrated"], own.fit.loads, strict=True
        )
    ]


def _spread(own: Validated, family: list[tuple[float, float]]) -> list[dict[str, Any]]:
    best = np.array([drawn.best_ca50_cad for drawn in own.block])
    bend = np.array([drawn.curvature_percent for drawn in own.block])
    away, stated = best - own.best, stated_sd(own.fit, best_slopes(own.fit))
    lost = -0.5 * own.curvature * away**2
    return [
        {
            "law": own.law.name,
            "file": load.file,
            "best_ca50_cad": own.best[at],
            "stated_sd_cad": float(stated[at]),
            **_sd_interval("redrawn_sd_cad", best[:, at]),
            **with_interval("redrawn_bias_cad", away[:, at]),
            "family_low_cad": family[at][0] if family else None,
            "family_high_cad": family[at][1] if family else None,
            "lost_p95_percent": float(np.quantile(lost[:, at], 0.95)),
            "curvature_percent_per_cad2": own.curvature[at],
            "curvature_relative_sd_percent": 100.0 * (sd_of(bend[:, at]) / abs(own.curvature[at])),
        }
        for at, load in enumerate(own.fit.loads)
    ]


def _sd_interval(name: str, values: NDArray[np.float64]) -> dict[str, float | None]:
    """Name a standard deviation and its 95 % interval, by chi square."""
    from scipy.special import chdtri

    freedom = values.size - 1
    if freedom < 1:
        return {name: None, f"{name}_low": None, f"{name}_high": None}
    sd = float(values.std(ddof=1))
    low, high = (sd * math.sqrt(freedom / float(chdtri(freedom, share))) for share in (0.025, 0.975))
    return {name: sd, f"{name}_low": low, f"{name}_high": high}


def _coverage(own: Validated) -> dict[str, Any]:
    """Give how often stated intervals hold the truth, over parameters that are not at a bound."""
    row: dict[str, Any] = {"law": own.law.name, "wall_heat_scale": own.fit.model.wall_heat_scale}
    truth, known = own.fit.report.values, np.isfinite(own.fit.report.stderr)
    row["parameters"] = int(known.sum())
    row["held_at_a_bound"] = int((own.fit.report.bounds_active != 0).sum())
    for kind, drawn in (("white", own.white), ("block", own.block)):
        held = [np.mean(np.abs(one.values - truth)[known] <= _Z * one.stderr[known]) for one in drawn]
        best = [np.mean(np.abs(one.best_ca50_cad - own.best) <= _Z * one.stated_sd_cad) for one in drawn]
        row |= with_interval(f"{kind}_parameters_share", np.array(held))
        row |= with_interval(f"{kind}_best_share", np.array(best))
    return row


def _dataset(done: list[Validated], family: list[tuple[float, float]]) -> xr.Dataset:
    loads = done[0].fit.loads
    over, drawn = ("law", "stage", "file"), ("law", "file", "draw")
    ends = np.array(family) if family else np.full((len(loads), 2), np.nan)
    shown = next((own for own in done if own.law.name == SHOWN), done[-1])

    def table(value: Any) -> list[Any]:
        return [[[value(own, stage, at) for at in range(len(loads))] for stage in STAGES] for own in done]

    variables: dict[str, tuple[Any, ...]] = {
        "law": ("law", [own.law.name for own in done], "-", "model"),
        "stage": ("stage", list(STAGES), "-", "what is known of the trace"),
        "file": ("file", [load.file for load in loads], "-", "trace"),
        "draw": ("draw", np.arange(len(done[0].block)), "-", "draw"),
        ANGLE: (ANGLE, shown.met[STAGES[0]][0].angle_cad),
        "rmse_percent": (over, table(lambda own, stage, at: own.met[stage][at].rmse_percent)),
        "imep_closed_error_percent": (over, table(lambda own, stage, at: own.met[stage][at].imep_closed_error_percent)),
        "best_ca50_cad": (over, table(lambda own, stage, at: own.burns[stage][at].best[0]), "°CA aTDC", "best CA50"),
        "curvature_percent": (
            over, table(lambda own, stage, at: own.burns[stage][at].best[1]), "%/°CA²", "curvature of the objective",
        ),
        "redrawn_ca50_cad": (
            drawn, [np.array([one.best_ca50_cad for one in own.block]).T for own in done], "°CA aTDC",
            "best CA50 of a calibration to redrawn residuals",
        ),
        "stated_sd_cad": (
            drawn, [np.array([one.stated_sd_cad for one in own.block]).T for own in done], "°CA",
            "stated standard deviation of the best CA50",
        ),
        "family_low_cad": ("file", ends[:, 0], "°CA aTDC", "least best CA50 of a family of plausible models"),
        "family_high_cad": ("file", ends[:, 1], "°CA aTDC", "largest best CA50 of a family of plausible models"),
        "measured_bar": (("file", ANGLE), [met.measured_bar for met in shown.met["calibrated"]]),
        "stage_bar": (
            ("stage", "file", ANGLE), [[met.model_bar for met in shown.met[stage]] for stage in STAGES], "bar",
            "model pressure",
        ),
    }  # fmt: skip
    return labelled_dataset(variables, attrs={"shown": shown.law.name})


_LOOKS = {"other loads": ("--", BLUE), "heat release": (":", GREEN), "calibrated": ("-", ORANGE)}
_MARKERS = "osD^"
_COLORS = (BLACK, BLUE, ORANGE, GREEN)
_SPAN_CAD = (-40.0, 80.0)


def _draw(dataset: xr.Dataset) -> dict[str, Figure]:
    law = str(dataset.attrs["shown"])
    return {
        f"Measured pressure and the model ({law}) before and after its calibration": _pressures(dataset),
        "Best CA50 of each calibrated model: 95 % of calibrations to redrawn residuals, the stated 95 % interval "
        "(short bars), and the range over a family of plausible models (grey)": _draw_best(dataset),
    }


def _pressures(dataset: xr.Dataset) -> Figure:
    figure = new_figure(9.0, 6.6)
    files = names_of(dataset, "file")
    angle = dataset[ANGLE].to_numpy()
    axes = figure.subplots(4, 2, sharex=True, height_ratios=(3.0, 1.2, 3.0, 1.2))
    for at, file in enumerate(files[:4]):
        ax, below = axes[2 * (at // 2), at % 2], axes[2 * (at // 2) + 1, at % 2]
        measured = dataset["measured_bar"][at].to_numpy()
        ax.plot(angle, measured, ".", color=BLACK, markersize=2.5, label="measured")
        for stage, (dash, color) in _LOOKS.items():
            model = dataset["stage_bar"].sel(stage=stage)[at].to_numpy()
            ax.plot(angle, model, dash, color=color, linewidth=1.1, label=stage)
            below.plot(angle, model - measured, dash, color=color, linewidth=1.0)
        below.axhline(0.0, color=GREY, linewidth=0.8)
        ax.set_title(file, loc="left", fontsize="small")
        ax.set_xlim(*_SPAN_CAD)
        for panel in (ax, below):
            panel.grid(alpha=0.3)
        if at % 2 == 0:
            ax.set_ylabel("pressure [bar]")
            below.set_ylabel("model −\nmeasured\n[bar]")
    axes[0, 0].legend(fontsize="small")
    for ax in axes[-1]:
        ax.set_xlabel(axis_label(dataset, ANGLE))
    return figure


def _draw_best(dataset: xr.Dataset) -> Figure:
    figure = new_figure(7.4, 4.2)
    ax = figure.subplots()
    files, laws = names_of(dataset, "file"), names_of(dataset, "law")
    best = dataset["best_ca50_cad"].sel(stage="calibrated").to_numpy()
    redrawn, stated = dataset["redrawn_ca50_cad"].to_numpy(), dataset["stated_sd_cad"].to_numpy()
    for at in range(len(files)):
        low, high = float(dataset["family_low_cad"][at]), float(dataset["family_high_cad"][at])
        ax.fill_between([at - 0.42, at + 0.42], low, high, color=GREY, alpha=0.2, linewidth=0.0)
        for k, law in enumerate(laws):
            x = at + 0.18 * (k - 0.5 * (len(laws) - 1))
            color, marker = _COLORS[k % len(_COLORS)], _MARKERS[k % len(_MARKERS)]
            ends = np.quantile(redrawn[k, at], [0.025, 0.975])
            ax.plot([x, x], ends, color=color, linewidth=1.2)
            half = 1.96 * float(np.median(stated[k, at]))
            ax.plot([x + 0.05] * 2, [best[k, at] - half, best[k, at] + half], color=color, linewidth=3.0, alpha=0.6)
            ax.plot(x, best[k, at], marker, color=color, markersize=5, label=law if at == 0 else None)
    ax.set_xticks(range(len(files)), files, fontsize="small")
    ax.set_ylabel("best CA50 [°CA aTDC]")
    ax.grid(alpha=0.3, axis="y")
    ax.legend(fontsize="small", frameon=False, ncols=2)
    return figure
