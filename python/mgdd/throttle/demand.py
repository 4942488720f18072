"""From the pedal to the plate: parameters and equations of the demand chain of a torque-based engine controller."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd._core.throttle import PedalMap
from mgdd.errors import ParameterError
from mgdd.io.parameters import ParameterFile, Parameters, entries, wanted
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from mgdd._core.throttle import DemandTracker

_AXES = ("pedal_percent", "speed_rpm")


class DemandChain(Parameters, _core.throttle.DemandChain):
    """Pedal to torque to air to opening: the parameters of the chain, and its equations over arrays.

    Keyword-only and immutable. The defaults are plausible for a naturally aspirated engine of 2 L with a throttle of
    60 mm; they are of no engine in particular. ``DemandChain.fields()`` lists bounds and defaults. The same class
    serves as the model of a controller and as the engine that it acts on (`mgdd.loop.simulate_drive`).

    Parameters
    ----------
    indicated_efficiency, heating_value_mj_per_kg, stoichiometric_air_fuel, air_fuel_ratio : float
        Indicated work over the heat of the fuel [-], its heating value [MJ/kg], stoichiometric air over fuel by mass
        [-], and lambda [-].
    friction_nm, friction_nm_per_rpm : float
        Friction torque at standstill [N m] and its rise with the speed [N m/rpm].
    displacement_l, volumetric_efficiency : float
        Displacement [L], and charge over what it holds of manifold gas [-].
    manifold_l, manifold_temperature_k : float
        Volume [L] and temperature [K] of the manifold.
    ambient_kpa, ambient_temperature_k : float
        State before the throttle [kPa, K].
    bore_mm, shaft_mm, plate_closed_deg, leak_mm2 : float
        Bore and shaft of the throttle [mm], plate against the cross-section where the opening is zero [deg], and what
        is open at any angle [mm²].
    discharge_5, discharge_20, discharge_45, discharge_90, discharge_pressure_loss : float
        Discharge coefficient up to 5 deg and at 20, 45 and 90 deg of opening [-], and the share that it loses at equal
        pressures [-].
    pressure_lag_s, filling_share : float
        Lag of the wanted manifold pressure [s], and share fed forward of the air that fills the manifold [-].
    lowest_flow_function, highest_ratio : float
        The flow function is taken no lower [-]; a measured pressure counts up to this ratio [-].
    reference_rate_deg_per_s, reference_bandwidth_per_s, widest_deg : float
        Fastest change of the reference [deg/s], bandwidth of its filter [1/s], and largest reference [deg].
    pedal_map : PedalMap, optional
        Torque that the driver wants; a progressive map of 8 by 8 entries if left out.

    Raises
    ------
    mgdd.errors.ParameterError
        A field outside its domain, naming field, value and bound.

    See Also
    --------
    mgdd.loop.simulate_drive : the chain with a throttle, its controller and the engine's air.

    References
    ----------
    Tan (2018), figure 2-2, names the blocks; the equations stand on the page Electronic throttle.

    Examples
    --------
    >>> from mgdd.throttle import DemandChain
    >>> chain = DemandChain(displacement_l=1.6, bore_mm=52.0)
    >>> chain
    DemandChain(displacement_l=1.6, bore_mm=52.0)
    >>> DemandChain.from_toml(chain.to_toml()) == chain
    True
    >>> air = chain.air_g_per_s([20.0, 60.0], 2000.0)
    >>> angle = chain.opening_deg(air, chain.pressure_kpa(air, 2000.0))
    >>> angle.round(2).tolist()
    [8.42, 14.05]
    >>> chain.torque_nm(chain.cylinder_g_per_s(chain.steady_kpa(angle, 2000.0), 2000.0), 2000.0).round(6).tolist()
    [20.0, 60.0]
    """

    def replace(self, **changes: Any) -> DemandChain:
        """Give a validated copy with some fields changed.

        Parameters
        ----------
        **changes : float or PedalMap
            Fields by name.

        Returns
        -------
        DemandChain
            The copy.
        """
        return DemandChain(**super().replace(**changes).to_dict())

    def to_parameters(self) -> ParameterFile:
        """Give all fields and the map of the pedal, as `to_toml` writes them."""
        numbers = self.to_dict()
        rows: dict[str, Any] = dict(numbers.pop("pedal_map").to_dict())
        rows["wanted_nm"] = [list(row) for row in rows["wanted_nm"]]
        return ParameterFile(kind="demand_chain", tables={"parameters": entries(numbers), "pedal_map": entries(rows)})

    @classmethod
    def from_parameters(cls, file: ParameterFile) -> DemandChain:
        """Make the chain of a file that `to_toml` wrote."""
        file.expect(kinds=("demand_chain",), tables=("parameters", "pedal_map"))
        names = [name for name in cls.fields() if name != "pedal_map"]
        table = file.values("pedal_map", wanted((*_AXES, "wanted_nm"), form="numbers"))
        if len({len(row) if isinstance(row, list) else 0 for row in table["wanted_nm"]}) != 1:
            raise ParameterError("wanted_nm: must be a list of rows of one length, a row per pedal", field="wanted_nm")
        return cls(**file.values("parameters", wanted(names)), pedal_map=PedalMap(**table))

    def steady(self, pedal_percent: ArrayLike, speed_rpm: ArrayLike) -> xr.Dataset:
        """Give the steady demand of every pedal at every speed.

        Parameters
        ----------
        pedal_percent : float or array_like, shape (n,)
            Pedal [%], in 0 to 100.
        speed_rpm : float or array_like, shape (m,)
            Engine speed [rpm], > 0.

        Returns
        -------
        xarray.Dataset
            ``wanted_torque_nm``, ``air_g_per_s``, ``pressure_kpa`` and ``opening_deg`` over ``pedal_percent`` and
            ``speed_rpm``; ``torque_nm`` is what the engine makes at that opening. A pressure above the ambient one is
            a torque that the engine cannot make.

        Raises
        ------
        mgdd.errors.ParameterError
            A pedal or speed outside its domain.

        Examples
        --------
        >>> from mgdd.throttle import DemandChain
        >>> demand = DemandChain().steady([10.0, 60.0], 2000.0)
        >>> demand["opening_deg"].values.round(2).ravel().tolist()
        [4.63, 10.97]
        """
        pedal, speed = (np.atleast_1d(np.asarray(x, np.float64)).ravel() for x in (pedal_percent, speed_rpm))
        shape = (pedal.size, speed.size)
        at = tuple(axis.ravel() for axis in np.broadcast_arrays(pedal[:, None], speed[None, :]))
        torque, air, pressure, opening = self._steady(*at)
        reached = self.cylinder_g_per_s(self.steady_kpa(opening, at[1]), at[1])
        made = {
            "wanted_torque_nm": (torque, "N m", "torque wanted"),
            "air_g_per_s": (air, "g/s", "air wanted"),
            "pressure_kpa": (pressure, "kPa", "manifold pressure wanted"),
            "opening_deg": (opening, "deg", "opening"),
            "torque_nm": (self.torque_nm(reached, at[1]), "N m", "torque"),
        }
        return labelled_dataset(
            {
                "pedal_percent": ("pedal_percent", pedal, "%", "pedal"),
                "speed_rpm": ("speed_rpm", speed, "rpm", "engine speed"),
                **{
                    name: (_AXES, np.reshape(np.asarray(values), shape), unit, text)
                    for name, (values, unit, text) in made.items()
                },
            }
        )

    def tracker(self, *, sample_s: float = 1e-3) -> DemandTracker:
        """Give the chain as a controller runs it, sample by sample, with the limits of the reference.

        Parameters
        ----------
        sample_s : float
            Time between samples [s], 1e-5 to 1.

        Returns
        -------
        DemandTracker
            ``step(pedal_percent, speed_rpm, pressure_kpa)`` gives the demand and the reference of a sample by name,
            ``take_over(reference_deg)`` goes on from an angle without a bump, ``state`` saves a run, ``reset`` forgets
            it.

        Raises
        ------
        mgdd.errors.ParameterError
            A sample time outside its domain.

        Examples
        --------
        >>> from mgdd.throttle import DemandChain
        >>> tracker = DemandChain().tracker()
        >>> start = tracker.step(10.0, 2000.0)["reference_deg"]
        >>> later = [tracker.step(60.0, 2000.0)["reference_deg"] for _ in range(400)]
        >>> round(start, 2), round(max(later), 1), round(later[-1], 2)
        (4.63, 13.0, 10.98)
        """
        return _core.throttle.DemandTracker(self, sample_s=sample_s)
