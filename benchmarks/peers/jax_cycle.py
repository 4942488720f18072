"""Many cycles in JAX with the algebra cut: `vmap` over `lax.scan`, float64, for `sweep_speed.py`.

Tables of the angle, two square roots, one power; up to the earliest SOC of all cases the power and the heat release are
left out, and where all cases are timings of one operating point that part is run for a single cycle.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from peers.cycle_cases import EARLIEST_CAD, Array, Engine, charge_of, cut_tables

jax.config.update("jax_enable_x64", True)


def compile_sweep(e: Engine, *, shared: bool, batch: int, unroll: int = 1) -> Callable[[Array], Array]:
    """Return a function from cases to figures that works batch by batch; its first call compiles.

    `shared` promises cases of one operating point. A batch that does not divide the number of cases is filled up with
    repetitions of the last case.
    """
    figures = jax.jit(partial(_figures, e, shared=shared, unroll=unroll))

    def run(cases: Array) -> Array:
        if cases[:, 4].min() < EARLIEST_CAD:
            raise ValueError(f"soc_cad = {cases[:, 4].min()}: must be >= {EARLIEST_CAD}, where the burn may start")
        blocks = [cases[i : i + batch] for i in range(0, len(cases), batch)]
        missing = batch - len(blocks[-1])
        blocks[-1] = np.concatenate([blocks[-1], np.repeat(cases[-1:], missing, axis=0)])
        rows = [figures(block) for block in blocks]
        return np.concatenate([np.asarray(row) for row in rows])[: len(cases)]

    return run


def _figures(e: Engine, cases: jax.Array, *, shared: bool, unroll: int) -> jax.Array:
    tables, n = cut_tables(e), e.angle.size
    burning = int(np.searchsorted(e.angle, EARLIEST_CAD)) - 1
    rows = np.column_stack([*tables, e.volume[:-1], np.diff(e.volume), e.angle[:-1]])

    def one(case: jax.Array, state: tuple | None) -> tuple:
        p_ref, gas, heat, duration = charge_of(e, case[0], case[1], case[2], case[3])
        still, per_pa, soc = e.c2 * e.stroke * case[0] / 30, e.cp * e.swept / gas, case[4]
        scale = e.wall_scale * 1e5**-0.8 * e.bore**-0.2 * gas**0.55 / (6 * case[0])
        still_power = jnp.exp(0.8 * jnp.log(still))

        def step(state: tuple, row: jax.Array, *, compression: bool) -> tuple:
            before, p, closed, lost, burned, highest, slope, steep = state
            keep, gain, wall, motored, volume, widening, angle = row
            power = still_power
            if not compression:
                rise = jnp.where(angle >= soc, jnp.maximum(p - p_ref * motored, 0.0), 0.0)
                power = jnp.exp(0.8 * jnp.log(still + per_pa * rise))
            loss = scale * wall * (p * volume / gas - e.wall_k) * jnp.sqrt(jnp.sqrt(p)) * power
            after = burned
            if not compression:
                s = jnp.clip((angle + 1.0 - soc) / duration, 0.0, 1.0)
                after = jnp.where(s <= 0.5, 2 * s * s, 1 - 2 * (1 - s) * (1 - s))
            following = keep * p + gain * (heat * (after - burned) - loss)
            higher = p > highest[1]
            highest = tuple(
                jnp.where(higher, new, old) for new, old in zip((before, p, following, angle), highest, strict=True)
            )
            steeper = following - p > slope
            slope, steep = jnp.where(steeper, following - p, slope), jnp.where(steeper, angle, steep)
            closed = closed + (p + following) * widening
            return (p, following, closed, lost + loss, after, highest, slope, steep), None

        if state is None:
            zero = 0.0 * p_ref
            state = (p_ref, p_ref, zero, zero, zero, (p_ref, zero, p_ref, zero), zero - jnp.inf, zero)
            return lax.scan(partial(step, compression=True), state, rows[:burning], unroll=unroll)[0]
        state, _ = lax.scan(partial(step, compression=False), state, rows[burning:], unroll=unroll)
        _, end, closed, lost, _, (a, b, c, top), slope, steep = state
        closed, bottom = 0.5 * closed, e.clearance + e.swept
        gross = closed + p_ref * (e.volume[0] - bottom) + 0.5 * (end + p_ref) * (bottom - e.volume[n - 1])
        bend = a - 2 * b + c
        works = (closed / e.swept / 1e5, gross / e.swept / 1e5, gross / heat)
        peak = ((b - (a - c) ** 2 / (8 * bend)) / 1e5, top + (a - c) / (2 * bend))
        return jnp.stack([*works, *peak, slope / 1e5, steep + 0.5, lost])

    if shared:
        state = one(cases[0], None)
        return jax.vmap(one, in_axes=(0, None))(cases, state)
    states = jax.vmap(lambda case: one(case, None))(cases)
    return jax.vmap(one)(cases, states)
