"""A campaign in one process: its numbers are those of the commands, and a second run computes what changed, no more."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from estimation import read_frf
from millfrf.campaign.campaign_run import RunOptions, RunSummary, run_campaign
from millfrf.campaign.jobs import JOB_OF
from millfrf.campaign.work import Work
from millfrf.command_line import run
from millfrf.core.content_hashes import EDITED
from millfrf.core.csv_tables import read_csv
from millfrf.core.provenance import edits_of


def serial(campaign: Path, **options: bool) -> RunSummary:
    return run_campaign(campaign, RunOptions(campaign.parent / "out", workers=0, **options))


def result(found: RunSummary, identity: str) -> Path:
    from millfrf.campaign.store import folder_of

    key = found.opened.keys[identity]
    assert key is not None
    return folder_of(found.opened.out, identity.partition(":")[0], key)


@pytest.fixture(scope="module")
def first(maker: Callable[[Path], Path], tmp_path_factory: pytest.TempPathFactory) -> RunSummary:
    """The first run, which computes everything."""
    return serial(maker(tmp_path_factory.mktemp("first") / "campaign"))


@pytest.fixture
def campaign(first: RunSummary, tmp_path: Path) -> Path:
    """A copy of the campaign with all its results."""
    shutil.copytree(first.opened.base, tmp_path / "copy")
    return tmp_path / "copy" / "campaign.toml"


@pytest.fixture
def fresh(first: RunSummary, tmp_path: Path) -> Path:
    """A copy of the campaign with checks, estimates and fits alone."""
    shutil.copytree(first.opened.base, tmp_path / "fresh")
    for kind in ("calibrate", "lobes", "report"):
        shutil.rmtree(tmp_path / "fresh" / "out" / "results" / kind)
    return tmp_path / "fresh" / "campaign.toml"


@pytest.fixture
def done(campaign: Path) -> RunSummary:
    """A second run, elsewhere."""
    return serial(campaign)


def test_numbers_are_those_of_the_commands(done: RunSummary, campaign: Path) -> None:
    folder = campaign.parent
    words = [str(folder / "recordings" / f"P1_{each}.h5") for each in ("central", "down", "up")]
    assert run(["estimate", *words, "--segment", "4", "--out", str(folder / "frf.h5")]) == 0
    theirs, ours = read_frf(folder / "frf.h5"), read_frf(result(done, "estimate:P1") / "frf.h5")
    assert np.array_equal(ours.valid, theirs.valid)
    scale = np.abs(theirs.values[theirs.valid]).max()
    assert np.abs(ours.values - theirs.values)[theirs.valid].max() < 1e-12 * scale
    np.testing.assert_allclose(ours.multiple_coherence, theirs.multiple_coherence, rtol=1e-9)


def test_a_second_run_computes_nothing_and_a_changed_recording_only_its_own(
    first: RunSummary, done: RunSummary, campaign: Path
) -> None:
    assert first.ran == 35
    assert done.ran == 0
    changed = campaign.parent / "recordings" / "P1_up.h5"
    changed.write_bytes((campaign.parent / "recordings" / "P1_up.h5").read_bytes() + b"\0")
    again = serial(campaign)
    # one check, two parts, their join, estimate, fit, calibration, lobes, and the report
    assert again.ran == 9


def test_a_broken_file_is_listed_and_hides_nothing_else(done: RunSummary, campaign: Path) -> None:
    (line,) = done.failures
    assert line.startswith("check P2_broken: P2_broken.h5 is not an HDF5 file")
    assert str(campaign.parent) not in line
    assert not done.state.failed
    assert (result(done, "lobes:P2") / "lobes.csv").is_file()
    assert "left out P2_broken" in (result(done, "estimate:P2") / "outcome.json").read_text()


def test_results_between_others_may_be_deleted(done: RunSummary, campaign: Path) -> None:
    """Spectra take much room, and nobody but other tasks reads them."""
    for kind in ("spectra", "join"):
        shutil.rmtree(campaign.parent / "out" / "results" / kind)
    assert serial(campaign).ran == 0
    (result(done, "fit:P1") / "model.json").unlink()
    assert serial(campaign).ran == 1  # what was made of it is there, and is what it would be


def test_refusals_are_tried_again_on_demand(done: RunSummary, campaign: Path) -> None:
    del done
    # the broken file's check and spectra, and the estimate, fit, calibration and lobes of its set
    assert serial(campaign, retry=True).ran == 6


def test_what_fails_by_chance_is_not_kept(
    fresh: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(work: Work, folder: Path) -> list[str]:
        raise RuntimeError("by chance")

    monkeypatch.setitem(JOB_OF, "calibrate", fails)
    words = ["campaign", str(fresh), "--workers", "0", "--out", str(fresh.parent / "out")]
    assert run(words) == 1
    said = capsys.readouterr().out
    assert "failed: calibrate P1: unforeseen RuntimeError (test_run.py, line" in said
    assert "4 left for the next run" in said  # two calibrations, and the lobes that need them
    monkeypatch.undo()
    assert run(words) == 0
    assert "0 left for the next run" in capsys.readouterr().out


@pytest.mark.long
def test_a_recording_that_changes_while_the_campaign_runs_is_not_mixed_up(
    fresh: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = JOB_OF["check"]

    def changing(work: Work, folder: Path) -> list[str]:
        verdict = judge(work, folder)
        if work.files[0].name == "P1_up.h5":
            work.files[0].write_bytes(work.files[0].read_bytes() + b"0")
        return verdict

    shutil.rmtree(fresh.parent / "out" / "results")
    monkeypatch.setitem(JOB_OF, "check", changing)
    verdict = serial(fresh)
    assert verdict.state.failed["check:P1_up"] == "P1_up.h5 changed while the campaign ran; run the campaign again"
    assert verdict.state.failed["fit:P1"].startswith("not run: it needs ")
    assert verdict.state.settled["lobes:P2"] == "done"


def test_a_full_disk_ends_the_run_and_keeps_what_is_there(
    fresh: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    if sys.platform != "linux" or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk]).returncode:
        pytest.skip("only root may mount a small disk")
    try:
        words = ["campaign", str(fresh), "--workers", "0", "--out", str(disk / "out")]
        assert run(words) == 1
        said = capsys.readouterr()
        assert "free space, then run the same command again" in said.out + said.err
        assert "no room for" in said.out + said.err
        kept = len(list(disk.glob("out/results/*/*/*/outcome.json")))
        assert kept > 3
        assert run([*words[:-1], str(disk / "out")]) == 1  # and it goes on as long as there is room
        assert len(list(disk.glob("out/results/*/*/*/outcome.json"))) >= kept
    finally:
        subprocess.run(["umount", disk], check=True)


def _without_digit(path: Path) -> None:
    """Change one digit of a file, which keeps its size."""
    data = bytearray(path.read_bytes())
    place = max(k for k, byte in enumerate(data[: len(data) // 2]) if chr(byte) in "12345678")
    data[place] += 1
    path.write_bytes(data)


def test_a_damaged_result_is_named_and_made_anew(
    first: RunSummary, campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before: a digit that changed in a stored model went into the table of modes without a word."""
    spectra = next(identity for identity in first.opened.keys if identity.startswith("spectra:"))
    out, estimate = campaign.parent / "out", f"estimate:{spectra.partition(':')[2][:2]}"
    damaged = {"fit:P1": "model.json", spectra: "spectra.npz", estimate: "frf.h5", "lobes:P2": "outcome.json"}
    for identity, name in damaged.items():
        _without_digit(out / result(first, identity).relative_to(first.opened.out) / name)
    assert run(["campaign", str(campaign), "--out", str(out), "--workers", "0"]) in (0, 1)
    said = capsys.readouterr()
    for identity, name in damaged.items():
        assert f"the stored result of {identity} is not used, as {name} changed after it was written" in said.err
    assert "unforeseen" not in said.out + said.err
    again = serial(campaign)
    assert again.ran == 0
    stored = (result(again, "fit:P1") / "model.json").read_text(encoding="utf-8")
    assert stored == (result(first, "fit:P1") / "model.json").read_text(encoding="utf-8")


def test_an_edited_file_is_refused_and_with_edited_every_result_of_it_says_so(
    fresh: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with h5py.File(fresh.parent / "frf_tip.h5", "r+") as file:
        file["values"][40, 0, 0] *= 1.01
    words = ["campaign", str(fresh), "--out", str(fresh.parent / "out"), "--workers", "0"]
    assert run(words) == 0
    said = capsys.readouterr()
    refusals = [line for line in (said.out + said.err).splitlines() if "frf_tip.h5 was edited" in line]
    assert [line.partition(": frf_tip")[0] for line in refusals] == ["failed: calibrate P1", "failed: calibrate P2"]
    assert all("--edited" in line for line in refusals)
    assert run([*words, "--edited"]) == 0
    assert "5 tasks run now; 33 done, 2 refused" in capsys.readouterr().out  # two calibrations, their lobes, the report
    doubts = [row[:3] for row in read_csv(fresh.parent / "out" / "doubts.csv").rows]
    for pose in ("P1", "P2"):
        assert ("calibrate", pose, f"frf_tip.h5: {EDITED}") in doubts
    assert run(words) == 0  # the acceptance holds for one run
    assert "0 tasks run now; 29 done, 6 refused" in capsys.readouterr().out
    assert {edits_of(path) for path in (fresh.parent / "out").glob("results/calibrate/*/*/model.json")} == {
        f"made from frf_tip.h5, {EDITED}"
    }
    assert {edits_of(path) for path in (fresh.parent / "out").glob("results/lobes/*/*/*.csv")} == {
        f"made from frf_tip.h5, {EDITED}"
    }
