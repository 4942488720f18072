"""An experiment over a bus at real-time pace that a busy machine can run: slow cycles, long time limits."""

import re
from pathlib import Path

from mgdd.rig import Experiment, SafetyEnvelope, SignalMap

CYCLE_MS = 10
TRACK = (
    'kind = "experiment"\nformat = 1\nseed = 5\ntask = "track"\nmode = "hil"\n'
    '[track]\nreference = "{reference}"\ncontroller = "pid"\nloop = "{loop}"\n'
    '[bus]\nmap = "map.toml"\npace = "real_time"\ntimeout_ms = 5000.0\n[safety]\nenvelope = "envelope.toml"\n'
)


def patient_experiment(
    folder: Path, reference: str = "step:20:35", loop: str = "auto", *, cycle_ms: int = CYCLE_MS
) -> Experiment:
    """Write map, DBC, envelope and experiment into a folder."""
    shipped = SignalMap.load("etb")
    dbc = shipped.dbc.file.read_text(encoding="utf-8")
    cycle = r'(BA_ "GenMsgCycleTime" BO_ (?:288|289|290)) \d+'
    (folder / "etb.dbc").write_text(re.sub(cycle, rf"\1 {cycle_ms}", dbc), encoding="utf-8")
    own = shipped.file.read_text(encoding="utf-8").replace("timeout_ms = 20", "timeout_ms = 5000")
    (folder / "map.toml").write_text(own, encoding="utf-8")
    patient = dict.fromkeys(("missed_deadlines", "unsent_cycles", "largest_age_cycles", "bad_frames"), 1e6)
    envelope = SafetyEnvelope(duty_limit=0.35, good_frames=5.0, stall_s=10.0, sensor_slope_v_per_s=1e5, **patient)
    (folder / "envelope.toml").write_text(envelope.to_toml(), encoding="utf-8")
    file = folder / "track.toml"
    file.write_text(TRACK.format(reference=reference, loop=loop), encoding="utf-8")
    return Experiment.load(file)
