"""Sliders over a cycle or a calibration map, in a notebook."""

from __future__ import annotations

import html
import io
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.engine import simulate
from mgdd.io.extras import import_extra
from mgdd.maps import CalibrationMap
from mgdd.plot import map_cells, pressure
from mgdd.plot.style import ORANGE, drawn
from mgdd.presets.meant import engine_of
from mgdd.results.labels import Label, label_of, named_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mgdd.presets.meant import CylinderLike, PointLike

_SHOWN = ("imep_gross_bar", "ca50_cad", "p_max_bar")
_SIZE = (6.6, 4.4)


def explore(what: CylinderLike | CalibrationMap, point: PointLike | None = None) -> Any:
    """Show sliders in a notebook: over a cycle of an engine, or over the axes of a calibration map.

    Parameters
    ----------
    what : Cylinder, Preset, str, path-like or CalibrationMap
        An engine, as of `mgdd.engine.simulate`: ``soc_cad``, ``fuel_mg`` and ``speed_rpm`` move the pressure trace, and
        gross IMEP, CA50 and maximum pressure are written below. Or a map: its axes move the place on it, and what its
        ``lookup`` gives is written below.
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        Where the sliders of an engine begin, with the intake state, as of `mgdd.engine.simulate`.

    Returns
    -------
    ipywidgets.VBox
        Sliders, picture and text, in this order; as the last line of a cell it is shown.

    Raises
    ------
    ImportError
        ipywidgets is not installed: ``pip install "mgdd[interactive]"``.
    mgdd.errors.Error, TypeError
        Neither an engine nor a map.

    Examples
    --------
    >>> from mgdd.report import explore
    >>> sliders, picture, text = explore("puma_single").children
    >>> sliders.children[0].value = -10.0  # as a hand does it
    """
    if isinstance(what, CalibrationMap):
        ends = {name: (own[0], own[-1], 0.5 * (own[0] + own[-1])) for name, own in what.axes.items()}
        return _panel(ends, what.labels, lambda at: _place(what, at))
    cylinder, start = engine_of(what, point, argument="what")
    ends = {"soc_cad": (-40.0, 20.0, -6.0), "fuel_mg": (0.0, 2.0 * start.fuel_mg or 50.0, start.fuel_mg)}
    ends["speed_rpm"] = (0.25 * start.speed_rpm, 2.0 * start.speed_rpm, start.speed_rpm)

    def draw(at: Mapping[str, Any]) -> tuple[Figure, str]:
        cycle = simulate(cylinder, start, **at)
        numbers = {label_of(cycle[name]): float(cycle[name]) for name in _SHOWN}
        return drawn(pressure, cycle, size=_SIZE), "\n".join(map(_said, numbers, numbers.values()))

    return _panel(ends, {name: named_label(name) for name in ends}, draw)


def _place(known: CalibrationMap, at: Mapping[str, float]) -> tuple[Figure, str]:
    """Draw a map with a cross at a place, and read it there."""
    figure = drawn(map_cells, known, size=_SIZE)
    value = float(known(at))
    cells = [np.interp(at[name], own, range(own.size)) for name, own in known.axes.items()]  # as `map_cells` draws them
    x, y = cells if len(cells) == 2 else (*at.values(), value)
    figure.axes[0].plot(x, y, "+", color=ORANGE, markersize=18, markeredgewidth=3)
    return figure, _said(known.labels[known.name], value)


def _said(label: Label, value: float) -> str:
    return f"{label.long_name}: {value:.4g} {label.units}"


def _panel(
    ends: Mapping[str, tuple[float, float, float]],
    labels: Mapping[str, Label],
    draw: Callable[[Mapping[str, float]], tuple[Figure, str]],
) -> Any:
    """Put sliders from, to and at, a picture and a text below each other; a slider that moves draws both anew."""
    widgets = import_extra("ipywidgets", "interactive", "explore")
    wide = {"style": {"description_width": "16em"}, "layout": {"width": "40em"}}
    sliders = {
        name: widgets.FloatSlider(
            description=f"{labels[name].long_name} [{labels[name].units}]", min=low, max=high, value=value,
            step=(high - low) / 100.0, **wide,
        )
        for name, (low, high, value) in ends.items()
    }  # fmt: skip
    picture, text = widgets.Image(format="png"), widgets.HTML()

    def redraw(_: Any = None) -> None:
        figure, said = draw({name: slider.value for name, slider in sliders.items()})
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
        picture.value, text.value = buffer.getvalue(), html.escape(said).replace("\n", "<br>")

    for slider in sliders.values():
        slider.observe(redraw, names="value")
    redraw()
    return widgets.VBox([widgets.VBox(list(sliders.values())), picture, text])
