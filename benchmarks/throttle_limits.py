"""How near each controller comes to the physical limit: full duty, then full reverse, by one who knows everything.

    python benchmarks/throttle_limits.py [--quick]

The limit: on the known, noise-free throttle, duty +1 for n1 samples, -1 for n2 samples, a last sample in between, then
the holding duty, on a grid of 1 ms and behind one sample of delay; the least settling time over all n1 and n2. The
controllers run on the same throttle with noise, know its parameters, and start cold or after 2 s of driving.
"""

from __future__ import annotations

import argparse

import numpy as np

from mgdd.loop import Reference, track, tuned_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.throttle import Throttle
from mgdd_studies.throttle_cases import throttle_of
from mgdd_studies.throttle_tracking import driving

SEEDS = 11
CASES = ((40.0, 42.0), (20.0, 60.0), (4.0, 20.0))


class Planned:
    """Sends a plan from the step on, before and after it the holding duty."""

    def __init__(self, plan: np.ndarray, before: float, after: float, step: int) -> None:
        self.plan, self.before, self.after, self.first, self.k = plan, before, after, step, -1

    def step(self, _reference_deg: float, _measurement_deg: float) -> float:
        """Give the next duty of the plan, whatever is measured."""
        self.k += 1
        at = self.k - self.first
        if at < 0:
            return self.before
        return float(self.plan[at]) if at < len(self.plan) else self.after


def holding(throttle: Throttle, angle_deg: float) -> float:
    """Duty in the middle of the friction band."""
    x = angle_deg - throttle.limp_home_deg
    side = "above" if x > 0.0 else "below"
    stiffness = getattr(throttle, f"spring_{side}_nm_per_rad")
    preload = getattr(throttle, f"preload_{side}_nm")
    return float((stiffness * np.radians(x) + np.sign(x) * preload) / throttle.stall_torque_nm)


def settled_ms(throttle: Throttle, reference: Reference, plan: np.ndarray) -> float:
    start, end = float(reference.angle_deg[0]), float(reference.angle_deg[-1])
    controller = Planned(plan, holding(throttle, start), holding(throttle, end), reference.from_sample)
    run = track(controller, reference, throttle=throttle, noise_deg=0.0)
    settling = float(run["settling_ms"])
    return settling if np.isfinite(settling) else np.inf


def limit_ms(throttle: Throttle, start: float, end: float) -> float:
    """Least settling time of the plans."""
    band = max(0.2, 0.02 * abs(end - start))
    reference = Reference.step(start, end, hold_s=0.05, after_s=0.2, band_deg=band)
    best = np.inf
    longest = 90 if abs(end - start) > 10 else 12
    for push in range(2, longest):
        last = np.inf
        for brake in range(push + 1):
            for between in (-0.5, 0.0, 0.5):
                plan = np.r_[np.full(push, 1.0), between, np.full(brake, -1.0)]
                found = settled_ms(throttle, reference, plan)
                best = min(best, found)
                last = min(last, found)
            if push + brake > best + 10:
                break
        if push > best + 5:
            break
    return float(best)


def median_ms(kind: str, throttle: Throttle, start: float, end: float, *, warm: bool) -> float:
    reference = Reference.step(start, end, after_s=0.6, band_deg=max(0.2, 0.02 * abs(end - start)))
    found = []
    for seed in range(SEEDS):
        controller = tuned_controller(kind, throttle)
        if warm:
            used = tuned_controller(kind, throttle)
            track(used, driving(), throttle=throttle, seed=100 + seed)
            controller.learnt = used.learnt  # type: ignore[union-attr]
        found.append(float(track(controller, reference, throttle=throttle, seed=seed)["settling_ms"]))
    return float(np.median(np.nan_to_num(found, nan=np.inf)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="P1 and the small step only")
    quick = parser.parse_args().quick
    for preset in ("P1",) if quick else ("P1", "P2", "P3"):
        throttle = throttle_of(preset)
        for start, end in CASES[: 1 if quick else None]:
            limit = limit_ms(throttle, start, end)
            print(f"{preset} {start:g} -> {end:g} deg: limit {limit:.0f} ms")
            for kind, family in FAMILIES.items():
                cold = median_ms(kind, throttle, start, end, warm=False)
                line = f"  {family.label:24s} {cold:6.0f} ms  {cold / limit:5.2f}"
                if kind == "guided":
                    warm = median_ms(kind, throttle, start, end, warm=True)
                    line += f"   after 2 s of driving {warm:6.0f} ms  {warm / limit:5.2f}"
                print(line, flush=True)


if __name__ == "__main__":
    main()
