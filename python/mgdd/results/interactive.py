"""A matplotlib figure as a Plotly figure, to zoom and hover in: what is drawn, at the same places, or a refusal.

Imported on use: it needs matplotlib.
"""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.category import StrCategoryFormatter
from matplotlib.collections import Collection, LineCollection, PathCollection, QuadMesh
from matplotlib.colors import to_rgba
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedFormatter, FuncFormatter
from matplotlib.transforms import IdentityTransform

from mgdd.errors import DataError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform

_PIXELS = 80.0  # per inch: a wide figure fits a page
_STEPS = {"steps": "vh", "steps-pre": "vh", "steps-post": "hv", "steps-mid": "hvh"}
_NONE = ("None", "none", " ", "")
_MARKERS = {
    "o": "circle", ".": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down", "D": "diamond",
    "*": "star", "+": "cross-thin", "x": "x-thin", "_": "line-ew", "|": "line-ns", 2: "line-ns", 3: "line-ns",
}  # fmt: skip


def plotly_script() -> str:
    """Return Plotly's own script, some megabytes, for a page without a network."""
    _need_plotly()
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def as_plotly(figure: Figure) -> Any:
    """Convert a figure: lines, bands, bars, cells, contours, dots, texts, legends, colour bars, log axes, twins.

    DataError names anything else in it, ImportError the extra where Plotly is missing.
    """
    go = _need_plotly()
    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]  # places and ticks are known only now
    width, height = (_PIXELS * figure.get_size_inches()).tolist()
    layout: dict[str, Any] = {"width": width, "height": height, "margin": dict.fromkeys("lrtb", 0), "showlegend": False}
    layout |= {"plot_bgcolor": "rgba(0,0,0,0)", "hovermode": "closest", "font": {"color": "black"}}
    # Below all axes lies a pair over the whole figure, in matplotlib's pixels, for the legends.
    for letter, pixels in zip("xy", map(float, figure.bbox.size), strict=True):
        layout[f"{letter}axis"] = {"range": [0.0, pixels], "visible": False, "fixedrange": True}
    texts = [*figure.texts, *(getattr(figure, f"_sup{which}") for which in ("title", "xlabel", "ylabel"))]
    notes = [_note(own) for own in dict.fromkeys(texts) if own is not None]
    legends, traces, grounds, known = list(figure.legends), list[Any](), list[Any](), dict[Any, int]()
    if [*figure.lines, *figure.patches, *figure.images, *figure.artists, *figure.subfigs]:
        raise _refused("parts outside of axes")
    for ax in filter(Artist.get_visible, figure.axes):
        known[ax] = number = len(known) + 2
        layout |= _axes(ax, known)
        ground: dict[str, Any] = dict(zip(("x0", "y0", "x1", "y1"), map(float, ax.get_position().extents), strict=True))
        ground |= {"xref": "paper", "yref": "paper", "layer": "below", "line": {"width": 0}}
        grounds.append(ground | {"fillcolor": _color(ax.get_facecolor())})
        titles = (ax.title, *(getattr(ax, f"_{side}_title") for side in ("left", "right")))
        notes += [_note(own) for own in (*titles, ax.xaxis.label, ax.yaxis.label)]
        place = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        for own in sorted(filter(Artist.get_visible, vars(ax)["_children"]), key=Artist.get_zorder):
            if isinstance(own, Text):
                notes.append(_note(own, ax, number))
            else:
                traces += [_hover(ax, own) | place | each for each in _traces(own, ax.transData)]
        legends += filter(None, [ax.get_legend()])
    for legend in legends:
        for own in sorted(legend.findobj(Artist.get_visible), key=lambda each: each is not legend.get_frame()):
            if isinstance(own, Text):
                notes.append(_note(own))
            elif isinstance(own, Line2D | Patch | Collection):
                traces += [{"hoverinfo": "skip"} | each for each in _traces(own, IdentityTransform())]
    layout |= {"annotations": [note for note in notes if note["text"]], "shapes": grounds}
    return go.Figure(data=[{"type": "scatter"} | own for own in traces], layout=layout)


def _need_plotly() -> Any:
    try:
        import plotly.graph_objects as go
    except ModuleNotFoundError as error:
        raise ImportError('an interactive figure needs plotly: pip install "mgdd[interactive]"') from error
    return go


def _refused(what: str) -> DataError:
    return DataError(f"a figure with {what} has no interactive form: draw it by matplotlib")


def _axes(ax: Any, known: dict[Any, int]) -> dict[str, Any]:
    """Place both axes; a twin lies over its host."""
    if ax.name != "rectilinear" or ax.child_axes:
        raise _refused("axes inside axes" if ax.child_axes else f"{ax.name} axes")
    number, box, out = known[ax], ax.get_position(), dict[str, Any]()
    host = next(known[own] for own in known if np.allclose(own.get_position().bounds, box.bounds))
    for letter, axis, other, ends in (("x", ax.xaxis, "y", box.intervalx), ("y", ax.yaxis, "x", box.intervaly)):
        labels = axis.get_majorticklabels()
        named = [_plain(label.get_text()) for label in labels if label.get_visible()]
        seen = any(named) and not (letter == "x" and host != number)
        limits = np.asarray(getattr(ax, f"get_{letter}lim")(), float)
        own = {"domain": ends.tolist(), "anchor": f"{other}{number}", "type": _scale(axis), "tickmode": "auto"}
        own |= {"range": (np.log10(limits) if own["type"] == "log" else limits).tolist(), "zeroline": False}
        own |= {"side": side} if (side := axis.get_ticks_position()) in ("top", "right") else {}
        own |= {"visible": ax.axison, "showline": True, "mirror": host == number, "linecolor": "black"}
        own |= {"showgrid": any(line.get_visible() for line in axis.get_gridlines()), "gridcolor": "#e5e5e5"}
        own |= {"showticklabels": seen, "ticks": "outside" if seen else "", "exponentformat": "none"}
        own |= {"tickfont": {"size": _pixels(labels[0].get_fontsize())}} if labels else {}
        if isinstance(axis.get_major_formatter(), FixedFormatter | FuncFormatter | StrCategoryFormatter):
            own |= {"tickmode": "array", "tickvals": list(map(float, axis.get_majorticklocs())), "ticktext": named}
            own |= {"tickangle": -labels[0].get_rotation()} if labels else {}
        shared = getattr(ax, f"get_shared_{letter}_axes")().get_siblings(ax)
        first = min(known[each] for each in shared if each in known)
        own |= {} if first == number else {"matches": f"{letter}{first}"}
        out[f"{letter}axis{number}"] = own | ({} if host == number else {"overlaying": f"{letter}{host}"})
    return out


def _scale(axis: Any) -> str:
    if axis.get_scale() == "log":
        return "log"
    low, high = axis.get_view_interval()
    moved = axis.get_transform().transform(np.linspace(low, high, 9))
    if not np.allclose(moved, np.linspace(moved[0], moved[-1], 9)):
        raise _refused(f"a {axis.get_scale()} scale")
    return "linear"


def _traces(own: Any, data: Transform) -> list[dict[str, Any]]:
    """Give the traces of what is drawn, by the transform of the data to the screen."""
    kind = type(own)
    if issubclass(kind, Line2D):
        return [_points(data, own.get_path(), own.get_transform()) | _line(own)]
    if issubclass(kind, QuadMesh):
        grid = own.get_coordinates()
        if np.ptp(grid[..., 0], axis=0).any() or np.ptp(grid[..., 1], axis=1).any():
            raise _refused("cells that are no rectangles")
        return [_cells(grid[0, :, 0], grid[:, 0, 1], own)]
    if issubclass(kind, AxesImage):
        left, right, bottom, top = own.get_extent()
        rows, columns = np.shape(own.get_array())[:2]
        ends = (bottom, top) if own.origin == "lower" else (top, bottom)
        return [_cells(np.linspace(left, right, columns + 1), np.linspace(*ends, rows + 1), own)]
    if issubclass(kind, PathCollection):
        if any(len(path) != len(Path.unit_circle()) for path in own.get_paths()):
            raise _refused("dots that are no circles")
        spots, size = np.asarray(own.get_offsets()), _pixels(np.sqrt(own.get_sizes()))
        dot = _marker("circle", size, own.get_facecolor(), own.get_edgecolor(), own.get_linewidth()[0])
        return [{"x": spots[:, 0], "y": spots[:, 1], "mode": "markers", "marker": dot}]
    if issubclass(kind, Patch):
        edge = {"color": _color(own.get_edgecolor()), "width": _pixels(own.get_linewidth())}
        how = {"fill": "toself", "fillcolor": _color(own.get_facecolor()), "line": edge, "hoveron": "points"}
        return [_points(data, own.get_path(), own.get_transform()) | {"mode": "lines"} | how]
    if not issubclass(kind, Collection) or np.any(own.get_offsets()):
        raise _refused(f"a {kind.__name__}")
    # Bands, contours, bars of errors: each path of its own colour.
    lines = issubclass(kind, LineCollection) or not len(own.get_facecolor())
    colors = own.get_edgecolor() if lines else own.get_facecolor()
    widths, dashes, out = own.get_linewidth(), own.get_linestyle(), []
    for at, path in enumerate(own.get_paths()):
        color = _color(colors[at % len(colors)])
        line = {"color": color, "width": _pixels(widths[at % len(widths)]), "dash": _dash(dashes[at % len(dashes)])}
        area = {"fill": "toself", "fillcolor": color, "line": {"width": 0}, "hoverinfo": "skip"}
        out.append(_points(data, path, own.get_transform()) | {"mode": "lines"} | ({"line": line} if lines else area))
    return out


def _line(own: Any) -> dict[str, Any]:
    mark, edge, every = own.get_marker(), own.get_markeredgewidth(), own.get_markevery()
    size = _pixels(own.get_markersize() * (0.5 if mark == "." else 1.0))
    if str(mark).startswith("$"):  # a letter
        return {"mode": "text", "text": mark.strip("$"), "textfont": {"size": size}}
    if mark not in (*_MARKERS, *_NONE):
        raise _refused(f"the marker {mark}")
    if every is not None:
        chosen = np.zeros(len(own.get_xdata()))
        chosen[slice(None, None, every) if isinstance(every, int) else every] = 1.0
        size, edge = size * chosen, edge * chosen
    line = {"color": _color(own.get_color()), "width": _pixels(own.get_linewidth()), "dash": _dash(own._dash_pattern)}
    line |= {"shape": _STEPS.get(own.get_drawstyle(), "linear")}
    marker = _marker(_MARKERS.get(mark, ""), size, own.get_markerfacecolor(), own.get_markeredgecolor(), edge)
    modes = ["lines"] * (own.get_linestyle() not in _NONE) + ["markers"] * (mark in _MARKERS)
    alpha = {} if own.get_alpha() is None else {"opacity": own.get_alpha()}
    return {"mode": "+".join(modes) or "none", "line": line} | alpha | ({"marker": marker} if mark in _MARKERS else {})


def _marker(symbol: str, size: Any, face: Any, edge: Any, width: Any) -> dict[str, Any]:
    line = {"color": _colors(edge), "width": _pixels(width)}
    return {"symbol": symbol, "size": size, "color": _colors(face), "opacity": 1.0, "line": line}


def _dash(pattern: tuple[float, Any]) -> str:
    return "solid" if pattern[1] is None else ",".join(f"{_pixels(part):.1f}px" for part in pattern[1])


def _cells(x: Any, y: Any, own: Any) -> dict[str, Any]:
    """Give rectangles of one colour each, whatever law makes the colours."""
    values: Any = np.ma.asarray(own.get_array(), float).filled(np.nan)
    if values.size != (len(x) - 1) * (len(y) - 1):
        raise _refused("a picture of pixels")
    low, high = map(float, own.get_clim())
    scale = [[at, _color(own.to_rgba(low + at * (high - low)))] for at in np.linspace(0.0, 1.0, 65)]
    cells = {"type": "heatmap", "x": x, "y": y, "z": values.reshape(len(y) - 1, len(x) - 1)}
    return cells | {"zmin": low, "zmax": high, "colorscale": scale, "showscale": False}


def _points(data: Transform, path: Any, transform: Any) -> dict[str, Any]:
    """Give the points of a path in units of the data, whatever it was drawn in."""
    pieces = [path.vertices] if path.codes is None else path.to_polygons(closed_only=False)
    parts = [part for piece in pieces for part in (piece, np.full((1, 2), np.nan))]
    points = np.concatenate(parts[:-1]) if parts else np.empty((0, 2))
    if transform != data:
        points = (transform - data).transform(points)
    return {"x": points[:, 0], "y": points[:, 1]}


def _hover(ax: Any, own: Any) -> dict[str, Any]:
    """Name what lies under the pointer, with the units of the axes."""
    label = "" if str(own.get_label()).startswith("_") else _plain(str(own.get_label()))
    said = {"x": ax.get_xlabel(), "y": ax.get_ylabel()}
    if issubclass(type(own), QuadMesh | AxesImage):
        said["z"] = own.colorbar.ax.get_ylabel() if own.colorbar else "value"
    lines = "<br>".join(f"{_plain(name) or letter}: %{{{letter}:.5g}}" for letter, name in said.items())
    return {"name": label, "hovertemplate": f"{lines}<extra>{label}</extra>"}


def _note(text: Text, ax: Any = None, number: int = 0) -> dict[str, Any]:
    """Write a text where it stands: on the paper, or at its point of axes."""
    if isinstance(text, Annotation) and text.arrow_patch is not None:
        raise _refused("an arrow")
    box, whole, place = text.get_window_extent(), cast("Any", text.figure), {"xref": "paper", "yref": "paper"}
    middle = (0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1))
    inside = ax is not None and ax.bbox.contains(*middle)
    # Of an annotation of a point that is out of sight matplotlib says the unit box.
    seen = text.get_visible() and box.bounds != (0.0, 0.0, 1.0, 1.0) and (inside or not (ax and text.get_clip_on()))
    x, y = (ax.transData if inside else whole.transFigure).inverted().transform(middle)
    if inside:
        place = {"xref": f"x{number}", "yref": f"y{number}"}
        x, y = np.log10(x) if ax.get_xscale() == "log" else x, np.log10(y) if ax.get_yscale() == "log" else y
    font = {"size": _pixels(text.get_fontsize()), "color": _color(text.get_color())}
    place |= {"xanchor": "center", "yanchor": "middle", "align": text.get_horizontalalignment()}
    said = _plain(text.get_text()) if seen else ""
    return {"text": said, "x": x, "y": y, "font": font, "textangle": -text.get_rotation(), "showarrow": False} | place


def _plain(text: str) -> str:
    if text.startswith(r"$\mathdefault{"):  # a tick of a logarithm, which Plotly writes itself
        return text
    if "$" in text:
        raise _refused(f"the formula {text!r}")
    return html.escape(text, quote=False).replace("\n", "<br>")


def _pixels(points: Any) -> Any:
    return points * _PIXELS / 72.0


def _color(color: Any) -> str:
    red, green, blue, alpha = to_rgba(color)
    return f"rgba({255 * red:.0f},{255 * green:.0f},{255 * blue:.0f},{alpha:.3g})"


def _colors(color: Any) -> Any:
    """Write one colour, or one per dot."""
    each = list(map(_color, color)) if np.ndim(color) == 2 else [_color(color)]
    return each if len(each) > 1 else (each or [_color("none")])[0]
