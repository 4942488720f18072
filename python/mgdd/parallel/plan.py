"""Which chunk is next: small at first, then as large as a wanted time allows, and lost ones again."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

_WANTED_S = 0.25  # of a chunk: far above the cost of handing it over, short enough for progress and Ctrl-C
_GROWTH = 8  # a chunk may be that much larger than the largest one measured
_ATTEMPTS = 3


@dataclass(frozen=True)
class Chunk:
    """Items ``start`` to ``stop`` (exclusive) of the work, and how often they have been handed out before."""

    start: int
    stop: int
    attempt: int = 0

    @property
    def size(self) -> int:
        """Number of items."""
        return self.stop - self.start

    def __str__(self) -> str:
        return f"item {self.start}" if self.size == 1 else f"items {self.start} to {self.stop - 1}"


class Plan:
    """Cuts ``n_items`` into chunks, in order; the cost of an item is measured while the work goes on."""

    def __init__(
        self, n_items: int, workers: int, *, seconds_per_item: float | None = None, largest: int | None = None
    ) -> None:
        self._n, self._workers = n_items, workers
        self._largest = n_items if largest is None else largest
        self._cost_s, self._measured = seconds_per_item, 0 if seconds_per_item is None else n_items
        self._next = 0
        self._lost: deque[Chunk] = deque()

    @property
    def n_at_once(self) -> int:
        """Chunks that may be out at a time: one more per worker, so that none waits for the next."""
        return 2 * self._workers if self._measured else self._workers

    @property
    def has_lost(self) -> bool:
        """Whether a lost chunk is next."""
        return bool(self._lost)

    def next(self) -> Chunk | None:
        """Return the next chunk, None when everything was handed out."""
        if self._lost:
            return self._lost.popleft()
        if self._next == self._n:
            return None
        start, self._next = self._next, self._next + self._size()
        return Chunk(start, self._next)

    def measured(self, chunk: Chunk, seconds: float) -> None:
        """Learn what the items of a finished chunk have cost."""
        now = seconds / chunk.size
        self._cost_s = now if self._cost_s is None else 0.5 * (self._cost_s + now)
        self._measured = max(self._measured, chunk.size)

    def lost(self, chunk: Chunk) -> bool:
        """Plan a lost chunk again; False where that was tried often enough."""
        again = replace(chunk, attempt=chunk.attempt + 1)
        self._lost.append(again)
        return again.attempt < _ATTEMPTS

    def _size(self) -> int:
        left = self._n - self._next
        if self._cost_s is None or not self._measured:
            return 1
        by_time = math.floor(_WANTED_S / self._cost_s) if self._cost_s > 0.0 else left
        fair = math.ceil(left / (2 * self._workers))  # the last chunks get small: nobody waits long for the others
        return max(1, min(by_time, fair, self._largest, _GROWTH * self._measured))
