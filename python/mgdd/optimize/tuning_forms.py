"""The tuner's closed forms: harmonics that do not mix, and the scatter of coupled estimates.

Below, z is the error of the estimate, each input in units of 1/sqrt(abs(J'')), so that the Hessian has ones on its
diagonal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from mgdd import _core
from mgdd.errors import ParameterError, ShapeError
from mgdd.optimize.inputs import named_values

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_RMS, _DISTANCE, _ARRIVAL, _AMPLITUDE_MAX = 0.2, 5.0, 0.45, 1.8  # of sqrt(noise_sd/abs(J''))
_CYCLES = 50.0
_RESERVE = 0.85  # noise makes arrival later than the mean path
_PERIODS = {"batch": 6, "moving_average": 10}  # at least
_PERIODS_OF_LAG = 2.4
_SLOW_PERIODS = 6.0  # per cycle of an unknown delay: 60 degrees
_DELAY_DOUBT, _DELAY_DOUBT_LEAST = 0.2, 2.0
_DELAYS_PER_TAU = 3.0


def coupling_of(hessian: Array) -> tuple[Array, Array]:
    """Return eigenvalues and eigenvectors of a matrix of curvatures whose diagonal is scaled to ones."""
    size = np.sqrt(np.abs(np.diag(hessian)))
    scaled = np.abs(hessian[0, 0]) / hessian[0, 0] * hessian / np.outer(size, size)
    eigen = np.linalg.eigh(scaled)
    return eigen.eigenvalues, eigen.eigenvectors


def harmonics_of(inputs: int, *, least: int, per_harmonic: float = 0.0) -> tuple[int, tuple[int, ...]]:
    """Return the shortest common period, and the oscillations in it of every input.

    The fastest input is as slow as possible. No harmonic is twice another one, nor sum or difference of two, also not
    where sampling folds them back; so the curvatures of J echo beside the slopes.
    """
    period = least
    while True:
        fastest = min((period - 1) // 2, int(period / per_harmonic) if per_harmonic > 0.0 else period)
        for top in range(inputs, fastest + 1):
            for below in combinations(range(top - 1, 0, -1), inputs - 1):  # close to each other: less ripple
                if _apart(harmonics := (*below[::-1], top), period):
                    return period, harmonics
        period += 1


def _apart(harmonics: tuple[int, ...], period: int) -> bool:
    own = set(harmonics)
    mixed = {2 * n for n in harmonics} | {f for a, b in combinations(harmonics, 2) for f in (a + b, abs(a - b))}
    return not own & ({f % period for f in mixed} | {-f % period for f in mixed})


def tuned(
    noise_sd: float,
    hessian: Array,
    of: tuple[str, ...],
    *,
    method: str,
    delay_cycles: float,
    lag_cycles: float,
    compensated: bool,
    delay_uncertainty: float | None,
    cycles: float | None,
    lengths: Mapping[str, Array | None],
) -> dict[str, Any]:
    """Choose settings; `lengths` holds rms, distance, arrival and amplitude_max, each per input or None.

    `of` is what a message writes behind the name of a number, per input.
    """
    own = 1.0 / np.sqrt(np.abs(np.diag(hessian)))  # units of z
    length = math.sqrt(noise_sd) * own
    shares = {"rms": _RMS, "distance": _DISTANCE, "arrival": _ARRIVAL, "amplitude_max": _AMPLITUDE_MAX}
    spec = {
        name: (share * length if (given := lengths[name]) is None else given) / own for name, share in shares.items()
    }
    for which, arrival, distance in zip(of, spec["arrival"] * own, spec["distance"] * own, strict=True):
        ParameterError.unless(arrival < distance, f"arrival{which}", arrival, f"below distance = {distance:g}")
    lag = _core.optimize.ComponentLag(delay_cycles=delay_cycles, lag_cycles=lag_cycles)
    whole = delay_cycles + lag_cycles
    if delay_uncertainty is None:
        delay_uncertainty = max(_DELAY_DOUBT * whole, _DELAY_DOUBT_LEAST) if whole > 0.0 else 0.0
    coupling = coupling_of(hessian)
    if method == "spsa":
        if whole > 0.0 or delay_uncertainty > 0.0:
            raise ParameterError(
                "method = 'spsa': takes a measurement without delay and lag; hold each set-point until the sensor has "
                "settled, or use 'batch'"
            )
        out, scatter = _spsa(noise_sd, coupling, spec, cycles)
    else:
        out, scatter = _dither(noise_sd, coupling, spec, method, lag, compensated, delay_uncertainty, cycles)
    out["rms"] = np.sqrt(np.diag(scatter))
    out["jitter_cost"] = 0.5 * float(np.sum(_matrix(coupling) * scatter))
    reasons = list[str]()
    if cycles is not None and out["cycles"] > cycles:
        reasons.append(
            f"cycles = {cycles:g} is too few: with a period of {out['period']} and a time constant of "
            f"{out['time_constant_cycles']:.4g} cycles the way takes {out['cycles']:.4g}"
        )
    for i in np.flatnonzero(out["rms"] > spec["rms"] * (1.0 + 1e-6)):
        reasons.append(
            f"rms{of[i]} = {spec['rms'][i] * own[i]:.4g} is out of reach with amplitude_max = "
            f"{spec['amplitude_max'][i] * own[i]:.4g}: expect {out['rms'][i] * own[i]:.4g}; an amplitude of "
            f"{out['amplitude'][i] * out['rms'][i] / spec['rms'][i] * own[i]:.4g} would do"
        )
    for name in ("amplitude", "rate", "rms"):
        out[name] = out[name] * own
    out["gain"] = out["gain"] * own ** (2 if method == "spsa" else 1)
    return {**out, "method": method, "met": not reasons, "reasons": tuple(reasons)}


def _matrix(coupling: tuple[Array, Array]) -> Array:
    size, along = coupling
    return np.asarray((along * size) @ along.T)


def _amplitudes(amplitude: Array, spec: Mapping[str, Array], scatter: Callable[[Array], Array]) -> Array:
    """Return the smallest amplitudes that leave the specified rms, as far as they are allowed."""
    for _ in range(100):
        amplitude = np.minimum(spec["amplitude_max"], amplitude * np.sqrt(np.diag(scatter(amplitude))) / spec["rms"])
    return amplitude


def _dither(
    noise_sd: float,
    coupling: tuple[Array, Array],
    spec: Mapping[str, Array],
    method: str,
    lag: Any,
    compensated: bool,
    doubt: float,
    cycles: float | None,
) -> tuple[dict[str, Any], Array]:
    bends, along = coupling
    batch = method == "batch"
    whole = lag.delay_cycles + lag.lag_cycles
    if not batch and not compensated and whole > 0.0:
        raise ParameterError(
            "method = 'moving_average': behind a lag that is not compensated its window slows the approach by more "
            "than these forms say; use 'batch', or compensate"
        )
    lagged = whole > 0.0 or doubt > 0.0
    unknown = doubt + (0.0 if compensated else whole)
    per_harmonic = max(_SLOW_PERIODS * unknown, _PERIODS_OF_LAG * lag.lag_cycles if compensated else 0.0)
    period, harmonics = harmonics_of(bends.size, least=_PERIODS[method], per_harmonic=per_harmonic)
    response = np.array([lag.response(period=period, harmonic=n) for n in harmonics])
    echo = response[:, 0] * (1.0 if compensated else np.cos(np.radians(response[:, 1])))

    ratio = spec["distance"] / spec["arrival"]
    decades = float(np.log(ratio).max())
    # The fastest direction keeps to the bound of averaging, the slowest one has to arrive.
    tau_least = bends[-1] * max((4.0 if lagged and compensated else 2.0) * period, _DELAYS_PER_TAU * (whole + doubt))
    cycles_wanted = cycles if cycles is not None else max(_CYCLES, (period + tau_least / bends[0] * decades) / _RESERVE)
    tau = max(tau_least, bends[0] * (_RESERVE * cycles_wanted - period) / decades)

    def scatter(amplitude: Array) -> Array:
        """Solve the stationary covariance of z with the noise of the slopes that its steps take in."""
        noise = (along.T * (2.0 * (noise_sd / (echo * amplitude * tau)) ** 2)) @ along
        share = bends / tau
        if batch:
            decay = 1.0 - period * share
            own = period * noise / (1.0 - np.outer(decay, decay))
        else:
            own = noise / np.add.outer(share, share)
        return np.asarray(along @ own @ along.T)

    amplitude = _amplitudes(spec["amplitude_max"], spec, scatter)
    final = scatter(amplitude)
    # What the clip must pass: noise of a batch; of a continuous step, the slopes of all inputs, which add up in it.
    if batch:
        rate = np.maximum(amplitude, 3.0 * np.sqrt(2.0 * period / tau * np.diag(final))) / period
    else:
        rate = np.maximum(3.0 * amplitude / period, 2.0 * float(amplitude @ spec["distance"]) / (amplitude * tau))
    slowest = float(tau / bends[0])
    linear = np.maximum(spec["arrival"], np.minimum(spec["distance"], rate * slowest))
    way = (spec["distance"] - linear) / rate + slowest * np.log(linear / spec["arrival"])
    out = {
        "amplitude": amplitude,
        "period": period,
        "harmonics": np.array(harmonics),
        "gain": 2.0 / (amplitude * tau * (1.0 if compensated else echo)),
        "rate": rate,
        "time_constant_cycles": slowest,
        "cycles": float(period + way.max()),
        "dither_cost": 0.25 * float(amplitude @ amplitude),
        "sensor_gain": response[:, 0],
        "sensor_phase_deg": response[:, 1],
        "delay_uncertainty": doubt,
    }
    return out, final


def spsa_moments(hessian: Array, q: float, c: Array) -> Array:
    """Return what an iteration makes of the second moments of c z, row by row: each slope bears those of all inputs."""
    count = c.size
    slopes, eye = hessian * np.outer(c, 1.0 / c), np.eye(count)
    squares = np.kron(slopes, slopes).reshape(count, count, count * count)
    spread = 2.0 * squares
    spread[np.arange(count), np.arange(count)] = np.trace(squares)
    linear = np.eye(count * count) - q * (np.kron(slopes, eye) + np.kron(eye, slopes))
    return np.asarray(linear + q * q * spread.reshape(count * count, -1))


def _spsa(
    noise_sd: float, coupling: tuple[Array, Array], spec: Mapping[str, Array], cycles: float | None
) -> tuple[dict[str, Any], Array]:
    count = coupling[0].size
    cycles_wanted = _CYCLES if cycles is None else cycles
    decades = float(np.log(spec["distance"] / spec["arrival"]).max())
    hessian = _matrix(coupling)

    def shrinks(q: float) -> float:
        return float(np.abs(np.linalg.eigvals(spsa_moments(hessian, q, spec["amplitude_max"]))).max())

    # Steps above 1/(inputs + 1) gain little: the slopes of the other inputs scatter them.
    steps = np.linspace(0.0, 1.0 / (count + 1), 201)[1:]
    factors = np.array([shrinks(q) for q in steps])
    q = float(steps[factors.argmin()])
    target = math.exp(-4.0 * decades / (_RESERVE * cycles_wanted))
    if factors.min() < target:
        low, high = 0.0, q
        for _ in range(60):
            q = 0.5 * (low + high)
            low, high = (low, q) if shrinks(q) < target else (q, high)

    def scatter(c: Array) -> Array:
        noise = (0.5 * (q * noise_sd) ** 2 * np.eye(count)).ravel()
        own = np.linalg.solve(np.eye(count * count) - spsa_moments(hessian, q, c), noise).reshape(count, count)
        return np.asarray(own / np.outer(c, c))

    c = _amplitudes(spec["amplitude_max"], spec, scatter)
    time_constant = -4.0 / math.log(float(np.abs(np.linalg.eigvals(spsa_moments(hessian, q, c))).max()))
    out = {
        "amplitude": c,
        "period": 2,
        "harmonics": None,
        "gain": np.full(count, q),
        "rate": np.maximum(2.0 * c, 1.2 * q * float(c @ spec["distance"]) / c),
        "time_constant_cycles": time_constant,
        "cycles": time_constant * decades,
        "dither_cost": 0.5 * float(c @ c),
        "sensor_gain": np.ones(count),
        "sensor_phase_deg": np.zeros(count),
        "delay_uncertainty": 0.0,
    }
    return out, scatter(c)


_METHODS = ("batch", "moving_average", "spsa")
_MOST_INPUTS = 8
_FLAT = 1e-6  # of the curvature along the inputs


def hessian_of(curvature: Any, inputs: Sequence[str]) -> tuple[Any, tuple[str, ...]]:
    """Read the curvature: a number for one input, a matrix for several, and the names of the inputs."""
    names = tuple(inputs)
    if isinstance(curvature, Mapping):
        names = names or tuple(map(str, curvature))
        curvature = named_values("curvature", curvature, names)
    values = np.asarray(curvature, dtype=np.float64)
    if values.size == 1:
        values = values.reshape(())
    count = len(values) if values.ndim else 1
    if values.ndim > 2 or values.shape not in ((), (count,), (count, count)) or count > _MOST_INPUTS:
        raise ShapeError(
            f"curvature has shape {values.shape}: must be a number, one per input, or the matrix of at most "
            f"{_MOST_INPUTS} inputs"
        )
    if names and len(names) != count:
        raise ShapeError(f"inputs has {len(names)} entries: must have {count}, one per input of curvature")
    for value in np.ravel(values if values.ndim < 2 else np.diag(values)):
        if not (math.isfinite(value) and value != 0.0):
            raise ParameterError.of("|curvature|", abs(value), "> 0; measure J at three points per input or more")
    if not values.ndim:
        return float(values), names
    if values.ndim == 1:
        return np.diag(-np.abs(values)), names
    if not np.isfinite(values).all() or not np.allclose(values, values.T, rtol=1e-6, atol=0.0):
        raise ParameterError("curvature: must be a symmetric matrix of finite numbers")
    sizes = coupling_of(values)[0]
    if (np.diag(values) > 0.0).any() != (np.diag(values) > 0.0).all() or not sizes[0] > _FLAT:
        raise ParameterError(
            "curvature: J must bend one way in every direction; its scaled matrix has the eigenvalues "
            f"{', '.join(f'{size:.3g}' for size in sizes)}: measure again, or give one number per input"
        )
    return values, names


def of_each(hessian: NDArray[np.float64], names: Sequence[str]) -> tuple[str, ...]:
    """Write of which input a number is; nothing where there is one without a name."""
    if len(hessian) == 1 and not names:
        return ("",)
    return tuple(f" of {name}" for name in names or (f"input {place}" for place in range(len(hessian))))


def per_input(name: str, value: Any, of: Sequence[str]) -> NDArray[np.float64] | None:
    """Read numbers of the specification, one per input."""
    if value is None:
        return None
    numbers, count = np.asarray(value, dtype=np.float64), len(of)
    if count == 1 and numbers.size != 1:
        raise ShapeError(f"{name} has {numbers.size} entries: must be one number, as curvature")
    if count > 1 and numbers.shape != (count,):
        raise ShapeError(f"{name} has shape {numbers.shape}: must be ({count},), one number per input in its unit")
    for which, number in zip(of, numbers.ravel(), strict=True):
        ParameterError.unless(number > 0.0 and math.isfinite(number), f"{name}{which}", number, "> 0")
    return numbers.ravel()


def check_wish(noise_sd: float, method: str, delay_uncertainty: float | None, cycles: float | None) -> None:
    """Refuse what is not per input."""
    ParameterError.unless(method in _METHODS, "method", method, f"one of {', '.join(_METHODS)}")
    if not (noise_sd > 0.0 and math.isfinite(noise_sd)):
        raise ParameterError.of(
            "noise_sd", noise_sd,
            "> 0; repeat one set-point some twenty times and take the standard deviation of J",
        )  # fmt: skip
    ParameterError.unless(cycles is None or (cycles > 0.0 and math.isfinite(cycles)), "cycles", cycles, "> 0")
    if delay_uncertainty is not None and not (delay_uncertainty >= 0.0 and math.isfinite(delay_uncertainty)):
        raise ParameterError.of("delay_uncertainty", delay_uncertainty, ">= 0 and finite; 0 for a delay known exactly")
