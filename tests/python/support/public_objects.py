"""Modules and public classes of both packages, found by walking them, and an object of each class made simply."""

import contextlib
import doctest
import importlib
import inspect
import io
import pkgutil
import warnings
from functools import cache
from types import ModuleType
from typing import Any

import mgdd
import mgdd_studies
from mgdd import _core

SEEKING = {"start": 2.0, "bounds": (-30.0, 10.0)}
# Every package whose names are public, and every module.
ROOMS = sorted(f"mgdd.{m.name}" for m in pkgutil.iter_modules(mgdd.__path__) if not m.name.startswith("_"))
ROOMS.append("mgdd_studies")
MODULES = ["mgdd", "mgdd_studies"]
MODULES += [m.name for each in (mgdd, mgdd_studies) for m in pkgutil.walk_packages(each.__path__, f"{each.__name__}.")]
MODULES = sorted(name for name in MODULES if "._core" not in name and not name.endswith("__main__"))
ARGUMENTS: tuple[dict[str, Any], ...] = (
    {},
    SEEKING,
    {"bounds": (-30.0, 10.0)},
    {"start": 2.0},
    {"sample_s": 1e-3},
    {"upper": 90.0},
    {"name": "p_max_bar", "upper": 90.0},
)


def bound_classes(room: ModuleType = _core) -> dict[str, type]:
    """Give every class of the compiled module by its full name."""
    found: dict[str, type] = {}
    for name, member in vars(room).items():
        if inspect.ismodule(member) and member.__name__ == f"{room.__name__}.{name}":
            found |= bound_classes(member)
        elif inspect.isclass(member) and not issubclass(member, BaseException):
            found[f"{room.__name__}.{name}"] = member
    return found


def public_classes() -> dict[str, type]:
    """Give every class that a module lists or, without a list, defines, by its full name."""
    found: dict[type, str] = {}
    for module in MODULES:
        room = importlib.import_module(module)
        own = [name for name, member in vars(room).items() if getattr(member, "__module__", "") == module]
        for name in getattr(room, "__all__", own):
            member = getattr(room, name)
            if inspect.isclass(member) and not name.startswith("_") and not issubclass(member, BaseException):
                found.setdefault(member, f"{module}.{name}")
    return {name: member for member, name in found.items()}


def _by_arguments(cls: type) -> Any:
    for arguments in ARGUMENTS:
        with contextlib.suppress(Exception):
            return cls(**arguments)
    return None


def _by_example(cls: type) -> Any:
    """Give the last object of this class that the example in its documentation makes."""
    test = doctest.DocTestParser().get_doctest(cls.__doc__ or "", {}, cls.__name__, None, None)
    doctest.DocTestRunner(verbose=False).run(test, out=io.StringIO().write, clear_globs=False)
    return next((value for value in reversed(test.globs.values()) if type(value) is cls), None)


@cache
def public_objects() -> dict[str, Any]:
    """Give an object of every public class that its example, or a few usual arguments, make."""
    made: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, cls in public_classes().items():
            if cls.__init__ is object.__init__ and cls.__subclasses__():  # made through those only
                continue
            thing = None if inspect.isabstract(cls) else _by_arguments(cls)
            runs = hasattr(cls, "state") or hasattr(cls, "measure")
            if thing is None and runs and not hasattr(cls, "__enter__") and ".rig.can" not in name:
                thing = _by_example(cls)  # of what runs only: those of fits take long, those of buses open some
            if type(thing) is cls:
                made[name] = thing
    return made


def saved_state(thing: Any) -> Any:
    """Give the saved state of what runs, a property or what a method gives."""
    return thing.state() if callable(thing.state) else thing.state
