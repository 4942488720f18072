"""Data sets that can be fetched: where each file comes from, and the hash that it must have."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any, NamedTuple

from mgdd.errors import DataError, ParameterError

_LOG = logging.getLogger(__name__)
_CACHE = "MGDD_CACHE_DIR"
_EXTRA = "pip install 'mgdd[datasets]'"
_RAW = "https://raw.githubusercontent.com"
_NEURAL = f"{_RAW}/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/examples"
_ADAPTATION = f"{_RAW}/forgi86/RNN-adaptation/098bc28720caaf2727da44481cb8945d5103c55c/examples"


class Origin(NamedTuple):
    """Public address of a file at a fixed commit, and its SHA-256."""

    url: str
    sha256: str


# As the records say where they are from; the hydrogen-diesel set is an export of our own and has no address.
ORIGINS: dict[str, dict[str, Origin]] = {
    "cascaded_tanks": {
        "dataBenchmark.csv": Origin(
            f"{_NEURAL}/CTS/data/dataBenchmark.csv", "ef2388ed822f3aef4aa80d6b0f2b466dd80b361786b3eafc7a2957c31ea323a7"
        )
    },
    "emps": {
        "DATA_EMPS.mat": Origin(
            f"{_NEURAL}/EMPS/data/DATA_EMPS.mat", "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e"
        ),
        "DATA_EMPS_PULSES.mat": Origin(
            f"{_NEURAL}/EMPS/data/DATA_EMPS_PULSES.mat",
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
