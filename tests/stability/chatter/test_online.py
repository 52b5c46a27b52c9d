"""Verdicts while a cut is recorded: onsets of an independent simulator, idle spindles, entries, lost samples."""

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from streamed_cuts import RATE, Stream, stream

from millfrf.stability import OnlineClassifier, StateChange, WatchedCut
from millfrf.stability.settings import THRESHOLDS

CHATTER = ("hopf", "period-doubling")


def watched(drawn: Stream) -> OnlineClassifier:
    quantities, derivatives = ("acceleration", "acceleration"), (2, 2)
    cut = WatchedCut(RATE, 2, drawn.stated_speed, drawn.cut.teeth, quantities, derivatives)
    return OnlineClassifier(cut)


def changes_of(drawn: Stream, classifier: OnlineClassifier, block: int = 512) -> list[StateChange]:
    changes = []
    for start in range(0, len(drawn.samples), block):
        changes += classifier.add(drawn.samples[start : start + block])
    return changes


@cache
def drawn_stream(number: int, seconds: float = 8.0, *, chatters: bool = True) -> Stream:
    return stream(np.random.default_rng([51, number]), seconds, chatters=chatters)


def latency(drawn: Stream, changes: list[StateChange]) -> float:
    """Time from the onset to the first alarm, s; infinite without an alarm."""
    return min((c.time - drawn.onset for c in changes if c.state in CHATTER), default=np.inf)


def longest(classifier: OnlineClassifier) -> float:
    """Return the time until windows that hold nothing but chatter must have announced it, s."""
    return classifier.window + (THRESHOLDS.online_confirmed + 1) * max(THRESHOLDS.online_hop, classifier.window / 8)


@pytest.mark.parametrize(
    "number", [12, pytest.param(2, marks=pytest.mark.long), pytest.param(7, marks=pytest.mark.long)]
)
def test_an_onset_is_announced_as_soon_as_windows_hold_it(number: int) -> None:
    drawn = drawn_stream(number)
    classifier = watched(drawn)
    changes = changes_of(drawn, classifier)
    assert 0 <= latency(drawn, changes) < longest(classifier)
    assert changes[0].state == "stable"
    [alarm] = [change for change in changes if change.state in CHATTER][:1]
    assert alarm.verdict is not None
    passing = drawn.cut.rpm / 60 * drawn.cut.teeth
    lines = np.abs(alarm.verdict.frequency + passing * np.arange(-9, 10))  # the announced line may be a side line
    assert np.abs(lines[:, None] / drawn.cut.frequencies - 1).min() < 0.2


def test_a_stable_cut_and_the_idle_spindle_raise_no_alarm() -> None:
    drawn = drawn_stream(12, chatters=False)
    states = [change.state for change in changes_of(drawn, watched(drawn))]
    assert states == ["stable", "idle"]


def test_the_size_of_blocks_does_not_matter() -> None:
    drawn = drawn_stream(12)
    by_blocks = [changes_of(drawn, watched(drawn), block) for block in (100, 4096)]
    assert [(c.time, c.state) for c in by_blocks[0]] == [(c.time, c.state) for c in by_blocks[1]]


def test_a_faster_rate_gives_the_same_states() -> None:
    drawn = drawn_stream(12)
    times = np.arange(5 * len(drawn.samples)) / 5
    faster = np.column_stack([np.interp(times, np.arange(len(drawn.samples)), column) for column in drawn.samples.T])
    cut = WatchedCut(5 * RATE, 2, drawn.stated_speed, drawn.cut.teeth, ("acceleration",) * 2, (2, 2))
    fast = OnlineClassifier(cut).add(faster)
    slow = watched(drawn).add(drawn.samples)
    assert [change.state for change in fast][:2] == [change.state for change in slow][:2]
    assert [change.time for change in fast][:2] == pytest.approx([change.time for change in slow][:2], abs=0.31)


def test_a_pump_that_starts_raises_no_alarm() -> None:
    drawn = drawn_stream(12, chatters=False)
    time = np.arange(len(drawn.samples))[:, None] / RATE
    size = drawn.samples[len(time) // 2 :][: int(RATE)].std(axis=0)
    hum = 0.5 * size * np.cos(2 * pi * 150 * time) * (time > time[-1] / 2)
    states = [change.state for change in changes_of(replace(drawn, samples=drawn.samples + hum), watched(drawn))]
    assert states[0] == "stable"
    assert not set(states) & set(CHATTER)


def test_a_sweep_of_the_speed_is_not_judged() -> None:
    drawn = drawn_stream(12)
    classifier = watched(drawn)
    for number, start in enumerate(range(0, len(drawn.samples), 1024)):
        classifier.set_speed(drawn.stated_speed * (1 + 0.01 * number))
        assert not [c for c in classifier.add(drawn.samples[start : start + 1024]) if c.state in CHATTER]
    kinds = {window.kind for window in classifier.judged()}
    assert kinds == {"sweep"}


def test_nothing_is_judged_before_a_speed_is_known() -> None:
    drawn = drawn_stream(12)
    classifier = OnlineClassifier(WatchedCut(RATE, 2, np.nan, drawn.cut.teeth))
    assert classifier.add(drawn.samples[:20480]) == []
    assert classifier.judged() == []
    classifier.set_speed(drawn.stated_speed)
    classifier.add(drawn.samples[20480:])
    assert "hopf" in {window.kind for window in classifier.judged()}


@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_samples_that_are_missing_leave_the_state_open(value: float) -> None:
    drawn = drawn_stream(12, chatters=False)
    half = len(drawn.samples) // 2
    samples = drawn.samples.copy()
    samples[half:] = value
    changes = changes_of(replace(drawn, samples=samples), watched(drawn))
    assert [change.state for change in changes] == ["stable", "undecided"]
    assert changes[-1].verdict is not None
    assert "samples are missing" in changes[-1].verdict.reason
    assert changes[-1].time * RATE - half == pytest.approx(0.5 * RATE, abs=0.6 * RATE)


def test_windows_do_not_span_lost_samples() -> None:
    drawn = drawn_stream(12, chatters=False)
    classifier = watched(drawn)
    third = len(drawn.samples) // 3
    classifier.add(drawn.samples[:third])
    classifier.forget(third + 777)
    changes = classifier.add(drawn.samples[third + 777 :])
    assert not [change for change in changes if change.state in CHATTER]
    assert classifier.judged()[-1].time == pytest.approx(len(drawn.samples) / RATE, abs=0.11)


@pytest.mark.slow
def test_thirty_onsets(capsys: pytest.CaptureFixture[str]) -> None:
    latencies, late = [], []
    for number in range(100, 130):
        drawn = drawn_stream(number, 16.0)
        classifier = watched(drawn)
        changes = changes_of(drawn, classifier)
        early = [change for change in changes if change.state in CHATTER and change.time < drawn.onset - 0.1]
        assert not early
        latencies.append(latency(drawn, changes))
        open_or_chatter = [change.time for change in changes if change.state in (*CHATTER, "undecided")]
        after = [time - drawn.onset for time in open_or_chatter if time > drawn.onset - 0.1]
        if min(after, default=np.inf) > longest(classifier):
            late.append(number)
    with capsys.disabled():
        print("latencies, s:", np.sort(np.round(latencies, 2)).tolist())
    assert not late


@pytest.mark.slow
def test_hours_of_stable_cuts(capsys: pytest.CaptureFixture[str]) -> None:
    alarms = 0
    for number in range(1100, 1160):
        drawn = drawn_stream(number, 60.0, chatters=False)
        alarms += sum(change.state in CHATTER for change in changes_of(drawn, watched(drawn)))
    with capsys.disabled():
        print("false alarms in an hour:", alarms)
    assert alarms == 0
