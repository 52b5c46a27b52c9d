"""Share of one core that verdicts on a running cut take: three channels at 51.2 kHz, two speeds.

    python -m benchmarks.online_chatter

The floor is one FFT of each window (0.4 s, every 0.1 s) of each channel at the full rate.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import time
from math import pi

import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.stability import OnlineClassifier, WatchedCut
from replay_data import MillingCell, table_one_model, tip_accelerometers

RATE, DEPTH, SECONDS = 51200.0, 1e-3, 20.0
PROCESS = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)


def samples(rpm: float) -> np.ndarray:
    """Three accelerations of a simulated cut, (n, 3), with 5 % noise."""
    sensors = tip_accelerometers(0.05)
    cell = MillingCell(table_one_model(), PROCESS, DEPTH, rpm * pi / 30, SECONDS, sample_rate=RATE, sensors=sensors)
    return cell.samples()


def share(data: np.ndarray, rpm: float) -> tuple[float, str]:
    """Return the processor time over the duration, and the last state."""
    cut = WatchedCut(RATE, 3, rpm * pi / 30, 2, ("acceleration",) * 3, (2, 2, 2))
    classifier = OnlineClassifier(cut)
    begin = time.process_time()
    for start in range(0, len(data), 5120):
        classifier.add(data[start : start + 5120])
    return (time.process_time() - begin) / SECONDS, classifier.state


def floor(data: np.ndarray) -> float:
    """Return the processor time of one FFT a window and channel, over the duration."""
    window, hop = round(0.4 * RATE), round(0.1 * RATE)
    begin = time.process_time()
    for start in range(0, len(data) - window, hop):
        np.fft.rfft(data[start : start + window], axis=0)
    return (time.process_time() - begin) / SECONDS


def main() -> None:
    print(f"{'speed (rpm)':>11} {'state':>12} {'share of a core':>16} {'over the floor':>15}")
    for rpm in (6000.0, 900.0):
        data = samples(rpm)
        share(data[: len(data) // 4], rpm)  # libraries are loaded
        used, state = share(data, rpm)
        print(f"{rpm:11.0f} {state:>12} {100 * used:14.1f} % {used / floor(data):15.1f}")


if __name__ == "__main__":
    main()
