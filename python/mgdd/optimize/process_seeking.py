"""Seeking with a Gaussian process of J and of every limit."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.optimize import Surface
from mgdd.errors import Error, ParameterError, ShapeError
from mgdd.optimize.inputs import by_name_or_number
from mgdd.optimize.seeker import Seeker

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NODES = {1: 41, 2: 17, 3: 11, 4: 7, 5: 5}  # per input: 5 inputs are asked for 3,125 times


def surface_of(guide: Any, names: Sequence[str], axes: Sequence[NDArray[np.float64]], *, argument: str) -> Any:
    """Read a guide in any of its forms over these nodes."""
    if guide is None or isinstance(guide, Surface):
        return guide
    if hasattr(guide, "dims") and hasattr(guide, "coords"):
        return _of_map(guide, names, argument)
    if len(axes) not in _NODES:
        raise ShapeError(f"{argument}: a guide is over one to five inputs, and there are {len(axes)}: leave it out")
    if not all(np.isfinite(axis).all() for axis in axes):
        raise ParameterError(f"{argument}: a guide is asked between the bounds, and some are infinite: give both")
    model = getattr(guide, "model", guide)
    if hasattr(model, "predict"):
        if not names:
            raise ParameterError(
                f"{argument}: a fitted response goes by names: give `inputs` with the names of its factors"
            )
        columns = [column.ravel() for column in np.meshgrid(*axes, indexing="ij")]
        predicted = model.predict(dict(zip(names, columns, strict=True)))
        values = np.asarray(predicted["mean"], np.float64)
    elif callable(guide):
        values = np.array([_asked(guide, names, point, argument) for point in product(*axes)])
    else:
        raise ParameterError(
            f"{argument} = {guide!r}: must be a callable of the inputs, a fitted response, or a DataArray over them"
        )
    return Surface(axes, values)


def _asked(guide: Callable[[Any], Any], names: Sequence[str], point: Sequence[float], argument: str) -> float:
    at: Any = dict(zip(names, map(float, point), strict=True)) if names else np.asarray(point, np.float64)
    where = ", ".join(f"{name} = {value:.6g}" for name, value in at.items()) if names else f"{at}"
    try:
        value = float(by_name_or_number(guide, at)[0] if names else guide(at))
    except (Error, ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise ParameterError(f"{argument} fails at {where}: {error}") from error
    if not math.isfinite(value):
        raise ParameterError(f"{argument} gives {value} at {where}: it must be finite between the bounds; narrow them")
    return value


def _of_map(guide: Any, names: Sequence[str], argument: str) -> Any:
    order = tuple(names) or tuple(guide.dims)
    if set(map(str, guide.dims)) != set(map(str, order)):
        raise ShapeError(
            f"{argument} is over {', '.join(map(str, guide.dims)) or 'nothing'}: must be over {', '.join(order)}; "
            "select the others away"
        )
    missing = [name for name in order if name not in guide.coords]
    if missing:
        raise ParameterError(
            f"{argument}: {', '.join(map(str, missing))} has no coordinates: say where its values stand"
        )
    sorted_map = guide.transpose(*order).sortby(list(order))
    axes = [np.asarray(sorted_map[name], np.float64) for name in order]
    values = np.asarray(sorted_map, np.float64)
    if not np.isfinite(values).all():
        first = dict(zip(order, np.argwhere(~np.isfinite(values))[0], strict=True))
        where = ", ".join(f"{name} = {float(sorted_map[name][k]):.6g}" for name, k in first.items())
        raise ParameterError(f"{argument} has no value at {where}: fill the map first, for example by smooth_map")
    return Surface(axes, values.ravel())


def with_guides(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Give the settings of a seeker with its guides as surfaces."""
    out = dict(settings)
    if out.get("guide") is None and out.get("limit_guides") is None:
        return out
    inputs = out.get("inputs") or []
    names = [one.name for one in inputs]
    if inputs:
        lower, upper = [one.lower for one in inputs], [one.upper for one in inputs]
    else:
        size = np.size(out.get("start", 0.0))
        sides = out.get("bounds", (-math.inf, math.inf))
        lower, upper = (np.broadcast_to(np.asarray(side, np.float64), size).tolist() for side in sides)
    axes = [np.linspace(low, high, _NODES.get(len(lower), 2)) for low, high in zip(lower, upper, strict=True)]
    for argument, of in (("guide", None), ("limit_guides", [one.name for one in out.get("limits", ())])):
        given = out.get(argument)
        if given is None:
            continue
        if isinstance(given, Mapping) and of is not None:
            unknown = [name for name in given if name not in of]
            if unknown:
                raise ParameterError(f"{argument} names {', '.join(unknown)}: the limits are {', '.join(of) or 'none'}")
            given = [given.get(name) for name in of]
        several = isinstance(given, list | tuple)
        out[argument] = [
            surface_of(one, names, axes, argument=f"{argument}[{k}]" if several else argument)
            for k, one in enumerate(given if several else [given])
        ]
    return out


class GaussianProcessSeeking(Seeker, _core.optimize.GaussianProcessSeeking):
    """Seek with a Gaussian process: few readings, several inputs, limits with a stated probability.

    Bayesian optimisation made for an engine that runs while it is sought on. After a reading at the start and one to
    the side per input, the next input is the one whose J, and what a few readings there would teach about the best
    input, is worth most over `horizon` cycles. Nothing is asked farther beyond what was read than 0.4 of the width that
    has been. Level, slopes and bends of J have a prior that takes its scale from the readings, so any unit of J and of
    the inputs does. All arguments are keywords.

    With a `guide`, a model too rough to design with, the readings to the side are left out: what it says is the mean of
    the process, times a factor and moved by a distance per input, both learnt beside what it misses. A guide in another
    unit than J does, and one that says nothing is left behind. Without it the plain search runs on.

    Parameters
    ----------
    start : float or array_like, shape (inputs,), or mapping
        First estimate, in the unit of the input; one to eight inputs. Limits should hold there.
    inputs, maximize
        As of every `Seeker`; a rate of an input bounds what is applied.
    bounds : pair of float or array_like
        Least and largest applied input, per input, finite, where `inputs` does not hold them.
    noise_sd : float, optional
        Standard deviation of one reading, > 0 [unit of J]; learnt without.
    horizon : float
        Cycles for which what is learnt pays: more looks farther, 0 only at J.
    memory_cycles : float
        In which the level of J is expected to wander by 1.2 noise deviations and its slopes by 0.04 bends, >= 10; how
        fast they do is learnt beside. Shorter follows a drift faster.
    kept : int
        Readings at most, 10 to 200; the oldest of those near the estimate makes room.
    first_step : float
        Of the readings to the side, as a share of the bounds; half of it where there are limits [-].
    limit_probability : float
        With which every limit holds at the estimate, and in all of forty inputs asked for, in [0.5, 1), as far as the
        processes know [-]. The ``margin`` of a limit is kept free beside it, its ``margin_sd`` is not.
    delay_cycles, lag_cycles : float
        Transport delay and time constant between the plant and J [cycles]; behind a lag an input is held for 0.7 time
        constants. Readings that are on their way are counted on.
    components : sequence of ComponentLag, optional
        Delay and lag of each component of J, for example efficiency at once and NOx behind its analyser; `tell` then
        takes one number per component, each with a process of its own.
    delay_uncertainty : int
        Cycles by which a delay may be shorter or longer than given, at most 20; ``delay_cycles`` says which one the
        readings show. A delay of 0, and one beside a lag, is taken as given.
    guide : callable, fitted response or DataArray, optional
        What a model says of J over one to five inputs: a callable of what `ask` gives or of plain numbers, asked on a
        grid between the bounds; a fit of `mgdd.surrogate.fit_response`; or a map with one dimension and its coordinates
        per input. A sequence gives one per component.
    limit_guides : mapping of str to guides, or sequence, optional
        The same of limits. With those of all limits the readings to the side are left out there too; nothing is asked
        farther beyond what was read than a first step, or 0.4 of its width.
    seed : int
        Of the inputs that are compared: the same seed gives the same run.
    limits : sequence of Limit, or mapping of str to float
        Measured quantities to keep, each with a process of its own; ``tell(J, limits)`` then takes their values.

    Raises
    ------
    mgdd.errors.ParameterError
        A value outside its domain, an infinite bound, bounds that exclude the start, or a guide that fails or is not
        finite somewhere between them.
    mgdd.errors.ShapeError
        Entries that are not one per input, or a guide of more than five inputs.

    Notes
    -----
    Readings that the process does not explain age what was known by ten times `memory_cycles`; `doubts` counts that.
    Where forty inputs in a row have stayed at the estimate, the search is over until the next of these, and a small
    dither around it goes on: with `memory_cycles` at 143, some 0.02 bounds where noise is a hundredth of the curvature.
    Cycles reported as misfires have a process of their own, which keeps the search out of what is likely to fail.
    `trust` says how much of J a guide explains.
    Of a limit whose readings stand well above 0 the logarithm is learnt: quantities as NOx spread over powers of ten.

    References
    ----------
    Rasmussen and Williams (2006), Gaussian processes for machine learning.
    Frazier, Powell and Dayanik (2009), The knowledge-gradient policy for correlated normal beliefs.
    Sui, Gotovos, Burdick and Krause (2015), Safe exploration for optimization with Gaussian processes.

    Examples
    --------
    >>> from mgdd.optimize import GaussianProcessSeeking
    >>> seeker = GaussianProcessSeeking(
    ...     start={"soc_cad": -16.0, "egr": 0.3}, inputs={"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)}
    ... )
    >>> history = seeker.run(lambda x: -0.03 * (x["soc_cad"] + 4) ** 2 - 300 * (x["egr"] - 0.15) ** 2, 20)
    >>> bool(abs(seeker.estimate[0] + 4.0) < 1.0 and abs(seeker.estimate[1] - 0.15) < 0.02)
    True
    >>> seeker = GaussianProcessSeeking(
    ...     start={"soc_cad": -16.0, "egr": 0.3}, inputs={"soc_cad": (-25.0, 15.0), "egr": (0.0, 0.4)},
    ...     guide=lambda x: -0.04 * x["soc_cad"] ** 2 - 250 * (x["egr"] - 0.2) ** 2,
    ... )
    >>> history = seeker.run(lambda x: -0.03 * (x["soc_cad"] + 4) ** 2 - 300 * (x["egr"] - 0.15) ** 2, 8)
    >>> bool(abs(seeker.estimate[0] + 4.0) < 1.0 and abs(seeker.estimate[1] - 0.15) < 0.02)
    True
    """

    def ask(self, n: int | None = None) -> Any:
        """Give the input of the next cycle, or of several that a bench measures in parallel.

        Parameters
        ----------
        n : int, optional
            How many, >= 1: a list, each as if those before had read what is expected. Tell each with its ``applied``.

        Returns
        -------
        array, mapping by name, or list of them
            Asking again before `tell` gives the same.

        Raises
        ------
        ParameterError
            Fewer than one, or several where J has components of their own.

        Examples
        --------
        >>> from mgdd.optimize import GaussianProcessSeeking
        >>> seeker = GaussianProcessSeeking(start={"x": 4.0}, inputs={"x": (-5.0, 5.0)})
        >>> for _ in range(6):
        ...     points = seeker.ask(4)
        ...     for x in points:
        ...         seeker.tell(-((x["x"] - 1.0) ** 2), applied=x)
        >>> seeker.cycle, bool(abs(seeker.estimate[0] - 1.0) < 0.2)
        (24, True)
        """
        if n is None:
            return super().ask()
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
            raise ParameterError.of("n", n, "a whole number >= 1")
        if self.component_count > 1:
            raise ParameterError("n: several at once take J as one number: leave components out, or ask for one")
        believer, out = copy.deepcopy(self), list[Any]()
        for _ in range(n):
            out.append(believer.ask())
            believer._believe(out[-1])
        return out

    def _believe(self, applied: Any) -> None:
        """Tell what is expected there: J of the best input, limits as last read near it."""
        history = self._history_columns()
        fired = history["misfire"] == 0.0
        names = self.input_names
        at = np.array([applied[name] for name in names] if names else applied, np.float64)
        if not fired.any():
            self.tell(
                0.0, [limit.upper - abs(limit.upper) for limit in self.settings["limits"]] or None, applied=applied
            )
            return
        own = self.settings
        bounds = [(one.lower, one.upper) for one in own["inputs"]] or list(zip(*own["bounds"], strict=True))
        away = np.linalg.norm((history["applied"] - at)[fired] / np.ptp(bounds, axis=1), axis=1)
        near = np.flatnonzero(fired)[np.argmin(away)]
        j = float(self.expected) if self.expected_sd > 0.0 else float(history["objective"][near])
        self.tell(j, history["limits"][near].tolist() or None, applied=applied)

    def tell(
        self,
        J: Any = None,  # noqa: N803
        limits: Any = None,
        *,
        misfire: bool = False,
        applied: Any = None,
    ) -> None:
        """Accept what was measured: at the input of the last `ask`, or at `applied`, one of several asked at once.

        Everything else is as of the other seekers: a refused reading changes nothing.
        """
        if applied is not None:
            super().ask()  # which gives the same where it was asked already
        super().tell(J, limits, misfire=misfire, applied=applied)

    def _prepared(self, settings: dict[str, Any]) -> dict[str, Any]:
        return with_guides(settings)
