"""The contract of every result: its data, a text, a figure, a file and a table."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mgdd.errors import DataError, ParameterError, did_you_mean
from mgdd.results.describe import PLAIN, Row, as_figure, as_html, as_text, fields_of, picture_of, rows_of, title_of
from mgdd.results.labels import Label, labelled_dataset, named_label

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes


class Figures(dict[str, Any]):
    """Figures of a run by name; called, they give the summary of the result as a text."""

    def __call__(self) -> str:
        """Return them as a text."""
        return as_text("figures", rows_of(self))


class Result:
    """What every result can do: `dataset`, `summary`, `plot`, `to_netcdf`, `to_dataframe`, a text and an HTML form.

    Every function of `mgdd.plot` takes a result or its `dataset`.

    Attributes
    ----------
    dataset : xarray.Dataset
        All its data, every variable with unit and long name.
    """

    if TYPE_CHECKING:

        @property
        def dataset(self) -> xr.Dataset:
            """All its data."""

    else:

        def __getattr__(self, name: str) -> Any:
            if hasattr(type(self), name):  # a property whose own code lacks an attribute: say which
                return object.__getattribute__(self, name)
            kind, names = type(self).__name__, [each for each in dir(self) if not each.startswith("_")]
            hint = "" if name.startswith("_") else did_you_mean(name, names) or f"it has {', '.join(names)}"
            raise AttributeError(f"{kind!r} object has no attribute {name!r}: {hint}", name=name, obj=self)

    def _title(self) -> str:
        return title_of(self)

    def _rows(self) -> list[Row]:
        return rows_of(fields_of(self))

    def __repr__(self) -> str:
        return as_text(self._title(), self._rows())

    def _repr_html_(self) -> str:
        try:
            picture = picture_of(self.dataset)
        except DataError:  # a fit that keeps no run
            picture = ""
        return as_html(self._title(), self._rows(), picture)

    def summary(self) -> str:
        """Return a human-readable summary.

        Returns
        -------
        str
            A few lines.
        """
        return as_text(self._title(), self._rows())

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draw the result: runs, maps and scans as figures of `mgdd.plot` do, a few numbers as their table.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; None makes a figure.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, the first where there are several.

        Raises
        ------
        DataError
            A result that has nothing to draw, as a fit that keeps no run or a motored estimate.
        """
        return self._draw(ax)

    def _draw(self, ax: Axes | None) -> Axes:
        return as_figure(self._title(), self._rows(), ax)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result to a file: its data to ``.nc``, the parameters of its model to ``.toml``.

        Parameters
        ----------
        path : path-like
            The file, by whose ending the form is chosen; one that is there is overwritten. `xarray.load_dataset` reads
            the first form, ``load`` of the class of the model the second.

        Raises
        ------
        ParameterError
            Another ending, or ``.toml`` for a result without a model that has a parameter file.
        """
        saved(self, path)

    def to_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Write `dataset` to a classic netCDF file; `xarray.load_dataset` reads it, and `mgdd.plot` draws what it read.

        Parameters
        ----------
        path : path-like
            The file; one that is there is overwritten.
        """
        self.dataset.to_netcdf(path, engine="scipy")

    def to_dataframe(self) -> pd.DataFrame:
        """Tabulate `dataset` over the dimension that most of its variables have.

        Returns
        -------
        pandas.DataFrame
            A row per entry of that dimension, which is the index; a variable over it and another one has a column per
            entry of the other, as ``limits[p_max_bar]``. Variables without that dimension stand in ``dataset`` only;
            where none has a dimension, all are one row.
        """
        import pandas as pd

        data = self.dataset
        dims = [str(dim) for own in data.data_vars.values() for dim in own.dims[:1] if data.sizes[dim]]
        if not dims:
            return pd.DataFrame({str(name): [variable.item()] for name, variable in data.data_vars.items()})
        main = max(dict.fromkeys(dims), key=dims.count)
        columns: dict[str, Any] = {}
        for name, variable in {**data.coords, **data.data_vars}.items():
            if main not in variable.dims or name == main:
                continue
            others = [str(dim) for dim in variable.dims if dim != main]
            if not others:
                columns[str(name)] = variable.to_numpy()
            elif len(others) == 1:
                table = variable.transpose(main, *others).to_numpy()
                names = data[others[0]].to_numpy() if others[0] in data else range(table.shape[1])
                columns |= {f"{name}[{entry}]": table[:, place] for place, entry in enumerate(names)}
        index = pd.Index(data[main].to_numpy(), name=main) if main in data.coords else None
        return pd.DataFrame(columns, index=index)


def saved(what: Any, path: str | os.PathLike[str]) -> None:
    """Write a result or a Dataset in the form of the ending of the file."""
    give, ending = getattr(what, "to_toml", None), Path(path).suffix
    if ending == ".nc":
        getattr(what, "dataset", what).to_netcdf(path, engine="scipy")
    elif ending == ".toml" and give is not None:
        Path(path).write_text(give(), encoding="utf-8")
    else:
        bound = "a file that ends in .nc, for the data" + (", or in .toml, for the parameters" if give else "")
        bound += "; to_dataframe().to_csv(path) writes a CSV file" if ending == ".csv" else ""
        raise ParameterError.of("path", os.fspath(path), bound)


class NumbersResult(Result):
    """A result that is a record of numbers and texts: its `dataset` has them as variables without a dimension."""

    _units: ClassVar[Mapping[str, str]] = MappingProxyType({})  # of numbers whose names do not give it

    def _rows(self) -> list[Row]:
        return rows_of(fields_of(self), self._units)

    @property
    def dataset(self) -> xr.Dataset:
        """The numbers as variables, the texts as attributes."""
        numbers: dict[str, Any] = {}
        texts: dict[str, Any] = {}
        for item in dataclasses.fields(self):  # type: ignore[arg-type]
            _sorted(item.name, getattr(self, item.name), numbers, texts)
        labels = {name: self._label(name) for name in numbers}
        return labelled_dataset({name: ((), value, *labels[name]) for name, value in numbers.items()}, attrs=texts)

    def _label(self, name: str) -> Label:
        label = named_label(name)
        return Label(self._units[name], label.long_name) if name in self._units else label


def _sorted(name: str, value: Any, numbers: dict[str, Any], texts: dict[str, Any]) -> None:
    if isinstance(value, str):
        texts[name] = value
    elif isinstance(value, Real | np.bool_):
        numbers[name] = value
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            _sorted(str(key) if name in PLAIN else f"{name}_{key}", entry, numbers, texts)
    elif isinstance(value, tuple) and len(value) == 2 and all(isinstance(entry, Real) for entry in value):
        for key, entry in zip(("low", "high"), value, strict=True):
            numbers[f"{name}_{key}"] = entry
    elif isinstance(value, tuple) and value and all(isinstance(entry, str) for entry in value):
        texts[name] = "\n".join(value)


def merged(*datasets: xr.Dataset, attrs: Mapping[str, Any] | None = None) -> xr.Dataset:
    """Put Datasets of one result beside each other."""
    import xarray as xr

    from mgdd.results.dataset import Dataset

    whole = xr.merge(datasets, combine_attrs="override", join="outer", compat="no_conflicts")
    return Dataset(whole.data_vars, whole.coords, dict(attrs or {}))
