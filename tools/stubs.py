"""Stubs of the core by pybind11-stubgen, from the signatures in the docstrings: `inspect` knows names, but no kinds."""

import inspect
import runpy
from typing import Any

from pybind11_stubgen.parser.mixins.filter import FilterClassMembers
from pybind11_stubgen.structs import Identifier

_of_python = inspect.getfullargspec


def _with_kinds(function: Any) -> inspect.FullArgSpec:
    if not inspect.isfunction(function):
        raise TypeError("its docstring says more")
    return _of_python(function)


if __name__ == "__main__":
    inspect.getfullargspec = _with_kinds
    # Every class has it, with the types of `object`.
    FilterClassMembers._FilterClassMembers__method_blacklist.add(Identifier("__reduce__"))  # type: ignore[attr-defined]
    runpy.run_module("pybind11_stubgen", run_name="__main__", alter_sys=True)
