"""Which function fits which kind of throttle model, and how a saved one becomes a model again."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import TYPE_CHECKING

from mgdd.errors import ParameterError
from mgdd.identify.first_principle import fit_throttle
from mgdd.identify.first_principle_model import FirstPrincipleModel
from mgdd.identify.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.identify.throttle_fit import FittedParameters, ThrottleFit, ThrottleModel
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

__all__ = ["check_kind", "fit_kind", "load_throttle_model"]

_STARTS = 4
_WORTH = 0.97
_TRAVEL = ("closed_deg", "open_deg")


def fit_kind(
    log: xr.Dataset,
    kind: str,
    *,
    limp_home_deg: float | None,
    two_sided: bool,
    delay_samples: float | Sequence[float],
    stops_deg: tuple[float, float],
    starts: int | None,
    seed: int,
) -> ThrottleFit:
    """Fit a kind with what the front knows; what is None keeps the fit's own default."""
    closed, opened = stops_deg
    if kind == "first_principle":
        fixed = None if limp_home_deg is None else {"limp_home_deg": limp_home_deg}
        fits = [
            fit_throttle(
                log, fixed=fixed, electrical=electrical, n_starts=starts or _STARTS, seed=seed,
                closed_deg=closed, open_deg=opened,
            )
            for electrical in (False, True)
        ]  # fmt: skip
        # A lag of the current that only follows the noise is left out: one number less to carry over.
        return fits[1] if fits[1].report.rmse < _WORTH * fits[0].report.rmse else fits[0]
    sides = "both" if two_sided else "shared"
    return fit_pseudo_wiener(
        log, kind, limp_home_deg=limp_home_deg, sides=sides, delay_samples=delay_samples, starts=starts, seed=seed,
        settings={"closed_deg": closed, "open_deg": opened},
    )  # fmt: skip


def check_kind(kind: str, *, two_sided: bool, delay_samples: float | Sequence[float]) -> None:
    """Refuse what the kind does not have, before the log is looked at."""
    if two_sided and kind in ("pw_w", "pw_p"):
        raise ParameterError(f"two_sided = True: {kind} has one set of parameters; only pw_r has one per side")
    if kind == "first_principle" and delay_samples not in (0, (0,), [0]):
        raise ParameterError(
            f"delay_samples = {delay_samples!r}: the first-principle groups have none; pw_r, pw_w and pw_p do"
        )


def load_throttle_model(path: str | os.PathLike[str]) -> ThrottleModel:
    """Make a model of the parameters that a fit has written.

    Parameters
    ----------
    path : path-like
        TOML of `ThrottleFit.to_toml`, as ``mgdd throttle identify --output`` writes it.

    Returns
    -------
    ThrottleModel
        Ready to simulate.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        Not TOML, no parameters, a wrong unit.
    ParameterError
        An unknown kind or parameter, a value outside its domain.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.identify import FirstPrincipleModel, load_throttle_model, throttle_start
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "fit.toml"
    ...     _ = file.write_text(FirstPrincipleModel(parameters=throttle_start()).to_toml())
    ...     load_throttle_model(file).kind
    'first_principle'
    """
    file = Path(path)
    if not file.exists():
        raise FileNotFoundError(errno.ENOENT, "no such file: check the path", str(file))
    saved = FittedParameters.from_toml(file.read_text(encoding="utf-8"), source=str(file))
    if saved.kind != "first_principle":
        return PseudoWiener(saved.kind, saved.values)
    values = dict(saved.values)
    travel = {name: values.pop(name) for name in _TRAVEL if name in values}
    closed, opened = travel.get("closed_deg", 0.0), travel.get("open_deg", 90.0)
    return FirstPrincipleModel(parameters=values, closed_deg=closed, open_deg=opened)
