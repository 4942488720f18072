"""A throttle fitted to a log as users of SciPy, lmfit, jax-sysid and SIPPY would, for `throttle_peers.py`.

Each takes the log (time [s], duty [-], angle [deg]) and the two stops [deg], and returns what gives the free run along
another duty. The grey box is the same for all: a plate with one time constant, two springs with preload, dry friction,
a lag of the motor and rigid stops, at steps of 0.25 ms. Pages include the code between the marks.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]
Run = Callable[[Column, float], Column]  # free run along a duty from an angle at rest
DELAYS = range(4)


# [model]
NAMES = ("tau", "gain", "up", "down", "k_up", "k_down", "dry", "home", "lag")
START = np.array([0.02, 8e4, 0.13, 0.13, 5e-4, 5e-4, 0.06, 10.0, 1e-3])
LOW, HIGH = 0.1 * START, 10.0 * START


def free_run(p, duty, angle, stops, delay):
    tau, gain, up, down, k_up, k_down, dry, home, lag = p
    x, v, i, h = angle, 0.0, duty[0], 2.5e-4
    out = np.empty(duty.size)
    for k in range(duty.size):
        out[k] = x
        u = duty[max(k - delay, 0)]
        for _ in range(4):
            i += (u - i) * (1.0 - np.exp(-h / lag))
            d = x - home
            spring = up + k_up * d if d > 0.0 else down - k_down * d
            spring *= np.tanh(d / 0.2)
            free = v + h * (gain * (i - spring) - v / tau)
            held = max(abs(free) - h * gain * dry, 0.0)
            v = held if free > 0.0 else -held
            x += h * v
            if x < stops[0] or x > stops[1]:
                x, v = min(max(x, stops[0]), stops[1]), 0.0
    return out


# [/model]


def by_scipy(duty: Column, angle: Column, stops: tuple[float, float]) -> Run:
    """Least squares of the free run, for each delay."""
    # [scipy]
    import numba
    from scipy.optimize import least_squares

    fast = numba.njit(free_run)

    def fit_delay(delay):
        def residual(share):
            return fast(START * share, duty, angle[0], stops, delay) - angle

        first = np.ones(START.size)
        return least_squares(residual, first, bounds=(0.1, 10.0), diff_step=1e-4)

    fits = {delay: fit_delay(delay) for delay in DELAYS}
    delay = min(fits, key=lambda each: fits[each].cost)
    best = START * fits[delay].x
    # [/scipy]
    return lambda other, first: fast(best, other, first, stops, delay)


def by_lmfit(duty: Column, angle: Column, stops: tuple[float, float]) -> Run:
    """Fit the same residual with named parameters and standard errors."""
    # [lmfit]
    import lmfit
    import numba

    fast = numba.njit(free_run)
    first = lmfit.Parameters()
    for row in zip(NAMES, START, LOW, HIGH, strict=True):
        first.add(row[0], row[1], min=row[2], max=row[3])

    def residual(parameters, delay):
        values = np.array([parameters[name].value for name in NAMES])
        return fast(values, duty, angle[0], stops, delay) - angle

    how = {"diff_step": 1e-4, "x_scale": START}  # its default is leastsq

    def fit(delay):
        return lmfit.minimize(residual, first, "least_squares", (delay,), **how)

    fits = {delay: fit(delay) for delay in DELAYS}
    delay = min(fits, key=lambda each: fits[each].chisqr)
    best = np.array([fits[delay].params[name].value for name in NAMES])
    # [/lmfit]
    return lambda other, first: fast(best, other, first, stops, delay)


def by_jax_sysid(duty: Column, angle: Column, stops: tuple[float, float], delay: int) -> Run:
    """Fit the grey box as a state function; the delay is given, for a search costs a fit each."""
    # [jax-sysid]
    import jax.numpy as jnp
    from jax_sysid.models import Model

    def state(state, u, params):
        p = START * jnp.exp(params[0])
        tau, gain, up, down, k_up, k_down, dry, home, lag = p
        (x, v, i), h = state, 2.5e-4
        for _ in range(4):
            i = i + (u[0] - i) * (1.0 - jnp.exp(-h / lag))
            d = x - home
            spring = jnp.where(d > 0.0, up + k_up * d, down - k_down * d)
            spring = spring * jnp.tanh(d / 0.2)
            free = v + h * (gain * (i - spring) - v / tau)
            held = jnp.maximum(jnp.abs(free) - h * gain * dry, 0.0)
            x = x + h * jnp.sign(free) * held
            inside = (x >= stops[0]) & (x <= stops[1])
            v = jnp.where(inside, jnp.sign(free) * held, 0.0)
            x = jnp.clip(x, *stops)
        return jnp.array([x, v, i])

    def late(u):
        return np.concatenate([np.full(delay, u[0]), u])[: u.size]

    model = Model(3, 1, 1, state, lambda x, _u, _p: x[:1])
    model.init(params=[np.zeros(9)], x0=np.array([angle[0], 0.0, duty[0]]))
    model.loss(rho_x0=0.0, rho_th=0.0, xsat=1e6, train_x0=False)
    model.optimization(adam_epochs=0, lbfgs_epochs=500, iprint=-1)
    model.fit(angle, late(duty))
    # [/jax-sysid]

    def run(other: Column, first: float) -> Column:
        return np.asarray(model.predict(np.array([first, 0.0, other[0]]), late(other))[0])[:, 0]

    return run


def by_sippy(duty: Column, angle: Column, stops: tuple[float, float]) -> Run:
    """Fit the best of linear models of order 1 to 4: it has no others."""
    # [sippy]
    from sippy_unipi import functionsetSIM, system_identification

    mean = duty.mean(), angle.mean()
    u, y = duty[None] - mean[0], angle[None] - mean[1]

    def fit(order):
        return system_identification(y, u, "N4SID", SS_fixed_order=order)

    def run(model, duty):
        matrices = model.A, model.B, model.C, model.D
        shift = duty[None] - mean[0]
        _, out = functionsetSIM.SS_lsim_process_form(*matrices, shift)
        return np.clip(out[0] + mean[1], *stops)

    fits = [fit(order) for order in range(1, 5)]
    errors = [np.nan_to_num(run(m, duty) - angle, nan=1e9).std() for m in fits]
    best = fits[int(np.argmin(errors))]
    # [/sippy]
    return lambda other, _first: run(best, other)


PEERS: dict[str, Callable[..., Run]] = {
    "SciPy and Numba": by_scipy,
    "lmfit and Numba": by_lmfit,
    "jax-sysid": by_jax_sysid,
    "SIPPY": by_sippy,
}
MARKS: dict[str, tuple[str, ...]] = {
    "SciPy and Numba": ("model", "scipy"),
    "lmfit and Numba": ("model", "lmfit"),
    "jax-sysid": ("jax-sysid",),
    "SIPPY": ("sippy",),
}


def lines_of(source: str, marks: tuple[str, ...]) -> int:
    """Count the lines of code between marks, without blank ones."""
    blocks = [source.partition(f"# [{mark}]\n")[2].partition(f"# [/{mark}]")[0] for mark in marks]
    return sum(bool(line.strip()) for block in blocks for line in block.splitlines())
