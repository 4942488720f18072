"""Results as widgets in a notebook, with the figures of the workbench."""

from __future__ import annotations

from typing import Any

from mgdd.errors import ParameterError
from mgdd.workbench.parts import panel
from mgdd.workbench.pictures import cells, runs, traces


def view(result: Any) -> Any:
    """Show a result with the figures of the workbench: zoom, cursor with values, a choice of what is drawn.

    Parameters
    ----------
    result : Result or xarray.Dataset
        Pressure over crank angle, a record of cycles, a search, a run over time, or a map.

    Returns
    -------
    panel.viewable.Viewable
        The last line of a cell shows it.

    Raises
    ------
    ImportError
        The extra ``workbench`` is not installed.
    mgdd.errors.ParameterError
        A result that has nothing to draw.

    Examples
    --------
    >>> from mgdd.engine import simulate
    >>> from mgdd.workbench import view
    >>> shown = view(simulate("puma_single"))
    >>> [each.label for each in shown.select(lambda each: hasattr(each, "options"))]
    ['shown']
    """
    pn = panel()
    pn.extension()
    data = getattr(result, "dataset", result)
    if not hasattr(data, "data_vars"):
        raise ParameterError(f"result = {type(result).__name__}: must be a result of mgdd or a Dataset")
    drawn = {str(name): draw for name in data.data_vars if (draw := _way(data, str(name))) is not None}
    if not drawn:
        raise ParameterError(f"result = {type(result).__name__}: has nothing over an angle, a time, a cycle or a map")
    which = pn.widgets.Select(label="shown", options=list(drawn), width=300)
    return pn.Column(
        which, pn.bind(lambda name: pn.pane.Bokeh(drawn[name](), sizing_mode="stretch_width"), which),
        sizing_mode="stretch_width",
    )  # fmt: skip


def _way(data: Any, name: str) -> Any:
    """Give what draws a variable, None for one that none of the figures has."""
    variable = data[name]
    dims = tuple(map(str, variable.dims))
    if variable.dtype.kind not in "fiu":
        return None
    if dims in (("crank_angle_cad",), ("cycle", "crank_angle_cad")):
        return lambda: traces({name: data}, name)
    if dims == ("cycle",):
        return lambda: traces({name: data}, name, over="cycle")
    if dims == ("time_s",):
        return lambda: runs(data, [name])
    numbers = all(dim in data and data[dim].dtype.kind in "fiu" for dim in dims)
    return (lambda: cells(variable)) if numbers and 1 <= len(dims) <= 2 else None
