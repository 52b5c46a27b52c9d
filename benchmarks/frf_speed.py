"""Speed of the FRF against a lean numpy H1, pyFRF and scipy.signal.csd, and from a file: `benchmarks/frf_speed.py`.

From arrays: 60 s at 10240 Hz, 3 forces, 3 and 12 responses, Hann segments of 4 s with half overlap; the peers see the
same samples. The lean H1 is what one would write with numpy: transforms of windowed segments, products summed over
them, one solution a line; no coherence, no covariance. pyFRF (PyPI) has no multi-input estimator; it is given each
force with each response in turn.
From a file: 24 channels (3 forces) at 10240 Hz for the time asked (an hour by default) recorded to a temporary file,
then estimated, beside the bare Fourier transforms of the same segments.
Elapsed and processor time; this package uses two threads, the peers one. The smallest of some runs that take turns.
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
    h1(accumulator.finish())


def lean(force: Samples, motion: Samples) -> None:
    """Plain numpy, all segments at once: H1 and the power of each response."""
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(SEGMENT) / SEGMENT)

    def lines(samples: Samples) -> NDArray[np.complex128]:
        segments = np.lib.stride_tricks.sliding_window_view(samples, SEGMENT, axis=0)[:: SEGMENT // 2]
        return np.fft.rfft((segments - segments.mean(axis=2, keepdims=True)) * window)

    f, x = lines(force), lines(motion)
    adjoint = f.conj().transpose(2, 0, 1)
    s_ff, s_xf = f.transpose(2, 1, 0) @ adjoint, x.transpose(2, 1, 0) @ adjoint
    np.einsum("spk,spk->kp", x, x.conj())
    np.linalg.solve(s_ff.transpose(0, 2, 1), s_xf.transpose(0, 2, 1))


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


def seconds(job: Callable[[Samples, Samples], None], force: Samples, motion: Samples) -> tuple[float, float] | None:
    """Elapsed and processor time of a run; None where the peer is not installed."""
    started = time.perf_counter(), time.process_time()
    try:
        job(force, motion)
    except ModuleNotFoundError:
        return None
    return time.perf_counter() - started[0], time.process_time() - started[1]


def from_arrays() -> None:
    """The table of ratios; jobs take turns, so that a change of the machine's speed meets all of them."""
    rng = np.random.default_rng(0)
    force = rng.standard_normal((int(60 * RATE), 3))
    print(f"{'responses':>9s} {'':>12s} {'elapsed s':>10s} {'processor s':>12s} {'millfrf /':>10s} {'millfrf /':>12s}")
    for n_responses in (3, 12):
        motion = force @ rng.standard_normal((3, n_responses)) + rng.standard_normal((len(force), n_responses))
        jobs = {"millfrf": own, "lean numpy": lean, "pyFRF": pyfrf, "csd loops": scipy_loops}
        runs = [{name: seconds(job, force, motion) for name, job in jobs.items()} for _ in range(5)]
        mine = None
        for name in jobs:
            times = [each for run in runs if (each := run[name]) is not None]
            if not times:
                print(f"{n_responses:9d} {name:>12s} {'missing':>10s}")
                continue
            least = np.min(times, axis=0)
            mine = least if mine is None else mine
            ratios = "{:10.2f} {:12.2f}".format(*(mine / least))
            print(f"{n_responses:9d} {name:>12s} {least[0]:10.3f} {least[1]:12.3f} {ratios}")


def bare_transforms() -> tuple[float, float]:
    """Elapsed and processor time of the Fourier transforms of one segment of 24 channels."""
    segments = np.random.default_rng(0).standard_normal((24, SEGMENT))
    times = []
    for _ in range(20):
        started = time.perf_counter(), time.process_time()
        fft.rfft(segments, axis=1)
        times.append((time.perf_counter() - started[0], time.process_time() - started[1]))
    return tuple(np.min(times, axis=0).tolist())


def from_file(duration: float) -> None:
    """Time in bare transforms, and peak memory, of a long recording."""
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
        times = []
        for _ in range(3):
            with Recording(path) as recording:
                started = time.perf_counter(), time.process_time()
                cross_spectra(recording, SETTINGS)
                times.append((time.perf_counter() - started[0], time.process_time() - started[1]))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    n_segments = int((duration * RATE - SEGMENT) / (SEGMENT / 2)) + 1
    mine, bare = np.min(times, axis=0), n_segments * np.array(bare_transforms())
    print(f"from file: {duration:g} s of 24 channels in {mine[0]:.2f} s, {duration / mine[0]:.0f} times real time")
    print(f"bare Fourier transforms of its {n_segments} segments: {bare[0]:.2f} s")
    print("over bare transforms: elapsed {:.2f}, processor time {:.2f}".format(*(mine / bare)))
    print(f"peak memory {peak:.0f} MB (before the estimate {before / 1024:.0f} MB)\n")


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
