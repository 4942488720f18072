"""Least squares and iterative learning control: numbers in, numbers out.

`IterativeLearning` improves the input of a repeated task from the error of each trial. `least_squares`, with bounds,
log-scaled parameters and an honest report, runs the Levenberg-Marquardt search of the C++ core on a Python function.
Every fit of this package, also those that never enter Python while they run, answers with a `FitReport`.

Examples
--------
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

from mgdd.optimize.fit_report import FitReport
from mgdd.optimize.iterative_learning import ConvergenceReport, IterativeLearning
from mgdd.optimize.least_squares import least_squares

__all__ = ["ConvergenceReport", "FitReport", "IterativeLearning", "least_squares"]
