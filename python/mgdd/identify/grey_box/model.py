"""What models of the user's own functions share: parameters, inputs between the samples, a file."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError, ShapeError
from mgdd.io.parameters import FIT_NOTES, Entry, ParameterFile, Wanted, entries, written
from mgdd.results.labels import VARIABLES, Label
from mgdd.results.units import unit_of
from mgdd.signals.even_grid import even_step
from mgdd.signals.model import RunInputs, SampledModel

Interpolation = Literal["hold", "linear", "cubic"]


@dataclass(frozen=True)
class Acting:
    """Inputs at the samples, (n, inputs), and at begin, middle and end of every step, (steps, 3, inputs).

    Where they differ between the m columns of a run, they have a last axis of length m; so have the times then.
    """

    time_s: NDArray[np.float64]
    samples: NDArray[np.float64]
    steps: NDArray[np.float64]
    substeps: int
    step_s: float

    def held(self) -> NDArray[np.float64]:
        """Return the input of every sample as it acts until the next one, shape (n, inputs) or (n, inputs, m)."""
        whole: NDArray[np.float64] = np.concatenate([self.steps[:: self.substeps, 0], self.samples[-1:]])
        return whole

    def stretches(self, length: int, columns: int) -> Acting:
        """Cut into stretches of `length` samples and the one after, `columns` columns for each, side by side.

        What lies beyond the end of the record repeats its last sample.
        """
        n = self.time_s.shape[0]
        first = length * np.arange(-(-n // length))
        at = np.minimum(first + np.arange(length + 1)[:, None], n - 1)
        step = self.substeps * first + np.arange(self.substeps * length)[:, None]

        def side_by_side(rows: NDArray[np.float64], ndim: int) -> NDArray[np.float64]:
            """Move the stretches, the second axis, behind the input, before the columns."""
            moved = np.moveaxis(rows, 1, ndim)
            if moved.ndim == ndim + 1:
                moved = np.repeat(moved[..., None], columns, axis=-1)
            return np.ascontiguousarray(moved.reshape(*moved.shape[:ndim], -1))

        samples = side_by_side(self.samples[at], 2)
        steps = side_by_side(self.steps[np.minimum(step, len(self.steps) - 1)], 3)
        return Acting(side_by_side(self.time_s[at], 1), samples, steps, self.substeps, self.step_s)


@dataclass(frozen=True)
class Drive:
    """Sampled inputs, shape (samples, inputs), and what lies between the samples."""

    time_s: NDArray[np.float64]
    inputs: NDArray[np.float64]
    substeps: int
    interpolation: Interpolation

    def __post_init__(self) -> None:
        known = ("hold", "linear", "cubic")
        ParameterError.unless(self.interpolation in known, "interpolation", self.interpolation, f"one of {known}")
        if self.interpolation == "cubic" and self.time_s.size < 4:
            raise ShapeError(f"interpolation = 'cubic': needs 4 samples, the record has {self.time_s.size}")

    @property
    def step_s(self) -> float:
        """Length of an integration step."""
        return even_step(self.time_s) / self.substeps

    def acting(self, delay_s: float | NDArray[np.float64]) -> Acting:
        """Return what acts of the inputs; a delay for each of m columns adds an axis of length m.

        Of inputs that are held a step sees their mean over it, so that what a delay does is continuous.
        """
        several, which = np.unique(delay_s, return_inverse=True)
        each = [self._late(float(one)) for one in several]
        samples, steps = each[0]
        if len(each) > 1:
            samples, steps = (np.stack(parts, axis=-1)[..., which] for parts in zip(*each, strict=True))
        return Acting(self.time_s, samples, steps, self.substeps, self.step_s)

    def _late(self, delay_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        from scipy.interpolate import make_interp_spline

        n = (self.time_s.size - 1) * self.substeps
        ends = self.time_s[0] + self.step_s * np.arange(n + 1) - delay_s
        if self.interpolation != "hold":
            spline = make_interp_spline(self.time_s, self.inputs, k=1 if self.interpolation == "linear" else 3)
            first, last = self.time_s[0], self.time_s[-1]
            middles = 0.5 * (ends[:-1] + ends[1:])
            samples, *nodes = (
                spline(np.clip(at, first, last)) for at in (self.time_s - delay_s, ends[:-1], middles, ends[1:])
            )
            return samples, np.stack(nodes, axis=1)
        if delay_s == 0.0:
            held = np.repeat(self.inputs[:-1], self.substeps, axis=0)
            return self.inputs, np.repeat(held[:, None], 3, axis=1)
        knots = np.concatenate([[self.time_s[0] - delay_s - 1.0], self.time_s, [self.time_s[-1] + 1.0]])
        areas = np.vstack([self.inputs[:1], self.inputs]) * np.diff(knots)[:, None]
        whole = np.vstack([np.zeros_like(areas[:1]), np.cumsum(areas, axis=0)])
        until = np.column_stack([np.interp(ends, knots, column) for column in whole.T])
        mean = np.diff(until, axis=0) / self.step_s
        at = np.searchsorted(self.time_s, self.time_s - delay_s, side="right") - 1
        return self.inputs[np.maximum(at, 0)], np.repeat(mean[:, None], 3, axis=1)


Rows = Callable[..., NDArray[np.float64]]
_TWO = 1e-3  # relative difference of the two columns of a check


def rows_of(function: Callable[..., Any], name: str, rows: int, *, vectorized: bool, timed: bool = False) -> Rows:
    """Return a function that gives (rows, m) for the m columns of its last argument; ShapeError says what it gave.

    A timed one has the time first, a number or (m,).
    """

    def whole(*given: Any) -> NDArray[np.float64]:
        return _rows(function(*given), name, rows, given[-1].shape[1])

    def one_by_one(*given: Any) -> NDArray[np.float64]:
        out = np.empty((rows, given[-1].shape[1]))
        of_columns = [np.ndim(each) > (1 if k or not timed else 0) for k, each in enumerate(given)]
        for i in range(out.shape[1]):
            own = (each[..., i] if several else each for each, several in zip(given, of_columns, strict=True))
            out[:, i] = _rows(function(*own), name, rows, 1)[:, 0]
        return out

    return whole if vectorized else one_by_one


def _rows(value: Any, name: str, rows: int, columns: int) -> NDArray[np.float64]:
    if isinstance(value, np.ndarray) and value.shape == (rows, columns):
        return value
    listed = isinstance(value, tuple | list) and len(value) == rows
    stacked = isinstance(value, np.ndarray) and rows > 1 and value.ndim == (1 if columns == 1 else 2)
    parts = value if listed or stacked else (value,)
    out, fits = np.empty((rows, columns)), len(parts) == rows
    for i, part in enumerate(parts if fits else ()):
        shape = part.shape if isinstance(part, np.ndarray) else np.shape(part)
        fits = fits and (shape == (columns,) or shape in ((), (1,)))
        if fits:
            out[i] = part
    if not fits:
        shapes = [np.shape(part) for part in parts]
        got = (len(parts), *shapes[0]) if len(set(shapes)) == 1 else shapes
        raise ShapeError(f"{name} returned shape {got}: must be ({rows}, {columns}), {rows} rows of {columns} columns")
    return out


def check_columns(function: Callable[..., Any], name: str, rows: int, given: Sequence[Any]) -> None:
    """Refuse a function that fails on two columns, or gives something else than on each alone.

    The last two-dimensional arguments are given with one column.
    """
    near = [np.hstack([a, a + _TWO * np.maximum(np.abs(a), _TWO)]) if np.ndim(a) == 2 else a for a in given]
    call = rows_of(function, name, rows, vectorized=True)
    remedy = "write it with x[0], p[1] and NumPy functions, or give the model vectorized=False"
    with np.errstate(all="ignore"):
        try:
            both = call(*near)
        except (ParameterError, ShapeError):
            raise
        except Exception as error:
            # Its own fault, where it fails on one column too; that error passes through.
            rows_of(function, name, rows, vectorized=False)(*given)
            raise ParameterError(f"{name} does not take columns ({type(error).__name__}: {error}): {remedy}") from error
        for i in (0, 1):
            alone = call(*(a[:, i : i + 1] if np.ndim(a) == 2 else a for a in near))
            if not np.allclose(both[:, i : i + 1], alone, rtol=1e-9, atol=0.0, equal_nan=True):
                raise ParameterError(f"{name} mixes its columns, each of which is a run of its own: {remedy}")


_SETTINGS = {
    "initial_state": Wanted("unit of the state", "numbers"),
    "input_names": Wanted(form="texts"),
    "output_names": Wanted(form="texts"),
    "interpolation": Wanted(form="text"),
    "input_delay_s": Wanted("s"),
    "vectorized": Wanted(form="flag"),
}


@dataclass(frozen=True, kw_only=True)
class GreyBoxModel(SampledModel):
    """A model made of functions, with its parameters; a kind says how they are run."""

    functions: ClassVar[tuple[str, ...]]
    settings: ClassVar[Mapping[str, Wanted]] = MappingProxyType({})
    kind: ClassVar[str]

    parameters: Mapping[str, float]
    initial_state: tuple[float, ...] = ()
    input_names: tuple[str, ...] = ("u",)
    output_names: tuple[str, ...] = ("y",)
    interpolation: Interpolation = "hold"
    input_delay_s: float = 0.0
    vectorized: bool = True

    def __post_init__(self) -> None:
        delay_s = self.input_delay_s
        ParameterError.unless(0.0 <= delay_s < np.inf, "input_delay_s", delay_s, "a delay >= 0 [s]")
        for name in ("input_names", "output_names"):
            given = getattr(self, name)
            ParameterError.unless(not isinstance(given, str), name, given, f"a sequence of names, [{given!r}] for one")
            object.__setattr__(self, name, tuple(given))
        ParameterError.unless(len(self.output_names) > 0, "output_names", self.output_names, "at least one name")
        start = np.atleast_1d(np.asarray(self.initial_state, dtype=np.float64))
        if start.ndim != 1 or not np.isfinite(start).all():
            raise ParameterError.of("initial_state", self.initial_state, "finite numbers, one per state")
        object.__setattr__(self, "initial_state", tuple(start.tolist()))
        values = {name: float(value) for name, value in self.parameters.items()}
        object.__setattr__(self, "parameters", MappingProxyType(values))
        object.__setattr__(self, "state_names", tuple(f"state_{i}" for i in range(len(self.initial_state))))

    @property
    def n_substeps(self) -> int:
        """Steps of the model per sample."""
        return 1

    @abstractmethod
    def run_columns(
        self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Simulate m columns of states, (n_states, m), and parameters, (n_parameters, m), side by side.

        Returns the outputs, (samples, outputs, m), and the states at the last sample.
        """

    @abstractmethod
    def check(self, acting: Acting, state: NDArray[np.float64], p: NDArray[np.float64]) -> None:
        """Refuse functions that cannot be run, by one column at the first sample."""

    def drive(self, time_s: NDArray[np.float64], inputs: list[NDArray[np.float64]]) -> Drive:
        """Return what lies between the samples of inputs; a model without inputs has a row of none."""
        table = np.column_stack(inputs) if inputs else np.empty((time_s.size, 0))
        return Drive(time_s, table, self.n_substeps, self.interpolation)

    def _rest(self) -> list[float]:
        return list(self.initial_state)

    def _run(self, run: RunInputs) -> NDArray[np.float64]:
        p = np.array(list(self.parameters.values()), dtype=np.float64)[:, None]
        start = np.array(run.state, dtype=np.float64)[:, None]
        acting = self.drive(run.time_s, run.columns).acting(self.input_delay_s)
        return self.run_columns(acting, start, p)[0][:, :, 0]

    def _label(self, name: str) -> Label:
        return VARIABLES.get(name, Label(f"unit of {name}", name))

    def to_parameters(self) -> ParameterFile:
        """Give parameters and settings, as `to_toml` writes them, with the names of the functions."""
        known = {**_SETTINGS, **self.settings}
        own = {name: value for name in known if (value := getattr(self, name)) is not None}
        names = {name: name_of(getattr(self, name)) for name in self.functions}
        tables: dict[str, Mapping[str, Entry]] = {
            "parameters": entries(self.parameters),
            "settings": written(own, {name: known[name] for name in own}),
            "functions": entries(names),
        }
        return ParameterFile(kind=self.kind, tables=tables)

    def to_toml(self) -> str:
        """Write parameters and settings as TOML, with the names of the functions."""
        return self.to_parameters().to_toml()

    @classmethod
    def _read(cls, text: str, origin: str, functions: Mapping[str, Callable[..., Any]]) -> Self:
        """Read what `to_toml` or a fit wrote; refuse functions of other names than those that were written."""
        file = ParameterFile.from_toml(text, origin=origin)
        file.expect(kinds=(cls.kind,), tables=("parameters", "settings", "functions", "fit?"), notes=FIT_NOTES)
        wanted = {name: Wanted(form="text") for name in cls.functions}
        for name, known in file.values("functions", wanted).items():
            if name_of(functions[name]) != known:
                raise ParameterError(
                    f"{name} = {name_of(functions[name])}: {origin} was written with {known}; give that function, "
                    f"or change the line in [functions] if it was renamed"
                )
        values = file.values("parameters", {name: Wanted(unit_of(name)) for name in file.tables["parameters"]})
        read: dict[str, Any] = {**functions, **file.values("settings", {**_SETTINGS, **cls.settings})}
        return cls(parameters=values, **read)


def name_of(function: Any) -> str:
    """Return the name by which a file keeps a function."""
    return str(getattr(function, "__qualname__", type(function).__qualname__))
