"""What a fit of the core leaves open, as findings with code and names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mgdd.results.finding import Finding

if TYPE_CHECKING:
    from mgdd import _core

__all__ = ["classified"]


def classified(report: _core.optimize.FitReport) -> tuple[Finding, ...]:
    """Give the sentences of the core their code and names; they stand in the order bounds, null directions, pairs."""
    names, sentences = tuple(report.names), list(report.findings)
    if not sentences:  # a fit that failed has bounds, but no uncertainty was described
        return ()
    reasons: list[tuple[str, tuple[str, ...]]] = [
        ("at_bound", (name,)) for name, side in zip(names, report.bounds_active, strict=False) if side != 0
    ]
    null = np.asarray(report.null_directions)
    reasons += [
        ("null_direction", tuple(name for name, part in zip(names, column, strict=True) if part != 0.0))
        for column in (null.T if null.ndim == 2 else ())
    ]
    reasons += [("correlated", pair) for pair in _strongest(report, len(sentences) - len(reasons))]
    return tuple(Finding(code, own, text) for (code, own), text in zip(reasons, sentences, strict=True))


def _strongest(report: _core.optimize.FitReport, count: int) -> list[tuple[str, str]]:
    """Return the `count` most correlated pairs outside the null directions, in the order of the parameters."""
    c, null = np.asarray(report.correlation), np.asarray(report.null_directions)
    loose = [bool(np.any(row != 0.0)) for row in np.reshape(null, (len(report.names), -1))]
    pairs = [
        (bool(loose[i] or loose[j]), -abs(c[i, j]), i, j)
        for i in range(len(report.names))
        for j in range(i + 1, len(report.names))
        if np.isfinite(c[i, j])
    ]
    kept = sorted((i, j) for *_, i, j in sorted(pairs)[:count])
    return [(report.names[i], report.names[j]) for i, j in kept]
