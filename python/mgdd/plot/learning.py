"""Error over trials of iterative learning."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.plot.style import LINE_STYLES, finished, new_axes, require

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from mgdd.results.result import Result

__all__ = ["learning"]

_MARKERS = "osv^D"


def learning(learned: xr.Dataset | Result, *, ax: Axes | None = None) -> Axes:
    """Draw how the error of a repeated task falls from trial to trial, one line per learning law.

    Parameters
    ----------
    learned : xarray.Dataset or Result
        ``ca50_error_cad`` [°CA] over ``law`` and ``trial``, as the study seeker-comparison gives.
    ax : matplotlib.axes.Axes, optional
        Where to draw; None makes a figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, logarithmic in the error.

    Raises
    ------
    DataError
        A variable is missing or has no unit.

    Examples
    --------
    >>> from mgdd.plot.learning import learning
    >>> from mgdd.results.labels import labelled_dataset
    >>> learned = labelled_dataset({
    ...     "law": ("law", ["p"], "-", "learning law"), "trial": ("trial", [0, 1, 2], "-", "trial"),
    ...     "ca50_error_cad": (("law", "trial"), [[8.0, 4.0, 2.0]], "°CA", "rms error of CA50"),
    ... })
    >>> learning(learned).get_ylabel()
    'rms error of CA50 [°CA]'
    """
    learned = require("learned", learned, ("law", "trial", "ca50_error_cad"), "the study seeker-comparison")
    ax = new_axes(ax)
    error = learned["ca50_error_cad"].transpose("law", "trial").to_numpy()
    lines: list[Line2D] = []
    for index, law in enumerate(learned["law"].to_numpy()):
        dash, color = LINE_STYLES[index % len(LINE_STYLES)]
        lines += ax.semilogy(
            learned["trial"], error[index], linestyle=dash, color=color, marker=_MARKERS[index % len(_MARKERS)],
            markersize=4, label=str(law),
        )  # fmt: skip
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter("{x:g}")
    ax.grid(alpha=0.3, which="both")
    return finished(ax, learned, "trial", "ca50_error_cad", lines, columns=3, grid=False)
