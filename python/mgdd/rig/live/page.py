"""The page itself: a Bokeh document per browser."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from html import escape
from typing import Any

import numpy as np

from mgdd.io.extras import import_extra
from mgdd.rig.live.figures import COLOURS, plain, with_legend
from mgdd.rig.live.live_data import EDGES_US, Line, LiveData, thinned
from mgdd.rig.live.server import serve_here
from mgdd.rig.live.sources import Source

_LOG = logging.getLogger(__name__)
# The eye needs no more, and the loop needs the processor; a sign of life each second, also where nothing is new.
_TICK_MS, _ALIVE_TICKS = 500, 2
_UNSEEN = 3  # updates that a slow browser may owe: what is more would pile up here
_WINDOWS_S = {"10 s": 10.0, "60 s": 60.0, "all": np.inf}
_GOOD = {"run": "#2e7d32", "armed": "#b26a00", "init": "#555", "limp": "#c62828", "fault": "#c62828"}
_SD_OF_95 = 1.96
_HEIGHT, _LEGEND_ROW, _WIDE_LABEL = 240, 22, 26  # pixels, and letters
_BROKEN_S = 3
_TEMPLATE = """{% block preamble %}
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>body { padding: 8px; font-family: sans-serif; }
body:has(#dark) { background: #15191c; color: #e0e0e0; }
#lost { display: none; position: fixed; inset: 0 0 auto 0; padding: 10px; z-index: 99; background: #c62828;
color: white; font: bold 16px sans-serif; }</style>
{% endblock %}
{% block contents %}{% if page_class %}<div id="{{ page_class }}"></div>{% endif %}
<div id="lost">No news from the server: this page stands still, and its stop button does nothing.
Use Ctrl-C where the rig runs, or the emergency stop; then load the page again.</div>{{ super() }}
<script>window.mgdd_updated = Date.now() + 20000; setInterval(() => {
document.getElementById("lost").style.display = Date.now() - window.mgdd_updated > BROKEN ? "block" : "none" }, 500)
</script>{% endblock %}""".replace("BROKEN", str(1000 * _BROKEN_S))


def _bokeh(module: str) -> Any:
    return import_extra(f"bokeh.{module}", "watch", "a live page")


class _View:
    """What one browser sees."""

    def __init__(self, source: Source, document: Any) -> None:
        models, layouts = _bokeh("models"), _bokeh("layouts")
        self._models, self._source, self._document = models, source, document
        self._status = models.Div(sizing_mode="stretch_width")
        self._timing = models.Div(sizing_mode="stretch_width")
        self._button = models.Button(
            label="STOP: open the bridge", button_type="danger", width=240, height=44, name="stop"
        )
        self._button.on_click(self._stop)
        self._window = models.RadioButtonGroup(labels=list(_WINDOWS_S), active=0, width=200, height=44)
        self._seen = models.ColumnDataSource({"n": [0]})
        self._status.js_on_change(
            "tags",
            models.CustomJS(
                args={"seen": self._seen},
                code="window.mgdd_updated = Date.now(); seen.data = {n: [cb_obj.tags[0]]}",
            ),
        )
        self._figures = models.Row(
            sizing_mode="stretch_width", styles={"flex-wrap": "wrap", "gap": "8px", "align-items": "flex-start"}
        )
        top = layouts.row(
            self._button, self._window, sizing_mode="stretch_width", styles={"flex-wrap": "wrap", "gap": "8px"}
        )
        document.add_root(layouts.column(top, self._status, self._figures, self._timing, sizing_mode="stretch_width"))
        document.title = "mgdd rig watch"
        if _asked_theme(document) == "dark":
            document.theme = "dark_minimal"
            document.template_variables["page_class"] = "dark"
        document.template = _TEMPLATE
        self._lines: list[tuple[Line, Any]] = []
        self._bars: dict[str, Any] = {}
        self._shape: Any = None
        self._shown: Any = None
        self._range, self._decades = models.Range1d(0.0, 10.0), models.Range1d(1.0, 1e4)
        self._ticks = self._sent = 0
        self.tick()
        document.add_periodic_callback(self.tick, _TICK_MS)

    def _stop(self) -> None:
        self._source.stop()
        _LOG.warning("stop was clicked: %s", self._source.said or "asked for")

    def tick(self) -> None:
        """Show what is new; what goes wrong here stands on the page."""
        self._ticks += 1
        if self._sent - self._seen.data["n"][0] > _UNSEEN:
            return
        try:
            self._source.look()
            trouble = self._source.trouble
            self._document.hold("combine")
            self._draw()
        except Exception as error:  # noqa: BLE001 - a page that stands still with old numbers would be worse
            _LOG.exception("the live page")
            trouble = f"the page cannot show this: {error}"
        text = _status_text(self._source, trouble)
        if text != self._status.text or self._ticks % _ALIVE_TICKS == 0:
            self._status.text = text
            self._sent += 1
            self._status.tags = [self._sent]
        self._document.unhold()

    def _draw(self) -> None:
        data, window_s = self._source.data, _WINDOWS_S[self._window.labels[self._window.active or 0]]
        if self._shown == (data.version, window_s):
            return
        self._shown = (data.version, window_s)
        panels = data.panels()
        shape = (panels, sorted(data.counts))
        if shape != self._shape:
            self._shape = shape
            self._build(data, panels)
        end_s = data.end_s
        from_s = max(end_s - window_s, min((float(t.time_s[0]) for t in data.tables.values() if t.rows), default=0.0))
        self._range.update(start=from_s, end=max(end_s, from_s + 1e-3))
        for line, source in self._lines:
            table = data.tables[line.table]
            time_s, values = thinned(*table.since(from_s, line.column))
            columns = {"x": time_s, "y": values}
            if line.sd_column is not None:
                own_s, sd = table.since(from_s, line.sd_column)
                half = _SD_OF_95 * np.interp(time_s, own_s, sd) if own_s.size else np.zeros_like(time_s)
                columns |= {"low": values - half, "high": values + half}
            source.data = columns
        if data.counts:
            filled = np.flatnonzero(sum(data.counts.values()))
            ends = np.log10([EDGES_US[filled[0]], EDGES_US[filled[-1] + 1]])
            self._decades.update(start=10.0 ** np.floor(ends[0]), end=10.0 ** np.ceil(ends[1]))
        for name, source in self._bars.items():
            filled = np.flatnonzero(data.counts[name])
            source.data = {
                "left": EDGES_US[filled], "right": EDGES_US[filled + 1], "top": data.counts[name][filled],
            }  # fmt: skip
        self._timing.text = _timing_text(data)

    def _build(self, data: LiveData, panels: dict[str, list[Line]]) -> None:
        """Make the figures anew: there are others than before."""
        self._lines, self._bars, figures = [], {}, []
        for axis, lines in panels.items():
            narrow = max(len(line.label) for line in lines) > _WIDE_LABEL
            figure = self._figure(
                x_range=self._range, x_axis_label="time since the start of the record [s]",
                height=_HEIGHT + _LEGEND_ROW * (len(lines) // (1 if narrow else 2)),
            )  # fmt: skip
            figure.yaxis.axis_label = plain(axis)
            for place, line in enumerate(lines):
                source = self._models.ColumnDataSource({name: [] for name in ("x", "y", "low", "high")})
                self._lines.append((line, source))
                colour, label = COLOURS[place % len(COLOURS)], plain(line.label)
                if line.sd_column is not None:
                    figure.varea(
                        "x", "low", "high", source=source, color=colour, alpha=0.2, legend_label=f"{label}, 95 %"
                    )
                figure.line("x", "y", source=source, color=colour, line_width=1.5, legend_label=label)
            with_legend(figure, 1 if narrow else 2)
            figures.append(figure)
        if data.counts:
            figure = self._figure(
                x_axis_type="log", y_axis_type="log", x_axis_label="time [µs]", x_range=self._decades, height=_HEIGHT
            )
            figure.yaxis.axis_label = "cycles since the start [-]"
            for place, name in enumerate(sorted(data.counts)):
                source = self._bars[name] = self._models.ColumnDataSource({n: [] for n in ("left", "right", "top")})
                figure.quad(
                    "left", "right", "top", 0.5, source=source, color=COLOURS[place], alpha=0.5, legend_label=name
                )
            with_legend(figure, 2)
            figures.append(figure)
        self._figures.children = figures

    def _figure(self, **how: Any) -> Any:
        made = _bokeh("plotting").figure(
            min_width=320, sizing_mode="stretch_width", align="start",
            frame_align=False, tools="pan,xwheel_zoom,box_zoom,reset,save",
            toolbar_location="right", output_backend="canvas", **how,
        )  # fmt: skip
        made.styles = {"flex": "1 1 460px"}
        made.toolbar.logo = None
        made.toolbar.autohide = True
        return made


def _asked_theme(document: Any) -> str:
    """Give the theme of the address, as ``?theme=dark``."""
    request = getattr(document.session_context, "request", None)
    asked: list[bytes] = request.arguments.get("theme", [b""]) if request is not None else [b""]
    return asked[0].decode(errors="replace")


def _status_text(source: Source, trouble: str) -> str:
    """Say what is watched, whether it runs, and what the gate says; every name may hold markup."""
    data = source.data
    colour = _GOOD.get(data.gate, "#555")
    gate = escape(data.gate or "not in this record")
    why = escape(data.reason or ("not reported by the bus" if data.frames else "–"))
    lines = [f"<b>{escape(source.name)}</b>: {escape(source.state)}"]
    lines += [
        f"safety gate: <b style='color:white;background:{colour};padding:2px 8px;border-radius:4px'>{gate}</b>"
        f" reason: <b>{why}</b>" + (f", now wrong: <b>{escape(data.cause)}</b>" if data.cause else "")
    ]
    bad = "<b style='color:#c62828'>"
    lines += [f"{bad}{escape(text)}</b>" for text in (source.said, trouble) if text]
    if data.frames and not data.tables:
        lines.append(f"{data.frames} frames, none of which makes a measurement: is --map the right one?")
    elif not data.tables and not trouble:
        lines.append("no samples yet")
    lines += [f"<small>{time_s:.2f} s: {escape(text)}</small>" for time_s, text in data.events]
    return "<div style='font-size:15px;line-height:1.5;overflow-wrap:anywhere'>" + "<br>".join(lines) + "</div>"


def _timing_text(data: LiveData) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)} [µs]</td>"
        + "".join(f"<td align=right>{data.quantile_us(name, share):.1f}</td>" for share in (0.5, 0.99, 0.999))
        + f"<td align=right>{data.largest_us[name]:.1f}</td></tr>"
        for name in sorted(data.counts)
    )
    head = "<tr><th></th>" + "".join(f"<th>{text}</th>" for text in ("p50", "p99", "p99.9", "max")) + "</tr>"
    missed = f"deadlines missed: {data.missed}" if "lateness" in data.counts else ""
    return f"<table cellpadding=4>{head}{rows}</table>{missed}" if rows else ""


def serve(source: Source, port: int, ready: Callable[[str], None], *, alive: Callable[[], bool] = lambda: True) -> None:
    """Serve the page of a source, as `serve_here` does."""
    server_of = _bokeh("server.server").Server

    def show(document: Any) -> None:
        _View(source, document)

    def made(path: str, options: Mapping[str, Any]) -> Any:
        return server_of({path: show}, use_index=False, redirect_root=False, **options)

    serve_here(made, port, ready, alive=alive)
