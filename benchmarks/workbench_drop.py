"""One question: how long after a file of 60 cycles is dropped on the workbench is there a picture, and a verdict.

    python benchmarks/workbench_drop.py [--rounds 5]

A record of 60 cycles and 1440 angles (CSV, 1.6 MB) goes into Debian's Chromium by its upload; each round has a window
of its own. Printed are wall times until the figure has been drawn and until the verdict stands there, processor time
of server and worker, and the load of the machine. The first round comes two seconds after the server is ready.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from support import machine

from mgdd.rig.can.processes import Child

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "python" / "support"))
from browser import CHROMIUM, Browser
from pressure_files import CYCLES, FULL, writer_in

ENGINE = "hd_diesel_128x144"
# Whether a figure has been drawn, and whether the table of files has its verdict.
_SEEN = """(() => { const models = [...Bokeh.documents[0]._all_models.values()], view = (one) =>
  Bokeh.index.find_one_by_id(one.id); return [
  models.some((one) => one.type == 'Figure' && view(one) && view(one).has_finished()),
  models.some((one) => typeof one.text == 'string' && one.text.includes('badge doubt')
    && one.text.includes('drifted.csv'))]; })()"""


def processes_below(root: int) -> list[int]:
    """Give a process and those that it began, as they are now."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended
            continue
    found = [root]
    for process in found:
        found += [each for each, parent in parents.items() if parent == process]
    return found


def processor_s(root: int) -> float:
    """Give the processor time of a process and all that it has begun, those that have ended too."""
    ticks = 0
    for process in processes_below(root):
        try:
            ticks += sum(map(int, Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:15]))
        except OSError:
            continue
    return ticks / os.sysconf("SC_CLK_TCK")


def drop(address: str, file: Path, folder: Path, server: int) -> tuple[float, float, float]:
    """Drop the file in a new window; give the seconds to picture and verdict, and processor time."""
    with Browser(address, folder, height=1800) as page:
        page.shows("Drop pressure files")
        time.sleep(2.0)
        page.choose("engine", ENGINE)
        time.sleep(1.0)
        before, begun = processor_s(server), time.perf_counter()
        page.upload(file)
        seen: list[float] = [0.0, 0.0]
        while not all(seen) and time.perf_counter() < begun + 60.0:
            for place, there in enumerate(page.evaluate(_SEEN) or ()):
                if there and not seen[place]:
                    seen[place] = time.perf_counter() - begun
            time.sleep(0.02)
        return seen[0], seen[1], processor_s(server) - before


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    if CHROMIUM is None:
        sys.exit("no chromium: tools/system_packages.sh browser")
    for what, words in machine.versions().items():
        print(f"{what}: {words}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bar = CYCLES[0] * (1.0 + 0.01 * np.random.default_rng(1).standard_normal((60, 1))) + 6.0
        file = writer_in(folder)([FULL, *bar], "angle," + ",".join(["p [bar]"] * len(bar)), "drifted.csv")
        child = Child("mgdd", "workbench", "--no-browser", "--quiet")
        try:
            print(f"{'round':>5} {'picture [s]':>12} {'verdict [s]':>12} {'processor [s]':>14} {'load of 1 min':>14}")
            for k in range(options.rounds):
                times = drop(child.line, file, folder / f"profile{k}", child.process.pid)
                print(f"{k + 1:>5} {times[0]:>12.2f} {times[1]:>12.2f} {times[2]:>14.2f} {os.getloadavg()[0]:>14.2f}")
        finally:
            child.stop()


if __name__ == "__main__":
    main()
