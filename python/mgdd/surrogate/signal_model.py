"""The surface of one signal of a measured engine, and how well it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mgdd.results.describe import described
from mgdd.results.labels import Label
from mgdd.surrogate.sensor_lag import SensorLag

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["SignalModel"]


@described
@dataclass(frozen=True, kw_only=True, eq=False)
class SignalModel:
    """The surface of one signal, and how well it does.

    Parameters
    ----------
    name : str
        The signal.
    label : Label
        Unit and long name.
    coefficients : ndarray, shape (p,)
        Of the terms of `Support.basis`, in the unit of the signal.
    lag_cycles : int
        From the command to the log; of a slow signal the delay before its lag [cycles].
    lag_scores : mapping of int to float
        Cross-validated R² of the static surface at each lag [-].
    lag_at_bound : bool
        Whether the lag lies on the upper edge of what was searched.
    sensor : SensorLag or None
        The dynamics of a slow signal.
    r2 : float
        R² over all records used [-].
    r2_held_out : float
        R² on the last part of the records, from a fit to the part before [-].
    residual_sd : float
        Standard deviation of record minus model, in the unit of the signal.
    cyclic_sd : float
        The part of it from one cycle to the next while the command is held; the rest is what the surface misses.

    Examples
    --------
    >>> from mgdd.surrogate import fit_surrogate, random_step_records
    >>> imep = fit_surrogate(random_step_records(1500)).signals["imep_bar"]
    >>> imep.lag_cycles, round(imep.residual_sd, 1)
    (1, 0.1)
    """

    name: str
    label: Label
    coefficients: NDArray[np.float64]
    lag_cycles: int
    lag_scores: Mapping[int, float]
    lag_at_bound: bool
    sensor: SensorLag | None
    r2: float
    r2_held_out: float
    residual_sd: float
    cyclic_sd: float
