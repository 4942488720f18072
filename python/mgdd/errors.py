"""The exceptions of mgdd: one tree, raised alike by the C++ core and by the Python layer.

Every message names the field or file, the value, and the bound or the remedy.

Examples
--------
>>> from mgdd.errors import DataError, Error
>>> issubclass(DataError, Error), issubclass(DataError, ValueError)
(True, True)
"""

from __future__ import annotations

from mgdd._core import ConvergenceError, DataError, Error, ParameterError, RigError, ShapeError

__all__ = ["ConvergenceError", "DataError", "Error", "ParameterError", "RigError", "ShapeError"]

for _error in (ConvergenceError, DataError, Error, ParameterError, RigError, ShapeError):
    _error.__module__ = __name__  # the public home, as tracebacks and pickles should name it
del _error
