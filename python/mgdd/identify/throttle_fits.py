"""Which function fits which kind of throttle model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mgdd.identify.throttle_fit import ThrottleFit

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fit_kind"]


def fit_kind(
    log: xr.Dataset, kind: str, *, limp_home_deg: float, two_sided: bool, starts: int | None, seed: int
) -> ThrottleFit:
    """Fit a kind with what the front knows; what is None keeps the fit's own default."""
    raise NotImplementedError
