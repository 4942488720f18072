"""A seeker with the optimum of a guide as feed-forward, of which it learns only the trim."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.guide.guided import TOLD, Column, Guided
from mgdd.optimize.optimum import Optimum
from mgdd.optimize.seeker import Seeker, rebuilt
from mgdd.presets.meant import change_between, numbers_of

if TYPE_CHECKING:
    import xarray as xr

Guide = Callable[[Any], "float | Sequence[float] | Optimum | None"]
Answer = Literal["same", "followed", "held", "refused"]

_LOG = logging.getLogger(__name__)
_CAUSES = ("", "calibration", "following", "new_point")  # of a value, the weightier the later
_LONGEST_SETTLING, _LAGS = 5, 3.0  # cycles before a reading of a test; lags until a sensor has settled
# Standard deviation of the right share of a move about the trust before, of a guide as good as it was; probability that
# it is not; relative standard deviation of its curvature; standard errors of the difference in J that make a verdict.
_TRUST = {"trust_sd": 0.15, "doubt": 0.1, "curvature_spread": 0.2, "significance": 3.0}
_UNIT = "unit of the input"
_POINT = "point."  # of the columns of the state that hold the operating point


class FeedForward(Guided, _core.guide.FeedForward):
    """A seeker whose estimate moves with the optimum of a guide; it learns what is left, the trim.

    ``at(point)`` says at which operating point the next cycle runs, ``ask()`` and ``tell(J)`` are those of a seeker. At
    a new operating point the estimate moves as far as the guide's optimum does, times the trust in the guide, and the
    trim stays. Trust is measured: after such a move J is read at the old place and at the new one, and the two show
    which share of the move was right. A calibration of the guide at the same point never moves what is applied: the
    trim takes the opposite step.

    Parameters
    ----------
    seeker : Seeker
        Any seeker of `mgdd.optimize`; it is copied with its state and history. Its bounds hold for what is applied.
        Golden section searches its whole bracket at every new point and gains nothing from a guide.
    guide : callable, optional
        ``guide(point)`` gives the optimum of the model there: a number, one number per input, or an
        `Optimum`, whose ``curvature`` then must be in the unit of J; None where the point lies outside
        of what the guide knows. Without a guide every call is that of the seeker, bit for bit.
    trust : float
        Trust in the guide before its first test, in [0, 1].
    calibration_rate : float or array_like
        Largest move of the feed-forward per cycle after a calibration [unit of the input].
    following_share : float
        Share of what the guide is ahead that the estimate moves per cycle while the operating point drifts, in
        (0, 1]: a first-order filter against a noisy measurement of the point.
    probe_cycles : int, optional
        Readings of J at each of the two places; 0 for a trust that is never tested. If left out 1, or 0 where
        `probe_settling` is above 5: so long a stay at the old place would cost more than a wrong guide.
    probe_settling : int, optional
        Cycles before them that do not count, at each place; if left out the delay and three times the lag of the
        slowest of the seeker's ``components``.
    noise_sd : float, optional
        Standard deviation of one reading of J; learnt from the readings if left out.
    keep_start : bool
        The guide's first value leaves the estimate at the seeker's own start, or where it stands if it has run, and
        the trim takes the distance; by itself the estimate begins at the guide's optimum.

    Raises
    ------
    mgdd.errors.ParameterError
        No seeker, a guide that cannot be called, or a number outside its domain.

    References
    ----------
    Tan 2018, section 5.2 (structure). Trust and its test are ours.

    Examples
    --------
    >>> from mgdd.guide import FeedForward
    >>> from mgdd.optimize import ExtremumSeeking
    >>> def late_by_one(fuel_mg):  # a rough model of the best timing
    ...     return -0.35 * fuel_mg + 1.0
    >>> seeker = ExtremumSeeking(start=-20.0, bounds=(-30.0, 10.0))
    >>> guided = FeedForward(seeker, late_by_one, noise_sd=0.1)
    >>> for cycle in range(400):
    ...     fuel_mg = 12.0 if cycle < 300 else 30.0
    ...     answer = guided.at(fuel_mg)
    ...     guided.tell(-0.0255 * (guided.ask()[0] + 0.35 * fuel_mg) ** 2)
    >>> bool(abs(guided.estimate[0] + 0.35 * 30.0) < 0.2), bool(abs(guided.trim[0] + 1.0) < 0.2), guided.verdict
    (True, True, 'confirmed')
    """

    _columns = MappingProxyType({
        "guide_optimum": Column(_UNIT, "optimum by the guide", per_input=True),
        "feed_forward": Column(_UNIT, "feed-forward in force", per_input=True),
        "trim": Column(_UNIT, "trim, estimate less feed-forward", per_input=True),
        "estimate": Column(_UNIT, "estimate of the optimum", per_input=True),
        "trust": Column("-", "trust in the guide"),
        "testing": Column("-", "test of the guide", np.int8),
        "point": Column("-", "operating points so far", np.int64),
        "applied": Column(_UNIT, "applied input", per_input=True),
        **TOLD,
    })  # fmt: skip
    _shown = ("verdict",)

    def __init__(
        self,
        seeker: Seeker,
        guide: Guide | None = None,
        *,
        trust: float = 1.0,
        calibration_rate: Any = 1.0,
        following_share: float = 0.2,
        probe_cycles: int | None = None,
        probe_settling: int | None = None,
        noise_sd: float | None = None,
        keep_start: bool = False,
    ) -> None:
        if guide is not None and not callable(guide):
            raise ParameterError.of("guide", guide, "None or a function of the operating point")
        ParameterError.unless(isinstance(keep_start, bool | np.bool_), "keep_start", keep_start, "True or False")
        settling = _settling_of(seeker) if probe_settling is None else probe_settling
        self._options: dict[str, Any] = {
            "trust": trust,
            "calibration_rate": calibration_rate,
            "following_share": following_share,
            "probe_cycles": int(settling <= _LONGEST_SETTLING) if probe_cycles is None else probe_cycles,
            "probe_settling": settling,
            "noise_sd": noise_sd,
        }
        super().__init__(seeker, **self._options, **_TRUST)
        self._options["keep_start"] = bool(keep_start)
        self._set_seeker_history(seeker._history_columns())
        self._seeker_class, self._seeker_kind, self._seeker_settings = type(seeker), seeker.kind, seeker.settings
        self._guide = guide
        self._point: dict[str, float] | None = None
        self._points = 0
        self._owed = ""  # cause of a value that the guide still has to give
        self._rows: list[tuple[Any, ...]] = []

    @property
    def guide(self) -> Guide | None:
        """The guide; another one counts as a calibration at the next `at`."""
        return self._guide

    @guide.setter
    def guide(self, guide: Guide | None) -> None:
        if guide is not None and not callable(guide):
            raise ParameterError.of("guide", guide, "None or a function of the operating point")
        self._guide = guide
        self.recalibrated()

    @property
    def point(self) -> dict[str, float] | None:
        """Numbers of the operating point given to `at` last; None before the first."""
        return None if self._point is None else dict(self._point)

    def recalibrated(self) -> None:
        """Say that the guide has changed in itself: the next `at` asks it again and moves nothing that is applied."""
        self._owed = self._owed or "calibration"

    def at(self, point: Any) -> Answer:
        """Say at which operating point the next cycle runs; call it before `ask`, in every cycle.

        Parameters
        ----------
        point : OperatingPoint, mapping of str to float, sequence of float, or float
            As the guide takes it. A change of any number by more than 5 % makes a new operating point; smaller ones are
            followed without a test and without a restart of the seeker.

        Returns
        -------
        {"same", "followed", "held", "refused"}
            ``held``: no guide, or the point lies outside of what it knows; ``refused``: it raised an error, or gave
            what is not finite, out of bounds or of the wrong size. In both the last valid feed-forward stands, a
            refusal also lowers the trust, and the guide is asked again in the next cycle.

        Raises
        ------
        mgdd.errors.ParameterError
            Not an operating point, or a call between `ask` and `tell`.
        """
        now = numbers_of(point)
        if not all(map(math.isfinite, now.values())):
            _LOG.warning("operating point %s is not finite: the last one stays", now)
            return "held"
        change = change_between(now, self._point)
        cause = max(self._owed, "" if change == "same" else change, key=_CAUSES.index)
        if not cause:
            return "same"
        opens = change == "new_point"
        answer = self._ask_guide(point, cause, opens)
        self._point, self._owed = now, "" if answer == "followed" else cause
        self._points += opens
        return answer

    def _ask_guide(self, point: Any, cause: str, opens: bool) -> Answer:
        retry = self._owed == cause and not opens
        optimum, curvature, why = [math.nan], list[float](), ""
        try:
            reply = None if self._guide is None else self._guide(point)
            if reply is None:
                if opens and self._point is not None:
                    self._hold()
                return "held"
            optimum, curvature = _numbers_of(reply)
            why = f"it gave {optimum}"
        except Exception as error:  # noqa: BLE001 - a guide must not stop the engine: logged, and trust falls
            why = f"it raised {type(error).__name__}: {error}"
        # A new point whose value comes late was opened before: to open it again would restart the seeker once more.
        offered = "following" if cause == "new_point" and not opens else cause
        if self._options["keep_start"] and np.isnan(self.guide_optimum).any():
            offered = "calibration"  # the first value of all: the estimate stays
        if self._offer(optimum, curvature, offered):
            return "followed"
        _LOG.log(
            logging.DEBUG if retry else logging.WARNING,
            "guide refused at %s: %s; the last valid feed-forward stays, trust is now %.2f",
            point, why, self.trust,
        )  # fmt: skip
        return "refused"

    def _standing(self) -> dict[str, Any]:
        tables = {name: getattr(self, name) for name in ("guide_optimum", "feed_forward", "trim", "estimate")}
        return {**tables, "trust": self.trust, "testing": self.testing, "point": self._points}

    def _arguments(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        return (self.seeker, self._guide), {}

    def _bare(self) -> FeedForward:
        seeker = self.seeker
        seeker.clear_history()
        bare: FeedForward = self._as(type(self), seeker, None)  # whoever takes it has the answers of the guide
        return bare

    @property
    def history(self) -> xr.Dataset:
        """What came from the guide and what from the trim, cycle by cycle.

        Dimensions `cycle` and `input`; variables before the result of the cycle: ``guide_optimum``, ``feed_forward``,
        ``trim`` and ``estimate``, ``applied`` in the cycle (cycle, input), ``trust`` (0 to 1), ``testing`` (1: the old
        place, 2: the new one), ``point`` (operating points so far), ``objective`` (NaN where the cycle misfired) and
        ``misfire``. What is not known yet is NaN. Built anew on every access.
        """
        return self._rows_dataset()

    @property
    def seeker(self) -> Seeker:
        """The seeker as it stands now, with its history: a copy."""
        made: Seeker = rebuilt(self._seeker_class, self._seeker_settings, self._seeker_state, self._seeker_history)
        return made

    @property
    def state(self) -> dict[str, list[float]]:
        """What the run needs to go on bit for bit, the history excepted: named lists of numbers, JSON-able.

        Setting it restores the run; one of another kind or size raises `mgdd.errors.ParameterError` and changes
        nothing.
        """
        own = {f"{_POINT}{name}": [value] for name, value in (self._point or {}).items()}
        own["points"] = [float(self._points), float(_CAUSES.index(self._owed))]
        return {**self._core_state, **own}

    @state.setter
    def state(self, saved: Mapping[str, Sequence[float]]) -> None:
        counted = list(saved.get("points", ()))
        if len(counted) != 2 or counted[1] not in range(len(_CAUSES)):
            message = "state column 'points' is missing or wrong: it belongs to another kind or version of object"
            raise ParameterError(message)
        own = {name for name in saved if name == "points" or name.startswith(_POINT)}
        self._core_state = {name: list(column) for name, column in saved.items() if name not in own}
        point = {name.removeprefix(_POINT): float(saved[name][0]) for name in own - {"points"}}
        self._point, self._points, self._owed = point or None, int(counted[0]), _CAUSES[int(counted[1])]


def _settling_of(seeker: Any) -> int:
    """Cycles until the slowest component of J shows a step of the input."""
    components = getattr(seeker, "settings", {}).get("components", ())
    return max((math.ceil(lag.delay_cycles + _LAGS * lag.lag_cycles) for lag in components), default=0)


def _numbers_of(reply: Any) -> tuple[list[float], list[float]]:
    """Give the optimum and, where it is known, the curvature of a guide's answer."""
    if isinstance(reply, Optimum):
        curvature = [reply.curvature] if len(reply.inputs) == 1 and reply.curvature < 0.0 else []
        return [float(value) for value in reply.inputs.values()], curvature
    return np.atleast_1d(np.asarray(math.nan if reply is None else reply, np.float64)).ravel().tolist(), []


# First cycle and end of an answer, its optimum (None: no answer), curvature and cause.
AnswerSpan = tuple[int, int, "list[float] | None", list[float], str]


class _Recording(FeedForward):
    """A feed-forward that keeps what goes to its core."""

    offers: list[tuple[list[float] | None, list[float], str]]

    def _offer(self, optimum: Any, curvature: Any, cause: str) -> bool:
        self.offers.append((optimum, curvature, cause))
        return super()._offer(optimum, curvature, cause)

    def _hold(self) -> None:
        self.offers.append((None, [], "new_point"))
        super()._hold()


def answers_along(seeker: FeedForward, schedule: Sequence[tuple[int, Any]], cycles: int) -> list[AnswerSpan]:
    """Ask the guide at every operating point of a schedule, for a loop that cannot ask it; the seeker stays as it is.

    A guide that held or refused is asked once more, and counts as saying the same until the next operating point.
    """
    asked: _Recording = seeker._as(_Recording, seeker.seeker, seeker.guide)
    out = list[AnswerSpan]()
    ends = [first for first, _ in schedule[1:]] + [cycles]
    for (first, point), end in zip(schedule, ends, strict=True):
        for begin, stop in ((first, first + 1), (first + 1, end)):
            if begin >= min(stop, cycles):
                break
            asked.offers = []
            answer = asked.at(point)
            out += [(begin, begin + 1 if answer == "followed" else stop, *offer) for offer in asked.offers]
            if answer in ("same", "followed"):
                break
    return out
