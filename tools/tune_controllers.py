"""Tune every kind of controller for every preset, all alike, and write python/mgdd/data/tuned_controllers.toml.

    python tools/tune_controllers.py [KIND ...]

Only the named kinds are tuned anew. A search starts from the shipped set, so a second run goes on: to stay fair, tune
all kinds in every round and count it in `ROUNDS`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from mgdd.loop import tune_controller
from mgdd.loop.controller_families import FAMILIES
from mgdd.loop.tuned import tuned_sets
from mgdd_studies.throttle_cases import throttle_of

N_THROTTLES, SPREAD, BUDGET, SEED, ROUNDS = 20, 0.2, 400, 7, 2
TARGET = Path(__file__).resolve().parents[1] / "python/mgdd/data/tuned_controllers.toml"

HEAD = f"""# Numbers that `mgdd.loop.tune_controller` found for each kind of controller and each preset.
# Protocol: {N_THROTTLES} throttles within {SPREAD:.0%} of the preset (P1 with stiction of 0.3 N m), {ROUNDS} rounds of {BUDGET} runs of the whole set
# for every kind, each from the best of the one before, seed {SEED}, noise of 0.03 deg, samples of 1 ms and a delay of one;
# the controller knows the preset only. Written by tools/tune_controllers.py.
"""  # noqa: E501


def written(sets: Mapping[str, Mapping[str, Mapping[str, float]]]) -> str:
    """Text of the file."""
    lines = [HEAD.rstrip()]
    for kind, by_preset in sets.items():
        lines.append(f"\n[{kind}]")
        for preset, numbers in by_preset.items():
            row = ", ".join(f"{name} = {float(value)!r}" for name, value in numbers.items())
            lines.append(f"{preset} = {{ {row} }}")
    return "\n".join([*lines, ""])


def main() -> None:
    """Tune and write after every one."""
    kinds = sys.argv[1:] or list(FAMILIES)
    sets = {kind: {preset: dict(row) for preset, row in rows.items()} for kind, rows in tuned_sets().items()}
    for kind in kinds:
        for preset in ("P1", "P2", "P3"):
            found = tune_controller(
                kind, throttle_of(preset), n_throttles=N_THROTTLES, spread=SPREAD, budget=BUDGET, seed=SEED
            )
            print(f"{kind} {preset}: {found.start_cost:.3f} -> {found.cost:.3f}  {dict(found.numbers)}", flush=True)
            sets[kind][preset] = dict(found.numbers)
    TARGET.write_text(written(sets), encoding="utf-8")


if __name__ == "__main__":
    main()
