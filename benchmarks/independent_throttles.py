"""One question: how well are throttles identified whose simulation shares no code with the package.

    python benchmarks/independent_throttles.py [--each 10] [--family lugre] [--first-seed 0] [--only REGEX] [--json F]

Forty random bodies, ten each of Coulomb, Stribeck and LuGre friction and with a gap in the gear; delays of 0 to 3
samples, lags of 0.3 to 2 ms, angle noise 0.02 to 0.05 deg and a 12-bit converter (tests/python/support). Each gives an
excitation log (8.3 s across limp-home: levels, then a chirp) and a fresh log of other levels (6.3 s). Both stops are
told. Every fit is a call of `identify_throttle` with its own defaults; one row of PW-R also asks for a set per side and
for delays of 0 to 5 samples.

Told of each: free-run fit on the fresh log, the delay found, how often the 95 % interval of delay, time constant, gain,
lag, preloads and springs holds the true value and how wide it is, whether the finding ``below_ceiling`` is given where
the fit misses its own log by more than the noise that was added to it, processor seconds. First the package's groups at
the true values must follow the fresh logs of the undelayed Coulomb bodies: otherwise truths and estimates do not mean
the same. Time constant and gain are those of a plate that moves with its motor: all inertia, all viscous damping; with
a gap, while it is closed.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import statistics
import sys
import time
from pathlib import Path
from typing import Any

from support import machine

from mgdd.errors import Error
from mgdd.identify import identify_throttle
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.identify.throttle.free_run import free_run, quality_of
from mgdd.io import throttle_log

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "python" / "support"))
from independent_throttle import FAMILIES, Body
from throttle_bodies import draw_body, make_logs

CALLS: dict[str, dict[str, Any]] = {
    "auto": {},
    "pw_r": {"model": "pw_r"},
    "pw_r, two_sided, delays 0 to 5": {"model": "pw_r", "two_sided": True, "delay_samples": range(6)},
    "first_principle": {"model": "first_principle"},
    "pw_w": {"model": "pw_w"},
    "pw_p": {"model": "pw_p"},
}
TRUTHS = {  # shown name: truth's name, then the names that fits use
    "delay": ("delay_samples", "delay_samples"),
    "time constant": ("tau_s", "tau_s"),
    "gain": ("gain_deg_per_s2_per_duty", "gain_deg_per_s2_per_duty"),
    "lag": ("electrical_s", "electrical_s"),
    "preload above": ("beta_above_duty", "beta_above_duty", "above_preload_duty"),
    "preload below": ("beta_below_duty", "beta_below_duty", "below_preload_duty"),
    "spring above": ("kappa_above_duty_per_deg", "kappa_above_duty_per_deg", "above_spring_duty_per_deg"),
    "spring below": ("kappa_below_duty_per_deg", "kappa_below_duty_per_deg", "below_spring_duty_per_deg"),
}
LOWEST_PERCENT = 98.0  # of the groups at the truth
MISSED_POINTS = 3.0  # below what the noise that was added would leave


def check_agreement(bodies: list[tuple[Body, Any, Any]]) -> None:
    for body, _, test in bodies:
        if body.family != "coulomb" or body.delay_samples != 0:
            continue
        model = FirstPrincipleModel(
            parameters=body.groups() | {"ramp_deg": body.ramp_deg}, closed_deg=body.closed_deg,
            open_deg=body.open_deg, substeps=20,
        )  # fmt: skip
        percent = quality_of([free_run(model, test)]).nrmse_fit_percent
        if percent is None or percent < LOWEST_PERCENT:
            sys.exit(f"the true groups follow a Coulomb body at {percent} %: nothing measured")


def identify(body: Body, train: Any, test: Any, call: dict[str, Any]) -> dict[str, Any]:
    begin = time.process_time()
    try:
        fit = identify_throttle(train, test=test, closed_deg=body.closed_deg, open_deg=body.open_deg, **call)
    except Error as error:
        return {"refused": str(error), "seconds": time.process_time() - begin}
    seconds = time.process_time() - begin
    estimates: dict[str, dict[str, Any]] = {}
    intervals, truths = fit.report.interval(0.95), body.groups() | {"delay_samples": float(body.delay_samples)}
    for shown, (truth, *names) in TRUTHS.items():
        name = next((own for own in names if own in fit.stderr), None)
        if name is not None and math.isfinite(fit.stderr[name]):
            estimates[shown] = {
                "value": fit.parameters[name], "stderr": fit.stderr[name], "truth": truths[truth],
                "interval": intervals[name],
            }  # fmt: skip
    assert fit.test is not None and fit.train is not None  # noqa: S101, PT018
    return {
        "missed_points": ceiling_of(body, train) - float(fit.train.nrmse_fit_percent or -math.inf),
        "doubted": "below_ceiling" in {finding.code for finding in fit.findings},
        "percent": fit.test.nrmse_fit_percent,
        "kind": fit.kind,
        # What was not searched was not found.
        "delay": None
        if call.get("model") in ("pw_r", "pw_w", "pw_p") and "delay_samples" not in call
        else fit.parameters["delay_samples"],
        "delay_truth": body.delay_samples,
        "estimates": estimates,
        "seconds": seconds,
    }


def ceiling_of(body: Body, log: Any) -> float:
    """Return what noise and converter leave of the fit of a perfect model [%]."""
    noise = math.hypot(body.noise_deg, body.converter_deg / math.sqrt(12.0))
    return 100.0 * (1.0 - noise / float(log["angle_deg"].std()))


def fit_figures(rows: list[dict[str, Any]]) -> str:
    percents = [row.get("percent", -math.inf) for row in rows]
    return f"{statistics.median(percents):5.1f} / {min(percents):5.1f}"


def covered(rows: list[dict[str, Any]], shown: str) -> str:
    own = [row["estimates"][shown] for row in rows if shown in row.get("estimates", {})]
    if not own:
        return "-"
    inside = sum(one["interval"][0] <= one["truth"] <= one["interval"][1] for one in own)
    error = statistics.median(abs(one["value"] / one["truth"] - 1.0) if one["truth"] else 0.0 for one in own)
    apart = statistics.median(abs(one["value"] - one["truth"]) / one["stderr"] for one in own)
    half = statistics.median(
        0.5 * (one["interval"][1] - one["interval"][0]) / (1.0 if shown == "delay" else one["truth"]) for one in own
    )
    width = f"half width {half:.2g} samples" if shown == "delay" else f"half width {100 * half:.2g} %"
    return f"{inside} of {len(own)} ({100 * error:.2g} %, {apart:.2g} standard errors, {width})"


def lag_error_by_delay(rows: list[dict[str, Any]]) -> str:
    """Say what each true delay adds to the lag: the median error [ms], and of how many bodies."""
    errors: dict[int, list[float]] = {}
    for row in rows:
        if (lag := row.get("estimates", {}).get("lag")) is not None:
            errors.setdefault(row["delay_truth"], []).append(1e3 * (lag["value"] - lag["truth"]))
    return ", ".join(f"{delay}: {statistics.median(own):+.2f} ({len(own)})" for delay, own in sorted(errors.items()))


def report(name: str, rows: dict[str, list[dict[str, Any]]]) -> None:
    everything = [row for own in rows.values() for row in own]
    print(f"\n{name}\n  free run on the fresh log, median / minimum [%]:")
    for family, own in rows.items():
        print(f"    {family:10s} {fit_figures(own)}")
    print(f"    {'all':10s} {fit_figures(everything)}, {sum('refused' in row for row in everything)} refused")
    told = [row for row in everything if row.get("delay") is not None]
    found = sum(row["delay"] == row["delay_truth"] for row in told)
    print(f"  delay found: {f'{found} of {len(everything)}' if told else 'not estimated'}")
    print("  95 % intervals that hold the truth (median error, median half width):")
    gap, others = rows.get("backlash", []), [row for family, own in rows.items() if family != "backlash" for row in own]
    for shown in TRUTHS:
        if covered(everything, shown) != "-":
            print(f"    {shown:14s} without a gap {covered(others, shown)} | with {covered(gap, shown)}")
    far = [row["doubted"] for row in everything if row.get("missed_points", 0.0) > MISSED_POINTS]
    near = [row["doubted"] for row in everything if row.get("missed_points", math.inf) <= MISSED_POINTS]
    counts = f"{sum(far)} of {len(far)} that miss {MISSED_POINTS:g} points, {sum(near)} of {len(near)} others"
    print(f"  below_ceiling: {counts}")
    if text := lag_error_by_delay(everything):
        print(f"  lag minus truth [ms] by the true delay, median (bodies): {text}")
    seconds = [row["seconds"] for row in everything]
    print(f"  processor seconds: median {statistics.median(seconds):.2f}, worst {max(seconds):.2f}")


def compare(results: dict[str, dict[str, list[dict[str, Any]]]], ours: str, theirs: str) -> None:
    """In how many bodies one call follows the fresh log better than another."""
    if ours not in results or theirs not in results:
        return
    pairs = [
        (one.get("percent", -math.inf), other.get("percent", -math.inf))
        for family in results[ours]
        for one, other in zip(results[ours][family], results[theirs][family], strict=True)
    ]
    print(f"\n{ours} is better than {theirs} in {sum(a > b for a, b in pairs)} of {len(pairs)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=10, help="bodies per family (default 10)")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first body of each family (default 0)")
    parser.add_argument("--family", choices=FAMILIES, nargs="+", default=list(FAMILIES), help="families (default all)")
    parser.add_argument("--only", default="", metavar="REGEX", help="calls whose name matches")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to FILE")
    options = parser.parse_args()
    machine.pin()
    head = machine.versions()
    for key, value in head.items():
        print(f"{key}: {value}")
    bodies = []
    families: list[str] = options.family
    for family in families:
        for seed in range(options.first_seed, options.first_seed + options.each):
            body = draw_body(family, seed)
            train, test = (throttle_log(*log) for log in make_logs(body, seed))
            bodies.append((body, train, test))
    check_agreement(bodies)
    results = {}
    for name, call in CALLS.items():
        if re.search(options.only, name) is None:
            continue
        rows: dict[str, list[dict[str, Any]]] = {family: [] for family in families}
        for body, train, test in bodies:
            rows[body.family].append(identify(body, train, test, call))
        report(name, rows)
        results[name] = rows
    for theirs in ("pw_r", "pw_r, two_sided, delays 0 to 5", "first_principle"):
        compare(results, "auto", theirs)
    if options.json:
        options.json.write_text(json.dumps({"machine": head, "results": results}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
