"""Controllers tuned alike: one cost, one set of throttles and references, one budget for every kind."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd.errors import Interrupted, ParameterError
from mgdd.loop.controller_families import Setup, groups_of
from mgdd.loop.many_tracks import track_many
from mgdd.loop.plates import PlateLike, PlatePlant, plate_of
from mgdd.loop.reference import Reference
from mgdd.loop.track import SWINGS_DEG
from mgdd.loop.tuned import family_of, shipped_numbers
from mgdd.parallel.finished import hand_over
from mgdd.results.result import NumbersResult
from mgdd.throttle import Throttle

if TYPE_CHECKING:
    import xarray as xr

_SPREAD_FIELDS = (
    ("inertia_kgm2",),
    ("viscous_nms_per_rad",),
    ("torque_constant_nm_per_a", "back_emf_vs_per_rad"),
    ("resistance_ohm",),
    ("spring_above_nm_per_rad", "spring_below_nm_per_rad"),
    ("preload_above_nm", "preload_below_nm"),
    ("coulomb_nm", "stiction_nm"),
)
_MOST = 5.0  # a run that never settles costs as much as one that takes five times as long as wanted


def with_stiction(factors: Mapping[str, float]) -> dict[str, float]:
    """Let stiction grow by the factor of the dry friction, unless it has one of its own."""
    friction = {"stiction_nm": factors["coulomb_nm"]} if "coulomb_nm" in factors else {}
    return dict(factors) | {name: factor for name, factor in friction.items() if name not in factors}


def draw_throttles(throttle: Throttle, n: int, *, spread: float = 0.2, seed: int = 0) -> list[Throttle]:
    """Draw throttles around one: inertia, viscous friction, motor, resistance, springs, preloads and dry friction."""
    ParameterError.unless(0.0 <= spread <= 0.9, "spread", spread, "in [0, 0.9]")
    ParameterError.unless(n >= 0, "n", n, ">= 0")
    factors = 1.0 + spread * (2.0 * np.random.default_rng(seed).random((n, len(_SPREAD_FIELDS))) - 1.0)
    return [
        throttle.replace(
            **{
                name: getattr(throttle, name) * float(factor)
                for names, factor in zip(_SPREAD_FIELDS, row, strict=True)
                for name in names
            }
        )
        for row in factors
    ]


def tuning_references() -> dict[str, tuple[Reference, float]]:
    """Give the references of the tuner with their wanted settling time [ms], of the sine its mean square error."""
    settling_ms = {(20, 60): 70.0, (60, 25): 70.0, (40, 42): 25.0, (42, 41): 20.0, (4, 20): 50.0, (20, 4): 50.0}
    steps = [
        (Reference.step(a, b, hold_s=0.4, after_s=0.6, band_deg=max(0.2, 0.02 * abs(b - a))), ms)
        for (a, b), ms in settling_ms.items()
    ]
    sine = Reference.sine(40.0, 10.0, 1.0, duration_s=2.0, skip_s=0.5)
    return {reference.name: (reference, goal) for reference, goal in [*steps, (sine, 0.05)]}


def tracking_cost(runs: xr.Dataset) -> float:
    """Cost of runs along `tuning_references`: mean over the throttles plus half their 95th percentile.

    Of each throttle: settling times over the wanted ones, the sine's error over the wanted one, each at most 5, mean
    static error over 0.1 deg, half the mean overshoot in deg, mean total variation over 20, and 5 per limit cycle
    above 0.5 deg.
    """
    goals = tuning_references()
    total = np.zeros(runs.sizes["throttle"])
    for name, (_, goal) in goals.items():
        run = runs.sel(reference=name)
        if name.startswith("sine"):
            total += np.minimum(run["mse_deg2"].to_numpy() / goal, _MOST)
            continue
        settling = np.nan_to_num(run["settling_ms"].to_numpy(), nan=1e9)
        total += np.minimum(settling / goal, _MOST)
        total += 5.0 * (run["limit_cycle_deg"].to_numpy() > SWINGS_DEG)
        total += np.minimum(run["static_error_deg"].to_numpy() / 0.1, _MOST) / 6.0
        total += 0.5 * np.minimum(run["overshoot_deg"].to_numpy(), 10.0) / 6.0
    total += np.minimum(runs["total_variation"].mean("reference").to_numpy() / 20.0, _MOST)
    return float(total.mean() + 0.5 * np.quantile(total, 0.95))


@dataclass(frozen=True, kw_only=True, repr=False)
class Tuning(NumbersResult):
    """What tuning found: numbers that `tuned_controller` takes, and how the search went."""

    kind: str
    numbers: Mapping[str, float]
    cost: float
    start_cost: float
    evaluations: int
    settings: Mapping[str, Any] = field(default_factory=dict)


def tune_controller(
    kind: str,
    throttle: PlateLike | Sequence[PlateLike],
    *,
    model: Any = None,
    n_throttles: int = 20,
    spread: float = 0.2,
    budget: int = 200,
    seed: int = 0,
    delay_samples: int | None = None,
    noise_deg: float = 0.03,
    workers: int | None = None,
) -> Tuning:
    """Tune a kind of controller for throttles around one; it knows that one only.

    Every kind has the same references, throttles, noise, cost and budget: the shipped set, a Latin hypercube over its
    numbers (a third of the budget), then the simplex of Nelder and Mead (1965) from its best corners.

    Parameters
    ----------
    kind : str
        ``guided``, ``mgdd1``, ``pid``, ``sliding_mode``, ``linear_mpc`` or ``nmpc``.
    throttle : Throttle, Preset, Fit, its model, str or path-like, or a sequence of plants
        The centre of the throttles, and what the controller knows. A sequence, or an object with ``step(duty)`` and
        ``output`` as `track` takes it, is all the plants that there are: none is drawn.
    model : optional
        What the controller knows, as for `tuned_controller`; `throttle` if left out.
    n_throttles, spread : int, float
        How many throttles, and the share by which seven of their numbers vary.
    budget : int
        Runs of the whole set, at least 30.
    seed : int
        Of throttles, noise and search.
    delay_samples, noise_deg : int, float
        As for `track_many`; left out, the delay of the model, to the nearest sample, or 1 where it has none.
    workers : int, optional
        As for `track_many`.

    Returns
    -------
    Tuning
        Its ``numbers`` make the controller, with the delay that they were found at: ``tuned_controller(kind, throttle,
        numbers=tuning.numbers, delay_samples=tuning.settings["delay_samples"])``.

    Raises
    ------
    mgdd.errors.ParameterError
        An unknown kind or a budget below 30.
    mgdd.errors.Interrupted
        Ctrl-C; ``partial`` is the Tuning of the sets that were run to the end, None where none was.

    Examples
    --------
    >>> from mgdd.loop import tune_controller
    >>> from mgdd.throttle import Throttle
    >>> tuning = tune_controller("mgdd1", Throttle(), n_throttles=2, budget=30)
    >>> tuning.cost <= tuning.start_cost, tuning.evaluations
    (True, 30)
    """
    family = family_of(kind)
    ParameterError.unless(budget >= 30, "budget", budget, ">= 30")
    stated = isinstance(throttle, Sequence) and not isinstance(throttle, str)
    plants: list[Any] = [*throttle] if stated else [throttle]  # type: ignore[misc]
    if not plants:
        raise ParameterError("throttle: give at least one plant")
    plates = [plate_of(each) for each in plants]
    known = plates[0] if model is None else plate_of(model)
    if isinstance(known.plant, PlatePlant):
        raise ParameterError.of(
            "model", model, "what the controller knows of a plant of your own: a fit of its log, a Throttle or a preset"
        )
    references = [reference for reference, _ in tuning_references().values()]
    groups, centre = groups_of(known.model or known.plant), plates[0].plant
    delay_samples = known.delay_samples(delay_samples, references[0].sample_s)
    setup = Setup(delay_samples=delay_samples, noise_deg=noise_deg)
    if isinstance(centre, Throttle) and not stated:
        plants = draw_throttles(centre, n_throttles, spread=spread, seed=seed)
    seen: list[tuple[float, tuple[float, ...]]] = []

    def cost_of(shares: Sequence[float]) -> float:
        if len(seen) >= budget:
            raise StopIteration
        inside = np.clip(np.asarray(shares, float), 0.0, 1.0)
        controller = family.build(groups, _numbers(family.space, inside), setup)
        runs = track_many(
            {kind: controller},
            references,
            plants,
            delay_samples=delay_samples,
            noise_deg=noise_deg,
            first_seed=seed,
            workers=workers,
        )
        outside = float(np.abs(np.asarray(shares, float) - inside).sum())
        cost = tracking_cost(runs.isel(controller=0)) + 10.0 * outside
        seen.append((cost, tuple(map(float, inside))))
        return cost

    stop: Interrupted | None = None
    try:
        numbers = shipped_numbers(kind, groups)
        shares = []
        for name, (low, high, logarithmic) in family.space.items():
            value = min(max(numbers[name], low), high)
            shares.append(math.log(value / low) / math.log(high / low) if logarithmic else (value - low) / (high - low))
        _search(cost_of, shares, budget, seed, seen)
    except KeyboardInterrupt:
        stop = Interrupted(f"interrupted: {len(seen)} of {budget} sets were run, the best is in .partial")
    if stop is not None and not seen:
        stop.partial = None  # the runs of half a set are not a tuning
        raise stop
    best, point = min(seen)
    tuning = Tuning(
        kind=kind,
        numbers=_numbers(family.space, point),
        cost=best,
        start_cost=seen[0][0],
        evaluations=len(seen),
        settings={
            "n_throttles": len(plants),
            "spread": spread,
            "seed": seed,
            "delay_samples": delay_samples,
            "noise_deg": noise_deg,
        },
    )
    return hand_over(tuning, stop)


def _search(
    cost_of: Callable[[Sequence[float]], float],
    start: Sequence[float],
    budget: int,
    seed: int,
    seen: Sequence[tuple[float, tuple[float, ...]]],
) -> None:
    """Spend the budget; `seen` holds what `cost_of` was asked."""
    from scipy.optimize import minimize
    from scipy.stats import qmc

    n = len(start)
    cost_of(start)
    for point in qmc.LatinHypercube(n, seed=seed).random(budget // 3):
        cost_of(point)
    while len(seen) < budget:
        corners = np.array([point for _, point in sorted(seen)[: n + 1]])
        before = len(seen)
        try:
            minimize(
                cost_of,
                corners[0],
                method="Nelder-Mead",
                options={"initial_simplex": corners, "adaptive": True, "xatol": 1e-3, "fatol": 1e-3},
            )
        except StopIteration:
            break
        if len(seen) < before + 2 * n:  # it stands: look elsewhere near the best
            rng = np.random.default_rng([seed, len(seen)])
            try:
                for _ in range(2 * n):
                    cost_of(np.clip(corners[0] + 0.1 * rng.normal(size=n), 0.0, 1.0))
            except StopIteration:
                break


def _numbers(space: Mapping[str, tuple[float, float, bool]], shares: Sequence[float]) -> dict[str, float]:
    out = {}
    for (name, (low, high, logarithmic)), share in zip(space.items(), shares, strict=True):
        value = low * (high / low) ** share if logarithmic else low + (high - low) * share
        out[name] = float(f"{value:.4g}")
    return out
