"""A recording whose samples the host's clock contradicts is refused or doubted, wherever it is used."""

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition import Block, Channel, Recording, RecordingWriter, StreamDescription, record
from acquisition.sources.source import Overrun
from millfrf.command_line import run

CHANNELS = (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X"))
STREAM = StreamDescription("daq", 1024.0, 0.0, CHANNELS)


def recording(path: Path, true_rate: float = 1024.0, gap: float = 0.0) -> Path:
    """Thirty seconds in blocks of a tenth of a second, with the host's time of each."""
    generator = np.random.default_rng(1)
    with RecordingWriter(path, [STREAM]) as writer:
        for k in range(300):
            force = generator.standard_normal(102)
            writer.append("daq", np.column_stack([force, 0.1 * force + 0.1 * generator.standard_normal(102)]))
            time = 102 * (k + 1) / true_rate + (gap if k > 150 else 0.0)
            writer.append_clock_pair("daq", 102 * (k + 1), 77.0 + time + generator.exponential(1e-3))
    return path


def test_a_wrong_rate_is_refused_by_jobs_and_told_by_inspect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = recording(tmp_path / "a.h5", true_rate=921.6)
    words = "has a sample rate of 921.6 Hz by the computer that recorded it, and the file says 1024 Hz (-10 %)"
    assert run(["estimate", str(path), "--out", str(tmp_path / "frf.h5")]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "frf.h5").exists()
    run(["inspect", str(path)])
    assert words in " ".join(capsys.readouterr().out.split())
    assert run(["convert", str(path), str(tmp_path / "b.h5")]) == 0
    said = capsys.readouterr()
    assert words in " ".join((said.out + said.err).split())


def test_a_gap_is_a_doubt_that_the_result_keeps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = recording(tmp_path / "a.h5", gap=0.5)
    assert run(["estimate", str(path), "--out", str(tmp_path / "frf.h5")]) == 0
    words = "0.5 s are missing after 15.04 s by the computer that recorded it"
    said = capsys.readouterr()
    assert words in " ".join((said.out + said.err).split())
    run(["inspect", str(tmp_path / "frf.h5")])
    assert words in " ".join(capsys.readouterr().out.split())


def test_a_sound_clock_says_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(["inspect", str(recording(tmp_path / "a.h5"))])
    assert "recorded it" not in capsys.readouterr().out


class Dropping:
    """A driver that loses two seconds of blocks and says so only by the number of the next block's first sample."""

    title, setup, streams, n_samples = "dropping", "", (STREAM,), None

    def __init__(self, lost: int) -> None:
        self.lost, self.count = lost, 0

    def open(self) -> None:
        self.count = 0

    def read(self) -> Block | None:
        self.count += 1
        first = 102 * (self.count - 1) + (self.lost if self.count > 50 else 0)
        return Block("daq", first, np.ones((102, 2)), 0.1 * self.count) if self.count < 100 else None

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("lost", "words"),
    [(2048, "2048 samples are missing after sample 5100"), (-102, "the driver gives samples twice")],
)
def test_blocks_that_do_not_follow_end_the_recording(tmp_path: Path, lost: int, words: str) -> None:
    with pytest.raises(Overrun, match=words):
        record(Dropping(lost), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as kept:
        assert kept.stream().n_samples == 5100
        assert words in kept.ending
        assert json.dumps(kept.complete) == "false"
