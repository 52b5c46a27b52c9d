"""A campaign in one process: its numbers are those of the commands, and a second run computes what changed, no more."""

from pathlib import Path

import numpy as np
import pytest

from estimation import read_frf
from millfrf.__main__ import run
from millfrf.campaign import RunOptions, RunSummary, run_campaign


def serial(campaign: Path, **options: bool) -> RunSummary:
    return run_campaign(campaign, RunOptions(campaign.parent / "out", workers=0, **options))


def result(found: RunSummary, identity: str) -> Path:
    from millfrf.campaign.running import folder_of

    key = found.opened.keys[identity]
    assert key is not None
    return folder_of(found.opened.out, identity.partition(":")[0], key)


@pytest.fixture
def done(campaign: Path) -> RunSummary:
    return serial(campaign)


def test_numbers_are_those_of_the_commands(done: RunSummary, campaign: Path) -> None:
    folder = campaign.parent
    words = [str(folder / "recordings" / f"P1_{one}.h5") for one in ("central", "down", "up")]
    assert run(["estimate", *words, "--segment", "4", "--out", str(folder / "frf.h5")]) == 0
    theirs, ours = read_frf(folder / "frf.h5"), read_frf(result(done, "estimate:P1") / "frf.h5")
    assert np.array_equal(ours.valid, theirs.valid)
    scale = np.abs(theirs.values[theirs.valid]).max()
    assert np.abs(ours.values - theirs.values)[theirs.valid].max() < 1e-12 * scale
    np.testing.assert_allclose(ours.multiple_coherence, theirs.multiple_coherence, rtol=1e-9)


def test_a_second_run_computes_nothing_and_a_changed_recording_only_its_own(done: RunSummary, campaign: Path) -> None:
    assert done.ran == 35
    assert serial(campaign).ran == 0
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
