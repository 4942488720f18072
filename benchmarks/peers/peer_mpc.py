"""Predictive control of the smooth throttle as others would write it, for `throttle_mpc_peers.py`.

Every maker returns a call that maps a state and a held reference [rad] to a duty. Same one-step model (one Runge-Kutta
step of 1 ms), same weights, same bounds, warm start by what the tool offers.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Controller = Callable[[Array, float], float]
Q, R, TERMINAL, N, STEP_S = 1e3, 1e-2, 5e3, 20, 1e-3
LIMP_HOME = 0.14


def derivative(x: Any, u: Any, ca: Any) -> Any:
    """Angle [rad], speed [rad/s] and current [A] of the plate under a duty; `ca` is CasADi."""
    deflection = x[0] - LIMP_HOME
    load = 4e-3 * x[1] + 0.12 * ca.tanh(x[1] / 0.5) + 0.12 * deflection + 0.25 * ca.tanh(deflection / 0.02)
    return ca.vertcat(x[1], (20 * 0.016 * x[2] - load) / 2e-3, (12 * u - 1.2 * x[2] - 20 * 0.016 * x[1]) / 1e-3)


def rk4(ca: Any, h: float, substeps: int = 1) -> Any:
    """CasADi Function of one sample: (state, duty) to the next state."""
    x0, u = ca.SX.sym("x", 3), ca.SX.sym("u")
    x = x0
    for _ in range(substeps):
        k1 = derivative(x, u, ca)
        k2 = derivative(x + h / 2 * k1, u, ca)
        k3 = derivative(x + h / 2 * k2, u, ca)
        k4 = derivative(x + h * k3, u, ca)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("step", [x0, u], [x])


def compiled(ca: Any, function: Any, folder: Path) -> Any:
    """Return the same function as generated C, by gcc -O3 for this processor."""
    name = function.name()
    library = folder / f"{name}.so"
    if library.exists():
        return ca.external(name, str(library))
    generator = ca.CodeGenerator(f"{name}.c")
    generator.add(function)
    generator.generate(f"{folder}/")
    subprocess.run(
        ["gcc", "-O3", "-march=native", "-shared", "-fPIC", str(folder / f"{name}.c"), "-o", str(library), "-lm"],
        check=True,
    )
    return ca.external(name, str(library))


def _problem(ca: Any, form: str) -> tuple[dict[str, Any], int]:
    """Single shooting (inputs alone are free) or multiple shooting (states too); parameters are state and reference."""
    step = rk4(ca, STEP_S)
    p, u = ca.SX.sym("p", 4), ca.SX.sym("U", N)
    states = ca.SX.sym("X", 3, N)
    x, cost, defects = p[:3], 0, []
    for k in range(N):
        x = step(x, u[k])
        if form == "multiple":
            defects.append(states[:, k] - x)
            x = states[:, k]
        cost += (TERMINAL if k == N - 1 else Q) * (x[0] - p[3]) ** 2 + R * u[k] ** 2
    if form == "single":
        return {"x": u, "p": p, "f": cost}, 0
    return {"x": ca.vertcat(u, ca.vec(states)), "p": p, "f": cost, "g": ca.vertcat(*defects)}, 3 * N


def gauss_newton(ca: Any, nlp: dict[str, Any]) -> Any:
    """Hessian without the second derivatives of the model; in single shooting those of the outputs."""
    step = rk4(ca, STEP_S)
    x, rows = nlp["p"][:3], []
    for k in range(N):
        x = step(x, nlp["x"][k])
        rows.append(np.sqrt(TERMINAL if k == N - 1 else Q) * (x[0] - nlp["p"][3]))
    jacobian = ca.jacobian(ca.vertcat(*rows), nlp["x"])
    factor = ca.SX.sym("lam_f")
    hessian = factor * 2 * (jacobian.T @ jacobian + R * ca.SX.eye(N))
    return ca.Function(
        "nlp_hess_l",
        [nlp["x"], nlp["p"], factor, ca.SX.sym("lam_g", 0)],
        [hessian],
        ["x", "p", "lam_f", "lam_g"],
        ["hess_gamma_x_x"],
    )


def casadi_solver(ca: Any, form: str, plugin: str, options: dict[str, Any], folder: Path | None) -> Controller:
    """Any NLP solver of CasADi, interpreted or (with a folder) as generated C, called through buffers of memory."""
    nlp, n_g = _problem(ca, form)
    name = "solver_" + str(abs(hash((form, plugin, str(options)))))
    if options.pop("gauss_newton", False):
        options["hess_lag"] = gauss_newton(ca, nlp)
    solver = ca.nlpsol(name, plugin, nlp, options)
    function = compiled(ca, solver, folder) if folder else solver
    n_x = nlp["x"].shape[0]
    bound = np.concatenate([np.ones(N), np.full(n_x - N, np.inf)])
    slots = dict(zip(solver.name_in(), range(solver.n_in()), strict=True))
    values = {
        "x0": np.zeros(n_x), "p": np.zeros(4), "lbx": -bound, "ubx": bound,
        "lbg": np.zeros(n_g), "ubg": np.zeros(n_g), "lam_x0": np.zeros(n_x), "lam_g0": np.zeros(n_g),
    }  # fmt: skip
    results = {name: np.zeros(max(1, solver.numel_out(name))) for name in ("x", "lam_x", "lam_g")}
    buffer, evaluate = function.buffer()
    for key, array in values.items():
        if array.size:
            buffer.set_arg(slots[key], memoryview(array))
    for i, key in enumerate(solver.name_out()):
        if key in results and solver.numel_out(key):
            buffer.set_res(i, memoryview(results[key]))
    first, kept = [True], (buffer, function, solver)  # the evaluation works on their memory

    def shift(solution: Array, into: Array, width: int) -> None:
        into[:-width], into[-width:] = solution[width:], solution[-width:]

    def control(x: Array, reference: float) -> float:
        values["p"][:3], values["p"][3] = x, reference
        if first[0] and kept:
            values["x0"][N:] = np.tile(x, N)[: n_x - N]
            first[0] = False
        evaluate()
        shift(results["x"][:N], values["x0"][:N], 1)
        shift(results["lam_x"][:N], values["lam_x0"][:N], 1)
        if n_g:
            shift(results["x"][N:], values["x0"][N:], 3)
            shift(results["lam_g"], values["lam_g0"], 3)
        return float(min(1.0, max(-1.0, results["x"][0])))

    return control


def do_mpc_controller(ca: Any) -> Controller:
    """do-mpc with a discrete model and IPOPT, output silenced, exact options otherwise its defaults."""
    import do_mpc

    model = do_mpc.model.Model("discrete", "SX")
    x, u, r = (
        model.set_variable("_x", "x", shape=(3, 1)),
        model.set_variable("_u", "u"),
        model.set_variable("_tvp", "r"),
    )
    model.set_rhs("x", rk4(ca, STEP_S)(x, u))
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.store_full_solution = N, STEP_S, False
    mpc.settings.supress_ipopt_output()
    error = x[0] - r
    # Its stage cost counts the present error too, which no input changes; the terminal one has no input.
    mpc.set_objective(mterm=TERMINAL * error**2, lterm=Q * error**2 + R * u**2)
    mpc.set_rterm(u=0.0)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -1.0, 1.0
    template, wanted = mpc.get_tvp_template(), [0.0]

    def references(_: float) -> Any:
        template["_tvp", :, "r"] = wanted[0]
        return template

    mpc.set_tvp_fun(references)
    mpc.setup()
    started = [False]

    def control(state: Array, reference: float) -> float:
        wanted[0] = reference
        if not started[0]:
            mpc.x0 = state.reshape(-1, 1)
            mpc.set_initial_guess()
            started[0] = True
        return float(mpc.make_step(state.reshape(-1, 1))[0, 0])

    return control


class TinyMpc:
    """TinyMPC on x+ = A x + B u with its bound of the input.

    Its residuals are zero at rest before a new reference has entered, so that a check of every iteration (`check` 1)
    ends at the input 0 for ever.
    """

    def __init__(self, a: Array, b: Array, *, rho: float, max_iter: int, check: int) -> None:
        import tinympc

        self.solver = tinympc.TinyMPC()
        # N knots are N - 1 inputs; its cost is half of each square.
        self.solver.setup(
            a, b, 2 * np.diag([Q, 1e-9, 1e-9]), np.array([[2 * R]]), N + 1, rho=rho, verbose=False,
            u_min=np.array([-1.0]), u_max=np.array([1.0]),
            max_iter=max_iter, abs_pri_tol=1e-3, abs_dua_tol=1e-3, check_termination=check,
        )  # fmt: skip
        self.solver.update_settings(en_state_bound=False, en_input_bound=True)
        self.core = self.solver._solver
        self.reference = np.zeros((3, N + 1), order="F")

    def __call__(self, x: Array, reference: float) -> float:
        """Return the first input; set state and reference, solve, read."""
        self.reference[0] = reference
        self.core.set_x0(x)
        self.core.set_x_ref(self.reference)
        self.core.solve()
        return float(self.core.solution.u[0, 0])
