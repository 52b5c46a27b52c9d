"""Time of a fit of recordings, in dense Gauss-Newton steps of the same size: `python -m benchmarks.fit_speed`.

Three simulated speed sweeps of 60 s, fitted from 13 to 60 Hz. A dense step forms the normal matrix from a Jacobian that
is already there, with the columns of all tests on all lines; a plain fit takes some tens of such steps for each number
of fixed poles, and forms the Jacobian each time. Processor times, the smallest of some runs that take turns.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import time
from collections.abc import Callable

import numpy as np

from estimation import BandRecording, Resampler, whole_ratio
from millfrf.cutting import MillingProcess
from modal_fit import fit_subspace
from modal_fit.maximum_likelihood.likelihood_fit import best_fit
from modal_fit.maximum_likelihood.whole_records import record_spectra
from replay_data import LinearSweep, MillingCell, default_structure, milling_sensors

BAND = (13.0, 60.0)
RPM = np.pi / 30
IMMERSIONS = ((0.38, 0.61), (0.77, 1.0), (0.0, 0.23))  # central, down, up milling, in units of pi


def sweeps() -> list[BandRecording]:
    """Three sweeps reduced to the band."""
    records = []
    for seed, (start, stop) in enumerate(IMMERSIONS):
        cut = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, start * np.pi, stop * np.pi, 0.1e-3, runout=5e-6)
        speed, sensors = LinearSweep(450 * RPM, 690 * RPM, 60.0), milling_sensors(0.01, 0.01)
        cell = MillingCell(default_structure(), cut, 2e-3, speed, 60.0, sensors=sensors, seed=seed)
        resampler = Resampler(10240.0, whole_ratio(10240.0, 1.5 * BAND[1]))
        samples, channels = resampler.add(cell.samples()), cell.streams[0].channels
        sides = (samples[:, :3], samples[:, 3:], channels[:3], channels[3:])
        records.append(BandRecording(f"test {seed + 1}", resampler.rate, *sides))
    return records


def seconds(job: Callable[[], object]) -> float:
    """Processor time of a run."""
    started = time.process_time()
    job()
    return time.process_time() - started


def main() -> None:
    """Print the times."""
    records = sweeps()
    poles, spectra = fit_subspace(records, BAND).model.poles, record_spectra(records, BAND)
    fit = best_fit(poles, spectra, BAND)[0]
    rows, columns = 2 * spectra.response.size, len(fit.covariance)
    jacobian = np.random.default_rng(0).standard_normal((rows, columns))
    jobs = {
        "poles of all orders and the fit": lambda: fit_subspace(records, BAND),
        "likelihood fit": lambda: best_fit(poles, spectra, BAND),
        "a dense step": lambda: jacobian.T @ jacobian,
    }
    runs = [{name: seconds(job) for name, job in jobs.items()} for _ in range(5)]
    least = {name: min(run[name] for run in runs) for name in jobs}
    print(f"{len(poles)} modes, {len(spectra.s)} lines of {spectra.n_tests} tests, {columns} unknowns")
    for name, taken in least.items():
        print(f"{name:>32s} {taken:7.3f} s {taken / least['a dense step']:7.1f} dense steps")


if __name__ == "__main__":
    main()
