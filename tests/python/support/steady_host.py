"""A host that arms a throttle and holds it open without looking at the answers: python steady_host.py BUS.

It reads a line at a time: `drive` arms and drives from then on, `stop` falls silent at once and keeps the bus, and says
every line again when it has acted on it.
"""

import select
import sys
import time

from mgdd.rig import SignalMap
from mgdd.rig.can.link import Sender
from mgdd.rig.can.transport import CanTransport

DUTY, PERIOD_S, SAFE_FRAMES = 0.3, 0.005, 12


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(where: str) -> None:
    signal_map, sender = SignalMap.load("etb"), Sender()
    command = signal_map.commands["ETB_Cmd"]
    safe, driven = command.payloads({}, command.safe), command.payloads({"duty": DUTY}, command.driven)
    mode, sent = "stop", 0
    with CanTransport.parse(where) as bus:
        say("ready")
        next_s = time.monotonic()
        while True:
            if select.select([sys.stdin], [], [], max(0.0, next_s - time.monotonic()))[0]:
                if not (mode := sys.stdin.readline().strip()):
                    return
                sent = 0
                say(mode)
            if time.monotonic() < next_s:
                continue
            next_s = max(next_s + PERIOD_S, time.monotonic())
            if mode == "drive":
                for frame in sender.frames(command, safe if sent < SAFE_FRAMES else driven):
                    bus.send(frame)
                sent += 1


main(sys.argv[1])
