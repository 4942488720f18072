"""Duty signals that make a throttle show its parameters: offset and amplitude, sampled, within -1..1.

Each gives ``duty`` over ``time_s``, with attributes that describe it, and refuses what `chirp` refuses.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd.errors import ParameterError
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

# Feedback taps of maximum-length registers, exclusive or of the bits named (from 1).
_TAPS = {
    3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7), 11: (11, 9),
    12: (12, 6, 4, 1), 13: (13, 4, 3, 1), 14: (14, 5, 3, 1), 15: (15, 14), 16: (16, 15, 13, 4),
}  # fmt: skip
_GOLDEN = 0.6180339887
_MOST_SAMPLES = 5_000_000


def chirp(
    duration_s: float = 12.0,
    *,
    offset: float,
    amplitude: float,
    low_hz: float = 0.2,
    high_hz: float = 6.0,
    sample_s: float = 1e-3,
) -> xr.Dataset:
    """Sweep a sine linearly from `low_hz` to `high_hz`.

    Parameters
    ----------
    duration_s, sample_s : float
        Length and sample time [s].
    offset, amplitude : float
        Mean duty and half the swing [-].
    low_hz, high_hz : float
        First and last frequency [Hz].

    Returns
    -------
    xarray.Dataset
        ``duty`` over ``time_s``; the attributes describe it.

    Raises
    ------
    ParameterError
        Here and in the other signals: a duty beyond ±1, a frequency at or above half the sampling rate, a length
        below two samples, a number outside the range of its parameter.

    Examples
    --------
    >>> from mgdd.signals import chirp
    >>> sweep = chirp(12.0, offset=0.15, amplitude=0.20)
    >>> sweep.sizes["time_s"], float(sweep["duty"][0])
    (12000, 0.15)
    """
    time = _time(duration_s, sample_s)
    _check_band(low_hz, high_hz, sample_s)
    phase = 2.0 * math.pi * (low_hz * time + (high_hz - low_hz) * time**2 / (2.0 * duration_s))
    return _signal("chirp", time, np.sin(phase), offset, amplitude, low_hz=low_hz, high_hz=high_hz)


def multisine(
    duration_s: float = 20.0,
    *,
    offset: float,
    amplitude: float,
    fundamental_hz: float = 0.1,
    high_hz: float = 8.0,
    harmonics: int = 20,
    sample_s: float = 1e-3,
) -> xr.Dataset:
    """Add odd harmonics of equal size with Schroeder's phases, which keep the peak low.

    Odd harmonics only: what the plate answers at the even ones is its nonlinearity. The harmonics are evenly spaced
    up to `high_hz`.

    Parameters
    ----------
    duration_s, sample_s : float
        Length and sample time [s]; whole periods of the fundamental use the length best.
    offset, amplitude : float
        Mean duty and largest swing from it [-].
    fundamental_hz, high_hz : float
        Fundamental and upper end of the band [Hz].
    harmonics : int
        How many.

    Returns
    -------
    xarray.Dataset
        ``duty`` over ``time_s``; ``attrs["crest_factor"]`` is peak over RMS of the swing.

    Notes
    -----
    Phase k of N is -pi k (k - 1)/N, Schroeder's for a flat spectrum.

    Examples
    --------
    >>> from mgdd.signals import multisine
    >>> multisine(offset=0.0, amplitude=0.2).attrs["crest_factor"] < 2.0
    True
    """
    time = _time(duration_s, sample_s)
    _check_band(fundamental_hz, high_hz, sample_s)
    odd = np.arange(1, math.floor(high_hz / fundamental_hz * (1.0 + 1e-12)) + 1, 2)
    if not 1 <= harmonics <= odd.size:
        raise ParameterError.of(
            "harmonics", harmonics, f"in [1, {odd.size}], the odd ones of {fundamental_hz:g} Hz up to {high_hz:g} Hz"
        )
    if duration_s * fundamental_hz < 1.0 - 1e-9:
        raise ParameterError(
            f"duration_s = {duration_s:g}: must hold one period of fundamental_hz = {fundamental_hz:g}"
        )
    spacing = (odd.size - 1) // (harmonics - 1) if harmonics > 1 else 1
    lines = odd[::spacing][:harmonics]
    k = np.arange(1, harmonics + 1)
    phases = -math.pi * k * (k - 1) / harmonics
    wave = np.cos(2.0 * math.pi * fundamental_hz * lines * time[:, None] + phases).sum(axis=1)
    # The peak between two samples is the amplifier's too, but what is sent is samples.
    period = _time(1.0 / fundamental_hz, min(sample_s, 0.02 / high_hz))
    whole = np.cos(2.0 * math.pi * fundamental_hz * lines * period[:, None] + phases).sum(axis=1)
    peak = max(float(np.abs(whole).max()), float(np.abs(wave).max()))
    crest = peak / float(np.sqrt(np.mean(whole**2)))
    return _signal(
        "multisine", time, wave / peak, offset, amplitude,
        low_hz=fundamental_hz, high_hz=float(lines[-1]) * fundamental_hz, harmonics=harmonics, crest_factor=crest,
    )  # fmt: skip


def prbs(
    duration_s: float | None = None,
    *,
    offset: float,
    amplitude: float,
    hold_s: float = 0.1,
    register: int = 7,
    sample_s: float = 1e-3,
) -> xr.Dataset:
    """Switch between two levels by a shift register of maximum length.

    Parameters
    ----------
    duration_s : float, optional
        Length [s]; None takes one period, ``hold_s`` times 2**register - 1.
    offset, amplitude : float
        Mean of the two levels and half their distance [-].
    hold_s : float
        Shortest time at a level [s]: the spectrum is flat to about 0.44 over it.
    register : int
        Length of the register, 3 to 16.
    sample_s : float
        Sample time [s].

    Examples
    --------
    >>> from mgdd.signals import prbs
    >>> signal = prbs(offset=0.15, amplitude=0.2, register=5)
    >>> signal.sizes["time_s"], sorted(set(signal["duty"].to_numpy().round(9).tolist()))
    (3100, [-0.05, 0.35])
    """
    ParameterError.unless(register in _TAPS, "register", register, "in [3, 16]")
    held = _hold(hold_s, sample_s)
    bits = maximum_length_sequence(register)
    time = _time(bits.size * held * sample_s if duration_s is None else duration_s, sample_s)
    wave = 2.0 * bits[(np.arange(time.size) // held) % bits.size].astype(np.float64) - 1.0
    return _signal(
        "prbs", time, wave, offset, amplitude,
        low_hz=1.0 / (bits.size * held * sample_s), high_hz=0.44 / (held * sample_s), hold_s=held * sample_s,
        register=register,
    )  # fmt: skip


def amplitude_random_steps(
    duration_s: float = 10.0,
    *,
    offset: float,
    amplitude: float,
    hold_s: float | tuple[float, float] = 0.15,
    seed: int | None = None,
    sample_s: float = 1e-3,
) -> xr.Dataset:
    """Step to levels spread over the whole swing (an amplitude-modulated pseudo-random sequence).

    Parameters
    ----------
    duration_s, sample_s : float
        Length and sample time [s].
    offset, amplitude : float
        Mean duty and largest swing from it [-].
    hold_s : float or (float, float)
        Time at a level, or shortest and longest [s]; a range needs a seed.
    seed : int, optional
        Of levels and holds. None takes the golden-ratio sequence, level k at ``2 frac(0.618 k) - 1``, which fills
        the swing evenly.

    Examples
    --------
    >>> from mgdd.signals import amplitude_random_steps
    >>> steps = amplitude_random_steps(3.0, offset=0.15, amplitude=0.2)
    >>> [round(float(u), 4) for u in steps["duty"][[0, 150, 300]]]
    [-0.05, 0.1972, 0.0444]
    """
    time = _time(duration_s, sample_s)
    shortest, longest = (hold_s, hold_s) if isinstance(hold_s, int | float) else hold_s
    least, most = _hold(shortest, sample_s), _hold(longest, sample_s)
    if most < least:
        raise ParameterError(f"hold_s = ({shortest:g}, {longest:g}): the first must not exceed the second")
    count = time.size // least + 1
    if seed is None:
        if most != least:
            raise ParameterError("seed = None: a range of hold_s is drawn at random and needs a seed")
        levels, holds = 2.0 * np.mod(_GOLDEN * np.arange(count), 1.0) - 1.0, np.full(count, least)
    else:
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
            raise ParameterError.of("seed", seed, "a whole number >= 0")
        rng = np.random.default_rng(seed)
        levels, holds = rng.uniform(-1.0, 1.0, count), rng.integers(least, most + 1, count)
    wave = np.repeat(levels, holds)[: time.size]
    return _signal(
        "amplitude_random_steps",
        time,
        wave,
        offset,
        amplitude,
        high_hz=0.44 / (least * sample_s),
        hold_s=least * sample_s,
    )


def staircase(
    *,
    offset: float,
    amplitude: float,
    rise: float = 0.01,
    hold_s: float = 0.25,
    cycles: int = 1,
    sample_s: float = 1e-3,
) -> xr.Dataset:
    """Climb from the lowest duty to the highest and back in small steps: hysteresis, breakaway, springs.

    Parameters
    ----------
    offset, amplitude : float
        Mean duty and half the swing [-].
    rise : float
        Height of a step [-]; the last one may be lower.
    hold_s, sample_s : float
        Time on a step and sample time [s].
    cycles : int
        How often up and down.

    Examples
    --------
    >>> from mgdd.signals import staircase
    >>> stairs = staircase(offset=0.0, amplitude=0.3)
    >>> round(float(stairs["time_s"][-1]), 6), round(float(stairs["duty"].max()), 9)
    (30.249, 0.3)
    """
    _check_swing(offset, amplitude)
    held = _hold(hold_s, sample_s)
    ParameterError.unless(math.isfinite(rise) and rise > 0.0, "rise", rise, "> 0")
    ParameterError.unless(cycles >= 1, "cycles", cycles, ">= 1")
    count = max(math.ceil(2.0 * amplitude / rise * (1.0 - 1e-9)), 1)
    up = np.linspace(-1.0, 1.0, count + 1)
    levels = np.r_[up, np.tile(np.r_[up[-2::-1], up[1:]], cycles - 1), up[-2::-1]]
    time = _time(levels.size * held * sample_s, sample_s)
    return _signal("staircase", time, np.repeat(levels, held), offset, amplitude, hold_s=held * sample_s, rise=rise)


def triangle(
    duration_s: float = 40.0, *, offset: float, amplitude: float, frequency_hz: float = 0.05, sample_s: float = 1e-3
) -> xr.Dataset:
    """Ramp slowly up and down: friction by the hysteresis, preload by the jump at limp-home, springs by the slope.

    Parameters
    ----------
    duration_s, sample_s : float
        Length and sample time [s].
    offset, amplitude : float
        Mean duty and half the swing [-]; starts at `offset`, upwards.
    frequency_hz : float
        Ramps up and down per second [Hz].

    Examples
    --------
    >>> from mgdd.signals import triangle
    >>> ramp = triangle(20.0, offset=0.0, amplitude=0.3)
    >>> round(float(ramp["duty"].max()), 6), round(float(ramp["duty"][10000]), 6)
    (0.3, 0.0)
    """
    time = _time(duration_s, sample_s)
    _check_band(0.0, frequency_hz, sample_s)
    wave = 1.0 - np.abs(np.mod(4.0 * frequency_hz * time + 3.0, 4.0) - 2.0)
    return _signal("triangle", time, -wave, offset, amplitude, low_hz=frequency_hz, high_hz=frequency_hz)


def maximum_length_sequence(register: int) -> NDArray[np.int_]:
    """Return one period, 2**register - 1 bits, of the register that starts with all ones."""
    from scipy.signal import max_len_seq

    # SciPy counts the bits from the other end and always feeds back the last.
    bits, _ = max_len_seq(register, taps=[register - tap for tap in _TAPS[register][1:]])
    return np.asarray(bits, dtype=np.int_)


def _time(duration_s: float, sample_s: float) -> NDArray[np.float64]:
    ParameterError.unless(math.isfinite(sample_s) and sample_s > 0.0, "sample_s", sample_s, "finite and > 0")
    if not (math.isfinite(duration_s) and duration_s >= 2.0 * sample_s):
        raise ParameterError.of("duration_s", duration_s, f"finite and at least two samples of {sample_s:g} s")
    if duration_s / sample_s > _MOST_SAMPLES:
        raise ParameterError(f"duration_s = {duration_s:g}: {_MOST_SAMPLES} samples of {sample_s:g} s are the most")
    return np.arange(round(duration_s / sample_s), dtype=np.float64) * sample_s


def _hold(hold_s: float, sample_s: float) -> int:
    if not (sample_s > 0.0 and math.isfinite(hold_s) and hold_s >= sample_s * (1.0 - 1e-9)):
        raise ParameterError.of("hold_s", hold_s, f"at least one sample, sample_s = {sample_s:g}")
    return max(round(hold_s / sample_s), 1)


def _check_band(low_hz: float, high_hz: float, sample_s: float) -> None:
    nyquist = 0.5 / sample_s
    if not 0.0 <= low_hz <= high_hz or not high_hz > 0.0:
        raise ParameterError(f"low_hz = {low_hz:g}, high_hz = {high_hz:g}: must be 0 <= low <= high, high > 0")
    if high_hz >= nyquist:
        raise ParameterError.of(
            "high_hz", high_hz, f"below half the sampling rate, {nyquist:g} Hz; lower it or sample_s = {sample_s:g}"
        )


def _check_swing(offset: float, amplitude: float) -> None:
    if not (math.isfinite(offset) and math.isfinite(amplitude) and amplitude >= 0.0):
        raise ParameterError(f"offset = {offset:g}, amplitude = {amplitude:g}: must be finite, the amplitude >= 0")
    if abs(offset) + amplitude > 1.0 + 1e-12:
        raise ParameterError(
            f"amplitude = {amplitude:g}: with offset = {offset:g} the duty passes ±1; at most {1.0 - abs(offset):g}"
        )


def _signal(
    kind: str, time: NDArray[np.float64], wave: NDArray[np.float64], offset: float, amplitude: float, **attrs: float
) -> xr.Dataset:
    _check_swing(offset, amplitude)
    duty = np.clip(offset + amplitude * wave, -1.0, 1.0)
    labels = {"kind": kind, "offset": offset, "amplitude": amplitude, **attrs}
    return labelled_dataset({"time_s": ("time_s", time), "duty": ("time_s", duty)}, attrs=labels)
