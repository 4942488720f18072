"""The studies by name: title, chapter of the dissertation, and whether workers can share their work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["STUDIES", "Study"]


class Study(NamedTuple):
    """What is known of a study before it runs."""

    title: str
    chapter: int | None = None  # of Tan (2018), where the question comes from it
    one_part: bool = False  # its work is one chain, nothing that workers could share


STUDIES: Mapping[str, Study] = {
    "measured-traces": Study(
        "calibrate a cycle model to four measured traces and find their best timing", one_part=True
    ),
    "throttle-characteristics": Study("holding-duty hysteresis, rate dependence and air flow of a throttle", 2),
    "seeker-comparison": Study("every seeker on the same engine, noise, start and budget", 3),
    "seekers-several-inputs": Study(
        "which seeker for several inputs: with and without a guide, beside tuned dithers, also under limits"
    ),
    "nox-sensors": Study("NOx analyser, fast sensor and soft sensor, steady and in transients", 4),
    "sensor-delay": Study("what a late NOx analyser does to extremum seeking, and three cures", 4),
    "timing-tests": Study(
        "four tests of extremum seeking: efficiency, another start, NOx by analyser and by soft sensor", 4
    ),
    "guided-start-up": Study("cycles that a rough model saves at the start, as feed-forward and as a curve", 5),
    "guide-accuracy": Study("how wrong a guide may be and still help after a load step and in trouble", 5),
    "guided-transients": Study("what a guide saves while the operating point keeps changing", 5),
    "ignition-delay": Study("start of injection for a start of combustion, and what a wrong delay costs a guide", 5),
    "model-validation": Study("cycle models beside measured traces, before and after calibration", 5),
    "online-calibration": Study("what the engine teaches its model while it runs, also with errors of the sensor", 6),
    "calibrated-guide": Study("whether a guide that the measured pressure calibrates beats one that stays wrong", 6),
    "from-design-to-map": Study(
        "a timing map by design of experiments: its cost, its losses, other engines, and what a guide makes of it", 2
    ),
    "map-that-seeks": Study(
        "a timing map by one search led by a rough model: visits, losses, changed engines, trouble, and drives"
    ),
    "torque-demand": Study("how far the torque follows the pedal through the throttle, and causes of the error", 2),
    "throttle-first-principle": Study(
        "groups of a throttle from noisy logs, also where the plant does more than the model", 7
    ),
    "throttle-pseudo-wiener": Study(
        "three pseudo-Wiener models of a throttle, in free run and corrected by measurements", 7
    ),
    "throttle-tracking": Study("six controllers, tuned alike, on throttles that they do not know", 7),
    "throttle-faults": Study("faults of a throttle under a supervisor: time to the safe state, reason, recovery"),
    "identification-benchmarks": Study(
        "measured drive, tanks and circuit: fits beside published ones (needs the data sets)"
    ),
    "guided": Study("a start guided by a rough model beside an unguided one, on the bench or a measured engine", 5),
    "measured-engine-seek": Study("seekers on a surrogate of a measured hydrogen-diesel engine (needs the data set)"),
}
