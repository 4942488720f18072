"""A bus of a user: identifiers of 29 bits, Motorola order, float signals, and states with names of his own."""

from __future__ import annotations

from pathlib import Path

OWN = """VERSION ""
NS_ :
BS_:
BU_: PC BOX

BO_ 2566848766 ThrCmd: 8 PC
 SG_ Check : 7|8@0+ (1,0) [0|255] "" BOX
 SG_ Count : 11|4@0+ (1,0) [0|15] "" BOX
 SG_ Go : 15|1@0+ (1,0) [0|1] "" BOX
 SG_ Drive : 23|32@0- (1,0) [-1|1] "" BOX

BO_ 2566849022 ThrAns: 8 BOX
 SG_ Angle : 7|32@0- (1,0) [-20|120] "deg" PC
 SG_ Stand : 39|3@0+ (1,0) [0|7] "" PC
 SG_ Used : 47|16@0- (0.0001,0) [-1|1] "" PC

BO_ 2566849278 ThrSens: 8 BOX
 SG_ PotA : 7|32@0- (1,0) [0|5] "V" PC
 SG_ PotB : 39|32@0- (1,0) [0|5] "V" PC

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 2566848766 5;
BA_ "GenMsgCycleTime" BO_ 2566849022 5;
BA_ "GenMsgCycleTime" BO_ 2566849278 5;
VAL_ 2566849022 Stand 0 "Aus" 1 "Bereit" 2 "Regelt" 5 "Notlauf" 6 "Fehler" ;
SIG_VALTYPE_ 2566848766 Drive : 1;
SIG_VALTYPE_ 2566849022 Angle : 1;
SIG_VALTYPE_ 2566849278 PotA : 1;
SIG_VALTYPE_ 2566849278 PotB : 1;
"""
NAMES = 'names = { init = "Aus", armed = "Bereit", run = "Regelt", limp = "Notlauf", fault = "Fehler" }\n'
OWN_MAP = f"""kind = "signal_map"
format = 1
dbc = "own.dbc"
trigger = "ThrAns"

[state]
message = "ThrAns"
signal = "Stand"
{NAMES}
[commands.ThrCmd]
timeout_ms = 20
e2e = {{ data_id = 7, crc = "Check", counter = "Count" }}
driven = {{ Go = 1 }}
safe = {{ Go = 0, Drive = 0.0 }}

[commands.ThrCmd.inputs]
duty = {{ signal = "Drive", unit = "-", lower = -1.0, upper = 1.0 }}

[measurements.ThrAns.values]
sensed_angle_deg = {{ signal = "Angle", unit = "deg" }}

[measurements.ThrAns.applied]
duty = {{ signal = "Used", unit = "-" }}

[measurements.ThrSens.values]
first_v = {{ signal = "PotA", unit = "V" }}
second_v = {{ signal = "PotB", unit = "V" }}
"""


def write_own(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write DBC and map, with other texts in the map, and return the map."""
    text = OWN_MAP
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "own.dbc").write_text(OWN, encoding="utf-8")
    (folder / "own.toml").write_text(text, encoding="utf-8")
    return folder / "own.toml"
