"""A server of pages on this machine alone, behind a secret word: of the live page, and of the workbench."""

from __future__ import annotations

import asyncio
import errno
import logging
import secrets
import signal
import socket
from collections.abc import Callable, Mapping
from typing import Any

from mgdd.errors import RigError
from mgdd.io.extras import import_extra

_OURS = frozenset({"127.0.0.1", "localhost"})
_SOCKETS, _FRAMES = ("".join(f" {kind}://{host}:*" for host in sorted(_OURS)) for kind in ("ws", "http"))
# A browser loads nothing from elsewhere for a page, whatever stands in it, and tells nobody its address.
_HEADERS = {
    "Content-Security-Policy": "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; connect-src 'self' blob:"
    f"{_SOCKETS}; frame-src{_FRAMES}",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


def serve_here(
    made: Callable[[str, Mapping[str, Any]], Any],
    port: int,
    ready: Callable[[str], None],
    *,
    alive: Callable[[], bool] = lambda: True,
) -> None:
    """Serve until Ctrl-C or SIGTERM, or `alive` says no; `made` makes the server of Bokeh for a path and options.

    The address, with a secret word, goes to `ready`. ImportError without Bokeh, RigError for a port in use.
    """
    logging.getLogger("bokeh").setLevel(logging.ERROR)
    for name in ("tornado.access", "asyncio"):  # a window may be closed while it receives a message
        logging.getLogger(name).setLevel(logging.CRITICAL)
    routing, web = (import_extra(f"tornado.{name}", "watch", "a live page") for name in ("routing", "web"))
    path = f"/{secrets.token_urlsafe(16)}"

    class Foreign(routing.Matcher):  # type: ignore[misc, name-defined]
        """A name of somebody else that has come to mean this machine: a page of his must not read from here."""

        def match(self, request: Any) -> dict[str, Any] | None:
            return None if request.host_name in _OURS else {}

    class WithHeaders(web.OutputTransform):  # type: ignore[misc, name-defined]
        """Every answer with the headers of above."""

        def transform_first_chunk(self, status_code: int, headers: Any, chunk: bytes, _: bool) -> Any:
            headers.update(_HEADERS)
            return status_code, headers, chunk

    try:
        socket.create_server(("127.0.0.1", port)).close()  # the server leaves a socket behind where it fails
        server = made(path, {
            "port": port, "address": "127.0.0.1", "allow_websocket_origin": sorted(_OURS),
            "check_unused_sessions_milliseconds": 2000, "unused_session_lifetime_milliseconds": 5000,
        })  # fmt: skip
    except OSError as error:
        why = "is in use" if error.errno == errno.EADDRINUSE else f"cannot be had: {error.strerror}"
        raise RigError(f"port {port} {why}: name another one, 0 takes a free one") from error
    server._tornado.default_router.rules.insert(0, routing.Rule(Foreign(), web.ErrorHandler, {"status_code": 403}))
    server._tornado.add_transform(WithHeaders)
    loop = server.io_loop.asyncio_loop
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, loop.stop)

    async def watch() -> None:
        while alive():
            await asyncio.sleep(0.5)
        loop.stop()

    watching = loop.create_task(watch())
    server.start()
    ready(f"http://127.0.0.1:{server.port}{path}")
    try:
        loop.run_forever()
    finally:
        watching.cancel()
        server.stop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)
