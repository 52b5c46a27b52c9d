"""Auxiliary devices fail softly: what a feed raises is logged, and steps of its clock are told from a busy host."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import HOST_AXIS, Block, Channel, Events, Recording, StreamDescription, WithFeeds, record
from acquisition.sources.source import Disconnected
from acquisition.sources.timing import StampedValue, SteadyStamps
from millfrf.command_line import run
from millfrf.core import InputError
from millfrf.steps.recording.acquire import open_session, record_session

STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
REPLAY = '[device]\ndriver = "replay"\nfile = "whole.h5"\nspeed = 1.0\n'


class Clockwork:
    """Blocks of 50 ms in real time; ends by itself, or with an error."""

    title, setup, streams, n_samples = "", "", (STREAM,), None

    def __init__(self, n_blocks: int, error: Exception | None = None) -> None:
        self.n_blocks, self.error, self.done = n_blocks, error, 0

    def open(self) -> None:
        self.started, self.done = time.monotonic(), 0

    def read(self) -> Block | None:
        if self.done == self.n_blocks:
            if self.error is not None:
                raise self.error
            return None
        self.done += 1
        due = self.started + self.done * 0.05
        time.sleep(max(0.0, due - time.monotonic()))
        return Block("main", (self.done - 1) * 50, np.ones((50, 1)), due)

    def close(self) -> None:
        pass


class Frail:
    """A feed that fails at every poll of some numbers, and cannot be opened for some attempts after that."""

    where = "frail device"

    def __init__(self, fails_at: Sequence[int], error: Exception, closed_for: int = 2) -> None:
        self.event_series = {"speed": HOST_AXIS}
        self.fails_at, self.error, self.closed_for = set(fails_at), error, closed_for
        self.polls, self.refused = 0, 0

    def open(self) -> None:
        if self.polls and self.refused < self.closed_for:
            self.refused += 1
            raise Disconnected("frail device: still gone")
        self.refused = 0

    def poll(self) -> list[Events]:
        self.polls += 1
        if self.polls in self.fails_at:
            raise self.error
        return [Events("speed", np.array([time.monotonic()]), np.array([float(self.polls)]))]

    def close(self) -> None:
        pass


@pytest.mark.long
@pytest.mark.parametrize(
    ("error", "words"),
    [
        (Disconnected("frail device is gone; check its plug"), "(is gone)"),
        (AttributeError("'NoneType' object has no attribute 'recv'"), "(AttributeError: 'NoneType' object has no"),
        (ValueError(), "(ValueError"),
    ],
)
def test_no_error_of_an_auxiliary_device_ends_the_cut(tmp_path: Path, error: Exception, words: str) -> None:
    feed = Frail([5, 20], error)
    record(WithFeeds(Clockwork(40), [feed], retry=0.1), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 2000)
        log = recording.events["devices"]
        times, codes = log.read()
        assert codes.tolist() == [0.0, 1.0, 0.0, 1.0]
        assert words in log.read_texts()[0]
        assert (np.diff(times)[::2] > 0.15).all()  # two attempts failed
        assert len(recording.events["speed"].read()[0]) > 10


def test_a_device_that_is_missing_is_told_before_the_cut(tmp_path: Path) -> None:
    feed = Frail([], ValueError())
    feed.polls = 1
    with pytest.raises(Disconnected, match="still gone"):
        record(WithFeeds(Clockwork(4), [feed]), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().n_samples == 0


def test_the_main_device_ends_the_recording_and_the_last_events_are_kept(tmp_path: Path) -> None:
    gone = Disconnected("NI gone; check its plug")
    with pytest.raises(Disconnected, match="NI gone"):
        record(WithFeeds(Clockwork(6, gone), [Frail([2], ValueError("x"))], retry=0.01), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (False, 300)
        assert recording.events["devices"].read()[1].tolist() == [0.0, 1.0]
        assert len(recording.events["speed"].read()[0]) >= 4


@pytest.mark.long
def test_acquire_and_inspect_tell_what_was_lost(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(Clockwork(20), tmp_path / "whole.h5")
    (tmp_path / "s.toml").write_text(REPLAY)
    opened = open_session(tmp_path / "s.toml")
    source = WithFeeds(opened.source, [Frail([1], Disconnected("frail device is gone; x"), closed_for=1000)], retry=0.1)
    tally = record_session(replace(opened, source=source), tmp_path / "a.h5")
    [loss] = tally.device_summary().losses
    begun = loss.removeprefix("frail device: lost (is gone) at ").removesuffix(" s, not back until the end")
    assert float(begun) == pytest.approx(0.5, abs=0.2)  # after the first block
    assert run(["inspect", str(tmp_path / "a.h5")]) == 0
    said = capsys.readouterr().out
    assert "warning: frail device: lost (is gone) at " in said
    assert "nothing looks wrong" not in said


def test_a_session_that_is_stopped_lets_its_devices_say_their_last_words(tmp_path: Path) -> None:
    class Talkative(Frail):
        def reopen(self) -> None:
            self.open()

        def drop(self) -> None:
            pass

        def notes(self) -> list[tuple[float, str]]:
            return self.told

        def conclude(self) -> None:
            self.told = [(time.monotonic(), "frail device: 3 packets were lost")]

        stated: list[tuple[float, str]] = []  # noqa: RUF012

    record(Clockwork(20), tmp_path / "whole.h5")
    (tmp_path / "s.toml").write_text(REPLAY)
    opened = open_session(tmp_path / "s.toml")
    inner = WithFeeds(opened.source, [Talkative([], ValueError())])
    source = WithFeeds(inner, [])
    tally = record_session(replace(opened, source=source), tmp_path / "a.h5", stop=lambda: source._source._feeds != ())
    assert tally.device_summary().notices[0].startswith("frail device: 3 packets were lost (")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        assert recording.events["devices"].read_texts() == ("frail device: 3 packets were lost",)


def test_two_feeds_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match="speed comes from two devices"):
        WithFeeds(Clockwork(1), [Frail([], ValueError()), Frail([], ValueError())])


def _steadied(stamps: np.ndarray, arrivals: np.ndarray, announced: dict[int, float]) -> tuple[np.ndarray, list[float]]:
    guard = SteadyStamps()
    clear = []
    for k, (stamp, arrival) in enumerate(zip(stamps, arrivals, strict=True)):
        if k in announced:
            guard.announce(announced[k], float(arrival))
        clear += guard.add(StampedValue("s", float(k), float(stamp), float(arrival)))
    clear += guard.flush()
    clear.sort(key=lambda one: one.value)
    assert [one.value for one in clear] == list(range(len(stamps)))
    return np.array([one.stamp for one in clear]), [size for _, size in guard.steps()]


@given(
    seed=st.integers(0, 500),
    step=st.floats(0.15, 1e9) | st.floats(-1e9, -0.15) | st.just(0.0),
    at=st.integers(50, 500),
    known=st.booleans(),
)
def test_a_step_of_a_devices_clock_is_taken_out_and_a_busy_host_is_none(
    seed: int, step: float, at: int, known: bool
) -> None:
    """Sixty seconds of messages, ten a second, most of them prompt and some held back by a host that stalls."""
    generator = np.random.default_rng(seed)
    true = 100.0 + 0.1 * np.arange(600)
    late = generator.exponential(2e-4, 600)
    for start in generator.integers(10, 590, 6):
        if abs(start - at) > 30:
            late[start : start + 10] += np.maximum(0.8 - (true[start : start + 10] - true[start]), 0)
    stamps = true * (1 + 50e-6) + 7e5 + np.where(np.arange(600) >= at, step, 0.0)
    steady, steps = _steadied(stamps, true + late, {at: step} if known and step else {})
    assert np.abs(steady - 7e5 - true * (1 + 50e-6)).max() < 0.01
    assert steps == ([pytest.approx(step, abs=0.01)] if step else [])
