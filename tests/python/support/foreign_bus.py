"""A bus of somebody else: big endian, identifiers of 29 bits, multiplexed answers, another CRC, other units."""

from __future__ import annotations

from pathlib import Path

FOREIGN = """VERSION ""
NS_ :
BS_:
BU_: PC BOX

BO_ 2566848766 Cmd: 8 PC
 SG_ Check : 7|8@0+ (1,0) [0|255] "" BOX
 SG_ Count : 11|4@0+ (1,0) [0|15] "" BOX
 SG_ Go : 15|1@0+ (1,0) [0|1] "" BOX
 SG_ Drive : 20|13@0- (0.025,0) [-100|100] "%" BOX

BO_ 2566849022 Answer: 8 BOX
 SG_ Select M : 7|4@0+ (1,0) [0|15] "" PC
 SG_ Angle m3 : 15|24@0- (0.0001,0) [-10|10] "rad" PC
 SG_ Current m5 : 15|16@0- (0.001,0) [-30|30] "A" PC
 SG_ Used m5 : 31|13@0- (0.025,0) [-100|100] "%" PC
 SG_ Alarm : 3|1@0+ (1,0) [0|1] "" PC

BO_ 2566849278 Done: 1 BOX
 SG_ Beat : 7|8@0+ (1,0) [0|255] "" PC

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 2566848766 10;
BA_ "GenMsgCycleTime" BO_ 2566849022 10;
BA_ "GenMsgCycleTime" BO_ 2566849278 10;
"""

FOREIGN_MAP = """kind = "signal_map"
format = 1
dbc = "foreign.dbc"
trigger = "Done"

[commands.Cmd]
e2e = { profile = "h2f", data_id = 7, crc = "Check", counter = "Count", max_step = 2 }
driven = { Go = 1 }
safe = { Go = 0, Drive = 0.0 }

[commands.Cmd.inputs]
duty = { signal = "Drive", unit = "%", scale = 0.01, lower = -0.9, upper = 0.9 }

[measurements.Answer.values]
sensed_angle_deg = { signal = "Angle", unit = "rad", scale = 57.29577951308232 }
current_a = { signal = "Current", unit = "A" }

[measurements.Answer.applied]
duty = { signal = "Used", unit = "%", scale = 0.01 }

[measurements.Done]
"""


def write_foreign(folder: Path) -> Path:
    """Write DBC and map, and return the map."""
    (folder / "foreign.dbc").write_text(FOREIGN, encoding="utf-8")
    (folder / "foreign.toml").write_text(FOREIGN_MAP, encoding="utf-8")
    return folder / "foreign.toml"
