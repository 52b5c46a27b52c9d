"""Plan of speed sweeps: three immersions with independent forces, and the duration for a wanted error."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from millfrf.core import Complex, InputError, Real

if TYPE_CHECKING:
    from millfrf.cutting import MillingProcess


@dataclass(frozen=True)
class SweepDemand:
    """Demands on a plan of sweeps: band, noise, wanted error.

    Parameters
    ----------
    band : Hz
        Lowest and highest frequency that must be excited.
    depth : m
        Axial depth of the sweeps.
    resolution : Hz
        Width over which lines may be averaged: well below the half-power bandwidth of the narrowest mode.
    response_noise : m/sqrt(Hz)
        Root of the power spectral density of a response's noise at the band's centre, as displacement.
    frf_error : m/N
        Largest standard deviation that any FRF entry may have.
    widths : rad
        Immersion widths that the fixture allows.
    """

    band: tuple[float, float]
    depth: float
    resolution: float
    response_noise: float
    frf_error: float
    widths: tuple[float, ...] = (math.pi / 6, math.pi / 4, math.pi / 3)

    def __post_init__(self) -> None:
        if not 0 < self.band[0] < self.band[1]:
            raise InputError(f"band {self.band[0]:g} to {self.band[1]:g} Hz is empty; give 0 < low < high")
        for name in ("depth", "resolution", "response_noise", "frf_error"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value!r} must be positive and finite")
        if not self.widths or not all(0 < width <= math.pi for width in self.widths):
            raise InputError("widths must lie in 0 ... 180 degrees; give at least one")


@dataclass(frozen=True)
class SweepPlan:
    """Sweeps that excite a band in all directions."""

    processes: "tuple[MillingProcess, ...]"  # the cutter in each immersion, one process per test
    spindle_speeds: tuple[float, float]  # rad/s, first and last of every sweep
    duration: float  # s, of each sweep
    frequencies: Real  # (n_frequencies,), Hz
    singular_values: Real  # (n_frequencies, 3), N^2/Hz, of the one-sided force spectra averaged over the tests
    frf_errors: Real  # (n_frequencies, 3), m/N, standard deviation of the FRF entries, one column per excitation
    condition: float  # largest over smallest singular value, worst over the band


def plan_sweeps(cutter: "MillingProcess", demand: SweepDemand) -> SweepPlan:
    """Choose three immersions and the duration of their sweeps.

    The tooth-passing line sweeps the band. The time that a line spends at a frequency falls with its rate, so that a
    sweep's force spectrum is ``2 c c^H / (h (f_high - f_low))`` with c the force's h-th coefficient (stationary phase).
    The three immersions are chosen so that the smallest singular value of their vectors c is largest. The duration
    follows from ``var H[:, q] = S_nn inv(S_ff)[q, q] / (B T)`` (Bendat & Piersol, Random Data, 4th ed., section 9.2)
    for n tests of length T and bandwidth B.

    Parameters
    ----------
    cutter
        Teeth, coefficients and feed of the cutter; the immersion it states is not used.
    demand
        Band, depth, noise and wanted error.

    Raises
    ------
    InputError
        No three immersions give independent forces: the axial coefficient is zero, or the feed is.
    """
    from millfrf.cutting import force_harmonics  # not at the top: numba takes 0.3 s

    candidates = _candidates(cutter, demand.widths)
    vectors = np.array([force_harmonics(process, 1)[1] for process in candidates]) * demand.depth
    triples = np.array(list(combinations(range(len(candidates)), 3)))
    smallest = np.linalg.svd(vectors[triples], compute_uv=False)[:, -1]
    best = triples[int(np.argmax(smallest))]
    if smallest.max() < 1e-6 * np.abs(vectors).max():  # dependent up to rounding
        raise InputError(
            f"no three immersions give independent forces with kac = {cutter.kac:g} and feed "
            f"{cutter.feed_per_tooth:g} m; a cutter without axial force excites no third direction"
        )
    processes = tuple(candidates[number] for number in best)
    low, high = demand.band
    frequencies = np.linspace(low, high, 101)
    spectra = predicted_spectra(processes, demand.depth, demand.band, frequencies)
    try:
        inverse = np.linalg.inv(spectra)
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"no forces in {low:g} to {high:g} Hz with depth_m = {demand.depth:g} and feed "
            f"{cutter.feed_per_tooth:g} m; give a depth and a feed that cut"
        ) from error
    # standard deviations of the FRF from one test of one second
    deviation = np.sqrt(np.real(np.einsum("kqq->kq", inverse)) * demand.response_noise**2 / demand.resolution)
    duration = float((deviation.max() / demand.frf_error) ** 2 / len(processes))
    # a sweep must stay near each line for some periods of its bandwidth
    duration = max(duration, 10 / demand.resolution)
    values = np.asarray(np.linalg.svd(spectra, compute_uv=False), dtype=np.float64)
    rate = 2 * math.pi / cutter.teeth
    return SweepPlan(
        processes,
        (low * rate, high * rate),
        duration,
        frequencies,
        values,
        deviation / math.sqrt(len(processes) * duration),
        float((values[:, 0] / values[:, -1]).max()),
    )


def predicted_spectra(
    processes: "Sequence[MillingProcess]", depth: float, band: tuple[float, float], frequencies: Real
) -> Complex:
    """Compute the force spectra of tooth-passing sweeps over ``band``, averaged over the tests.

    They are one-sided, (n_frequencies, 3, 3), N^2/Hz.
    """
    from millfrf.cutting import force_harmonics  # not at the top: numba takes 0.3 s

    low, high = band
    n_harmonics = 6  # of the tooth passing
    total = np.zeros((len(frequencies), 3, 3), dtype=complex)
    for process in processes:
        coefficients = depth * force_harmonics(process, n_harmonics)
        for harmonic in range(1, n_harmonics + 1):
            swept = (frequencies >= harmonic * low) & (frequencies <= harmonic * high)
            c = coefficients[harmonic]
            total[swept] += 2 * np.outer(c, c.conj()) / (harmonic * (high - low))
    return np.asarray(total / len(processes))


def _candidates(cutter: "MillingProcess", widths: Sequence[float]) -> "list[MillingProcess]":
    """Return the cutter in every immersion of an allowed width, with starts 7.5 degrees apart."""
    return [
        replace(cutter, start_angle=float(start), exit_angle=min(float(start) + width, math.pi))
        for width in widths
        for start in np.linspace(0, math.pi, 25)
        if start + width <= math.pi + 1e-9
    ]
