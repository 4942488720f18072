"""The known names that a wrong one may mean: one way for arguments, modules, columns and files.

No public part of the package.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

_LONGEST_NAME = 200  # of what is compared with known names, a comparison that grows with the square of the length
# Letters that are more than a coincidence, and names that are an answer rather than a list.
_SHORTEST_STEM, _MOST_NAMES = 3, 4
_LEAST_ALIKE = 0.65  # two of three letters are; at 0.6 --dcm leads to --decimal
# Words of the field, and of other libraries, by what stands for them here.
_MEANS = {
    word: meant.split()
    for words, meant in {
        "rpm rps revs": "speed",
        "ignition spark timing advance": "soc",
        "boost map manifold charge": "intake",
        "kp": "proportional",
        "ki": "integral",
        "kd": "derivative",
        "dt ts step period sampling": "sample",
        "length t_end stop": "duration",
        "bound range": "bound lower upper",
        "min minimum lower lb": "lower min bound",
        "max maximum upper ub": "upper max bound",
        "x0 initial guess": "start",
        "iteration iter maxiter step evaluation budget": "cycle",
        "method algorithm optimizer solver strategy": "seeker method",
        "y target output": "response output",
        "x feature": "factor input",
        "constraint": "limit",
        "fit calibrate train estimate regress": "identify fit estimate",
        "load open import parse": "read load",
        "read": "read load",
        "save export dump to": "write to",
        "list ls": "available name",
        "run": "simulate run",
        "optimize optimise minimize maximise maximize best": "optimum optimize seek",
        "es esc": "extremum",
        "gp gpr bo bayesian kriging": "gaussian response",
        "mpc": "predictive",
        "smc": "sliding",
        "ilc": "iterative",
        "doe": "design",
    }.items()
    for word in words.split()
}
# In a guess they carry no meaning: counts are whole numbers without them, a file has its form by its ending.
_IDLE = frozenset(("n", "num", "number", "of", "get", "the", "csv", "file", "data"))


def near_names(name: str, known: Iterable[str]) -> list[str]:
    """Return the known names that begin alike, else those of all its words, else the nearest one by its letters.

    Names that differ in their unit are different quantities, so all of them are given: ``pmax`` begins ``p_max_bar``
    and ``p_max_cad``, of which the nearest by its letters would be a guess.
    """
    if len(name) > _LONGEST_NAME:
        return []
    near = [other for other in known if len(other) <= _LONGEST_NAME]
    stem, words = _letters(name), _words(name) - _IDLE
    close = [other for other in near if len(stem) >= _SHORTEST_STEM and _letters(other).startswith(stem)]
    if not 0 < len(close) <= _MOST_NAMES:
        close = [other for other in near if words and all(_words(other) & _meant(word) for word in words)]
        if len(close) > _MOST_NAMES:  # of many, those that say no more
            close = [other for other in close if len(_words(other)) == min(map(len, map(_words, close)))]
    if not 0 < len(close) <= _MOST_NAMES:
        bare = {other.lstrip("-"): other for other in near}  # two dashes alike are no letters alike
        close = [bare[one] for one in difflib.get_close_matches(name.lstrip("-"), bare, 1, _LEAST_ALIKE)]
    return close


def _meant(word: str) -> set[str]:
    """Return a word with what stands for it here."""
    return {word, *_MEANS.get(word, ())}


def _words(name: str) -> set[str]:
    parts = re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+", name)
    return {part.lower().removesuffix("s") if len(part) > _SHORTEST_STEM else part.lower() for part in parts}


def _letters(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "")
