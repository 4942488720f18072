"""Figures of measured cycles, one after another or a whole record at the speed of memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.engine.trace_cycles import CYCLE, burn_marks, scatter
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.presets.meant import CylinderLike, cylinder_of
from mgdd.results.labels import ANGLE, labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray


class Indicating:
    """Work, peaks, burn angles, exponents and knock of cycle after cycle on the same crank angles.

    What the cycles share is prepared once; a cycle of 3600 samples then takes some 15 µs, alone or in a record, with
    equal figures. Against `mgdd.engine.analyze` the burn window is given, nothing is smoothed and nothing doubted: for
    cycles that arrive one by one, and records that were looked at before.

    Parameters
    ----------
    cylinder : Cylinder, Preset, str or path-like
        Geometry, IVC and EVO.
    crank_angle_cad : array_like
        Angles of the samples [°CA aTDC], rising, of the closed part, of 360 or of 720 degrees.
    speed_rpm : float
        Engine speed [rpm], for the band of knock.
    pegging : {"none", "inlet", "two_point", "least_squares"}
        As in `analyze`, of each cycle.
    pegging_exponent : float
        Polytropic exponent of compression [-].
    inlet_pressure_kpa : float, optional
        For ``inlet`` [kPa].
    gamma : float
        Of the heat release [-].
    heat_window_cad : tuple of float
        Window of the cumulative net heat [°CA aTDC].
    knock_band_hz : tuple of float
        Band of the oscillation [Hz]: half the gain at its ends, all of it 25 % of the lower end farther in.
    knock_window_cad : tuple of float
        Where it is looked for [°CA aTDC].

    Raises
    ------
    mgdd.errors.DataError
        Angles with gaps or repeated; fewer than 20 samples from IVC to EVO; without the angles that pegging reads.
    mgdd.errors.ParameterError
        A value outside its domain.

    Notes
    -----
    Work is the trapezoid of p dV; net is that of 720 degrees, gross of -180 to 180, and PMEP is net less gross,
    negative where the gas exchange takes work (Heywood 1988, chapter 2). Net heat is that of Krieger and Borman (1966)
    at a constant gamma; a cycle burns if it exceeds 5 % of the internal energy at the start of the window. MAPO, IMPO
    and SEPO are the largest absolute oscillation, the integral of its absolute value and of its square (Brecq and Le
    Corre 2005). What the angles or the sampling do not reach is NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from mgdd.engine import Indicating
    >>> angle = np.arange(-360.0, 360.0, 0.2)
    >>> indicating = Indicating("puma_single", angle, speed_rpm=1500.0)
    >>> figures = indicating.cycle(np.where(angle < 0.0, 1.2, 1.5))
    >>> round(figures["pmep_bar"], 3)
    -0.3
    """

    def __init__(
        self,
        cylinder: CylinderLike,
        crank_angle_cad: ArrayLike,
        *,
        speed_rpm: float,
        pegging: str = "none",
        pegging_exponent: float = 1.35,
        inlet_pressure_kpa: float | None = None,
        gamma: float = 1.33,
        heat_window_cad: tuple[float, float] = (-10.0, 90.0),
        knock_band_hz: tuple[float, float] = (4000.0, 20000.0),
        knock_window_cad: tuple[float, float] = (-10.0, 90.0),
    ) -> None:
        """Prepare what the cycles share."""
        options = _core.engine.TraceOptions(
            pegging=pegging,
            pegging_exponent=pegging_exponent,
            inlet_pressure_kpa=inlet_pressure_kpa or 0.0,
            gamma=gamma,
            heat_from_cad=heat_window_cad[0],
            heat_to_cad=heat_window_cad[1],
            knock_low_hz=knock_band_hz[0],
            knock_high_hz=knock_band_hz[1],
            knock_from_cad=knock_window_cad[0],
            knock_to_cad=knock_window_cad[1],
        )
        self._core = _core.engine.Indicating(crank_angle_cad, cylinder_of(cylinder), speed_rpm, options)
        self._angle, self._speed_rpm = np.array(crank_angle_cad, np.float64), float(speed_rpm)

    def cycle(self, pressure_bar: ArrayLike) -> dict[str, float]:
        """Give the figures of one cycle.

        Parameters
        ----------
        pressure_bar : array_like
            Pressure [bar] of each crank angle.

        Returns
        -------
        dict of str to float
            By the names of `record`.

        Raises
        ------
        mgdd.errors.DataError
            A sample that is not finite, or above 500 bar.
        mgdd.errors.ShapeError
            Another number of samples than angles.
        """
        return dict(self._core.one(pressure_bar))

    def record(self, pressure_bar: ArrayLike, *, threads: int = 0) -> xr.Dataset:
        """Give the figures of every cycle of a record.

        Parameters
        ----------
        pressure_bar : array_like
            Pressure [bar], (cycle, angle), or (cylinder, cycle, angle).
        threads : int
            Threads of the core; 0 for one per processor.

        Returns
        -------
        xarray.Dataset
            Over ``cycle``, counted from 1, or over ``cylinder`` and it: ``pegging_bar imep_closed_bar imep_gross_bar
            imep_net_bar pmep_bar p_max_bar p_max_cad dp_max_bar_per_cad dp_max_cad heat_net_j ca10_cad ca50_cad
            ca90_cad n_compression n_expansion mapo_bar impo_bar_cad sepo_bar2_cad``, and ``misfire`` and
            ``partial_burn`` for a cycle whose net heat is below a fifth, or four fifths, of the record's median.
            Beside each figure stand its ``mean_NAME``, ``std_NAME``, ``p5_NAME``, ``p95_NAME`` and
            ``cov_NAME_percent``, beside each IMEP its ``lnv_imep_..._percent``: the lowest over the mean.

        Raises
        ------
        mgdd.errors.DataError, mgdd.errors.ShapeError
            As `cycle`, naming the cycle.

        Examples
        --------
        >>> from mgdd.engine import Indicating, simulate
        >>> runs = [simulate("puma_single", {"fuel_mg": mg}, soc_cad=-5.0) for mg in (20.0, 0.0, 21.0)]
        >>> indicating = Indicating("puma_single", runs[0]["crank_angle_cad"], speed_rpm=1500.0)
        >>> made = indicating.record([run["pressure_bar"] for run in runs])
        >>> made["misfire"].values.tolist()
        [False, True, False]
        """
        pressure = np.ascontiguousarray(pressure_bar, np.float64)
        if pressure.ndim not in (2, 3):
            raise ShapeError("pressure_bar must be (cycle, angle) or (cylinder, cycle, angle)")
        scalars = self._core.many(pressure, threads)
        dims = ("cylinder", CYCLE)[-pressure.ndim + 1 :]
        axes = {
            name: (name, np.arange(1, size + 1), "-", name) for name, size in zip(dims, pressure.shape, strict=False)
        }
        figures = {name: (dims, values) for name, values in scalars.items()}
        marks = {name: (dims, values) for name, values in burn_marks(scalars).items()}
        return labelled_dataset({**axes, **figures, **marks, **scatter(scalars, dims[:-1])})

    def oscillation(self, pressure_bar: ArrayLike) -> xr.Dataset:
        """Give the pressure in the band of knock over its window.

        Parameters
        ----------
        pressure_bar : array_like
            Pressure [bar], (cycle, angle).

        Returns
        -------
        xarray.Dataset
            ``oscillation_bar(cycle, crank_angle_cad)``; without angles where the sampling does not reach the band.
        """
        pressure = np.atleast_2d(np.ascontiguousarray(pressure_bar, np.float64))
        sound = self._core.oscillation(pressure)
        return labelled_dataset(
            {
                CYCLE: (CYCLE, np.arange(1, len(pressure) + 1)),
                ANGLE: (ANGLE, sound[ANGLE]),
                "oscillation_bar": ((CYCLE, ANGLE), sound["pressure_bar"]),
            }
        )

    def noise(self, pressure_bar: ArrayLike, *, attenuation_db: Mapping[float, float] | None = None) -> xr.Dataset:
        """Give the third-octave levels of the pressure, and with a structure's attenuation the combustion noise.

        Parameters
        ----------
        pressure_bar : array_like
            Pressure [bar], (cycle, angle), of whole cycles of 720 degrees that follow each other.
        attenuation_db : mapping of float to float, optional
            What the structure of the engine takes away between the pressure and the sound [dB], by frequency [Hz],
            nominal ones of bands included; between them it is linear over the logarithm of frequency. It is a property
            of an engine and a microphone, and there is no default.

        Returns
        -------
        xarray.Dataset
            ``pressure_level_db(cycle, frequency_hz)``, re 20 µPa, in bands of IEC 61260-1 (base ten), as far as the
            sampling reaches and no narrower than the harmonics of a cycle are apart; ``mean_pressure_level_db`` is the
            level of their mean square. With `attenuation_db` also ``noise_level_dba(cycle)``, the A-weighted sum (IEC
            61672-1) over the bands that the table spans, and ``mean_noise_level_dba``.

        Raises
        ------
        mgdd.errors.DataError
            Crank angles that are not a whole cycle in even steps, a sample that is not finite.
        mgdd.errors.ParameterError
            A table of fewer than two numbers, or of other frequencies than the bands.
        mgdd.errors.ShapeError
            Another number of samples than angles.

        Notes
        -----
        What each cycle begins higher or lower than the next one is taken off along it, so that a drift of the sensor is
        no sound.

        Examples
        --------
        >>> import numpy as np
        >>> from mgdd.engine import Indicating
        >>> angle = np.arange(-360.0, 360.0, 0.2)
        >>> indicating = Indicating("puma_single", angle, speed_rpm=1500.0)
        >>> tone = 20.0 + 0.2 * np.sqrt(2.0) * np.sin(2.0 * np.pi * angle / 9.0)  # 1 kHz; 0.2 bar are 180 dB
        >>> made = indicating.noise([tone], attenuation_db={500.0: 90.0, 2000.0: 70.0})
        >>> round(float(made["noise_level_dba"][0]), 3)
        100.0
        """
        pressure = np.atleast_2d(np.ascontiguousarray(pressure_bar, np.float64))
        if pressure.ndim != 2 or pressure.shape[1] != self._angle.size:
            raise ShapeError(f"pressure_bar has shape {pressure.shape}: must be (cycle, {self._angle.size} angles)")
        if not np.isfinite(pressure).all():
            cycle, sample = np.argwhere(~np.isfinite(pressure))[0]
            raise DataError(f"cycle {cycle + 1}: pressure_bar[{sample}] = {pressure[cycle, sample]}: must be finite")
        hz, level = pressure_levels(self._angle, pressure, self._speed_rpm)
        made: dict[str, tuple[Any, ...]] = {
            CYCLE: (CYCLE, np.arange(1, len(pressure) + 1)),
            "frequency_hz": ("frequency_hz", hz),
            "pressure_level_db": ((CYCLE, "frequency_hz"), level),
            "mean_pressure_level_db": ("frequency_hz", _mean_db(level)),
        }
        if attenuation_db is not None:
            noise = noise_levels(hz, level, attenuation_db)
            made |= {"noise_level_dba": (CYCLE, noise), "mean_noise_level_dba": ((), _mean_db(noise))}
        return labelled_dataset(made)


def _mean_db(level_db: NDArray[np.float64]) -> NDArray[np.float64]:
    """Level of the mean square over the cycles."""
    with np.errstate(divide="ignore"):
        mean_db: NDArray[np.float64] = 10.0 * np.log10(np.mean(10.0 ** (0.1 * level_db), axis=0))
    return mean_db


_CYCLE_DEG = 720.0
_REFERENCE_PA, _PA_PER_BAR = 20e-6, 1e5
# Of the audible range, by their number from 1 kHz on: 20 Hz to 20 kHz (IEC 61260-1, base-ten).
_FIRST, _LAST, _PER_DECADE = -17, 13, 10.0
_NOMINAL = 0.05  # of a band, by which a nominal frequency as 1.6 kHz is beside that of its band
_POLES_HZ = (20.598997, 107.65265, 737.86223, 12194.217)  # of A-weighting; the outer two are double


def pressure_levels(
    angle_cad: NDArray[np.float64], bar: NDArray[np.float64], speed_rpm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the mid-band frequencies [Hz] and the level of each cycle (cycle, band) [dB re 20 µPa].

    A cycle has harmonics of half the engine speed, and a band those between its edges. Bands that are narrower than
    the harmonics are apart, or reach beyond half the sampling rate, are left out.
    """
    step = float(np.median(np.diff(angle_cad)))
    samples = round(_CYCLE_DEG / step)
    even = np.abs(np.diff(angle_cad) - step).max() <= 0.01 * step
    if not even or samples not in (angle_cad.size, angle_cad.size - 1):
        span = angle_cad[-1] - angle_cad[0] + step
        raise DataError(
            f"levels are of whole cycles in even steps, and the crank angles span {span:.4g} of {_CYCLE_DEG:g} degrees"
            f"{'' if even else ', in uneven steps'}: record whole cycles"
        )
    bar = bar[:, :samples]
    # A cycle ends where the next begins: the rise from one to the other is not sound, and is taken off along it.
    rise = np.append(np.diff(bar[:, 0]), 0.0)
    periodic = bar - rise[:, None] * (np.arange(samples) / samples)
    lines = np.fft.rfft(periodic, axis=1)[:, 1 : (samples + 1) // 2] / samples
    squares = 2.0 * np.abs(lines * _PA_PER_BAR) ** 2
    spacing = speed_rpm / 120.0
    number = np.arange(_FIRST, _LAST + 1)
    low, high = (1e3 * 10.0 ** ((number + side) / _PER_DECADE) for side in (-0.5, 0.5))
    usable = (high - low >= spacing) & (high <= spacing * samples / 2)
    edges = np.append(low[usable], high[usable][-1:])
    at = np.searchsorted(spacing * np.arange(1, lines.shape[1] + 1), edges)
    sums = np.concatenate([np.zeros((len(bar), 1)), np.cumsum(squares, axis=1)], axis=1)
    with np.errstate(divide="ignore"):
        levels = 10.0 * np.log10(np.diff(sums[:, at], axis=1) / _REFERENCE_PA**2)
    return 1e3 * 10.0 ** (number[usable] / _PER_DECADE), levels


def noise_levels(
    hz: NDArray[np.float64], level_db: NDArray[np.float64], attenuation_db: Mapping[float, float]
) -> NDArray[np.float64]:
    """Give the A-weighted level of each cycle behind a structure: the sum over the bands within its table [dB]."""
    table = {float(key): float(value) for key, value in attenuation_db.items()}
    if len(table) < 2 or not all(key > 0.0 and np.isfinite([key, value]).all() for key, value in table.items()):
        raise ParameterError.of("attenuation_db", attenuation_db, "two or more finite dB by their frequencies > 0 Hz")
    number = _PER_DECADE * np.log10(np.array(sorted(table)) / 1e3)
    number = np.where(np.abs(number - number.round()) < _NOMINAL, number.round(), number)
    band = (_PER_DECADE * np.log10(hz / 1e3)).round()
    inside = (band >= number[0]) & (band <= number[-1])
    if not inside.any():
        shown = f"{min(table):g} to {max(table):g} Hz"
        raise ParameterError.of("attenuation_db", shown, f"of the bands from {hz[0]:.4g} to {hz[-1]:.4g} Hz")
    loss = np.interp(band, number, [table[key] for key in sorted(table)])
    shares = 10.0 ** (0.1 * (level_db - loss + a_weighting_db(hz)))
    with np.errstate(divide="ignore"):
        band_db: NDArray[np.float64] = 10.0 * np.log10(shares[:, inside].sum(axis=1))
    return band_db


def a_weighting_db(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the A-weighting of frequencies [dB], 0 at 1 kHz (IEC 61672-1)."""
    made: NDArray[np.float64] = 20.0 * np.log10(_a_response(np.asarray(hz, np.float64)) / _a_response(np.float64(1e3)))
    return made


def _a_response(hz: NDArray[np.float64] | np.float64) -> NDArray[np.float64]:
    first, second, third, fourth = (hz**2 + pole**2 for pole in _POLES_HZ)
    made: NDArray[np.float64] = hz**4 / (first * np.sqrt(second * third) * fourth)
    return made
