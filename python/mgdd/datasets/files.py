"""Where the files of a data set are: in MGDD_DATA_DIR, then (hash-checked) in the package."""

from __future__ import annotations

import errno
import hashlib
import os
from pathlib import Path

from mgdd.errors import DataError

_VARIABLE = "MGDD_DATA_DIR"
_PACKAGE = Path(__file__).parents[1] / "data"
HD = "hd_diesel_128x144"
ENGINE_MAPS = "advisor_engine_maps"

# SHA-256 of every file that the package carries.
_PACKAGED = {
    HD: {
        f"{HD}_traces.csv": "47e92d491a838de2aceeb7b84b62375613c465c5a109fae0122babf65024cadb",
        f"{HD}_conditions.csv": "599f36c318f968fd3894d1d44f56995ed7cad5e18daf19ef320f92532c5cb9a4",
        f"{HD}_SOURCE.txt": "23b966d613723032f57cb31ccafbfd6ebe920f3d95709b2e0901209f8c0f4e8a",
        f"{HD}_LICENSE.txt": "ec423cc5506eea1ffbfc9955c3ec8f86139996963d84ff306a5ee41eda8a4ff1",
    }
}

# The sets that `read` reads, and the files that each needs.
FILES: dict[str, tuple[str, ...]] = {
    ENGINE_MAPS: ("vw_1.9tdi_ornl_hot.csv", "mercedes_1.7_ornl_hot.csv"),
    "h2df_502": ("h2df_test502_cycles.csv",),
    HD: (f"{HD}_conditions.csv", f"{HD}_traces.csv"),
}

LICENCES: dict[str, str] = {
    ENGINE_MAPS: "permission of the Alliance for Sustainable Energy, LLC, without the ADVISOR trademark (license.txt)",
    "h2df_502": "Apache-2.0",
    HD: "MIT",
}


def names() -> tuple[str, ...]:
    """Name the data sets that can be read now.

    Returns
    -------
    tuple of str
        The sets whose files are all in the package or in ``MGDD_DATA_DIR``, sorted.

    Examples
    --------
    >>> from mgdd import datasets
    >>> "hd_diesel_128x144" in datasets.names()
    True
    """
    folder = _data_dir()

    def there(name: str, file: str) -> bool:
        return file in _PACKAGED.get(name, {}) or (folder is not None and (folder / name / file).is_file())

    return tuple(sorted(name for name, files in FILES.items() if all(there(name, file) for file in files)))


def path(name: str, file: str) -> Path:
    """Find a file of a data set: ``$MGDD_DATA_DIR/name/file`` first, then the package."""
    folder = _data_dir()
    if folder is not None and (folder / name / file).is_file():
        return folder / name / file
    packaged = _PACKAGE / file
    digest = _PACKAGED.get(name, {}).get(file)
    if digest is None or not packaged.is_file():
        first = f"looked for {folder / name / file}" if folder else f"{_VARIABLE} is not set"
        raise FileNotFoundError(
            errno.ENOENT,
            f"no file {file!r} of data set {name!r}: {first}, and the package ({_PACKAGE}) lacks it; "
            f"set {_VARIABLE} to a folder that holds {name}/{file}; "
            f"data sets at hand: {', '.join(names())}",
        )
    digest_of_file = hashlib.sha256(packaged.read_bytes()).hexdigest()
    if digest_of_file != digest:
        raise DataError(
            f"{packaged}: SHA-256 is {digest_of_file}, shipped was {digest}: the file was changed; reinstall mgdd, or "
            f"put your own version under {_VARIABLE}/{name}"
        )
    return packaged


def place(name: str) -> str:
    """Describe where a data set is, or where it belongs."""
    here = name in names()
    return str(path(name, FILES[name][0]).parent) if here else f"not here: put it into ${_VARIABLE}/{name}"


def _data_dir() -> Path | None:
    value = os.environ.get(_VARIABLE)
    return Path(value) if value else None
