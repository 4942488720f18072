"""What a guide says of a schedule of operating points, for loops of the core, which call no Python."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mgdd.guide.feed_forward import FeedForward

# First cycle and end of an answer, its optimum (None: nothing was said), curvature and cause.
Said = tuple[int, int, "list[float] | None", list[float], str]


class _Recording(FeedForward):
    """A feed-forward that keeps what goes to its core."""

    heard: list[tuple[list[float] | None, list[float], str]]

    def _offer(self, optimum: Any, curvature: Any, cause: str) -> bool:
        self.heard.append((optimum, curvature, cause))
        return super()._offer(optimum, curvature, cause)

    def _hold(self) -> None:
        self.heard.append((None, [], "new_point"))
        super()._hold()


def answers_along(seeker: FeedForward, schedule: Sequence[tuple[int, Any]], cycles: int) -> list[Said]:
    """Ask the guide at every operating point of a schedule, for a loop that cannot ask it; the seeker stays as it is.

    A guide that held or refused is asked once more, and counts as saying the same until the next operating point.
    """
    asked: _Recording = seeker._as(_Recording, seeker.seeker, seeker.guide)
    out = list[Said]()
    ends = [first for first, _ in schedule[1:]] + [cycles]
    for (first, point), end in zip(schedule, ends, strict=True):
        for begin, stop in ((first, first + 1), (first + 1, end)):
            if begin >= min(stop, cycles):
                break
            asked.heard = []
            answer = asked.at(point)
            out += [(begin, begin + 1 if answer == "followed" else stop, *said) for said in asked.heard]
            if answer in ("same", "followed"):
                break
    return out
