"""One engine cycle as a reactor network in Cantera: other physics than ours, for `sweep_speed.py`.

A cylinder of ideal gas with n-dodecane, air and their reactions (`nDodecane_Reitz.yaml` of the wheel), intake and
exhaust valve, injector and a piston wall that moves by the slider crank, over 720 °CA with gas exchange. No wall heat,
no given burn: combustion is what the kinetics make of it. They act from IVC to EVO, and a run is one cycle from a
cylinder full of air: in a charge with residual gas the integrator gives up soon (CVODES error -3), at tolerances from
1e-6 to 1e-12. Bore, stroke, rod, ratio, valve closing and opening, speed, fuel and intake are those of the other
contenders.
"""

from __future__ import annotations

import math
from typing import Any

import cantera as ct
import numpy as np

MECHANISM, PHASE, FUEL, AIR = "nDodecane_Reitz.yaml", "nDodecane_IG", "c12h26:1", "o2:1, n2:3.76"
INTAKE_OPENS_CAD, EXHAUST_CLOSES_CAD = 342.0, 378.0  # after firing TDC
INJECTION_CAD = (-10.0, 5.0)
VALVE_KG_PER_S_PA = 1e-6
EXHAUST_PA, AMBIENT_K = 1.2e5, 300.0


def _is_open(angle: float, window: tuple[float, float]) -> bool:
    return (angle - window[0]) % 720.0 < (window[1] - window[0]) % 720.0


class CanteraEngine:
    """A network that starts at the BDC before compression, full of air; `run` advances it by 720 °CA, once."""

    def __init__(self, cylinder: Any, point: Any, *, kinetics: bool, relative_tolerance: float) -> None:
        gas = ct.Solution(MECHANISM, PHASE)
        disc = math.pi / 4 * (cylinder.bore_mm / 1e3) ** 2
        radius, rod = cylinder.stroke_mm / 2e3, cylinder.connecting_rod_mm / 1e3
        self.cad_per_s = 6.0 * point.speed_rpm
        self.swept = disc * 2 * radius
        gas.TPX = point.intake_temperature_k, point.intake_pressure_kpa * 1e3, AIR
        inlet = ct.Reservoir(gas, clone=True)
        self.cylinder = ct.IdealGasReactor(gas, clone=True)
        self.cylinder.volume = self.swept * cylinder.compression_ratio / (cylinder.compression_ratio - 1)
        self.kinetics = kinetics
        gas.TPX = AMBIENT_K, EXHAUST_PA, AIR
        outlet, ambient = ct.Reservoir(gas, clone=True), ct.Reservoir(gas, clone=True)
        gas.TPX = AMBIENT_K, 1600e5, FUEL
        injector = ct.Reservoir(gas, clone=True)

        self.valves = (ct.Valve(inlet, self.cylinder), ct.Valve(self.cylinder, outlet))
        ivc, evo = cylinder.ivc_cad, cylinder.evo_cad
        self.windows = ((INTAKE_OPENS_CAD, ivc + 720.0), (evo, EXHAUST_CLOSES_CAD), INJECTION_CAD, (ivc, evo))
        self.injector = ct.MassFlowController(injector, self.cylinder)
        seconds = (INJECTION_CAD[1] - INJECTION_CAD[0]) / self.cad_per_s
        self.fuel_kg_per_s = point.fuel_mg * 1e-6 / seconds

        def piston_speed(t: float) -> float:
            phi = math.radians(self.angle(t))
            slope = math.sin(phi) * (1 + math.cos(phi) / math.sqrt((rod / radius) ** 2 - math.sin(phi) ** 2))
            return -radius * math.radians(self.cad_per_s) * slope

        self.piston = ct.Wall(ambient, self.cylinder, A=disc, velocity=piston_speed)
        self.network = ct.ReactorNet([self.cylinder])
        self.network.rtol, self.network.atol = relative_tolerance, 1e-16
        self.open = None

    def angle(self, t: float) -> float:
        """Crank angle [°CA after firing TDC]; the run starts at -180."""
        return self.cad_per_s * t - 180.0

    def run(self) -> dict[str, float]:
        """Advance by steps of 1 °CA; return the net IMEP and the highest pressure [bar] of the one cycle."""
        pressures, volumes = np.empty(720), np.empty(720)
        for k in range(720):
            self._set_valves(k - 180.0)
            self.network.advance((k + 1) / self.cad_per_s)
            pressures[k], volumes[k] = self.cylinder.phase.P, self.cylinder.volume
        work = np.sum((pressures + np.roll(pressures, 1)) / 2 * (volumes - np.roll(volumes, 1)))
        return {"imep_net_bar": float(work / self.swept / 1e5), "p_max_bar": float(pressures.max() / 1e5)}

    def _set_valves(self, angle: float) -> None:
        """Valves and injector for the step that begins here; the integrator starts anew where one of them switches."""
        is_open = [_is_open(angle, window) for window in self.windows]
        if is_open == self.open:
            return
        self.open = is_open
        for valve, now in zip(self.valves, is_open, strict=False):
            valve.valve_coeff = VALVE_KG_PER_S_PA * now
        self.injector.mass_flow_rate = self.fuel_kg_per_s * is_open[2]
        self.cylinder.chemistry_enabled = self.kinetics and is_open[3]
        self.network.reinitialize()
