"""Records of the benchmarks: read from MGDD_DATA_DIR or from what was fetched before, or fetched and checked."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mgdd.datasets.files import path
from mgdd.errors import DataError, ParameterError
from mgdd.io.table import read_table
from mgdd.results.labels import labelled_dataset

if TYPE_CHECKING:
    import xarray as xr

_LOG = logging.getLogger(__name__)
_RAW = "https://raw.githubusercontent.com"
_SYSID = f"{_RAW}/forgi86/sysid-neural-continuous/956aa7ecd73061b0321c6f6098d74c9e4a7ce67a/examples"
_ADAPTATION = f"{_RAW}/forgi86/RNN-adaptation/098bc28720caaf2727da44481cb8945d5103c55c/examples"
_NOT_SEEN = "the terms of the authors were not seen"
_NEURAL = f"Apache-2.0 of the redistributing repository forgi86/sysid-neural-continuous; {_NOT_SEEN}"


class Origin(NamedTuple):
    """Public address of a file at a fixed commit, and its SHA-256."""

    url: str
    sha256: str


# The addresses that the records state.
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


def names() -> tuple[str, ...]:
    """Name the sets that can be read now, without a download."""

    def at_hand(name: str) -> bool:
        try:
            return all(_file(name, file) for file in ORIGINS[name])
        except FileNotFoundError:
            return False

    return tuple(filter(at_hand, ORIGINS))


def read(name: str, *, fetch: bool = False) -> tuple[xr.Dataset, xr.Dataset]:
    """Read the estimation and the test record of a benchmark, over ``time_s``.

    Parameters
    ----------
    name : {"cascaded_tanks", "emps", "wh2009"}
        ``emps``: a motor-driven slide with friction in closed loop at 1 kHz, ``drive_v`` (controller output, pulses
        included), ``position_m``, ``reference_m`` and the scalar ``force_n_per_v``. ``cascaded_tanks``: ``pump_v`` and
        ``level_v`` every 4 s; the level sensor ends at 10 V. ``wh2009``: ``input_v`` and ``output_v`` of the
        Wiener-Hammerstein circuit of the SYSID benchmark at 51.2 kHz, 100 000 and 78 800 samples.
    fetch : bool
        Download what is neither in ``$MGDD_DATA_DIR/NAME`` nor in ``MGDD_CACHE_DIR``, check it and keep it there; it
        needs the package pooch. The attributes of the records name the terms of the data.

    Raises
    ------
    FileNotFoundError
        The set is in none of these places; the message states where its files belong.
    mgdd.errors.ParameterError
        An unknown name.
    mgdd.errors.DataError
        A changed file, missing columns or samples; a file that cannot be fetched.

    References
    ----------
    Janot, Gautier and Brunot (2019), Data Set and Reference Models of EMPS.

    Schoukens and Noël (2017), Three benchmarks addressing open challenges in nonlinear system identification.

    Schoukens, Suykens and Ljung (2009), Wiener-Hammerstein benchmark.
    """
    if name not in ORIGINS:
        raise ParameterError(f"benchmark {name!r}: must be one of {', '.join(ORIGINS)}")
    return _READERS[name](*(_file(name, file, fetch=fetch) for file in ORIGINS[name]))


def _file(name: str, file: str, *, fetch: bool = False) -> Path:
    """Find a file of a benchmark; what is fetched is kept in MGDD_CACHE_DIR."""
    folder = Path(os.environ.get("MGDD_CACHE_DIR") or Path.home() / ".cache" / "mgdd") / name
    try:
        return path(name, file)
    except FileNotFoundError as error:
        if (folder / file).is_file():
            return folder / file
        if not fetch:
            how = f"{error.strerror}, or fetch it: mgdd_studies.benchmarks.records.read({name!r}, fetch=True)"
            raise FileNotFoundError(error.errno, how) from None
    try:
        import pooch
    except ImportError as error:
        raise ImportError("fetching a benchmark needs pooch: pip install 'mgdd[datasets]'") from error
    origin = ORIGINS[name][file]
    _LOG.info("fetching %s", origin.url)
    try:
        kept = pooch.retrieve(
            url=origin.url, known_hash=f"sha256:{origin.sha256}", fname=file, path=folder, progressbar=False
        )
    except ValueError as error:
        raise DataError(f"{origin.url}: is not the known file: {error}") from error
    except OSError as error:
        raise DataError(
            f"{origin.url}: cannot be fetched: {error}; put the file into $MGDD_DATA_DIR/{name} by hand"
        ) from error
    return Path(kept)


def _emps(*files: Path) -> tuple[xr.Dataset, xr.Dataset]:
    first, second = map(_emps_record, files)
    return first, second


def _emps_record(file: Path) -> xr.Dataset:
    from scipy.io import loadmat

    content = loadmat(file)
    missing = [name for name in ("t", "qg", "qm", "vir", "gtau") if name not in content]
    if missing:
        raise DataError(f"{file}: lacks {', '.join(missing)}: this is not a record of the EMPS benchmark")
    n = content["qm"].size
    return labelled_dataset(
        {
            "time_s": ("time_s", np.arange(n) * 1e-3, "s", "time"),  # the stamps differ from this by 20 ns
            "drive_v": ("time_s", content["vir"].ravel(), "V", "controller output"),
            "position_m": ("time_s", content["qm"].ravel(), "m", "measured position"),
            "reference_m": ("time_s", content["qg"].ravel(), "m", "reference position"),
            "force_n_per_v": ((), float(content["gtau"].item()), "N/V", "drive force per volt"),
        },
        attrs={
            "title": "electro-mechanical positioning system (EMPS)",
            "file": file.name,
            "citation": "A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop on "
            "Nonlinear System Identification Benchmarks (workshop of 2019)",
            "licence": _NEURAL,
        },
    )


def _cascaded_tanks(file: Path) -> tuple[xr.Dataset, xr.Dataset]:
    table = read_table(file)

    def record(pump: str, level: str, title: str) -> xr.Dataset:
        values = table.numbers(table.index(pump)), table.numbers(table.index(level))
        return labelled_dataset(
            {
                "time_s": ("time_s", np.arange(values[0].size) * 4.0, "s", "time"),
                "pump_v": ("time_s", values[0], "V", "pump voltage"),
                "level_v": ("time_s", values[1], "V", "level of the lower tank"),
            },
            attrs={
                "title": f"cascaded tanks with overflow, {title}",
                "citation": "M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël, Cascaded tanks benchmark",
                "licence": _NEURAL,
            },
        )

    return record("uEst", "yEst", "estimation"), record("uVal", "yVal", "test")


def _wiener_hammerstein(file: Path) -> tuple[xr.Dataset, xr.Dataset]:
    with file.open(encoding="utf-8") as lines:
        header = lines.readline().strip()
        if not header.replace('"', "").startswith("uBenchMark,yBenchMark"):
            raise DataError(f"{file}: begins with {header[:60]!r}: columns uBenchMark, yBenchMark were expected")
        columns = np.loadtxt(lines, delimiter=",", usecols=(0, 1)).T[:, 5200:184_000]
    if columns[0].size != 178_800:
        raise DataError(f"{file}: holds {columns[0].size + 5200} samples: the official split needs 184000")

    def record(rows: slice, title: str) -> xr.Dataset:
        return labelled_dataset(
            {
                "time_s": ("time_s", np.arange(178_800)[rows] / 51_200.0, "s", "time"),
                "input_v": ("time_s", columns[0][rows], "V", "input of the circuit"),
                "output_v": ("time_s", columns[1][rows], "V", "output of the circuit"),
            },
            attrs={
                "title": f"Wiener-Hammerstein circuit, {title}",
                "citation": "J. Schoukens, J. Suykens, L. Ljung, Wiener-Hammerstein benchmark (2009)",
                "licence": f"MIT of the redistributing repository forgi86/RNN-adaptation; {_NOT_SEEN}",
            },
        )

    return record(slice(0, 100_000), "estimation"), record(slice(100_000, None), "test")


_READERS: dict[str, Callable[..., tuple[xr.Dataset, xr.Dataset]]] = {
    "cascaded_tanks": _cascaded_tanks,
    "emps": _emps,
    "wh2009": _wiener_hammerstein,
}
