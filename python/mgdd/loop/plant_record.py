"""What a loop kept of cycles, as columns and as a Dataset, of a bench and of any plant."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mgdd import _core
from mgdd.loop.plant import Measurement, Plant
from mgdd.results.labels import VARIABLES, Label, labelled_dataset, named_label

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mgdd.optimize import Seeker
    from mgdd.results.dataset import Dataset

FLAGS = {
    "misfire": "nothing burned",
    "clamped": "request outside the timing window",
    "unphysical": "no such cycle exists",
    "operating_point_changed": "speed or fuel moved by more than 5 %",
}
# Of the bench alone: files have an `egr` in percent too.
OWN_LABELS = {"egr": ("-", "recirculated exhaust gas, share of the charge's mass")}


def objective_label(weights: Mapping[str, float]) -> Label:
    """Give unit and name of J, a sum of weighted quantities; of J itself where it is unknown what it is made of."""
    if not weights:
        return VARIABLES["j"]
    (name, weight), *more = weights.items()
    first = named_label(name) if weight == 1.0 else Label("unit of J", name)
    if weight == 1.0 and not more:
        return first
    terms = " ".join(f"{each:+g} {term}" for term, each in weights.items())
    return Label(first.units, terms.removeprefix("+1 ").removeprefix("+"))


def weights_of(performance: _core.engine.Performance) -> dict[str, float]:
    """Give the weights of the quantities in J; none where a term is no plain multiple of one."""
    plain = all(term.reference == 1.0 and term.above is None for term in performance.terms)
    return {term.signal: term.weight for term in performance.terms} if plain else {}


def cycles_to_dataset(
    bench: _core.loop.VirtualEngine,
    columns: dict[str, Any],
    *,
    noise_free_limits: NDArray[np.float64] | None = None,
    more: Mapping[str, tuple[Any, ...]] = {},
) -> Dataset:
    """Label the columns of a run, with further ones that are labelled already."""
    settings = bench.settings
    names = [term.signal for term in settings["performance"].terms]
    total, seen = Counter(names), Counter[str]()
    terms = []
    for name in names:
        seen[name] += 1
        terms.append(name if total[name] == 1 else f"{name}_{seen[name]}")
    variables: dict[str, tuple[Any, ...]] = {"cycle": ("cycle", columns.pop("cycle")), **more}
    components, limits = columns.pop("components"), columns.pop("limits")
    for name, values in columns.items():
        flag = ("-", FLAGS[name]) if name in FLAGS and name not in VARIABLES else ()
        variables[name] = ("cycle", values, *OWN_LABELS.get(name, flag))
    variables["j"] = (*variables["j"][:2], *objective_label(weights_of(settings["performance"])))
    variables["component"] = ("component", terms, "-", "term of the performance")
    variables["components"] = (("cycle", "component"), components, "unit of J", "component of the performance")
    attrs = {"seed": bench.seed, "nox_sensor": settings["nox_sensor"]}
    return _with_limits(variables, settings["limits"], limits, noise_free_limits, attrs)


def _with_limits(
    variables: dict[str, tuple[Any, ...]],
    names: Sequence[str],
    measured: NDArray[np.float64],
    noise_free: NDArray[np.float64] | None,
    attrs: Mapping[str, Any] | None = None,
) -> Dataset:
    """Label cycles with their limited quantities, tables of cycle and limit."""
    if not names:
        return labelled_dataset(variables, attrs=attrs)
    units = [VARIABLES[name].units if name in VARIABLES else _UNKNOWN for name in names]
    over, own = ("cycle", "limit"), "unit of the limit"
    variables["limit"] = ("limit", list(names), "-", "limited quantity")
    variables["limit_units"] = ("limit", units, "-", own)
    variables["limits"] = (over, measured, own, "measured value of a limited quantity")
    if noise_free is not None:
        text = "noise-free value of a limited quantity at the applied inputs"
        variables["noise_free_limits"] = (over, noise_free, own, text)
    return labelled_dataset(variables, attrs=attrs).set_coords("limit_units")


_UNKNOWN = "not given by the plant"
VOID = "cycle that the seeker did not use"
_OWN = ("soc_requested_cad", "soc_applied_cad", "j", "misfire")  # columns that the loop itself knows


class Row(NamedTuple):
    """One measured cycle."""

    estimate: NDArray[np.float64]
    asked: NDArray[np.float64]
    applied: NDArray[np.float64]
    void: bool
    measured: Measurement


@dataclass(frozen=True, kw_only=True)
class Cycles:
    """The cycles of a run, a row each."""

    estimate: NDArray[np.float64]  # cycle, input
    asked: NDArray[np.float64]
    applied: NDArray[np.float64]
    j: NDArray[np.float64]
    components: NDArray[np.float64]  # cycle, component
    misfire: NDArray[np.bool_]
    void: NDArray[np.bool_]
    limits: Mapping[str, NDArray[np.float64]]
    values: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    noise_free: NDArray[np.float64] | None = None  # cycle, limit

    @classmethod
    def of(cls, log: Sequence[Row], inputs: int) -> Cycles:
        """Take the rows of a log; a value that is missing in some cycles is NaN there."""
        rows = [row.measured for row in log]
        width = max((len(row.components) for row in rows), default=1)
        components = np.full((len(rows), width), math.nan)
        for at, row in enumerate(rows):
            components[at, : len(row.components)] = row.components

        def columns(tables: list[Mapping[str, float]]) -> dict[str, NDArray[np.float64]]:
            names = dict.fromkeys(name for table in tables for name in table)
            return {name: np.array([table.get(name, math.nan) for table in tables]) for name in names}

        limits = columns([row.limits for row in rows])
        noise_free = None
        if any(row.noise_free_limits for row in rows):
            noise_free = np.array([[row.noise_free_limits.get(name, math.nan) for name in limits] for row in rows])
        return cls(
            estimate=np.array([row.estimate for row in log], np.float64).reshape(-1, inputs),
            asked=np.array([row.asked for row in log], np.float64).reshape(-1, inputs),
            applied=np.array([row.applied for row in log], np.float64).reshape(-1, inputs),
            j=np.array([row.performance for row in rows], np.float64),
            components=components,
            misfire=np.array([row.misfire for row in rows], np.bool_),
            void=np.array([row.void for row in log], np.bool_),
            limits=limits,
            values=columns([row.values for row in rows]),
            noise_free=noise_free,
        )


def cycles_given(seeker: Seeker, count: int) -> Cycles:
    """Take the last cycles from the history of a seeker, of a plant that applies what it is asked for."""
    history = {name: column[len(column) - count :] for name, column in seeker._history_columns().items()}
    missed = history["misfire"] != 0.0
    names = list(seeker.limit_names)
    return Cycles(
        estimate=history["estimate"], asked=history["applied"], applied=history["applied"], j=history["objective"],
        components=history["objective"][:, np.newaxis], misfire=missed, void=missed,
        limits={name: history["limits"][:, k] for k, name in enumerate(names)},
    )  # fmt: skip


def steered(
    inputs: tuple[str, ...], estimate: NDArray[np.float64], asked: NDArray[np.float64], applied: NDArray[np.float64]
) -> dict[str, tuple[Any, ...]]:
    """Label what a seeker thought and asked for, and what was applied, each a column per input."""
    over, unit = ("cycle", "input"), "unit of the input"
    return {
        "input": ("input", list(inputs), "-", "input of the plant"),
        "estimate": (over, estimate, unit, "estimate of the best input"),
        "asked": (over, asked, unit, "input that was asked for"),
        "applied": (over, applied, unit, "input that the plant applied"),
    }


def dataset_of(cycles: Cycles, first: int, plant: Plant, guided: Mapping[str, tuple[Any, ...]]) -> Dataset:
    """Label what was measured; a plant that counts its cycles numbers them, others from the first."""
    columns = dict(cycles.values)
    count = columns.pop("cycle", None)
    cycle = np.arange(first, first + cycles.j.size) if count is None or not np.isfinite(count).all() else count
    variables: dict[str, tuple[Any, ...]] = {
        "cycle": ("cycle", cycle.astype(np.int64)),
        **steered(plant.input_names, cycles.estimate, cycles.asked, cycles.applied),
        "j": ("cycle", cycles.j, *objective_label(getattr(plant, "objective", {}))),
        "misfire": ("cycle", cycles.misfire, "-", FLAGS["misfire"]),
        "void": ("cycle", cycles.void, "-", VOID),
        **guided,
    }
    for name, values in columns.items():
        if name in FLAGS and name not in _OWN:
            variables[name] = ("cycle", values == 1.0, "-", FLAGS[name])
        elif name not in _OWN:
            labels: dict[str, tuple[str, str]] = OWN_LABELS if "intake_o2_fraction" in columns else {}  # of a bench
            label: tuple[str, ...] = () if name in VARIABLES else labels.get(name, (_UNKNOWN, name))
            variables[name] = ("cycle", values, *label)
    width = cycles.components.shape[1]
    variables["component"] = ("component", np.arange(width), "-", "term of the performance")
    variables["components"] = (("cycle", "component"), cycles.components, "unit of J", "component of the performance")
    table = np.stack([*cycles.limits.values()] or [cycles.j], axis=1)
    return _with_limits(variables, list(cycles.limits), table, cycles.noise_free)
