"""Fixtures of all tests: where the repository stands, reproducible Hypothesis, figures without a screen."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

os.environ.setdefault("MPLBACKEND", "Agg")

# One terminal for all: what rich prints depends on these.
os.environ["TERM"] = "xterm"
for name in ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR"):
    os.environ.pop(name, None)

# A shell that runs the tests in the background has them ignore Ctrl-C, and their children too: some send it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples on every run and machine; no deadline, because sanitizer builds are slow.
hypothesis.settings.register_profile("reproducible", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("reproducible")


@pytest.fixture(autouse=True)
def _figures_are_closed() -> Iterator[None]:
    """Close what a test or an example drew: one process runs hundreds of them."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")


def _signals() -> tuple[object, ...]:
    return (
        signal.getsignal(signal.SIGINT),
        signal.getsignal(signal.SIGTERM),
        signal.pthread_sigmask(signal.SIG_BLOCK, ()),
    )


@pytest.fixture(autouse=True)
def _signals_are_left_as_found() -> Iterator[None]:
    """A handler that one test leaves behind takes the Ctrl-C of the next."""
    found = _signals()
    yield
    assert _signals() == found


@pytest.fixture
def no_thread_is_left() -> Iterator[None]:
    """Of a test that has to end the threads that it began."""
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) - before == set()


@pytest.fixture(scope="session")
def quick_study() -> Callable[..., Any]:
    """Return a function that gives a study by name with quick=True, run once for all tests and workers."""
    from study_cache import quick_study

    return quick_study


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the root of the repository."""
    return Path(__file__).resolve().parents[3]
