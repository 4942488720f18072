"""The one look for a file before it is read: one that is not there is named with its nearest neighbour."""

from __future__ import annotations

import contextlib
import errno
from pathlib import Path
from typing import TYPE_CHECKING

from mgdd.errors import did_you_mean

if TYPE_CHECKING:
    import os

__all__ = ["existing_file"]


def existing_file(path: str | os.PathLike[str]) -> Path:
    """Return the path of a file that is there.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    pathlib.Path
        The same.

    Raises
    ------
    FileNotFoundError
        No such file; the message names the one of its folder whose name is nearest.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from mgdd.io.existing_file import existing_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (pathlib.Path(folder) / "chirp.csv").write_text("time_s,duty,angle_deg")
    ...     try:
    ...         existing_file(pathlib.Path(folder) / "chrip.csv")
    ...     except FileNotFoundError as error:
    ...         print(error.strerror)
    no such file: did you mean 'chirp.csv'?
    """
    file = Path(path)
    if file.exists():
        return file
    near = ""
    with contextlib.suppress(OSError):  # no such folder either, or one that must not be listed
        near = did_you_mean(file.name, (other.name for other in file.parent.iterdir()))
    raise FileNotFoundError(errno.ENOENT, f"no such file: {near or 'check the path'}", str(file))
