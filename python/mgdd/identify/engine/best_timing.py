"""Best timing of measured loads: the answer of every plausible model of a family, and of the best one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mgdd import _core
from mgdd._core.optimize import Limit
from mgdd.engine import find_optimum, simulate
from mgdd.engine.optimum import DEFAULT_CAD, check_request
from mgdd.errors import ConvergenceError, Interrupted
from mgdd.identify.engine.family import Member, ModelFamily, fit_family
from mgdd.identify.engine.records import Load
from mgdd.identify.engine.request import Bounds, Request
from mgdd.identify.engine.tdc import TdcEstimate
from mgdd.identify.engine.timing_records import RANGED, BestTiming, MemberTiming, undetermined
from mgdd.optimize.optimum import Optimum, limits_of
from mgdd.parallel.finished import hand_over
from mgdd.presets.meant import CylinderLike, PointLike

_MARGIN_CAD = 15.0  # the search reaches this far beyond the fitted timing


def best_timing(
    traces: Sequence[Any],
    cylinder: CylinderLike,
    *,
    family: ModelFamily | None = None,
    fuel_heat_j: float | Sequence[float | None] | None = None,
    bounds: Bounds | None = None,
    point: PointLike | None = None,
    objective: str = "imep_closed_bar",
    limits: Mapping[str, float] | Sequence[Limit] | None = None,
    bounds_cad: tuple[float, float] | None = None,
    pegging: str = "none",
    pegging_exponent: float = 1.35,
    inlet_pressure_kpa: float | None = None,
    progress: Callable[[str], None] | None = None,
    step_cad: float = 0.25,
    integrator: str = "trapezoid",
) -> list[BestTiming]:
    """Give each load's best timing by every model of a family, and the range of the plausible ones.

    Traces alone do not determine wall heat and gamma, so one model's best timing would be false precision: the range
    states what the plausible models leave open, the best member what to try first.

    Parameters
    ----------
    traces, cylinder, fuel_heat_j, bounds, point, pegging, pegging_exponent, inlet_pressure_kpa, step_cad, integrator
        As in `mgdd.identify.fit_cylinder`.
    family : ModelFamily, optional
        Which models, and what is plausible; `ModelFamily()` if left out.
    objective : str
        As in `mgdd.engine.find_optimum`. Closed-cycle work is the default because a closed-valve trace carries no more.
    limits : mapping of str to float, or sequence of Limit, optional
        Further limits, as in `mgdd.engine.find_optimum`; they hold beside the trace's own p_max.
    bounds_cad : tuple of float, optional
        Searched range of SOC, as in `mgdd.engine.find_optimum`; by default it reaches 15 °CA beyond the fitted timing.
    progress : callable, optional
        Called with a short text after each fit.

    Returns
    -------
    list of BestTiming
        One per trace; ``best`` of a trace without a plausible model raises `mgdd.errors.ConvergenceError`.

    Raises
    ------
    mgdd.errors.ConvergenceError
        No member of the family could be fitted, or a plausible one has no timing within the limits.
    mgdd.errors.ParameterError, mgdd.errors.DataError
        As in `fit_cylinder` and `find_optimum`.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the list over the models that were finished, or None.

    Examples
    --------
    >>> from mgdd import datasets, presets
    >>> from mgdd.identify import ModelFamily, best_timing
    >>> family = ModelFamily(burn_shapes=["double_wiebe"], gammas=[("linear", None)], wall_heat_scales=[1.0])
    >>> cylinder = presets.load("hd_diesel_128x144").cylinder
    >>> rows = best_timing(datasets.read("hd_diesel_128x144"), cylinder, family=family)
    >>> [(member.member.wall_heat_model, round(member.free_ca50_cad)) for member in rows[0].members if member.plausible]
    [('woschni', 7), ('hohenberg', 4)]
    >>> rows[0].free_direction
    'not determined'
    """
    caps = {limit.name: limit.upper - limit.margin for limit in limits_of(limits)}
    check_request(objective, caps)
    request = Request.of(
        traces, cylinder, free=None, fuel_heat_j=fuel_heat_j, bounds=bounds, point=point, start_values=None,
        step_cad=step_cad, integrator=integrator, options=None,
        pegging=pegging, pegging_exponent=pegging_exponent, inlet_pressure_kpa=inlet_pressure_kpa,
    )  # fmt: skip
    family = family or ModelFamily()
    stop: Interrupted | None = None
    try:
        fitted = fit_family(request, family, progress)
    except Interrupted as error:
        if error.partial is None:
            raise
        fitted, stop = error.partial, error
    members = [member for member in fitted if math.isfinite(member.fit.report.rmse)]
    if not members:
        raise ConvergenceError("no model of the family could be fitted to these traces: check geometry, TDC, pegging")
    scheme: dict[str, Any] = {"step_cad": step_cad, "integrator": integrator}
    answers = [
        tuple(_answer(member, at, objective, caps, bounds_cad, scheme) for member in members)
        for at in range(len(request.traces))
    ]
    misfit = family.misfit_cad
    rows = [_over_family(label, timings, misfit) for label, timings in zip(request.labels, answers, strict=True)]
    return hand_over(rows, stop)


def _answer(
    member: Member,
    at: int,
    objective: str,
    limits: Mapping[str, float],
    bounds_cad: tuple[float, float] | None,
    scheme: dict[str, Any],
) -> MemberTiming:
    load: Load = member.fit.loads[at]
    free: Optimum | None
    limited: Optimum | None
    now = simulate(load.cylinder, load.point, soc_cad=load.soc_cad, **scheme)
    # The model's own error in p_max at the measured timing is not a violation of the limit.
    ceiling = max(load.p_max_bar, float(now["p_max_bar"]) * (1.0 + 1e-9))
    own_limits = {**limits, "p_max_bar": min(ceiling, limits.get("p_max_bar", math.inf))}
    search: dict[str, Any] = {"bounds_cad": bounds_cad or _search(load), **scheme}
    try:
        free = find_optimum(load.cylinder, load.point, objective, limits=limits, **search)
        limited = find_optimum(load.cylinder, load.point, objective, limits=own_limits, **search)
    except ConvergenceError:
        if not member.why_not[at]:
            raise
        free = limited = None  # an implausible member does not count, so it must not stop the others
    base = float(now[objective])
    return MemberTiming(
        member=member,
        plausible=not member.why_not[at],
        why_not=member.why_not[at],
        rmse_percent=load.rmse_percent,
        left_out_percent=member.left_out_percent[at],
        imep_closed_error_percent=load.imep_closed_error_percent,
        fitted_soc_cad=load.soc_cad,
        fitted_ca50_cad=load.ca50_cad,
        soc_minus_soi_cad=load.onset_against_soi_cad,
        efficiency_gross=float(now["efficiency_gross"]),
        **_best_of(limited, base, load.soc_cad, ""),
        **_best_of(free, base, load.soc_cad, "free_"),
        free_p_max_bar=math.nan if free is None else float(free["p_max_bar"]),
        p_max_model_error_bar=float(now["p_max_bar"]) - load.p_max_bar,
        p_max_limit_bar=ceiling,
        at_bound=any(optimum is not None and optimum.at_bound for optimum in (free, limited)),
    )


def _search(load: Load) -> tuple[float, float]:
    """Give the range to search: the usual one, and the fitted timing well inside it."""
    low, high = _core.engine.timing_window_cad
    cylinder = load.cylinder
    first = min(DEFAULT_CAD[0], load.soc_cad - _MARGIN_CAD)
    last = max(DEFAULT_CAD[1], load.soc_cad + _MARGIN_CAD)
    return max(first, low, cylinder.ivc_cad), min(last, high, cylinder.evo_cad - 1.0)


def _best_of(best: Optimum | None, base: float, fitted: float, prefix: str) -> dict[str, float]:
    # Over a cycle without work no gain is a share of it.
    per_base = 100.0 / base if base > 0.0 else math.nan
    soc, half, gain = (
        (math.nan,) * 3 if best is None else (best["soc_cad"], best["ca50_cad"], per_base * (best.value - base))
    )
    values = {"soc_cad": soc, "ca50_cad": half, "shift_cad": soc - fitted, "gain_percent": gain}
    return {prefix + name: value for name, value in values.items()}


def _over_family(file: str, answers: tuple[MemberTiming, ...], misfit_cad: float) -> BestTiming:
    plausible = [answer for answer in answers if answer.plausible]

    def span(name: str) -> tuple[float, float]:
        values = [float(getattr(answer, name)) for answer in plausible] or [math.nan]
        wider = misfit_cad if name.endswith("_cad") else 0.0
        return min(values) - wider, max(values) + wider

    ranges = {name: span(name) for name in RANGED}
    for prefix in ("", "free_"):
        if undetermined(
            ranges[f"{prefix}shift_cad"]
        ):  # then the measured timing may be the best, and nothing is gained
            ranges[f"{prefix}gain_percent"] = (
                min(0.0, ranges[f"{prefix}gain_percent"][0]),
                ranges[f"{prefix}gain_percent"][1],
            )
    return BestTiming(file=file, members=answers, **ranges)


def headline_of(rows: Sequence[BestTiming]) -> Member:
    """Give the member that stands for all loads: plausible for the most of them, then with the least score."""

    def rank(at: int) -> tuple[int, float]:
        members = [row.members[at] for row in rows]
        return -sum(answer.plausible for answer in members), members[0].member.score

    return rows[0].members[min(range(len(rows[0].members)), key=rank)].member


def doubts_of(rows: Sequence[BestTiming], tdc: TdcEstimate | None = None) -> list[str]:
    """Report what makes the answers doubtful: the headline's findings, answers at an end of the search, TDC."""
    reasons = [str(finding) for finding in headline_of(rows).fit.findings]
    for row in rows:
        ends = sum(answer.at_bound for answer in row.plausible)
        if ends:
            reasons.append(
                f"{row.file}: the best timing of {ends} plausible model(s) lies at the end of the searched range: "
                "widen bounds_cad, or suspect TDC"
            )
        if not row.plausible:
            reasons.append(f"{row.file}: no model is plausible: suspect geometry, TDC, pegging, speed or trapped mass")
    return reasons + (tdc.doubts() if tdc is not None else [])
