"""Model-guided data-driven optimization and control for internal combustion engine systems.

The modules: `mgdd.engine` (cycle model and trace analysis), `mgdd.throttle` (electronic throttle), `mgdd.identify`
(calibration, throttle logs), `mgdd.guide` (models that guide a seeker), `mgdd.optimize` (least squares, seekers,
iterative learning), `mgdd.control` (PID, sliding mode), `mgdd.loop` (virtual bench, closed loops), `mgdd.sweep` (many
cycles at once), `mgdd.design` (design of experiments), `mgdd.maps` (look-up tables), `mgdd.parallel` (executors),
`mgdd.rig` (test rigs), `mgdd.workbench` (pages in a browser), `mgdd.presets`, `mgdd.io`, `mgdd.datasets`, `mgdd.plot`,
`mgdd.report`, `mgdd.results` and `mgdd.errors`. They are imported on use.

Crank angles are degrees everywhere, firing TDC = 0, compression negative (°CA aTDC).
"""

from __future__ import annotations

import importlib
import sys
from typing import Any

from mgdd._core import __version__

__all__ = [
    "__version__",
    "cmake_dir",
    "control",
    "datasets",
    "design",
    "engine",
    "errors",
    "guide",
    "identify",
    "io",
    "loop",
    "maps",
    "optimize",
    "parallel",
    "plot",
    "presets",
    "report",
    "results",
    "rig",
    "signals",
    "surrogate",
    "sweep",
    "throttle",
    "workbench",
]


def cmake_dir() -> str:
    """Return the folder of ``mgddConfig.cmake``, the C++ controllers of this package for CMake.

    ``find_package(mgdd COMPONENTS control)`` with ``-Dmgdd_DIR=...`` gives the target ``mgdd::control``, compiled from
    source for the target of the project that asks. It needs C++20 and no Eigen.

    Returns
    -------
    str
        For ``-Dmgdd_DIR``.

    See Also
    --------
    mgdd.loop.export_controller : a tuned controller as such a project.

    Examples
    --------
    >>> import mgdd
    >>> from pathlib import Path
    >>> (Path(mgdd.cmake_dir()) / "mgddConfig.cmake").is_file()
    True
    """
    from pathlib import Path

    return str(Path(__file__).parent / "cpp" / "cmake")


def __getattr__(name: str) -> Any:
    if name in __all__:
        return importlib.import_module(f"mgdd.{name}")
    from mgdd._rooms import missing

    raise missing(sys.modules[__name__], name)


def __dir__() -> list[str]:
    return sorted(__all__)
