"""What objects show of themselves: a short text and an HTML table, with units, for every result, preset and model."""

import html
import re
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import xarray as xr

from mgdd import _core, datasets, presets
from mgdd.engine import Cylinder, NoxModel, OperatingPoint, Performance, SoftSensor, find_optimum
from mgdd.guide import FeedForward, ModelOptimum, OnlineCalibration, TimingMap
from mgdd.identify import OdeModel, check_excitation, fit_cylinder, validate_throttle
from mgdd.identify.throttle.automatic import fit_groups
from mgdd.identify.throttle.first_principle_model import FirstPrincipleModel
from mgdd.io import throttle_log
from mgdd.loop import SensorDynamics, VirtualEngine, run_seeker
from mgdd.maps import CalibrationMap
from mgdd.optimize import ExtremumSeeking, FitOptions, GoldenSection, Limit, tune
from mgdd.presets.preset import Preset
from mgdd.results.describe import Row, as_html, as_text, picture_of, rows_of
from mgdd.results.units import unit_of
from mgdd.signals import chirp
from mgdd.throttle import DemandChain, PseudoWiener, SensorPair, Throttle, simulate_throttle
from mgdd_studies.benchmarks.drive_axis import slide_model
from mgdd_studies.benchmarks.wiener_hammerstein import LinearFilter


def objects() -> dict[str, Callable[[], Any]]:

    def log() -> Any:
        signal = chirp(4.0, offset=0.01, amplitude=0.34, high_hz=5.0)
        run = simulate_throttle(Throttle(), signal["duty"], time_s=signal["time_s"])
        return throttle_log(run["time_s"], run["duty"], run["angle_deg"])

    seeking = {"start": -20.0, "bounds": (-30.0, 10.0)}
    return {
        "engine preset": lambda: presets.load("puma_single"),
        "throttle preset": lambda: presets.load("P1"),
        "cylinder": lambda: Cylinder(bore_mm=90.0),
        "point": lambda: OperatingPoint(trapped_mass_g=0.7),
        "throttle": lambda: Throttle(friction="stribeck", stiction_nm=0.3),
        "sensors": lambda: SensorPair(closed_v=0.4),
        "demand chain": lambda: DemandChain(bore_mm=52.0, leak_mm2=1.5),
        "pedal map": lambda: DemandChain().pedal_map,
        "NOx": NoxModel,
        "soft sensor": SoftSensor,
        "performance": Performance.efficiency_and_nox,
        "analyser": SensorDynamics,
        "limit": lambda: Limit(name="p_max_bar", upper=95.0),
        "bench": VirtualEngine,
        "online calibration": lambda: OnlineCalibration("puma_single"),
        "verdict": lambda: OnlineCalibration("puma_single").verdicts["wall_heat_scale"],
        "seeker": lambda: ExtremumSeeking(**seeking),
        "feed-forward": lambda: FeedForward(ExtremumSeeking(**seeking), lambda _: -5.0),
        "model optimum": lambda: ModelOptimum(Cylinder()),
        "timing map": lambda: TimingMap(CalibrationMap({"fuel_mg": [6.0, 20.0]}, -5.0, name="soc_cad")),
        "golden": lambda: GoldenSection(**seeking, noise_sd=0.2),
        "run": lambda: run_seeker(VirtualEngine(), ExtremumSeeking(**seeking), 300),
        "steady": lambda: VirtualEngine(limits=["p_max_bar"]).find_optimum({"p_max_bar": 95.0}),
        "optimum": lambda: find_optimum(Cylinder(), OperatingPoint()),
        "tuning": lambda: tune(0.25, -0.1, method="batch", distance=10.0, arrival=1.0),
        "pw_r": lambda: PseudoWiener("pw_r"),
        "pw_p": lambda: PseudoWiener("pw_p", {"plays": 8.0}),
        "first principle": FirstPrincipleModel,
        "ode": lambda: OdeModel(derivative=print, output=print, parameters={"tau_s": 1.0}, initial_state=(0.0,)),
        "drive": lambda: slide_model({"mass_kg": 95.0}, force_n_per_v=35.0),
        "filter": lambda: LinearFilter(4).model(np.ones(5), np.ones(5), 0.0, 0.0),
        "fit": lambda: fit_groups(log(), delays=[0.0], options=FitOptions(n_starts=1)),
        "report": lambda: fit_groups(log(), delays=[0.0], options=FitOptions(n_starts=1)).report,
        "validation": lambda: validate_throttle(FirstPrincipleModel(), log()),
        "check": lambda: check_excitation(chirp(4.0, offset=0.01, amplitude=0.34), Throttle()),
        "calibration": lambda: fit_cylinder(
            datasets.read("hd_diesel_128x144")[:1], presets.load("hd_diesel_128x144").cylinder
        ),
    }


class Tags(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        drawn = tag in ("svg", "polyline", "rect")  # the small picture
        assert drawn or all(name == "style" for name, _ in attrs)
        if tag != "br":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("name", objects())
def test_the_text_is_short_and_the_html_whole(name: str) -> None:
    thing = objects()[name]()
    lines = repr(thing).splitlines()
    assert 1 <= len(lines) <= 15
    assert max(map(len, lines)) <= 100
    assert "object at 0x" not in repr(thing)
    markup = thing._repr_html_()
    Tags(markup)
    assert type(thing).__name__ in markup or name in ("fit", "report", "calibration")
    assert "<td" in markup


def test_units_are_there() -> None:
    text, markup = repr(presets.load("P1")), presets.load("P1")._repr_html_()
    assert "preload_above_nm 0.396 N m" in text
    assert re.search(r"inertia_kgm2</th><td[^>]*>0\.0021</td><td[^>]*>kg m²</td>", markup)
    assert markup.count("<tr>") == len(Throttle.fields())
    assert "bore_mm 86 mm" in repr(presets.load("puma_single"))
    assert "% of p_max" in repr(objects()["calibration"]())


def test_many_and_long_rows_are_counted_and_cut() -> None:
    rows = [Row(f"a_rather_long_name_{i}", "123456", "N m s/rad") for i in range(100)]
    text = as_text("title", rows).splitlines()
    assert len(text) <= 15
    assert max(map(len, text)) <= 100
    assert re.fullmatch(r"  … and \d+ more", text[-1])
    shown = " ".join(text).count("a_rather_long_name_")
    assert text[-1] == f"  … and {100 - shown} more"
    assert "… and 40 more" in as_html("title", rows)
    long = as_text("t" * 300 + " end", [Row("x", "y " * 200)]).splitlines()
    assert max(map(len, long)) <= 100
    assert html.escape("<b> & 'c'") in as_html("<b> & 'c'", [])


def test_the_html_shows_a_few_rows_a_fold_and_a_small_picture() -> None:
    rows = [Row(f"name_{i}", str(i)) for i in range(47)]
    seen, fold = as_html("title", rows).split("<details>")
    assert (seen.count("<tr>"), fold.count("<tr>")) == (8, 39)
    assert "<details>" not in as_html("title", rows[:10])
    markup = objects()["run"]()._repr_html_()
    Tags(markup)
    picture = markup.split("<svg")[1].split("</svg>")[0]
    assert len(picture) < 6000
    assert 100 <= picture.count(",") <= 200
    assert "<svg" not in objects()["optimum"]()._repr_html_()


def test_a_map_shows_its_cells_and_no_name_is_markup() -> None:
    axes = {"speed_rpm": [900, 1500, 3000], "fuel_mg": [6, 20]}
    known = CalibrationMap(
        axes, [[-1, -4], [-2, -6], [-5, -9]], name="soc_cad", provenance={"from": "<b>bench</b> & 7"}
    )
    markup = known._repr_html_()
    Tags(markup)
    assert markup.count("<rect") == 6
    assert "x='0' y='25' width='80' height='25' fill='rgb(254,232,56)'" in markup  # least speed and fuel: the latest
    assert "soc_cad over speed_rpm and fuel_mg" in markup
    assert "&lt;b&gt;bench&lt;/b&gt; &amp; 7" in markup
    curve = CalibrationMap({"fuel_mg": [6, 8, 20]}, [-1, -2, -8], name="soc_cad")._repr_html_()
    assert "points='0,4.0 34,10.0 240,46.0'" in curve
    odd = xr.Dataset({"<i>x</i>": ("a<b", np.arange(20.0))})
    assert "&lt;i&gt;x&lt;/i&gt; over a&lt;b" in picture_of(odd)
    assert "<i>" not in picture_of(odd)
    assert "<svg" not in objects()["timing map"]()._repr_html_()  # the same everywhere


def test_rows_know_units_arrays_and_what_is_missing() -> None:
    rows = rows_of(
        {
            "tau_s": 0.1234567891, "p_max_bar": np.float64(95.0), "on": True, "none_deg": None, "gone_mm": float("nan"),
            "grid": np.zeros((3, 4)), "pair": (1.0, 2.5), "words": ("a",), "nothing": (), "map": {"a_s": 1, "b_m": 2},
            "parameters": {"mass_kg": 95.0}, "gain_percent": {"x.csv": 1.5}, "own": 3.0,
        },
        {"own": "furlong"},
    )  # fmt: skip
    assert rows == [
        Row("tau_s", "0.123457", "s"), Row("p_max_bar", "95", "bar"), Row("on", "yes"), Row("none_deg", "–"),
        Row("gone_mm", "–"), Row("grid", "0 (3 × 4)"), Row("pair", "1, 2.5"), Row("words", "a"),
        Row("nothing", "none"), Row("map.a_s", "1", "s"), Row("map.b_m", "2", "m"), Row("mass_kg", "95", "kg"),
        Row("gain_percent.x.csv", "1.5", "%"), Row("own", "3", "furlong"),
    ]  # fmt: skip


def test_names_end_in_their_unit() -> None:
    wrong = {
        f"{kind.__name__}.{name}": (unit_of(name), info["unit"])
        for kind in (Cylinder, OperatingPoint, Throttle)
        for name, info in kind.fields().items()
        if unit_of(name) != info["unit"]
    }
    # Their own field says it: differences of angles, symbols of formulas, and units that nothing else has.
    assert set(wrong) <= {
        "Cylinder.burn_duration_ref_cad", "Cylinder.second_delay_cad", "Cylinder.second_duration_cad",
        "Cylinder.ignition_c0_cad", "Cylinder.gamma_linear_300k", "Cylinder.gamma_polynomial_c2_per_k2",
        "Cylinder.woschni_cp_m_per_sk", "Cylinder.wiebe_a", "Cylinder.wiebe_m", "Cylinder.second_wiebe_m",
        "OperatingPoint.burn_duration_cad",
    }, wrong  # fmt: skip
    for kind in ("pw_r", "pw_w", "pw_p"):
        units = _core.throttle.pseudo_wiener_units(kind)
        assert {name: unit_of(name) for name in units} == dict(units)
    assert isinstance(presets.load("P1"), Preset)
