"""The workbench: pages in a browser of this machine for what the command line does, by mouse; and views in a notebook.

``mgdd workbench`` serves it. Its pages call the public interface and nothing else; each one shows the command and the
Python that do the same.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.workbench.notebook import view

__all__ = ["view"]

_furnish(__name__)
