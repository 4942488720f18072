"""The one look for a file before it is read: one that is not there is named with its nearest neighbour."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path

from mgdd._arguments import shown
from mgdd.errors import ParameterError, did_you_mean

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
    mgdd.errors.ParameterError
        A folder, or a path that cannot be looked up: too long, with a NUL, or behind a folder that must not be entered.

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
    given: object = path
    if not isinstance(given, str | os.PathLike):
        bound = (
            "the path of a file; data in memory go as they are to what uses them, as mgdd.engine.analyze(frame, "
            "cylinder) or mgdd.identify.identify_throttle(frame)"
        )
        raise ParameterError(f"path = {shown(path)}: must be {bound}", field="path", value=path, bound=bound)
    file = Path(path)
    try:
        mode = file.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:  # ValueError: what cannot be handed to the system at all
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise ParameterError.of("path", str(file), f"one that can be looked up ({why}): give another") from error
    else:
        if stat.S_ISDIR(mode):
            raise ParameterError.of("path", str(file), "a file, and this is a folder: name a file in it")
        return file
    near = ""
    with contextlib.suppress(OSError):  # no such folder either, or one that must not be listed
        near = did_you_mean(file.name, (other.name for other in file.parent.iterdir()))
    raise FileNotFoundError(errno.ENOENT, f"no such file: {near or 'check the path'}", str(file))
