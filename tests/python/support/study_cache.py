"""Studies that ran once are read again: by other tests, by other workers, by the next run of the same code.

The results lie below build/studies, in a folder named after what made them: the module, its sources and its data.
"""

import fcntl
import functools
import hashlib
import inspect
import os
import pickle
import shutil
from pathlib import Path
from typing import Any

import mgdd
import mgdd_studies
from mgdd import _core
from mgdd_studies import run_study
from mgdd_studies.base import StudyResult
from mgdd_studies.registry import function_of

ALL = Path(__file__).resolve().parents[3] / "build" / "studies"
KEPT_VERSIONS = 3
# The quick studies of all tests: fewer seeds where the tables that are tested are the same with them.
QUICK: dict[str, dict[str, int]] = {
    "calibrated-guide": {"n_seeds": 2},
    "guide-accuracy": {"n_seeds": 4},
    "guided-start-up": {"n_seeds": 6},
    "guided-transients": {"n_seeds": 2},
    "ignition-delay": {"n_seeds": 3},
    "measured-engine-seek": {"n_seeds": 1},
    "model-validation": {"n_seeds": 6},
    "online-calibration": {"n_seeds": 2},
    "seekers-several-inputs": {"n_seeds": 4},
    "sensor-delay": {"n_seeds": 4},
    "throttle-first-principle": {"n_seeds": 1},
    "throttle-pseudo-wiener": {"starts": 4},
}


def sources() -> list[Path]:
    """List the files that a result depends on; in a build of developers what stands in a package is a link."""
    packages = [Path(each.__file__).resolve().parent for each in (mgdd, mgdd_studies)]
    return sorted(file for each in packages for ending in ("py", "toml", "csv") for file in each.rglob(f"*.{ending}"))


@functools.cache
def folder() -> Path:
    """Make the folder of this version, and forget old ones."""
    digest = hashlib.sha256(Path(_core.__file__).read_bytes())
    for file in sources():
        digest.update(file.name.encode() + file.read_bytes())
    digest.update(f"{os.environ.get('MGDD_DATA_DIR')} {_core.instruction_set()}".encode())
    made = ALL / digest.hexdigest()[:16]
    made.mkdir(parents=True, exist_ok=True)
    os.utime(made)
    for old in sorted(ALL.iterdir(), key=lambda version: -version.stat().st_mtime)[KEPT_VERSIONS:]:
        shutil.rmtree(old, ignore_errors=True)
    return made


def quick_study(name: str) -> StudyResult:
    """Give the study that every test of it looks at: a quick one, but for the one that whole pages are made of."""
    return study(name, quick=name != "measured-traces", **QUICK.get(name, {}))


def study(name: str, **options: Any) -> StudyResult:
    """Give what `mgdd_studies.run_study` gives, with figures; run it only if nobody has."""
    options |= {"figures": True}
    call = inspect.signature(function_of(name)).bind(**options)
    call.apply_defaults()
    # The result does not depend on who is told of progress; his address is another one in every process.
    told = {key: value for key, value in call.arguments.items() if value is not None and not callable(value)}
    assert all(isinstance(value, bool | int | float | str) for value in told.values()), told
    words = "-".join(f"{key}_{value}" for key, value in sorted(told.items()))
    file = folder() / f"{name}-{words}.pickle"
    with file.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # whoever wants the same waits for the first
        if not file.exists():
            part = file.with_suffix(".part")
            part.write_bytes(pickle.dumps(run_study(name, **options)))
            part.rename(file)
    result: StudyResult = pickle.loads(file.read_bytes())
    return result
