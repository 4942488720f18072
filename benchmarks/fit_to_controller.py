"""One question: how do controllers that were tuned on a fit run on the throttle itself, beside those tuned on it.

    python benchmarks/fit_to_controller.py [--each 6] [--budget 40] [--only pid] [--json FILE]

Bodies that share no code with the package (tests/python/support): with Coulomb, Stribeck and LuGre friction and with a
gap, delays of 0 to 3 samples. Each gives a log of 8.3 s; `identify_throttle` with its defaults fits it, and
`tune_controller` tunes every kind on the fit, with its defaults on 20 throttles within 20 % of it, and, with the true
groups, on the body alone as a plant of one's own: the same budget, seed and noise. Then both run on the body along the
references of the tuner. What is shown of each
kind: cost, mean settling time of the six steps [ms] (one that never settles counts as 600), total variation of the
duty, and how many bodies end a run in a limit cycle of more than 0.5 deg; medians over the bodies, and the median over
the bodies of the ratio, fit over body.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from pathlib import Path
from typing import Any

import numpy as np
from support import machine

from mgdd.identify import identify_throttle
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.io import throttle_log
from mgdd.loop import track_many, tune_controller, tuned_controller
from mgdd.loop.tune import tracking_cost, tuning_references

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "python" / "support"))
from independent_throttle import FAMILIES, Body
from throttle_bodies import BodyPlate, draw_body, make_logs

KINDS = ("pid", "sliding_mode", "linear_mpc", "guided")
NEVER_MS = 600.0


def figures(controller: Any, body: Body) -> dict[str, float]:
    """Run a controller on a body along the references of the tuner."""
    references = [reference for reference, _ in tuning_references().values()]
    runs = track_many({"it": controller}, references, [BodyPlate(body)], delay_samples=0, first_seed=7).isel(
        controller=0
    )
    steps = [reference.name for reference in references if reference.name.startswith("step")]
    settling = np.nan_to_num(runs["settling_ms"].sel(reference=steps).to_numpy(), nan=NEVER_MS)
    return {
        "cost": tracking_cost(runs),
        "settling_ms": float(settling.mean()),
        "variation": float(runs["total_variation"].mean()),
        "swings": float((runs["limit_cycle_deg"].sel(reference=steps) > 0.5).any()),
    }


def row(family: str, seed: int, kinds: list[str], budget: int) -> dict[str, Any]:
    """Tune for one body on its fit and on itself."""
    body = draw_body(family, seed)
    log = throttle_log(*make_logs(body, seed)[0])
    fit = identify_throttle(log, closed_deg=body.closed_deg, open_deg=body.open_deg)
    groups = body.groups() | {"ramp_deg": body.ramp_deg, "delay_samples": float(body.delay_samples)}
    truth = FirstPrincipleModel(parameters=groups, closed_deg=body.closed_deg, open_deg=body.open_deg)
    out: dict[str, Any] = {"family": family, "seed": seed, "fit": fit.kind}
    for kind in kinds:
        on_fit = tune_controller(kind, fit, budget=budget, seed=1)
        on_body = tune_controller(kind, [BodyPlate(body)], model=truth, budget=budget, seed=1)
        for name, tuning, model in (("fit", on_fit, fit), ("body", on_body, truth)):
            delay = tuning.settings["delay_samples"]
            made = tuned_controller(kind, model, numbers=tuning.numbers, delay_samples=delay)
            out[f"{kind}, {name}"] = figures(made, body)
    return out


def main() -> None:
    machine.pin()
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--each", type=int, default=6, help="bodies of each family")
    parser.add_argument("--budget", type=int, default=40)
    parser.add_argument("--only", action="append", choices=KINDS)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    print(", ".join(f"{name}: {words}" for name, words in machine.versions().items()), flush=True)
    kinds = args.only or list(KINDS)
    rows = []
    for seed in range(args.each):
        for family in FAMILIES:
            rows.append(row(family, seed, kinds, args.budget))
            print(f"  {family} {seed}", file=sys.stderr, flush=True)
    print(f"{'kind':14} {'cost':>15} {'settling [ms]':>15} {'variation':>15} {'swing':>9}  ratios")
    for kind in kinds:
        cells, ratios = [], []
        for name in ("cost", "settling_ms", "variation"):
            both = [(one[f"{kind}, fit"][name], one[f"{kind}, body"][name]) for one in rows]
            cells.append("{:.2f} / {:.2f}".format(*(statistics.median(column) for column in zip(*both, strict=True))))
            ratios.append(f"{statistics.median(a / b for a, b in both):.2f}")
        swings = [sum(one[f"{kind}, {way}"]["swings"] for one in rows) for way in ("fit", "body")]
        print(f"{kind:14} {cells[0]:>15} {cells[1]:>15} {cells[2]:>15} {swings[0]:>4.0f} /{swings[1]:>3.0f}  {ratios}")
    if args.json:
        args.json.write_text(json.dumps({"versions": machine.versions(), "rows": rows}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
