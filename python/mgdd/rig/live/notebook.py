"""The live page from Python: a server in a process of its own, shown in the cell of a notebook."""

from __future__ import annotations

import os
from html import escape
from typing import Self

from mgdd.io.extras import import_extra
from mgdd.rig.can.processes import Child


class LivePage:
    """A page that is served by another process: `watch` gives it; it ends with `close`, a ``with`` block or Python."""

    def __init__(self, child: Child) -> None:
        self._child = child
        self.url = child.line

    def close(self) -> None:
        """End the server; what it shows goes on, apart from a simulation."""
        self._child.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<LivePage {self.url}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{escape(self.url)}" width="100%" height="900" style="border:0"></iframe>'


def watch(
    source: str | os.PathLike[str] | None = None,
    *,
    signal_map: str | os.PathLike[str] | None = None,
    port: int = 0,
) -> LivePage:
    """Serve a live page on this machine alone, with a stop button that opens the bridge.

    Traces by unit, state and reason of the safety gate, the estimate of a seeker with its interval, histograms of
    times. The last line of a cell shows it in a notebook whose browser runs on the same machine.

    Parameters
    ----------
    source : str or path-like, optional
        Folder of a run that goes on or is over, a record, or a bus, ``INTERFACE:CHANNEL``; a simulated throttle if left
        out.
    signal_map : str or path-like, optional
        How frames are read; ``etb`` for a bus, none for a record if left out.
    port : int
        0 takes a free one.

    Returns
    -------
    LivePage
        With ``url``, which holds a secret word, and ``close()``.

    Raises
    ------
    ImportError
        The extra ``watch`` is not installed.
    mgdd.errors.RigError
        The server did not start; the message holds its error output.

    Examples
    --------
    >>> from mgdd.rig import watch
    >>> with watch() as page:
    ...     page.url.startswith("http://127.0.0.1:")
    True
    """
    import_extra("bokeh", "watch", "a live page")
    words = ["--map", os.fspath(signal_map)] if signal_map is not None else []
    words += ["--port", str(port), "--no-browser", "--quiet", "--"]
    return LivePage(Child("mgdd", "rig", "watch", *words, "simulate" if source is None else os.fspath(source)))
