"""One question: what becomes of a loop whose delay is longer than its controller was told.

    python benchmarks/throttle_untold_delay.py [--kind guided] [--sample-ms 1] [--later 0 1 2 3] [--each 4] [--blind]

Bodies that share no code with the package (tests/python/support), with Coulomb, Stribeck and LuGre friction and with a
gap. The controller knows each within 20 %, and their delay of one sample; the loop has some samples more. Shown of each
row: settling [ms] of the steps to 0.5 deg, median / 95 % over the bodies, the first step of a fresh controller apart;
how many bodies swing by more than 0.5 deg at the end of a step; and for how many the controller's own delay is more
than a sample off. ``told`` is the same with the true delay. ``--blind`` turns the search for the delay off.
"""

from __future__ import annotations

import argparse
import math
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from support import machine

from mgdd.control import GuidedPredictive
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.loop import Reference, track, tuned_controller

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "python" / "support"))
from independent_throttle import FAMILIES
from throttle_bodies import BodyPlate, draw_body, known_of

STEPS = {
    "first": ((20.0, 60.0), (40.0, 42.0), (20.0, 4.0)),
    "later": ((20.0, 60.0, 20.0, 60.0, 40.0, 42.0, 20.0, 4.0),),
}
HOLD_S, BAND_DEG, SWING_DEG = 0.6, 0.5, 0.5


def run(kind: str, family: str, seed: int, later: int, *, told: bool, blind: bool, sample_ms: int) -> dict[str, Any]:
    """Run the steps on one body: settling [ms] of each, whether it swings, and the delay that is used at the end."""
    body = draw_body(family, seed)
    known = known_of(body, seed) | {"delay_samples": sample_ms * (1.0 + (later if told else 0))}
    model = FirstPrincipleModel(parameters=known, closed_deg=body.closed_deg, open_deg=body.open_deg)
    out: dict[str, Any] = {"swings": 0, "off": 0}
    for name, sequences in STEPS.items():
        for levels in sequences:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of slow samples
                made: Any = tuned_controller(kind, model, sample_s=1e-3 * sample_ms, noise_deg=body.noise_deg)
            if blind:
                made = GuidedPredictive(**(made.settings | {"delay_search_samples": 0}))
            hold = round(HOLD_S * 1e3 / sample_ms)
            reference = Reference(angle_deg=np.repeat(levels, hold), sample_s=1e-3 * sample_ms)
            plate = BodyPlate(body, levels[0], milliseconds=sample_ms)
            angle = track(
                made, reference, throttle=plate, delay_samples=1 + later, noise_deg=body.noise_deg, seed=seed
            )["angle_deg"].to_numpy()
            for i in range(1 if name == "first" else 3, len(levels)):
                own = angle[i * hold : (i + 1) * hold]
                outside = np.flatnonzero(np.abs(own - levels[i]) > BAND_DEG)
                time_ms = 0.0 if outside.size == 0 else (outside[-1] + 1.0) * sample_ms
                key = f"{name} {levels[i - 1]:g}-{levels[i]:g}"
                out[key] = math.inf if outside.size and outside[-1] == hold - 1 else time_ms
                out["swings"] |= int(np.ptp(own[-hold // 2 :]) > SWING_DEG)
            if kind == "guided":
                out["off"] |= int(abs(made.delay_found_samples - 1 - later) > 1)
    return out


def main() -> None:
    machine.pin()
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kind", default="guided")
    parser.add_argument("--sample-ms", type=int, default=1)
    parser.add_argument("--later", type=int, nargs="+", default=list(range(6)))
    parser.add_argument("--each", type=int, default=4, help="bodies of each family")
    parser.add_argument("--blind", action="store_true")
    args = parser.parse_args()
    print(", ".join(f"{name}: {words}" for name, words in machine.versions().items()), flush=True)
    for later in args.later:
        for told in (False, True) if later and args.kind == "guided" else (False,):
            rows = [
                run(args.kind, family, seed, later, told=told, blind=args.blind, sample_ms=args.sample_ms)
                for family in FAMILIES
                for seed in range(args.each)
            ]
            cells = []
            for key in [key for key in rows[0] if key not in ("swings", "off")]:
                times = [row[key] for row in rows]
                high = np.quantile(times, 0.95, method="lower")
                cells.append(f"{key} {np.quantile(times, 0.5, method='lower'):3.0f}/{high:3.0f}")
            counts = ", ".join(f"{sum(row[key] for row in rows)} {key}" for key in ("swings", "off"))
            print(f"+{later} {'told' if told else '':4} {counts} of {len(rows)} | {' | '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
