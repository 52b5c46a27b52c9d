"""Long recordings: what needs all of them at once is refused before it starts, and a part can be cut out."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, Events, Recording, RecordingWriter, Stream, StreamDescription
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError, require_memory

RATE, N = 100.0, 4000


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """40 s of two channels that begin at 5 s, with a slow series and clock pairs."""
    channels = (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X"))
    path = tmp_path / "rec.h5"
    with RecordingWriter(path, [StreamDescription("main", RATE, 5.0, channels)], event_names=["speed"]) as writer:
        writer.append("main", np.arange(2.0 * N).reshape(N, 2))
        writer.append_clock_pairs("main", np.array([[0.0, 100.0], [2000.0, 120.0], [4000.0, 140.0]]))
        writer.append_events(Events("speed", np.array([6.0, 16.0, 44.0]), np.array([1.0, 2.0, 3.0])))
    return path


def test_a_part_is_cut_out_with_its_events_and_clock(recording: Path, tmp_path: Path) -> None:
    assert run(["convert", str(recording), str(tmp_path / "part.h5"), "--span", "10", "30"]) == DONE
    with Recording(tmp_path / "part.h5") as part:
        stream = part.stream()
        assert (stream.start_time, stream.n_samples) == (15.0, 2000)
        np.testing.assert_array_equal(stream.read(), np.arange(2.0 * N).reshape(N, 2)[1000:3000])
        np.testing.assert_array_equal(part.clock_pairs("main"), [[1000.0, 120.0]])
        np.testing.assert_array_equal(part.events["speed"].read(), [[16.0], [2.0]])


@pytest.mark.parametrize("span", [("30", "10"), ("-1", "2"), ("50", "60")])
def test_a_part_that_is_not_there_is_refused(
    span: tuple[str, str], recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = recording.with_name("part.h5")
    assert run(["convert", str(recording), str(out), "--span", *span]) == BAD_INPUT
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()


def test_npz_is_written_block_by_block_as_numpy_writes_it(recording: Path, tmp_path: Path) -> None:
    assert run(["convert", str(recording), str(tmp_path / "rec.npz")]) == DONE
    with np.load(tmp_path / "rec.npz", allow_pickle=False) as archive:
        assert archive["samples"].dtype == np.float32
        np.testing.assert_array_equal(archive["samples"], np.arange(2.0 * N).reshape(N, 2))
        assert str(archive["stream"]) == "main"
    assert run(["convert", str(tmp_path / "rec.npz"), str(tmp_path / "back.h5")]) == DONE


def test_an_archive_that_unpacks_to_gigabytes_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Before: 5.8 MB took above 9.4 GB."""
    bomb = tmp_path / "bomb.npz"
    zeros = bytes(1 << 20)
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("x.npy", "w") as entry:
        header = {"descr": "<f8", "fortran_order": False, "shape": (500 << 17, 1)}
        np.lib.format.write_array_header_1_0(entry, header)
        for _ in range(500):
            entry.write(zeros)
    assert run(["convert", str(bomb), str(tmp_path / "out.h5")]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "unpacks to 524288" in said
    assert "MILLFRF_MEMORY_GB=2" in said


@pytest.mark.parametrize(
    "words",
    [
        "chatter steady.h5 --cutting cut.toml --speed 800 --out out.json",
        "predict model_tip.json steady.h5 --out out.h5",
        "diagnose model_tip.json steady.h5 --out out",
        "cut diagnose cut.toml steady.h5 --depth 0.001 --speed 800 --out out",
        "fit up.h5 down.h5 central.h5 --band 13 30 --out out.json",
        "tap tap_x.h5 tap_y.h5 tap_z.h5 --out out.h5",
        "estimate up.h5 down.h5 central.h5 --estimator local-polynomial --band 13 30 --out out.h5",
        "convert up.h5 out.mat",
    ],
)
def test_what_takes_too_much_memory_is_refused_before_it_starts(
    words: str, inputs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(inputs)
    monkeypatch.setenv("MILLFRF_MEMORY_GB", "0.00005")
    read: list[str] = []
    for name in ("read", "blocks"):
        monkeypatch.setattr(Stream, name, lambda self, *words, **more: read.append(self.path.name))
    assert run(words.split()) == BAD_INPUT
    assert not read
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "GB are allowed" in said
    assert "--span" in said
    assert not (inputs / words.split()[-1]).exists()


@pytest.mark.parametrize("value", ["", "much", "-1", "nan"])
def test_an_allowance_that_is_no_number_is_refused(value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MILLFRF_MEMORY_GB", value)
    with pytest.raises(InputError, match="MILLFRF_MEMORY_GB is"):
        require_memory(1.0, "a", "b")
