"""Where the files of a data set are: in MGDD_DATA_DIR, then (hash-checked) in the package, then what was fetched."""

from __future__ import annotations

import errno
import hashlib
import logging
import os
from pathlib import Path
from typing import Any, NamedTuple

from mgdd.errors import DataError, ParameterError

_LOG = logging.getLogger(__name__)
_CACHE = "MGDD_CACHE_DIR"
_EXTRA = "pip install 'mgdd[datasets]'"
_RAW = "https://raw.githubusercontent.com"
_SYSID = f"{_RAW}/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/examples"
_ADAPTATION = f"{_RAW}/forgi86/RNN-adaptation/098bc28720caaf2727da44481cb8945d5103c55c/examples"


class Origin(NamedTuple):
    """Public address of a file at a fixed commit, and its SHA-256."""

    url: str
    sha256: str


# The origins that the records state; the hydrogen-diesel set is an export of our own and has no address.
ORIGINS: dict[str, dict[str, Origin]] = {
    "cascaded_tanks": {
        "dataBenchmark.csv": Origin(
            f"{_SYSID}/CTS/data/dataBenchmark.csv",
            "ef2388ed822f3aef4aa80d6b0f2b466dd80b361786b3eafc7a2957c31ea323a7",
        )
    },
    "emps": {
        "DATA_EMPS.mat": Origin(
            f"{_SYSID}/EMPS/data/DATA_EMPS.mat",
            "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
        ),
        "DATA_EMPS_PULSES.mat": Origin(
            f"{_SYSID}/EMPS/data/DATA_EMPS_PULSES.mat",
            "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
        ),
    },
    "wh2009": {
        "WienerHammerBenchmark.csv": Origin(
            f"{_ADAPTATION}/WH/data/WH2009/WienerHammerBenchmark.csv",
            "95f241ac5e0afb48c47b24b3630f55e0d6f8f2f4dec145bd8adf852b19851fa3",
        )
    },
}


def fetch(name: str) -> Path:
    """Download a data set that has a public address, check it, and keep it for the next time, in ``MGDD_CACHE_DIR``.

    Nothing is downloaded without this call. Read the terms of the data first: the attributes of the loaded records
    name them.
    """
    if name not in ORIGINS:
        raise ParameterError(f"data set {name!r}: must be one of {', '.join(ORIGINS)} to be fetched")
    pooch = _pooch()
    if pooch is None:
        raise ImportError(f"fetching a data set needs pooch: {_EXTRA}")
    folder = _folder(pooch) / name
    for file, origin in ORIGINS[name].items():
        _LOG.info("fetching %s", origin.url)
        try:
            pooch.retrieve(
                url=origin.url, known_hash=f"sha256:{origin.sha256}", fname=file, path=folder, progressbar=False
            )
        except ValueError as error:
            raise DataError(f"{origin.url}: is not the known file: {error}") from error
        except OSError as error:
            raise DataError(
                f"{origin.url}: cannot be fetched: {error}; put the file into $MGDD_DATA_DIR/{name} by hand"
            ) from error
    return folder


def find_fetched(name: str, file: str) -> Path | None:
    """Return a file that was fetched before, if it is still there."""
    pooch = _pooch()
    if name not in ORIGINS or file not in ORIGINS[name] or pooch is None:
        return None
    path = _folder(pooch) / name / file
    return path if path.is_file() else None


def fetched() -> tuple[str, ...]:
    """Name the sets all of whose files were fetched before."""
    return tuple(name for name, files in ORIGINS.items() if all(find_fetched(name, file) for file in files))


def _folder(pooch: Any) -> Path:
    return Path(os.environ.get(_CACHE) or pooch.os_cache("mgdd"))


def _pooch() -> Any:
    try:
        import pooch
    except ImportError:
        return None
    return pooch


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
    "cascaded_tanks": ("dataBenchmark.csv",),
    "emps": ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"),
    "h2df_502": ("h2df_test502_cycles.csv",),
    HD: (f"{HD}_conditions.csv", f"{HD}_traces.csv"),
    "wh2009": ("WienerHammerBenchmark.csv",),
}

_NOT_SEEN = "the terms of the authors were not seen"
_NEURAL = f"Apache-2.0 of the redistributing repository forgi86/sysid-neural-continuous; {_NOT_SEEN}"
LICENCES: dict[str, str] = {
    ENGINE_MAPS: "permission of the Alliance for Sustainable Energy, LLC, without the ADVISOR trademark (license.txt)",
    "cascaded_tanks": _NEURAL,
    "emps": _NEURAL,
    "h2df_502": "Apache-2.0",
    HD: "MIT",
    "wh2009": f"MIT of the redistributing repository forgi86/RNN-adaptation; {_NOT_SEEN}",
}


def names() -> tuple[str, ...]:
    """Name the data sets that can be read now.

    Returns
    -------
    tuple of str
        The sets whose files are all in the package or in ``MGDD_DATA_DIR``, and those that were fetched, sorted.

    Examples
    --------
    >>> from mgdd import datasets
    >>> "hd_diesel_128x144" in datasets.names()
    True
    """
    folder = _data_dir()

    def there(name: str, file: str) -> bool:
        return file in _PACKAGED.get(name, {}) or (folder is not None and (folder / name / file).is_file())

    complete = {name for name, files in FILES.items() if all(there(name, file) for file in files)}
    return tuple(sorted({*complete, *fetched()}))


def path(name: str, file: str) -> Path:
    """Find a file of a data set: ``$MGDD_DATA_DIR/name/file`` first, then the package, then what was fetched."""
    folder = _data_dir()
    if folder is not None and (folder / name / file).is_file():
        return folder / name / file
    if (fetched_file := find_fetched(name, file)) is not None:
        return fetched_file
    packaged = _PACKAGE / file
    digest = _PACKAGED.get(name, {}).get(file)
    if digest is None or not packaged.is_file():
        first = f"looked for {folder / name / file}" if folder else f"{_VARIABLE} is not set"
        fetching = f", or fetch it: mgdd.datasets.read({name!r}, fetch=True)" if name in ORIGINS else ""
        raise FileNotFoundError(
            errno.ENOENT,
            f"no file {file!r} of data set {name!r}: {first}, and the package ({_PACKAGE}) lacks it; "
            f"set {_VARIABLE} to a folder that holds {name}/{file}{fetching}; "
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
    """Describe where a data set is, or how to get it."""
    if name in names():
        return str(path(name, FILES[name][0]).parent)
    fetched_by = f"mgdd data get {name} --fetch -o FILE"
    return f"not here: {fetched_by if name in ORIGINS else f'put it into ${_VARIABLE}/{name}'}"


def _data_dir() -> Path | None:
    value = os.environ.get(_VARIABLE)
    return Path(value) if value else None
