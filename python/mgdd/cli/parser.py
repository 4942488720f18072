"""A parser that is filled when it is asked, and whose errors are one line that leads on."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from mgdd.errors import hinted

# fmt: off
# Options of other programs, and what they are here.
_OPTIONS = {
    "--method": "--seeker", "--optimizer": "--seeker", "--algorithm": "--seeker", "--bounds": "--input",
    "--x0": "--start", "--iterations": "--cycles", "--options": "--seeker-set", "--constraint": "--limit",
    "--engine": "--preset", "--format": "--output", "--plot": "--figure", "--silent": "--quiet",
    "--rpm": "--speed-rpm", "--unit": "--pressure-unit", "--grid": "--over", "--param": "--set", "--dir": "--folder",
    "--points": "--visits", "--cycles": "--visits", "--step": "--reference step:FROM:TO", "--dcm": "--output FILE.dcm",
    "--bore": "--set bore_mm=X", "--stroke": "--set stroke_mm=X", "--cr": "--set compression_ratio=X",
    "--rod": "--set connecting_rod_mm=X", "--max-pressure": "--limit p_max_bar=X",
}
# fmt: on


class UsageError(Exception):
    """A command line that no command takes; it carries the parser that refused it."""

    def __init__(self, message: str, parser: argparse.ArgumentParser) -> None:
        super().__init__(message)
        self.parser = parser


class Parser(argparse.ArgumentParser):
    """An argument parser that is filled when it is asked, and raises its errors in one line that leads on."""

    later: Callable[[Parser], None] | None = None
    example = ""
    words: Sequence[str] = ()

    def filled(self) -> Parser:
        """Give the parser with all its options or commands."""
        later, self.later = self.later, None
        if later is not None:
            try:
                later(self)
            except ImportError as error:
                self.error(str(error))
        return self

    def _ranges(self, option: str) -> bool:
        """Whether a range of numbers, of which the first is below zero, stands behind an option."""
        begun = [k for k, word in enumerate(self.words) if word.startswith("--") and option.startswith(word[2:])]
        behind = "".join(self.words[k + 1] for k in begun[:1] if k + 1 < len(self.words))
        return "--over" in self.format_usage() and re.fullmatch(r"-[\d.]+[:,][\d.:,-]+", behind) is not None

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse with all options."""
        self.filled()
        self.words = list(args or ())
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Raise the message, with the nearest choice behind one that is none, a form or an example of what lacks."""
        if found := re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)$", message):
            message = hinted(message, found[1], [choice.strip("' ") for choice in found[2].split(",")])
        elif message.endswith("required") or "required: " in message:
            message += f", as in {self.example}"
        elif (found := re.search(r"--(\S+): expected one argument$", message)) and self._ranges(found[1]):
            message += _over(found[1])
        elif found := re.search(r"argument (\S+): expected one argument$", message):
            action = next(own for own in self._actions if "/".join(own.option_strings) == found[1])
            form = f", {action.metavar}; below zero it is {action.option_strings[-1]}=-…" if action.type else ""
            message += f", one of {', '.join(action.choices)}" if action.choices else form
        elif found := re.search(r"argument --(\S+): invalid .*'.+[:,].+'$", message):
            message += _over(found[1]) if "--over" in self.format_usage() else ""
        raise UsageError(message, self)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse what the command that was found does not know, with the nearest of its options or an example."""
        found, extra = self.parse_known_args(args, namespace)
        if extra:
            own = found.parser
            strange = next((word.partition("=")[0] for word in extra if word.startswith("-")), "")
            if strange == "--interactive":  # other programs need it for what pages do anyway
                own.error("--interactive: pages of --report show the values under the pointer: leave it out")
            strange = _OPTIONS.get(strange, strange)
            known = ["--output", *re.findall(r"--[a-z-]+", own.format_usage())]
            message = f"unrecognized arguments: {' '.join(extra)}"
            if " " in strange and strange.partition(" ")[0] in known:
                message += f"; did you mean {strange!r}?"
            else:
                message = hinted(message, strange, known)
            own.error(message if "did you mean" in message else f"{message}, as in {own.example}")
        return found


def _over(option: str) -> str:
    return f"; a range is --over {option.replace('-', '_')}=LOW:HIGH:COUNT"
