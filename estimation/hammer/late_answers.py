"""Spectra of answers in the middle and in the last half of their segments, averaged over the taps of a point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import hann

from .cutting_out import segments_of
from .screening import FoundTaps
from .segments import TapSettings
from .windows import force_window

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


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
        self._window = hann(self._half, sym=False)[:, None]
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
