"""What models of the user's own functions share: parameters, inputs between the samples, a file."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mgdd.errors import ParameterError
from mgdd.identify.grey_box.drive import Acting, Drive, Interpolation
from mgdd.io.parameters import FIT_NOTES, Entry, ParameterFile, Wanted, entries, written
from mgdd.results.labels import VARIABLES, Label
from mgdd.results.units import unit_of
from mgdd.signals.model import RunInputs, SampledModel

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
