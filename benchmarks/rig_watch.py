"""One question: does the live page change how punctual the real-time loop is that it shows.

    python benchmarks/rig_watch.py [--rounds 6] [--seconds 10] [--period-ms 1]

One run of the simulated throttle of `mgdd rig watch`: in turns nobody looks, and a browser shows the page. Printed are
the quantiles of the loop's period, from one beginning of a cycle to the next, over all turns of either kind.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from support import machine

from mgdd.rig import read_record, watch

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "python" / "support"))
from browser import CHROMIUM, Browser

SHARES = (0.5, 0.99, 0.999)


def turns(options: argparse.Namespace, folder: Path) -> dict[str, list[tuple[int, int]]]:
    """Run, and give the stretches of either kind on the monotonic clock [ns]."""
    record, spans = folder / "run.rec", dict[str, list[tuple[int, int]]](alone=[], page=[])
    command = [sys.executable, "-m", "mgdd.rig.live.simulated", str(record), str(options.period_ms)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as rig:
        while not record.exists():
            time.sleep(0.1)
        time.sleep(5.0)
        for number in range(options.rounds):
            spans["alone"].append(stretch(options.seconds))
            with watch(record) as page, Browser(page.url, folder / str(number)) as browser:
                if not browser.shows("deadlines missed"):
                    raise SystemExit("the page shows no loop")
                time.sleep(2.0)
                spans["page"].append(stretch(options.seconds))
            time.sleep(2.0)
        rig.terminate()
    return spans


def stretch(seconds: float) -> tuple[int, int]:
    begin = time.monotonic_ns()
    time.sleep(seconds)
    return begin, time.monotonic_ns()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=6, help="turns of each kind (default 6)")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of a turn (default 10)")
    parser.add_argument("--period-ms", type=float, default=1.0, help="period of the loop (default 1)")
    options = parser.parse_args()
    if CHROMIUM is None:
        raise SystemExit("no chromium: tools/system_packages.sh browser")
    for name, words in machine.versions().items():
        print(f"{name}: {words}")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        spans = turns(options, Path(folder))
        run = read_record(Path(folder) / "run.rec")
    loop: Any = run.samples["loop"]
    begun_ms = loop["time_s"].to_numpy() * 1e3 + loop["lateness_us"].to_numpy() * 1e-3
    stamps = loop["time_s"].to_numpy()[1:] + run.header["monotonic_ns"] * 1e-9
    period_us, missed, found = np.diff(begun_ms) * 1e3, loop["missed"].to_numpy()[1:], {}
    print(f"load {os.getloadavg()[0]:.1f}")
    for kind, own in spans.items():
        inside = np.any([(stamps >= a * 1e-9) & (stamps < b * 1e-9) for a, b in own], axis=0)
        found[kind] = np.quantile(period_us[inside], SHARES)
        numbers = ", ".join(f"p{100 * s:g} {v:.1f} us" for s, v in zip(SHARES, found[kind], strict=True))
        print(f"{kind:6} {inside.sum()} periods: {numbers}, max {period_us[inside].max():.0f} us, missed "
              f"{int(missed[inside].sum())}")  # fmt: skip
    change = found["page"] / found["alone"] - 1.0
    print(
        "page against alone: "
        + ", ".join(f"p{100 * s:g} {100 * c:+.2f} %" for s, c in zip(SHARES, change, strict=True))
    )


if __name__ == "__main__":
    main()
