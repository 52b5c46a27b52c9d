"""Noise from repeated periods or recordings: the part of the signals that does not repeat."""

from collections.abc import Sequence

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real

from ..band_recordings.band_recording import BandRecording
from ..settings import PERIODS
from .cut_periods import Realisation, SteadyPeriods, steady_periods
from .noise import MeasuredNoise, averaged_lines, noise_bound, noise_in_silence, split_covariance
from .period_search import find_repeats


def covariance_of_periods(periods: SteadyPeriods) -> tuple[Complex, int]:
    """Compute the covariance (n_lines, n, n) of the noise of one period, and its complex degrees of freedom.

    Forces come first, then responses.

    ``C = sum_m sum_i (Z_mi - Z_m)(Z_mi - Z_m)^H / sum_m (P_m - 1)`` over the periods i of each realisation m with the
    mean Z_m: the robust method (Pintelon & Schoukens, System Identification, 2nd ed., section 4.3.1).
    """
    products = []
    for realisation in periods.realisations:
        joint = np.concatenate([realisation.forces, realisation.responses], axis=2)
        deviation = (joint - joint.mean(axis=0)).transpose(1, 2, 0)
        products.append(deviation @ deviation.conj().transpose(0, 2, 1))
    freedom = sum(realisation.n_periods - 1 for realisation in periods.realisations)
    return np.asarray(sum(products) / freedom), freedom


def drift_of(periods: SteadyPeriods) -> Real:
    """Compute von Neumann's ratio of each response, (n_responses,): mean squared change over twice the variance.

    It is 1 for noise that is independent from period to period, and 0 for a slow drift (Ann. Math. Stat. 12, 367,
    1941).
    """
    change, spread, freedom = 0.0, 0.0, 0
    for realisation in periods.realisations:
        responses = realisation.responses
        change = change + np.sum(np.abs(np.diff(responses, axis=0)) ** 2, axis=(0, 1))
        spread = spread + np.sum(np.abs(responses - responses.mean(axis=0)) ** 2, axis=(0, 1))
        freedom += realisation.n_periods - 1
    return np.asarray((change / (2 * freedom)) / np.maximum(spread / freedom, 1e-300))


def noise_of_periods(periods: SteadyPeriods) -> MeasuredNoise:
    """Measure the noise from the differences between steady periods.

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
    counts = [realisation.n_periods for realisation in periods.realisations]
    source = f"{sum(counts)} steady periods of {periods.period:.4g} s"
    if len(counts) > 1:
        source += f" in {len(counts)} realisations"
    left_out = sum(realisation.left_out for realisation in periods.realisations)
    # neither a transient nor a drift can be found in fewer than four periods
    if left_out:
        source += f", {left_out} left out as transient"
    elif max(counts) < 4:
        source += ", taken as steady"
    drift = drift_of(periods)
    if max(counts) >= 4 and drift.min() < PERIODS.drift:
        worst = periods.responses[int(drift.argmin())].name
        source += (
            f"; most of the differences drift slowly from period to period ({worst}: changes carry "
            f"{100 * drift.min():.0f} % of the variance) and count as noise"
        )
    return _noise(periods, covariance, freedom, "periods", f"Differences between {source}.")


def noise_of_repeats(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Measure the noise in a band (Hz) from differences between recordings of the same force.

    The recordings must begin at the same sample of the force; all are cut to the shortest.
    """
    if not _same_samples(recordings):
        raise InputError(f"{len(recordings)} recordings do not hold one force twice; give repeats of one test")
    n, first = min(len(recording.force) for recording in recordings), recordings[0]
    numbers = np.arange(1, int(first.usable_band * n / first.rate) + 1)
    forces, responses = (
        np.array([scipy.fft.rfft(x[:n] - x[:n].mean(axis=0), axis=0)[numbers] / np.sqrt(n) for x in signals])
        for signals in zip(*((recording.force, recording.response) for recording in recordings), strict=True)
    )
    duration = n / first.rate
    periods = SteadyPeriods(
        numbers * first.rate / n,
        first.rate,
        duration,
        (Realisation(first.name, forces, responses, 0),),
        first.excitations,
        first.responses,
    ).within(band)
    covariance, freedom = covariance_of_periods(periods)
    statement = f"Differences between {len(recordings)} recordings of the same force over {duration:.4g} s."
    return _noise(periods, covariance, freedom, "repeats", statement)


def _same_samples(recordings: Sequence[BandRecording]) -> bool:
    """Return whether recordings, two at least, hold the same forces at the same samples and level."""
    if len(recordings) < 2:
        return False
    n = min(len(recording.force) for recording in recordings)
    first, *others = (recording.force[:n] - recording.force[:n].mean(axis=0) for recording in recordings)
    return all(
        other.shape == first.shape
        and np.any(other)
        and np.sum((other - first) ** 2) <= (1 - PERIODS.alike) * (np.sum(other**2) + np.sum(first**2))
        for other in others
    )


def _noise(periods: SteadyPeriods, covariance: Complex, freedom: int, kind: str, statement: str) -> MeasuredNoise:
    m = len(periods.excitations)
    averaged, averaged_freedom = averaged_lines(covariance, freedom)
    # power of what repeats, forces first
    power = sum(
        np.concatenate([np.abs(each.forces.mean(axis=0)) ** 2, np.abs(each.responses.mean(axis=0)) ** 2], axis=1)
        for each in periods.realisations
    ) / len(periods.realisations)
    share = np.sqrt(np.einsum("kpp->p", covariance).real / np.maximum(np.sum(power, axis=0), 1e-300))
    return MeasuredNoise(
        periods.frequencies,
        periods.rate,
        *split_covariance(averaged, m),
        kind,
        averaged_freedom,
        share[m:],
        share[:m],
        statement,
    )


def measured_noise(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Measure the noise by the first of four methods that the recordings allow.

    The methods are: periods of the forces; recordings that repeat one force; blocks without force; the upper bound of
    ``noise_bound``.

    Parameters
    ----------
    recordings
        Recordings of the same channels, sample rate and level.
    band : Hz
        Lowest and highest frequency of the lines.

    Raises
    ------
    InputError
        No recording, or a band in which no method gives a result.
    """
    if not recordings:
        raise InputError("no recording; give at least one")
    if all(find_repeats(recording.force) is not None for recording in recordings):
        return noise_of_periods(steady_periods(recordings).within(band))
    if _same_samples(recordings):
        return noise_of_repeats(recordings, band)
    return noise_in_silence(recordings, band) or noise_bound(recordings, band)
