"""The fit of a pseudo-Wiener model to throttle logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

import numpy as np

from mgdd import _core
from mgdd.errors import DataError, ParameterError
from mgdd.identify.metrics import fit_percent
from mgdd.identify.throttle_fit import ThrottleFit
from mgdd.optimize import FitReport
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["PseudoWienerFit", "fit_pseudo_wiener"]

# Enough that the best of PW-W and PW-P is found more than once on the records of the study.
_STARTS = MappingProxyType({"pw_r": 9, "pw_w": 16, "pw_p": 16})


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PseudoWienerFit(ThrottleFit):
    """A `ThrottleFit` that also says how its searches ended.

    Parameters
    ----------
    hits : int
        Searches that ended at the best fit: once only says that a better one may exist.
    search_rmse_deg : tuple of float
        Error of every search [deg], the best first; infinite where one failed.

    Examples
    --------
    >>> from mgdd.identify import PseudoWienerFit
    >>> "hits" in PseudoWienerFit.__dataclass_fields__
    True
    """

    hits: int = 1
    search_rmse_deg: tuple[float, ...] = ()


def fit_pseudo_wiener(
    log: xr.Dataset | Sequence[xr.Dataset],
    kind: str = "pw_r",
    *,
    limp_home_deg: float | None = None,
    sides: str = "shared",
    free: Sequence[str] = (),
    delay_samples: float | Sequence[float] = 0,
    plays: int = 1,
    start: PseudoWiener | None = None,
    settings: Mapping[str, float] | None = None,
    starts: int | None = None,
    seed: int = 1,
    lag_start: str = "best",
    max_iterations: int = 150,
) -> PseudoWienerFit:
    """Fit a pseudo-Wiener model in free run, from several starts.

    Parameters
    ----------
    log : xarray.Dataset or sequence of them
        ``duty`` [-] and ``angle_deg`` [deg] over an even ``time_s`` [s].
    kind : {"pw_r", "pw_w", "pw_p"}
        Friction and preload inside the block; strict Wiener; Wiener with play.
    limp_home_deg : float, optional
        Limp-home angle [deg]; the first angle of the first log if left out, which must then start at rest there.
    sides : {"shared", "above", "below", "both"}
        PW-R: one set of values for both sides of limp-home, only one side, or a set each.
    free : sequence of str, optional
        Parameters to fit, for PW-R without the side: ``tau_s gain_deg_per_s2_per_duty preload_duty spring_duty_per_deg
        coulomb_duty`` without, further ``square_per_deg cube_per_deg2 limp_home_deg``; for the others all.
    delay_samples : float or sequence of float
        Delay of the duty, 0 to 5 samples; of several the best is kept.
    plays : int
        PW-P: number of plays, 1 to 8.
    start : PseudoWiener, optional
        A single search from here, instead of many.
    settings : mapping of str to float, optional
        Settings and held parameters of the model by name.
    starts : int, optional
        Searches per delay (PW-W and PW-P: per delay and start rule of the lags).
    seed : int
        Of the Latin hypercube of starts.
    lag_start : {"best", "rest", "map"}
        PW-W and PW-P: what the lags hold when a free run starts. ``rest``: no duty, as of a throttle that waits at
        limp-home; ``map``: what the static map turns into the first angle; ``best``: whichever fits better.
    max_iterations : int
        Trial steps per search.

    Returns
    -------
    PseudoWienerFit
        The best of all searches; its findings say how many of them ended there.

    Raises
    ------
    DataError
        Logs of different or uneven sample time, a duty beyond ±1.
    ParameterError
        A kind or name that does not exist.

    Notes
    -----
    Output error with exact forward sensitivities on Levenberg-Marquardt. Only groups of the physical parameters can be
    told from duty and angle: tau = J/b, G = g/J, and preload, spring and friction over the stall torque g.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import fit_pseudo_wiener
    >>> from mgdd.io import throttle_log
    >>> from mgdd.throttle import PseudoWiener
    >>> time = np.arange(4000) * 1e-3
    >>> duty = 0.15 + 0.2 * np.sin(2.0 * np.pi * (0.5 * time + 0.6 * time**2))
    >>> truth = PseudoWiener("pw_r", {"above_coulomb_duty": 0.08, "below_coulomb_duty": 0.08})
    >>> log = throttle_log(time, duty, truth.simulate(time, duty, start_deg=8.0))
    >>> fit = fit_pseudo_wiener(log, limp_home_deg=8.0, starts=2)
    >>> round(fit.parameters["above_coulomb_duty"], 4)
    0.08
    """
    logs = cast("list[xr.Dataset]", [log] if hasattr(log, "variables") else list(log))
    if not logs:
        raise DataError("no logs: a fit needs at least one")
    sample_s = _sample(logs)
    columns = [(one["duty"].to_numpy(), one["angle_deg"].to_numpy()) for one in logs]
    limp_home = float(columns[0][1][0]) if limp_home_deg is None else float(limp_home_deg)
    base = PseudoWiener(kind) if start is None else start
    if base.kind != kind:
        raise ParameterError(f"start is a {base.kind}: must be a {kind}")
    values: dict[str, float] = {**base.at_sample(sample_s).parameters, "limp_home_deg": limp_home}
    if kind == "pw_p" and start is None:
        values["plays"] = float(plays)
    if lag_start not in ("best", "rest", "map"):
        raise ParameterError(f"lag_start = {lag_start!r}: must be one of best, rest, map")
    if lag_start != "best" and "map_start" in values:
        values["map_start"] = float(lag_start == "map")
    values |= {name: float(value) for name, value in (settings or {}).items()}
    delays = [delay_samples] if isinstance(delay_samples, int | float) else list(delay_samples)
    parameters, report, rmse, hits = _core.fit_pseudo_wiener(
        kind=kind,
        records=columns,
        parameters=values,
        sides=sides,
        free=list(free),
        delays=delays,
        starts=_STARTS.get(kind, 1) if starts is None else starts,
        seed=seed,
        only_given_start=start is not None,
        try_map_start=lag_start == "best",
        max_iterations=max_iterations,
    )
    wrapped = FitReport.from_core(report, np.concatenate([angle for _, angle in columns]))
    model = PseudoWiener(kind, parameters)
    modelled = [
        model.simulate(one["time_s"].to_numpy(), duty, start_deg=float(angle[0]))
        for one, (duty, angle) in zip(logs, columns, strict=True)
    ]
    found = [*wrapped.findings]
    if rmse.size > 1:
        found.append(f"{hits} of {rmse.size} searches ended at the best fit")
        if hits < 2:
            found.append("the best fit was found once only: a better one may exist, raise starts")
    if kind == "pw_r" and sides == "shared":
        found.append("one set of values serves both sides of limp-home: sides='both' fits a set each")
    return PseudoWienerFit(
        report=wrapped,
        model=model,
        kind=kind,
        fit_percent_train=fit_percent(np.concatenate([angle for _, angle in columns]), np.concatenate(modelled)),
        parameters=dict(model.parameters),
        unidentifiable=wrapped.unidentifiable,
        findings=tuple(found),
        hits=int(hits),
        search_rmse_deg=tuple(rmse.tolist()),
        source=str(logs[0].attrs.get("file", "log")),
    )


def _sample(logs: Sequence[xr.Dataset]) -> float:
    steps = []
    for one in logs:
        time = one["time_s"].to_numpy()
        steps.append(float(time[-1] - time[0]) / max(1, time.size - 1))
    if max(steps) - min(steps) > 1e-3 * min(steps) or not min(steps) > 0.0:
        raise DataError("the logs have different sample times: resample them to one")
    return steps[0]
