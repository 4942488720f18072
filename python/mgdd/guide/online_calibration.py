"""Calibration of the cycle model to the measured pressure while an engine runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex

import numpy as np

from mgdd import _core
from mgdd._core.engine import OperatingPoint
from mgdd._settings import remade
from mgdd.errors import ParameterError, ShapeError
from mgdd.presets.meant import CylinderLike, cylinder_of
from mgdd.results.describe import as_html, rows_of
from mgdd.results.labels import labelled_dataset
from mgdd.results.result import NumbersResult

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True, repr=False)
class ParameterVerdict(NumbersResult):
    """How much one parameter of an online calibration deserves belief.

    Attributes
    ----------
    name : str
        Of the parameter.
    value, standard_error : float
        Estimate, and its standard error with everything that is not known exactly counted.
    knowledge : str
        ``"determined"``, ``"uncertain"``, ``"held"`` (the data know less than was known beforehand), ``"at bound"``,
        ``"contradicted"`` (the model does not fit this pressure) or ``"no data"``.
    sentence : str
        All of it in words, with the reason.
    """

    name: str
    value: float
    standard_error: float
    knowledge: str
    sentence: str


_FIGURES = {
    "residual_rms_bar": ("bar", "root mean square residual of the mean trace"),
    "noise_bar": ("bar", "standard deviation of a sample of the mean trace"),
    "effective_samples": ("-", "independent samples that the residual is worth"),
}


class OnlineCalibration(_core.guide.OnlineCalibration):
    """Keeps parameters of the cycle model true to the mean pressure of the last cycles, and says which it cannot know.

    Offer every cycle, then update once: a refused cycle is left out and says why. What stands between model and
    measurement and is not adapted counts as known to its `uncertainty` only, so that an error of TDC, gain, pegging,
    gamma, fuel, timing, compression ratio or temperature widens the standard error instead of passing for wall heat.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        The guide: a preset, its name, or a cylinder of your own. It is not changed.
    method : {"gauss_newton", "recursive", "extremum_seeking"}
        One exact Gauss-Newton step per update on the last window; the same with earlier windows remembered;
        extremum seeking on the pressure error, which moves the wall heat alone.
    parameters : sequence of str
        What is adapted: ``"wall_heat_scale"``, ``"soc_offset_cad"``, ``"burn_duration_scale"``, ``"gamma_offset"``,
        ``"fuel_heat_scale"``, ``"compression_ratio_offset"``, ``"charge_temperature_offset_k"``,
        ``"wall_temperature_offset_k"``, ``"tdc_offset_cad"``, ``"pressure_gain"``, ``"pressure_offset_bar"``,
        ``"soc_variance_scale"``.
    uncertainty : mapping of str to float, optional
        Standard deviation of what is known of the parameters that are not adapted, in their units; 0: exactly as the
        model has it. Left out:
        0.3 °CA of SOC, 5 % of burn duration, 0.01 of gamma, 2 % of fuel heat, 0.1 of compression ratio, 10 K of
        charge at IVC (3 % of trapped mass), 70 K of wall, 0.3 °CA of TDC, 0.5 % of pressure gain, 0.1 bar of pegging,
        100 % of the variance of SOC. So the wall heat is known to 3 % at best; where fuel, mass or temperatures are
        measured, say how well: ``{"fuel_heat_scale": 0.0, "charge_temperature_offset_k": 3.0}``.
    window_cycles : int
        Cycles whose mean is compared, in [2, 500].
    steady_cycles : int
        Cycles left out after speed, fuel or intake changed by more than 5 %.
    cov_limit_percent : float
        COV of IMEP in the window from which on nothing is adapted [%].
    forgetting : float
        Weight that a window keeps in the next one, in [0, 1]; ``recursive`` only.
    soc_scatter_cad : float
        Scatter of the true start of combustion about the given one from cycle to cycle [°CA]: it blurs the mean
        pressure, and differs from window to window. 0 where the start of combustion is measured.
    jump_factor : float
        A cycle whose residual is so many times the usual one is left out; three in a row start anew.
    trials_per_update : int
        Cycles of the model per update; ``extremum_seeking`` only.
    step_cad, integrator
        As in `mgdd.engine.simulate`.

    Raises
    ------
    ParameterError
        A setting outside its domain, an unknown parameter, or a second one for ``extremum_seeking``.

    References
    ----------
    Tan (2018), chapter 6; Tan et al. (2016): wall heat by extremum seeking on the pressure error. The rest is ours.

    Examples
    --------
    >>> from mgdd.engine import Cylinder
    >>> from mgdd.guide import OnlineCalibration
    >>> from mgdd.loop import VirtualEngine
    >>> bench = VirtualEngine(pressure_noise_bar=0.05)  # its wall heat is 0.5
    >>> known = {"charge_temperature_offset_k": 2.0, "wall_temperature_offset_k": 10.0, "compression_ratio_offset": 0.0}
    >>> calibration = OnlineCalibration(Cylinder(wall_heat_scale=1.0), uncertainty=known)
    >>> for _ in range(40):
    ...     soc_cad = bench.step(-6.0)["soc_cad"]
    ...     status = calibration.offer(bench.pressure()[1], bench.point, soc_cad)
    ...     status = calibration.update()
    >>> round(calibration.cylinder.wall_heat_scale, 2), calibration.determined
    (0.5, True)
    """

    def __init__(
        self,
        cylinder: CylinderLike,
        *,
        method: str = "gauss_newton",
        parameters: Sequence[str] = ("wall_heat_scale",),
        uncertainty: Mapping[str, float] | None = None,
        window_cycles: int = 10,
        steady_cycles: int = 20,
        cov_limit_percent: float = 3.0,
        forgetting: float = 0.9,
        soc_scatter_cad: float = 0.3,
        jump_factor: float = 3.0,
        trials_per_update: int = 5,
        step_cad: float = 1.0,
        integrator: str = "trapezoid",
    ) -> None:
        ParameterError.unless(not isinstance(parameters, str), "parameters", parameters, "a sequence of names")
        super().__init__(
            cylinder=cylinder_of(cylinder),
            method=method,
            parameters=list(parameters),
            uncertainty=dict(uncertainty or {}),
            window_cycles=window_cycles,
            steady_cycles=steady_cycles,
            cov_limit_percent=cov_limit_percent,
            forgetting=forgetting,
            soc_scatter_cad=soc_scatter_cad,
            jump_factor=jump_factor,
            trials_per_update=trials_per_update,
            step_cad=step_cad,
            integrator=integrator,
        )
        self._size = len(self.angles_cad)
        self._history: list[tuple[str, list[float]]] = []

    def offer(
        self, pressure_bar: ArrayLike, point: OperatingPoint, soc_cad: SupportsFloat | SupportsIndex, *,
        misfire: bool = False,
    ) -> str:  # fmt: skip
        """Give the pressure of one cycle.

        Parameters
        ----------
        pressure_bar : array_like
            One pressure per angle of `angles_cad` [bar], pegged as well as can be. Missing samples as NaN.
        point : OperatingPoint
            Speed, fuel and intake of this cycle, as measured or commanded.
        soc_cad : float
            Start of combustion, measured or commanded [°CA aTDC].
        misfire : bool
            Whether the cycle is known to have misfired.

        Returns
        -------
        str
            ``"accepted"``, or why not: ``"misfire"``, ``"unsteady"``, ``"saturated"``, ``"unusable numbers"``. A
            refused cycle teaches nothing; one at another operating point empties the window.

        Raises
        ------
        ShapeError
            Not one pressure per angle.
        """
        pressure = np.asarray(pressure_bar, float)
        if pressure.shape != (self._size,):
            raise ShapeError(
                f"pressure_bar has shape {pressure.shape}: must be ({self._size},), one per angle of angles_cad"
            )
        return super().offer(pressure, point, soc_cad, misfire=misfire)

    def update(self) -> str:
        """Do the work of one cycle: at most one step, or `trials_per_update` trials.

        Returns
        -------
        str
            ``"updated"``; ``"collecting"`` while the window fills; ``"poor excitation"`` where every parameter is
            held; ``"COV"``, ``"jump"``, ``"no such cycle"``, or why the last cycle was refused.
        """
        status = super().update()
        row = [*self.values.values(), *self.errors.values(), *(self.figures[name] for name in _FIGURES)]
        self._history.append((status, row))
        return status

    @property
    def parameters(self) -> dict[str, float]:
        """Value of every parameter by name, adapted or only estimated beside them."""
        return self.values

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error of every parameter by name; 0 for what is known exactly, and before the first step."""
        return self.errors

    @property
    def verdicts(self) -> dict[str, ParameterVerdict]:
        """What the data determine of each adapted parameter."""
        values, errors = self.values, self.errors
        return {
            name: ParameterVerdict(
                name=name, value=values[name], standard_error=errors[name], knowledge=knowledge, sentence=sentence
            )
            for name, (knowledge, sentence) in super().verdicts.items()
        }

    def summary(self) -> str:
        """Say status and verdicts as text.

        Returns
        -------
        str
            A few lines: how far it is, then one sentence per adapted parameter.

        Examples
        --------
        >>> from mgdd.guide import OnlineCalibration
        >>> print(OnlineCalibration("puma_single").summary())
        gauss_newton: 0 cycles taken, 0 updates, now collecting
        wall_heat_scale = 0.5: no data, nothing was adapted yet
        """
        figures = self.figures
        taken, updates = figures["accepted"], figures["updates"]
        jumps = f", {figures['jumps']} jumps" if figures["jumps"] else ""
        lines = [f"{self.settings['method']}: {taken} cycles taken, {updates} updates{jumps}, now {self.status}"]
        if updates:
            residual = f"residual {figures['residual_rms_bar']:.3g} bar rms"
            worth = f"worth {figures['effective_samples']:.0f} independent samples"
            lines.append(f"{residual}, {worth}; COV of IMEP {figures['cov_percent']:.2g} %")
        return "\n".join([*lines, *(verdict.sentence for verdict in self.verdicts.values())])

    @property
    def history(self) -> xr.Dataset:
        """Parameters after every update, over ``update``: value and ``NAME_error`` of each, figures of the residual.

        ``moved`` is 1 where the update took place, ``status`` says why not. Built anew on every access.
        """
        names = _core.guide.calibrated_parameters()
        width = 2 * len(names) + len(_FIGURES)
        rows = np.array([row for _, row in self._history], float).reshape(len(self._history), width)
        variables: dict[str, tuple[Any, ...]] = {
            "update": ("update", np.arange(len(self._history)), "-", "update of the calibration"),
            "status": ("update", np.array([status for status, _ in self._history], str), "-", "status of the update"),
            "moved": (
                "update",
                np.array([status == "updated" for status, _ in self._history], np.int8),
                "-",
                "whether parameters were adapted",
            ),
        }
        for i, (name, (unit, meaning)) in enumerate(names.items()):
            variables[name] = ("update", rows[:, i], unit, meaning)
            variables[f"{name}_error"] = ("update", rows[:, len(names) + i], unit, f"standard error: {meaning}")
        for i, (name, (unit, meaning)) in enumerate(_FIGURES.items()):
            variables[name] = ("update", rows[:, 2 * len(names) + i], unit, meaning)
        return labelled_dataset(variables, attrs={"method": self.settings["method"]})

    def __reduce__(self) -> tuple[Any, ...]:
        changed = {"state": self.state, "_history": list(self._history)}
        return remade, (OnlineCalibration, (), self.settings, changed)

    def __repr__(self) -> str:
        names = ", ".join(f"{name} {self.parameters[name]:.4g}" for name in self.settings["parameters"])
        return f"<OnlineCalibration {self.settings['method']}: {names}, {self.status}>"

    def _repr_html_(self) -> str:
        return as_html("OnlineCalibration", rows_of({"status": self.status, **self.parameters, **self.settings}))
