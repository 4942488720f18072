"""`mgdd map`: what is refused names field, value and remedy, in the words of the options, and writes nothing."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from map_cases import sweep as map_sweep
from map_cases import timing_table
from mgdd.cli import main
from mgdd.io.binary_files import write_netcdf
from mgdd.maps import CalibrationMap, optimize_map, write_map
from mgdd.surrogate import fit_response
from typed import Capsys, commands

_, refused = commands("map")

BENCH = """speed_rpm,fuel_mg,p_max_bar,flat_k
900,6,60,300
1500,12,75,300
2100,20,99,300
2700,9,66,300
3000,28,121,300
1200,25,112,300
"""


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one good file of each kind."""
    tmp_path = tmp_path_factory.mktemp("good")
    write_netcdf(map_sweep(), tmp_path / "table.nc")
    write_netcdf(map_sweep().isel(speed_rpm=0, fuel_mg=0, drop=True), tmp_path / "line.nc")
    best = optimize_map(map_sweep(), "efficiency_gross", limits={"p_max_bar": 140.0}, max_loss=1e-5)
    write_map(best, tmp_path / "best.nc")
    write_map(timing_table(), tmp_path / "holes.nc")
    write_map(CalibrationMap({"fuel_mg": [6.0, 40.0]}, [1.0, 2.0], name="rail_bar"), tmp_path / "rail.nc")
    write_map(CalibrationMap({"fuel_mg": [60.0, 80.0]}, [1.0, 2.0], name="rail_bar"), tmp_path / "far.nc")
    (tmp_path / "bench.csv").write_text(BENCH)
    columns = dict(
        zip(
            ("speed_rpm", "fuel_mg", "p_max_bar"),
            np.loadtxt(tmp_path / "bench.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2)).T,
            strict=True,
        )
    )
    model = fit_response(columns, "p_max_bar", degree=1).model
    (tmp_path / "p_max.toml").write_text(model.to_toml())
    (tmp_path / "design.csv").write_text("point,speed_rpm,fuel_mg\n0,900,6\n1,1500,50\n")
    return tmp_path


@pytest.fixture
def here(good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(shutil.copytree(good, tmp_path, dirs_exist_ok=True))
    return tmp_path


WORDS = {
    "RANGES": "--over speed_rpm=900:3000 --over fuel_mg=6:40",
    "GRID": "--over speed_rpm=1000:2000:3 --over fuel_mg=10,20",
    "P_MAX": "--response p_max_bar", "FACTORS": "--factors speed_rpm,fuel_mg", "BEST": "--maximize efficiency_gross",
}  # fmt: skip
# A command, and what its message says; behind => where nothing is feasible.
REFUSED = """
design -o plan.csv -> the following arguments are required: --over
design --over speed_rpm=900 --points 4 -o plan.csv -> --over speed_rpm=900: write NAME=LOW:HIGH, for example
design --over speed_rpm=3000:900 --points 4 -o plan.csv -> LOW and HIGH must be finite and LOW < HIGH
design --over speed_rpm=900:3000:1 --points 4 -o plan.csv -> N = 1: must be >= 2 levels
design RANGES --over fuel-mg=1:2 --points 4 -o plan.csv -> --over fuel_mg is given twice
design RANGES -o plan.csv -> --points = None: must be a whole number in [1, 1000000] for method 'sobol'
design RANGES --points 0 -o plan.csv -> --points = 0: must be a whole number
design RANGES --points 4 --model cubic -o plan.csv -> --model does not act here; --method sobol fits no
design RANGES --points 4 --preset puma_single -o plan.csv -> --preset does not act here; without --limit
design RANGES --points 4 --motored -o plan.csv -> --motored does not act here; without --limit
design RANGES --points 4 --limit p_max_bar=high -o plan.csv -> --limit p_max_bar=high: 'high' is not a number
design RANGES --points 4 --limit p_max_ba=9 -o plan.csv -> --limit = 'p_max_ba': must be a known name
design RANGES --points 4 --extend design.csv -o plan.csv -> --extend: fuel_mg = 50 of point 1: must be in [6, 40]
design RANGES --points 4 --extend designs.csv -o plan.csv -> did you mean 'design.csv'
design --over fuel_mg=0:60 --points 4 --extend design.csv -o design.csv -> the file of --extend; new points
design RANGES --points 4 -o plan.xlsx -> the ending must be one of .csv, .nc, .json
fit bench.csv P_MAX -> --factors is needed: which columns of bench.csv make p_max_bar
fit bench.csv --response p_max FACTORS -> bench.csv: no column 'p_max': did you mean 'p_max_bar'?
fit bench.csv P_MAX --factors p_max_bar,fuel_mg -> each name once, without the response p_max_bar
fit bench.csv P_MAX --factors fuel_mg, -> --factors fuel_mg,: each name once
fit bench.csv --response flat_k FACTORS -> flat_k is 300 at every point: nothing to fit
fit bench.csv P_MAX FACTORS --delimiter ; -> no column 'speed_rpm'
fit bench.csv P_MAX FACTORS --figure fit.gif -> --figure fit.gif: the ending must be one of
predict p_max.toml -> one of the arguments --over --points is required
predict p_max.toml --over speed_rpm=1000:2000:3 -> --over fuel_mg=LOW:HIGH:N is missing: the models need
predict p_max.toml GRID --over soc_cad=0:1:2 -> --over soc_cad: not a factor of the models: they have
predict p_max.toml p_max.toml GRID -> two files hold a model of p_max_bar: give one of each response
predict bench.csv GRID -> bench.csv: a model ends in .toml, as mgdd map fit -o model.toml writes it
optimize table.nc BEST --minimize p_max_bar -> not allowed with argument
optimize table.nc --maximize efficiency -> did you mean 'efficiency_gross'?
optimize table.nc BEST --along soi_cad -> name the swept input with --along
optimize line.nc BEST -> name the swept input with --along
optimize table.nc BEST --limit p_max=100 -> did you mean 'p_max_bar'?
optimize table.nc BEST --limit p_max_bar=60 => or pass --infeasible 'keep'
optimize table.nc BEST --limit p_max_bar=10 => no soc_cad keeps the limits in any cell
optimize table.nc BEST --sd nox_ppm=1 -> 'nox_ppm' is neither the objective nor limited
optimize bench.csv BEST -> a map is made of a table over a grid, which a CSV file does not keep: write it as netCDF
optimize table.nc BEST --limit p_max_bar=110 --infeasible keep -o b.dcm -> smooth the map with --fill
smooth best.nc --slope-limit fuel_mg -o smooth.nc -> --slope-limit fuel_mg: write NAME=NUMBER
smooth best.nc --slope-limit speed=1 -o smooth.nc -> slope_limits: no axis 'speed': did you mean 'speed_rpm'?
smooth best.nc --slope-limit fuel_mg=1e-4 -o smooth.nc => widen the ranges: a larger --max-loss, other limits
smooth rail.nc -o smooth.nc -> an optimum with --max-loss has one
smooth best.jsn -o smooth.nc -> no such file: did you mean 'best.nc'?
smooth p_max.toml -o smooth.nc -> give such an ending
show best.nc --contour -> --contour does not act here; it is a form of the picture
show best.nc --contour --figure a.png --column source -> contradict each other
show best.nc --column lowest -> --column lowest: the map has value, support, sd, low
show best.nc --name soi_cad -> best.nc: no variable 'soi_cad' over one or two axes: the Dataset has
show table.nc -> of a sweep make a map first, with optimize_map or mgdd map optimize
show rail.nc --sweep table.nc -> it does not belong to this map
show p_max.toml -> a map is written to and read from .nc, .csv, .dcm, .cdfx
diff rail.nc far.nc -> have nothing in common: pass --grid 'first'
diff best.nc holes.nc -o diff.csv -> the ending must be one of .nc, .json
export best.nc -> -o is needed: name the file to write
export -o a.nc -> no map: name a file, or a measured engine with --advisor
export best.nc rail.nc -o a.nc -> 2 maps fit into a .dcm or .cdfx only
export best.nc --label A -o a.nc -> --label does not act here; only a .dcm or .cdfx file
export best.nc --label A --label B -o a.dcm -> 2 for 1 maps: give one per map
export rail.nc far.nc -o a.dcm -> two maps would be called 'rail_bar' in a.dcm
export holes.nc -o a.dcm -> a DCM file needs all: smooth the map with --fill
export best.nc --advisor mercedes -o a.csv -> --advisor and best.nc contradict
"""


@pytest.mark.parametrize("line", REFUSED.strip().splitlines())
def test_what_is_refused_names_the_remedy_and_writes_nothing(line: str, here: Path, capsys: Capsys) -> None:
    command, arrow, message = line.partition(" => " if " => " in line else " -> ")
    for word, meant in WORDS.items():
        command = command.replace(word, meant)
    assert message in _refused(here, capsys, command, 3 if arrow == " => " else 2)


def _refused(here: Path, capsys: Capsys, command: str, code: int = 2) -> str:
    before = {file.name: file.read_bytes() for file in here.iterdir()}
    said = refused(capsys, *command.split(), code=code)
    assert {file.name: file.read_bytes() for file in here.iterdir()} == before
    return said


def test_a_list_of_points_is_not_a_grid(here: Path, capsys: Capsys) -> None:
    points = ["--points", "bench.csv", "-o", "list.nc"]
    (here / "bench.csv").write_text("speed_rpm,fuel_mg\n1000,10\n2000,20\n1500,11\n")
    assert main(["engine", "sweep", *points, "--quiet"]) == 0
    capsys.readouterr()
    said = _refused(here, capsys, f"optimize list.nc {WORDS['BEST']}")
    assert "list.nc: a list of 3 points, but a map needs a grid" in said
    assert "mgdd map predict" in said


def test_errors_are_json_where_that_is_asked(here: Path, capsys: Capsys) -> None:
    assert main(["map", "design", "--over", "fuel_mg=6:40", "--points", "0", "--json"]) == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert (error["type"], error["field"], error["value"]) == ("ParameterError", "--points", 0)
    best = WORDS["BEST"].split()
    assert main(["map", "optimize", str(here / "table.nc"), *best, "--limit", "p_max_bar=10", "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["error"]["type"] == "ConvergenceError"


def test_a_file_that_was_there_stays_as_it_was(here: Path, capsys: Capsys) -> None:
    """A command that fails after it has computed leaves the old file, and none half written beside it."""
    (here / "old.dcm").write_text("old")
    options = "--limit p_max_bar=110 --infeasible keep -o old.dcm"
    assert "value" in _refused(here, capsys, f"optimize table.nc {WORDS['BEST']} {options}")
    assert (here / "old.dcm").read_text() == "old"
