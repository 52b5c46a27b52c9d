"""Poles of all orders 1 ... 60: this package against sdypy-EMA and pyOMA-2. `python benchmarks/pole_speed.py`.

9 FRFs (3 responses, 3 excitations) and 300 FRFs (100 responses, 3 excitations) of 801 lines each. The peers, from PyPI
(`sdypy-EMA`, `pyOMA-2`), see the same lines: sdypy all FRFs as one list with a common denominator, pyOMA-2 the matrix
as if it were half spectra. Each time is the smallest of three (of one for pyOMA-2); BLAS threads are pinned to one.

The peers' polynomials have real coefficients: order 60 holds 30 modes. Ours are complex on a one-sided band: degree 30
holds 30 modes an excitation. Both the degree of equal modes and degree 60 are shown.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import contextlib
import io
import logging
import time
import warnings
from collections.abc import Callable

import numpy as np

from estimation import Frf
from modal_fit import ModalModel
from modal_fit.stabilisation import matrix_fraction_poles

ORDER = 60
BAND = (10.0, 410.0)
AXIS = np.linspace(*BAND, 801)
REPEATS = 3


def simulated(n_responses: int) -> Frf:
    """Ten modes seen at many responses, with 0.1 % noise."""
    rng = np.random.default_rng(1)
    omega = 2 * np.pi * np.linspace(40, 380, 10)
    zeta = rng.uniform(0.005, 0.03, 10)
    model = ModalModel(
        poles=omega * (-zeta + 1j * np.sqrt(1 - zeta**2)),
        right=rng.standard_normal((10, n_responses)) + 0j,
        left=rng.standard_normal((10, 3)) * 1e-6j,
        responses=tuple(f"P{k}:+X" for k in range(n_responses)),
        excitations=("P0:+X", "P1:+X", "P2:+X"),
    )
    frf = model.frf(AXIS)
    noise = rng.standard_normal((2, *frf.values.shape)) * 1e-3 * np.std(frf.values)
    return Frf(
        AXIS, frf.values + noise[0] + 1j * noise[1], frf.responses, frf.excitations, frf.quantity, frf.unit, frf.valid
    )


def own(frf: Frf) -> int:
    """This package, as many modes as the peers' order has."""
    return sum(len(order.poles) for order in matrix_fraction_poles(frf, BAND, ORDER // 2))


def own_twice(frf: Frf) -> int:
    """This package, twice as many modes."""
    return sum(len(order.poles) for order in matrix_fraction_poles(frf, BAND, ORDER))


def sdypy(frf: Frf) -> int:
    """sdypy-EMA."""
    from sdypy import EMA

    flat = frf.values.reshape(len(AXIS), -1).T
    model = EMA.Model(flat, AXIS, lower=BAND[0], upper=BAND[1], pol_order_high=ORDER, frf_form="receptance")
    model.get_poles(show_progress=False)
    return sum(len(np.atleast_1d(poles)) for poles in model.all_poles)


def pyoma(frf: Frf) -> int:
    """pyOMA-2."""
    from pyoma2.functions import plscf

    spectra = np.ascontiguousarray(np.moveaxis(frf.values, 0, 2))
    step = 1 / (2 * BAND[1])
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        denominators, numerators = plscf.pLSCF(spectra, step, ORDER)
        frequencies, *_ = plscf.pLSCF_poles(denominators, numerators, step, "per", 2 * len(AXIS))
    return int(np.isfinite(np.asarray(frequencies, dtype=float)).sum())


def seconds(job: Callable[[Frf], int], frf: Frf, repeats: int) -> float | None:
    """Smallest time of some runs; None where the peer is not installed."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        try:
            job(frf)
        except ModuleNotFoundError:
            return None
        times.append(time.perf_counter() - started)
    return min(times)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    logging.disable(logging.CRITICAL)
    heads = ("FRFs", "degree", "millfrf s", "sdypy s", "ratio", "pyOMA-2 s", "ratio")
    print("{:>5s} {:>6s} {:>10s} {:>10s} {:>8s} {:>10s} {:>8s}".format(*heads))
    for n_responses in (3, 100):
        frf = simulated(n_responses)
        peers = [seconds(sdypy, frf, REPEATS), seconds(pyoma, frf, 1)]
        for degree, job in ((ORDER // 2, own), (ORDER, own_twice)):
            mine = seconds(job, frf, REPEATS)
            assert mine is not None
            cells = [("missing", "-") if peer is None else (f"{peer:.2f}", f"{mine / peer:.4f}") for peer in peers]
            row = " ".join(f"{a:>10s} {b:>8s}" for a, b in cells)
            print(f"{3 * n_responses:5d} {degree:6d} {mine:10.3f} {row}", flush=True)


if __name__ == "__main__":
    main()
