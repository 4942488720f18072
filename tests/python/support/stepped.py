"""Every seeker that is stepped by ask and tell, found in the package: each class and each form of it."""

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

import mgdd.guide
import mgdd.optimize
from mgdd.errors import ParameterError, ShapeError
from mgdd.guide import Curve
from mgdd.optimize import Seeker

# What has no default, or says what a plant is like: as a user of the quadratic of these tests would give it.
GIVEN: dict[str, Any] = {
    "curve": Curve.parabola(curvature=-0.06, best=0.0, reach=60.0),
    "noise_sd": 0.3,
}
NEEDS = {"CurveSeeking": "curve", "GoldenSection": "noise_sd"}


def classes() -> dict[str, type[Any]]:
    """Find the classes of the public modules."""
    public = [getattr(module, name) for module in (mgdd.optimize, mgdd.guide) for name in module.__all__]
    return {
        one.__name__: one for one in public if inspect.isclass(one) and issubclass(one, Seeker) and one is not Seeker
    }


def forms_of(cls: type[Any], settings: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Give the settings of each form; a refusal names them all."""
    if "form" not in cls(**settings).settings:
        yield settings
        return
    try:
        cls(**settings, form="?")
    except ParameterError as refusal:
        for form in re.findall(r"\w+", str(refusal).partition("one of")[2]):
            yield {**settings, "form": form}


def stepped(**space: Any) -> dict[str, Callable[[], Any]]:
    """Make one of each class and form over this space; of several inputs, of those that seek several."""
    out: dict[str, Callable[[], Any]] = {}
    n = len(space["start"]) if isinstance(space["start"], Mapping) else np.size(space["start"])
    for name, cls in classes().items():
        own = {NEEDS[name]: GIVEN[NEEDS[name]]} if name in NEEDS else {}
        takes = inspect.signature(cls).parameters
        if n > 1 and "harmonics" in takes:
            own |= {"period": 40, "harmonics": [4, 5, 7][:n]}
        try:
            cls(**space, **own)
        except ShapeError as refusal:
            if n == 1 or "one input" not in str(refusal):
                raise
            continue
        for settings in forms_of(cls, {**space, **own}):
            label = f"{name} {settings.get('form', '')}".strip()
            out[label] = lambda cls=cls, settings=settings: cls(**settings)
    return out
