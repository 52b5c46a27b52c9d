"""Checks of hammer tests."""

import os
import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from acquisition import Stream, opened
from estimation import Decay, FoundTaps, Frf, MergedTaps, TapSettings, TapTest, begins_with_recording, find_taps
from millfrf.core import InputError, listed

from .frfs import check_frf
from .passivity import POWERS, DrivePoint, checked_lines, drive_point_delay, drive_points
from .recordings import check_channels, warnings_of
from .settings import GATE
from .signal_faults import MAINS_HUM, hum_warnings
from .signals import ChannelLevel


def check_tap_recordings(paths: Sequence[str | os.PathLike[str]], tests: Sequence[TapTest]) -> list[str]:
    """Check the channels that hammer tests take from their recordings, as :func:`check_recordings` does.

    Clipped, missing or repeated samples give no warning, because taps that contain them are rejected with a reason; nor
    does mains hum, which :func:`tap_test_warnings` judges.
    ``tests`` are the hammer tests in the recordings ``paths``, one or more in each recording.
    """
    names = {
        str(test.path): (
            [channel.name for channel in test.excitations],
            [channel.name for channel in test.responses],
        )
        for test in tests
    }
    return check_channels(paths, lambda source: names[str(source.path)], tests[0].stream, True, hum=False)


def check_taps_found(recordings: Sequence[FoundTaps]) -> None:
    """Refuse a recording without taps, or a point without a usable tap (:func:`check_taps_used`).

    Raises
    ------
    InputError
        With the file, and what it contains: a cut, a shaker, noise, or taps that are all rejected.
    """
    for recording in recordings:
        channels = ", ".join(channel.name for channel in recording.test.excitations)
        if not recording.taps:
            raise InputError(
                f"{recording.test.path.name}: no tap found: the force on {channels} nowhere exceeds its own noise by "
                "twelve standard deviations; check the hammer's channel, or leave the file out"
            )
        if recording.busy > GATE.tap_busy_max:
            raise InputError(
                f"{recording.test.path.name}: no taps of a hammer: the force on {channels} exceeds a fifth of its "
                f"largest value during {100 * recording.busy:.0f} % of the time, as in a cut or under a shaker; use "
                "'millfrf estimate'"
            )
    check_taps_used(recordings)


def check_taps_used(recordings: Sequence[FoundTaps]) -> list[str]:
    """Refuse a recording in which no tap can be used, unless others measured the same points.

    A triggered analyser writes each tap to a file of its own, so that one double hit is a file without a usable tap.

    Returns
    -------
    list of str
        One warning for each recording that is left out.

    Raises
    ------
    InputError
        With the file and the reasons, the most frequent first.
    """
    warnings = []
    for recording in recordings:
        if recording.used:
            continue
        reason, remedy = _without_usable_tap(recording)
        if not any(_measures_the_same(other, recording) for other in recordings if other.used):
            raise InputError(f"{reason}; {remedy}")
        warnings.append(f"{reason}; the file is left out, because others measured the same points")
    return warnings


def _without_usable_tap(recording: FoundTaps) -> tuple[str, str]:
    """State why no tap of a recording can be used, and a remedy."""
    reasons = Counter(_kind(tap.reason) for tap in recording.taps).most_common(3)
    first = next(tap for tap in recording.taps if _kind(tap.reason) == reasons[0][0])
    counts = ", ".join(f"{count} x {reason}" for reason, count in reasons)
    number = len(recording.taps)
    none = f"none of its {number} taps can be used" if number > 1 else "its only tap cannot be used"
    at = f"the first at {recording.time(first):.3f} s, {first.reason}"
    return f"{recording.test.path.name}: {none} ({counts}; {at})", _remedy(reasons[0][0])


def _measures_the_same(other: FoundTaps, recording: FoundTaps) -> bool:
    """Return whether the usable taps of another recording hit the same points and have the same responses."""

    def hit(taps: FoundTaps) -> set[str]:
        judged = taps.used or taps.taps
        return {taps.test.excitations[each.tap.channel].degree_of_freedom for each in judged}

    def responses(taps: FoundTaps) -> set[str]:
        return {channel.degree_of_freedom for channel in taps.test.responses}

    return hit(other) >= hit(recording) and responses(other) >= responses(recording)


def _kind(reason: str) -> str:
    """Return the beginning of a reason without its numbers, so that equal reasons can be counted."""
    return re.split(r":| after | \d", reason)[0]


def _remedy(reason: str) -> str:
    if reason.startswith(("the next hit", "the recording ends")):
        return "give a shorter --segment, or tap more slowly"
    if reason.startswith("too early"):
        return "record some time before the first tap"
    if reason.startswith("overload"):
        return "choose a larger range of that input and tap again"
    return "tap again, or leave the file out"


def tap_test_warnings(
    merged: MergedTaps,
    recordings: Sequence[FoundTaps],
    settings: TapSettings,
    decay: Decay,
) -> list[str]:
    """Return warnings about an FRF of hammer tests, one sentence each."""
    return [
        *_of_beginnings(recordings, settings),
        *_of_peaks(recordings),
        *_of_averages(merged.frf),
        *_of_ringing(settings, decay),
        *_of_hum(recordings, settings, decay),
        *_of_points(merged, recordings),
        *_of_disagreement(merged),
        *_of_coherence(merged.frf),
        *_of_delays(merged.frf),
        *warnings_of(check_frf, merged.frf, "the FRF"),
    ]


def _of_beginnings(recordings: Sequence[FoundTaps], settings: TapSettings) -> list[str]:
    names = [
        test.test.path.name for test in recordings if any(begins_with_recording(tap, settings) for tap in test.taps)
    ]
    if not names:
        return []
    return [
        f"{listed(names)}: the tap begins with the recording, so that the zero of each channel is taken from its end; "
        "record some time before the taps"
    ]


def _of_peaks(recordings: Sequence[FoundTaps]) -> list[str]:
    """Warn of taps that no hammer makes."""
    peaks = {each.test.path.name: max(abs(tap.tap.peak) for tap in each.used) for each in recordings}
    large = {name: peak for name, peak in peaks.items() if peak > GATE.hammer_max}
    if not large:
        return []
    return [
        f"{listed(list(large))}: taps of up to {1e-3 * max(large.values()):.0f} kN, more than hammers measure (22 kN): "
        "correct the unit or the sensitivity of the force, of which each limit is a multiple"
    ]


def _of_averages(frf: Frf) -> list[str]:
    assert frf.averages is not None
    averages = frf.averages if frf.measured is None else frf.averages[frf.measured]
    single = int((averages < 2).sum())
    if not single:
        return []
    return [
        f"{single} of {averages.size} entries rest on a single tap: they have no coherence, and their noise can "
        "only be judged from neighbouring lines; tap each point three times or more"
    ]


def _of_ringing(settings: TapSettings, decay: Decay) -> list[str]:
    warnings = []
    tau = settings.time_constant
    # the exponential window shrinks what is cut off at the segment's end
    cut_off = decay.left * (1.0 if tau is None else np.exp(-settings.duration / tau))
    if cut_off > GATE.cut_off_max:
        warnings.append(
            f"{100 * cut_off:.0f} % of the response at {decay.frequency:.4g} Hz on {decay.response} remains at the end "
            f"of the segment of {settings.duration:.4g} s and is cut off: the FRF has an error of this size there; "
            "leave --exponential auto, or give longer segments"
        )
    if decay.before > GATE.ringing_max:
        warnings.append(
            f"{100 * decay.before:.0f} % of the response to one tap still rings when the next tap comes; wait longer "
            "between taps"
        )
    return warnings


def subtracted_hum(recordings: Sequence[FoundTaps]) -> list[str]:
    """Name the mains hum that was subtracted: a fault of the measurement, but none of the FRF that it leaves."""
    subtracted: dict[str, list[str]] = {}
    for recording in recordings:
        if tones := _tones(recording):
            listed = ", ".join(f"{name} at {line:.2f} Hz" for name, line in tones)
            subtracted.setdefault(listed, []).append(recording.test.path.name)
    return [
        f"{', '.join(dict.fromkeys(files))}: {MAINS_HUM} in {listed}: a steady tone that was there before the first "
        "tap; it was fitted before and between the taps, and subtracted: check shields and grounds"
        for listed, files in subtracted.items()
    ]


def _tones(recording: FoundTaps) -> list[tuple[str, float]]:
    """Return channels and frequencies (Hz) of the hum that was subtracted."""
    return [
        (name, tone.frequency)
        for tone in recording.tones
        for name, amplitude in zip(recording.test.names, tone.amplitudes, strict=True)
        if amplitude
    ]


def _of_hum(recordings: Sequence[FoundTaps], settings: TapSettings, decay: Decay) -> list[str]:
    """Name lines that were there before the taps and remain."""
    remaining = []
    for recording in recordings:
        with opened(recording.test.path) as source:
            texts = hum_warnings(source.stream(recording.test.stream), recording.test.names, _tones(recording))
            remaining += [f"{recording.test.path.name}: {text}" for text in texts]
    mains = np.outer(GATE.hum, np.arange(1, GATE.hum_harmonics + 1))
    spacing = 2 / settings.duration  # of the lines of half a segment
    hum = [line for line in decay.hum if not (remaining and np.abs(mains - line).min() <= spacing)]
    if hum:
        lines = ", ".join(f"{line:.4g}" for line in hum[:5]) + (" ..." if len(hum) > 5 else "")
        remaining.append(
            f"hum at {lines} Hz was there before the taps: it is no ringing and asks for no window, but the FRF is off "
            "on these lines; ground the sensor, or tap more often and fit a band without them"
        )
    return remaining


def _of_points(merged: MergedTaps, recordings: Sequence[FoundTaps]) -> list[str]:
    warnings = []
    hit = {
        recording.test.excitations[used.tap.channel].degree_of_freedom
        for recording in recordings
        for used in recording.used
    }
    idle = {channel.degree_of_freedom for recording in recordings for channel in recording.test.excitations} - hit
    if idle:
        warnings.append(f"no tap hit {', '.join(sorted(idle))}: the FRF has no column for it")
    unnamed = [label for label in (*merged.frf.excitations, *merged.frf.responses) if ":" not in label]
    if unnamed:
        warnings.append(
            f"the position of {', '.join(unnamed[:5])}{' ...' if len(unnamed) > 5 else ''} is not known: the FRF "
            "carries the channel's name; give --point or --points"
        )
    ends = {label: 0.0 if band is None else band[1] for label, band in merged.bands.items()}
    widest = max(ends, key=lambda label: ends[label])
    narrow = [label for label, end in ends.items() if end < GATE.tap_narrow * ends[widest]]
    if narrow:
        warnings.append(
            f"the force at {', '.join(narrow[:5])}{' ...' if len(narrow) > 5 else ''} drives up to "
            f"{ends[narrow[0]]:.4g} Hz only, that at {widest} up to {ends[widest]:.4g} Hz: the FRF's band ends with "
            "the lowest; hit every point with the same tip"
        )
    return warnings


def _of_disagreement(merged: MergedTaps) -> list[str]:
    if not merged.disagreements or merged.disagreements[0].share < GATE.disagreement_max:
        return []
    worst = merged.disagreements[0]
    return [
        f"{worst.test} and the other files disagree on {worst.response} / {worst.excitation} "
        f"({100 * np.sqrt(worst.share):.0f} % off their average): was the same point hit, and was the sensor there?"
    ]


def _of_coherence(frf: Frf) -> list[str]:
    if frf.coherence is None:
        return []
    in_band = frf.valid & (frf.frequencies > 0)
    if frf.band is not None:
        in_band &= (frf.frequencies >= frf.band[0]) & (frf.frequencies <= frf.band[1])
    median = np.nan_to_num(np.median(frf.coherence[in_band], axis=0), nan=1.0)
    poor = np.argwhere(median < GATE.tap_coherence_min)
    if not len(poor):
        return []
    p, q = poor[int(np.argmin(median[tuple(poor.T)]))]
    return [
        f"the coherence of {len(poor)} of {median.size} entries is below {GATE.tap_coherence_min:g} on half of the "
        f"band's lines (lowest: {frf.responses[p]} / {frf.excitations[q]}, median {median[p, q]:.2f}); hit "
        "harder, or average more"
    ]


def _of_delays(frf: Frf) -> list[str]:
    """Return warnings about responses that are late or early at their drive points."""
    points = [point for node in drive_points(frf.responses, frf.excitations).values() for point in node]
    return [text for point in points if frf.quantity in POWERS and (text := _delayed(frf, point))]


def _delayed(frf: Frf, point: DrivePoint) -> str | None:
    """Return a warning if a response is late or early at its drive point by an angle that would shift a limit."""
    delay = drive_point_delay(frf, point)
    highest = float(frf.frequencies[checked_lines(frf)][-1])
    if delay is None or 2 * np.pi * highest * abs(delay) < GATE.delay_angle:
        return None
    angle = 360 * highest * abs(delay)
    return (
        f"{frf.responses[point.row]} is at least {1e3 * abs(delay):.3g} ms {'late' if delay > 0 else 'early'} for the "
        f"force at {frf.excitations[point.column]} ({angle:.0f}° at {highest:.4g} Hz, where a passive structure "
        "returns no power): do both channels have one filter and one clock? State input_delay_s, or measure again"
    )


def double_hit_warnings(stream: Stream, levels: Sequence[ChannelLevel]) -> list[str]:
    """Return one warning for each force channel with double hits."""
    warnings = []
    for level in levels:
        if level.channel.quantity != "force" or stream.duration > GATE.tap_record_max or level.n_missing:
            continue
        if level.deviation == 0 or level.peak < GATE.tap_peak * level.deviation:
            continue
        force = np.concatenate([block[:, 0] for block in stream.blocks(channels=[level.channel.name])])
        taps = find_taps(force, stream.sample_rate)
        double = [tap for tap in taps if tap.second_hit is not None]
        if double:
            times = ", ".join(f"{stream.start_time + tap.time:.3f} s" for tap in double[:5])
            warnings.append(
                f"{level.channel.name}: {len(double)} of {len(taps)} taps hit twice (at {times}; the first after "
                f"{1e3 * (double[0].second_hit or 0):.1f} ms with {100 * double[0].second_share:.0f} %); "
                "'millfrf tap' leaves them out"
            )
    return warnings
