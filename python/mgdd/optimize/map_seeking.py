"""Seeking a whole map with one process over operating points and inputs."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError, ShapeError, argument
from mgdd.optimize.inputs import inputs_of, named_values, unit_of_input
from mgdd.optimize.map_driver import MapDriver
from mgdd.optimize.optimum import limits_of
from mgdd.optimize.process_seeking import surface_of
from mgdd.optimize.seeker import made_of_saved, write_saved
from mgdd.results.labels import labelled_dataset, named_label

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd._core.optimize import Input

_NODES = {1: 41, 2: 17, 3: 11, 4: 7}  # of a guide, per input
_OWN_NAMES = ("j", "j_sd", "regret", "excess", "limit", "holds", "readings", "failed")  # of cells and records
_REFUSED = ("J is not one number", "wrong number of limits", "a number that is not a reading: finite, within 1e30")


class Suggestion(NamedTuple):
    """Where to read next.

    Parameters
    ----------
    at : dict of str to float
        The operating point.
    inputs : dict of str to float
        The inputs there.
    gain : float
        By how much the reading is expected to raise J, summed over the cells [unit of J]; 0 while nothing is known.
    sd : float
        Standard deviation of J there before the reading [unit of J].
    """

    at: dict[str, float]
    inputs: dict[str, float]
    gain: float
    sd: float


class MapSeeking(_core.optimize.MapSeeking):
    """Seek the best inputs over operating points: one Gaussian process whose context is the operating point.

    A reading at one point teaches all others, by the model where there is one: its factor, its place and what it misses
    are smooth functions of point and inputs, and are learnt. `suggest` gives the point and inputs whose reading is
    expected to raise J of the whole map most, `ask` the inputs at a point that others choose, as on a drive; `cells` is
    the map so far. Without a `guide` the plain process runs on.

    Parameters
    ----------
    inputs : mapping of str to (float, float) or (float, float, float), or sequence of Input
        Bounds of every input, finite, and the step in which it is set.
    axes : mapping of str to array_like
        Numbers of the operating point with the entries of the map, strictly increasing, two at least; their ends bound
        the points of `ask`.
    limits : mapping of str to float, or sequence of Limit
        Measured quantities to keep, in every cell with `limit_probability` and in all of forty readings.
    guide : callable, fitted response or DataArray, optional
        What a model says of J, over axes and inputs: a callable takes all by name, as ``{"speed_rpm": ..., "soc_cad":
        ...}``. Up to five axes and inputs together.
    limit_guides : mapping of str to guides, optional
        The same of the limits.
    start : mapping of str to float, optional
        First inputs without a guide, where the limits hold in the middle of the map; the middle of the bounds if left
        out.
    noise_sd : float, optional
        Standard deviation of one reading of J, > 0 [unit of J]; learnt without.
    averaged : float
        Readings whose mean a visit gives.
    moving_cost : float
        Of another operating point, in visits: where it is high, several readings are taken at a point.
    memory_readings : float
        Readings in which the level of J is expected to wander by 1.2 noise deviations; how fast it does is learnt.
    horizon : float
        Readings for which what `ask` learns at a point pays.
    kept : int
        Readings at most, 10 to 500. Alike ones that follow each other are averaged.
    smoothness : float
        J that one squared bend of the map may cost, 0 for none: a second difference along an axis, in ranges of the
        input per squared mean step of the axis. The search visits what the smooth map needs.
    reach : float
        Under limits nothing is asked farther from the best inputs of a cell than this share of the bounds, nor twice as
        far beyond what was read.
    limit_probability : float
        In [0.5, 1).
    maximize : bool
        False to minimise J.
    seed : int
        Of the inputs that are compared.

    Raises
    ------
    mgdd.errors.ParameterError, mgdd.errors.ShapeError
        Axes, bounds, limits or guides that make no search; the message names the entry.

    See Also
    --------
    mgdd.loop.seek_map : the whole search on a plant.

    References
    ----------
    Krause and Ong (2011), Contextual Gaussian process bandit optimization.
    Frazier, Powell and Dayanik (2009), The knowledge-gradient policy for correlated normal beliefs.

    Examples
    --------
    >>> from mgdd.optimize import MapSeeking
    >>> def engine(x):
    ...     best = -2.0 - 0.003 * (x["speed_rpm"] - 1000) - 0.1 * (x["fuel_mg"] - 10)
    ...     return 40.0 - 0.05 * (x["soc_cad"] - best) ** 2
    >>> axes = {"speed_rpm": [1000, 1500, 2000, 2500], "fuel_mg": [10, 20, 30]}
    >>> rough = lambda x: engine({**x, "soc_cad": x["soc_cad"] + 3.0})
    >>> search = MapSeeking({"soc_cad": (-20.0, 10.0)}, axes, guide=rough)
    >>> for _ in range(4):
    ...     visit = search.suggest()
    ...     search.tell(visit.at, visit.inputs, engine({**visit.at, **visit.inputs}))
    >>> search.cells()["soc_cad"].values.round(1).tolist()[0]
    [-2.0, -3.0, -4.0]
    >>> bool(abs(search.ask({"speed_rpm": 1250, "fuel_mg": 15})["soc_cad"] + 3.25) < 0.2)
    True
    """

    def __init__(
        self,
        inputs: Mapping[str, tuple[float, ...]] | Sequence[Input],
        axes: Mapping[str, ArrayLike],
        *,
        limits: Any = (),
        guide: Any = None,
        limit_guides: Any = None,
        start: Mapping[str, float] | None = None,
        **settings: Any,
    ) -> None:
        sought = inputs_of(inputs)
        names = [one.name for one in sought]
        entries = entries_of(axes, names)
        if not names:
            raise ParameterError("inputs: none given; give bounds by name, for example {'soc_cad': (-20.0, 5.0)}")
        for one in sought:
            if not (math.isfinite(one.lower) and math.isfinite(one.upper)):
                raise ParameterError(f"inputs: {one.name} = ({one.lower:g}, {one.upper:g}): give finite bounds")
        kept = limits_of(limits)
        _require_apart(list(entries), names, [one.name for one in kept])
        over = {**entries, **input_nodes(sought)}
        given: dict[str, Any] = {}
        for which, one in {"guide": guide, **(limit_guides if isinstance(limit_guides, Mapping) else {})}.items():
            _require_over_inputs(which, one, names)
        if guide is not None:
            given["guide"] = [surface_of(guide, list(over), list(over.values()), argument="guide")]
        elif limit_guides:
            raise ParameterError("limit_guides: need a guide of J beside them: give `guide` too")
        if limit_guides:
            given["limit_guides"] = _limit_guides(limit_guides, [one.name for one in kept], over)
        middle = {one.name: 0.5 * (one.lower + one.upper) for one in sought} if start is None else start
        if "context" in settings:
            raise ParameterError.of("context", settings["context"], "left out: the axes are the context")
        context = [_core.optimize.Input(name, float(column[0]), float(column[-1])) for name, column in entries.items()]
        super().__init__(
            start=named_values("start", middle, names), inputs=list(sought), context=context,
            axes=[column.tolist() for column in entries.values()], limits=list(kept), **given, **settings,
        )  # fmt: skip

    @property
    def input_names(self) -> tuple[str, ...]:
        """What is sought."""
        return tuple(one.name for one in self.settings["inputs"])

    @property
    def limit_names(self) -> tuple[str, ...]:
        """What is limited."""
        return tuple(limit.name for limit in self.settings["limits"])

    @property
    def axes(self) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
        """Entries of every axis of the map, by name."""
        own = self.settings
        return {one.name: np.array(column) for one, column in zip(own["context"], own["axes"], strict=True)}

    def suggest(self) -> Suggestion:
        """Give the operating point and inputs of the next visit; asking again before `tell` gives the same.

        After a reading of a cell that lies far off what was expected it is the same visit once more, twice at most.

        Returns
        -------
        Suggestion
            Point, inputs, what the reading is expected to be worth, and what is not known there.
        """
        at, inputs, gain, sd = self._suggest()
        names = [one.name for one in self.settings["context"]]
        return Suggestion(
            dict(zip(names, at.tolist(), strict=True)), dict(zip(self.input_names, inputs.tolist(), strict=True)),
            gain, sd,
        )  # fmt: skip

    def ask(self, at: Mapping[str, float]) -> dict[str, float]:
        """Give the inputs of the next reading at an operating point.

        Parameters
        ----------
        at : mapping of str to float
            The point, within the ends of the axes.

        Returns
        -------
        dict of str to float
            The inputs that are worth most there: by J, and by what they teach.

        Raises
        ------
        mgdd.errors.ParameterError
            A number of the point is missing or lies outside of its axis.
        """
        return dict(zip(self.input_names, self._ask(self._context(at)).tolist(), strict=True))

    def tell(
        self,
        at: Mapping[str, float],
        inputs: Mapping[str, float],
        J: float | None = None,  # noqa: N803
        limits: Mapping[str, float] | Sequence[float] | None = None,
        *,
        misfire: bool = False,
        readings: float = 1.0,
        sd: Mapping[str, float] | None = None,
    ) -> None:
        """Accept what was read at a point with these inputs; a refused reading changes nothing.

        Parameters
        ----------
        at, inputs : mapping of str to float
            The operating point and what was really applied there.
        J : float
            What was read, or the mean of several readings.
        limits : mapping of str to float, or sequence
            Values of the limited quantities.
        misfire : bool
            The visit gave no reading: the engine failed there.
        readings : float
            How many readings `J` and `limits` are the mean of.
        sd : mapping of str to float, optional
            Standard deviations of these readings, of ``"j"`` and the limits: no reading is taken for surer than
            that. Without them their noise is learnt of what the means do not explain.

        Raises
        ------
        mgdd.errors.ParameterError
            A point or inputs with missing, unknown or non-finite numbers.
        mgdd.errors.DataError
            J or limits that are not readings.
        """
        context = self._context(at)
        names = self.input_names
        applied = np.array(_numbers("inputs", inputs, names))
        held = self.limit_names
        values = [0.0] * len(held)
        if not misfire:
            given = _numbers("limits", limits, held) if isinstance(limits, Mapping) else limits
            values = [float(x) for x in (given if given is not None else ())]
            if J is None or not math.isfinite(J):
                raise DataError.of("J", J, "finite; say misfire=True where the engine failed")
            if len(values) != len(held):
                raise ShapeError(f"limits has {len(values)} entries: must be {', '.join(held) or 'left out'}")
        if not readings > 0.0 or not math.isfinite(readings):
            raise ParameterError.of("readings", readings, "> 0, how many the mean is of")
        own = [0.0] * (1 + len(held))
        if sd is not None:
            own = _numbers("sd", sd, ["j", *held])
            if min(own) < 0.0:
                raise ParameterError.of("sd", dict(sd), ">= 0")
        told = 0.0 if misfire else float(J or 0.0)
        status = self._tell(context, applied, told, values, misfire, float(readings), own)
        if status > 1:
            raise DataError(f"J = {J!r}, limits = {values}: {_REFUSED[min(status - 3, 2)]}")

    def driver(self) -> MapDriver:
        """Give a seeker for an engine that is driven through operating points; all it reads this search learns."""
        return MapDriver(self)

    def cells(self) -> xr.Dataset:
        """Give the map as it is known now.

        Returns
        -------
        xarray.Dataset
            Over the axes: the best of every input and ``NAME_sd``, ``j`` there, ``j_sd``, ``regret`` (by which the true
            best is expected to be above), ``excess`` of the worst limit with its probability in shares of it (above 0
            where no input is known to be safe), and ``holds`` over ``limit``, the probability of each.
        """
        own, axes, held = self.settings, self.axes, self.limit_names
        shape = tuple(column.size for column in axes.values())
        rows = self._cells()
        variables: dict[str, tuple[Any, ...]] = {
            name: (name, column, *named_label(name)) for name, column in axes.items()
        }
        for k, one in enumerate(own["inputs"]):
            unit, text = unit_of_input(one), named_label(one.name).long_name
            variables[one.name] = (tuple(axes), np.reshape([row[1][k] for row in rows], shape), unit, text)
            sd = np.reshape([row[2][k] for row in rows], shape)
            variables[f"{one.name}_sd"] = (tuple(axes), sd, unit, f"standard deviation of the best {text}")
        texts = ("objective", "standard deviation of the objective", "expected regret")
        for place, (name, text) in enumerate(zip(("j", "j_sd", "regret"), texts, strict=True), start=3):
            variables[name] = (tuple(axes), np.reshape([row[place] for row in rows], shape), "unit of J", text)
        excess = np.maximum(np.reshape([row[6] for row in rows], shape), -1.0)  # without limits far below it
        variables["excess"] = (tuple(axes), excess, "-", "excess over the worst limit, share of it")
        if held:
            variables["limit"] = ("limit", list(held), "-", "limited quantity")
            variables["holds"] = (
                (*axes, "limit"), np.reshape([row[7] for row in rows], (*shape, len(held))), "-",
                "probability that the limit holds",
            )  # fmt: skip
        return labelled_dataset(variables)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write settings and state as JSON; `load` goes on from there bit for bit."""
        write_saved(path, "MapSeeking", self.settings, self.state)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a search back that `save` wrote; DataError for any other file."""
        made: Self = made_of_saved(path, {"MapSeeking": cls}, _remade)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), self.settings, self.state)

    def __repr__(self) -> str:
        size = " x ".join(f"{column.size} {name}" for name, column in self.axes.items())
        return f"<MapSeeking of {', '.join(self.input_names)} over {size}, {self.readings} readings>"

    def _context(self, at: Mapping[str, float]) -> np.ndarray[Any, np.dtype[np.float64]]:
        own = self.settings["context"]
        numbers = _numbers("at", at, [one.name for one in own])
        for one, value in zip(own, numbers, strict=True):
            if not one.lower <= value <= one.upper:
                raise ParameterError(
                    f"at: {one.name} = {value:g}: must be in [{one.lower:g}, {one.upper:g}], the ends of its axis"
                )
        return np.array(numbers)


def input_nodes(inputs: Sequence[Input]) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Give the values of every input at which a guide is asked."""
    count = _NODES.get(len(inputs), 5)
    return {one.name: np.linspace(one.lower, one.upper, count) for one in inputs}


def entries_of(axes: Any, inputs: Sequence[str]) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Read the axes of a map, two entries at least, none of them called as an input."""
    if not isinstance(axes, Mapping) or not axes:
        raise ParameterError.of(
            argument("axes"), axes, "names with their entries, for example {'fuel_mg': [6, 20, 40]}"
        )
    out = {}
    for name, entries in axes.items():
        column = np.array(entries, ndmin=1)
        numbers = column.ndim == 1 and column.dtype.kind in "iuf" and column.size > 1
        if not numbers or not np.isfinite(column).all() or not (np.diff(column) > 0.0).all():
            raise ParameterError.of(
                f"{argument('axes')} of {name}", column.tolist(), "two entries at least, finite numbers, increasing"
            )
        out[str(name)] = column.astype(np.float64)
    if twice := [name for name in inputs if name in out]:
        raise ParameterError(f"{argument('inputs')}: {', '.join(twice)} is an axis too: name it in one of them")
    return out


def _require_apart(axes: Sequence[str], inputs: Sequence[str], limits: Sequence[str]) -> None:
    """Refuse names by which the map says something else."""
    own = {*_OWN_NAMES, *(f"{name}_sd" for name in inputs)}
    for what, names, others in (("axes", axes, ()), ("inputs", inputs, ()), ("limits", limits, [*axes, *inputs])):
        for name in names:
            if name in own or name in others:
                meant = "an axis or an input" if name in others else "a number of every cell or visit"
                raise ParameterError.of(f"{argument(what)}: name", name, f"another one: {meant} is called so")


def _require_over_inputs(name: str, guide: Any, inputs: Sequence[str]) -> None:
    """Refuse a map over operating points alone: of every input it says the same."""
    axes = getattr(guide, "axes", None)
    if isinstance(axes, Mapping) and not set(axes) & set(inputs):
        raise ParameterError.of(
            name, guide,
            f"a model over {', '.join(inputs)} too, and this map says where the best input lies: give the model that "
            "it was made with, or go on from its search with seeker=",
        )  # fmt: skip


def _limit_guides(given: Any, limits: Sequence[str], over: Mapping[str, Any]) -> list[Any]:
    if not isinstance(given, Mapping):
        raise ParameterError.of("limit_guides", given, "guides by the names of limits")
    unknown = [name for name in given if name not in limits]
    if unknown:
        raise ParameterError(f"limit_guides names {', '.join(unknown)}: the limits are {', '.join(limits) or 'none'}")
    return [
        surface_of(given.get(name), list(over), list(over.values()), argument=f"limit_guides[{name}]")
        for name in limits
    ]


def _numbers(argument: str, given: Any, names: Sequence[str]) -> list[float]:
    if not isinstance(given, Mapping) or set(given) != set(names):
        have = ", ".join(map(str, given)) if isinstance(given, Mapping) else repr(given)
        raise ParameterError(f"{argument} has {have or 'nothing'}: must have one number for each of {', '.join(names)}")
    values = [float(given[name]) for name in names]
    for name, value in zip(names, values, strict=True):
        if not math.isfinite(value):
            raise ParameterError.of(f"{argument}: {name}", value, "finite")
    return values


def _remade(cls: type[Any], settings: dict[str, Any], state: dict[str, Any]) -> Any:
    made: Any = cls.__new__(cls)  # type: ignore[call-overload]
    _core.optimize.MapSeeking.__init__(made, **settings)
    made.state = state
    return made
