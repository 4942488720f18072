"""The Dataset of mgdd: what xarray's can do, and the summary and the figure that every result has."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import xarray as xr
from xarray.plot.accessor import DatasetPlotAccessor

if TYPE_CHECKING:
    import os

    from matplotlib.axes import Axes


class _Plot(DatasetPlotAccessor):
    """``data.plot()`` draws the figure of `mgdd.plot` for these data; ``data.plot.scatter`` and others are xarray's."""

    __slots__ = ()

    def __call__(self, *, ax: Axes | None = None) -> Any:
        """Draw as `mgdd.results.result.Result.plot` does."""
        # By name: texts and figures stand above the data that they show.
        return import_module("mgdd.plot.data").data(self._ds, ax=ax)


class _PlotOf:
    def __get__(self, data: Dataset | None, owner: type[Dataset]) -> Any:
        return _Plot if data is None else _Plot(data)


class Dataset(xr.Dataset):  # type: ignore[no-untyped-call]
    """The data of a function or a result: an `xarray.Dataset` that has a summary and a figure of its own.

    A selection, a mean and a pickle of it are one again; ``plot()`` takes ``ax`` as that of a `Fit`.

    Examples
    --------
    >>> from mgdd.throttle import simulate_throttle
    >>> run = simulate_throttle("P1", 0.3)
    >>> print(run[["angle_deg"]].summary())
    Dataset over 1001 time_s
      angle_deg 8 to 90.0203 deg
    >>> run.plot().get_ylabel()
    'plate angle [deg]'
    """

    __slots__ = ()
    plot = _PlotOf()

    def summary(self) -> str:
        """Return a human-readable summary.

        Returns
        -------
        str
            Its size, and the value or the range of every variable.
        """
        text: str = import_module("mgdd.results.describe").dataset_text(self)
        return text

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the data to a netCDF file; its name ends in ``.nc``, another one is a ParameterError.

        Parameters
        ----------
        path : path-like
            The file; one that is there is overwritten. `xarray.load_dataset` reads it.
        """
        import_module("mgdd.results.result").saved(self, path)
