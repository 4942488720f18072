"""One diagnostic: a code for programs, a human-readable sentence and its remedy; what a fit of the core leaves open."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from mgdd import _core


@dataclass(frozen=True)
class Finding:
    """One limitation of a result, or what the data do not determine; programs test the code, people read the text.

    Parameters
    ----------
    code : str
        Kind of the finding, for example ``at_bound``, ``correlated`` or ``not_converged``.
    names : tuple of str
        Parameters, traces or signals that it is about.
    text : str
        What was found, as a sentence without a full stop.
    remedy : str
        What to do about it; empty where the text is enough.
    """

    code: str
    names: tuple[str, ...]
    text: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.text}; {self.remedy}" if self.remedy else self.text

    def to_dict(self) -> dict[str, Any]:
        """Give code, names, text and remedy as plain values."""
        return {"code": self.code, "names": list(self.names), "text": self.text, "remedy": self.remedy}


def unique(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings in order, each once."""
    return tuple(dict.fromkeys(findings))


def findings_html(title: str, findings: Iterable[Finding]) -> str:
    """Return a titled list in HTML, nothing without findings."""
    import html

    items = "".join(f"<li>{html.escape(str(finding))}</li>" for finding in findings)
    return f"<p>{html.escape(title)}:</p><ul>{items}</ul>" if items else ""


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
    reasons += [
        ("correlated", next(pair for pair in combinations(names, 2) if text.startswith(f"{pair[0]} and {pair[1]}: ")))
        for text in sentences[len(reasons) :]
    ]
    return tuple(Finding(code, own, text) for (code, own), text in zip(reasons, sentences, strict=True))
