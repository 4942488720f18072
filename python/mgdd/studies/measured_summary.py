"""Numbers of the measured-traces study as plain values and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd.identify.engine.profile import WallHeatProfile
from mgdd.identify.engine.records import CylinderFit, Load, figures_of
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

    from mgdd.identify.engine.family import Member
    from mgdd.identify.engine.timing_records import BestTiming

__all__ = ["law_row", "law_table", "summarize"]

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
    return {
        "study": "measured-traces",
        "seeds": 0,
        "rows": [_row(load, best) for load, best in zip(main.fit.loads, timing, strict=True)],
        "mgdd": _core.__version__,
        "law": main.name,
        "headline": main_row(main),
        "traces": rows,
        "laws": [law_row(fit) for fit in fits],
        "common": {"wall_heat_scale": {law: profile.to_dict() for law, profile in profiles.items()}},
        "unidentifiable": sorted(
            {*main.fit.report.unidentifiable, *(["wall_heat_scale"] if _unknown(profiles) else [])}
        ),
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


def _row(load: Load, best: BestTiming) -> dict[str, Any]:
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


def law_row(fit: CylinderFit) -> dict[str, Any]:
    """Give one row of the comparison of burn laws: lists over the traces."""
    known = any(math.isfinite(load.soi_cad) for load in fit.loads)
    onset = {"onset_against_soi_cad": [load.onset_against_soi_cad for load in fit.loads]} if known else {}
    return {
        "law": fit.kind,
        **onset,
        "file": [load.file for load in fit.loads],
        "rmse_percent": [load.rmse_percent for load in fit.loads],
        "imep_closed_error_percent": [load.imep_closed_error_percent for load in fit.loads],
        "soc_cad": [load.soc_cad for load in fit.loads],
        "largest_error_bar": [load.largest_error_bar for load in fit.loads],
        "largest_error_cad": [load.largest_error_cad for load in fit.loads],
        "wall_heat_scale": fit.model.wall_heat_scale,
        "warnings": [str(finding) for finding in fit.findings],
    }


def _unknown(profiles: Mapping[str, WallHeatProfile]) -> bool:
    return any(not profile.identifiable for profile in profiles.values())


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
