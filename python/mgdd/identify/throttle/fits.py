"""Which function fits which kind of throttle model, and how a saved one becomes a model again."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from mgdd.errors import ParameterError
from mgdd.identify.throttle.first_principle import fit_first_principle
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.pseudo_wiener_fit import fit_pseudo_wiener
from mgdd.io.parameters import ParameterFile
from mgdd.optimize import FitOptions
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    import xarray as xr

    from mgdd.results import Fit, Model

__all__ = ["KINDS", "check_kind", "fit_kind", "load_throttle_model"]

KINDS = ("first_principle", "pw_r", "pw_w", "pw_p")
_WORTH = 0.97


def fit_kind(
    log: xr.Dataset,
    kind: str,
    *,
    limp_home_deg: float | None,
    two_sided: bool,
    delay_samples: float | Sequence[float],
    stops_deg: tuple[float, float],
    options: FitOptions | None,
) -> Fit:
    """Fit a kind with what the front knows; what is None keeps the fit's own default."""
    closed, opened = stops_deg
    if kind == "first_principle":
        fixed = None if limp_home_deg is None else {"limp_home_deg": limp_home_deg}
        fits = [
            fit_first_principle(
                log, fixed=fixed, free=free, options=options, closed_deg=closed, open_deg=opened,
            )
            for free in ((), ("electrical_s",))
        ]  # fmt: skip
        # A lag of the current that only follows the noise is left out: one number less to carry over.
        return fits[1] if fits[1].report.rmse < _WORTH * fits[0].report.rmse else fits[0]
    sides = "both" if two_sided else "shared"
    return fit_pseudo_wiener(
        log, kind, limp_home_deg=limp_home_deg, sides=sides, delay_samples=delay_samples, options=_seeded(options),
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


def load_throttle_model(path: str | os.PathLike[str]) -> Model:
    """Make a model of the parameters that a fit has written.

    Parameters
    ----------
    path : path-like
        TOML of `mgdd.results.Fit.to_toml`, as ``mgdd throttle identify --output`` writes it.

    Returns
    -------
    mgdd.results.Model
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
    >>> from mgdd.identify import FirstPrincipleModel, load_throttle_model
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
