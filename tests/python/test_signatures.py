"""One name of an argument has one meaning in every public signature, which is found here by the code."""

import dataclasses
import importlib
import inspect
from collections.abc import Iterator

import pytest

from public_objects import ROOMS

# `lower` and `upper` are fields of a record, one number each, as a file holds them; what bounds a search is `bounds`.
RECORDS = {"mgdd.control.Mgdd1"}  # beside dataclasses and classes with `fields`
HAND_WRITTEN = {"Experiment", "SignalMap"}  # files that people write: loaded, not saved
DATA = {"self", "trace", "traces", "cycle", "cycles", "nox_ppm"}  # may come before the cylinder that they are of


def signatures() -> Iterator[tuple[str, dict[str, inspect.Parameter]]]:
    """Every public function, constructor and method with its parameters; of records the methods alone."""
    for room in ROOMS:
        module = importlib.import_module(room)
        for name in module.__all__:
            thing, full = getattr(module, name), f"{room}.{name}"
            calls = {full: thing}
            if inspect.isclass(thing):
                own = [m for m in dir(thing) if not m.startswith("_")]
                calls = {f"{full}.{m}": getattr(thing, m) for m in own}
                if not (dataclasses.is_dataclass(thing) or hasattr(thing, "fields") or full in RECORDS):
                    calls[full] = thing
            for called, call in calls.items():
                if callable(call) and getattr(call, "__module__", "").startswith("mgdd"):
                    try:
                        yield called, dict(inspect.signature(call).parameters)
                    except ValueError:  # a method of the core, which says in its docstring what it takes
                        continue


FOUND = dict(signatures())


def of(name: str) -> dict[str, str]:
    return {call: str(taken[name].annotation) for call, taken in FOUND.items() if name in taken}


def test_there_are_signatures() -> None:
    assert len(FOUND) > 400
    assert {"mgdd.optimize.Spsa", "mgdd.optimize.least_squares", "mgdd.guide.CurveSeeking"} <= set(of("bounds"))


def test_bounds_are_one_argument() -> None:
    """As SciPy has them: a pair, or pairs by name."""
    assert of("lower") == of("upper") == {}
    named = {name for taken in FOUND.values() for name in taken if name.startswith("bounds")}
    forms = {call: form for name in named for call, form in of(name).items() if form != str(inspect.Parameter.empty)}
    assert [call for call, form in forms.items() if not ("tuple[" in form or form.startswith("Bounds"))] == []


@pytest.mark.parametrize(("name", "meaning"), [("points", ""), ("traces", "Sequence"), ("seeds", "Iterable[int]")])
def test_a_plural_holds_what_it_names(name: str, meaning: str) -> None:
    """Neither a switch (`pointwise`, `keep_traces`) nor a number of them (`n_points`, `n_seeds`)."""
    forms = of(name)
    assert forms
    assert [call for call, form in forms.items() if form.removesuffix(" | None") in ("bool", "int")] == []
    assert {form for form in forms.values() if meaning not in form} == set()


def test_a_cylinder_is_called_so_and_comes_first() -> None:
    """Before it stand the data that a function reads, and nothing else."""
    calls = {call: list(taken) for call, taken in FOUND.items() if "cylinder" in taken}
    assert len(calls) > 10
    assert {call: names for call, names in calls.items() if not set(names[: names.index("cylinder")]) <= DATA} == {}
    wrong = [
        f"{call}({name})"
        for call, taken in FOUND.items()
        for name, each in taken.items()
        if str(each.annotation) in ("CylinderLike", "Cylinder") and name != "cylinder"
    ]
    assert wrong == []


def test_what_is_loaded_was_saved() -> None:
    """`load` reads what `save` of the same class wrote; formats of others have `read` and `write`."""
    classes = {call.rpartition(".")[0] for call in FOUND if call.endswith(".load")} - {"mgdd.presets"}
    assert len(classes) > 8
    assert {name.rpartition(".")[2] for name in classes if f"{name}.save" not in FOUND} == HAND_WRITTEN
