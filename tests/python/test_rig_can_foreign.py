"""A rig behind the DBC of somebody else."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from bus_node import ETB
from foreign_bus import write_foreign
from mgdd._core.rig import Frame
from mgdd.loop import VirtualThrottle
from mgdd.rig import CanRig


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
