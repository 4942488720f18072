"""Figures by structure: units on the axes, the Dataset's own numbers on the lines, given axes respected."""

import itertools
from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mgdd import datasets, plot
from mgdd.errors import DataError
from mgdd.guide import FeedForward
from mgdd.loop import LoopCriteria, VirtualEngine, run_seeker
from mgdd.optimize import ExtremumSeeking
from mgdd.plot.calibration import calibration_overlay, wall_heat_profile
from mgdd.results.labels import ANGLE, labelled_dataset

CAD = np.arange(-120.0, 121.0)
LITRE = 0.1 + 0.9 * (1.0 - np.cos(np.radians(CAD)))
BAR = 3.0 * LITRE**-1.35 + 60.0 * np.exp(-((CAD - 12.0) ** 2) / 400.0)
RATE = 200.0 * np.exp(-((CAD - 8.0) ** 2) / 100.0)
WAVE = 0.5 * np.sin(CAD / 9.0)
SOC = np.linspace(-20.0, 10.0, 7)


def simulated():
    return labelled_dataset({
        ANGLE: (ANGLE, CAD), "pressure_bar": (ANGLE, BAR), "volume_l": (ANGLE, LITRE),
        "motored_pressure_bar": (ANGLE, 3.0 * LITRE**-1.35), "heat_release_j_per_cad": (ANGLE, RATE),
    })  # fmt: skip


def analysed():
    return labelled_dataset({
        ANGLE: (ANGLE, CAD), "pressure_bar": (ANGLE, BAR), "volume_l": (ANGLE, LITRE),
        "heat_release_net_j_per_cad": (ANGLE, RATE), "heat_release_gross_j_per_cad": (ANGLE, 1.1 * RATE),
        "n_compression": ((), 1.35), "n_expansion": ((), 1.31),
    })  # fmt: skip


def overlay():
    return labelled_dataset(
        {
            ANGLE: (ANGLE, CAD), "measured_bar": (ANGLE, BAR), "model_bar": (ANGLE, BAR + WAVE),
            "residual_bar": (ANGLE, WAVE), "rmse_percent": ((), 0.71),
            "imep_closed_error_percent": ((), -1.04), "soc_cad": ((), -3.4), "soi_cad": ((), -2.0),
        },
        attrs={"file": "a100.csv", "burn": "double_wiebe"},
    )  # fmt: skip


def profile():
    rmse = [[0.30, 0.21, 0.20, 0.33], [0.28, 0.22, 0.21, 0.30]]
    return labelled_dataset({
        "wall_heat_scale": ("wall_heat_scale", [0.0, 0.5, 1.0, 2.0]),
        "file": ("file", ["a25", "a100"], "-", "trace"), "rmse_percent": (("file", "wall_heat_scale"), rmse),
    })  # fmt: skip


def sweep(efficiency=None):
    values = 0.56 - 2e-4 * (SOC + 5.7) ** 2 if efficiency is None else efficiency
    return labelled_dataset({
        "soc_cad": ("soc_cad", SOC), "efficiency_gross": ("soc_cad", values),
        "nox_affine_log_ppm": ("soc_cad", 1200.0 * np.exp(-SOC / 20.0)),
        "nox_arrhenius_ppm": ("soc_cad", 1300.0 * np.exp(-SOC / 22.0)),
    })  # fmt: skip


CYCLE = np.arange(300)
NEAR = -6.0 - 9.0 * np.exp(-CYCLE / 40.0)


def sought():
    return labelled_dataset(
        {
            "cycle": ("cycle", CYCLE), "j": ("cycle", 56.0 - 0.02 * (NEAR + 6.0) ** 2),
            "input": ("input", ["soc_cad"], "-", "input"),
            "estimate": (("cycle", "input"), NEAR[:, np.newaxis], "unit of the input", "estimate"),
            "asked": (("cycle", "input"), (NEAR + np.sin(CYCLE))[:, np.newaxis], "unit of the input", "asked for"),
            "nox_soft_ppm": ("cycle", 1500.0 - 30.0 * (NEAR + 6.0)),
            "limit": ("limit", ["p_max_bar", "t_max_k"], "-", "limited quantity"),
            "limit_units": ("limit", ["bar", "K"], "-", "unit of the limit"),
            "limits": (("cycle", "limit"), np.column_stack([90.0 - NEAR, 1900.0 - NEAR]), "unit of the limit", "value"),
        },
        attrs={"nox_sensor": "soft"},
    ).set_coords("limit_units")  # fmt: skip


def readings(over="cycle"):
    axis = {"cycle": CYCLE.astype(float), "soc_cad": SOC, "t_max_k": 1900.0 + 10.0 * SOC}[over]
    names = ("true", "analyser", "fast", "soft", "soft_corrected")
    return labelled_dataset({
        over: (over, axis), **{f"nox_{name}_ppm": (over, 900.0 + axis + k) for k, name in enumerate(names)},
    })  # fmt: skip


def followed():
    """A step that is followed badly: the reference, the angle and their difference are three different lines."""
    return labelled_dataset({
        "time_s": ("time_s", [0.0, 0.1, 0.3], "s", "time"),
        "reference_deg": ("time_s", [20.0, 60.0, 60.0], "degree", "reference"),
        "angle_deg": ("time_s", [19.0, 25.0, 63.0], "degree", "plate angle"),
        "duty": ("time_s", [0.2, 0.9, 0.4], "-", "duty"),
    })  # fmt: skip


PLOTS = {
    "throttle under control": (plot.throttle_run, followed),
    "throttle": (plot.throttle_run, lambda: followed().drop_vars("reference_deg")),
    "seeking": (plot.seeking, sought),
    "sensors over cycles": (plot.sensors, readings),
    "sensors over timing": (plot.sensors, lambda: readings("soc_cad")),
    "pressure of a simulation": (plot.pressure, simulated),
    "pressure of an analysis": (plot.pressure, analysed),
    "pressure of a measurement": (plot.pressure, lambda: datasets.read("hd_diesel_128x144")[3]),
    "log p-V": (partial(plot.pressure, log_pv=True), analysed),
    "overlay": (calibration_overlay, overlay),
    "profile": (wall_heat_profile, profile),
    "timing": (plot.timing, sweep),
}


def line(ax, label):
    found = [item for item in ax.get_lines() if item.get_label() == label]
    assert len(found) == 1, [item.get_label() for item in ax.get_lines()]
    return found[0]


def twin_of(ax):
    return next(other for other in ax.figure.axes if other is not ax)


def entries(ax):
    return [item.get_text() for item in ax.get_legend().get_texts()]


@pytest.mark.parametrize("name", PLOTS)
def test_given_axes_are_used_and_no_figure_is_opened(name):
    function, dataset = PLOTS[name]
    figure, (left, right) = plt.subplots(1, 2)
    before = plt.get_fignums()
    assert function(dataset(), ax=right) is right
    assert plt.get_fignums() == before
    assert not left.has_data()
    figure.canvas.draw()


@pytest.mark.parametrize("name", PLOTS)
def test_one_figure_with_units_on_every_axis(name):
    function, dataset = PLOTS[name]
    data = dataset()
    untouched = data.copy(deep=True)
    ax = function(data)
    assert plt.get_fignums() == [ax.figure.number]
    assert data.identical(untouched)
    for axes in ax.figure.axes:
        assert "[" in axes.get_ylabel()
        assert axes.get_ylabel().endswith("]")
    assert any(axes.get_xlabel().endswith("]") for axes in ax.figure.axes)
    assert len(entries(ax)) == len(set(entries(ax))) >= 1


@pytest.mark.parametrize("name", PLOTS)
def test_nothing_written_overlaps(name):
    function, dataset = PLOTS[name]
    ax = function(dataset())
    ax.figure.canvas.draw()
    renderer = ax.figure.canvas.get_renderer()
    written = [ax.get_legend(), *ax.texts]
    for axes in ax.figure.axes:
        written += [axes.xaxis.label, axes.yaxis.label]
    boxes = [item.get_window_extent(renderer) for item in written if getattr(item, "get_text", lambda: "x")()]
    for index, box in enumerate(boxes):
        assert ax.figure.bbox.fully_overlaps(box)
        assert box.x0 >= -1.0
        assert box.y0 >= -1.0
        assert box.y1 <= ax.figure.bbox.y1 + 1.0
        assert not any(box.fully_overlaps(other) for other in boxes[index + 1 :])


@pytest.mark.parametrize("name", PLOTS)
def test_lines_are_told_apart_without_colour(name):
    function, dataset = PLOTS[name]
    ax = function(dataset())
    looks = [
        (item.get_linestyle(), item.get_marker(), round(item.get_linewidth(), 1))
        for axes in ax.figure.axes
        for item in axes.get_lines()
        if not item.get_label().startswith("_")
    ]
    assert len(looks) == len(set(looks))


def test_pressure_shows_the_numbers_of_the_dataset():
    ax = plot.pressure(simulated())
    assert ax.get_xlabel() == "crank angle [°CA aTDC]"
    assert ax.get_ylabel() == "cylinder pressure [bar]"
    np.testing.assert_array_equal(line(ax, "cylinder pressure").get_data(), [CAD, BAR])
    motored = line(ax, "motored pressure")
    assert motored.get_linestyle() == "--"
    np.testing.assert_array_equal(motored.get_ydata(), 3.0 * LITRE**-1.35)
    twin = twin_of(ax)
    assert twin.get_ylabel() == "heat release rate [J/°CA]"
    np.testing.assert_array_equal(line(twin, "heat release rate").get_data(), [CAD, RATE])
    assert entries(ax) == ["cylinder pressure", "motored pressure", "heat release rate"]


def test_pressure_of_an_analysis_has_net_and_gross():
    twin = twin_of(plot.pressure(analysed()))
    np.testing.assert_array_equal(line(twin, "net heat release rate").get_ydata(), RATE)
    np.testing.assert_array_equal(line(twin, "gross heat release rate").get_ydata(), 1.1 * RATE)


def test_pressure_of_a_measurement_is_named_and_alone():
    ax = plot.pressure(datasets.read("hd_diesel_128x144")[0])
    assert entries(ax) == ["cylinder pressure, pressure_a25_bar"]
    assert ax.figure.axes == [ax]


def test_log_pv_slopes():
    ax = plot.pressure(analysed(), log_pv=True)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    np.testing.assert_array_equal(line(ax, "cylinder pressure").get_data(), [LITRE, BAR])
    fitted = {"compression n = 1.350 (−100 to −40 °CA aTDC)": 1.35, "expansion n = 1.310 (60 to 120 °CA aTDC)": 1.31}
    for label, exponent in fitted.items():
        volume, bar = line(ax, label).get_data()
        assert -np.diff(np.log(bar)) / np.diff(np.log(volume)) == pytest.approx(exponent)
    without = plot.pressure(analysed().drop_vars(["n_compression", "n_expansion"]), log_pv=True)
    assert len(without.get_lines()) == 1


def test_a_pure_polytrope_lies_on_its_slope():
    data = analysed().assign(pressure_bar=(ANGLE, 3.0 * LITRE**-1.35, analysed()["pressure_bar"].attrs))
    volume, bar = line(plot.pressure(data, log_pv=True), "compression n = 1.350 (−100 to −40 °CA aTDC)").get_data()
    np.testing.assert_allclose(bar, 3.0 * volume**-1.35, rtol=1e-12)


def test_overlay_and_its_residual_panel():
    data = overlay()
    ax = calibration_overlay(data)
    panel = ax.figure.axes[-1]
    np.testing.assert_array_equal(line(ax, "measured").get_data(), [CAD, BAR])
    np.testing.assert_array_equal(line(ax, "model, double Wiebe").get_ydata(), data["model_bar"])
    np.testing.assert_array_equal(panel.get_lines()[0].get_data(), [CAD, data["residual_bar"]])
    assert panel.get_xlabel() == "crank angle [°CA aTDC]"
    assert panel.get_xlim() == ax.get_xlim() == (-120.0, 120.0)
    assert panel.get_position().y1 < ax.get_position().y0
    assert entries(ax)[2:] == ["start of injection −2.0", "start of combustion −3.4"]
    assert ax.texts[0].get_text() == "a100.csv\nRMSE 0.71 % of p_max\nclosed IMEP −1.0 %"


def test_overlay_without_soi_and_on_free_axes():
    data = overlay().assign(soi_cad=((), np.nan, overlay()["soi_cad"].attrs))
    free = plt.figure().add_axes((0.2, 0.2, 0.7, 0.6))
    ax = calibration_overlay(data, ax=free)
    assert not any("injection" in entry for entry in entries(ax))
    assert ax.figure.axes[-1].get_position().y0 == pytest.approx(0.2)


def test_profile_marks_what_the_traces_cannot_tell_apart():
    data = profile()
    ax = wall_heat_profile(data)
    for index, name in enumerate(("a25", "a100")):
        expected = [data["wall_heat_scale"], data["rmse_percent"][index]]
        np.testing.assert_array_equal(line(ax, name).get_data(), expected)
    assert entries(ax)[-1] == "within 10 % of the best"
    together = np.sqrt((data["rmse_percent"].to_numpy() ** 2).mean(axis=0))
    band = ax.patches[0].get_extents().transformed(ax.transData.inverted())
    ends = np.interp([band.x0, band.x1], data["wall_heat_scale"], together)
    np.testing.assert_allclose(ends, 1.1 * together.min(), rtol=5e-3)
    single = wall_heat_profile(data.isel(file=0, drop=True))
    assert entries(single)[0] == "best fit"


def test_timing_marks_the_optimum():
    ax = plot.timing(sweep())
    twin = twin_of(ax)
    assert ax.get_xlabel() == "start of combustion [°CA aTDC]"
    np.testing.assert_array_equal(line(ax, "gross indicated efficiency").get_data(), [SOC, sweep()["efficiency_gross"]])
    for name, label in (("nox_affine_log_ppm", "affine-log"), ("nox_arrhenius_ppm", "Arrhenius")):
        np.testing.assert_array_equal(line(twin, f"NOx proxy, {label} map").get_ydata(), sweep()[name])
    best, top = line(ax, "best: 0.5600 at −5.7 °CA aTDC").get_data()
    np.testing.assert_allclose([*best, *top], [-5.7, 0.56], rtol=1e-12)


def test_timing_says_when_the_sweep_ends_too_early():
    ax = plot.timing(sweep(efficiency=0.5 + 1e-3 * SOC))
    assert "best at the end of the sweep: 0.5100 at 10.0 °CA aTDC" in entries(ax)


@pytest.mark.parametrize(
    ("function", "dataset", "variable", "maker"),
    [
        (plot.pressure, simulated, "pressure_bar", "mgdd.io.read_pressure or mgdd.engine.simulate"),
        (partial(plot.pressure, log_pv=True), simulated, "volume_l", "mgdd.engine.analyze or mgdd.engine.simulate"),
        (calibration_overlay, overlay, "residual_bar", "mgdd.identify.fit_cylinder"),
        (wall_heat_profile, profile, "rmse_percent", "mgdd.identify.wall_heat_profile"),
        (plot.timing, sweep, "nox_arrhenius_ppm", "mgdd.engine.timing_sweep"),
        (plot.seeking, sought, "asked", "mgdd.loop.run_seeker"),
        (plot.sensors, readings, "nox_true_ppm", "mgdd.loop.VirtualEngine.run"),
        (plot.throttle_run, followed, "angle_deg", "mgdd.throttle.simulate_throttle"),
    ],
)
def test_a_missing_variable_is_named_with_its_maker(function, dataset, variable, maker):
    with pytest.raises(DataError, match=f"no variable '{variable}': {maker} makes it; this one has "):
        function(dataset().drop_vars(variable))
    assert plt.get_fignums() == []


def test_a_variable_without_unit_is_refused():
    data = simulated()
    del data["motored_pressure_bar"].attrs["units"]
    with pytest.raises(DataError, match="motored_pressure_bar has no units"):
        plot.pressure(data)
    assert plt.get_fignums() == []


def test_values_that_cannot_be_drawn_are_refused():
    relative = analysed().assign(pressure_bar=analysed()["pressure_bar"] - 5.0)
    relative["pressure_bar"].attrs = analysed()["pressure_bar"].attrs
    with pytest.raises(DataError, match=r"pressure_bar = .* at -120 °CA aTDC: a logarithm needs > 0; peg"):
        plot.pressure(relative, log_pv=True)
    with pytest.raises(DataError, match=r"soc_cad has shape \(2,\): at least three timings"):
        plot.timing(sweep().isel(soc_cad=slice(2)))
    with pytest.raises(DataError, match="rmse_percent has dimensions"):
        wall_heat_profile(profile().assign(rmse_percent=profile()["rmse_percent"].isel(wall_heat_scale=0)))


def test_seeking_has_four_panels_in_order():
    caps = {"p_max_bar": 100.0}
    ax = plot.seeking(sought(), optimum_cad=-6.0, limit_values=caps)
    panels = ax.figure.axes
    assert [panel.get_ylabel() for panel in panels] == [
        "soc_cad [°CA aTDC]", "J [unit of J]", "NOx,\nsoft sensor [ppm]", "limited [bar, K]",
    ]  # fmt: skip
    assert all(upper.get_position().y0 > lower.get_position().y1 for upper, lower in itertools.pairwise(panels))
    np.testing.assert_array_equal(line(ax, "estimate").get_data(), [CYCLE, NEAR])
    np.testing.assert_array_equal(line(ax, "with dither").get_ydata(), sought()["asked"][:, 0])
    np.testing.assert_array_equal(line(panels[3], "limit p_max_bar 100").get_ydata(), [100.0, 100.0])
    assert "optimum −6.00" in entries(ax)
    mean = line(panels[1], "mean of 50 cycles").get_ydata()
    j = sought()["j"].to_numpy()
    assert mean[[0, 9, 200]] == pytest.approx([j[0], j[:10].mean(), j[151:201].mean()])


def test_seeking_shows_the_slope_or_leaves_panels_out():
    with_slope = sought().assign(gradient_per_cad=("cycle", NEAR, {"units": "%/°CA", "long_name": "slope"}))
    assert plot.seeking(with_slope).figure.axes[2].get_ylabel() == "slope [%/°CA]"
    bare = sought().drop_dims("limit").assign_attrs(nox_sensor="none")
    assert len(plot.seeking(bare).figure.axes) == 2
    free = plt.figure().add_axes((0.2, 0.2, 0.7, 0.6))
    assert plot.seeking(sought(), ax=free) is free
    assert len(free.figure.axes) == 4
    misfired = sought()
    misfired["j"][7] = np.nan
    assert np.isfinite(line(plot.seeking(misfired).figure.axes[1], "mean of 50 cycles").get_ydata()).all()
    with pytest.raises(DataError, match="limit_values: 'torque' was not measured"):
        plot.seeking(sought(), limit_values={"torque": 3.0})


def test_sensors_over_cycles_timing_and_temperature():
    for over in ("cycle", "soc_cad", "t_max_k"):
        data = readings(over)
        ax = plot.sensors(data)
        analyser = line(ax, "analyser")
        np.testing.assert_array_equal(analyser.get_data(), [data[over], data["nox_analyser_ppm"]])
        assert (analyser.get_marker() == "None") == (over == "cycle")
        assert set(entries(ax)) == {
            "true value", "analyser", "fast sensor", "soft sensor", "soft sensor held to the analyser",
        }  # fmt: skip
    wrong = readings().rename(cycle="seed")
    with pytest.raises(DataError, match="must be one of cycle, soc_cad"):
        plot.sensors(wrong)


# --- a throttle ---------------------------------------------------------------------------------------------
def test_a_run_with_a_reference_shows_it_and_the_error() -> None:
    ax = plot.throttle_run(followed())
    assert entries(ax) == ["reference", "plate angle"]
    assert line(ax, "reference").get_ydata().tolist() == [20.0, 60.0, 60.0]
    panels = {other.get_ylabel(): other for other in ax.figure.axes}
    assert list(panels) == ["plate angle [deg]", "error [deg]", "duty [-]"]
    assert panels["error [deg]"].get_lines()[0].get_ydata().tolist() == [1.0, 35.0, -3.0]


def test_a_run_without_a_reference_shows_what_is_there() -> None:
    run = followed().drop_vars("reference_deg").assign(current_a=("time_s", [1.0, 2.0, 3.0], {"units": "A"}))
    run["current_a"].attrs["long_name"] = "motor current"
    ax = plot.throttle_run(run)
    assert [other.get_ylabel() for other in ax.figure.axes] == ["plate angle [deg]", "duty [-]", "motor current [A]"]


# --- what a run knows ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("guided", [False, True], ids=["loop of the core", "loop in Python"])
def test_a_run_that_knows_its_optimum_and_limit_shows_them(guided: bool) -> None:
    seeker = ExtremumSeeking(start=-8.0, bounds=(-30.0, 10.0), limits={"p_max_bar": 104.0})
    loop = FeedForward(seeker, lambda _: -8.0) if guided else seeker
    bench = VirtualEngine(seed=1, limits=["p_max_bar"], nox_sensor="none")
    run = run_seeker(bench, loop, 60, criteria=LoopCriteria(optimum=-3.25))
    ax = plot.seeking(run)
    assert line(ax, "optimum −3.25").get_ydata()[0] == -3.25
    limited = ax.figure.axes[-1]
    assert line(limited, "limit p_max_bar 104").get_ydata()[0] == 104.0
    assert sum(item.get_label().startswith("limit ") for item in limited.get_lines()) == 1
    assert "optimum −4.00" in entries(plot.seeking(run, optimum_cad=-4.0))
