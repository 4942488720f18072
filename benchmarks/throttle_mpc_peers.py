"""One question: what does a step of nonlinear predictive control of a throttle cost, beside the tools people use.

    python -m venv peers && peers/bin/pip install casadi do-mpc tinympc && cmake --build --preset bench
    PYTHONPATH=build/dev/python peers/bin/python benchmarks/throttle_mpc_peers.py [--steps 6000] [--json FILE]

The smooth throttle over 6000 samples of 1 ms, plant at 0.25 ms: squares of 0.3 and 1.0 rad, a sine of 5 Hz, small
squares across limp-home; the reference held over 20 samples. Cost 1e3 e^2, terminal 5e3 e^2, 1e-2 u^2, |u| <= 1. A time
without the closed-loop error beside it says nothing. The linear problem is the same plate without friction and preload.

Before anything is timed, the plant must be that of the C++ program, and ours with ten iterations per sample must follow
as IPOPT does. Ours is timed in C++ (wall time, smallest of 7 runs for each sample), the peers around their whole call
from Python by the processor time of the thread (smallest of `--repeats`), which leaves out what else the machine does.
Generated C is called through shared buffers, so that Python adds a microsecond, not the cost of conversions. The wheel
of TinyMPC prints a line per solve; it goes to the null device, and its first row, of one iteration, holds what both
cost.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from peers import peer_mpc
from support import machine

BENCH_PROGRAM = Path(__file__).parents[1] / "build" / "bench" / "bench" / "bench_receding_horizon"
UNMEASURED = 500
QRQP = {"print_iter": False, "print_header": False, "print_info": False}
SQP = {"qpsol": "qrqp", "qpsol_options": QRQP, "print_header": False, "print_iteration": False, "print_time": False}
SQP |= {"print_status": False, "error_on_fail": False}
IPOPT = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}


def reference_of(k: int) -> float:
    if k < 3000:
        return 0.3 if (k // 300) % 2 == 0 else 1.0
    if k < 4500:
        return peer_mpc.LIMP_HOME + 0.5 * math.sin(2 * math.pi * 5 * (1e-3 * k - 3.0))
    return peer_mpc.LIMP_HOME + (-0.05 if (k // 150) % 2 == 0 else 0.05)


def drive(controller, plant, steps, home=peer_mpc.LIMP_HOME, watch=None):
    """Microseconds of every measured step, and the closed-loop error [rad]."""
    x, squares, times = np.array([home, 0.0, 0.0]), 0.0, []
    for k in range(steps):
        r = reference_of(k) - peer_mpc.LIMP_HOME + home
        begin = time.thread_time_ns()
        u = controller(x, r)
        times.append((time.thread_time_ns() - begin) / 1e3)
        if watch:
            watch(k, x, r, controller)
        x = plant(x, u)
        squares += (x[0] - r) ** 2
    return np.array(times[min(UNMEASURED, steps // 10) :]), math.sqrt(squares / steps)


def measure(make, plant, steps, repeats, **more):
    best, rms = None, 0.0
    for _ in range(repeats):
        times, rms = drive(make(), plant, steps, **more)
        best = times if best is None else np.minimum(best, times)
    p50, p99, p999 = np.quantile(best, [0.5, 0.99, 0.999])
    return {"rms_rad": rms, "p50": p50, "p99": p99, "p999": p999, "max": float(best.max()), "steps": steps}


@contextlib.contextmanager
def silent():
    """Nothing on standard output: the wheel of TinyMPC prints a line per solve, whatever `verbose` says."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def exact_plan(ca, a, b, x, r, terminal):
    """Return inputs and cost of the convex problem by CasADi's active set; terminal: a matrix on the last error."""
    n = peer_mpc.N
    powers = [np.linalg.matrix_power(a, k) for k in range(n + 1)]
    wanted = np.array([r, 0.0, 0.0])
    hessian, slope, constant = 2 * peer_mpc.R * np.eye(n), np.zeros(n), 0.0
    for k in range(1, n + 1):
        weight = terminal if k == n else np.diag([peer_mpc.Q, 0, 0])
        gain = np.column_stack([powers[k - 1 - i] @ b[:, 0] if i < k else np.zeros(3) for i in range(n)])
        rest = powers[k] @ x - wanted
        hessian += 2 * gain.T @ weight @ gain
        slope += 2 * gain.T @ weight @ rest
        constant += rest @ weight @ rest
    qp = ca.conic("qp", "qrqp", {"h": ca.Sparsity.dense(n, n)}, QRQP)
    u = np.array(qp(h=hessian, g=slope, lbx=-1.0, ubx=1.0)["x"]).ravel()
    return u, lambda v: 0.5 * v @ hessian @ v + slope @ v + constant


def tiny_quality(ca, a, b, every=97):
    """Watcher of a loop: how much dearer its plans are than the best, on the cost that it says it minimises."""
    found = []

    def watch(k, x, r, controller):
        if k % every or k < UNMEASURED:
            return
        plan = np.array(controller.core.solution.u).ravel()[: peer_mpc.N]
        terminal = np.array(controller.solver_terminal)
        best, cost = exact_plan(ca, a, b, x, r, terminal)
        found.append((cost(np.clip(plan, -1, 1)) - cost(best)) / max(cost(best), 1e-9))

    return found, watch


def lqr_terminal(a, b, rho):
    """Matrix that TinyMPC puts on the last error: of the Riccati equation with rho added to both weights, halved."""
    q, r = np.diag([2 * peer_mpc.Q, 2e-9, 2e-9]) + rho * np.eye(3), 2 * peer_mpc.R + rho
    p = q.copy()
    for _ in range(20_000):
        gain = (b.T @ p @ a) / (r + (b.T @ p @ b))
        p = q + a.T @ p @ (a - b @ gain)
    return 0.5 * p


def run_ours(program: Path):
    rows, extra = [], {}
    for line in subprocess.run([program, "--json"], check=True, capture_output=True, text=True).stdout.splitlines():
        record = json.loads(line)
        if "model" in record:
            rows.append(record)
        else:
            extra |= record
    return rows, extra


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=6000, help="samples of the loop (default 6000)")
    parser.add_argument("--repeats", type=int, default=2, help="runs of every peer (default 2)")
    parser.add_argument("--bench-program", type=Path, default=BENCH_PROGRAM, help="bench_receding_horizon, built")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    parser.add_argument("--linear-only", action="store_true", help="TinyMPC alone")
    options = parser.parse_args()
    if not options.bench_program.exists():
        parser.error(f"{options.bench_program} is not built: cmake --preset bench && cmake --build --preset bench")
    return options


def main() -> None:
    options = arguments()
    try:
        import casadi as ca
    except ImportError:
        print("CasADi is the plant here, too: pip install casadi do-mpc tinympc, in an environment of their own")
        return
    context = machine.versions()
    for package in ("casadi", "do-mpc", "tinympc"):
        try:
            context[package] = version(package)
        except PackageNotFoundError:
            context[package] = "missing: left out"
    machine.pin()
    ours, extra = run_ours(options.bench_program)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        step = peer_mpc.compiled(ca, peer_mpc.rk4(ca, 0.25e-3, 4), folder)

        def plant(x, u):
            return np.array(step(x, u)).ravel()

        x = np.array([peer_mpc.LIMP_HOME, 0.0, 0.0])
        for k in range(400):
            x = plant(x, 0.6 * math.sin(0.05 * k))
        if not np.allclose(x, extra["trace"], rtol=1e-9, atol=1e-12):
            sys.exit(f"the plants differ: {x} and {extra['trace']}; nothing timed")

        def solver(form, plugin, settings, *, generated=False):
            return lambda: peer_mpc.casadi_solver(ca, form, plugin, dict(settings), folder if generated else None)

        real_time = SQP | {"max_iter": 1}
        gauss = real_time | {"gauss_newton": True}
        peers = {
            "CasADi IPOPT, multiple shooting": (solver("multiple", "ipopt", IPOPT), 1),
            "CasADi IPOPT, warm start": (
                solver("multiple", "ipopt", IPOPT | {"ipopt.warm_start_init_point": "yes", "ipopt.mu_init": 1e-4}), 1
            ),
            "sqpmethod, C, multiple shooting": (solver("multiple", "sqpmethod", SQP, generated=True), options.repeats),
            "sqpmethod, C, multiple, one iteration": (
                solver("multiple", "sqpmethod", real_time, generated=True), options.repeats
            ),
            "sqpmethod, C, single shooting": (solver("single", "sqpmethod", SQP, generated=True), options.repeats),
            "sqpmethod, C, single, one Gauss-Newton iteration": (
                solver("single", "sqpmethod", gauss, generated=True), options.repeats
            ),
        }  # fmt: skip
        if not context["do-mpc"].startswith("missing"):
            peers["do-mpc"] = (lambda: peer_mpc.do_mpc_controller(ca), 1)
        rows = {}
        for title, (make, repeats) in () if options.linear_only else peers.items():
            try:
                rows[title] = measure(make, plant, options.steps, repeats)
            except RuntimeError as problem:
                rows[title] = {"failed": str(problem).splitlines()[0]}
            print(title, rows[title], file=sys.stderr, flush=True)
        linear = {}
        ab = np.array(extra["linear"]).reshape(3, 4)
        a, b = ab[:, :3].copy(), ab[:, 3:].copy()
        if not context["tinympc"].startswith("missing"):
            for title, rho, most, check in (
                ("TinyMPC, rho 1, as it comes", 1.0, 1000, 1),
                ("TinyMPC, rho 1, check every 5", 1.0, 1000, 5),
                ("TinyMPC, rho 0.1, check every 5", 0.1, 1000, 5),
                ("TinyMPC, rho 0.01, check every 5", 0.01, 1000, 5),
                ("TinyMPC, rho 10, check every 5", 10.0, 1000, 5),
                ("TinyMPC, rho 0.1, 10 iterations", 0.1, 10, 5),
            ):

                def make(rho=rho, most=most, check=check):
                    made = peer_mpc.TinyMpc(a, b, rho=rho, max_iter=most, check=check)
                    made.solver_terminal = lqr_terminal(a, b, rho)
                    return made

                found, watch = tiny_quality(ca, a, b)
                with silent():
                    row = measure(
                        make, lambda x, u: a @ x + b[:, 0] * u, options.steps, options.repeats, home=0.0, watch=watch
                    )
                found = found or [math.nan]
                linear[title] = row | {"dearer_median": float(np.median(found)), "dearer_most": float(np.max(found))}
                print(title, linear[title], file=sys.stderr, flush=True)
    best = next(
        r for r in ours if r["model"] == "smooth" and r["n"] == 20 and r["scalar"] == "double" and not r["change"]
    )
    ten = next(r for r in ours if r["iterations"] == 10 and not r["change"])
    ipopt = rows.get("CasADi IPOPT, multiple shooting", ten)
    if options.steps == 6000 and not abs(ten["rms_rad"] - ipopt["rms_rad"]) < 0.005 * ipopt["rms_rad"]:
        sys.exit(f"ours to convergence follows with {ten['rms_rad']}, IPOPT with {ipopt['rms_rad']}: nothing reported")
    for key, value in context.items():
        print(f"{key:26s} {value}")
    show("mgdd RecedingHorizon, N 20", best, best, rows)
    ours_linear = next(r for r in ours if r["model"] == "linear" and r["scalar"] == "double")
    print()
    show("mgdd RecedingHorizon, linear model, N 20", ours_linear, ours_linear, linear)
    if options.json:
        report = {"context": context, "ours": ours, "extra": extra, "peers": rows, "linear": linear}
        options.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


def show(title, own, unit, rows) -> None:
    print(f"{'':50s} {'rms rad':>8s} {'p50 us':>9s} {'p99':>9s} {'p99.9':>9s} {'max':>9s} {'ratio':>7s}")
    for name, row in {title: own, **rows}.items():
        if "failed" in row:
            print(f"{name:50s} failed: {row['failed']}")
            continue
        print(f"{name:50s} {row['rms_rad']:8.4f} {row['p50']:9.2f} {row['p99']:9.2f}", end=" ")
        print(f"{row['p999']:9.2f} {row['max']:9.1f} {row['p50'] / unit['p50']:7.1f}", end="")
        dearer = row.get("dearer_median")
        print("" if dearer is None else f"   plan dearer by {dearer:.1e} median, {row['dearer_most']:.1e} at most")


if __name__ == "__main__":
    main()
