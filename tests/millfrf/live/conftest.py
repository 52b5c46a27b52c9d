"""What the tests of the live page share: a monitor, and a simulated NI device behind the real client package."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition import Channel, StreamDescription
from millfrf.live.monitor import LiveMonitor, LiveSettings

pytest.importorskip("bokeh")
RATE = 4096.0
CHANNELS = (
    Channel("fx", "force", "N", "TCP", "+X", full_scale=10.0),
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X", full_scale=3.0),
)


@pytest.fixture
def monitor() -> Iterator[LiveMonitor]:
    stream = StreamDescription("main", RATE, 0.0, CHANNELS)
    monitor = LiveMonitor([stream], LiveSettings((10.0, 1000.0), 0.25, teeth=2, spindle_speed_rpm=6000.0))
    yield monitor
    monitor.close()


@pytest.fixture(scope="session")
def with_ni(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment in which the simulated DAQmx library is found."""
    if shutil.which("gcc") is None or not sys.platform.startswith("linux"):
        pytest.skip("the simulated DAQmx library needs gcc on Linux")
    pytest.importorskip("nidaqmx")
    folder = tmp_path_factory.mktemp("daqmx")
    library = folder / "libnidaqmx.so.1"
    source = Path(__file__).resolve().parents[2] / "acquisition" / "simulated_daqmx.c"
    flags = ["-O2", "-shared", "-fPIC", f"-Wl,-soname,{library.name}"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(source), "-lm"], check=True)
    (folder / "libnidaqmx.so").symlink_to(library.name)
    return {**os.environ, "LD_LIBRARY_PATH": str(folder)}
