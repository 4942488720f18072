"""One question: how many lines does a throttle from its log take elsewhere, and how well does that model run.

    python benchmarks/throttle_peers.py [--each 1] [--only REGEX] [--json FILE]

Bodies that share no code with any of the contenders (tests/python/support), with Coulomb, Stribeck and LuGre friction
and with a gap, each with a log of 8.3 s and a fresh log of 6.3 s. `identify_throttle` runs with its defaults; what a
user of SciPy, lmfit, jax-sysid and SIPPY would write stands in `peers/throttle_fits.py`: all but SIPPY, which knows
linear models only, fit one grey box from one start, and jax-sysid gets the true delay. Shown of each: fit of the free
run on the fresh log without its first 50 ms [%], its median and worst over the bodies, lines of code without those that
read the log, and processor seconds per log, compilation included. `pip install lmfit jax-sysid sippy_unipi` in an
environment of its own; what is not installed is named and left out.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from peers import throttle_fits
from support import machine

from mgdd.identify import identify_throttle
from mgdd.io import throttle_log

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "python" / "support"))
from independent_throttle import FAMILIES
from throttle_bodies import draw_body, make_logs

SKIP = 50  # samples, as `identify_throttle` leaves them out
OURS_LINES = 2


def fit_percent(angle: np.ndarray, run: np.ndarray) -> float:
    y, error = angle[SKIP:], (run - angle)[SKIP:]
    return float(100.0 * (1.0 - np.linalg.norm(error) / np.linalg.norm(y - y.mean())))


def ours(logs: Any, stops: tuple[float, float]) -> float:
    train, fresh = (throttle_log(*log) for log in logs)
    fit = identify_throttle(train, test=fresh, closed_deg=stops[0], open_deg=stops[1])
    return float(fit.test.nrmse_fit_percent)


def theirs(name: str, logs: Any, stops: tuple[float, float], delay: int) -> float:
    (_, duty, angle), (_, other, wanted) = logs
    given = {"delay": delay} if name == "jax-sysid" else {}
    run = throttle_fits.PEERS[name](duty, angle, stops, **given)
    return fit_percent(wanted, run(other, float(wanted[:SKIP].mean())))


def main() -> None:
    machine.pin()
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--each", type=int, default=1, help="bodies of each family")
    parser.add_argument("--only", default=".", help="contenders whose name matches")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    print(", ".join(f"{name}: {words}" for name, words in machine.versions().items()), flush=True)
    source = Path(throttle_fits.__file__).read_text(encoding="utf-8")
    bodies = [(family, seed) for seed in range(args.each) for family in FAMILIES]
    rows: dict[str, Any] = {}
    print(f"{'':18} {'fit, median':>12} {'worst':>8} {'lines':>6} {'s per log':>10}  by body")
    for name in ("mgdd", *throttle_fits.PEERS):
        if not re.search(args.only, name):
            continue
        fits, seconds = [], []
        try:
            for family, seed in bodies:
                body = draw_body(family, seed)
                logs, stops = make_logs(body, seed), (body.closed_deg, body.open_deg)
                begin = time.process_time()
                fits.append(ours(logs, stops) if name == "mgdd" else theirs(name, logs, stops, body.delay_samples))
                seconds.append(time.process_time() - begin)
        except ModuleNotFoundError as missing:
            print(f"{name:18} not installed: {missing.name}")
            continue
        lines = OURS_LINES if name == "mgdd" else throttle_fits.lines_of(source, throttle_fits.MARKS[name])
        rows[name] = {"fit_percent": fits, "seconds": seconds, "lines": lines}
        each = " ".join(f"{fit:.1f}" for fit in fits)
        middle = f"{statistics.median(fits):12.1f} {min(fits):8.1f}"
        print(f"{name:18} {middle} {lines:6d} {statistics.median(seconds):10.1f}  {each}", flush=True)
    if args.json:
        args.json.write_text(json.dumps({"versions": machine.versions(), "rows": rows}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
