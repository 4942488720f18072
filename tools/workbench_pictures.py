"""Take the pictures of docs/workbench.md in Debian's Chromium: checks, cycles and a map.

Run `python tools/workbench_pictures.py [FOLDER]` with the package installed; they go to docs/_static. The record is 60
simulated cycles of `puma_single` whose timing scatters, with noise, and 6 bar too high.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mgdd.engine import simulate
from mgdd.rig.can.processes import Child

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "python" / "support"))
from browser import CHROMIUM, Browser  # noqa: E402

WIDTH = 1000
HEIGHTS = {"check": 900, "cycles": 1250, "map": 1730}  # pixels


def record(folder: Path) -> Path:
    """Write the record."""
    random = np.random.default_rng(1)
    runs = [simulate("puma_single", soc_cad=soc, step_cad=0.5) for soc in random.normal(-5.0, 0.7, 60)]
    angle = runs[0]["crank_angle_cad"].to_numpy()
    bar = [run["pressure_bar"].to_numpy() + 6.0 + random.normal(0.0, 0.02, angle.size) for run in runs]
    file = folder / "monday.csv"
    head = ",".join(["angle [deg]", *["p [bar]"] * len(bar)])
    np.savetxt(file, np.column_stack([angle, *bar]), delimiter=",", header=head, comments="", fmt="%.4f")
    return file


def take(page: Browser, name: str, folder: Path) -> None:
    """Take the picture of a page, once its figures stand."""
    time.sleep(2.0)
    page.call(
        "Emulation.setDeviceMetricsOverride", width=WIDTH, height=HEIGHTS[name], deviceScaleFactor=1, mobile=False
    )
    page.evaluate("document.querySelectorAll('*').forEach((one) => { one.scrollTop = 0 })")
    time.sleep(2.0)
    file = folder / f"workbench_{name}.png"
    page.screenshot(file)
    from PIL import Image

    Image.open(file).convert("RGB").quantize(256).save(file, optimize=True)


def main() -> None:
    """Drop the record, and take one picture after the other."""
    if CHROMIUM is None:
        raise SystemExit("no chromium: tools/system_packages.sh browser")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "_static"
    with tempfile.TemporaryDirectory() as name:
        child = Child("mgdd", "workbench", "--no-browser", "--quiet")
        try:
            with Browser(child.line, Path(name) / "profile", width=WIDTH, height=1600) as page:
                page.shows("Drop pressure files")
                time.sleep(2.0)
                page.choose("engine", "puma_single")
                page.upload(record(Path(name)))
                page.shows("IMEP [bar]")
                page.tab("Check")
                page.shows("checks made")
                take(page, "check", folder)
                page.click("Peg by two points")
                page.shows("pegging = two_point")
                page.tab("Cycles")
                page.click("Analyse")
                page.shows("Make the page")
                while page.count("canvas") < 7:
                    time.sleep(0.2)
                take(page, "cycles", folder)
                page.tab("Map")
                page.click("Seek the map")
                page.shows("Save map.nc")
                page.click("Sweep, optimise, smooth")
                page.shows("Save swept.nc")
                take(page, "map", folder)
        finally:
            child.stop()


if __name__ == "__main__":
    main()
