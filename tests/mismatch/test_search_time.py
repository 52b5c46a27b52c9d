"""A search that has lasted long enough judges what it has found, and says that more may have been missed."""

from inspect import signature

import numpy as np
import pytest
from one_mode_rig import Rig

from millfrf.mismatch import SearchSettings, Settings, diagnose
from millfrf.steps.diagnose import diagnose as command


@pytest.mark.long
def test_a_search_without_time_tells_what_it_has() -> None:
    """One round is made in any case: the law of that round is proved as usual."""
    rig = Rig(response="displacement").stiffened(0.3, 60.0)
    recordings = rig.recordings((20.0, 40.0, 60.0))
    stages: list[str] = []
    hurried = diagnose(rig.model, recordings, Settings(search=SearchSettings(longest=0.0)), stages.append)
    assert [one.name for one in hurried.physics] == ["stiffness_hardening"]
    assert hurried.improvement.after < 0.1 * hurried.improvement.before
    assert "causes, round 1" in stages
    assert "causes, round 2" not in stages
    assert "causes of implausible modes" not in stages
    assert any("ended after 0 s" in doubt for doubt in hurried.doubts)


def test_a_search_in_time_says_nothing_of_it() -> None:
    rig = Rig(response="displacement")
    found = diagnose(rig.model, rig.recordings((20.0, 40.0), 15.0))
    assert np.isfinite(found.improvement.after)
    assert not any("ended after" in doubt for doubt in found.doubts)


def test_the_command_gives_the_usual_time() -> None:
    assert signature(command).parameters["search_time"].default == SearchSettings().longest
