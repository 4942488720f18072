"""What the share of back-EMF in the damping, which duty and angle hardly show, leaves open of the other groups."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from mgdd.identify.throttle.hunt import FINE, Hunt, names_of

if TYPE_CHECKING:
    from mgdd.identify.throttle.first_principle_problem import Search
    from mgdd.results import FitReport

__all__ = ["SHARE", "TYPICAL_SHARE", "with_unknown_share"]

SHARE = "viscous_share"
# A shorted motor brakes more than its bearings: what is not back-EMF is anything from none to half of the damping.
_SHARES = (0.0, 0.5)
TYPICAL_SHARE = 0.5 * sum(_SHARES)


def with_unknown_share(hunt: Hunt, found: Search, report: FitReport) -> FitReport:
    """Add to the errors of a fit at the typical share what another share, evenly spread, would change.

    While the plate slides, lag, time constant and gain take up whatever the share is: a log of a few seconds knows it
    to 0.2 at best. It is therefore not estimated but considered (Schmidt 1966): its spread counts through the change of
    every estimate between both ends.
    """
    ends = [
        hunt.search({**found.values, SHARE: share}, names_of(found), FINE, 10, 1e-6).report.values for share in _SHARES
    ]
    change = (np.asarray(ends[1]) - np.asarray(ends[0])) / math.sqrt(12.0)
    covariance = report.covariance + np.outer(change, change)
    stderr = np.sqrt(report.stderr**2 + change**2)
    for array in (covariance, stderr):
        array.flags.writeable = False
    return dataclasses.replace(report, covariance=covariance, stderr=stderr)
