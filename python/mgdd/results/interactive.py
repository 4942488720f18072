"""A matplotlib figure as a Plotly figure, to zoom and hover in: one converter of what is drawn, for every plot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import DataError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from numpy.typing import NDArray

__all__ = ["as_plotly", "plotly_script"]

_DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
_MARKERS = {"o": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down", "D": "diamond", "x": "x-thin-open"}
_PIXELS = 80.0  # per inch, so that the text is as large as that of a page


def plotly_script() -> str:
    """Return Plotly's own script, some megabytes, for a page without a network."""
    _need_plotly()
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def as_plotly(figure: Figure) -> Any:
    """Convert a figure of straight axes: lines, bands, cells, contours, bars and texts, all at the same places.

    DataError for other axes and for tables, ImportError without Plotly.
    """
    go = _need_plotly()
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]  # the layout and the ticks are known only now
    layout: dict[str, Any] = {"height": _PIXELS * figure.get_figheight(), "annotations": [], "plot_bgcolor": "white"}
    layout |= {"margin": dict.fromkeys("lrtb", 0), "font": {"size": 11, "color": "black"}, "showlegend": True}
    traces: list[dict[str, Any]] = []
    known: dict[Axes, int] = {}
    for ax in figure.axes:
        if ax.get_label() == "<colorbar>":
            continue
        if ax.name != "rectilinear" or ax.tables:
            raise DataError(f"a figure of {ax.name} axes or tables has no interactive form: draw it by matplotlib")
        number = known[ax] = len(known) + 1
        host = next((own for own in known if np.allclose(own.get_position().bounds, ax.get_position().bounds)), ax)
        layout |= _axes(ax, number, known, known[host])
        place = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        named = host.get_legend() is not None or bool(figure.legends)
        shown = {"legend": f"legend{known[host]}", "showlegend": named}
        traces += [place | own for own in _traces(ax, shown)]
        layout["annotations"] += [_text(ax, text, number) for text in ax.texts if text.get_text()]
        if title := ax.get_title(loc="left") or ax.get_title():
            box = ax.get_position()
            layout["annotations"].append(_note(title, x=box.x0, y=box.y1, xanchor="left", yanchor="bottom"))
    return go.Figure(data=traces, layout=layout)


def _need_plotly() -> Any:
    try:
        import plotly.graph_objects as go
    except ModuleNotFoundError as error:
        raise ImportError('an interactive figure needs plotly: pip install "mgdd[interactive]"') from error
    return go


def _axes(ax: Any, number: int, known: dict[Axes, int], host: int) -> dict[str, Any]:
    """Place both axes, and the legend in their corner; a twin lies over its host."""
    box, out = ax.get_position(), dict[str, Any]()
    for letter, axis, ends in (("x", ax.xaxis, (box.x0, box.x1)), ("y", ax.yaxis, (box.y0, box.y1))):
        own: dict[str, Any] = {"domain": ends, "anchor": f"{'y' if letter == 'x' else 'x'}{number}", "tickmode": "auto"}
        own |= {"showline": True, "mirror": True, "automargin": False, "ticks": "outside", "linecolor": "black"}
        own |= {"title": {"text": axis.get_label_text().replace("\n", "<br>"), "standoff": 4}, "gridcolor": "#e5e5e5"}
        own["type"], limits = axis.get_scale(), np.asarray(getattr(ax, f"get_{letter}lim")(), float)
        own["range"] = (np.log10(limits) if own["type"] == "log" else limits).tolist()
        if type(axis.get_major_formatter()).__name__ not in ("ScalarFormatter", "LogFormatterSciNotation"):
            labels = [label.get_text() for label in axis.get_majorticklabels()]
            own |= {"tickvals": list(map(float, axis.get_majorticklocs())), "ticktext": labels, "tickmode": "array"}
            own |= {"tickfont": {"size": min([11.0, *(label.get_fontsize() for label in axis.get_majorticklabels())])}}
        own["showticklabels"] = any(label.get_visible() and label.get_text() for label in axis.get_majorticklabels())
        shared = getattr(ax, f"get_shared_{letter}_axes")().get_siblings(ax)
        first = next((known[other] for other in known if other is not ax and other in shared), None)
        own |= {} if first is None else {"matches": f"{letter}{first}"}
        out[f"{letter}axis{number}"] = own
    if host != number:
        out[f"xaxis{number}"] |= {"overlaying": f"x{host}", "showticklabels": False, "ticks": ""}
        out[f"yaxis{number}"] |= {"overlaying": f"y{host}", "side": "right", "showgrid": False, "mirror": False}
    corner = {"x": box.x1, "y": box.y1, "xanchor": "right", "yanchor": "top", "bgcolor": "rgba(255,255,255,0.6)"}
    out[f"legend{number}"] = corner | {"font": {"size": 9}}
    return out


def _traces(ax: Any, shown: dict[str, Any]) -> list[dict[str, Any]]:
    from matplotlib.collections import LineCollection, PathCollection, QuadMesh
    from matplotlib.colors import to_hex

    out: list[dict[str, Any]] = []
    for own in ax.collections:
        named = _named(own.get_label(), shown)
        edges, faces = own.get_edgecolor(), own.get_facecolor()
        mesh, dots, lines = (isinstance(own, kind) for kind in (QuadMesh, PathCollection, LineCollection))
        if mesh:
            grid = own.get_coordinates()
            out.append(_cells(grid[0, :, 0], grid[:, 0, 1], own.get_array(), own))
        elif dots:
            fill = [to_hex(color) for color in (faces if len(faces) else edges)]
            spots = np.asarray(own.get_offsets())
            dot = {"color": fill if len(fill) == len(spots) else (fill or ["black"])[0], "size": 7}
            out.append(named | {"x": spots[:, 0], "y": spots[:, 1], "mode": "markers", "marker": dot})
        else:  # bands, contours, bars of errors: each path of its own colour
            lines = lines or not len(faces)
            colors = edges if lines else faces
            for at, path in enumerate(own.get_paths()):
                tint = tuple(colors[at % len(colors)]) if len(colors) else (0.0, 0.0, 0.0, 1.0)
                corners = _corners(ax, path, own.get_transform())
                out.append((named if at == 0 else _named("_", shown)) | corners | _filled(tint, lines=lines))
        if getattr(own, "colorbar", None) is not None:
            out.append(_scale(own))
    for image in ax.images:
        left, right, bottom, top = image.get_extent()
        rows, columns = image.get_array().shape[:2]
        ends = (bottom, top) if image.origin == "lower" else (top, bottom)
        x, y = np.linspace(left, right, columns + 1), np.linspace(*ends, rows + 1)
        out.append(_cells(x, y, image.get_array(), image))
    for patch in ax.patches:
        corners = _corners(ax, patch.get_path(), patch.get_transform())
        out.append(_named(patch.get_label(), shown) | corners | _filled(patch.get_facecolor(), lines=False))
    for line in ax.lines:
        points = _corners(ax, line.get_path(), line.get_transform())
        mark, dash = _MARKERS.get(str(line.get_marker())), line.get_linestyle()
        color, face = to_hex(line.get_color()), line.get_markerfacecolor()
        inner = color if str(face) == "none" else to_hex(face)
        marker = {"symbol": mark, "color": inner, "size": line.get_markersize()} if mark else {}
        drawn = [text for text, there in (("lines", dash not in ("None", "none", "")), ("markers", mark)) if there]
        style: dict[str, Any] = {"color": color, "width": 1.2 * line.get_linewidth(), "dash": _DASHES.get(dash, "dot")}
        style["shape"] = "hv" if line.get_drawstyle() == "steps-post" else "linear"
        how = {"mode": "+".join(drawn) or "none", "line": style, "marker": marker}
        out.append(_named(line.get_label(), shown) | points | how)
    return out


def _named(label: Any, shown: dict[str, Any]) -> dict[str, Any]:
    text = "" if str(label).startswith("_") else str(label)
    return {"type": "scatter", "name": text} | shown | ({} if text else {"showlegend": False})


def _corners(ax: Axes, path: Any, transform: Any) -> dict[str, Any]:
    """Give the points of a path in units of the data, whatever it was drawn in."""
    pieces = [path.vertices] if path.codes is None else path.to_polygons(closed_only=False)
    points = np.concatenate([part for piece in pieces for part in (piece, np.full((1, 2), np.nan))][:-1])
    if transform != ax.transData:
        points = (transform - ax.transData).transform(points)
    return {"x": points[:, 0], "y": points[:, 1]}


def _filled(color: Any, *, lines: bool) -> dict[str, Any]:
    text = "rgba({:.0f},{:.0f},{:.0f},{:.3g})".format(*(255 * part for part in color[:3]), color[3])
    if lines:
        return {"mode": "lines", "line": {"color": text, "width": 1}}
    return {"mode": "lines", "fill": "toself", "fillcolor": text, "line": {"width": 0}, "hoverinfo": "skip"}


def _colors(mappable: Any) -> dict[str, Any]:
    from matplotlib.colors import to_hex

    scale = [[at, to_hex(mappable.get_cmap()(at))] for at in np.linspace(0.0, 1.0, 17)]
    return {"colorscale": scale, **dict(zip(("cmin", "cmax"), map(float, mappable.get_clim()), strict=True))}


def _cells(x: NDArray[np.float64], y: NDArray[np.float64], values: Any, mappable: Any) -> dict[str, Any]:
    own = _colors(mappable)
    z: Any = np.ma.asarray(values, float).filled(np.nan).reshape(len(y) - 1, len(x) - 1)
    ends = {"zmin": own["cmin"], "zmax": own["cmax"], "colorscale": own["colorscale"]}
    return {"type": "heatmap", "x": x, "y": y, "z": z, "showscale": False} | ends


def _scale(mappable: Any) -> dict[str, Any]:
    """Give the colour bar, which belongs to a trace of no points."""
    box = (side := mappable.colorbar.ax).get_position()
    bar = {"title": {"text": side.get_ylabel(), "side": "right"}, "x": box.x0, "y": box.y0, "len": box.height}
    bar |= {"xanchor": "left", "yanchor": "bottom", "thickness": 12, "xpad": 0, "ypad": 0}
    marker = _colors(mappable) | {"showscale": True, "colorbar": bar}
    return {"type": "scatter", "x": [None], "y": [None], "mode": "markers", "showlegend": False, "marker": marker}


def _text(ax: Axes, text: Text, number: int) -> dict[str, Any]:
    box = text.get_window_extent()
    x, y = ax.transData.inverted().transform((0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)))
    x, y = np.log10(x) if ax.get_xscale() == "log" else x, np.log10(y) if ax.get_yscale() == "log" else y
    return _note(text.get_text(), x=x, y=y, xref=f"x{number}", yref=f"y{number}")


def _note(text: str, **place: Any) -> dict[str, Any]:
    return {"xref": "paper", "yref": "paper", "text": text.replace("\n", "<br>"), "showarrow": False,
            "font": {"size": 10}} | place  # fmt: skip
