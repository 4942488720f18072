"""The virtual engine bench: SOC and further inputs in, what a bench would measure of that cycle out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex

import numpy as np

from mgdd import _core
from mgdd._core.engine import OperatingPoint
from mgdd._core.loop import SensorDynamics
from mgdd._settings import takes_settings_of
from mgdd.errors import ParameterError, RigError, hinted
from mgdd.loop.lower_limits import measured_names
from mgdd.loop.plant import Measurement, checked_inputs
from mgdd.loop.plant_record import cycles_to_dataset, weights_of
from mgdd.loop.steady import find_optimum, limits_to_keep, split_inputs, steady_map
from mgdd.optimize import Limit
from mgdd.optimize.optimum import Optimum, limit_names_of
from mgdd.presets.meant import CylinderLike, PointLike, engine_of
from mgdd.results.describe import as_html, rows_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from mgdd.results.dataset import Dataset

_SEARCHED_CAD = (-30.0, 10.0)  # by default, as `mgdd engine seek` does
_RANDOM = (
    "soc_scatter_cad", "efficiency_noise_percent", "misfire_probability", "soc_drift_cad_per_kcycle",
    "wall_heat_drift_per_kcycle",
)  # fmt: skip


@takes_settings_of(_core.loop.VirtualEngine, without=("cylinder",))
class VirtualEngine(_core.loop.VirtualEngine):
    """A virtual engine bench: the cycle model with noise, drift and the sensors of a real one.

    The plant scatters, misfires and drifts as asked, and runs through a schedule of operating points. Its sensors are
    a NOx analyser (late and slow), a fast NOx sensor and a soft sensor that maps the maximum gas temperature. All
    noise is a function of seed and cycle: the same seed gives the same run, however it is cut. A bench can be
    pickled and copied at any cycle; one bench must not be stepped from two threads at once.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        A preset, its name, or a cylinder of your own.
    point : OperatingPoint, Preset, str, path-like or mapping of str to float, optional
        Operating point; that of the preset if left out. It must carry fuel.
    schedule : sequence of (int, OperatingPoint), optional
        First cycle of each operating point, the first being 0, instead of ``point``.
    limits : sequence of str, or limits by name or as Limit
        Up to eight indicators to report as limits, NOx by its sensor (``"nox_true_ppm"``, ``"nox_fast_ppm"``, ...),
        ``"t_evo_k"`` (gas temperature at EVO [K], as the exhaust begins to leave), or ``"cov_imep_percent"`` (of the
        last 50 cycles; 0 at the first). The engine measures them; the values that count are those of the search.
    seed : int
        Of all noise, in [0, 2**64).
    **settings
        As `fields` lists them.

    Raises
    ------
    mgdd.errors.ParameterError
        A setting outside its domain; the message names field, value and bound.
    mgdd.errors.ConvergenceError
        A scheduled point without a physical cycle.

    Examples
    --------
    >>> from mgdd.engine import Performance
    >>> from mgdd.loop import VirtualEngine
    >>> bench = VirtualEngine(performance=Performance.efficiency_and_nox(), nox_sensor="analyser", seed=1)
    >>> cycle = bench.step(-6.0)
    >>> len(cycle["components"]), cycle["misfire"]
    (2, False)

    Three inputs, of which EGR takes NOx:

    >>> bench = VirtualEngine(inputs=["soc_cad", "egr", "intake_pressure_kpa"], soc_scatter_cad=0.0)
    >>> [round(bench.step({"soc_cad": -6.0, "egr": egr})["nox_true_ppm"]) for egr in (0.0, 0.3)]
    [1545, 763]
    """

    def __init__(
        self,
        cylinder: CylinderLike = "puma_single",
        point: PointLike | None = None,
        *,
        schedule: Iterable[tuple[int, OperatingPoint]] | None = None,
        limits: Mapping[str, float] | Sequence[Limit | str] = (),
        seed: int = 0,
        **settings: Any,
    ) -> None:
        if schedule is not None and point is not None:
            raise ParameterError("point and schedule were both given: name the operating points in one of them")
        ParameterError.unless(0 <= seed < 2**64, "seed", seed, "in [0, 2**64)")
        cylinder, first = engine_of(cylinder, {} if point is None else point)
        try:
            super().__init__(
                cylinder=cylinder,
                schedule=[(0, first)] if schedule is None else list(schedule),
                limits=limit_names_of(limits),
                seed=seed,
                **settings,
            )
        except ParameterError as error:
            if error.field != "limits" or not isinstance(error.value, str):
                raise
            names = str(error.bound).removeprefix("one of ").split(", ")
            raise error.reworded(hinted(str(error), error.value, names)) from None

    @property
    def input_names(self) -> tuple[str, ...]:
        """What is steered: ``soc_cad`` [°CA aTDC] and what ``inputs`` names besides."""
        return tuple(self.input_bounds)

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limited quantities that a cycle reports."""
        return tuple(self.settings["limits"])

    @property
    def objective(self) -> dict[str, float]:
        """Weights of the quantities in J by name; empty where a term is not a plain multiple of one."""
        return weights_of(self.settings["performance"])

    def apply(self, inputs: Mapping[str, float]) -> None:
        """Set the inputs of the next cycle.

        Parameters
        ----------
        inputs : mapping of str to float
            All of `input_names`; the bench clamps them to `input_bounds` and says so in ``values["clamped"]``.
        """
        self._applied = checked_inputs(inputs, self.input_names)

    def measure(self) -> Measurement:
        """Run one cycle at the inputs applied last.

        Returns
        -------
        Measurement
            ``values`` holds the indicators, actual SOC, NOx of every sensor and the flags as 0 or 1;
            ``applied`` are the inputs within `input_bounds`; ``noise_free_limits`` are the limits there without
            scatter, noise and misfire, the true steady NOx for every sensor and COV of IMEP as NaN.
        """
        applied = getattr(self, "_applied", None)
        if applied is None:
            raise RigError("measure() before apply(): apply a timing first")
        first, further = applied[0], applied[1:]
        noise_free = (
            self.noise_free_limits([first], [self.cycle], [[x] for x in further])[0] if self.limit_names else []
        )
        cycle = super().step(first, further)
        components, limits = cycle.pop("components"), cycle.pop("limits")
        return Measurement(
            components=tuple(map(float, components)),
            limits=limits,
            misfire=cycle["misfire"],
            values={name: float(value) for name, value in cycle.items()},
            noise_free_limits=dict(zip(self.limit_names, map(float, noise_free), strict=True)),
            applied={"soc_cad": float(cycle["soc_applied_cad"])}
            | {name: float(cycle[name]) for name in self.input_names[1:]},
            pressure_bar=self.pressure()[1],
        )

    def step(
        self,
        soc_cad: SupportsFloat | SupportsIndex | Mapping[str, float],
        further: Sequence[SupportsFloat | SupportsIndex] = (),
    ) -> dict[str, Any]:
        """Run one cycle.

        Parameters
        ----------
        soc_cad : float or mapping of str to float
            Start of combustion [°CA aTDC], or inputs by name; clamped to `input_bounds`. NaN and what is left out
            repeat the last one, at first the value of the operating point.
        further : sequence of float
            The other inputs in their order, where ``soc_cad`` is a number.

        Examples
        --------
        >>> from mgdd.loop import VirtualEngine
        >>> cycle = VirtualEngine(inputs=["soc_cad", "egr"], seed=1).step({"soc_cad": -6.0, "egr": 0.9})
        >>> cycle["egr"], cycle["clamped"]
        (0.5, True)
        """
        if isinstance(soc_cad, Mapping):
            first, others = split_inputs(self.input_names, soc_cad, math.nan)
            return super().step(first, others)
        return super().step(soc_cad, further)

    def pressure(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the pressure trace of the last cycle as the sensor reads it.

        Returns
        -------
        angle_cad, pressure_bar : ndarray
            Angles as the encoder labels them, IVC to EVO [°CA aTDC], and pressure [bar]; NaN where no such cycle
            exists. Reading it again gives the same, also after `state` was restored.

        Raises
        ------
        mgdd.errors.RigError
            No cycle has run yet.

        Examples
        --------
        >>> from mgdd.loop import VirtualEngine
        >>> bench = VirtualEngine(soc_scatter_cad=0.0, pressure_gain_error=0.01)
        >>> cycle = bench.step(-6.0)
        >>> angle_cad, pressure_bar = bench.pressure()
        >>> float(pressure_bar.max().round(1))
        108.2
        """
        angle, pressure = self.pressure_columns()
        if not len(angle):
            raise RigError("pressure() before the first cycle: step the bench first")
        return angle, pressure

    def run(self, soc_cad: ArrayLike | Mapping[str, ArrayLike]) -> Dataset:
        """Run one cycle per requested start of combustion, without the GIL.

        Parameters
        ----------
        soc_cad : array_like, or mapping of str to array_like
            Requests [°CA aTDC], one-dimensional; clamped to `window_cad` and flagged, NaN repeats the last one. Or
            columns of several inputs by name, and numbers that hold in every cycle.

        Returns
        -------
        xarray.Dataset
            Over ``cycle``: requested and actual SOC, further inputs as applied (with EGR also the intake oxygen
            ``intake_o2_fraction``), the indicators as measured, NOx by every sensor, the flags,
            ``components`` over ``component`` and their sum ``j``, and ``limits`` over ``limit`` where limits were
            named.

        Examples
        --------
        >>> from mgdd.loop import VirtualEngine
        >>> bench = VirtualEngine(soc_scatter_cad=0.0, efficiency_noise_percent=0.0)
        >>> bench.run([-6.0, -5.0])["p_max_bar"].values.round(1)
        array([107.2, 103. ])
        """
        first, further = split_inputs(self.input_names, soc_cad, math.nan)
        if further:
            first, *further = np.broadcast_arrays(first, *further)
        return cycles_to_dataset(self, self.run_columns(first, further))

    def steady_map(self, soc_cad: ArrayLike | Mapping[str, ArrayLike], *, cycle: int = 0) -> xr.Dataset:
        """Measure without scatter, noise, misfire and drift, each sensor settled; the bench itself does not run.

        Parameters
        ----------
        soc_cad : array_like, or mapping of str to array_like
            Starts of combustion [°CA aTDC], one-dimensional, or values of several inputs by name, whose grid is
            measured; an input that is not named has the value of the operating point.
        cycle : int
            The operating point is that of this cycle of the schedule.

        Returns
        -------
        xarray.Dataset
            Over ``soc_cad`` and the other inputs named: ``j``, ``efficiency_gross``, ``imep_gross_bar``, ``p_max_bar``,
            ``dp_max_bar_per_cad``, ``t_max_k``, ``nox_true_ppm``, ``nox_soft_ppm``.

        Examples
        --------
        >>> from mgdd.loop import VirtualEngine
        >>> VirtualEngine().steady_map([-10.0, -5.0])["efficiency_gross"].values.round(3)
        array([0.557, 0.562])
        """
        return steady_map(self._quiet(cycle), soc_cad)

    def find_optimum(
        self,
        limits: Mapping[str, float | tuple[float | None, float | None]] | Sequence[Limit] | None = None,
        *,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        cycle: int = 0,
    ) -> Optimum:
        """Find the best inputs without noise: what seekers are judged by. The bench itself does not run.

        Parameters
        ----------
        limits : mapping of str to float or (float, float), or sequence of Limit, optional
            Upper limits on what the bench can limit, or lower and upper ones, as in `seek`, for example
            ``{"p_max_bar": 95.0}``; the margin of a `Limit` is kept. NOx of any sensor is the true steady one.
        bounds : mapping of str to (float, float), optional
            Searched ranges by input; those left out are `input_bounds`, of the timing -30 to 10 °CA aTDC.
        cycle : int
            The operating point is that of this cycle of the schedule.

        Returns
        -------
        Optimum
            Input ``soc_cad``, to about 0.001 CAD, and the others; objective ``j``. ``values`` holds the indicators
            there and, for every limited one, ``scatter_NAME``: the standard deviation from cycle to cycle that the
            scatter of SOC causes, to first order, in its unit. The optimum is sought by a grid, then beside its best
            point or, of several inputs and under limits, from its best points by SLSQP. The curvature is taken over
            ±3 CAD at the free optimum; of several inputs it is NaN.

        Raises
        ------
        mgdd.errors.ParameterError
            Bounds outside the window of the bench or of an unknown input, or a limit without a steady value.
        mgdd.errors.ConvergenceError
            Nothing in the range meets the limits.

        Examples
        --------
        >>> from mgdd.loop import VirtualEngine
        >>> round(VirtualEngine().find_optimum()["soc_cad"], 2)
        -5.63
        """
        upper_limits = limits_to_keep(limits)
        split_inputs(self.input_names, bounds or {}, None)
        searched = self.input_bounds | {"soc_cad": _SEARCHED_CAD} | dict(bounds or {})
        quiet = self._quiet(cycle, limits=measured_names(upper_limits))
        return find_optimum(quiet, upper_limits, searched, float(self.settings["soc_scatter_cad"]))

    def _quiet(self, cycle: int, **changes: Any) -> VirtualEngine:
        """Copy the bench without anything random or slow, at the operating point of one cycle."""
        ParameterError.unless(cycle >= 0, "cycle", cycle, ">= 0")
        settings = self.settings
        cylinder = settings.pop("cylinder")
        settings.pop("schedule")
        silent = SensorDynamics(delay_s=0.0, lag_s=0.0, noise_fraction=0.0)
        settings |= {"analyser": silent, "fast_sensor": silent} | dict.fromkeys(_RANDOM, 0.0)
        return VirtualEngine(cylinder, self.point_at(cycle), **settings | changes)

    def _repr_html_(self) -> str:
        return as_html(f"VirtualEngine at cycle {self.cycle}", rows_of(self.settings))
