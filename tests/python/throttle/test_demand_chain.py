"""The demand chain from Python: facts of an independent program, files and copies, refusals, equations over arrays."""

import copy
import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from mgdd.cli import main
from mgdd.control import Pid, SlidingMode
from mgdd.errors import DataError, ParameterError, ShapeError
from mgdd.loop import simulate_drive
from mgdd.results.labels import check_labels
from mgdd.throttle import DemandChain, PedalMap, SensorPair, Throttle
from mgdd.throttle.characteristics import airflow_torque_nm

ODD = DemandChain(
    displacement_l=1.62, volumetric_efficiency=0.91, manifold_l=2.3, manifold_temperature_k=323.0, ambient_kpa=96.4,
    ambient_temperature_k=287.0, indicated_efficiency=0.36, bore_mm=52.0, shaft_mm=9.0, plate_closed_deg=11.0,
    leak_mm2=1.5, discharge_20=0.71, pressure_lag_s=0.03,
    pedal_map=PedalMap(pedal_percent=[0, 30, 100], speed_rpm=[900, 5500], wanted_nm=[[-4, -9], [35, 21], [101, 88]]),
)  # fmt: skip


def test_numbers_of_an_independent_program() -> None:
    chain = DemandChain(leak_mm2=0.0, discharge_pressure_loss=0.0)
    angle = np.array([2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0])
    area = [12.081, 36.622, 94.458, 271.83, 526.66, 1036.12, 1663.86, 2348.86]
    np.testing.assert_allclose(chain.area_mm2(angle), area, rtol=1e-4)
    air = float(chain.cylinder_g_per_s(40.0, 2000.0))
    assert air == pytest.approx(12.736, rel=1e-4)
    assert float(chain.filling_time_s(2000.0)) == pytest.approx(0.1059, rel=5e-4)
    opening = float(chain.opening_deg(air, 40.0))
    discharge = np.interp(opening, [5.0, 20.0, 45.0, 90.0], [0.65, 0.75, 0.85, 0.9])
    assert discharge * float(chain.area_mm2(opening)) == pytest.approx(53.70, rel=1e-4)


@pytest.mark.parametrize("chain", [DemandChain(), ODD], ids=["default", "odd"])
def test_files_dicts_and_copies_are_exact(chain: DemandChain) -> None:
    assert DemandChain.from_toml(chain.to_toml()) == chain
    assert DemandChain(**chain.to_dict()) == chain
    for twin in (copy.deepcopy(chain), pickle.loads(pickle.dumps(chain)), chain.replace()):
        assert twin == chain
        assert type(twin) is DemandChain
        assert hash(twin) == hash(chain)
    assert eval(repr(chain), {"DemandChain": DemandChain, "PedalMap": PedalMap}) == chain
    assert chain.replace(leak_mm2=4.0) != chain
    assert PedalMap(**chain.pedal_map.to_dict()) == chain.pedal_map


def test_every_field_of_a_file_counts() -> None:
    assert DemandChain.from_toml(ODD.to_toml()).to_dict() == ODD.to_dict()
    for name, field in DemandChain.fields().items():
        if name != "pedal_map":
            assert {"unit", "lower", "upper", "meaning", "default"} <= set(field), name
    text = ODD.to_toml()
    with pytest.raises(DataError, match="bore_mm"):
        DemandChain.from_toml("\n".join(line for line in text.splitlines() if not line.startswith("bore_mm")))
    with pytest.raises(ParameterError, match="unit"):
        DemandChain.from_toml(text.replace('unit = "L"', 'unit = "m³"'))
    with pytest.raises(ParameterError, match="wanted_nm"):
        DemandChain.from_toml(text.replace("[-4.0, -9.0]", "[-4.0]"))


def test_a_refused_value_names_itself() -> None:
    for change, field in (
        ({"bore_mm": -1.0}, "bore_mm"),
        ({"shaft_mm": 60.0}, "shaft_mm"),
        ({"discharge_90": 0.5}, "discharge_90"),
        ({"manifold_l": math.nan}, "manifold_l"),
    ):
        with pytest.raises(ParameterError) as error:
            DemandChain(**change)
        assert error.value.field == field
        with pytest.raises(ParameterError):
            DemandChain().replace(**change)
    with pytest.raises(ParameterError, match="did you mean 'bore_mm'"):
        DemandChain().replace(bore=52.0)
    with pytest.raises(ParameterError, match="PedalMap"):
        DemandChain().replace(pedal_map=3.0)
    good = {"pedal_percent": [0, 50], "speed_rpm": [900, 5000], "wanted_nm": [[1, 2], [3, 4]]}
    for wrong, field in (
        ({"wanted_nm": [[1, 2], [3, 1]]}, "wanted_nm[1][1]"),
        ({"wanted_nm": [[1, 2], [3, math.nan]]}, "wanted_nm[1][1]"),
        ({"pedal_percent": [0, 101]}, "pedal_percent[1]"),
        ({"speed_rpm": [0, 5000]}, "speed_rpm[0]"),
    ):
        with pytest.raises(ParameterError) as error:
            PedalMap(**{**good, **wrong})
        assert error.value.field == field
    with pytest.raises(ShapeError, match="2 x 3"):
        PedalMap(pedal_percent=[0, 50], speed_rpm=[900, 3000, 5000], wanted_nm=[[1, 2], [3, 4]])
    with pytest.raises(ShapeError, match="full_load_nm"):
        PedalMap.of_full_load([900, 5000], [100.0])


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: ODD.air_g_per_s(20.0, 0.0), "speed_rpm"),
        (lambda: ODD.torque_nm([1.0, math.nan], 2000.0), "air_g_per_s"),
        (lambda: ODD.throttle_g_per_s(91.0, 40.0), "angle_deg"),
        (lambda: ODD.opening_deg(5.0, -1.0), "pressure_kpa"),
        (lambda: ODD.angle_of_area_deg(-3.0), "area_mm2"),
        (lambda: ODD.pedal_map.torque_nm(101.0, 2000.0), "pedal_percent"),
        (lambda: ODD.steady([5.0, -1.0], 2000.0), "pedal_percent"),
    ],
)
def test_an_equation_refuses_what_cannot_be(call: object, field: str) -> None:
    with pytest.raises(ParameterError) as error:
        call()  # type: ignore[operator]
    assert error.value.field == field


def test_equations_broadcast_and_give_back_what_came() -> None:
    speed = np.array([900.0, 2500.0, 5200.0])
    torque = np.array([[5.0], [40.0], [75.0], [90.0]])
    air = ODD.air_g_per_s(torque, speed)
    assert np.shape(air) == (4, 3)
    np.testing.assert_allclose(ODD.torque_nm(air, speed), np.broadcast_to(torque, (4, 3)), rtol=1e-12)
    pressure = ODD.pressure_kpa(air, speed)
    np.testing.assert_allclose(ODD.cylinder_g_per_s(pressure, speed), air, rtol=1e-12)
    reached = np.asarray(pressure)[np.asarray(pressure) < 0.95 * ODD.ambient_kpa]
    flow = np.asarray(air)[np.asarray(pressure) < 0.95 * ODD.ambient_kpa]
    np.testing.assert_allclose(ODD.throttle_g_per_s(ODD.opening_deg(flow, reached), reached), flow, rtol=1e-9)
    angle = np.linspace(0.5, 68.0, 40)  # beyond 69 deg the shaft alone is in the way
    np.testing.assert_allclose(ODD.angle_of_area_deg(ODD.area_mm2(angle)), angle, rtol=1e-9)
    assert isinstance(ODD.area_mm2(3.0), float)


def test_a_tracker_goes_on_bit_for_bit_and_takes_over_without_a_bump() -> None:
    first, second = ODD.tracker(sample_s=2e-3), ODD.tracker(sample_s=2e-3)
    for k in range(200):
        first.step(30.0 + 20.0 * math.sin(0.05 * k), 2000.0, 50.0)
    second.state = first.state
    for k in range(200):
        assert first.step(10.0 + 0.2 * k, 2100.0, math.nan) == second.step(10.0 + 0.2 * k, 2100.0, math.nan)
    first.reset()
    first.take_over(33.0)
    assert first.step(math.nan, math.nan)["reference_deg"] == 33.0
    assert abs(first.step(5.0, 2000.0)["reference_deg"] - 33.0) <= 1.6
    with pytest.raises(ParameterError) as error:
        second.state = {**second.state, "reference_deg": [95.0]}
    assert "reference_deg" in str(error.value)


def test_the_command_prints_the_steady_demand(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "chain.toml"
    file.write_text(ODD.to_toml(), encoding="utf-8")
    argv = ["throttle", "demand", "--pedal-percent", "60", "--speed-rpm", "2000", "--chain", str(file)]
    assert main([*argv, "--set", "leak_mm2=2", "--json"]) == 0
    out = json.loads(capsys.readouterr().out)
    steady = ODD.replace(leak_mm2=2.0).steady(60.0, 2000.0)
    for name in steady.data_vars:
        assert out[name] == float(steady[name].item()), name
    assert out["reachable"] is True
    assert out["parameters"]["leak_mm2"] == 2.0
    assert main([*argv, "--set", "leak=2"]) == 2
    assert "did you mean 'leak_mm2'" in capsys.readouterr().err
    assert main([*argv[:5], "1e9"]) == 2
    assert "speed_rpm" in capsys.readouterr().err


QUIET = SensorPair(noise_v=0.0, adc_bits=24)
CHAIN = DemandChain()


def tip_in(n: int = 1500, at: int = 300) -> np.ndarray:
    return np.where(np.arange(n) < at, 12.0, 55.0)


class Held:
    """Holds a duty, whatever it is told."""

    def __init__(self, duty: float) -> None:
        self.duty = duty

    def step(self, *_: float) -> float:
        return self.duty


def test_a_held_pedal_stays_at_its_steady_demand() -> None:
    run = simulate_drive(CHAIN, np.full(800, 30.0), 2400.0, sensors=QUIET)
    check_labels(run)
    steady = CHAIN.steady(30.0, 2400.0)
    np.testing.assert_allclose(run["reference_deg"], float(steady["opening_deg"].item()), atol=0.01)
    np.testing.assert_allclose(run["pressure_kpa"][0], float(steady["pressure_kpa"].item()), rtol=1e-9)
    np.testing.assert_allclose(run["torque_nm"], float(steady["wanted_torque_nm"].item()), atol=2.0)


@pytest.mark.parametrize("controller", [Pid, SlidingMode])
def test_the_engine_makes_the_wanted_torque(controller: type[Pid | SlidingMode]) -> None:
    run = simulate_drive(CHAIN, tip_in(), 2000.0, controller=controller(), sensors=QUIET)
    error = (run["torque_nm"] - run["wanted_torque_nm"]).to_numpy()
    assert abs(error[-200:]).max() < 1.5
    assert abs((run["pressure_kpa"] - run["wanted_pressure_kpa"]).to_numpy()[:300]).max() < 1.0


def test_filling_fed_forward_is_what_makes_the_torque_quick() -> None:
    def rise_time(chain: DemandChain) -> int:
        torque = simulate_drive(chain, tip_in(), 2000.0, sensors=QUIET)["torque_nm"].to_numpy()
        return int(np.argmax(torque[300:] > torque[299] + 0.9 * (torque[-1] - torque[299])))

    assert rise_time(CHAIN) < 0.6 * rise_time(CHAIN.replace(filling_share=0.0))


def test_a_measured_pressure_corrects_an_engine_that_breathes_less() -> None:
    # 80 % pedal is above the critical ratio: the flow through the plate depends on the pressure behind it.
    weak = CHAIN.replace(volumetric_efficiency=0.765)
    pedal = np.full(2000, 80.0)
    told, blind = (
        simulate_drive(CHAIN, pedal, 3000.0, engine=weak, measured_pressure=is_told, sensors=QUIET)
        for is_told in (True, False)
    )
    error = [abs(float((run["torque_nm"] - run["wanted_torque_nm"])[-1])) for run in (told, blind)]
    assert error[0] < 1.0 < 4.0 < error[1]


def test_the_drop_over_the_plate_loads_it() -> None:
    run = simulate_drive(CHAIN, tip_in(), 2000.0, sensors=QUIET)
    drop = CHAIN.ambient_kpa - run["pressure_kpa"].to_numpy()
    one = airflow_torque_nm(Throttle(pressure_drop_kpa=1.0, bore_mm=CHAIN.bore_mm), run["angle_deg"].to_numpy())
    np.testing.assert_allclose(run["airflow_torque_nm"], one * drop, rtol=1e-12)
    assert not simulate_drive(CHAIN, tip_in(400), 2000.0, air_torque=False)["airflow_torque_nm"].any()


def test_runs_repeat_and_seeds_differ() -> None:
    first, second, other = (simulate_drive(CHAIN, tip_in(500), 2000.0, seed=seed) for seed in (3, 3, 4))
    assert first.identical(second)
    assert not np.array_equal(first["sensed_angle_deg"], other["sensed_angle_deg"])


@pytest.mark.parametrize(
    ("pedal", "speed", "controller", "error", "field"),
    [
        ([10.0, 120.0], 2000.0, None, ParameterError, "pedal_percent"),
        ([10.0, math.nan], 2000.0, None, ParameterError, "pedal_percent"),
        ([10.0, 20.0], [2000.0, 0.0], None, ParameterError, "speed_rpm"),
        ([10.0, 20.0], 2000.0, Held(math.nan), ParameterError, "duty"),
        ([10.0, 20.0], [2000.0], None, ShapeError, ""),
        ([], 2000.0, None, ShapeError, ""),
        (10.0, 2000.0, None, ShapeError, ""),
    ],
)
def test_what_cannot_be_driven_is_refused(
    pedal: object, speed: object, controller: object, error: type[Exception], field: str
) -> None:
    with pytest.raises(error) as refused:
        simulate_drive(CHAIN, pedal, speed, controller=controller)  # type: ignore[arg-type]
    assert (getattr(refused.value, "field", "") or "") == field
