"""What the Python interface of every seeker adds to the core: history, files and pickles."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, Error
from mgdd.io.existing_file import existing_file
from mgdd.results.describe import as_html, rows_of
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["SeekerRecord", "read_seeker_file"]

_FORMAT = 1
_INPUT_UNIT, _J_UNIT = "unit of the input", "unit of J"


class _CoreSeeker(Protocol):
    """What `SeekerRecord` needs of the class of the core that it is mixed into."""

    kind: ClassVar[str]

    @property
    def settings(self) -> dict[str, Any]: ...
    @property
    def state(self) -> dict[str, list[float]]: ...
    @property
    def estimate(self) -> NDArray[np.float64]: ...
    @property
    def cycle(self) -> int: ...
    def _history_columns(self) -> dict[str, Any]: ...
    def _clear_history(self) -> None: ...


class SeekerRecord:
    """History, files and pickles of a seeker; mixed into every seeker of `mgdd.optimize`."""

    kind: ClassVar[str]

    @property
    def history(self: _CoreSeeker) -> xr.Dataset:
        """What was applied and told, cycle by cycle.

        Dimensions `cycle` and `input`; variables `applied` and `estimate` (before the cycle was told), both
        (cycle, input) in the unit of the input, `objective` (J as told, components summed; NaN where the cycle
        misfired) and `misfire` (0 or 1). Built anew on every access.
        """
        columns = self._history_columns()
        return labelled_dataset(
            {
                "cycle": ("cycle", columns["cycle"].astype(np.int64)),
                "input": ("input", np.arange(columns["applied"].shape[1]), "-", "index of the input"),
                "applied": (("cycle", "input"), columns["applied"], _INPUT_UNIT, "applied input"),
                "estimate": (("cycle", "input"), columns["estimate"], _INPUT_UNIT, "estimate of the optimum"),
                "objective": ("cycle", columns["objective"], _J_UNIT, "objective J"),
                "misfire": ("cycle", columns["misfire"].astype(np.int8), "-", "misfired cycle"),
            },
            attrs={"seeker": self.kind},
        )

    def clear_history(self: _CoreSeeker) -> None:
        """Forget the history; the run goes on."""
        self._clear_history()

    def save(self: _CoreSeeker, path: str | os.PathLike[str]) -> None:
        """Write settings and state as JSON; the history is not part of the file.

        Parameters
        ----------
        path : path-like
            File to write or to replace. It is replaced in one step, so an interruption leaves the old one.

        Raises
        ------
        OSError
            The file cannot be written.
        """
        content = {
            "format": _FORMAT,
            "kind": self.kind,
            "mgdd_version": _core.__version__,
            "settings": _encode(self.settings),
            "state": _encode(self.state),
        }
        target = Path(path)
        fresh = target.with_name(target.name + ".new")
        fresh.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        fresh.replace(target)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a seeker back; it goes on bit for bit where `save` left it, with an empty history.

        Parameters
        ----------
        path : path-like
            File that `save` wrote.

        Returns
        -------
        seeker
            Of this class.

        Raises
        ------
        DataError
            No file of a seeker, one of another kind, or one whose settings and state do not fit.
        OSError
            The file cannot be read.
        """
        kind, settings, state = read_seeker_file(path)
        if kind != cls.kind:
            raise DataError(f"{Path(path)}: holds a {kind}, not a {cls.kind}; load_seeker reads any kind")
        try:
            seeker: Self = _rebuild(cls, settings, state, None)
        except (Error, TypeError, KeyError) as error:
            raise DataError(f"{Path(path)}: settings and state do not make a {kind}: {error}") from error
        return seeker

    def __reduce__(self: _CoreSeeker) -> tuple[Any, ...]:
        columns = {name: np.asarray(column) for name, column in self._history_columns().items()}
        return _rebuild, (type(self), self.settings, self.state, columns), self.__dict__ or None

    def __repr__(self: _CoreSeeker) -> str:
        return f"<{type(self).__name__} cycle {self.cycle}, estimate {np.array2string(self.estimate, precision=6)}>"

    def _repr_html_(self: _CoreSeeker) -> str:
        now = {"cycle": self.cycle, "estimate": self.estimate}
        return as_html(type(self).__name__, rows_of({**now, **self.settings}))


def read_seeker_file(path: str | os.PathLike[str]) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Read kind, settings and state of a file that `SeekerRecord.save` wrote; DataError if it is none."""
    file = existing_file(path)
    try:
        content = json.loads(file.read_text(encoding="utf-8"), object_hook=_decode)
        found = content["format"]
        kind, settings, state = content["kind"], content["settings"], content["state"]
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"{file}: is not a seeker written by save(): {error!r}") from error
    if found != _FORMAT:
        raise DataError(f"{file}: has format {found!r}: this version of mgdd reads format {_FORMAT}")
    if not (isinstance(kind, str) and isinstance(settings, dict) and isinstance(state, dict)):
        raise DataError(f"{file}: is not a seeker written by save(): kind, settings or state are not what they must be")
    return kind, settings, state


def _rebuild(cls: type[Any], settings: dict[str, Any], state: dict[str, Any], history: dict[str, Any] | None) -> Any:
    with warnings.catch_warnings():  # advice on these settings was given when they were chosen
        warnings.simplefilter("ignore", UserWarning)
        seeker = cls(**settings)
    seeker.state = state
    if history is not None:
        seeker._set_history_columns(history)
    return seeker


def _encode(value: Any) -> Any:
    """JSON has no infinities and no objects: both become tagged mappings."""
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": repr(value)}
    if isinstance(value, _core.optimize.ComponentLag):
        return {"component_lag": {"delay_cycles": value.delay_cycles, "lag_cycles": value.lag_cycles}}
    if isinstance(value, _core.optimize.Limit):
        names = ("name", "upper", "margin", "method", "weight", "scale")
        return {"limit": {name: getattr(value, name) for name in names}}
    if isinstance(value, dict):
        return {name: _encode(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_encode(item) for item in value]
    return value


def _decode(item: dict[str, Any]) -> Any:
    if set(item) == {"number"}:
        return float(item["number"])
    if set(item) == {"component_lag"}:
        return _core.optimize.ComponentLag(**item["component_lag"])
    if set(item) == {"limit"}:
        return _core.optimize.Limit(**item["limit"])
    return item
