"""The exceptions of mgdd: one tree, raised alike by the C++ core and by the Python layer.

Every message names the field or file, the value, and the bound or the remedy; where one field is to blame, the error
carries the three as attributes too.

Examples
--------
>>> from mgdd.errors import DataError, Error
>>> issubclass(DataError, Error), issubclass(DataError, ValueError)
(True, True)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Self

from mgdd._guesses import near_names

__all__ = [
    "ConvergenceError",
    "DataError",
    "Error",
    "InUseError",
    "Interrupted",
    "ParameterError",
    "RigError",
    "ShapeError",
    "WorkerLostError",
]


def __dir__() -> list[str]:
    return __all__


# Letters: of a value that a message quotes, and of a whole message. What a file carries may be of any length.
_LONGEST_VALUE, _LONGEST_MESSAGE = 120, 399
_NOTE = 32  # letters of what says how many are left out
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_VALUE + 1},}}")
_LONG_QUOTE = re.compile(rf"'[^'\n]{{{_LONGEST_VALUE + 1},}}'|\"[^\"\n]{{{_LONGEST_VALUE + 1},}}\"")


# What moves the cursor, colours, rings or turns the direction of a text; tabs and ends of lines are left.
_ACTING = {
    code: f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}"
    for code in (
        *range(9),
        *range(11, 32),
        *range(127, 160),
        0x200E,
        0x200F,
        *range(0x2028, 0x202F),
        *range(0x2066, 0x206A),
    )
}


def printable(text: str) -> str:
    """Write out what a terminal would obey, as the escapes of a name in a file."""
    return text.translate(_ACTING)


def shortened(text: str, longest: int = _LONGEST_VALUE) -> str:
    """Cut a long text in its middle."""
    if len(text) <= longest:
        return text
    tail = longest // 4
    return f"{text[: longest - tail]}[... {len(text) - longest} letters ...]{text[len(text) - tail :]}"


def _short_message(message: str) -> str:
    """Cut what a message quotes, then the message, so that the field before and the remedy behind stay."""
    message = printable(message)
    for long in (_LONG_WORD, _LONG_QUOTE):
        if len(message) > _LONGEST_MESSAGE:
            message = long.sub(lambda found: shortened(found[0], _LONGEST_VALUE - _NOTE), message)
    return shortened(message, _LONGEST_MESSAGE - _NOTE) if len(message) > _LONGEST_MESSAGE else message


class Error(Exception):
    """Base of everything mgdd raises, Ctrl-C apart.

    Parameters
    ----------
    message : str
        What is wrong and what to do; what a terminal would obey is written out, the whole is cut to 399 letters.
    field : str, optional
        Name of the field or argument to blame.
    value : object, optional
        What it was.
    bound : str, optional
        What it must be.

    Attributes
    ----------
    field, value, bound
        As given; None where no single field is to blame.

    Examples
    --------
    >>> from mgdd.engine import Cylinder
    >>> from mgdd.errors import Error
    >>> try:
    ...     Cylinder(bore_mm=-86.0)
    ... except Error as error:
    ...     print(error)
    bore_mm = -86 mm: must be > 0 and <= 2000
    """

    field: str | None
    value: Any
    bound: str | None

    def __init__(
        self, message: str = "", *, field: str | None = None, value: Any = None, bound: str | None = None
    ) -> None:
        super().__init__(_short_message(message))
        self.field, self.value, self.bound = field, value, bound

    @classmethod
    def of(cls, field: str, value: Any, bound: str, *, known: Iterable[str] = ()) -> Self:
        """Make the error of one refused field: ``field = value: must be bound``.

        Parameters
        ----------
        field : str
            Its name.
        value : object
            What was given.
        bound : str
            What it must be, with a remedy where there is one.
        known : iterable of str
            Names that it may be, of which the nearest is named.

        Returns
        -------
        Error
            Of this class, with message and attributes.

        Examples
        --------
        >>> from mgdd.errors import ParameterError
        >>> ParameterError.of("cycles", 0, ">= 1")
        ParameterError('cycles = 0: must be >= 1')
        """
        shown = f"{value:.12g}" if isinstance(value, float) else repr(value) if isinstance(value, str) else f"{value}"
        message = hinted(f"{field} = {shortened(shown)}: must be {bound}", str(value), known)
        return cls(message, field=field, value=value, bound=bound)

    @classmethod
    def unless(cls, holds: Any, field: str, value: Any, bound: str) -> None:
        """Raise the error of one refused field, as `of` makes it, unless a condition holds."""
        if not holds:
            raise cls.of(field, value, bound)

    def reworded(self, message: str) -> Self:
        """Give the same error with another message, for callers that know more of where it happened.

        Parameters
        ----------
        message : str
            The new message.

        Returns
        -------
        Error
            Of the same class, with the same field, value and bound.

        Examples
        --------
        >>> from mgdd.errors import ParameterError
        >>> error = ParameterError("must be > 0", field="bore_mm", value=-86.0, bound="> 0")
        >>> error.reworded("engine.toml: bore_mm must be > 0").field
        'bore_mm'
        """
        return type(self)(message, field=self.field, value=self.value, bound=self.bound)


class ParameterError(Error, ValueError):
    """A parameter outside its domain; the message names field, value and bound."""


class ShapeError(Error, ValueError):
    """An array of the wrong length or dimension."""


class DataError(Error, ValueError):
    """Measured data that cannot be what the caller says they are."""


class ConvergenceError(Error, RuntimeError):
    """A numerical method that did not reach its tolerance."""


class RigError(Error, OSError):
    """A test rig that cannot do what was asked."""


class InUseError(Error, RuntimeError):
    """A bench, seeker or learner that a call in another thread is running.

    An object that changes serves one call at a time. While a long call runs it without the interpreter's lock, any
    other call to it is refused with this error at once, and changes nothing: wait for that call, or give each thread
    its own copy (``copy.deepcopy``).
    """


class WorkerLostError(Error, RuntimeError):
    """A worker of an executor that is gone, with its work.

    Attributes
    ----------
    partial : object
        What the call would have returned, as far as it came.
    """

    partial: Any = None


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a long call, with what was finished until then.

    Code that catches `KeyboardInterrupt` catches it too; what is caught by ``except Exception`` is not.

    Parameters
    ----------
    message : str
        What was kept.
    partial : object, optional
        What the call would have returned, as far as it came; None where nothing was finished.

    Examples
    --------
    >>> from mgdd.errors import Interrupted
    >>> from mgdd.loop import VirtualEngine, run_seeker
    >>> from mgdd.optimize import GoldenSection
    >>> seeker = GoldenSection(start=-20.0, bounds=(-30.0, 10.0), noise_sd=0.25)
    >>> try:
    ...     run = run_seeker(VirtualEngine(), seeker, 300)
    ... except Interrupted as stop:
    ...     run = stop.partial
    >>> run.dataset.sizes["cycle"]
    300
    """

    def __init__(self, message: str = "interrupted", partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Ask for the known names that are near, or say nothing where none is."""
    close = near_names(name, list(known))
    return f"did you mean {' or '.join(map(repr, close))}?" if close else ""


def hinted(message: str, name: str, known: Iterable[str]) -> str:
    """Put the nearest of the known names behind a message, where one is near."""
    return "; ".join(filter(None, (message, did_you_mean(name, known))))


_written: ContextVar[Callable[[str, str | None], str] | None] = ContextVar("written", default=None)
_door: ContextVar[tuple[Collection[str], Callable[[str, str | None], str]] | None] = ContextVar("door", default=None)


def argument(name: str, text: str | None = None) -> str:
    """Write an argument as the reader of a message would give it: ``step_s=0.001`` in Python, or as an option.

    Where the function that was called does not take it, what stands for it there: see `taken`.
    """
    write, door = _written.get(), _door.get()
    if door is not None and name not in door[0]:
        return door[1](name, text)
    if write is not None:
        return write(name, text)
    return name if text is None else f"{name}={text}"


@contextmanager
def taken(names: Collection[str], instead: Callable[[str, str | None], str]) -> Iterator[None]:
    """Let `argument` write, of names that the function called does not take, ``instead(name, text)``.

    The outermost function counts: it is the one that the reader of a message called.
    """
    token = _door.set(_door.get() or (names, instead))
    try:
        yield
    finally:
        _door.reset(token)


@contextmanager
def arguments_written(write: Callable[[str, str | None], str]) -> Iterator[None]:
    """Let `argument` write in another way, for the command line."""
    token = _written.set(write)
    try:
        yield
    finally:
        _written.reset(token)
