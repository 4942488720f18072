"""One diagnostic: a code for programs, a sentence and its remedy for people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["Finding", "findings_html", "unique"]


@dataclass(frozen=True)
class Finding:
    """One reason to distrust a result, or what data leave open; programs test the code, people read the text.

    Parameters
    ----------
    code : str
        Kind of the finding, for example ``at_bound``, ``correlated`` or ``not_converged``.
    names : tuple of str
        Parameters, traces or signals that it is about.
    text : str
        What was found, as a sentence without a full stop.
    remedy : str
        What to do about it; empty where the text says all.

    Examples
    --------
    >>> from mgdd.results import Finding
    >>> found = Finding("one_way", (), "the plate only opens", "add a triangle across limp-home")
    >>> found.code, str(found)
    ('one_way', 'the plate only opens; add a triangle across limp-home')
    """

    code: str
    names: tuple[str, ...]
    text: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.text}; {self.remedy}" if self.remedy else self.text

    def to_dict(self) -> dict[str, Any]:
        """Give code, names, text and remedy as plain values.

        Returns
        -------
        dict
            Field names to values; names as a list.
        """
        return {"code": self.code, "names": list(self.names), "text": self.text, "remedy": self.remedy}


def unique(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings in order, each once."""
    return tuple(dict.fromkeys(findings))


def findings_html(title: str, findings: Iterable[Finding]) -> str:
    """Return a titled list in HTML, nothing without findings."""
    import html

    items = "".join(f"<li>{html.escape(str(finding))}</li>" for finding in findings)
    return f"<p>{html.escape(title)}:</p><ul>{items}</ul>" if items else ""
