"""Which function fits which kind of throttle model, and how a saved one becomes a model again."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mgdd.errors import ParameterError
from mgdd.identify.throttle.automatic import fit_groups
from mgdd.identify.throttle.choice import fit_auto
from mgdd.identify.throttle.first_principle_model import LONGEST_DELAY, FirstPrincipleModel
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.io.parameters import ParameterFile
from mgdd.optimize import FitOptions
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

    from mgdd.results import Fit
    from mgdd.results.model import Model

PSEUDO_WIENER = ("pw_r", "pw_w", "pw_p")
KINDS = ("first_principle", *PSEUDO_WIENER)
CHOICES = ("auto", *KINDS)
_DELAYS = tuple(float(delay) for delay in range(int(LONGEST_DELAY) + 1))
_PW_DELAY = 5.0  # the longest of a pseudo-Wiener model, whose delay line is part of its state


def fit_kind(
    log: xr.Dataset,
    kind: str,
    *,
    limp_home_deg: float | None,
    two_sided: bool,
    delay_samples: float | Sequence[float] | None,
    stops_deg: tuple[float, float],
    options: FitOptions | None,
) -> Fit:
    """Fit a kind with what the front knows; what is None keeps the fit's own default."""
    if kind not in PSEUDO_WIENER:
        fixed = None if limp_home_deg is None else {"limp_home_deg": limp_home_deg}
        fit = fit_auto if kind == "auto" else fit_groups
        delays = _DELAYS if delay_samples is None else delays_of(delay_samples)
        return fit(log, fixed=fixed, delays=delays, stops_deg=stops_deg, options=options)
    closed, opened = stops_deg
    sides = "both" if two_sided else "shared"
    return fit_pseudo_wiener(
        log, kind, limp_home_deg=limp_home_deg, sides=sides, delay_samples=delay_samples or 0,
        options=_seeded(options), settings={"closed_deg": closed, "open_deg": opened},
    )  # fmt: skip


def check_kind(kind: str, *, two_sided: bool, delay_samples: float | Sequence[float] | None) -> None:
    """Refuse what the kind does not have, before the log is looked at."""
    if two_sided and kind in ("pw_w", "pw_p"):
        raise ParameterError(f"two_sided = True: {kind} has one set of parameters; only pw_r has one per side")
    longest = _PW_DELAY if kind in PSEUDO_WIENER else LONGEST_DELAY
    for delay in () if delay_samples is None else delays_of(delay_samples):
        if not 0.0 <= delay <= longest:
            raise ParameterError.of("delay_samples", delay, f"within [0, {longest:g}]")


def delays_of(delay_samples: float | Sequence[float]) -> tuple[float, ...]:
    """Return the delays that were asked for, at least one."""
    delays = (delay_samples,) if isinstance(delay_samples, int | float) else tuple(delay_samples)
    if not delays:
        raise ParameterError("delay_samples = (): must be at least one delay")
    return tuple(float(delay) for delay in delays)


def load_throttle_model(path: str | os.PathLike[str]) -> Model:
    """Make a model of the parameters that a fit has written.

    Parameters
    ----------
    path : path-like
        TOML of `mgdd.results.Fit.to_toml`, as ``mgdd throttle identify --output`` writes it.

    Returns
    -------
    Model
        Ready to simulate.

    Raises
    ------
    FileNotFoundError
        No such file.
    DataError
        Not TOML, another kind or format version, a missing table or key.
    ParameterError
        An unknown key, another unit, a wrong type, a value outside its domain.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.identify import load_throttle_model
    >>> from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "fit.toml"
    ...     _ = file.write_text(FirstPrincipleModel().to_toml())
    ...     load_throttle_model(file).kind
    'first_principle'
    """
    file = ParameterFile.read(path)
    model = FirstPrincipleModel if file.kind == "first_principle" else PseudoWiener
    file.expect(kinds=KINDS, tables=file.tables, notes=file.notes)
    return model.of_file(file)


def _seeded(options: FitOptions | None) -> FitOptions:
    """Return the options with the seed of every identification, 0."""
    known = options or FitOptions()
    return known if known.seed is not None else replace(known, seed=0)
