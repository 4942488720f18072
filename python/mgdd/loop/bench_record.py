"""The cycles of the virtual bench as a labelled Dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mgdd import _core
from mgdd.loop.limit_figures import noise_free_variable
from mgdd.results.labels import VARIABLES, labelled_dataset

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mgdd.results.dataset import Dataset

__all__ = ["FLAGS", "OWN_LABELS", "cycles_to_dataset"]

FLAGS = {
    "misfire": "nothing burned",
    "clamped": "request outside the timing window",
    "unphysical": "no such cycle exists",
    "operating_point_changed": "speed or fuel moved by more than 5 %",
}
# Of the bench alone: files have an `egr` in percent too.
OWN_LABELS = {"egr": ("-", "recirculated exhaust gas, share of the charge's mass")}


def cycles_to_dataset(
    bench: _core.loop.EngineBench,
    columns: dict[str, Any],
    *,
    noise_free_limits: NDArray[np.float64] | None = None,
    more: Mapping[str, tuple[Any, ...]] = {},
) -> Dataset:
    """Label the columns of a run, with further ones that are labelled already."""
    settings = bench.settings
    terms = _unique([term.signal for term in settings["performance"].terms])
    variables: dict[str, tuple[Any, ...]] = {"cycle": ("cycle", columns.pop("cycle")), **more}
    components, limits = columns.pop("components"), columns.pop("limits")
    for name, values in columns.items():
        flag = ("-", FLAGS[name]) if name in FLAGS and name not in VARIABLES else ()
        variables[name] = ("cycle", values, *OWN_LABELS.get(name, flag))
    variables["component"] = ("component", terms, "-", "term of the performance")
    variables["components"] = (("cycle", "component"), components, "unit of J", "component of the performance")
    names = settings["limits"]
    if names:
        units = {name: label.units for name, label in VARIABLES.items()}
        own = "unit of the limit"
        variables["limit"] = ("limit", names, "-", "limited quantity")
        variables["limit_units"] = ("limit", [units[name] for name in names], "-", own)
        variables["limits"] = (("cycle", "limit"), limits, own, "measured value of a limited quantity")
        if noise_free_limits is not None:
            variables["noise_free_limits"] = noise_free_variable(noise_free_limits)
    out = labelled_dataset(variables, attrs={"seed": bench.seed, "nox_sensor": settings["nox_sensor"]})
    return out.set_coords("limit_units") if names else out


def _unique(names: Sequence[str]) -> list[str]:
    """Add a number to the names that occur more than once."""
    total, seen = Counter(names), Counter[str]()
    out = []
    for name in names:
        seen[name] += 1
        out.append(name if total[name] == 1 else f"{name}_{seen[name]}")
    return out
