"""Speed of the FRF against pyFRF and loops of scipy.signal.csd, and memory from a file: `benchmarks/frf_speed.py`.

From arrays: 60 s at 10240 Hz, 3 forces, 3 and 12 responses, Hann segments of 4 s with half overlap; the peers see the
same samples. pyFRF (PyPI) has no multi-input estimator; it is given each force with each response in turn.
From a file: 24 channels (3 forces) at 10240 Hz for the time asked (an hour by default) recorded to a temporary file,
then estimated; the throughput is printed beside that of the bare Fourier transforms of the same segments.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import resource
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from estimation import SpectralAccumulator, SpectralSettings, cross_spectra, h1

RATE, SEGMENT = 10240.0, 40960
SETTINGS = SpectralSettings(SEGMENT, 0.5, "hann")
Samples = NDArray[np.float64]


def channels(n_responses: int) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """Three forces and accelerations."""
    forces = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in "xyz")
    motions = tuple(Channel(f"a{n}", "acceleration", "m/s^2", f"P{n}", "+X") for n in range(n_responses))
    return forces, motions


def own(force: Samples, motion: Samples) -> None:
    """This package: all spectra, H1, coherence, covariance."""
    accumulator = SpectralAccumulator(*channels(motion.shape[1]), RATE, SETTINGS)
    accumulator.add(force, motion)
    h1(accumulator.result())


def scipy_loops(force: Samples, motion: Samples) -> None:
    """Every needed pair by scipy.signal.csd, then the same matrix solution."""
    from scipy import signal  # not before the memory of the file's estimate was measured

    options = {"fs": RATE, "nperseg": SEGMENT, "window": "hann"}
    s_ff = np.array([[signal.csd(v, u, **options)[1] for v in force.T] for u in force.T])
    s_xf = np.array([[signal.csd(f, x, **options)[1] for f in force.T] for x in motion.T])
    for x in motion.T:
        signal.welch(x, **options)
    np.moveaxis(s_xf, 2, 0) @ np.linalg.inv(np.moveaxis(s_ff, 2, 0))


def pyfrf(force: Samples, motion: Samples) -> None:
    """pyFRF: one force at a time."""
    import pyFRF

    options = {"window": "hann", "nperseg": SEGMENT, "noverlap": SEGMENT // 2, "fft_len": SEGMENT}
    for f in force.T:
        for x in motion.T:
            pyFRF.FRF(sampling_freq=int(RATE), exc=f, resp=x, **options).get_H1()


def seconds(job: Callable[[Samples, Samples], None], force: Samples, motion: Samples) -> float | None:
    """Smallest of three times; None where the peer is not installed."""
    times = []
    for _ in range(3):
        started = time.perf_counter()
        try:
            job(force, motion)
        except ModuleNotFoundError:
            return None
        times.append(time.perf_counter() - started)
    return min(times)


def from_arrays() -> None:
    """The table of ratios."""
    rng = np.random.default_rng(0)
    force = rng.standard_normal((int(60 * RATE), 3))
    print(f"{'responses':>9s} {'millfrf s':>10s} {'pyFRF s':>9s} {'ratio':>7s} {'csd loops s':>12s} {'ratio':>7s}")
    for n_responses in (3, 12):
        motion = force @ rng.standard_normal((3, n_responses)) + rng.standard_normal((len(force), n_responses))
        mine = seconds(own, force, motion)
        assert mine is not None
        peers = [seconds(job, force, motion) for job in (pyfrf, scipy_loops)]
        cells = [("missing", "-") if peer is None else (f"{peer:.3f}", f"{mine / peer:.3f}") for peer in peers]
        print(f"{n_responses:9d} {mine:10.3f} {cells[0][0]:>9s} {cells[0][1]:>7s} {cells[1][0]:>12s} {cells[1][1]:>7s}")


def from_file(duration: float) -> None:
    """Throughput and peak memory of a long recording."""
    forces, motions = channels(21)
    rng = np.random.default_rng(0)
    block = rng.standard_normal((int(RATE), 24)).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.h5"
        with RecordingWriter(path, (StreamDescription("main", RATE, 0.0, (*forces, *motions)),)) as writer:
            for _ in range(int(duration)):
                writer.append("main", block)
        del block
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with Recording(path) as recording:
            started = time.perf_counter()
            cross_spectra(recording, SETTINGS)
            mine = time.perf_counter() - started
    n_segments = int((duration * RATE - SEGMENT) / (SEGMENT / 2)) + 1
    segments = rng.standard_normal((24, SEGMENT))
    started = time.perf_counter()
    for _ in range(20):
        fft.rfft(segments, axis=1)
    bare = (time.perf_counter() - started) / 20 * n_segments
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\nfrom file: {duration:g} s of 24 channels in {mine:.1f} s, {duration / mine:.0f} times real time")
    print(f"bare Fourier transforms of its {n_segments} segments: {bare:.1f} s (share {bare / mine:.2f})")
    print(f"peak memory {peak:.0f} MB (before the estimate {before / 1024:.0f} MB)")


def main() -> None:
    """Both tables; the file first, so that its peak memory is its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0, help="length of the recording")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    from_file(options.seconds)
    from_arrays()


if __name__ == "__main__":
    main()
