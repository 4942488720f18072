"""A hub in a thread of the test, for transports of the same process."""

import asyncio
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from mgdd.rig.can.hub import BusFault, Hub


@contextmanager
def running_hub(faults: Sequence[str] = (), **settings: float | None) -> Iterator[Hub]:
    """Serve at a free port until the block ends."""
    hub = Hub(faults=[BusFault.parse(text) for text in faults], **settings)  # type: ignore[arg-type]
    ready, stop = threading.Event(), asyncio.Event()
    loop = asyncio.new_event_loop()

    def serve() -> None:
        loop.run_until_complete(hub.run(lambda _: ready.set(), stop))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        assert ready.wait(10.0)
        yield hub
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
        loop.close()


def bus_of(hub: Hub) -> str:
    return f"socketcand:can0?host=127.0.0.1&port={hub.port}"
