"""The groups of a throttle with as much structure as its log supports: lag, delay, Stribeck drop, presliding, gap."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd.errors import Interrupted, hand_over
from mgdd.identify.starts import spread_starts
from mgdd.identify.throttle.delay_report import with_delay
from mgdd.identify.throttle.first_principle_model import REFINEMENTS, FirstPrincipleModel
from mgdd.identify.throttle.first_principle_problem import GroupsProblem, Search, groups_problem
from mgdd.identify.throttle.free_run import draw_free_run, free_run, quality_of, source_of
from mgdd.optimize.fit_options import FitOptions, fit_options
from mgdd.results import Finding, Fit, FitReport

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["fit_groups", "independent_samples"]

LAG, RAMP, DELAY = ("electrical_s",), ("ramp_deg",), ("delay_samples",)
DROP = ("stribeck_drop", "stribeck_deg_per_s")
PRESLIDING = ("presliding_deg", "presliding_damping")
GAP = ("half_gap_deg",)
_ABSENT = {name: REFINEMENTS[name] for term in (DROP, PRESLIDING, GAP) for name in term}
_SHOWN = {LAG: "lag", DROP: "Stribeck drop", PRESLIDING: "presliding", GAP: "gap"}
# Steps per sample of the first look, of the look at bristles, and of what is handed over.
_COARSE, _BRISTLES, _FINE = 2, 4, 8
_WORTH = 0.99  # what explains less than a hundredth of the error is left out, however certain it is
_FLOOR_DEG = 1e-3  # no sensor shows less: a residual below it is as good as any
_SEEDS = 3  # rough solutions that are looked at from every delay
_MOTOR_LAG_S = 1e-3  # L/R of throttle motors, which decides between delays that the log does not separate
_AT_NOISE = 1.05  # a residual that small leaves nothing to explain
_DROPS, _SPEEDS, _PRESLIDINGS, _HALF_GAPS = (0.08, 0.6), (8.0, 40.0), (0.06, 0.2), (0.1, 0.3)


@dataclass(kw_only=True)
class _Hunt:
    """Searches of one log, what they compared, and the best of them so far."""

    problem: GroupsProblem
    max_iterations: int
    tolerance: float
    best: Search | None = None
    done: list[Search] = field(default_factory=list)

    def search(
        self, values: Mapping[str, float], free: Sequence[str], substeps: int, iterations: int, tolerance: float = 1e-4
    ) -> Search:
        """Search once; an interrupt hands over what it has."""
        try:
            found = self.problem.search(
                values, free, substeps=substeps, tolerance=tolerance,
                max_iterations=min(iterations, self.max_iterations),
            )  # fmt: skip
        except Interrupted as stop:
            if isinstance(stop.partial, Search):
                self.keep(stop.partial)
            raise
        return self.keep(found)

    def keep(self, found: Search) -> Search:
        self.done.append(found)
        if self.best is None or found.rmse < self.best.rmse:
            self.best = found
        return found

    def fine(self, values: Mapping[str, float], free: Sequence[str]) -> Search:
        return self.search(values, free, _FINE, self.max_iterations, self.tolerance)


def fit_groups(
    log: xr.Dataset,
    *,
    fixed: Mapping[str, float] | None = None,
    delays: Sequence[float] = range(6),
    stops_deg: tuple[float, float] = (0.0, 90.0),
    options: FitOptions | None = None,
) -> Fit:
    """Fit the first-principle groups and keep of lag, delay, Stribeck drop, presliding and gap what the log supports.

    Coulomb friction with lag and delay comes first; then the others, each from several starts, with the delay free.
    The structure with the lowest n ln(cost) + k ln(n) is kept (Schwarz 1978), n counting independent samples of the
    residual. It is then fitted with fine steps at the delays about the one found, and every term is tried without.

    Parameters
    ----------
    log : xarray.Dataset
        ``duty`` [-] and ``angle_deg`` [deg] over ``time_s`` [s], evenly sampled.
    fixed : mapping of str to float, optional
        Groups that are known.
    delays : sequence of float
        Delays that may be, in samples.
    stops_deg : tuple of float
        Mechanical stops [deg].
    options : FitOptions, optional
        4 starts of a Stribeck drop with seed 0, 40 trial steps per search, tolerance 1e-7 of the last.

    Returns
    -------
    mgdd.results.Fit
        ``kind`` is ``first_principle``; the finding ``structure_chosen`` says what was compared.

    Raises
    ------
    DataError, ParameterError
        As `mgdd.identify.fit_first_principle`.

    References
    ----------
    Schwarz (1978) for the comparison of structures.
    """
    chosen = fit_options(options, n_starts=4, seed=0, max_iterations=40, tolerance=1e-7)
    problem = groups_problem(log, fixed=fixed, stops_deg=stops_deg)
    hunt = _Hunt(problem=problem, max_iterations=chosen.max_iterations, tolerance=chosen.tolerance)
    interrupted: Interrupted | None = None
    findings: list[Finding] = []
    by_delay: dict[float, Search] = {}
    try:
        rough, terms = _structure(hunt, fixed or {}, sorted(delays), chosen.n_starts, chosen.seed)
        found, by_delay = _whole_delay(hunt, rough, sorted(delays))
        found, terms = _without(hunt, found, terms)
        findings = _told(found, terms, by_delay)
    except Interrupted as stop:
        if hunt.best is None:
            raise
        found, interrupted = hunt.best, stop
    report = FitReport.from_core(found.report, problem.angle)
    if len(by_delay) > 1:
        by_rmse = {delay: max(one.rmse, _FLOOR_DEG) for delay, one in by_delay.items()}
        report = with_delay(report, found.values["delay_samples"], by_rmse, independent_samples(found))
    model = FirstPrincipleModel(
        parameters=found.values, closed_deg=stops_deg[0], open_deg=stops_deg[1], substeps=_FINE, sample_s=problem.step_s
    )
    run = free_run(model, log)
    fit = Fit(
        report=report,
        model=model,
        kind=model.kind,
        train=quality_of([run]),
        unidentifiable=(*problem.unvisited, *report.unidentifiable),
        findings=(*problem.findings, *report.findings, *findings),
        source=source_of(log),
        start_rmse=tuple(sorted(one.rmse for one in hunt.done)),
        n_best=sum(one.rmse <= 1.005 * found.rmse for one in hunt.done),
        run=run,
        draw=draw_free_run,
    )
    return hand_over(fit, interrupted)


def _structure(
    hunt: _Hunt, fixed: Mapping[str, float], delays: Sequence[float], n_starts: int, seed: int
) -> tuple[list[Search], list[tuple[str, ...]]]:
    """Find the structure and its rough values, the best first, with the delay free between the first and the last."""
    problem = hunt.problem
    latency = [*LAG, *(DELAY if len(delays) > 1 else ())]
    further = [*latency, *(RAMP if problem.both_sides else ())]
    base = [*problem.free, *(name for name in further if name not in fixed)]
    values = {**problem.values, "delay_samples": float(min(max(1.0, delays[0]), delays[-1]))}
    values |= {"electrical_s": 1e-3} if "electrical_s" in base else {}

    def of(terms: Sequence[tuple[str, ...]]) -> list[str]:
        return [*base, *(name for term in terms for name in term if name not in fixed)]

    moving = [name for name in ("tau_s", "gain_deg_per_s2_per_duty", *latency) if name in base]
    first = hunt.search(values, moving, _COARSE, 15).values if moving else values
    plain = _best([hunt.search(start, base, _COARSE, 40) for start in (first, values)])
    found: dict[tuple[tuple[str, ...], ...], Search] = {(): plain}
    terms: list[tuple[str, ...]] = [LAG] if "electrical_s" in base else []
    enough = max(_AT_NOISE * noise_of(problem.angle), _FLOOR_DEG)
    if plain.rmse < enough:
        return [plain], terms
    box = [
        _core.optimize.Parameter(name=name, lower=low, upper=high, log_scaled=True)
        for name, (low, high) in zip(DROP, (_DROPS, _SPEEDS), strict=True)
    ]
    start = {**plain.values, "stribeck_drop": 0.15, "stribeck_deg_per_s": 25.0}
    tries = [hunt.search(one, of([DROP]), _COARSE, 20) for one in spread_starts(start, box, n_starts, seed)]
    dropping = hunt.search(_best(tries).values, of([DROP]), _COARSE, 40)
    found[(DROP,)] = dropping
    if dropping.rmse < enough:
        return [dropping], [*terms, DROP]
    tries = [
        hunt.search(
            {**one.values, "presliding_deg": width, "stribeck_drop": max(one.values["stribeck_drop"], 0.05)},
            of([DROP, PRESLIDING]), _BRISTLES, 25,
        )
        for one in (plain, dropping)
        for width in _PRESLIDINGS
    ]  # fmt: skip
    found[(DROP, PRESLIDING)] = hunt.search(_best(tries).values, of([DROP, PRESLIDING]), _BRISTLES, 30)
    if problem.both_sides:
        tries = [
            hunt.search({**plain.values, "half_gap_deg": half, "ramp_deg": 0.25}, of([GAP]), _COARSE, 30)
            for half in _HALF_GAPS
        ]
        found[(GAP,)] = _best(tries)
        found[(DROP, GAP)] = hunt.search({**found[(GAP,)].values, "stribeck_drop": 0.1}, of([DROP, GAP]), _COARSE, 30)
    n = independent_samples(_best(found.values()))
    best = min(found, key=lambda one: _criterion(found[one], len(of(one)), n))
    # Sticking makes the cost rough: what the other structures have found are further starts of the chosen one.
    own = {name: found[best].values[name] for term in best for name in term}
    others = [one for structure, one in found.items() if structure != best]
    again = [hunt.search({**one.values, **_ABSENT, **own}, of(best), _BRISTLES, 25) for one in others]
    return sorted([found[best], *again], key=lambda one: one.rmse)[:_SEEDS], [*terms, *best]


def _whole_delay(hunt: _Hunt, rough: Sequence[Search], delays: Sequence[float]) -> tuple[Search, dict[float, Search]]:
    """Fit with fine steps at the delays about the rough one; of equals take the one whose lag a motor would have."""
    at = rough[0].values["delay_samples"]
    free = [name for name in _names(rough[0]) if name not in DELAY]
    near = [d for d in delays if math.floor(at) - 1 <= d <= math.ceil(at)] or [min(delays, key=lambda d: abs(d - at))]
    found = {}
    for delay in near:
        starts = [_at_delay(one, delay, hunt.problem.step_s, free) for one in rough]
        looks = [hunt.search(start, free, _BRISTLES, 15) for start in starts]
        found[delay] = hunt.fine(_best(looks).values, free)
    for k, delay in enumerate(near):  # each also from where its neighbours ended
        for other in near[max(k - 1, 0) : k] + near[k + 1 : k + 2]:
            again = hunt.fine(_at_delay(found[other], delay, hunt.problem.step_s, free), free)
            if again.rmse < found[delay].rmse:
                found[delay] = again
    enough = max(_best(found.values()).rmse, _FLOOR_DEG) / _WORTH
    ties = [delay for delay in near if found[delay].rmse <= enough]
    kept = min(ties, key=lambda delay: abs(math.log(max(found[delay].values["electrical_s"], 1e-5) / _MOTOR_LAG_S)))
    return found[kept], found


def _without(hunt: _Hunt, found: Search, terms: list[tuple[str, ...]]) -> tuple[Search, list[tuple[str, ...]]]:
    """Try every term without, the last first; what the log does not miss is left out."""
    for term in [PRESLIDING, GAP, DROP, LAG]:
        if term not in terms or (term == DROP and PRESLIDING in terms):
            continue
        free = [name for name in _names(found) if name not in term]
        absent = {**_ABSENT, "electrical_s": 0.0}
        smaller = hunt.fine({**found.values, **{name: absent[name] for name in term}}, free)
        n = independent_samples(found)
        if not _missed(smaller, found, len(term), n):
            found, terms = smaller, [one for one in terms if one != term]
    return found, terms


def independent_samples(found: Search) -> float:
    """Return how many independent samples the residual is worth: samples over its integrated correlation time."""
    residual = np.asarray(found.report.residual)
    return residual.size / _core.optimize.autocorrelation_time(residual)


def noise_of(angle: NDArray[np.float64]) -> float:
    """Return the standard deviation of white noise on an angle: its second differences, which motion hardly has."""
    second = np.diff(angle, 2)
    return float(1.4826 * np.median(np.abs(second)) / math.sqrt(6.0))


def _missed(smaller: Search, larger: Search, size: int, n: float) -> bool:
    """Whether the log needs the `size` numbers that the larger model has beyond the smaller."""
    low, high = max(larger.rmse, _FLOOR_DEG), max(smaller.rmse, _FLOOR_DEG)
    return low < _WORTH * high and 2.0 * n * math.log(high / low) > size * math.log(n)


def _criterion(found: Search, size: int, n: float) -> float:
    return 2.0 * n * math.log(max(found.rmse, _FLOOR_DEG)) + size * math.log(n)


def _at_delay(found: Search, delay: float, step_s: float, free: Sequence[str]) -> dict[str, float]:
    """Move a part of the latency between delay and lag."""
    values = {**found.values, "delay_samples": float(delay)}
    if "electrical_s" in free:
        lag = found.values["electrical_s"] + step_s * (found.values["delay_samples"] - delay)
        values["electrical_s"] = min(max(lag, 1e-4), 0.015)
    return values


def _names(found: Search) -> list[str]:
    return [name for name in found.report.names if name in found.values]


def _best(searches: Iterable[Search]) -> Search:
    return min(searches, key=lambda one: one.rmse)


def _told(found: Search, terms: Sequence[tuple[str, ...]], by_delay: Mapping[float, Search]) -> list[Finding]:
    """Say what the model has and what it is worth, and how other delays fare."""
    has = ", ".join(_SHOWN[term] for term in terms) or "none"
    left = ", ".join(_SHOWN[term] for term in _SHOWN if term not in terms) or "nothing"
    text = f"Coulomb friction with {has} ({found.rmse:.3g} deg RMS); left out, as the log does not support it: {left}"
    if len(by_delay) < 2:
        return [Finding("structure_chosen", tuple(name for term in terms for name in term), text)]
    each = ", ".join(f"{delay:g}: {one.rmse:.3g}" for delay, one in sorted(by_delay.items()))
    text += f"; delay {found.values['delay_samples']:g} samples (deg RMS by delay: {each})"
    told = [Finding("structure_chosen", tuple(name for term in terms for name in term), text)]
    enough = max(_best(by_delay.values()).rmse, _FLOOR_DEG) / _WORTH
    ties = [f"{delay:g}" for delay, one in sorted(by_delay.items()) if one.rmse <= enough]
    if len(ties) > 1:
        text = (
            f"delays of {' and '.join(ties)} samples fit within a hundredth; taken is the one with the lag of a motor"
        )
        told.append(
            Finding("delay_open", ("delay_samples", *LAG), text, "add steps of the duty, or give delay_samples")
        )
    return told
