"""
Models of measured benchmarks.
"""
from __future__ import annotations
import collections.abc
import mgdd._core.optimize
import numpy
import numpy.typing
import typing
__all__: list[str] = ['DriveAxis', 'FreeRunFit', 'FreeRunRecord', 'TwoTanks', 'WienerHammerstein', 'filter_series']
class FreeRunRecord:
    """
    One measured record, its start and what of the start is unknown.
    """
    def __init__(self, *, input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], output: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], start: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], free_start: collections.abc.Sequence[str] = [], skip: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        ...
    def __repr__(self) -> str:
        ...
class FreeRunFit:
    """
    What a free-run fit hands back.
    """
    def __repr__(self) -> str:
        ...
    @property
    def outputs(self) -> list:
        ...
    @property
    def parameters(self) -> list[float]:
        ...
    @property
    def report(self) -> mgdd._core.optimize.FitReport:
        ...
    @property
    def starts(self) -> list[list[float]]:
        ...
class DriveAxis:
    """
    Motor-driven axis with friction.
    """
    parameter_names: typing.ClassVar[list] = ['mass_kg', 'viscous_ns_per_m', 'viscous_asymmetry_ns_per_m', 'coulomb_n', 'stribeck_n', 'stribeck_speed_m_per_s', 'offset_n', 'offset_drift_n_per_s', 'stiffness_n_per_m']
    state_names: typing.ClassVar[list] = ['position_m', 'speed_m_per_s', 'time_s']
    def __init__(self, *, force_n_per_v: typing.SupportsFloat | typing.SupportsIndex, centre_m: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def fit(self, *, base: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], free: collections.abc.Sequence[str], records: collections.abc.Sequence[FreeRunRecord], dt_s: typing.SupportsFloat | typing.SupportsIndex, options: mgdd._core.optimize.LeastSquaresOptions) -> FreeRunFit:
        """
        Levenberg-Marquardt on the free run with exact sensitivities; releases the GIL.
        """
    def free_run(self, *, parameters: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], start: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], dt_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
        """
        Output at every sample.
        """
class TwoTanks:
    """
    Two tanks in a row with overflow.
    """
    parameter_names: typing.ClassVar[list] = ['pump_per_s', 'upper_outflow_per_s', 'upper_exponent', 'lower_outflow_per_s', 'lower_exponent', 'lower_datum_v', 'upper_brim_v', 'overflow_share', 'delay_samples']
    state_names: typing.ClassVar[list] = ['upper_level_v', 'lower_level_v', 'pump_before_v', 'pump_before_that_v']
    def __init__(self, *, lower_brim_v: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def fit(self, *, base: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], free: collections.abc.Sequence[str], records: collections.abc.Sequence[FreeRunRecord], dt_s: typing.SupportsFloat | typing.SupportsIndex, options: mgdd._core.optimize.LeastSquaresOptions) -> FreeRunFit:
        """
        Levenberg-Marquardt on the free run with exact sensitivities; releases the GIL.
        """
    def free_run(self, *, parameters: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], start: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], dt_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
        """
        Output at every sample.
        """
class WienerHammerstein:
    """
    Filter, static curve, filter.
    """
    def __init__(self, *, first_order: typing.SupportsInt | typing.SupportsIndex, last_order: typing.SupportsInt | typing.SupportsIndex, n_curve: typing.SupportsInt | typing.SupportsIndex, lower: typing.SupportsFloat | typing.SupportsIndex, upper: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def curve(self, parameters: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        The static curve.
        """
    def fit(self, *, start: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], output: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], skip: typing.SupportsInt | typing.SupportsIndex, options: mgdd._core.optimize.LeastSquaresOptions) -> mgdd._core.optimize.FitReport:
        """
        Levenberg-Marquardt on the response with exact derivatives; releases the GIL.
        """
    def simulate(self, parameters: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Response from rest.
        """
    @property
    def lower(self) -> float:
        ...
    @property
    def names(self) -> list[str]:
        ...
    @property
    def upper(self) -> float:
        ...
def filter_series(b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    B/A u from rest.
    """
