"""NI, CAN, Modbus, serial line, amplifier and robot at once, each unplugged and plugged in again while a cut runs."""

import socket
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording

pytest.importorskip("can")
HERE = Path(__file__).parent
RunWithDaqmx = Callable[..., subprocess.CompletedProcess[str]]
PULLED = {
    "CAN bus slcan ttyCAN": (3.0, 6.0, "spindle_speed_rpm", 6000.0),
    "Modbus ttyDrive": (4.0, 7.0, "drive_load", 42.0),
    "serial line ttyTachometer": (4.5, 8.0, "tachometer_rpm", 6001.5),
    "RSI": (5.0, 9.0, "joint_2_rad", -np.pi / 2),
    "amplifier on ttyAmplifier": (6.0, 10.0, None, None),
}


@pytest.mark.slow
def test_the_cut_is_complete_and_the_file_tells_what_happened_when(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        port = line.getsockname()[1]
    program = (HERE / "whole_rig.py").read_text()
    folder = HERE / "drivers"
    done = with_daqmx(f"import sys; sys.argv[1:] = [{str(folder)!r}, '{port}']\n{program}")
    assert done.returncode == 0, done.stderr
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 14 * 25600)
        rows, index = recording.stream().read(), np.arange(14 * 25600)
        np.testing.assert_allclose(rows[:, 0], 100 * (index % 65536 / 16384), rtol=1e-6)  # 1000 N at 10 V
        np.testing.assert_allclose(rows[:, 1], 2 * index % 65536 / 16384 / (0.1 / 9.80665), rtol=1e-6)
        log = recording.events["devices"]
        lines = list(zip(*log.read(), log.read_texts(), strict=True))
        for device, (gone, again, series, value) in PULLED.items():
            stated = [(at, code) for at, code, text in lines if text.startswith(device) and code < 2]
            assert [code for _, code in stated] == [0.0, 1.0], (device, lines)
            (lost, _), (back, _) = stated
            assert gone - 0.5 < lost < gone + 1.5, device
            assert again - 0.1 < back < again + 2.5, device
            if series is not None:
                times, values = recording.events[series].read()
                np.testing.assert_allclose(values, value, rtol=1e-9)
                assert not ((times > lost + 0.1) & (times < back - 0.1)).any(), device
                for begin, end in ((0.5, gone - 0.2), (back + 0.2, 13.0)):
                    inside = times[(times > begin) & (times < end)]
                    assert len(inside) > 0.5 * (end - begin) / 0.12, (device, begin, end, len(inside))
    losses = [line for line in done.stdout.splitlines() if line.startswith("loss: ")]
    warnings = [line for line in done.stdout.splitlines() if line.startswith("warning: ")]
    for device in PULLED:
        for said in (losses, warnings):
            assert sum(": lost (" in line and device in line and "back after" in line for line in said) == 1, device
