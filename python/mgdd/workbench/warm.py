"""What the process that forks all work has imported before: one cycle is simulated, checked and drawn by it."""

from __future__ import annotations

import threading

_BEFORE = threading.active_count()  # one there, more where all modules are imported by turns

import scipy.signal  # noqa: E402
import scipy.stats  # noqa: E402, F401 - half of the time of the first analysis

from mgdd import engine, identify, plot  # noqa: E402, F401 - modules come on use
from mgdd.workbench import work  # noqa: E402, F401 - what is forked finds it here

_CYCLE = engine.simulate("puma_single")
engine.check_pressure(_CYCLE, "puma_single")
plot.pressure(_CYCLE).figure.canvas.draw()
if threading.active_count() > _BEFORE:
    raise RuntimeError("threads do not survive a fork: warm up with less")
