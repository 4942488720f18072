"""Seekers that find a best input from measurements alone, their tuner, iterative learning, and least squares.

A seeker proposes an input (``ask``) and accepts what was measured there (``tell``), one engine cycle at a time; it
never holds a plant, so simulation, replay and the test bench are the same loop. `tune` chooses amplitude, period
and gain from noise and curvature, `measure_map` reads those off measurements, ``run`` of a seeker closes the loop on a
function. `IterativeLearning` improves the input of a repeated task from the error of each trial. `least_squares` is
the Levenberg-Marquardt search behind every fit, which answers with a `FitReport`.

Examples
--------
>>> from mgdd.optimize import tune
>>> tuning = tune(0.25, -0.051, distance=12.0, arrival=1.0)
>>> seeker = tuning.seeker(start=-18.0, bounds=(-30.0, 10.0))
>>> history = seeker.run(lambda soi: 56.0 - 0.0255 * (soi[0] + 6.0) ** 2, 300)
>>> abs(seeker.estimate[0] + 6.0) < 0.1
np.True_

>>> import numpy as np
>>> from mgdd.optimize import least_squares
>>> t = np.linspace(0.0, 3.0, 40)
>>> y = 2.0 * np.exp(-0.8 * t) + 0.01 * np.cos(40.0 * t)
>>> def decay(p):
...     e = np.exp(-p[1] * t)
...     return p[0] * e - y, np.column_stack([e, -p[0] * t * e])
>>> fit = least_squares(decay, [1.0, 0.1], names=["amplitude", "rate"], data=y)
>>> fit.success, fit.unidentifiable
(True, ())
>>> np.abs(fit.values - [2.0, 0.8]).max() < 3.0 * fit.stderr.max()
np.True_
"""

from __future__ import annotations

from mgdd._core.optimize import ComponentLag, Input, Limit
from mgdd._rooms import furnish as _furnish
from mgdd.optimize.direct_seekers import ExtremumSeeking, GoldenSection, GradientDescent, Spsa
from mgdd.optimize.iterative_learning import IterativeLearning
from mgdd.optimize.least_squares import FitOptions, least_squares
from mgdd.optimize.map_seeking import MapSeeking
from mgdd.optimize.measured_map import measure_map
from mgdd.optimize.process_seeking import GaussianProcessSeeking
from mgdd.optimize.seeker import Seeker
from mgdd.optimize.tuning import tune

__all__ = [
    "ComponentLag", "ExtremumSeeking", "FitOptions", "GaussianProcessSeeking", "GoldenSection", "GradientDescent",
    "Input", "IterativeLearning", "Limit", "MapSeeking", "Seeker", "Spsa", "least_squares", "measure_map", "tune",
]  # fmt: skip

_furnish(__name__)
