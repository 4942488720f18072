"""Figures by Plotly: what matplotlib draws, at the same places and with the same units, or a refusal."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mgdd.engine import simulate
from mgdd.errors import DataError, ParameterError
from mgdd.loop import VirtualEngine, run_seeker
from mgdd.maps import CalibrationMap
from mgdd.optimize import ExtremumSeeking
from mgdd.plot import pressure
from mgdd.results.interactive import as_plotly, plotly_script

pytest.importorskip("plotly")


def converted(draw: Callable[[Axes], Any]) -> Any:
    figure = Figure()
    draw(figure.add_subplot())
    return as_plotly(figure)


def drawn(figure: Any) -> list[Any]:
    """Traces on the axes; those of legends stand on the pair below."""
    return [trace for trace in figure.data if trace.xaxis == "x2"]


def texts(figure: Any) -> set[str]:
    return {note.text for note in figure.layout.annotations}


def test_a_result_draws_itself_by_plotly() -> None:
    seeker = ExtremumSeeking(start=-2.0, lower=-30.0, upper=10.0)
    run = run_seeker(VirtualEngine(seed=1), seeker, 100)
    figure = run.plot(engine="plotly")
    assert any(np.array_equal(trace.y, run.dataset["estimate"][:, 0], equal_nan=True) for trace in drawn(figure))
    for wrong in ({"engine": "bokeh"}, {"engine": "plotly", "ax": Figure().add_subplot()}):
        with pytest.raises(ParameterError, match="must be 'matplotlib', or 'plotly' without ax"):
            run.plot(**wrong)


def test_a_twin_lies_over_its_host_and_both_name_their_units() -> None:
    figure = Figure()
    pressure(simulate("puma_single"), ax=figure.add_subplot())
    own = as_plotly(figure)
    assert (own.layout.yaxis3.overlaying, own.layout.yaxis3.side, own.layout.xaxis3.matches) == ("y2", "right", "x2")
    assert {"crank angle [°CA aTDC]", "cylinder pressure [bar]", "cylinder pressure"} <= texts(own)
    assert "cylinder pressure [bar]: %{y:.5g}" in own.data[0].hovertemplate
    log = Figure()
    pressure(simulate("puma_single"), log_pv=True, ax=(ax := log.add_subplot()))
    layout = as_plotly(log).layout
    assert (layout.xaxis2.type, layout.yaxis2.type) == ("log", "log")
    assert layout.xaxis2.range == pytest.approx(np.log10(ax.get_xlim()))


def test_cells_keep_values_colours_breakpoints_and_colour_bar() -> None:
    axes = {"speed_rpm": [900, 1500, 2100], "fuel_mg": [6, 20]}
    source = [["given", "held"], ["given", "infeasible"], ["given", "given"]]
    cells = {"source": source, "active_limit": [["", "p_max_bar"], ["", ""], ["", ""]]}
    made = CalibrationMap(axes, [[-1, -4], [-2, np.nan], [-5, -9]], name="soc_cad", cells=cells)
    figure = made.plot(engine="plotly")
    table = next(own for own in drawn(figure) if own.type == "heatmap")
    assert np.array_equal(table.z, made.values.T, equal_nan=True)
    assert (table.zmin, table.zmax, len(table.colorscale)) == (-9.0, -1.0, 65)
    assert "start of combustion [°CA aTDC]: %{z:.5g}" in table.hovertemplate
    assert figure.layout.xaxis2.ticktext == ("900", "1500", "2100")
    assert {"−1", "−4 h", " ×", "held by p_max_bar", "start of combustion [°CA aTDC]"} <= texts(figure)
    assert next(own for own in figure.data if own.type == "scatter" and own.mode == "text").text == "h"  # of the legend
    assert "rgba(213,94,0,1)" in {own.line.color for own in drawn(figure) if own.type == "scatter"}
    assert figure.layout.yaxis3.side == "right"  # the colour bar is drawn as the axes that it is


def test_bars_bands_dots_contours_and_marks_stand_where_they_are_drawn() -> None:
    bars = drawn(converted(lambda ax: ax.bar(["a", "b"], [1.0, 3.0], yerr=[0.1, 0.2], capsize=2)))
    assert [max(own.y) for own in bars if own.fill == "toself"] == [1.0, 3.0]
    assert sorted(max(own.y) for own in bars if own.mode == "lines" and not own.fill) == pytest.approx([1.1, 3.2])
    (band,) = drawn(converted(lambda ax: ax.fill_between([0.0, 1.0], [1.0, 2.0], [3.0, 4.0], color="r", alpha=0.5)))
    assert (band.fillcolor, min(band.y), max(band.y)) == ("rgba(255,0,0,0.5)", 1.0, 4.0)
    (dots,) = drawn(converted(lambda ax: ax.scatter([1.0, 2.0], [3.0, 4.0], c=[0.0, 1.0], s=[4.0, 9.0])))
    assert (list(dots.x), dots.mode, len(set(dots.marker.color))) == ([1.0, 2.0], "markers", 2)
    (line,) = drawn(converted(lambda ax: ax.plot([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], "s:", markevery=2)))
    assert ("px" in line.line.dash, line.marker.symbol, list(line.marker.size > 0)) == (True, "square", [1, 0, 1])
    (limit,) = drawn(converted(lambda ax: (ax.set_xlim(1.0, 200.0), ax.set_xscale("log"), ax.axvline(100.0))))
    assert list(limit.x) == pytest.approx([100.0, 100.0])
    contours = converted(lambda ax: ax.contourf([0.0, 1.0], [0.0, 1.0], [[0.0, 1.0], [1.0, 2.0]], levels=4))
    assert all(own.fill == "toself" for own in drawn(contours))
    turned = converted(lambda ax: (ax.invert_yaxis(), ax.set_title("a < b"), ax.figure.supxlabel("time [s]")))
    assert turned.layout.yaxis2.range == (1.0, 0.0)
    assert {"a &lt; b", "time [s]"} <= texts(turned)


def test_a_text_beside_the_axes_stays_and_one_out_of_sight_does_not_come() -> None:
    def draw(ax: Axes) -> None:
        ax.set_xlim(0.0, 1.0)
        ax.text(1.05, 0.5, "beside", transform=ax.transAxes)
        ax.annotate("beyond", (2.0, 0.5))
        ax.figure.add_subplot(label="unseen").set_visible(False)

    figure = converted(draw)
    assert [(note.text, note.xref) for note in figure.layout.annotations] == [("beside", "paper")]
    assert "xaxis3" not in figure.layout


def _polar() -> Figure:
    figure = Figure()
    figure.add_subplot(projection="polar")
    return figure


@pytest.mark.parametrize(
    ("what", "draw"),
    [
        ("polar axes", None),
        ("a symlog scale", lambda ax: (ax.set_ylim(-9.0, 9.0), ax.set_yscale("symlog"))),
        ("axes inside axes", lambda ax: ax.inset_axes((0.5, 0.5, 0.4, 0.4))),
        ("parts outside of axes", lambda ax: ax.figure.patches.append(ax.figure.patch)),
        ("an arrow", lambda ax: ax.annotate("a", (0, 0), (1, 1), arrowprops={"arrowstyle": "->"})),
        ("a Table", lambda ax: ax.table([["a"]])),
        ("a picture of pixels", lambda ax: ax.imshow(np.zeros((2, 2, 3)))),
        ("dots that are no circles", lambda ax: ax.scatter([1], [1], marker="^")),
        ("the marker H", lambda ax: ax.plot([1], [1], "H")),
        ("the formula", lambda ax: ax.set_xlabel("$p_1$")),
        ("a Quiver", lambda ax: ax.quiver([1], [1], [1], [1])),
    ],
)
def test_what_has_no_such_form_is_refused_by_its_name(what: str, draw: Callable[[Axes], Any] | None) -> None:
    with pytest.raises(DataError, match=f"a figure with {what}.* draw it by matplotlib"):
        as_plotly(_polar()) if draw is None else converted(draw)


def test_the_extra_is_named_where_plotly_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    for call in (plotly_script, lambda: as_plotly(Figure())):
        with pytest.raises(ImportError, match=r'pip install "mgdd\[interactive\]"'):
            call()
