"""One question: how long does the ten-parameter throttle fit take, and from how many starts does it arrive.

    python benchmarks/throttle_identification.py [--repeats 5] [--starts 20] [--peer-starts 20] [--json FILE]

Smooth throttle, 20 000 samples at 1 ms, RK4 one step per sample: random levels held 80 samples in the first half, a
linear chirp 0.2 to 6 Hz in the second, pulled slowly towards the middle angle; starts at rest at a known angle; angle
noise 0.05 deg. Free: Km, Ke, R, Kv, Tc, ks, Tpd, thLH and both smoothing widths; known: J, N, L, supply. Starts within
+-50 % of every
parameter, the same for all; bounds 0.1 and 10 times the truth; stop at a relative cost of 1e-9. Reached: rmse within
0.5 % of that at the truth. All contenders must agree on the simulation to 1e-7 deg before any is timed. One core;
processor seconds, so that a neighbour on a shared machine does not count.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from peers import numba_throttle
from scipy.optimize import least_squares
from support import machine

from mgdd import _core
from mgdd.identify.throttle.smooth import SmoothThrottle
from mgdd.optimize import FitOptions

STEP_S, N, NOISE_DEG, TOLERANCE = 1e-3, 20_000, 0.05, 1e-9
PEER_STEPS = 200  # steps after which SciPy is stopped; its finite differences are not counted
TRUTH = np.array(_core.identify.smooth_example)
RECORDS = {  # duty offset, duty amplitude, middle angle [deg], start [rad]
    "across limp-home": (0.0, 0.35, 15.0, 0.14),
    "above limp-home only": (0.15, 0.2, 45.0, 0.7),
}


def simulate(duty: np.ndarray, start: tuple[float, float, float], parameters: np.ndarray = TRUTH) -> np.ndarray:
    """Angle [deg] of the free run."""
    model = SmoothThrottle(parameters=dict(zip(_core.identify.smooth_names, parameters, strict=True)))
    inputs = {"time_s": STEP_S * np.arange(duty.size), "duty": duty}
    return model.simulate(inputs, initial_state=start)["angle_deg"].to_numpy()


def make_record(offset: float, amplitude: float, middle_deg: float, start_rad: float) -> tuple:
    """Duty, noisy angle [deg], start state and the root mean square of the noise drawn."""
    rng = np.random.default_rng(20)
    levels = rng.uniform(-1.0, 1.0, N // 2 // 80 + 1)
    t = STEP_S * np.arange(N // 2)
    wave = np.concatenate([np.repeat(levels, 80)[: N // 2], np.sin(2 * np.pi * (0.2 * t + 0.5 * 5.8 / t[-1] * t**2))])
    duty = offset + amplitude * wave
    start = (start_rad, 0.0, 0.0)
    for k in range(0, N, 80):  # the pull needs the angle of the run so far
        angle = simulate(duty[: k + 2], start)[k]
        duty[k : k + 80] -= 0.002 * (angle - middle_deg)
    noise = rng.normal(0.0, NOISE_DEG, N)
    return duty, simulate(duty, start) + noise, start, float(np.sqrt(np.mean(noise**2)))


def record(duty: np.ndarray, angle: np.ndarray) -> dict[str, np.ndarray]:
    return {"time_s": STEP_S * np.arange(duty.size), "duty": duty, "angle_deg": angle}


def contenders(duty, angle, start, lower, upper):
    """Name to a call that maps one start to (rmse, evaluations)."""

    def residual(z):
        with np.errstate(all="ignore"):
            r = numba_throttle.simulate(np.exp(z), duty, STEP_S, start) - angle
        return np.nan_to_num(r, nan=1e6, posinf=1e6, neginf=-1e6).clip(-1e6, 1e6)

    def exact(p):
        with np.errstate(all="ignore"):
            y, j = numba_throttle.simulate_with_sensitivities(p, duty, STEP_S, start)
        return (y - angle if np.isfinite(y).all() else np.full(N, 1e6)), j

    def scipy_two_point(p):
        fit = least_squares(
            residual,
            np.log(p),
            bounds=(np.log(lower), np.log(upper)),
            method="trf",
            ftol=TOLERANCE,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=PEER_STEPS,
        )
        return np.sqrt(2 * fit.cost / N), fit.nfev

    def plain(p):
        cost, _, evaluations = numba_throttle.plain_lm(exact, p, lower, upper, TOLERANCE)
        return np.sqrt(cost / N), evaluations

    def ours(p):
        fit = SmoothThrottle().fit(
            record(duty, angle), start_values=p, bounds=(lower, upper), initial_state=start,
            options=FitOptions(tolerance=TOLERANCE),
        )  # fmt: skip
        return fit.report.rmse, fit.report.nfev

    return {"mgdd": ours, "plain LM, Numba sensitivities": plain, "SciPy trf 2-point, Numba": scipy_two_point}


def measure(name: str, options: argparse.Namespace) -> dict:
    duty, angle, start, floor = make_record(*RECORDS[name])
    lower, upper = 0.1 * TRUTH, 10.0 * TRUTH
    starts = TRUTH * np.random.default_rng(5).uniform(0.5, 1.5, (options.starts, 10))
    for p in starts[:3]:
        ours = simulate(duty[:2000], start, p)
        peer, jacobian = numba_throttle.simulate_with_sensitivities(p, duty[:2000], STEP_S, start)
        plain = numba_throttle.simulate(p, duty[:2000], STEP_S, start)
        h = 1e-6 * p
        numeric = (
            numba_throttle.simulate(p + h * (np.arange(10) == 0), duty[:2000], STEP_S, start)
            - numba_throttle.simulate(p - h * (np.arange(10) == 0), duty[:2000], STEP_S, start)
        ) / (2 * h[0])
        if max(np.abs(ours - peer).max(), np.abs(ours - plain).max()) > 1e-7:
            sys.exit("the simulations differ: nothing timed")
        if np.abs(numeric - jacobian[:, 0]).max() > 1e-3 * np.abs(numeric).max():
            sys.exit("the sensitivities differ: nothing timed")
    rows = {}
    for contender, call in contenders(duty, angle, start, lower, upper).items():
        call(starts[0])
        repeats = options.repeats if contender == "mgdd" else 1
        seconds, rmse = [], []
        mine = starts if contender == "mgdd" else starts[: options.peer_starts]
        for p in mine:
            best = []
            for _ in range(repeats):
                begin = time.process_time()
                reached, _ = call(p)
                best.append(time.process_time() - begin)
            seconds.append(statistics.median(best))
            rmse.append(reached)
        rows[contender] = {
            "median_s": statistics.median(seconds),
            "worst_s": max(seconds),
            "reached": int(np.sum(np.array(rmse) <= 1.005 * floor)),
            "starts": len(mine),
        }
        print(name, contender, rows[contender], flush=True)
    times = []
    for _ in range(options.repeats):
        begin = time.process_time()
        fit = SmoothThrottle().fit(record(duty, angle), start_values=starts, bounds=(lower, upper), initial_state=start)
        times.append(time.process_time() - begin)
    rows["mgdd, all starts in lanes"] = {
        "total_s": statistics.median(times),
        "reached": int(np.sum([r.rmse <= 1.005 * floor for r in fit.start_reports])),
    }
    return {
        "record": name,
        "noise_floor_deg": floor,
        "contenders": rows,
        "unidentifiable": fit.report.unidentifiable,
        "findings": fit.report.findings,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--peer-starts", type=int, default=5, help="starts for the peers (default 5)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    machine.pin()
    head = {**machine.versions(), "instruction set": _core.instruction_set()}
    for key, value in head.items():
        print(f"{key}: {value}")
    results = [measure(name, options) for name in RECORDS]
    for result in results:
        print(f"\n{result['record']}: noise floor {result['noise_floor_deg']:.4f} deg, {options.starts} starts")
        ours = result["contenders"]["mgdd"]["median_s"]
        for name, row in result["contenders"].items():
            if "total_s" in row:
                print(f"  {name:32s} {row['total_s']:8.3f} s for all,         reached {row['reached']}")
            else:
                print(
                    f"  {name:32s} {row['median_s']:8.4f} s median, worst {row['worst_s']:7.4f} s, "
                    f"reached {row['reached']} of {row['starts']}, {row['median_s'] / ours:5.1f} x"
                )
        for finding in result["findings"]:
            print(f"    {finding}")
    if options.json:
        options.json.write_text(json.dumps({"machine": head, "results": results}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
