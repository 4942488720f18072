"""Live: a run, a record or a simulated throttle, as `mgdd rig watch` shows it."""

from __future__ import annotations

import asyncio
from html import escape
from typing import Any

from mgdd.errors import Error
from mgdd.rig import watch
from mgdd.workbench.parts import button, column, page, panel, side, text


class Live:
    """The last page; its server is a process of its own, which ends with the window."""

    title = "Live"

    def __init__(self) -> None:
        self.source = panel().widgets.TextInput(
            label="folder of a run, a record, or simulate", value="simulate", width=320, align="end"
        )
        self._shown = page()
        self._page: Any = None
        self.layout = column(
            page(text("The page of mgdd rig watch: it reads, and its stop button opens the bridge.", "quiet")),
            side(self.source, button("Watch", self.watch, first=True)), self._shown,
        )  # fmt: skip

    def watch(self) -> None:
        """Open the page of a source, while this one goes on."""
        self.close()
        self._shown.object = text("opening")
        panel().state.execute(self.opened)

    async def opened(self) -> None:
        """Wait for the server of the page, and show it."""
        try:
            self._page = await asyncio.to_thread(watch, self.source.value or "simulate")
        except (Error, ImportError) as error:
            self._shown.object = text(str(error), "bad")
            return
        theme = "dark" if panel().config.theme == "dark" else "light"
        self._shown.object = (
            f"<iframe src='{escape(self._page.url)}?theme={theme}' width='100%' height='900' style='border:0'></iframe>"
        )

    def close(self) -> None:
        """End the server of the page."""
        if self._page is not None:
            self._page.close()
            self._page = None
