"""Spectra of the taps of one test, summed over taps."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import Band, Complex, InputError, Real

from ..band_recordings.channel_matching import before_high_pass
from ..frf.quantities import frf_quantity
from .segments import TapSettings, exponential_window, force_window, segments_of
from .taps import FoundTaps


@dataclass(frozen=True)
class TapSums:
    """Products of the spectra of forces f and responses x, summed over the taps of one test.

    Parameters
    ----------
    name
        Name of the test, for messages.
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.
    input_power : (n_frequencies, n_excitations, n_excitations)
        Products of the forces, ``sum f_i conj(f_j)``.
    cross : (n_frequencies, n_responses, n_excitations)
        Products of responses and forces, ``sum x_p conj(f_q)``.
    output_power : (n_frequencies, n_responses)
        Power of the responses, ``sum |x_p|^2``.
    excitations, responses
        Degrees of freedom along the axes.
    counts : (n_excitations,), int
        Number of taps that hit each excitation hardest.
    quantity, unit
        Quantity and unit of responses over forces.
    grounded
        Whether responses hold down to 0 Hz: none of their sensors has a high-pass.
    """

    name: str
    frequencies: Real
    input_power: Complex
    cross: Complex
    output_power: Real
    excitations: tuple[str, ...]
    responses: tuple[str, ...]
    counts: NDArray[np.int64]
    quantity: str
    unit: str
    grounded: bool


def tap_sums(
    found: FoundTaps, settings: TapSettings, band: Band | None = None, places: Collection[str] = ()
) -> TapSums:
    """Cut, window, transform and sum the usable taps of a test.

    The force is cut off after the contact; where there is an exponential window, force and response are multiplied by
    it. Known input delays and the sensors' high-passes are taken out, at the ``s = i w + 1/tau`` where the spectra
    stand. Forces that no tap hit hardest are left out.

    Parameters
    ----------
    found
        Taps of the test; at least one is usable.
    settings
        Lengths of the segments, and windows.
    band : Hz
        Lowest and highest frequency of the lines to keep; None: all.
    places
        Degrees of freedom that taps of other tests hit: the share of an oblique tap of this test there is a force, too.

    Raises
    ------
    InputError
        No usable tap, two channels at one place, responses of different quantities, or a band without lines.
    """
    test, tau = found.test, settings.time_constant
    if not found.used:
        raise InputError(f"{test.path.name}: no tap can be used; tap again, or leave the file out")
    struck = {one.tap.channel for one in found.used}
    hit = [k for k, one in enumerate(test.excitations) if k in struck or one.degree_of_freedom in places]
    forces = [test.excitations[k] for k in hit]
    for channels in (forces, test.responses):
        _check_places(channels, test.path.name)
    quantity, unit = frf_quantity(test.responses, forces)
    f, chosen = _lines(settings, band)
    s = np.asarray(2j * np.pi * f + (0.0 if tau is None else 1 / tau), dtype=np.complex128)
    windows = _windows(settings, len(forces), len(test.responses))
    factors = np.column_stack([_correction(channel, s) for channel in (*forces, *test.responses)])
    columns = [*hit, *range(len(test.excitations), len(test.excitations) + len(test.responses))]
    n = len(forces)
    power, cross = np.zeros((len(f), n, n), complex), np.zeros((len(f), len(test.responses), n), complex)
    output = np.zeros((len(f), len(test.responses)))
    for _, samples in segments_of(found, settings):
        lines = np.fft.rfft(samples[:, columns] * windows, axis=0)[chosen] * factors
        force, answer = lines[:, :n], lines[:, n:]
        power += force[:, :, None] * force[:, None, :].conj()
        cross += answer[:, :, None] * force[:, None, :].conj()
        output += np.abs(answer) ** 2
    return TapSums(
        test.path.name,
        f,
        power,
        cross,
        output,
        tuple(channel.degree_of_freedom for channel in forces),
        tuple(channel.degree_of_freedom for channel in test.responses),
        np.array([sum(one.tap.channel == k for one in found.used) for k in hit], dtype=np.int64),
        quantity,
        unit,
        not any(channel.high_pass_hz for channel in test.responses),
    )


def _lines(settings: TapSettings, band: Band | None) -> tuple[Real, NDArray[np.bool_]]:
    f = np.fft.rfftfreq(settings.length, 1 / settings.sample_rate)
    chosen = np.ones(len(f), dtype=bool) if band is None else (f >= band[0]) & (f <= band[1])
    if not chosen.any():
        assert band is not None
        raise InputError(
            f"no line lies between {band[0]:g} and {band[1]:g} Hz (segments of {settings.duration:g} s have lines up "
            f"to {f[-1]:g} Hz, {f[1]:.3g} Hz apart); widen the band"
        )
    return np.asarray(f[chosen], dtype=float), chosen


def _windows(settings: TapSettings, n_forces: int, n_responses: int) -> Real:
    """(length, n_forces + n_responses)"""
    windows = np.ones((settings.length, n_forces + n_responses))
    if settings.force_samples is not None:
        duration = settings.force_samples / settings.sample_rate
        windows[:, :n_forces] = force_window(settings.length, settings.sample_rate, duration)[:, None]
    if settings.time_constant is not None:
        windows *= exponential_window(settings.length, settings.sample_rate, settings.time_constant)[:, None]
    return windows


def _correction(channel: Channel, s: Complex) -> Complex:
    """Give the factor for a channel's lines: it undoes the delay, and a response's first-order high-pass."""
    factor = np.exp(s * (channel.input_delay_s or 0.0))
    if channel.high_pass_hz and channel.quantity != "force":
        factor = factor * before_high_pass(s, [channel.high_pass_hz])[:, 0]
    return np.asarray(factor)


def _check_places(channels: Sequence[Channel], file: str) -> None:
    there: dict[str, str] = {}
    for channel in channels:
        place = channel.degree_of_freedom
        if place in there:
            raise InputError(
                f"{file}: channels {there[place]} and {channel.name} are both at {place}; name one of them "
                "(excitations, responses), or give a table that says where they were (points)"
            )
        there[place] = channel.name


@dataclass(frozen=True)
class LateAnswers:
    """Powers of the responses to one tap, under one Hann window of half a segment, averaged over the taps of a point.

    Parameters
    ----------
    places
        Degrees of freedom of the responses.
    n_taps, n_earlier
        Number of taps averaged, and number of those that follow another tap.
    middle, last : (n_lines, n_responses)
        Power in the middle and in the last half of the segment.
    whole : (2 n_lines - 1, n_responses)
        Power of the whole segment, without a window.
    coherence : (n_lines, n_responses)
        Coherence of force and response in the last half.
    earlier, rest : (n_lines, n_responses)
        Power in the half segment before a tap that follows another one, and before a recording's first tap; 0: not
        recorded.
    quiet_known
        Whether a recording holds half a segment before its first tap.
    force : (n_lines,)
        Power of the force.
    """

    places: tuple[str, ...]
    n_taps: int
    n_earlier: int
    middle: Real
    last: Real
    whole: Real
    coherence: Real
    earlier: Real
    rest: Real
    quiet_known: bool
    force: Real


def late_answers(found: Sequence[FoundTaps], settings: TapSettings) -> list[LateAnswers]:
    """Average the late responses for each point that was hit and each set of responses.

    Parameters
    ----------
    found
        Usable taps of all tests.
    settings
        Segments; their exponential window is not applied.
    """
    sums: dict[tuple[str, tuple[str, ...]], _Sums] = {}
    for each in found:
        places = tuple(channel.degree_of_freedom for channel in each.test.responses)
        for number, samples in segments_of(each, settings, before=settings.length // 2):
            column = each.taps[number].tap.channel
            key = (each.test.excitations[column].degree_of_freedom, places)
            if key not in sums:
                sums[key] = _Sums(settings, len(places))
            sums[key].add(
                samples[:, column],
                samples[:, len(each.test.excitations) :],
                follows=number > 0,
                recorded=each.taps[number].place >= settings.length // 2,
            )
    return [one.average(places) for (_, places), one in sums.items()]


class _Sums:
    """Running sums over the taps of one point."""

    def __init__(self, settings: TapSettings, n_responses: int) -> None:
        self._settings, self._half = settings, settings.length // 2
        n_lines = self._half // 2 + 1
        self._window = scipy.signal.windows.hann(self._half, sym=False)[:, None]
        self._cut = np.ones(settings.length)
        if settings.force_samples is not None:
            duration = settings.force_samples / settings.sample_rate
            self._cut = force_window(settings.length, settings.sample_rate, duration)
        self._cross = np.zeros((n_lines, n_responses), complex)
        self._middle, self._last, self._earlier, self._rest = (np.zeros((n_lines, n_responses)) for _ in range(4))
        self._whole = np.zeros((self._half + 1, n_responses))
        self._force = np.zeros(n_lines)
        self._n = self._n_earlier = self._n_rest = 0

    def add(self, force: Real, answer: Real, *, follows: bool, recorded: bool) -> None:
        """One tap: half a segment before it, and the segment; whether another tap came before, and what is before."""
        half, quarter = self._half, len(answer) - self._half - self._half // 2
        drive = np.fft.rfft(force[half:] * self._cut)[::2, None][: len(self._last)]
        last = np.fft.rfft(answer[-half:] * self._window, axis=0)
        quiet = _power(answer[self._settings.before : half + self._settings.before] * self._window)
        self._cross += last * drive.conj()
        self._last += np.abs(last) ** 2
        self._middle += _power(answer[quarter : quarter + half] * self._window)
        self._whole += _power(answer[half:])
        self._force += np.abs(drive[:, 0]) ** 2
        self._n += 1
        if follows:
            self._earlier += quiet
            self._n_earlier += 1
        elif recorded:
            self._rest += quiet
            self._n_rest += 1

    def average(self, places: tuple[str, ...]) -> LateAnswers:
        """Give the powers for one tap."""
        both = self._last * self._force[:, None]
        coherence = np.abs(self._cross) ** 2 / np.where(both > 0, both, 1.0)
        return LateAnswers(
            places,
            self._n,
            self._n_earlier,
            self._middle / self._n,
            self._last / self._n,
            self._whole / self._n,
            coherence,
            self._earlier / max(1, self._n_earlier),
            self._rest / max(1, self._n_rest),
            self._n_rest > 0,
            self._force,
        )


def _power(samples: Real) -> Real:
    return np.asarray(np.abs(np.fft.rfft(samples, axis=0)) ** 2)
