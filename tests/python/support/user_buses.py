"""Buses of other people: their DBC, and maps of it, written into a folder."""

from collections.abc import Mapping
from pathlib import Path


def dbc_of(messages: str, cycle_ms: Mapping[int, int], more: str = "") -> str:
    """The text of a DBC: messages, the times between two frames by number, and what follows."""
    cycles = "".join(f'BA_ "GenMsgCycleTime" BO_ {number} {ms};\n' for number, ms in cycle_ms.items())
    attribute = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    return f'VERSION ""\nNS_ :\nBS_:\nBU_: PC BOX\n\n{messages}\n{attribute}{cycles}{more}'


def write_bus(folder: Path, name: str, dbc: str, text: str) -> Path:
    """Write DBC and map under a name, and return the map."""
    (folder / f"{name}.dbc").write_text(dbc, encoding="utf-8")
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return folder / f"{name}.toml"


# Big endian, identifiers of 29 bits, multiplexed answers, another CRC, other units.
FOREIGN = dbc_of(
    """\
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
""",
    dict.fromkeys((2566848766, 2566849022, 2566849278), 10),
)

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
    return write_bus(folder, "foreign", FOREIGN, FOREIGN_MAP)


# Identifiers of 29 bits, Motorola order, float signals, and states with names of his own.
OWN = dbc_of(
    """\
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
""",
    dict.fromkeys((2566848766, 2566849022, 2566849278), 5),
    """\
VAL_ 2566849022 Stand 0 "Aus" 1 "Bereit" 2 "Regelt" 5 "Notlauf" 6 "Fehler" ;
SIG_VALTYPE_ 2566848766 Drive : 1;
SIG_VALTYPE_ 2566849022 Angle : 1;
SIG_VALTYPE_ 2566849278 PotA : 1;
SIG_VALTYPE_ 2566849278 PotB : 1;
""",
)
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
    return write_bus(folder, "own", OWN, text)
