"""What the Python interface of every seeker adds to the core: runs, history, files and pickles."""

from __future__ import annotations

import inspect
import json
import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, Error, Interrupted, ParameterError, hinted
from mgdd.io.files import parsed, read_plain_text, write_whole_text
from mgdd.optimize.inputs import unit_of_input, with_inputs
from mgdd.optimize.optimum import limits_of
from mgdd.optimize.seeker_findings import SeekerFindings
from mgdd.results.describe import as_html, rows_of
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import os

    import xarray as xr

_FORMAT = 1
_INPUT_UNIT, _J_UNIT = "unit of the input", "unit of J"
_RECORDS: dict[str, type[Any]] = {
    "component_lag": _core.optimize.ComponentLag, "limit": _core.optimize.Limit, "input": _core.optimize.Input,
}  # fmt: skip


class Seeker(SeekerFindings):
    """What every seeker of `mgdd.optimize` has beside ``ask`` and ``tell``; `Seeker.load` reads a file of any kind.

    Parameters
    ----------
    inputs : sequence of Input, or mapping of str to (float, float), optional
        Names, units, bounds, scales and rates of the inputs; `ask` then gives a mapping, and ``start`` and whatever is
        given per input may be one.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep, or their upper values by name; ``tell(J, limits)`` then takes what was read.
    maximize : bool
        False to minimise J.
    *given, **settings
        As each kind says them.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from mgdd.optimize import Seeker, Spsa
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "spsa.json"
    ...     Spsa(start=3.0).save(file)
    ...     Seeker.load(file)
    <Spsa cycle 0, estimate [3.]>
    >>> seeker = Spsa(start={"soc_cad": -8.0, "egr": 0.1}, inputs={"soc_cad": (-20.0, 5.0), "egr": (0.0, 0.4)})
    >>> seeker.tell(52.0, applied=seeker.ask())
    """

    kind: ClassVar[str]

    def __init_subclass__(cls, **more: Any) -> None:
        """Show what a seeker takes: the settings of its class of the core."""
        super().__init_subclass__(**more)
        core = next((base for base in cls.__mro__[1:] if base.__module__.startswith("mgdd._core")), None)
        if core is not None:
            cls.__signature__ = inspect.signature(core)  # type: ignore[attr-defined]
        if Seeker in cls.__bases__:
            cls.kind = cls.__name__

    if not TYPE_CHECKING:  # the constructors of the core say what they take

        def __init__(self, *given: Any, **settings: Any) -> None:
            if isinstance(settings.get("limits"), Mapping):
                settings["limits"] = list(limits_of(settings["limits"]))
            if settings.get("inputs") is not None or isinstance(settings.get("start"), Mapping):
                settings = with_inputs(settings)
            super().__init__(*given, **self._prepared(settings))

    def _prepared(self, settings: dict[str, Any]) -> dict[str, Any]:
        """Give settings as the class of the core takes them."""
        return settings

    def run(self, fun: Callable[[Any], Any], cycles: int) -> xr.Dataset:
        """Seek the optimum of a Python function for a number of cycles; `mgdd.loop.run_seeker` does so on a plant.

        Parameters
        ----------
        fun : callable
            ``fun(input) -> J`` with the input of shape (inputs,), a mapping where inputs have names, or
            ``-> (J, limits)`` where the seeker keeps limits; None says that the cycle misfired. J is a number, or an
            array with one entry per component. Exceptions of `fun` pass through and leave the seeker as before that
            cycle.
        cycles : int
            Calls of `fun`, >= 0.

        Returns
        -------
        xarray.Dataset
            The `history`, earlier runs included.

        Raises
        ------
        ParameterError
            `cycles` is negative.
        DataError, ShapeError
            `fun` returned what the seeker refuses; the seeker is unchanged by that cycle.
        Interrupted
            Ctrl-C; ``partial`` is the history so far. The interrupted cycle is asked again when the run is continued.

        Examples
        --------
        >>> from mgdd.optimize import GradientDescent
        >>> history = GradientDescent(start=0.0).run(lambda x: -0.02 * (x[0] - 3.0) ** 2, 60)
        >>> round(float(history["estimate"][-1, 0]), 3)
        3.0
        """
        ParameterError.unless(cycles >= 0, "cycles", cycles, ">= 0")
        try:
            for _ in range(cycles):
                answer = fun(self.ask())
                if answer is None:
                    self.tell(math.nan, misfire=True)
                elif isinstance(answer, tuple):
                    self.tell(*answer)
                else:
                    self.tell(answer)
        except KeyboardInterrupt:
            done = (
                f"interrupted after cycle {self.cycle}; the history is in .partial, and the seeker can go on from here"
            )
            raise Interrupted(done, self.history) from None
        return self.history

    @property
    def history(self) -> xr.Dataset:
        """What was applied and measured, cycle by cycle.

        Dimensions `cycle` and `input`, by name where inputs have names; variables `applied` (as asked, where ``tell``
        got no ``applied``) and `estimate` (before the result of the cycle), both (cycle, input) in the unit of the
        input, `objective` (J as given, components summed; NaN where the cycle misfired) and `misfire` (0 or 1). With
        limits also dimension `limit`, and over (cycle, limit) `limits` as given and `limit_states` after the cycle (0
        free, 1 active, 2 infeasible). Built anew on every access.
        """
        columns = self._history_columns()
        names, over, unit = self.limit_names, ("cycle", "limit"), "unit of the limit"
        inputs = self.settings["inputs"]
        own = [unit_of_input(one) for one in inputs]
        input_unit = own[0] if own and len(set(own)) == 1 else _INPUT_UNIT
        which: tuple[Any, ...] = ("input", np.arange(columns["applied"].shape[1]), "-", "index of the input")
        if inputs:
            which = ("input", self.input_names, "-", "name of the input")
        limited: dict[str, tuple[Any, ...]] = {
            "limit": ("limit", names, "-", "limited quantity"),
            "limits": (over, columns["limits"], unit, "measured value of a limited quantity"),
            "limit_states": (over, columns["limit_states"].astype(np.int8), "-", "0 free, 1 active, 2 infeasible"),
        }
        return labelled_dataset(
            {
                "cycle": ("cycle", columns["cycle"].astype(np.int64)),
                "input": which,
                "applied": (("cycle", "input"), columns["applied"], input_unit, "input that the plant applied"),
                "estimate": (("cycle", "input"), columns["estimate"], input_unit, "estimate of the optimum"),
                "objective": ("cycle", columns["objective"], _J_UNIT, "objective J"),
                "misfire": ("cycle", columns["misfire"].astype(np.int8), "-", "misfired cycle"),
                **(limited if names else {}),
            },
            attrs={"seeker": self.kind},
        )

    def clear_history(self) -> None:
        """Forget the history; the run goes on."""
        self._clear_history()

    def save(self, path: str | os.PathLike[str]) -> None:
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
        write_saved(path, self.kind, self.settings, self.state)

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
            Of this class; of any kind for `Seeker` itself.

        Raises
        ------
        DataError
            Not a file of a seeker, one of another kind, or one whose settings and state do not fit.
        OSError
            The file cannot be read.
        """
        classes = {one.kind: one for one in (Seeker.__subclasses__() if cls is Seeker else [cls])}
        seeker: Self = made_of_saved(path, classes, rebuilt)
        return seeker

    def __reduce__(self) -> tuple[Any, ...]:
        columns = {name: np.asarray(column) for name, column in self._history_columns().items()}
        return rebuilt, (type(self), self.settings, self.state, columns), self.__dict__ or None

    def __repr__(self) -> str:
        now = np.array2string(self.estimate, precision=6)
        if names := self.input_names:
            now = ", ".join(f"{name} {value:.6g}" for name, value in zip(names, self.estimate.tolist(), strict=True))
        return f"<{type(self).__name__} cycle {self.cycle}, estimate {now}>"

    def _repr_html_(self) -> str:
        now = {"cycle": self.cycle, "estimate": self.estimate}
        return as_html(type(self).__name__, rows_of({**now, **self.settings}))


def write_saved(path: str | os.PathLike[str], kind: str, settings: Mapping[str, Any], state: Any) -> None:
    """Write kind, settings and state of a search as JSON."""
    content = {
        "format": _FORMAT,
        "kind": kind,
        "mgdd_version": _core.__version__,
        "settings": encoded(settings),
        "state": encoded(state),
    }
    write_whole_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def made_of_saved(path: str | os.PathLike[str], classes: Mapping[str, Any], make: Callable[..., Any]) -> Any:
    """Make the search of a file, of one of the classes by kind; DataError for any other file."""
    kind, settings, state = _read_saved(path)
    if kind not in classes:
        raise DataError(hinted(f"{Path(path)}: holds a {kind}, not a {' or '.join(classes)}", kind, classes))
    try:
        return make(classes[kind], settings, state)
    except (Error, TypeError, KeyError) as error:
        raise DataError(f"{Path(path)}: settings and state do not make a {kind}: {error}") from error


def _read_saved(path: str | os.PathLike[str]) -> tuple[str, dict[str, Any], dict[str, Any]]:
    file = Path(path)
    try:
        content = parsed(read_plain_text(file, only_utf8=True), "content", "JSON", _decode)
        version = content["format"]
        kind, settings, state = content["kind"], content["settings"], content["state"]
    except (ValueError, KeyError, TypeError) as error:
        reason = str(error) if isinstance(error, DataError) else repr(error)
        raise DataError(f"{file}: is not a seeker written by save(): {reason}") from error
    if version != _FORMAT:
        raise DataError(f"{file}: has format {version!r}: this version of mgdd reads format {_FORMAT}")
    if not (isinstance(kind, str) and isinstance(settings, dict) and isinstance(state, dict)):
        raise DataError(f"{file}: is not a seeker written by save(): kind, settings or state are not what they must be")
    return kind, settings, state


def rebuilt(
    cls: type[Any], settings: dict[str, Any], state: dict[str, Any], history: dict[str, Any] | None = None
) -> Any:
    """Make a seeker of its settings, state and, if given, columns of history."""
    with warnings.catch_warnings():  # advice on these settings was given when they were chosen
        warnings.simplefilter("ignore", UserWarning)
        seeker = cls(**settings)
    seeker.state = state
    if history is not None:
        seeker._set_history_columns(history)
    return seeker


def encoded(value: Any) -> Any:
    """JSON has no infinities and no objects: both become tagged mappings."""
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": repr(value)}
    if tag := next((tag for tag, kind in _RECORDS.items() if isinstance(value, kind)), ""):
        return {tag: encoded(value.to_dict())}
    if isinstance(value, _core.guide.Curve):
        return {"curve": value._table}
    if isinstance(value, _core.optimize.Surface):
        return {"surface": [value.axes, value.values.ravel().tolist()]}
    if isinstance(value, dict):
        return {name: encoded(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [encoded(item) for item in value]
    return value


def _decode(item: dict[str, Any]) -> Any:
    tag = next(iter(item)) if len(item) == 1 else ""
    if tag == "number":
        return float(item["number"])
    if tag in _RECORDS:
        return _RECORDS[tag](**item[tag])
    if tag == "curve":
        return _core.guide.Curve._of_table(item["curve"])
    if tag == "surface":
        return _core.optimize.Surface(*item["surface"])
    return item
