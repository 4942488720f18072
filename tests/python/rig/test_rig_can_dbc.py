"""A rig behind the DBC of a user: driven in this process and another, or its map is told which names are needed."""

import math
from pathlib import Path

import pytest

from bus_node import ETB
from mgdd._core.rig import Frame
from mgdd.cli import main
from mgdd.errors import ParameterError, RigError
from mgdd.loop import VirtualThrottle
from mgdd.rig import CanRig, SignalMap, VirtualNode
from mgdd.rig.can.node import LocalBus
from user_buses import NAMES, write_foreign, write_own


def test_a_throttle_behind_a_bus_of_somebody_else(tmp_path: Path) -> None:
    """No state to be asked, multiplexed answers, a trigger without protection: the node is driven all the same."""
    straight = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=0.01, seed=4)
    plant = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=0.01, seed=4)
    with CanRig(write_foreign(tmp_path), plant=plant) as rig:
        for k in range(30):
            duty = 0.00025 * round(4000 * 0.3 * math.sin(0.4 * k))
            rig.apply({"duty": duty})
            measured = rig.measure()
            straight.apply({"duty": duty, "bridge_open": 0.0})
            wanted = straight.measure().values
            assert measured.values["sensed_angle_deg"] == pytest.approx(wanted["sensed_angle_deg"], abs=3e-3)
            assert measured.values["current_a"] == pytest.approx(wanted["current_a"], abs=5.1e-4)
            assert measured.applied == {"duty": pytest.approx(duty, abs=1e-9)}


def test_a_multiplexed_command_carries_one_input_per_frame(tmp_path: Path) -> None:
    """Supply and torque of the air by ETB_Config, which is sent on events and has no safe frame."""
    (tmp_path / "etb.dbc").write_bytes(ETB.dbc.file.read_bytes())
    file = tmp_path / "config.toml"
    more = """
[commands.ETB_Config.inputs]
supply_v = { signal = "SupplyVoltage", unit = "V", lower = 6.0, upper = 16.0 }
airflow_torque_nm = { signal = "AirflowTorque", unit = "N m", lower = -5.0, upper = 5.0 }

[commands.ETB_Cmd]
"""
    text = ETB.file.read_text(encoding="utf-8")
    file.write_text(text.replace("\n[commands.ETB_Cmd]\n", more), encoding="utf-8")
    names = ["supply_v", "airflow_torque_nm", "duty"]
    frames: list[Frame] = []
    plant = VirtualThrottle(inputs=[*names, "bridge_open"], sample_s=5e-3, seed=4)
    straight = VirtualThrottle(inputs=[*names, "bridge_open"], sample_s=5e-3, seed=4)
    with CanRig(file, plant=plant, on_frame=frames.append) as rig:
        assert rig.input_names == ("supply_v", "airflow_torque_nm", "duty")
        for supply in (8.0, 13.5):
            for _ in range(10):
                given = {"supply_v": supply, "airflow_torque_nm": -0.125, "duty": 0.5}
                rig.apply(given)
                measured = rig.measure()
                straight.apply({**given, "bridge_open": 0.0})
                wanted = straight.measure().values
            assert measured.values["supply_v"] == pytest.approx(supply)
            assert measured.values["sensed_angle_deg"] == pytest.approx(wanted["sensed_angle_deg"], abs=5.1e-3)
    config = [frame.data for frame in frames if frame.id == 0x125]
    assert len(config) == 2 * 20
    assert {data[0] for data in config} == {0, 1}


EXPERIMENT = """kind = "experiment"
format = 1
task = "{task}"
mode = "hil"
[{task}]
[bus]
map = "{file}"
"""


def check(folder: Path, file: Path, task: str = "track") -> int:
    """Check an experiment over a map as a user does."""
    experiment = folder / "experiment.toml"
    experiment.write_text(EXPERIMENT.format(task=task, file=file.name), encoding="utf-8")
    return main(["rig", "check", str(experiment)])


def test_a_dbc_of_a_user_is_driven_in_another_process(tmp_path: Path) -> None:
    file = write_own(tmp_path)
    assert check(tmp_path, file) == 0
    plant = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=5e-3, seed=4)
    with VirtualNode(file, step=True, seed=4) as node, CanRig(file, node.bus, mode="hil", timeout_s=20.0) as rig:
        assert rig.state == "Bereit"
        for _ in range(40):
            rig.apply({"duty": 0.25})
            measured = rig.measure().values
            plant.apply({"duty": 0.25, "bridge_open": 0.0})
            straight = plant.measure().values
            for name in ("sensed_angle_deg", "first_v", "second_v"):  # a float of 32 bits
                assert measured[name] == pytest.approx(straight[name], rel=1e-6)
        assert rig.state == "Regelt"


def test_states_by_names_of_his_own_are_understood(tmp_path: Path) -> None:
    plant = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=5e-3, seed=4)
    with CanRig(write_own(tmp_path), plant=plant) as rig:
        assert isinstance(rig.bus, LocalBus)
        rig.apply({"duty": 0.25})
        rig.measure()
        rig.bus.core.gate.abort()
        rig.apply({"duty": 0.25})
        with pytest.raises(RigError, match="the node is in state 'Notlauf' and does not drive"):
            rig.measure()
        rig.arm()
        rig.apply({"duty": 0.25})
        assert rig.measure().applied["duty"] == 0.25


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            [("sensed_angle_deg", "angle_of_plate_deg"), ("first_v", "pot_a_v")],
            "measured values = 'angle_of_plate_deg, pot_a_v, second_v': must be completed by sensed_angle_deg, first_v",
        ),
        ([("duty =", "drive =")], "inputs = 'drive': must be duty: so task = 'track' calls what it commands"),
        (
            [(NAMES, "")],
            "Stand = 'Aus, Bereit, Regelt, Notlauf, Fehler': must be named for the modes init, armed, run, limp, fault",
        ),
        ([('fault = "Fehler"', 'fault = "Error"')], "state.names.fault = 'Error': must be a name of the value table"),
        ([("init =", "initial =")], "state.names.initial = 'Aus': must be one of the keys init, armed, run, limp"),
        ([('run = "Regelt", ', "")], "must be named for the modes run of a virtual node"),
    ],
)
def test_a_map_without_the_names_is_told_all_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: list[tuple[str, str]], message: str
) -> None:
    assert check(tmp_path, write_own(tmp_path, *changes)) == 2
    assert message in capsys.readouterr().err


def test_a_node_needs_the_names_of_its_states_and_a_bench_does_not(tmp_path: Path) -> None:
    file = write_own(tmp_path, (NAMES, 'failed = ["Notlauf"]\n'))
    known = SignalMap.load(file)
    assert known.state is not None
    assert (known.state.failed, known.state.unarmed) == (("Notlauf",), None)
    with pytest.raises(ParameterError, match=r"names = \{ init = \"STATE\""):
        CanRig(file, plant=VirtualThrottle(inputs=["duty", "bridge_open"]))
    named = SignalMap.load(write_own(tmp_path)).state
    assert named is not None
    assert (named.failed, named.unarmed) == (("Notlauf", "Fehler"), "Aus")
    assert named.codes() == {"init": 0, "armed": 1, "run": 2, "limp": 5, "fault": 6}
    assert ETB.state is not None
    assert ETB.state.codes() == {"init": 0, "armed": 1, "run": 2, "limp": 3, "fault": 4}


def test_a_state_for_two_modes(tmp_path: Path) -> None:
    """Off and armed look alike: the host counts its safe frames instead."""
    file = write_own(tmp_path, ('init = "Aus", armed = "Bereit"', 'init = "Aus", armed = "Aus"'))
    plant = VirtualThrottle(inputs=["duty", "bridge_open"], sample_s=5e-3, seed=4)
    with CanRig(file, plant=plant) as rig:
        rig.apply({"duty": 0.25})
        assert rig.measure().applied["duty"] == 0.25
        assert rig.state == "Regelt"


def test_a_search_without_an_objective_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It would seek the best of J = 0."""
    engine = SignalMap.load("engine").file
    (tmp_path / "engine.dbc").write_bytes(engine.with_suffix(".dbc").read_bytes())
    text = engine.read_text(encoding="utf-8")
    begin = text.index("[[objective]]")
    file = tmp_path / "no_goal.toml"
    file.write_text(text[:begin] + text[text.index("[state]") :], encoding="utf-8")
    assert check(tmp_path, file, "seek") == 2
    assert "no_goal.toml: [[objective]] is missing" in capsys.readouterr().err
