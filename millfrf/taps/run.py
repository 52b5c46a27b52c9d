"""The step from recordings of hammer tests to an FRF: one part after the other."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from estimation import (
    Decay,
    FoundTaps,
    Frf,
    MergedTaps,
    TapSettings,
    TapSums,
    TapTest,
    answer_decay,
    choose_segments,
    found_taps,
    merge_taps,
    placed,
    require_room_for_taps,
    screened,
    tap_sums,
    window_for,
)
from millfrf.core import Band, InputError, Result, Summary, counted, doubts_line

from ..gate import check_tap_recordings, check_taps_found, check_taps_used, doubts_of_taps
from ..progress import Progress, silent
from .options import TapOptions
from .points_of_files import tests_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class TapResult(Result):
    """An FRF of hammer tests with what it was made from.

    Parameters
    ----------
    merged
        The FRF, in the recordings' own quantity, and the band of each excitation.
    found
        Taps of each test, each with the reason where it was left out.
    settings
        Segments and windows.
    decay
        What was left of the answers at the segments' ends, before the exponential window.
    warnings
        One sentence each.
    options
        How the recordings were turned into the FRF.
    """

    merged: MergedTaps
    found: tuple[FoundTaps, ...]
    settings: TapSettings
    decay: Decay
    warnings: tuple[str, ...]
    options: TapOptions

    @property
    def frf(self) -> Frf:
        """The FRF matrix, with coherence and averages of each entry."""
        return self.merged.frf

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw entries of the FRF and return the axes; see :func:`millfrf.figures.frf.draw_frf` for the choices."""
        return self.frf.plot(axes, **choices)

    def _summary(self) -> Summary:
        frf, used = self.frf, sum(len(each.used) for each in self.found)
        shape = f"{counted(len(frf.responses), 'response')} x {counted(len(frf.excitations), 'excitation')}"
        rows = tuple((each.test.path.name, str(len(each.taps)), str(len(each.used))) for each in self.found)
        return Summary(
            f"TapResult: {used} of {counted(sum(len(each.taps) for each in self.found), 'tap')} used, {shape}",
            (
                f"frf: {frf.quantity} in {frf.unit}, {counted(len(frf.frequencies), 'line')}",
                *doubts_line(self.warnings),
            ),
            ("recording", "taps", "used"),
            rows,
        )


def tap_recordings(
    paths: Sequence[str | os.PathLike[str]], options: TapOptions, progress: Progress = silent
) -> TapResult:
    """FRF of the taps in one or many recordings.

    Raises
    ------
    InputError
        A file or option that cannot be used; recordings without a usable tap, or of different rates; entries of the
        matrix that no tap gives.
    """
    if not paths:
        raise InputError("no recording given; name at least one")
    tests = tests_of(paths, options)
    for test in tests:
        require_room_for_taps(test)
    doubts = check_tap_recordings(paths, tests, progress)
    found = _found(tests, progress)
    settings = choose_segments(
        found,
        segment=options.segment,
        pre_trigger=options.pre_trigger,
        force_window=options.force_window_seconds,
    )
    found = _screened(found, settings, progress)
    with progress("how long the answers ring"):
        decay = answer_decay(found, settings)
    asked = options.time_constant
    settings = replace(settings, time_constant=window_for(decay.left, settings) if asked is None else asked or None)
    merged = merge_taps(_sums(found, settings, options.band, progress), settings.time_constant)
    doubts += doubts_of_taps(merged, found, settings, decay)
    return TapResult(merged, tuple(found), settings, decay, tuple(dict.fromkeys(doubts)), options)


def _found(tests: Sequence[TapTest], progress: Progress) -> list[FoundTaps]:
    found = []
    with progress("finding taps", len(tests)) as update:
        for number, test in enumerate(tests):
            found.append(found_taps(test))
            update(number + 1)
    check_taps_found(found)
    return found


def _screened(found: Sequence[FoundTaps], settings: TapSettings, progress: Progress) -> list[FoundTaps]:
    judged = []
    with progress("judging taps", len(found)) as update:
        for number, each in enumerate(found):
            judged.append(screened(placed(each, settings), settings))
            update(number + 1)
    check_taps_used(judged)
    return judged


def _sums(found: Sequence[FoundTaps], settings: TapSettings, band: Band | None, progress: Progress) -> list[TapSums]:
    places = {each.test.excitations[one.tap.channel].degree_of_freedom for each in found for one in each.used}
    sums = []
    with progress("spectra of the taps", len(found)) as update:
        for number, each in enumerate(found):
            sums.append(tap_sums(each, settings, band, places))
            update(number + 1)
    return sums
