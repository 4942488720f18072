"""What is finished when Ctrl-C or a lost worker ends long work: kept, and handed over in the error."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from mgdd.errors import Interrupted, WorkerLostError

Item = TypeVar("Item")
Result = TypeVar("Result")


def or_partial(call: Callable[[], Result]) -> tuple[Result, Interrupted | None]:
    """Call the core: what it returns, or the part that Ctrl-C left with the Interrupted that brought it."""
    try:
        return call(), None
    except Interrupted as stop:
        if stop.partial is None:
            raise
        return stop.partial, stop


def keep_finished(call: Callable[[Item], Result], items: Iterable[Item], done: list[Result]) -> Interrupted | None:
    """Call the core for one item after the other and append to `done`, the part that Ctrl-C left included."""
    try:
        for item in items:
            done += [call(item)]
    except KeyboardInterrupt as stop:
        part = getattr(stop, "partial", None)
        if part is not None:
            done.append(part)
        if not done:
            raise
        return Interrupted("interrupted: what was finished is in .partial", done[-1])
    return None


def hand_over(result: Result, stop: Interrupted | WorkerLostError | None) -> Result:
    """Return a whole result; raise one made of a part in the error that ended it."""
    if stop is not None:
        stop.partial = result
        raise stop
    return result
