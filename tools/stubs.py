"""Stubs of the core by pybind11-stubgen, from the signatures in the docstrings: `inspect` knows names, but no kinds."""

import inspect
import runpy
from typing import Any

_of_python = inspect.getfullargspec


def _with_kinds(function: Any) -> inspect.FullArgSpec:
    if not inspect.isfunction(function):
        raise TypeError("its docstring says more")
    return _of_python(function)


if __name__ == "__main__":
    inspect.getfullargspec = _with_kinds
    runpy.run_module("pybind11_stubgen", run_name="__main__", alter_sys=True)
