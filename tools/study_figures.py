"""Draw the figures of docs/study_*.md and docs/throttle_tracking.md: one or two of each study.

Run `python tools/study_figures.py [FOLDER [STUDY ...]]` with the package installed; FOLDER defaults to docs/_static,
the studies to all of them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

from mgdd_studies import run_study

OUT = Path(__file__).parents[1] / "docs" / "_static"
# Study, number of the figure, resolution: a file stays below 150 kB.
FIGURES = {
    "study_seekers.png": ("seeker-comparison", 0, 72),
    "study_several_paths.png": ("seekers-several-inputs", 1, 72),
    "study_several_limits.png": ("seekers-several-inputs", 2, 72),
    "study_sensors.png": ("nox-sensors", 1, 72),
    "study_delay.png": ("sensor-delay", 0, 90),
    "study_cures.png": ("sensor-delay", 1, 90),
    "study_tests.png": ("timing-tests", 3, 80),
    "study_guided.png": ("guided", 0, 80),
    "study_guide_curve.png": ("guided-start-up", 1, 72),
    "study_guide_step.png": ("guide-accuracy", 0, 72),
    "study_ignition_delay.png": ("ignition-delay", 0, 80),
    "study_ignition_runs.png": ("ignition-delay", 2, 72),
    "study_validation.png": ("model-validation", 1, 80),
    "study_guide_drive.png": ("guided-transients", 0, 80),
    "study_calibration_errors.png": ("online-calibration", 1, 72),
    "study_guide_learns.png": ("calibrated-guide", 0, 72),
    "study_guide_learns_step.png": ("calibrated-guide", 1, 72),
    "study_tracking.png": ("throttle-tracking", 0, 80),
    "study_guide_plane.png": ("guided-transients", 1, 72),
    "study_map_effort.png": ("from-design-to-map", 0, 80),
    "study_map_parts.png": ("from-design-to-map", 1, 80),
    "study_map_drives.png": ("from-design-to-map", 3, 72),
    "study_map_seeks_visits.png": ("map-that-seeks", 0, 80),
    "study_map_seeks_changed.png": ("map-that-seeks", 1, 72),
    "study_map_seeks_map.png": ("map-that-seeks", 2, 72),
    "study_map_seeks_drives.png": ("map-that-seeks", 3, 72),
}


def main() -> None:
    """Run each study once, write its figures."""
    mpl.use("Agg")
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    mpl.rcParams["font.size"] = 9.5
    wanted = {file: figure for file, figure in FIGURES.items() if figure[0] in sys.argv[2:] or len(sys.argv) < 3}
    results = {name: run_study(name) for name in {name for name, _, _ in wanted.values()}}
    for file, (name, number, dpi) in wanted.items():
        figure = list(results[name].figures.values())[number]
        figure.savefig(out / file, dpi=dpi, metadata={"Software": None})
        print(file, (out / file).stat().st_size // 1024, "kB")


if __name__ == "__main__":
    main()
