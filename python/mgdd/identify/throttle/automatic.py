"""The groups of a throttle with as much structure as its log supports: lag, delay, Stribeck drop, presliding, gap."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from mgdd import _core
from mgdd.errors import Interrupted
from mgdd.identify.throttle.first_principle_model import LONGEST_DELAY, REFINEMENTS, FirstPrincipleModel
from mgdd.identify.throttle.first_principle_problem import Search, groups_problem
from mgdd.identify.throttle.free_run import below_ceiling, draw_free_run, free_run, noise_of, quality_of, source_of
from mgdd.identify.throttle.nuisances import SHARE, TYPICAL_SHARE, delay_weights, independent_values, with_nuisances
from mgdd.identify.throttle.whole_delay import (
    AT_NOISE,
    BRISTLES,
    FINE,
    FLOOR_DEG,
    MOVING,
    RAMPS,
    Delays,
    Hunt,
    best_of,
    delay_at_end,
    independent_samples,
    missed,
    names_of,
    steps_of,
    whole_delay,
    with_delay,
)
from mgdd.optimize.least_squares import FitOptions, fit_options, spread_starts
from mgdd.parallel.finished import hand_over
from mgdd.results import Fit
from mgdd.results.finding import Finding
from mgdd.results.fit_report import FitReport

if TYPE_CHECKING:
    import xarray as xr

LAG, RAMP, DELAY = ("electrical_s",), ("ramp_deg",), ("delay_samples",)
DROP = ("stribeck_drop", "stribeck_deg_per_s")
PRESLIDING = ("presliding_deg", "presliding_damping")
GAP = ("half_gap_deg",)
STOPS = ("stop_duty_per_deg", "stop_damping")
_ABSENT = {name: REFINEMENTS[name] for term in (DROP, PRESLIDING, GAP) for name in term}
_SHOWN = {LAG: "lag", DROP: "Stribeck drop", PRESLIDING: "presliding", GAP: "gap"}
_STOP = {"stop_duty_per_deg": 40.0, "stop_damping": 0.7}
_AS_GOOD, _STIFFEST = 1.002, 400.0  # stops that were touched yield unless the log shows that they do not
_TOUCHED_DEG = 0.5  # as near as that the plate has been at a stop
_COARSE = 2  # steps per sample of the first look
_FIRST_LOOK = 6  # delays; the next are tried while one of the last two is the best
_SEEDS = 2  # rough solutions that are looked at from every delay
_DROPS, _SPEEDS, _PRESLIDINGS, _HALF_GAPS = (0.08, 0.6), (8.0, 40.0), (0.06, 0.2), (0.1, 0.3)


def fit_groups(
    log: xr.Dataset,
    *,
    fixed: Mapping[str, float] | None = None,
    delays: Sequence[float] = range(21),
    stops_deg: tuple[float, float] = (0.0, 90.0),
    options: FitOptions | None = None,
) -> Fit:
    """Fit the first-principle groups, and keep of lag, delay, drop, presliding and gap what the log supports.

    Coulomb friction with lag and delay comes first; then the others, each from several starts, with the delay free.
    The structure with the lowest n ln(cost) + k ln(n) is kept (Schwarz 1978), n counting independent samples of the
    residual. It is then fitted with fine steps at the delays about the one found, and every term is tried without.
    """
    chosen = fit_options(options, n_starts=4, seed=0, max_iterations=40, tolerance=1e-7)
    problem = groups_problem(log, fixed=fixed, stops_deg=stops_deg)
    fine = steps_of(FINE, problem.step_s)
    hunt = Hunt(problem=problem, max_iterations=chosen.max_iterations, tolerance=chosen.tolerance)
    interrupted: Interrupted | None = None
    findings: list[Finding] = []
    by_delay: Delays | None = None
    report: FitReport | None = None
    fixed_values = fixed or {}
    try:
        rough, terms = _structure(hunt, fixed_values, sorted(delays), chosen.n_starts, chosen.seed)
        by_delay = whole_delay(hunt, rough, sorted(delays))
        search, terms = _without(hunt, by_delay.best, terms)
        if STOPS in terms:
            search = hunt.fine(search.values, list(dict.fromkeys([*names_of(search), *STOPS])))
        findings = _findings(search, terms, by_delay, delays)
        report = FitReport.from_core(search.report, problem.angle)
        n = independent_values(problem, report)
        weights = delay_weights(by_delay.rivals, search.values["delay_samples"], n)
        report = with_nuisances(
            problem, search.values, report, substeps=fine, share_known=SHARE in fixed_values, delays=weights
        )
    except Interrupted as stop:
        if hunt.best is None:
            raise
        interrupted = stop
        if report is None:
            search = hunt.best if by_delay is None else by_delay.best
            report = FitReport.from_core(search.report, problem.angle)
    if by_delay is not None and len(by_delay.rmse) > 1:
        delay = search.values["delay_samples"]
        report = with_delay(report, delay, by_delay.rivals, independent_values(problem, report), delays)
    model = FirstPrincipleModel(
        parameters=search.values, closed_deg=stops_deg[0], open_deg=stops_deg[1], substeps=fine, sample_s=problem.step_s
    )
    run = free_run(model, log)
    train = quality_of([run])
    fit = Fit(
        report=report,
        model=model,
        kind=model.kind,
        train=train,
        unidentifiable=(*problem.unvisited, *report.unidentifiable),
        findings=(*problem.findings, *report.findings, *findings, *below_ceiling([log], train)),
        source=source_of(log),
        start_rmse=tuple(sorted(entry.rmse for entry in hunt.done)),
        n_best=sum(entry.rmse <= 1.005 * search.rmse for entry in hunt.done),
        run=run,
        draw=draw_free_run,
    )
    return hand_over(fit, interrupted)


def _structure(
    hunt: Hunt, fixed: Mapping[str, float], delays: Sequence[float], n_starts: int, seed: int
) -> tuple[list[Search], list[tuple[str, ...]]]:
    """Find the structure and its rough values, the best first, with the delay free between the first and the last."""
    problem = hunt.problem
    latency = [*LAG, *(DELAY if len(delays) > 1 else ())]
    further = [*latency, *(RAMP if problem.both_sides else ())]
    base = [*problem.free, *(name for name in further if name not in fixed)]
    values = dict(problem.values)
    values |= {"electrical_s": 1e-3, SHARE: fixed.get(SHARE, TYPICAL_SHARE)} if "electrical_s" in base else {}

    def of(terms: Sequence[tuple[str, ...]]) -> list[str]:
        return [*base, *(name for term in terms for name in term if name not in fixed)]

    # A search in the valley of a wrong delay seldom leaves it: each begins with a search of its own.
    ramps: list[dict[str, float]] = [{}, *({"ramp_deg": ramp} for ramp in RAMPS if "ramp_deg" in base)]
    moving = [name for name in MOVING if name in base]
    whole = [name for name in base if name not in DELAY]
    tries: list[Search] = []
    for number, delay in enumerate(delays):
        if number >= _FIRST_LOOK and best_of(tries) not in tries[-2:]:
            break
        start = {**values, "delay_samples": float(delay)}
        first = hunt.search(start, moving, _COARSE, 10).values if moving else start
        tries.append(hunt.search(first, whole, _COARSE, 20))
    nearest = sorted(tries, key=lambda one: one.rmse)[:2]
    # Ramp and limp-home have valleys of their own, and so have both together.
    tries = [hunt.search({**one.values, **ramp}, base, _COARSE, 20) for one in nearest for ramp in ramps]
    plain = hunt.search(best_of(tries).values, base, BRISTLES, 20)
    terms: list[tuple[str, ...]] = [LAG] if "electrical_s" in base else []
    plain, terms = _stopped(hunt, fixed, plain, terms)
    fits: dict[tuple[tuple[str, ...], ...], Search] = {(): plain}
    enough = max(AT_NOISE * noise_of(problem.angle), FLOOR_DEG)
    if plain.rmse < enough:
        return [plain], terms
    box = [
        _core.optimize.Parameter(name=name, lower=low, upper=high, log_scaled=True)
        for name, (low, high) in zip(DROP, (_DROPS, _SPEEDS), strict=True)
    ]
    start = {**plain.values, "stribeck_drop": 0.15, "stribeck_deg_per_s": 25.0}
    tries = [hunt.search(one, of([DROP]), _COARSE, 20) for one in spread_starts(start, box, n_starts, seed)]
    dropping = hunt.search(best_of(tries).values, of([DROP]), _COARSE, 40)
    fits[(DROP,)] = dropping
    if dropping.rmse < enough:
        return [dropping], [*terms, DROP]
    least = min([plain, dropping], key=lambda one: one.rmse).values
    tries = [
        hunt.search(
            {**least, "presliding_deg": width, "stribeck_drop": max(least["stribeck_drop"], 0.05)},
            of([DROP, PRESLIDING]), BRISTLES, 25,
        )
        for width in _PRESLIDINGS
    ]  # fmt: skip
    fits[(DROP, PRESLIDING)] = hunt.search(best_of(tries).values, of([DROP, PRESLIDING]), BRISTLES, 30)
    # Both ways: friction without bristles also from where that with them has ended.
    rigid = {**fits[(DROP, PRESLIDING)].values, **{name: _ABSENT[name] for name in PRESLIDING}}
    fits[(DROP,)] = best_of([dropping, hunt.search(rigid, of([DROP]), BRISTLES, 25)])
    if problem.both_sides:
        tries = [
            hunt.search({**plain.values, "half_gap_deg": half, "ramp_deg": 0.25}, of([GAP]), _COARSE, 30)
            for half in _HALF_GAPS
        ]
        fits[(GAP,)] = best_of(tries)
        fits[(DROP, GAP)] = hunt.search({**fits[(GAP,)].values, "stribeck_drop": 0.1}, of([DROP, GAP]), _COARSE, 30)
    n = independent_samples(best_of(fits.values()))
    best = min(fits, key=lambda one: 2.0 * n * math.log(max(fits[one].rmse, FLOOR_DEG)) + len(of(one)) * math.log(n))
    # Sticking makes the cost rough: what the other structures have found are further starts of the chosen one.
    parameters = {name: fits[best].values[name] for term in best for name in term}
    others = [one.values for one in sorted(fits.values(), key=lambda one: one.rmse)[1:3]]
    others += [{**fits[best].values, **ramp} for ramp in ramps[1:]]
    again = [hunt.search({**one, **_ABSENT, **parameters}, of(best), BRISTLES, 20) for one in others]
    return sorted([fits[best], *again], key=lambda one: one.rmse)[:_SEEDS], [*terms, *best]


def _stopped(
    hunt: Hunt, fixed: Mapping[str, float], plain: Search, terms: list[tuple[str, ...]]
) -> tuple[Search, list[tuple[str, ...]]]:
    """Let the stops yield where the plate has touched one and the log does not show that they are rigid."""
    problem = hunt.problem
    low, high = problem.stops_deg
    touched = problem.angle.min() < low + _TOUCHED_DEG or problem.angle.max() > high - _TOUCHED_DEG
    if not touched or set(STOPS) & set(fixed):
        return plain, terms
    soft = hunt.search({**plain.values, **_STOP}, [*names_of(plain), *STOPS], BRISTLES, 25)
    if soft.rmse > _AS_GOOD * plain.rmse or soft.values["stop_duty_per_deg"] > _STIFFEST:
        return plain, terms
    return soft, [*terms, STOPS]


def _without(hunt: Hunt, search: Search, terms: list[tuple[str, ...]]) -> tuple[Search, list[tuple[str, ...]]]:
    """Try every term without, the last first; what the log does not miss is left out."""
    for term in [PRESLIDING, GAP, DROP, LAG]:
        if term not in terms or (term == DROP and PRESLIDING in terms):
            continue
        free = [name for name in names_of(search) if name not in term]
        absent = {**_ABSENT, "electrical_s": 0.0}
        smaller = hunt.search({**search.values, **{name: absent[name] for name in term}}, free, FINE, 25, 1e-6)
        n = independent_samples(search)
        if not missed(smaller, search, len(term), n):
            search, terms = smaller, [one for one in terms if one != term]
    return search, terms


def _findings(fit: Search, terms: Sequence[tuple[str, ...]], delays: Delays, tried: Sequence[float]) -> list[Finding]:
    """Report what the model has and what it is worth, and how other delays fare."""
    by_delay, rms = delays.rmse, fit.rmse
    has = ", ".join(_SHOWN[term] for term in terms if term in _SHOWN) or "none"
    stops = ", stops that yield" if STOPS in terms else ""
    left = ", ".join(_SHOWN[term] for term in _SHOWN if term not in terms) or "nothing"
    text = f"Coulomb friction with {has} ({rms:.3g} deg RMS{stops}); left out, as the log does not support it: {left}"
    if len(by_delay) < 2:
        return [Finding("structure_chosen", tuple(name for term in terms for name in term), text)]
    each = ", ".join(f"{delay:g}: {error:.3g}" for delay, error in sorted(by_delay.items()))
    text += f"; delay {fit.values['delay_samples']:g} samples (deg RMS by delay: {each})"
    findings = [Finding("structure_chosen", tuple(name for term in terms for name in term), text)]
    chosen_delay = fit.values["delay_samples"]
    findings += delay_at_end(chosen_delay, tried, LONGEST_DELAY)
    if len(delays.ties) > 1:
        ties = " and ".join(f"{delay:g}" for delay in delays.ties)
        text = f"delays of {ties} samples fit alike; taken is the shortest with the lag of a motor"
        findings.append(
            Finding("delay_open", ("delay_samples", *LAG), text, "add steps of the duty, or give delay_samples")
        )
    return findings
