"""Figures of the study of guide accuracy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd import plot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["draw"]

_SHOWN = ("wall heat +30 %", "duration -15 %", "adiabatic", "wrong sign")


def draw(dataset: xr.Dataset) -> dict[str, Figure]:
    """Draw the load step with each guide, as feed-forward and as curve, and the error under trouble, by caption."""
    from matplotlib.figure import Figure

    runs = [str(name) for name in dataset["run"].to_numpy()]
    names = ["estimate_median_cad", "estimate_low_cad", "estimate_high_cad"]
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    for ax, form in zip(figure.subplots(1, 2, sharey=True), ("feed-forward", "curve"), strict=True):
        wanted = [f"{form}, {name}" for name in _SHOWN]
        kept = [name for name in ("feed-forward, none", *wanted) if name in runs]
        own = dataset[[*names, "optimum_after_cad"]].sel(run=kept).rename(optimum_after_cad="optimum_cad")
        labels = [name.partition(", ")[2] for name in kept]
        own = own.assign_coords(run=("run", labels, dataset["run"].attrs))
        plot.convergence(own, ax=ax)
        ax.annotate(f"guide as {form}", (0.98, 0.96), xycoords="axes fraction", ha="right", va="top")
        ax.set_xlabel("engine cycle since the load step [-]")
    out = {"Load step from 12 to 30 mg: median of the estimate over the seeds, and the band of 80 % of them": figure}
    if "trouble" in dataset:
        cases = [str(name) for name in dataset["trouble"].to_numpy()]
        figure = Figure(figsize=(11.0, 2.1 * -(-len(cases) // 2)), layout="constrained")
        axes = figure.subplots(-(-len(cases) // 2), 2, sharex=True, sharey=True, squeeze=False)
        cycle = dataset["trouble_cycle"].to_numpy()
        for ax, at in zip(axes.flat, range(len(cases)), strict=False):
            low, middle, high = (dataset[f"error_{end}_cad"][at].to_numpy() for end in ("low", "median", "high"))
            ax.fill_between(cycle, low, high, color="0.8", linewidth=0.0)
            ax.plot(cycle, middle, color="black", linewidth=1.0)
            ax.axhline(0.0, color="0.4", linewidth=0.8)
            ax.set_title(cases[at], loc="left", fontsize="small")
            ax.set(xlim=(0, cycle.size), ylim=(-8.0, 8.0))
            ax.grid(alpha=0.3)
        for ax in axes.flat[len(cases) :]:
            ax.remove()
        for ax in axes.flat[len(cases) - 2 : len(cases)]:
            ax.tick_params(labelbottom=True)
        figure.supylabel("error of the estimate [°CA]", fontsize="medium")
        figure.supxlabel("engine cycle [-]", fontsize="medium")
        out["Unannounced trouble, curve-guided: median error of the estimate and the band of 80 % of the seeds"] = (
            figure
        )
    return out
