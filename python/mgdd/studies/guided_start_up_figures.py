"""Figures of the study of guided start-up."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd import plot
from mgdd.plot.style import drawn

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the estimates with a feed-forward, and panels of those by a curve, by caption."""
    from matplotlib.figure import Figure

    names = {f"estimate_{end}_cad" for end in ("median", "low", "high")}
    kept = [name for name in ("none", "wall heat +30 %", "duration -15 %", "adiabatic") if name in dataset["guide"]]
    own = dataset[[*sorted(names), "optimum_cad"]].sel(guide=kept)
    out = {
        "Feed-forward: median of the estimate over the seeds, and the band that holds 80 % of them": drawn(
            plot.convergence, own, size=(7.4, 4.2)
        )
    }
    if "case" not in dataset:
        return out
    cases = [str(name) for name in dataset["case"].to_numpy()]
    shown = [at for at, name in enumerate(cases) if any(part in name for part in ("+30 %", "adiabatic", "60", "no mo"))]
    shown = shown[:8]
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    curve = dataset[[f"curve_{name}" for name in sorted(names)]].rename({f"curve_{n}": n for n in sorted(names)})
    for place, (ax, at) in enumerate(zip(figure.subplots(2, 4, sharex=True, sharey=True).flat, shown, strict=False)):
        panel = curve.isel(case=[at], cycle=slice(60)).assign(optimum_cad=dataset["case_optimum_cad"].isel(case=at))
        plot.convergence(panel.drop_vars("case_optimum_cad", errors="ignore"), ax=ax)
        ax.get_legend().remove()
        ax.set_title(cases[at], loc="left", fontsize="small")
        ax.set(xlabel="", ylabel="")
        ax.tick_params(labelbottom=place >= 4)
    figure.supylabel("estimate of the best timing [°CA aTDC]", fontsize="medium")
    figure.supxlabel("engine cycle [-]", fontsize="medium")
    out[
        "The curve: median of the estimate and the band of 80 % of the seeds, from the guide's optimum and from afar"
    ] = figure
    return out
