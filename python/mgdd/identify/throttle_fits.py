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

    import xarray as xr

__all__ = ["fit_kind", "load_throttle_model"]

_STARTS = 4
_TRAVEL = ("closed_deg", "open_deg")


def fit_kind(
    log: xr.Dataset, kind: str, *, limp_home_deg: float | None, two_sided: bool, starts: int | None, seed: int
) -> ThrottleFit:
    """Fit a kind with what the front knows; what is None keeps the fit's own default."""
    if kind == "first_principle":
        fixed = None if limp_home_deg is None else {"limp_home_deg": limp_home_deg}
        return fit_throttle(log, fixed=fixed, n_starts=starts or _STARTS, seed=seed)
    if two_sided and kind != "pw_r":
        raise ParameterError(f"two_sided = True: {kind} has one set of parameters; only pw_r has one per side")
    sides = "both" if two_sided else "shared"
    return fit_pseudo_wiener(log, kind, limp_home_deg=limp_home_deg, sides=sides, starts=starts, seed=seed)


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
