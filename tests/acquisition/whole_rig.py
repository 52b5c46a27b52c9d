"""A whole rig for one process: the session of all devices, and a schedule that unplugs each and plugs it in again.

Run where the simulated DAQmx library is found; the argument is the folder of the simulated serial devices. Every
auxiliary device is a pseudo terminal behind a link, or a process, so that it can be pulled and come back.
"""

import importlib.util
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

SESSION = """
title = "whole rig"
duration_s = 14.0
[device]
driver = "ni"
sample_rate_hz = 25600
[[channels]]
name = "fx"
quantity = "force"
unit = "N"
terminal = "cDAQ1Mod9/ai0"
amplifier = "dyno"
amplifier_range = 1000
range_v = 10
[[channels]]
name = "ax"
quantity = "acceleration"
unit = "g"
terminal = "cDAQ1Mod2/ai0"
mv_per_unit = 100
iepe_ma = 2
[[counters]]
name = "angle"
counter = "cDAQ1/_ctr0"
[[amplifier]]
name = "dyno"
port = "ttyAmplifier"
baud = 9600
on_open = [{ send = "RANGE 1,{fx}", expect = "OK" }]
check = [{ send = "RANGE? 1", expect = "RANGE {fx}" }]
check_every_s = 0.5
[[can]]
interface = "slcan"
channel = "ttyCAN"
dbc = "cell.dbc"
signals = [{ signal = "Speed", series = "spindle_speed_rpm" }]
options = { sleep_after_open = 0, bitrate = 500000 }
[[modbus]]
port = "ttyDrive"
baud = 115200
slave = 3
registers = [{ address = 7, series = "drive_load" }]
[[tachometer]]
port = "ttyTachometer"
baud = 115200
series = "tachometer_rpm"
silence_s = 1.0
[[rsi]]
address = "127.0.0.1"
port = %d
cycle_ms = 4
silence_s = 0.5
"""
DBC = """VERSION ""
BU_: PLC
BO_ 256 Spindle: 8 PLC
 SG_ Speed : 0|16@1+ (0.5,0) [0|32000] "rpm" PLC
"""
SCHEDULE = {
    "ttyCAN": (3.0, 6.0),
    "ttyDrive": (4.0, 7.0),
    "ttyTachometer": (4.5, 8.0),
    "controller": (5.0, 9.0),
    "ttyAmplifier": (6.0, 10.0),
}
"""Seconds after the first block at which each device is pulled and put in again."""


def load(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Rig:
    """The auxiliary devices by name, pulled and put in by their schedule."""

    def __init__(self, drivers: Path, port: int) -> None:
        lines = load(drivers / "lines.py")
        self._controller = [sys.executable, str(drivers / "rsi_controller.py"), str(port), "4", "100000"]
        self._make = {
            "ttyCAN": lambda: lines.FarEnd(lines.tachometer(lambda due: self._can(), 0.02)),
            "ttyDrive": lambda: lines.FarEnd(lines.modbus_slave(3, {7: 42})),
            "ttyTachometer": lambda: lines.FarEnd(lines.tachometer(lambda due: b"6001.5\r\n", 0.02)),
            "ttyAmplifier": lambda: lines.FarEnd(lines.ranged_amplifier({"1": 1000.0})),
        }
        self._there: dict[str, Any] = {}
        self._began = 0.0

    @staticmethod
    def _can() -> bytes:
        return b"t1008" + (2 * 6000).to_bytes(2, "little").hex().encode() + bytes(6).hex().encode() + b"\r"

    def plug(self, name: str) -> None:
        if name == "controller":
            self._there[name] = subprocess.Popen(self._controller, stdout=subprocess.DEVNULL)
            return
        self._there[name] = self._make[name]()
        Path(name).symlink_to(self._there[name].port)

    def pull(self, name: str) -> None:
        device = self._there.pop(name, None)
        if device is None:
            return
        if name == "controller":
            device.kill()
            device.wait()
            return
        Path(name).unlink()
        device.unplug()

    def run_schedule(self) -> None:
        steps = [
            (at, act, name) for name, (gone, back) in SCHEDULE.items() for at, act in ((gone, "pull"), (back, "plug"))
        ]
        began = time.monotonic()
        for at, act, name in sorted(steps):
            time.sleep(max(0.0, began + at - time.monotonic()))
            getattr(self, act)(name)


def main(drivers: Path, port: int) -> None:
    from millfrf.command_line import run
    from millfrf.steps.recording.acquire import open_session, record_session

    Path("s.toml").write_text(SESSION % port)
    Path("cell.dbc").write_text(DBC)
    rig = Rig(drivers, port)
    for name in SCHEDULE:
        rig.plug(name)
    schedule = threading.Thread(target=rig.run_schedule)

    def begin(taken: object) -> None:
        if not schedule.ident:
            schedule.start()

    try:
        tally = record_session(open_session("s.toml"), "a.h5", watchers=[begin])
        assert tally is not None
        schedule.join()
    finally:
        for name in SCHEDULE:
            rig.pull(name)
    print(tally.summary())
    for line in tally.device_summary().losses:
        print("loss:", line)
    run(["inspect", "a.h5"])
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
