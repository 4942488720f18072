"""How far the numbers that were tuned at 1 ms serve at other sample times and delays, kind by kind.

    python benchmarks/tuned_rates.py [KIND ...]

Steps of 20 to 60, 40 to 42 and 4 to 20 deg on 12 throttles within 20 % of each preset; the controller knows the preset
and the delay, where it can know one. `longest_sample_s` and `longest_dead_s` of `mgdd.loop.controller_families` are
where at most 2 % of the runs end in a limit cycle of more than 0.5 deg.
"""

from __future__ import annotations

import sys

import numpy as np

from mgdd import presets
from mgdd.loop import Reference, track_many
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.tune import draw_throttles
from mgdd.loop.tuned import tuned_with_doubts

RATES = (
    (0.2, 5), (0.5, 2), (1, 0), (1, 1), (1, 2), (1, 3), (1, 5), (1, 7), (1, 12), (2, 0), (2, 1), (2, 2), (5, 0), (5, 1),
    (10, 0), (10, 1),
)  # fmt: skip


def swinging(kind: str, sample_ms: float, delay_samples: int) -> tuple[float, float, bool]:
    """Give median settling time [ms], the share that ends in a limit cycle [%], and whether that is doubted."""
    sample_s, settling, cycles, doubted = sample_ms * 1e-3, [], [], False
    references = [
        Reference.step(a, b, hold_s=0.3, after_s=1.0, sample_s=sample_s, band_deg=max(0.3, 0.02 * abs(b - a)))
        for a, b in ((20, 60), (40, 42), (4, 20))
    ]
    for name in ("P1", "P2", "P3"):
        throttle = presets.load(name, kind="throttle").throttle
        controller, doubts = tuned_with_doubts(kind, throttle, sample_s=sample_s, delay_samples=delay_samples)
        runs = track_many(
            {kind: controller}, references, draw_throttles(throttle, 12, seed=3), delay_samples=delay_samples,
            first_seed=5,
        )  # fmt: skip
        settling.append(runs["settling_ms"].to_numpy().ravel())
        cycles.append(runs["limit_cycle_deg"].to_numpy().ravel())
        doubted |= bool(doubts)
    share = 100.0 * float((np.concatenate(cycles) > 0.5).mean())
    return float(np.nanmedian(np.concatenate(settling))), share, doubted


def main() -> None:
    """Print one row per kind, sample time and delay."""
    print("kind          sample  delay  settles [ms]  limit cycles  doubted")
    for kind in sys.argv[1:] or FAMILIES:
        for sample_ms, delay in RATES:
            settles, share, doubted = swinging(kind, sample_ms, delay)
            print(
                f"{kind:12s} {sample_ms:5g} ms {delay:6d} {settles:13.0f} {share:11.0f} %  {'yes' if doubted else ''}"
            )


if __name__ == "__main__":
    main()
