"""Work that outgrows one core or one machine: any executor, and the same results in the same order.

Whatever takes ``executor=`` in mgdd goes through here: work is cut into chunks, and Ctrl-C or a lost worker leaves what
is finished.
"""

from __future__ import annotations

from mgdd._rooms import furnish as _furnish
from mgdd.parallel.chunks import map_items

__all__ = ["map_items"]

_furnish(__name__)
