"""
Fits of the cylinder and the throttle, update while running.
"""
from __future__ import annotations
import collections.abc
import mgdd._core.engine
import mgdd._core.optimize
import numpy
import numpy.typing
import typing
__all__: list[str] = ['CylinderFit', 'GradientPwR', 'LoadBurn', 'LoadFit', 'MeasuredCycle', 'RecursivePwR', 'WindowPwR', 'common_parameters', 'correlation_limit', 'estimate_burn', 'fit_cylinder', 'fit_pseudo_wiener', 'fit_throttle_groups', 'group_names', 'load_parameters', 'simulate_throttle_groups', 'throttle_group_bounds', 'wall_heat_scale_upper', 'with_burn']
class MeasuredCycle:
    def __init__(self, *, label: str, crank_angle_cad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pressure_bar: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], point: mgdd._core.engine.OperatingPoint) -> None:
        ...
    def __repr__(self) -> str:
        ...
class LoadBurn:
    def __init__(self) -> None:
        ...
    def __repr__(self) -> str:
        ...
    @property
    def burn_duration_cad(self) -> float:
        ...
    @burn_duration_cad.setter
    def burn_duration_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def fuel_heat_j(self) -> float:
        ...
    @fuel_heat_j.setter
    def fuel_heat_j(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_delay_cad(self) -> float:
        ...
    @second_delay_cad.setter
    def second_delay_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_duration_cad(self) -> float:
        ...
    @second_duration_cad.setter
    def second_duration_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_fraction(self) -> float:
        ...
    @second_fraction.setter
    def second_fraction(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def second_wiebe_m(self) -> float:
        ...
    @second_wiebe_m.setter
    def second_wiebe_m(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def soc_cad(self) -> float:
        ...
    @soc_cad.setter
    def soc_cad(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def start_pressure_bar(self) -> float:
        ...
    @start_pressure_bar.setter
    def start_pressure_bar(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def wiebe_m(self) -> float:
        ...
    @wiebe_m.setter
    def wiebe_m(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class LoadFit:
    def __repr__(self) -> str:
        ...
    @property
    def burn(self) -> LoadBurn:
        ...
    @property
    def ca50_cad(self) -> float:
        ...
    @property
    def heat_loss_fraction(self) -> float:
        ...
    @property
    def imep_closed_bar(self) -> float:
        ...
    @property
    def imep_closed_error_percent(self) -> float:
        ...
    @property
    def imep_closed_model_bar(self) -> float:
        ...
    @property
    def largest_error_bar(self) -> float:
        ...
    @property
    def largest_error_cad(self) -> float:
        ...
    @property
    def model_bar(self) -> numpy.typing.NDArray[numpy.float64]:
        ...
    @property
    def p_max_bar(self) -> float:
        ...
    @property
    def rmse_bar(self) -> float:
        ...
    @property
    def rmse_percent(self) -> float:
        ...
    @property
    def trapped_mass_g(self) -> float:
        ...
class CylinderFit:
    def __repr__(self) -> str:
        ...
    @property
    def correlation_if_free(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def cylinder(self) -> mgdd._core.engine.Cylinder:
        ...
    @property
    def loads(self) -> list[LoadFit]:
        ...
    @property
    def report(self) -> mgdd._core.optimize.FitReport:
        ...
class RecursivePwR:
    """
    Recursive least squares of PW-R; use mgdd.identify.OnlineUpdate.
    """
    def __init__(self, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, free: collections.abc.Sequence[str], every: typing.SupportsInt | typing.SupportsIndex, noise_deg: typing.SupportsFloat | typing.SupportsIndex, forgetting: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def state(self) -> dict[str, list[float]]:
        ...
    def update(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> int:
        """
        Takes samples in order, without the GIL; returns how many changed the model.
        """
    @property
    def parameters(self) -> dict:
        ...
class WindowPwR:
    """
    Sliding-window fit of PW-R; use mgdd.identify.OnlineUpdate.
    """
    def __init__(self, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, free: collections.abc.Sequence[str], every: typing.SupportsInt | typing.SupportsIndex, noise_deg: typing.SupportsFloat | typing.SupportsIndex, prior_spread: typing.SupportsFloat | typing.SupportsIndex, iterate_every: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def state(self) -> dict[str, list[float]]:
        ...
    def update(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> int:
        """
        Takes samples in order, without the GIL; returns how many changed the model.
        """
    @property
    def parameters(self) -> dict:
        ...
class GradientPwR:
    """
    Gradient update of PW-R; use mgdd.identify.OnlineUpdate.
    """
    def __init__(self, parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], *, free: collections.abc.Sequence[str], adaptation_gain: typing.SupportsFloat | typing.SupportsIndex, noise_deg: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def restore(self, state: collections.abc.Mapping[str, collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    def state(self) -> dict[str, list[float]]:
        ...
    def update(self, duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], angle_deg: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> int:
        """
        Takes samples in order, without the GIL; returns how many changed the model.
        """
    @property
    def parameters(self) -> dict:
        ...
def common_parameters() -> list[str]:
    """
    Cylinder fields that may be freed for all loads.
    """
def estimate_burn(trace: MeasuredCycle, cylinder: mgdd._core.engine.Cylinder) -> LoadBurn:
    """
    A start from the trace's heat release.
    """
def fit_cylinder(traces: collections.abc.Sequence[MeasuredCycle], cylinder: mgdd._core.engine.Cylinder, start: collections.abc.Sequence[LoadBurn], free: collections.abc.Sequence[str], step_cad: typing.SupportsFloat | typing.SupportsIndex, integrator: str, max_iterations: typing.SupportsInt | typing.SupportsIndex, bounds: collections.abc.Mapping[str, tuple[typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]]) -> CylinderFit:
    """
    Levenberg-Marquardt with exact sensitivities; releases the GIL.
    """
def fit_pseudo_wiener(*, kind: str, records: collections.abc.Sequence[tuple[typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.Annotated[numpy.typing.ArrayLike, numpy.float64]]], parameters: collections.abc.Mapping[str, typing.SupportsFloat | typing.SupportsIndex], sides: str, free: collections.abc.Sequence[str], delays: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], starts: typing.SupportsInt | typing.SupportsIndex, seed: typing.SupportsInt | typing.SupportsIndex, only_given_start: bool, try_map_start: bool, max_iterations: typing.SupportsInt | typing.SupportsIndex) -> tuple[dict, mgdd._core.optimize.FitReport, numpy.typing.NDArray[numpy.float64], int]:
    """
    Output-error fit from several starts: parameters, report, RMSE of every search, count that reached the best.
    """
def fit_throttle_groups(records: collections.abc.Sequence[tuple[typing.SupportsFloat | typing.SupportsIndex, typing.Annotated[numpy.typing.ArrayLike, numpy.float64], typing.Annotated[numpy.typing.ArrayLike, numpy.float64], collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], typing.SupportsInt | typing.SupportsIndex, collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]]], *, stages: collections.abc.Sequence[tuple[collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]], starts: collections.abc.Sequence[typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(19)"]], closed_deg: typing.SupportsFloat | typing.SupportsIndex, open_deg: typing.SupportsFloat | typing.SupportsIndex, substeps: typing.SupportsInt | typing.SupportsIndex, n_threads: typing.SupportsInt | typing.SupportsIndex) -> dict:
    """
    Staged multi-start fit of the throttle groups; releases the GIL.
    """
def load_parameters() -> list[str]:
    """
    Names that may be freed per load.
    """
def simulate_throttle_groups(values: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(19)"], duty: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, step_s: typing.SupportsFloat | typing.SupportsIndex, start: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"], closed_deg: typing.SupportsFloat | typing.SupportsIndex, open_deg: typing.SupportsFloat | typing.SupportsIndex, substeps: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Angle [deg] on every sample; releases the GIL.
    """
def throttle_group_bounds() -> list:
    """
    The groups with their bounds.
    """
def with_burn(cylinder: mgdd._core.engine.Cylinder, burn: LoadBurn) -> mgdd._core.engine.Cylinder:
    """
    The cylinder with one load's shape fields.
    """
correlation_limit: float = 0.98
group_names: tuple = ('tau_s', 'gain_deg_per_s2_per_duty', 'beta_above_duty', 'kappa_above_duty_per_deg', 'delta_duty', 'beta_below_duty', 'kappa_below_duty_per_deg', 'limp_home_deg', 'electrical_s', 'stribeck_drop', 'stribeck_deg_per_s', 'ramp_deg', 'delay_samples', 'presliding_deg', 'presliding_damping', 'half_gap_deg', 'viscous_share', 'stop_duty_per_deg', 'stop_damping')
wall_heat_scale_upper: float = 2.5
