"""Plan of speed sweeps: three immersions with independent forces, and the duration for a wanted error."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from millfrf.core import Complex, Index, InputError, Real

if TYPE_CHECKING:
    from millfrf.cutting import MillingProcess

_HARMONICS = 6  # of the tooth passing that are taken into account
_DEPENDENT = 1e-12  # smallest singular value over the largest of all spectra below which it is a rounding error


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
        Immersion widths that the fixture allows; each also allows the central cut with the radial depth of an up cut
        of this width.
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
    The smallest singular value s of the spectra of three immersions limits the FRF error by noise of the responses, and
    their condition k that by noise of the dynamometer, which grows with its range; both act on the variance. A triple
    of immersions loses the larger of ``max(s) / s`` and ``k / min(k)`` of what is attainable. Of all widths, the up,
    the central and the down cut of one radial depth (the layout of Franco et al.) that lose least are the reference;
    chosen are the immersions that lose least among those not worse than the reference in s nor in k. The duration
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
        No three immersions give independent forces: the axial coefficient is zero, or the feed is; or the widths leave
        fewer than three immersions.
    """
    processes = _best_immersions(cutter, demand)
    low, high = demand.band
    frequencies = np.linspace(low, high, 101)
    spectra = predicted_spectra(processes, demand.depth, demand.band, frequencies)
    inverse = np.linalg.inv(spectra)
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
    total = np.zeros((len(frequencies), 3, 3), dtype=complex)
    for process in processes:
        coefficients = depth * force_harmonics(process, _HARMONICS)
        for harmonic in range(1, _HARMONICS + 1):
            swept = (frequencies >= harmonic * low) & (frequencies <= harmonic * high)
            c = coefficients[harmonic]
            total[swept] += 2 * np.outer(c, c.conj()) / (harmonic * (high - low))
    return np.asarray(total / len(processes))


def _best_immersions(cutter: "MillingProcess", demand: SweepDemand) -> "tuple[MillingProcess, ...]":
    """Choose the three immersions as :func:`plan_sweeps` states, or refuse."""
    widths = sorted(set(demand.widths))
    layouts = [_of_one_radial_depth(cutter, width) for width in widths]
    candidates = [*_candidates(cutter, widths), *(central for _, central, _ in layouts)]
    triples = np.array(list(combinations(range(len(candidates)), 3)), dtype=int).reshape(-1, 3)
    smallest, condition = _worst_over_band(candidates, triples, demand)
    if not np.isfinite(condition).any():
        raise InputError(
            f"no three immersions of {', '.join(f'{math.degrees(width):g}' for width in widths)} degrees give "
            f"independent forces with kac = {cutter.kac:g}, feed {cutter.feed_per_tooth:g} m and depth "
            f"{demand.depth:g} m; a cutter without axial force excites no third direction: give its kac, or allow "
            "narrower widths if they are near 180 degrees"
        )
    most, least = smallest.max(), condition.min()
    in_layouts = np.array([_worst_over_band(layout, np.array([[0, 1, 2]]), demand) for layout in layouts])[:, :, 0]
    reference = in_layouts[np.argmin(_loss(in_layouts[:, 0], in_layouts[:, 1], most, least))]
    rounding = 1e-9  # the reference is among the candidates
    as_good = (smallest >= reference[0] * (1 - rounding)) & (condition <= reference[1] * (1 + rounding))
    best = triples[int(np.argmin(np.where(as_good, _loss(smallest, condition, most, least), np.inf)))]
    return tuple(sorted((candidates[number] for number in best), key=lambda process: process.start_angle))


def _loss(smallest: Real, condition: Real, most: float, least: float) -> Real:
    """Return by what factor three immersions are worse than ``most`` or ``least``, whichever is more."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.maximum(most / smallest, condition / least))


def _of_one_radial_depth(cutter: "MillingProcess", width: float) -> "tuple[MillingProcess, ...]":
    """Return the up, the central and the down cut of the radial depth at which an up cut is ``width`` (rad) wide."""
    half = math.asin((1 - math.cos(width)) / 2)
    angles = ((0.0, width), (math.pi / 2 - half, math.pi / 2 + half), (math.pi - width, math.pi))
    return tuple(replace(cutter, start_angle=start, exit_angle=stop) for start, stop in angles)


def _worst_over_band(candidates: "Sequence[MillingProcess]", triples: Index, demand: SweepDemand) -> tuple[Real, Real]:
    """Return the smallest singular value (N^2/Hz) and the condition of each triple's spectra, worst over the band.

    Dependent forces have the values 0 and infinity. The spectra are constant between the frequencies at which a
    harmonic begins or ends.
    """
    low, high = demand.band
    edges = [harmonic * edge for harmonic in range(1, _HARMONICS + 1) for edge in demand.band]
    steps = np.unique([edge for edge in edges if low <= edge <= high])
    between = (steps[:-1] + steps[1:]) / 2
    single = np.array([predicted_spectra([process], demand.depth, demand.band, between) for process in candidates])
    smallest, condition = np.full(len(triples), np.inf), np.zeros(len(triples))
    for spectra in np.moveaxis(single, 1, 0):
        values = np.linalg.eigvalsh(np.add.reduce([spectra[column] for column in triples.T]) / 3)
        low_value, high_value = values[:, 0], values[:, -1]
        low_value[low_value < _DEPENDENT * high_value.max(initial=0.0)] = 0.0
        smallest = np.minimum(smallest, low_value)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = np.maximum(condition, np.where(low_value > 0, high_value / low_value, np.inf))
    return smallest, condition


def _candidates(cutter: "MillingProcess", widths: Sequence[float]) -> "list[MillingProcess]":
    """Return the cutter in every immersion of an allowed width.

    Starts are 7.5 degrees apart, with those of the central cut and of the down cut, which ends at 180 degrees.
    """
    candidates: list[MillingProcess] = []
    for width in sorted(set(widths)):
        latest = math.pi - width
        starts = [*np.arange(0, latest, math.pi / 24), latest / 2, latest]
        distinct = {round(float(start), 9): float(start) for start in starts}
        candidates += [
            replace(cutter, start_angle=start, exit_angle=min(start + width, math.pi)) for start in distinct.values()
        ]
    return candidates
