"""The page: one session per window, its views in tabs, and the server of this machine that serves it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, ClassVar

from mgdd.rig.live.server import serve_here
from mgdd.workbench.jobs import prepare
from mgdd.workbench.parts import panel
from mgdd.workbench.pictures import bokeh
from mgdd.workbench.session import Session
from mgdd.workbench.views.check import Check
from mgdd.workbench.views.cycles import Cycles
from mgdd.workbench.views.files import Files
from mgdd.workbench.views.live import Live
from mgdd.workbench.views.maps import Map
from mgdd.workbench.views.search import Search
from mgdd.workbench.views.throttle import Throttle
from mgdd.workbench.views.timing import Timing

_FILES = "static/extensions/panel/"
_UNUSED_MS = 60_000  # a window that lost its server may come back so long
_MESSAGE_BYTES = 16_000_000  # of the websocket: a file comes in pieces of eight million
_CSS = """
:host, :root { --bokeh-base-font: system-ui, sans-serif; }
body { margin: 0; background: var(--panel-background-color); color: var(--panel-on-background-color); }
#header { font-family: system-ui, sans-serif; }
"""
_TABS = """
:host { grid-template-columns: minmax(0, 1fr) !important; }
.bk-header, .bk-headers-wrapper { flex-wrap: wrap !important; overflow: visible !important; height: auto; }
.bk-tab, .bk-tab.bk-active { color: var(--panel-on-background-color); }
"""


class Bench:
    """All views of one window."""

    def __init__(self) -> None:
        self.session = Session()
        self.files = Files(self.session, self.follow)
        self.check, self.cycles, self.timing = Check(self.files), Cycles(self.files), Timing(self.files)
        self.search, self.map, self.throttle, self.live = (
            Search(self.session), Map(self.session), Throttle(self.session), Live(),
        )  # fmt: skip
        self.views = (self.files, self.check, self.cycles, self.timing, self.search, self.map, self.throttle, self.live)
        self.tabs = panel().Tabs(
            *((view.title, view.layout) for view in self.views),
            dynamic=True,
            sizing_mode="stretch_width",
            stylesheets=[_TABS],
        )

    def follow(self) -> None:
        """Let the views that are there follow the chosen file, and the engines that were dropped."""
        if not hasattr(self, "views"):  # it is not ready yet
            return
        for view in (self.check, self.cycles, self.timing):
            view.show()
        for plant in (self.search, self.map):
            plant.engine.options = self.session.engines

    def close(self) -> None:
        """End all work of the window, and forget its files."""
        for view in self.views:
            view.close()
        self.session.close()


@cache
def _template() -> Any:
    """Make the template: that of Panel without its font, which comes from elsewhere."""

    class Page(panel().template.VanillaTemplate):  # type: ignore[misc]
        _resources: ClassVar[dict[str, dict[str, str]]] = {"css": {}}

    return Page


def window() -> Any:
    """Make the page of one window."""
    pn = panel()
    pn.extension()
    # Panel knows where its own files are only in a page, and not in one that comes back after its session was ended.
    pn.state.curdoc.template_variables.setdefault("dist_url", _FILES)
    bench = Bench()
    pn.state.on_session_destroyed(lambda _: bench.close())
    dark = pn.config.theme == "dark"
    other = "default" if dark else "dark"
    switch = pn.pane.HTML(f"<a style='color:white' href='?theme={other}'>{'light' if dark else 'dark'}</a>")
    return _template()(
        title="mgdd workbench",
        main=[bench.tabs],
        header=[switch],
        raw_css=[_CSS],
        theme=pn.config.theme,
    )


def serve(port: int, ready: Callable[[str], None], *, alive: Callable[[], bool] = lambda: True) -> None:
    """Serve the workbench on this machine alone; as `mgdd.rig.live.server.serve_here`."""
    server_of = panel().io.server.get_server
    prepare()
    bokeh("plotting")  # before the first file is dropped

    def made(path: str, options: Mapping[str, Any]) -> Any:
        own = {**options, "unused_session_lifetime_milliseconds": _UNUSED_MS}
        origins = own.pop("allow_websocket_origin")
        return server_of(
            {path.strip("/"): window}, websocket_origin=origins, use_index=False, redirect_root=False, show=False,
            start=False, websocket_max_message_size=_MESSAGE_BYTES, **own,
        )  # fmt: skip

    serve_here(made, port, ready, alive=alive)
