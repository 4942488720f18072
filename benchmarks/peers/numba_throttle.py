"""The smooth throttle for Numba: free run, and free run with exact sensitivities; RK4, one step per sample."""

from __future__ import annotations

import math

import numba
import numpy as np

INERTIA, GEAR, INDUCTANCE, SUPPLY = 2e-3, 20.0, 1e-3, 12.0
DEG = 180.0 / math.pi


@numba.njit(fastmath=True, inline="always")
def rhs(p, th, w, i, u):
    d = th - p[7]
    torque = GEAR * p[0] * i - p[1] * w - p[2] * math.tanh(w / p[3]) - p[4] * d - p[5] * math.tanh(d / p[6])
    return w, torque / INERTIA, (SUPPLY * u - p[9] * i - GEAR * p[8] * w) / INDUCTANCE


@numba.njit(fastmath=True, cache=False)
def simulate(p, duty, h, start):
    angle = np.empty(duty.size)
    th, w, i = start
    for k in range(duty.size):
        angle[k] = DEG * th
        u = duty[k]
        a1, b1, c1 = rhs(p, th, w, i, u)
        a2, b2, c2 = rhs(p, th + 0.5 * h * a1, w + 0.5 * h * b1, i + 0.5 * h * c1, u)
        a3, b3, c3 = rhs(p, th + 0.5 * h * a2, w + 0.5 * h * b2, i + 0.5 * h * c2, u)
        a4, b4, c4 = rhs(p, th + h * a3, w + h * b3, i + h * c3, u)
        th += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        w += h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)
        i += h / 6.0 * (c1 + 2.0 * (c2 + c3) + c4)
    return angle


@numba.njit(fastmath=True, inline="always")
def slopes(p, th, w, i, u, s, k, n):
    """Right-hand side and its sensitivity columns k[n] = A s + B."""
    d = th - p[7]
    tf = math.tanh(w / p[3])
    tp = math.tanh(d / p[6])
    fs = p[2] / p[3] * (1.0 - tf * tf)
    ps = p[5] / p[6] * (1.0 - tp * tp)
    torque = GEAR * p[0] * i - p[1] * w - p[2] * tf - p[4] * d - p[5] * tp
    a10 = -(p[4] + ps) / INERTIA
    a11 = -(p[1] + fs) / INERTIA
    a12 = GEAR * p[0] / INERTIA
    a21 = -GEAR * p[8] / INDUCTANCE
    a22 = -p[9] / INDUCTANCE
    for j in range(10):
        k[n, 0, j] = s[1, j]
        k[n, 1, j] = a10 * s[0, j] + a11 * s[1, j] + a12 * s[2, j]
        k[n, 2, j] = a21 * s[1, j] + a22 * s[2, j]
    k[n, 1, 0] += GEAR * i / INERTIA
    k[n, 1, 1] -= w / INERTIA
    k[n, 1, 2] -= tf / INERTIA
    k[n, 1, 3] += fs * w / p[3] / INERTIA
    k[n, 1, 4] -= d / INERTIA
    k[n, 1, 5] -= tp / INERTIA
    k[n, 1, 6] += ps * d / p[6] / INERTIA
    k[n, 1, 7] -= a10
    k[n, 2, 8] -= GEAR * w / INDUCTANCE
    k[n, 2, 9] -= i / INDUCTANCE
    return w, torque / INERTIA, (SUPPLY * u - p[9] * i - GEAR * p[8] * w) / INDUCTANCE


@numba.njit(fastmath=True, cache=False)
def simulate_with_sensitivities(p, duty, h, start):
    angle = np.empty(duty.size)
    jacobian = np.empty((duty.size, 10))
    th, w, i = start
    s = np.zeros((3, 10))
    q = np.zeros((3, 10))
    k = np.zeros((4, 3, 10))
    for n in range(duty.size):
        angle[n] = DEG * th
        for j in range(10):
            jacobian[n, j] = DEG * s[0, j]
        u = duty[n]
        a1, b1, c1 = slopes(p, th, w, i, u, s, k, 0)
        for r in range(3):
            for j in range(10):
                q[r, j] = s[r, j] + 0.5 * h * k[0, r, j]
        a2, b2, c2 = slopes(p, th + 0.5 * h * a1, w + 0.5 * h * b1, i + 0.5 * h * c1, u, q, k, 1)
        for r in range(3):
            for j in range(10):
                q[r, j] = s[r, j] + 0.5 * h * k[1, r, j]
        a3, b3, c3 = slopes(p, th + 0.5 * h * a2, w + 0.5 * h * b2, i + 0.5 * h * c2, u, q, k, 2)
        for r in range(3):
            for j in range(10):
                q[r, j] = s[r, j] + h * k[2, r, j]
        a4, b4, c4 = slopes(p, th + h * a3, w + h * b3, i + h * c3, u, q, k, 3)
        for r in range(3):
            for j in range(10):
                s[r, j] += h / 6.0 * (k[0, r, j] + 2.0 * (k[1, r, j] + k[2, r, j]) + k[3, r, j])
        th += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        w += h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)
        i += h / 6.0 * (c1 + 2.0 * (c2 + c3) + c4)
    return angle, jacobian


def plain_lm(evaluate, start, lower, upper, tolerance, max_iterations=200):
    """Twenty lines of Levenberg-Marquardt (Marquardt scaling, log parameters, clipped): cost, point, evaluations."""
    z = np.log(start)
    low, high = np.log(lower), np.log(upper)
    residual, jacobian = evaluate(np.exp(z))
    cost = residual @ residual
    damping, evaluations = 1e-2, 1
    scaled = jacobian * np.exp(z)
    for _ in range(max_iterations):
        a, g = scaled.T @ scaled, scaled.T @ residual
        step = np.linalg.solve(a + damping * np.diag(np.maximum(np.diag(a), 1e-9)), -g)
        trial = np.clip(z + step, low, high)
        new_residual, new_jacobian = evaluate(np.exp(trial))
        evaluations += 1
        new_cost = new_residual @ new_residual
        if new_cost < cost:
            done = (cost - new_cost) < tolerance * cost
            z, cost, residual = trial, new_cost, new_residual
            scaled = new_jacobian * np.exp(z)
            damping = max(damping / 9.0, 1e-12)
            if done:
                break
        else:
            damping *= 11.0
            if damping > 1e12:
                break
    return cost, np.exp(z), evaluations
