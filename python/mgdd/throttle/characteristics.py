"""What the parameters of a throttle give in closed form: groups, holding duty, linear part, air flow."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd import _core
from mgdd._core.throttle import Throttle
from mgdd.errors import ParameterError
from mgdd.presets.meant import ThrottleLike, throttle_of
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_DEG = math.radians(1.0)


def characteristics(throttle: ThrottleLike, angle_deg: ArrayLike | None = None) -> xr.Dataset:
    """Give the groups that duty and angle identify, the linear part on each side of limp-home, and the holding duty.

    Parameters
    ----------
    throttle : Throttle, Preset, str or path-like
        Its parameters; the modelled air flow (``pressure_drop_kpa``) counts in the holding duty.
    angle_deg : array_like, shape (n,), optional
        Angles of the holding duty [deg] within the travel; the travel in steps of about 0.25 deg if left out.

    Returns
    -------
    xarray.Dataset
        Scalars: ``stall_torque_nm`` g = K (V - V_drop)/R, ``damping_nms_per_rad`` b = K_v + K K_e/R, ``tau_s`` = J/b,
        ``gain_deg_per_s2`` = g/J per duty, and in units of duty ``preload_above``, ``preload_below``, ``coulomb`` and
        ``stiction`` (torque over g), and ``spring_above_per_deg``, ``spring_below_per_deg`` [1/deg]. The linear part,
        without dry friction, preload and inductance, over ``side`` ("above", "below"): ``pole_real_per_s`` and
        ``pole_imag_rad_per_s`` over ``pole``, slow one first, ``gain_deg_per_duty``, ``natural_frequency_rad_per_s``
        and ``damping_ratio`` [-]; without a spring the gain is infinite and the ratio is not a number. Over
        ``angle_deg``, in duty [-] and not clipped to 1: ``duty_spring``, which balances springs and air;
        ``duty_rising`` and ``duty_falling``, at which the plate slides open and closed very slowly; and
        ``duty_breakaway_up`` and ``duty_breakaway_down``, at which it leaves its rest.

    Raises
    ------
    mgdd.errors.ParameterError
        An angle outside the travel or not finite.

    Notes
    -----
    Inertia, torque constant and resistance cannot be identified separately from duty and angle alone; the groups can.
    The friction of slow sliding is the Coulomb level, with the forms ``stribeck`` and ``lugre`` the breakaway level;
    the form ``tanh`` has no band at rest, its branches are those of a plate in motion.

    Examples
    --------
    >>> from mgdd.throttle import Throttle, characteristics
    >>> c = characteristics(Throttle())
    >>> round(float(c["tau_s"]), 4), round(float(c["preload_above"]), 4), round(float(c["coulomb"]), 4)
    (0.0197, 0.1292, 0.0927)
    >>> c["pole_real_per_s"].sel(side="above").values.round(3).tolist()
    [-0.83, -49.929]
    >>> curve = characteristics(Throttle(), [45.0])
    >>> round(float(curve["duty_rising"][0] - curve["duty_falling"][0]), 4)
    0.1854
    """
    throttle = throttle_of(throttle)
    angle = _angles(throttle, angle_deg)
    stall, damping, inertia = throttle.stall_torque_nm, throttle.damping_nms_per_rad, throttle.inertia_kgm2
    plate = throttle.plate
    scalars = {
        "stall_torque_nm": (stall, "N m", "stall torque per unit duty"),
        "damping_nms_per_rad": (damping, "N m s/rad", "viscous friction and braking by the motor"),
        "tau_s": (plate.time_constant_s, "s", "time constant of the speed"),
        "gain_deg_per_s2": (plate.gain_deg_per_s2, "deg/s²", "acceleration per unit duty"),
        "preload_above": (plate.preload_above, "-", "preload above limp-home, in duty"),
        "preload_below": (plate.preload_below, "-", "preload below limp-home, in duty"),
        "coulomb": (plate.friction, "-", "Coulomb friction, in duty"),
        "stiction": (_breakaway_nm(throttle) / stall, "-", "breakaway friction, in duty"),
        "spring_above_per_deg": (plate.spring_above_per_deg, "1/deg", "spring above, in duty"),
        "spring_below_per_deg": (plate.spring_below_per_deg, "1/deg", "spring below, in duty"),
    }
    springs = np.array([throttle.spring_above_nm_per_rad, throttle.spring_below_nm_per_rad])
    poles = np.array([np.roots([inertia, damping, spring]) for spring in springs], dtype=np.complex128)
    poles = np.take_along_axis(poles, np.argsort(np.abs(poles), axis=1, kind="stable"), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(springs > 0.0, damping / (2.0 * np.sqrt(springs * inertia)), np.nan)
        gain = np.where(springs > 0.0, stall / springs / _DEG, np.inf)
    return labelled_dataset(
        {
            **{name: ((), *entry) for name, entry in scalars.items()},
            "side": ("side", ["above", "below"], "-", "side of limp-home"),
            "pole": ("pole", np.arange(2), "-", "pole"),
            "pole_real_per_s": (("side", "pole"), poles.real, "1/s", "real part of the pole"),
            "pole_imag_rad_per_s": (("side", "pole"), poles.imag, "rad/s", "imaginary part of the pole"),
            "gain_deg_per_duty": ("side", gain, "deg", "angle per unit duty at rest"),
            "natural_frequency_rad_per_s": ("side", np.sqrt(springs / inertia), "rad/s", "natural frequency"),
            "damping_ratio": ("side", ratio, "-", "damping ratio"),
            "angle_deg": ("angle_deg", angle),
            **_holding_duty(throttle, angle),
        }
    )


def _holding_duty(t: Throttle, angle: NDArray[np.float64]) -> dict[str, tuple[object, ...]]:
    """Give the duty that holds the plate, and the band that friction leaves free around it."""
    x = (angle - t.limp_home_deg) * _DEG
    above = x >= 0.0
    share = np.clip((angle - t.limp_home_deg) / t.preload_ramp_deg, -1.0, 1.0)
    spring = np.where(above, t.spring_above_nm_per_rad, t.spring_below_nm_per_rad) * x
    preload = np.where(above, t.preload_above_nm, t.preload_below_nm) * share
    balance = spring + preload - _core.throttle.airflow_torque(t, angle)
    slow = t.stiction_nm if t.friction in ("stribeck", "lugre") else t.coulomb_nm
    leave = _breakaway_nm(t)
    columns = {
        "duty_spring": (balance, "duty that balances the springs"),
        "duty_rising": (balance + slow, "duty while the plate slides open slowly"),
        "duty_falling": (balance - slow, "duty while the plate slides closed slowly"),
        "duty_breakaway_up": (balance + leave, "duty at which the plate leaves its rest to open"),
        "duty_breakaway_down": (balance - leave, "duty at which the plate leaves its rest to close"),
    }
    return {name: ("angle_deg", _duty_of(t, torque), "-", text) for name, (torque, text) in columns.items()}


def airflow_torque_nm(throttle: ThrottleLike, angle_deg: ArrayLike) -> NDArray[np.float64]:
    """Give the torque [N m] of the modelled air flow at plate angles [deg], -D³ dp C_T(angle), at most 0: it closes.

    The table of C_T is a placeholder of plausible shape, to be fitted to a flow bench.
    """
    throttle = throttle_of(throttle)
    angle = np.asarray(angle_deg, dtype=np.float64)
    if not np.isfinite(angle).all():
        raise ParameterError("angle_deg holds a value that is not finite")
    return np.asarray(_core.throttle.airflow_torque(throttle, angle.ravel())).reshape(angle.shape)


def _breakaway_nm(t: Throttle) -> float:
    return t.coulomb_nm if t.friction in ("coulomb", "tanh") else t.stiction_nm


def _duty_of(t: Throttle, torque: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the duty of a static torque; the dead band comes on top."""
    duty = torque / t.stall_torque_nm
    return np.asarray(duty + np.sign(duty) * t.dead_band)


def _angles(t: Throttle, angle_deg: ArrayLike | None) -> NDArray[np.float64]:
    if angle_deg is None:
        return np.linspace(t.closed_deg, t.open_deg, 4 * max(1, round(t.open_deg - t.closed_deg)) + 1)
    angle = np.atleast_1d(np.asarray(angle_deg, dtype=np.float64))
    bad = ~((angle >= t.closed_deg) & (angle <= t.open_deg))
    if bad.any():
        travel = f"{t.closed_deg:g} to {t.open_deg:g} deg"
        raise ParameterError(f"angle_deg = {angle[bad].flat[0]:g} deg: must lie within the travel, {travel}")
    return angle
