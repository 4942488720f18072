"""Functions that take arrays take whatever `numpy.asarray` takes, and give the same numbers for each form."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import mgdd
from array_calls import CALLS, MORE, Array


def strided(values: Array) -> Array:
    out = np.repeat(values, 2)[::2]
    out.flags.writeable = False
    return out


def unaligned(values: Array) -> Array:
    """Begin at an odd byte, as an array over a buffer that another process sent."""
    out = np.frombuffer(b"\0" + values.tobytes(), values.dtype, offset=1)
    assert not out.flags.aligned
    return out


FORMS: dict[str, Callable[[Array], Any]] = {
    "list": lambda values: values.tolist(),
    "tuple": lambda values: tuple(values.tolist()),
    "series": lambda values: pd.Series(values, index=np.arange(values.size) + 1000),
    "dataarray": lambda values: xr.DataArray(values, dims="sample", coords={"sample": np.arange(values.size) + 1000}),
    "read-only strided": strided,
    "unaligned": unaligned,
    "scalars of numpy": list,
}


def takers() -> Iterable[str]:
    """Public functions and methods that say ArrayLike, protocols and constructors of results left out."""
    for module in mgdd.__all__:
        room = importlib.import_module(f"mgdd.{module}") if module != "__version__" else None
        for name in getattr(room, "__all__", ()):
            thing = getattr(room, name)
            members = vars(thing).items() if inspect.isclass(thing) else [("", thing)]
            for key, member in members:
                function = getattr(member, "__func__", member)
                annotations = getattr(function, "__annotations__", {}) if callable(function) else {}
                if any("ArrayLike" in str(note) for what, note in annotations.items() if what != "return"):
                    yield f"{module}.{name}.{key}".rstrip(".")


def test_every_taker_of_arrays_is_here() -> None:
    found = {name for name in takers() if not name.startswith("results.FitReport.")}
    assert set(CALLS) == found


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", [*CALLS, *MORE])
def test_every_form_gives_the_same_numbers(name: str, form: str) -> None:
    call, arrays = (CALLS | MORE)[name]
    before = [values.copy() for values in arrays]
    expected = call(*arrays)
    given = [FORMS[form](values) for values in arrays]
    found = call(*given)
    np.testing.assert_equal(found, expected)
    for values, copy, own in zip(arrays, before, given, strict=True):
        np.testing.assert_array_equal(values, copy)
        np.testing.assert_array_equal(np.asarray(own), copy)
