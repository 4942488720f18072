"""The one writer of whole files: under another name first, so that a file is complete, or as it was before."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

__all__ = ["write_whole", "write_whole_text"]


def write_whole(path: str | os.PathLike[str], write: Callable[[Path], object]) -> None:
    """Let `write` make a file beside `path` and give it its name once it is on the disk.

    Parameters
    ----------
    path : path-like
        The file; an existing one is replaced in one step.
    write : callable
        ``write(other)`` writes everything to the path that it gets. What it raises is passed on, and nothing remains.

    Raises
    ------
    OSError
        The file cannot be written; one that was there is as before.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io.whole_file import write_whole
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_whole(pathlib.Path(folder) / "map.json", lambda path: path.write_text("{}"))
    ...     [file.name for file in pathlib.Path(folder).iterdir()]
    ['map.json']
    """
    whole = Path(path).resolve()  # a link stays one
    if whole.exists() and not whole.is_file():  # a terminal or a pipe has no other name
        write(whole)
        return
    half = whole.with_name(f".{whole.name}.part")
    try:
        write(half)
        with half.open("rb") as written:
            os.fsync(written.fileno())
        half.replace(whole)
    finally:
        half.unlink(missing_ok=True)


def write_whole_text(path: str | os.PathLike[str], text: str) -> None:
    r"""Write a text as UTF-8 with ``\n`` at the end of its lines, as `write_whole` does."""
    write_whole(path, lambda half: half.write_text(text, encoding="utf-8", newline="\n"))
