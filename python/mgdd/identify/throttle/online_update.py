"""The on-line update of PW-R beside a running throttle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError
from mgdd.presets.meant import ThrottleLike, throttle_model_of
from mgdd.results import Fit
from mgdd.signals.model import SampledModel
from mgdd.throttle import PseudoWiener

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_ALL = ("tau_s", "gain_deg_per_s2_per_duty", "preload_duty", "spring_duty_per_deg", "coulomb_duty")


class OnlineUpdate:
    """Keeps PW-R up to date while a throttle runs: what has been learned so far is `model`.

    Parameters
    ----------
    model : PseudoWiener, or Fit, its model, Throttle, Preset, str or path-like
        Start, of kind ``pw_r``; PW-R with the groups of anything else.
    method : {"recursive_least_squares", "window", "gradient"}
        Recursive least squares with gates; a sliding window of 100 points with a prior; a normalised gradient.
    free : sequence of str, optional
        Parameters that may move; gain and preload without, with ``window`` all five. What stays is held as a torque
        over the inertia, since supply and winding resistance change the gain alone.
    every : int
        Samples per difference (``recursive_least_squares``) or per point (``window``).
    noise_deg : float
        Standard deviation of the sensor [deg]; smaller errors than 3 of it teach nothing.
    forgetting : float
        ``recursive_least_squares``: forgetting factor per update [-].
    prior_spread : float
        ``window``: standard deviation of the prior as a share of each parameter [-].
    iterate_every : int
        ``window``: samples between its steps.
    adaptation_gain : float
        ``gradient``: g_r [-].

    Raises
    ------
    ParameterError
        A model of another kind, an unknown method or parameter.

    Notes
    -----
    g_r is a symbol of Tan (2018); the law behind it is ours. Supply and winding resistance change the gain alone, so
    preload, spring and friction in duty all fall where the gain rises.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.identify import OnlineUpdate
    >>> from mgdd.throttle import PseudoWiener
    >>> update = OnlineUpdate(PseudoWiener("pw_r"))
    >>> update.update(np.full(1000, 0.15), np.full(1000, 45.0)), update.model == PseudoWiener("pw_r")
    (0, True)
    """

    def __init__(
        self,
        model: ThrottleLike | Fit | SampledModel,
        *,
        method: str = "recursive_least_squares",
        free: Sequence[str] | None = None,
        every: int = 5,
        noise_deg: float = 0.03,
        forgetting: float = 0.998,
        prior_spread: float = 0.2,
        iterate_every: int = 50,
        adaptation_gain: float = 0.05,
    ) -> None:
        meant = throttle_model_of(model)
        start = meant if isinstance(meant, PseudoWiener) else PseudoWiener.of_throttle(meant)
        if start.kind != "pw_r":
            raise ParameterError(f"model is a {start.kind}: must be a pw_r")
        self._start = start
        names = list(free if free is not None else (_ALL if method == "window" else _ALL[1:3]))
        values = dict(start.parameters)
        self._core: _core.identify.RecursivePwR | _core.identify.WindowPwR | _core.identify.GradientPwR
        if method == "recursive_least_squares":
            self._core = _core.identify.RecursivePwR(
                values, free=names, every=every, noise_deg=noise_deg, forgetting=forgetting
            )
        elif method == "window":
            self._core = _core.identify.WindowPwR(
                values,
                free=names,
                every=every,
                noise_deg=noise_deg,
                prior_spread=prior_spread,
                iterate_every=iterate_every,
            )
        elif method == "gradient":
            self._core = _core.identify.GradientPwR(
                values, free=names, adaptation_gain=adaptation_gain, noise_deg=noise_deg
            )
        else:
            raise ParameterError.of("method", method, "one of 'recursive_least_squares', 'window', 'gradient'")

    def update(self, duty: ArrayLike, angle_deg: ArrayLike) -> int:
        """Take one or many samples in order.

        Parameters
        ----------
        duty, angle_deg : float or array_like, shape (n,)
            Duty sent [-] and angle measured [deg] at each sample; NaN where one was dropped, which keeps the clock
            and teaches nothing.

        Returns
        -------
        int
            How many of them changed the model.

        Raises
        ------
        ShapeError
            Columns of different length.
        """
        return int(self._core.update(np.atleast_1d(duty), np.atleast_1d(angle_deg)))

    @property
    def model(self) -> PseudoWiener:
        """The model as it is now."""
        return PseudoWiener("pw_r", self._core.parameters)

    def state(self) -> dict[str, Any]:
        """Give all that a restart needs as named columns of numbers."""
        return {name: list(values) for name, values in self._core.state().items()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a saved state, bit for bit."""
        self._core.restore({str(name): list(values) for name, values in state.items()})
