"""Recording 24 channels at 51.2 kHz: `python benchmarks/acquisition_speed.py [SECONDS]` (60; needs gcc on Linux).

The simulated DAQmx library of the tests gives the samples in real time to `millfrf acquire --live` in a process of its
own, with the page open in headless Chromium where there is one. Every sample is checked afterwards. Then the writer
alone is timed against plain h5py, which neither flushes nor survives a kill.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from acquisition import Channel, Recording, RecordingWriter, StreamDescription

RATE, N_CHANNELS, BLOCK = 51200.0, 24, 5120
SIMULATED = Path(__file__).resolve().parents[1] / "tests" / "acquisition" / "simulated_daqmx.c"


def session_text(seconds: float) -> str:
    """Three forces and 21 accelerations on six modules."""
    lines = [f"duration_s = {seconds}", "band_hz = [5.0, 1000.0]", "[device]", 'driver = "ni"']
    lines += [f"sample_rate_hz = {RATE}", "[live]", "segment_s = 0.5"]
    for k in range(N_CHANNELS):
        force = k < 3
        lines += ["[[channels]]", f'name = "c{k}"', f'terminal = "cDAQ1Mod{1 + k // 4}/ai{k % 4}"']
        lines += [f'node = "P{k // 3}"', f'direction = "+{"XYZ"[k % 3]}"']
        lines += ['quantity = "force"', 'unit = "N"', "units_per_volt = 1"] if force else []
        lines += [] if force else ['quantity = "acceleration"', 'unit = "m/s^2"', "mv_per_unit = 1", "iepe_ma = 2"]
    return "\n".join(lines)


def record_with_page(folder: Path, seconds: float) -> None:
    """The whole chain in real time; prints CPU share, longest delay, and whether a sample was lost."""
    library = folder / "libnidaqmx.so.1"
    flags = ["-O2", "-shared", "-fPIC", f"-Wl,-soname,{library.name}"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(SIMULATED), "-lm"], check=True)
    (folder / "libnidaqmx.so").symlink_to(library.name)
    (folder / "session.toml").write_text(session_text(seconds))
    command = [sys.executable, "-m", "millfrf", "acquire", "session.toml", "--out", "rec.h5", "--live", "--at-once"]
    environment = {**os.environ, "LD_LIBRARY_PATH": str(folder)}
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    url = next(line.split()[-1] for line in process.stdout if "live page" in line)
    began = time.monotonic()
    seen = watch_page(url, folder / "live_page.png", seconds)
    said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.monotonic() - began
    cpu = usage.ru_utime + usage.ru_stime
    print(f"24 channels x 51.2 kHz x {seconds:g} s, page {seen}")
    print(f"  {said.splitlines()[0]}")
    print(f"  CPU {cpu:.1f} s of {wall:.1f} s ({100 * cpu / wall:.0f} % of one core, start included), exit {status}")
    print(f"  samples that are not what the device gave: {count_wrong(folder / 'rec.h5', seconds)}")


def watch_page(url: str, picture: Path, seconds: float) -> str:
    """Keep the page open in Chromium nearly to the end; returns what was seen."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        browser = None
    if browser is None:
        return "not open (no Chromium or playwright)"
    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = started.new_page(viewport={"width": 1400, "height": 1250})
        page.goto(url)
        page.wait_for_timeout(1000 * max(seconds - 12, 2))
        status = page.locator("text=samples a channel").first.inner_text()
        page.screenshot(path=str(picture))
        page.wait_for_timeout(4000)
    kept = shutil.copy(picture, os.environ.get("MILLFRF_ARTEFACTS", tempfile.gettempdir()))
    return f"open in Chromium ({status}; picture {kept})"


def count_wrong(path: Path, seconds: float) -> int:
    """Samples missing or different from the simulated device's."""
    wrong, start = 0, 0
    scale = np.array([1.0 if k < 3 else 1e3 for k in range(N_CHANNELS)]) / 16384  # N/V, then 1 mV per m/s^2
    with Recording(path) as recording:
        for block in recording.stream().blocks():
            index = np.arange(start, start + len(block))[:, None] * np.arange(1, N_CHANNELS + 1)
            wrong += int(np.sum(~np.isclose(block, index % 65536 * scale, rtol=1e-6, atol=0)))
            start += len(block)
    return wrong + N_CHANNELS * (round(seconds * RATE) - start)


def write_rate(folder: Path, seconds: float) -> tuple[float, float]:
    """Times faster than real time: our writer, and plain h5py on the same blocks."""
    channels = tuple(Channel(f"c{k}", "acceleration", "m/s^2") for k in range(N_CHANNELS))
    block = np.random.default_rng(0).standard_normal((BLOCK, N_CHANNELS))
    n_blocks = int(seconds * RATE / BLOCK)
    began = time.perf_counter()
    with RecordingWriter(folder / "ours.h5", [StreamDescription("ni", RATE, 0.0, channels)]) as writer:
        for k in range(n_blocks):
            writer.append("ni", block)
            writer.append_clock_pair("ni", k * BLOCK, k * 0.1)
    ours = time.perf_counter() - began
    began = time.perf_counter()
    with h5py.File(folder / "plain.h5", "w") as file:
        data = file.create_dataset("x", (0, N_CHANNELS), "f4", maxshape=(None, N_CHANNELS), chunks=(4096, N_CHANNELS))
        for k in range(n_blocks):
            data.resize((k + 1) * BLOCK, axis=0)
            data[k * BLOCK :] = block
    plain = time.perf_counter() - began
    return seconds / ours, seconds / plain


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        record_with_page(folder, seconds)
        ours, plain = write_rate(folder, seconds)
    print(f"writer: {ours:.0f} times real time; plain h5py {plain:.0f}; ours / plain {ours / plain:.2f}")


if __name__ == "__main__":
    main()
