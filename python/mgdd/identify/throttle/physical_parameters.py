"""Physical numbers of a throttle from its groups and what was measured apart."""

from __future__ import annotations

import math

from mgdd.errors import ParameterError
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel

__all__ = ["physical_parameters"]


def physical_parameters(
    model: FirstPrincipleModel,
    *,
    resistance_ohm: float,
    supply_v: float,
    inertia_kgm2: float | None = None,
    torque_constant_nm_per_a: float | None = None,
) -> dict[str, float]:
    """Compute physical numbers back from groups: g = K V/R and G = g/J leave one number to be known.

    Parameters
    ----------
    model : FirstPrincipleModel
        Groups.
    resistance_ohm, supply_v : float
        Measured at the terminals [ohm, V].
    inertia_kgm2, torque_constant_nm_per_a : float
        Exactly one of them [kg m², N m/A at the plate].

    Returns
    -------
    dict of str to float
        Inertia, torque constant, viscous friction (without back-EMF), springs, preloads and Coulomb friction, all at
        the plate shaft.

    Raises
    ------
    ParameterError
        A number that is not positive, or none or both of the two.

    Examples
    --------
    >>> from mgdd.identify import FirstPrincipleModel, physical_parameters
    >>> model = FirstPrincipleModel()
    >>> found = physical_parameters(model, resistance_ohm=1.5, supply_v=12.0, inertia_kgm2=0.0021)
    >>> round(found["torque_constant_nm_per_a"], 4)
    0.2291
    """
    known = {
        "resistance_ohm": resistance_ohm,
        "supply_v": supply_v,
        "inertia_kgm2": inertia_kgm2,
        "torque_constant_nm_per_a": torque_constant_nm_per_a,
    }
    for name, value in known.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ParameterError.of(name, value, "> 0")
    if (inertia_kgm2 is None) == (torque_constant_nm_per_a is None):
        raise ParameterError("inertia_kgm2, torque_constant_nm_per_a: give exactly one of them")
    p = model.parameters
    gain = math.radians(p["gain_deg_per_s2_per_duty"])
    if torque_constant_nm_per_a is not None:
        stall = torque_constant_nm_per_a * supply_v / resistance_ohm
    else:
        stall = gain * float(inertia_kgm2 or math.nan)
    inertia = stall / gain
    constant = stall * resistance_ohm / supply_v
    return {
        "inertia_kgm2": inertia,
        "torque_constant_nm_per_a": constant,
        "viscous_nms_per_rad": inertia / p["tau_s"] - constant**2 / resistance_ohm,
        "spring_above_nm_per_rad": math.degrees(p["kappa_above_duty_per_deg"]) * stall,
        "spring_below_nm_per_rad": math.degrees(p["kappa_below_duty_per_deg"]) * stall,
        "preload_above_nm": p["beta_above_duty"] * stall,
        "preload_below_nm": p["beta_below_duty"] * stall,
        "coulomb_nm": p["delta_duty"] * stall,
    }
