#!/usr/bin/env python3
"""Convert the four measured heavy-duty diesel traces to the CSV files that the package carries.

    python tools/convert_hd_traces.py --source <folder of pExpA25 ...>

reads the unmodified files of LibICE-post (two columns: crank angle [deg], pressure [Pa]) and writes into
python/mgdd/data four files: traces, operating conditions, source, licence. Running it again gives the same bytes.
Without --source it looks in $MGDD_DATA_DIR/libice_hd_diesel. Standard library only.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

STEM = "hd_diesel_128x144"
COMMIT = "c1bc6acc2a5952f28ed11f76c4a26cb506e6b5aa"
SAMPLES = 267

SOURCE = f"""\
Heavy-duty diesel engine, bore 128 mm, stroke 144 mm: measured cylinder pressure, cycle-averaged,
valves closed, at four loads; crank angles in whole degrees. Converted, figures only, from LibICE-post:
  F. Ramognino, LibICE-post, https://github.com/RamogninoF/LibICE-post
  commit {COMMIT}
  tutorials/loadingDictionaries/data/exp/pExpA25, pExpA50, pExpA75, pExpA100
Licence: MIT, Copyright (c) 2018 The Python Packaging Authority; full text in {STEM}_LICENSE.txt
Made by tools/convert_hd_traces.py; Pa to bar is exact.

Columns of {STEM}_traces.csv:
  crank angle [deg, firing TDC = 0, compression negative]; pressure [bar] at 25, 50, 75, 100 % load
Columns of {STEM}_conditions.csv:
  file = column of {STEM}_traces.csv; load [%]; engine speed [rpm]; trapped mass [g per cycle];
  start of injection [deg, firing TDC = 0, compression negative]
"""
# load [%], speed [rpm], trapped mass [g], start of injection [°CA aTDC], as in the tutorial's dictionaries
CONDITIONS = (
    (25, 1200, "3.0858", "-5.06"),
    (50, 1200, "4.13863", "-4.73"),
    (75, 1200, "5.39428", "-4.75"),
    (100, 1200, "6.193", "-2.00"),
)
LICENSE = """\
Copyright (c) 2018 The Python Packaging Authority

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all
copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
SOFTWARE.
"""


def bar_text(pascal: str) -> str:
    """Pascal to bar on integers: every digit kept, four decimals."""
    value = int(pascal)
    if value < 0 or value % 10:
        raise ValueError(f"pressure {pascal} Pa: must be a multiple of 10 Pa, not negative")
    return f"{value // 100_000}.{value % 100_000 // 10:04d}"


def read_source(file: Path) -> tuple[list[int], list[str]]:
    """Read one source file: whole crank angles [deg] and pressure [bar, as text]."""
    rows = [line.split() for line in file.read_text(encoding="ascii").splitlines() if line.strip()]
    if len(rows) != SAMPLES or any(len(row) != 2 for row in rows):
        raise ValueError(f"{file}: {SAMPLES} rows of two columns expected, {len(rows)} rows found")
    return [int(row[0]) for row in rows], [bar_text(row[1]) for row in rows]


def convert(source: Path, out: Path) -> list[Path]:
    """Write the four files from folder `source` into folder `out`; an error leaves `out` as it was."""
    angles: list[int] = []
    columns: list[list[str]] = []
    for load, *_ in CONDITIONS:
        angle, pressure = read_source(source / f"pExpA{load}")
        if columns and angle != angles:
            raise ValueError(f"{source / f'pExpA{load}'}: crank angles differ from those of the other loads")
        angles = angle
        columns.append(pressure)
    names = [f"pressure_a{load}_bar" for load, *_ in CONDITIONS]
    rows = [",".join((str(angle), *row)) for angle, *row in zip(angles, *columns, strict=True)]
    traces = [",".join(("crank_angle_cad", *names)), *rows]
    conditions = ["file,load_percent,speed_rpm,trapped_mass_g,soi_cad"]
    conditions += [",".join(map(str, (name, *row))) for name, row in zip(names, CONDITIONS, strict=True)]
    content = {
        f"{STEM}_traces.csv": "\n".join(traces) + "\n",
        f"{STEM}_conditions.csv": "\n".join(conditions) + "\n",
        f"{STEM}_SOURCE.txt": SOURCE,
        f"{STEM}_LICENSE.txt": LICENSE,
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, text in content.items():
        (out / name).write_text(text, encoding="ascii", newline="\n")
    return [out / name for name in content]


def main() -> int:
    folder = os.environ.get("MGDD_DATA_DIR")
    default = Path(folder) / "libice_hd_diesel" if folder else None
    parser = argparse.ArgumentParser(description="Convert the measured heavy-duty diesel traces to CSV in bar.")
    parser.add_argument("--source", type=Path, default=default, help="folder that holds pExpA25 ... pExpA100")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(__file__).parents[1] / "python" / "mgdd" / "data",
        help="target folder",
    )
    arguments = parser.parse_args()
    if arguments.source is None:
        parser.error("give --source, or set MGDD_DATA_DIR to the folder above libice_hd_diesel")
    try:
        for file in convert(arguments.source, arguments.out):
            print(file)
    except (OSError, ValueError) as error:
        print(f"convert_hd_traces: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
