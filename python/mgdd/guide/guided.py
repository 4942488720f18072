"""What a feed-forward and a guided engine share in Python: finished cycles as data, settings, text and pickles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from mgdd._settings import remade
from mgdd.optimize.seeker_findings import SeekerFindings
from mgdd.results.describe import as_html, rows_of
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    class _CoreGuided:
        """What both have of their class of the core beside a seeker, and what each brings itself."""

        @property
        def applied(self) -> NDArray[np.float64]: ...
        @property
        def trust(self) -> float: ...
        def _standing(self) -> Mapping[str, Any]: ...  # what stands before the next cycle, by column
        def _arguments(self) -> tuple[tuple[Any, ...], dict[str, Any]]: ...  # of __init__, beside the options

else:
    _CoreGuided = object


class Column(NamedTuple):
    """A variable of the history: units and long name as `labelled_dataset` takes them."""

    units: str
    long_name: str
    dtype: type = np.float64
    per_input: bool = False  # one number for every input of the seeker


TOLD = {"objective": Column("unit of J", "objective J"), "misfire": Column("-", "misfired cycle", np.int8)}


class Guided(SeekerFindings, _CoreGuided):
    """A seeker with a guide that keeps every finished cycle.

    A subclass sets `_columns`: what `_standing` gives before the result of a cycle, then what was applied, then `TOLD`.
    Its ``__init__`` sets the attributes below.
    """

    _columns: ClassVar[Mapping[str, Column]]
    _shown: ClassVar[tuple[str, ...]]  # further properties for the table of a notebook
    _seeker_kind: str
    _seeker_settings: dict[str, Any]
    _options: dict[str, Any]
    _rows: list[tuple[Any, ...]]

    def tell(
        self,
        J: Any = None,  # noqa: N803
        limits: Any = None,
        *,
        misfire: bool = False,
        applied: Any = None,
    ) -> None:
        """Accept what was measured at the input of the last ask.

        Parameters
        ----------
        J : float or array_like
            Performance, or one number per component.
        limits : sequence or mapping of str to float, optional
            One value per limit of the seeker.
        misfire : bool
            The cycle is counted and its J and limits are not read.
        applied : array_like, optional
            What the plant really applied, if not what was asked for.
        """
        with self._recorded(J, misfire, applied):
            super().tell(J, limits, misfire=misfire, applied=applied)

    @contextmanager
    def _recorded(self, objective: Any, misfire: bool, applied: Any) -> Iterator[None]:
        """Keep the cycle whose result is given inside, unless it is refused."""
        before = (self.cycle, *self._standing().values())
        yield
        values = [applied[name] for name in self.input_names] if isinstance(applied, Mapping) else applied
        done = self.applied if values is None else np.array(values, np.float64)
        total = math.nan if misfire else float(np.sum(np.asarray(objective, np.float64)))
        self._rows.append((*before, done, total, misfire))

    def _rows_dataset(self) -> xr.Dataset:
        """Give the rows as data."""
        named = zip(("cycle", *self._columns), zip(*self._rows, strict=True), strict=True)
        values: dict[str, Any] = dict(named) if self._rows else dict.fromkeys(("cycle", *self._columns), ())
        variables: dict[str, tuple[Any, ...]] = {"cycle": ("cycle", np.array(values["cycle"], np.int64))}
        if any(column.per_input for column in self._columns.values()):
            variables["input"] = ("input", np.arange(self.estimate.size), "-", "index of the input")
        for name, column in self._columns.items():
            shape = (-1, self.estimate.size) if column.per_input else (-1,)
            dims = ("cycle", "input") if column.per_input else "cycle"
            table: NDArray[Any] = np.array(values[name], column.dtype).reshape(shape)
            variables[name] = (dims, table, column.units, column.long_name)
        return labelled_dataset(variables, attrs={"seeker": self._seeker_kind})

    @property
    def settings(self) -> dict[str, Any]:
        """What it was made of: those of the seeker, and its own."""
        return {**self._seeker_settings, **self._options}

    def _bare(self) -> Any:
        """Copy it as it stands, without its finished cycles."""
        arguments, named = self._arguments()
        return self._as(type(self), *arguments, **named)

    def _as(self, cls: type[Any], *arguments: Any, **named: Any) -> Any:
        return remade(cls, arguments, named | self._options, {"state": self.state})

    def __reduce__(self) -> tuple[Any, ...]:
        arguments, named = self._arguments()
        changed = {"state": self.state, "_rows": list(self._rows)}
        return remade, (type(self), arguments, named | self._options, changed)

    def __repr__(self) -> str:
        at = np.array2string(self.estimate, precision=6)
        return (
            f"<{type(self).__name__} with {self._seeker_kind}, cycle {self.cycle}, estimate {at}, "
            f"trust {self.trust:.2f}>"
        )

    def _repr_html_(self) -> str:
        shown = {name: getattr(self, name) for name in self._shown}
        return as_html(type(self).__name__, rows_of({**self._standing(), **shown, **self._options}))
