"""What a result says of its making."""

import tomllib
from pathlib import Path

from millfrf.core.provenance import origin, with_warnings
from millfrf.mismatch import Settings


def test_warnings_of_two_jobs_stand_in_one_table() -> None:
    """Before: a prediction made from a prediction had the table twice, and its set-up could not be read."""
    setup = "[tool]\nteeth = 2\n"
    once = with_warnings(setup, ["late \n samples"])
    twice = with_warnings(once, ["late samples", 'a "dead" channel'])
    assert tomllib.loads(twice) == {
        "tool": {"teeth": 2},
        "made_by_millfrf": {"warnings": ["late samples", 'a "dead" channel']},
    }
    assert with_warnings(twice, []) == twice
    behind = once + "\n[cut]\ndepth_m = 0.001\n"
    kept = tomllib.loads(with_warnings(behind, ["other"]))
    assert kept["cut"] == {"depth_m": 0.001}
    assert kept["made_by_millfrf"]["warnings"] == ["late samples", "other"]
    assert "warnings" in with_warnings("no = [toml", ["said"])


def test_options_are_told_without_addresses() -> None:
    """Equal options give equal text in every process."""
    stated = origin("diagnose", [], {"settings": Settings(), "out": Path("a") / "b"})["options"]
    assert stated["out"] == str(Path("a") / "b")
    assert stated["settings"]["lab"]["frequency"] == 0.01
    assert stated["settings"]["proof"]["test"] == "signed_ranks"
    assert " at 0x" not in str(stated)
