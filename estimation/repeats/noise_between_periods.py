"""Noise from repeated periods or recordings: all that does not repeat."""

from collections.abc import Sequence

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real

from ..band_recordings.band_recording import BandRecording
from .cut_periods import Realisation, SteadyPeriods, steady_periods
from .noise import PERIODS, REPEATS, MeasuredNoise, averaged_lines, noise_bound, noise_in_silence, parted
from .period_search import ALIKE, find_repeats

DRIFT = 0.5
"""Von Neumann's ratio below which the periods drift: white noise has 1, a straight drift 0."""


def covariance_of_periods(periods: SteadyPeriods) -> tuple[Complex, int]:
    """Joint covariance of the noise of one period at each line, forces first, and its complex degrees of freedom.

    ``C = sum_m sum_i (Z_mi - Z_m)(Z_mi - Z_m)^H / sum_m (P_m - 1)`` over the periods i of each realisation m with the
    mean Z_m: the robust method (Pintelon & Schoukens, System Identification, 2nd ed., section 4.3.1).

    Parameters
    ----------
    periods
        Steady periods of one or more realisations.

    Returns
    -------
    (n_lines, n_excitations + n_responses, n_excitations + n_responses), int
    """
    total: Complex | None = None
    freedom = 0
    for one in periods.realisations:
        joint = np.concatenate([one.forces, one.responses], axis=2)
        away = (joint - joint.mean(axis=0)).transpose(1, 2, 0)
        part = away @ away.conj().transpose(0, 2, 1)
        total = part if total is None else total + part
        freedom += one.n_periods - 1
    if total is None:
        raise InputError("no realisation; give the periods of at least one")
    return np.asarray(total / freedom), freedom


def drift_of(periods: SteadyPeriods) -> Real:
    """Von Neumann's ratio of each response, (n_responses,): mean squared change over twice the variance.

    1 for noise that is independent from period to period, 0 for a slow drift (Ann. Math. Stat. 12, 367, 1941).
    """
    change, spread, count, freedom = 0.0, 0.0, 0, 0
    for one in periods.realisations:
        change = change + np.sum(np.abs(np.diff(one.responses, axis=0)) ** 2, axis=(0, 1))
        spread = spread + np.sum(np.abs(one.responses - one.responses.mean(axis=0)) ** 2, axis=(0, 1))
        count, freedom = count + one.n_periods - 1, freedom + one.n_periods - 1
    return np.asarray((change / (2 * count)) / np.maximum(spread / freedom, 1e-300))


def noise_of_periods(periods: SteadyPeriods) -> MeasuredNoise:
    """Noise of a record of that length and place, from the differences between steady periods.

    Parameters
    ----------
    periods
        Steady periods of one level; see :func:`steady_periods`.

    Examples
    --------
    >>> from estimation import BandRecording, channels_of, steady_periods
    >>> rng = np.random.default_rng(0)
    >>> force = np.tile(rng.normal(size=(512, 1)), (8, 1))
    >>> motion = 3 * force + 0.1 * rng.normal(size=force.shape)
    >>> channels = channels_of("force", ["P:+X"]), channels_of("displacement", ["P:+X"])
    >>> noise = noise_of_periods(steady_periods([BandRecording("r", 512.0, force, motion, *channels)]))
    >>> noise.kind, bool(abs(noise.response_level()[0] - 0.1) < 0.01)
    ('periods', True)
    """
    covariance, freedom = covariance_of_periods(periods)
    counts = [one.n_periods for one in periods.realisations]
    said = f"{sum(counts)} steady periods of {periods.period:.4g} s"
    if len(counts) > 1:
        said += f" in {len(counts)} realisations"
    left = sum(one.left_out for one in periods.realisations)
    if left:
        said += f", {left} left out as transient"
    elif max(counts) < 4:
        said += ", taken as steady"
    drift = drift_of(periods)
    if max(counts) >= 4 and drift.min() < DRIFT:
        worst = periods.responses[int(drift.argmin())].name
        said += (
            f"; most of what differs drifts slowly from period to period ({worst}: changes carry "
            f"{100 * drift.min():.0f} % of the variance), and is counted as noise"
        )
    return _noise(periods, covariance, freedom, PERIODS, f"Differences between {said}.")


def noise_of_repeats(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Noise from recordings of one force that was played several times: what differs between them.

    Parameters
    ----------
    recordings
        Two recordings or more that begin at the same sample of the same force; all are cut to the shortest.
    band : Hz
        Lowest and highest frequency of the lines.

    Raises
    ------
    InputError
        Fewer than two recordings, or forces that are not the same.
    """
    if not same_at_once(recordings):
        raise InputError(f"{len(recordings)} recordings do not hold one force twice; give repeats of one test")
    n, first = min(len(one.force) for one in recordings), recordings[0]
    kept = np.arange(1, int(first.usable_band * n / first.rate) + 1)
    forces, responses = (
        np.array([scipy.fft.rfft(x[:n] - x[:n].mean(axis=0), axis=0)[kept] / np.sqrt(n) for x in each])
        for each in ([one.force for one in recordings], [one.response for one in recordings])
    )
    one = Realisation(first.name, forces, responses, 0)
    frequencies = kept * first.rate / n
    periods = SteadyPeriods(frequencies, first.rate, n / first.rate, (one,), first.excitations, first.responses)
    periods = periods.within(band)
    covariance, freedom = covariance_of_periods(periods)
    said = f"Differences between {len(recordings)} recordings of the same force over {n / first.rate:.4g} s."
    return _noise(periods, covariance, freedom, REPEATS, said)


def same_at_once(recordings: Sequence[BandRecording]) -> bool:
    """Whether recordings, two at least, hold the same forces at the same samples and level."""
    if len(recordings) < 2:
        return False
    n = min(len(one.force) for one in recordings)
    forces = [one.force[:n] - one.force[:n].mean(axis=0) for one in recordings]
    for other in forces[1:]:
        if other.shape != forces[0].shape:
            return False
        misfit = np.sum((other - forces[0]) ** 2)
        if misfit > (1 - ALIKE) * (np.sum(other**2) + np.sum(forces[0] ** 2)) or not np.any(other):
            return False
    return True


def _noise(periods: SteadyPeriods, covariance: Complex, freedom: int, kind: str, said: str) -> MeasuredNoise:
    m = len(periods.excitations)
    averaged, behind = averaged_lines(covariance, freedom)
    responses, forces, cross = parted(averaged, m)
    power = sum(
        np.concatenate([(np.abs(one.forces.mean(axis=0)) ** 2), np.abs(one.responses.mean(axis=0)) ** 2], axis=1)
        for one in periods.realisations
    ) / len(periods.realisations)
    share = np.sqrt(np.einsum("kpp->p", covariance).real / np.maximum(np.sum(power, axis=0), 1e-300))
    return MeasuredNoise(
        periods.frequencies, periods.rate, responses, forces, cross, kind, behind, share[m:], share[:m], said
    )


def measured_noise(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Measure the noise of recordings of one level by the first of these that they allow.

    Periods of the forces; recordings that repeat one force; stretches without force; else the upper bound of
    :func:`noise_bound`.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate.
    band : Hz
        Lowest and highest frequency of the lines.

    Raises
    ------
    InputError
        No recording, or a band in which none of these can be had.
    """
    if not recordings:
        raise InputError("no recording; give at least one")
    if all(find_repeats(one.force) is not None for one in recordings):
        return noise_of_periods(steady_periods(recordings).within(band))
    if same_at_once(recordings):
        return noise_of_repeats(recordings, band)
    return noise_in_silence(recordings, band) or noise_bound(recordings, band)
