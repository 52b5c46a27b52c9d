"""Plan speed sweeps: which three immersions, how long, so that the forces are independent and the FRF certain."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real

if TYPE_CHECKING:
    from millfrf.cutting import MillingProcess

_HARMONICS = 6
_STEPS = 24  # of the immersion's start over 180 degrees


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
        Standard deviation density of a response's noise at the band's centre, as displacement.
    frf_error : m/N
        Largest standard deviation wanted of any FRF entry.
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
    """Sweeps that excite a band in all directions.

    Parameters
    ----------
    processes
        Milling process of the cutter in each immersion, one a test.
    spindle_speeds : rad/s
        First and last speed of every sweep.
    duration : s
        Duration of each sweep.
    frequencies : (n_frequencies,), Hz
        Frequencies at which the errors are predicted.
    singular_values : (n_frequencies, 3), N^2/Hz
        Predicted singular values of the one-sided force spectra averaged over the tests.
    frf_errors : (n_frequencies, 3), m/N
        Predicted standard deviation of an FRF entry at ``resolution``, one column an excitation.
    condition
        Largest over smallest singular value, at worst over the band.
    """

    processes: "tuple[MillingProcess, ...]"
    spindle_speeds: tuple[float, float]
    duration: float
    frequencies: Real
    singular_values: Real
    frf_errors: Real
    condition: float


def plan_sweeps(cutter: "MillingProcess", demand: SweepDemand) -> SweepPlan:
    """Choose three immersions and the duration of their sweeps.

    The tooth-passing line sweeps the band. A line dwells on a frequency for a time that falls with its rate, so that
    a sweep's force spectrum is ``2 c c^H / (h (f_high - f_low))`` with c the force's h-th coefficient (stationary
    phase). Three tests are independent as far as their three vectors c are: the immersions are those with the
    largest smallest singular value. The duration follows from ``var H[:, q] = S_nn inv(S_ff)[q, q] / (B T)``
    (Bendat & Piersol, Random Data, 4th ed., section 9.2) for n tests of length T and bandwidth B.

    Parameters
    ----------
    cutter
        Teeth, coefficients, feed; its own immersion is not used.
    demand
        Band, depth and what is wanted.

    Raises
    ------
    InputError
        No three immersions give independent forces: the axial coefficient is zero, or the feed is.
    """
    from millfrf.cutting import force_harmonics

    candidates = _candidates(cutter, demand)
    vectors = np.array([force_harmonics(process, 1)[1] for process in candidates]) * demand.depth
    triples = np.array(list(combinations(range(len(candidates)), 3)))
    smallest = np.linalg.svd(vectors[triples], compute_uv=False)[:, -1]
    best = triples[int(np.argmax(smallest))]
    if smallest.max() < 1e-6 * np.abs(vectors).max():
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
    weakest = np.sqrt(np.real(np.einsum("kqq->kq", inverse)) * demand.response_noise**2 / demand.resolution)
    duration = float((weakest.max() / demand.frf_error) ** 2 / len(processes))
    shortest = 10 / demand.resolution  # a sweep must dwell on each line for some periods of its bandwidth
    duration = max(duration, shortest)
    values = np.asarray(np.linalg.svd(spectra, compute_uv=False), dtype=np.float64)
    rate = 2 * math.pi / cutter.teeth
    return SweepPlan(
        processes,
        (low * rate, high * rate),
        duration,
        frequencies,
        values,
        weakest / math.sqrt(len(processes) * duration),
        float((values[:, 0] / values[:, -1]).max()),
    )


def predicted_spectra(
    processes: "Sequence[MillingProcess]", depth: float, band: tuple[float, float], frequencies: Real
) -> NDArray[np.complex128]:
    """One-sided force spectra of sweeps of the tooth-passing line over ``band``, averaged over the tests.

    Returns
    -------
    (n_frequencies, 3, 3), N^2/Hz
    """
    from millfrf.cutting import force_harmonics

    low, high = band
    total = np.zeros((len(frequencies), 3, 3), dtype=complex)
    for process in processes:
        coefficients = depth * force_harmonics(process, _HARMONICS)
        for harmonic in range(1, _HARMONICS + 1):
            swept = (frequencies >= harmonic * low) & (frequencies <= harmonic * high)
            c = coefficients[harmonic]
            total[swept] += 2 * np.outer(c, c.conj()) / (harmonic * (high - low))
    return np.asarray(total / len(processes), dtype=np.complex128)


def _candidates(cutter: "MillingProcess", demand: SweepDemand) -> "list[MillingProcess]":
    """The cutter in every immersion of an allowed width on a grid of starts."""
    found = []
    for width in demand.widths:
        for start in np.linspace(0, math.pi, _STEPS + 1):
            if start + width <= math.pi + 1e-9:
                exit_angle = min(float(start) + width, math.pi)
                found.append(replace(cutter, start_angle=float(start), exit_angle=exit_angle))
    return found
