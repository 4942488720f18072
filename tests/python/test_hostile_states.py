"""A saved state with numbers that no run can have made is refused, or the run goes on; the process never ends."""

import contextlib
import copy
import itertools
import os
import re
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from public_objects import public_objects, saved_state

HOSTILE = (-1.0, -1e9 - 3, 4e15, 3e5 + 1, 2.0**53, 17.5, -(2.0**53), 1e300)
WHOLE_S = 300.0  # of the processor for the states of one class: time that a loaded machine adds does not count


def runs() -> dict[str, Any]:
    """Give an object of every class that has a state to set."""
    return {
        name: thing
        for name, thing in public_objects().items()
        if hasattr(thing, "restore") or getattr(getattr(type(thing), "state", None), "fset", None) is not None
    }


def drive(thing: Any, cycles: int = 12) -> None:
    """Run a seeker, a controller, a plant or a gate for some cycles."""
    for k in range(cycles):
        if hasattr(thing, "ask"):
            asked = np.ravel(thing.ask())
            thing.tell(-0.025 * float(np.sum((asked - 6.0) ** 2)), misfire=k % 5 == 3)
        elif hasattr(thing, "apply"):
            thing.apply(dict.fromkeys(thing.input_names, 0.1))
            thing.measure()
        elif hasattr(thing, "restore"):
            thing.update(0.1, 10.0 + 0.1 * k)
        elif hasattr(thing, "command"):
            thing.observe(good_frames=1, age_s=0.0)
            thing.command(0.1)
        elif hasattr(thing, "step"):
            with contextlib.suppress(TypeError):
                thing.step(20.0, 10.0 + 0.1 * k)
                continue
            thing.step(-6.0)


def hostile(state: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Give the state with one column at a time replaced, as told and with an input that was asked.

    Of columns that differ by a number in their name, as those of hypotheses do, the first and the last.
    """
    alike: dict[str, list[str]] = {}
    for key in state:
        alike.setdefault(re.sub(r"\d+", "#", key), []).append(key)
    for key in dict.fromkeys(key for keys in alike.values() for key in (keys[0], keys[-1])):
        column = state[key]
        if 0 < len(column) <= 32:
            for value in HOSTILE:
                for asked in (False, True) if "asked" in state else (False,):
                    yield {**state, key: [value] * len(column), **({"asked": [1.0]} if asked else {})}


def survives(make: Any, most: int) -> tuple[int, int, int]:
    """Try so many states at most in a child process: states tried, how many were taken, and how the child ended."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.setitimer(signal.ITIMER_PROF, WHOLE_S)
        tried = taken = 0
        with contextlib.suppress(BaseException):
            thing = make()
            with contextlib.suppress(Exception):
                drive(thing)
            state = dict(saved_state(thing))
            every = 1 + sum(1 for _ in hostile(state)) // most
            for changed in itertools.islice(hostile(state), 0, None, every):
                tried += 1
                with contextlib.suppress(Exception):
                    two = make()
                    if hasattr(two, "restore"):
                        two.restore(changed)
                    else:
                        two.state = changed
                    taken += 1
                    if changed.get("asked") == [1.0] and hasattr(two, "tell"):
                        two.tell(1.0)
                    drive(two)
        os.write(write, f"{tried} {taken}".encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as said:
        numbers = said.read().split()
    ended = os.waitpid(pid, 0)[1]
    return (int(numbers[0]), int(numbers[1]), ended) if numbers else (0, 0, ended)


def check(most: int) -> int:
    ended: dict[str, str] = {}
    total = 0
    for name, thing in runs().items():
        tried, _, how = survives(lambda thing=thing: copy.deepcopy(thing), most)
        if os.WIFSIGNALED(how) or how:
            ended[name] = f"signal {os.WTERMSIG(how)}" if os.WIFSIGNALED(how) else f"status {how}"
        total += tried
    assert not ended
    return total


def test_impossible_numbers_do_not_end_the_process() -> None:
    assert len(runs()) > 15
    assert check(most=20) > 200


@pytest.mark.slow
def test_thousands_of_hostile_states_do_not_end_the_process() -> None:
    """Over 5000 under the sanitizers, where a read beside its memory shows; a quarter elsewhere."""
    share = 1 if "libasan" in os.environ.get("LD_PRELOAD", "") else 4
    assert check(most=700 // share) > 5000 // share
