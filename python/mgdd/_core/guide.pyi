"""
What a model tells a seeker, and how it learns while an engine runs.
"""
from __future__ import annotations
import collections.abc
import mgdd._core.engine
import numpy
import numpy.typing
import typing
__all__: list[str] = ['OnlineCalibration', 'calibrated_parameters']
class OnlineCalibration:
    """
    Calibration while an engine runs; use mgdd.guide.OnlineCalibration.
    """
    def __init__(self, *, cylinder: mgdd._core.engine.Cylinder, method: str, parameters: collections.abc.Sequence[str], uncertainty: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], window_cycles: typing.SupportsInt | typing.SupportsIndex, steady_cycles: typing.SupportsInt | typing.SupportsIndex, cov_limit_percent: typing.SupportsFloat | typing.SupportsIndex, forgetting: typing.SupportsFloat | typing.SupportsIndex, soc_scatter_cad: typing.SupportsFloat | typing.SupportsIndex, jump_factor: typing.SupportsFloat | typing.SupportsIndex, trials_per_update: typing.SupportsInt | typing.SupportsIndex, step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str) -> None:
        ...
    def offer(self, pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], point: mgdd._core.engine.OperatingPoint, soc_cad: typing.SupportsFloat | typing.SupportsIndex, *, misfire: bool = False) -> str:
        """
        Takes one cycle; the status says what became of it.
        """
    def restart(self) -> None:
        """
        Forget all cycles, keep the parameters.
        """
    def update(self) -> str:
        """
        One step of the calibration; the status says what became of it.
        """
    @property
    def angles_cad(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Angles that a pressure trace is taken on [°CA aTDC].
        """
    @property
    def cylinder(self) -> mgdd._core.engine.Cylinder:
        """
        The guide's cylinder with the adapted parameters.
        """
    @property
    def determined(self) -> bool:
        """
        Whether the data determine every parameter that is adapted.
        """
    @property
    def errors(self) -> dict:
        ...
    @property
    def figures(self) -> dict:
        ...
    @property
    def settings(self) -> dict:
        """
        Constructor keywords as a new dict.
        """
    @property
    def state(self) -> dict[str, list[float]]:
        """
        State between two cycles: named lists of numbers, JSON-able. Setting it continues that run bit for
        bit; a state of other settings raises ParameterError and changes nothing.
        """
    @state.setter
    def state(self, arg1: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def status(self) -> str:
        """
        Of the last call.
        """
    @property
    def values(self) -> dict:
        ...
    @property
    def verdicts(self) -> dict:
        ...
def calibrated_parameters() -> dict:
    """
    Unit and meaning of every parameter of an online calibration, by name.
    """
