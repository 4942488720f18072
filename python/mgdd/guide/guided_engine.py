"""The whole guided loop of an engine: seek, calibrate, re-optimise, blend."""

from __future__ import annotations

import copy
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from mgdd import _core
from mgdd._core.engine import OperatingPoint
from mgdd.errors import ParameterError
from mgdd.guide.guided import TOLD, Column, Guided
from mgdd.guide.model_optimum import ModelOptimum
from mgdd.guide.online_calibration import OnlineCalibration

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd.optimize import Seeker

_CAD = "°CA aTDC"


class GuidedEngine(Guided, _core.guide.GuidedEngine):
    """Seek, calibrate, re-optimise and blend, one engine cycle at a time.

    ``at(point)`` says at which operating point the next cycle runs, ``ask()`` gives its timing, ``tell(J,
    pressure_bar=...)`` takes what was measured. A seeker of `mgdd.optimize` gets the model's optimum as feed-forward
    (`FeedForward`); `CurveSeeking` gets the model's curve. With a calibration the model follows the measured pressure,
    and what it says anew reaches the seeker without moving the applied timing by itself. `mgdd.loop.run_seeker` runs
    it on any plant; the work per cycle is bounded.

    Parameters
    ----------
    seeker : Seeker
        Of one input, the start of combustion [°CA aTDC], maximising; copied as it stands.
    model : ModelOptimum
        The guide; copied.
    point : OperatingPoint
        Of the first cycle; the model must have a best timing there.
    calibration : OnlineCalibration, optional
        What keeps the model true to the pressure; copied, of a cylinder of the same geometry.
    changed_share : float
        Change of speed, fuel or intake that makes a new operating point [-].
    calibrated_sd_cad : float
        How far the best timing of a calibrated model may lie from the plant's, one standard deviation [°CA].
    recalibrated_cad : float
        Move of the model's best timing below which a calibration is not passed on [°CA].
    calibration_rate_cad : float
        Largest move of a feed-forward per cycle after a calibration [°CA].
    noise_sd : float, optional
        Standard deviation of one reading, for the trust in a feed-forward [unit of J]; learnt without.
    keep_start : bool
        Begin at the seeker's own start, or where it stands if it has run; by itself a run begins at the model's best
        timing. The trim takes the distance; a `CurveSeeking` uses the model from the second cycle on.

    Raises
    ------
    mgdd.errors.ParameterError
        A model without a best timing, another geometry, a setting outside its domain.

    References
    ----------
    Tan (2018), figure 6-1 and chapter 6 (structure). Curve, trust and bumpless rules are ours.

    Examples
    --------
    >>> from mgdd.engine import Cylinder
    >>> from mgdd.guide import CurveSeeking, GuidedEngine, ModelOptimum, OnlineCalibration
    >>> from mgdd.loop import VirtualEngine, run_seeker
    >>> bench = VirtualEngine(seed=2)  # its wall heat is 0.5
    >>> rough = Cylinder(wall_heat_scale=1.0)
    >>> model = ModelOptimum(rough)
    >>> curve = model.curve(bench.point)
    >>> seeker = CurveSeeking(start=curve.best, bounds=(-30.0, 10.0), curve=curve)
    >>> guided = GuidedEngine(seeker, model, bench.point, calibration=OnlineCalibration(rough))
    >>> run = run_seeker(bench, guided, 80)
    >>> round(guided.cylinder.wall_heat_scale, 1), abs(run.summary["final_soc_cad"] + 5.63) < 1.0
    (0.5, True)
    """

    _columns = MappingProxyType({
        "guide_optimum": Column(_CAD, "best timing by the guide", per_input=True),
        "feed_forward": Column(_CAD, "feed-forward in force", per_input=True),
        "trim": Column("°CA", "trim, estimate less feed-forward", per_input=True),
        "estimate": Column(_CAD, "estimate of the best timing", per_input=True),
        "estimate_sd": Column("°CA", "standard deviation of the estimate as stated", per_input=True),
        "trust": Column("-", "trust in the guide"),
        "wall_heat_scale": Column("-", "wall-heat scale of the guide"),
        "applied": Column(_CAD, "applied timing", per_input=True),
        **TOLD,
    })  # fmt: skip
    _shown = ("recalibrations", "refusals", "calibration_status")

    def __init__(
        self,
        seeker: Seeker,
        model: ModelOptimum,
        point: OperatingPoint,
        *,
        calibration: OnlineCalibration | None = None,
        changed_share: float = 0.05,
        calibrated_sd_cad: float = 2.0,
        recalibrated_cad: float = 0.1,
        calibration_rate_cad: float = 1.0,
        noise_sd: float | None = None,
        keep_start: bool = False,
    ) -> None:
        ParameterError.unless(isinstance(model, ModelOptimum), "model", model, "a ModelOptimum")
        if calibration is not None and not isinstance(calibration, OnlineCalibration):
            raise ParameterError.of("calibration", calibration, "an OnlineCalibration, or None")
        self._options: dict[str, Any] = {
            "changed_share": changed_share,
            "calibrated_sd_cad": calibrated_sd_cad,
            "recalibrated_cad": recalibrated_cad,
            "calibration_rate_cad": calibration_rate_cad,
            "noise_sd": noise_sd,
            "keep_start": keep_start,
        }
        super().__init__(seeker, model, calibration, point, **self._options)
        self._seeker_kind, self._seeker_settings = seeker.kind, seeker.settings
        self._made_of = (
            (copy.deepcopy(seeker), copy.deepcopy(model), point),
            {"calibration": copy.deepcopy(calibration)},
        )
        self._rows = []

    def _standing(self) -> dict[str, Any]:
        return dict(zip(self._columns, self._now().values(), strict=False))  # in the order of the core

    def _arguments(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        return self._made_of

    def at(self, point: OperatingPoint) -> Literal["followed", "refused"]:
        """Say at which operating point the next cycle runs; call it before `ask`, in every cycle.

        Parameters
        ----------
        point : OperatingPoint
            Speed, fuel and intake.

        Returns
        -------
        {"followed", "refused"}
            ``refused``: the model has no answer there; its last answer stands, and it is asked again in the next
            cycle.

        Raises
        ------
        mgdd.errors.ParameterError
            A call between `ask` and `tell`.
        """
        return "followed" if self._at(point) == "followed" else "refused"

    def tell(
        self,
        J: Any = None,  # noqa: N803
        limits: Any = None,
        *,
        misfire: bool = False,
        applied: Any = None,
        pressure_bar: ArrayLike | None = None,
    ) -> None:
        """Accept what was measured at the timing of the last ask.

        Parameters
        ----------
        J, limits, misfire, applied
            As of the seeker, the applied timing in °CA aTDC.
        pressure_bar : array_like, optional
            Pressure of the cycle on the angles of the calibration [bar]; not used without one.
        """
        with self._recorded(J, misfire, applied):
            self._tell(J, limits, misfire, applied, pressure_bar)

    @property
    def history(self) -> xr.Dataset:
        """What came from the guide, what from the trim, and the trust, cycle by cycle.

        As that of a `FeedForward`, over ``cycle`` and ``input``, before the result of each: ``guide_optimum``,
        ``feed_forward``, ``trim``, ``estimate``, ``estimate_sd`` (NaN where the seeker states none), over ``cycle``
        ``trust`` and ``wall_heat_scale`` of the guide; in the cycle ``applied``, ``objective`` (NaN where it misfired)
        and ``misfire`` (0 or 1). Built anew on every access.
        """
        return self._rows_dataset()
